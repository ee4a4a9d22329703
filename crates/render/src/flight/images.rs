//! Images that a pass in flight has, or begins with.

use std::sync::Arc;

use super::super::attachments::Clearing;
use super::super::surface::{Shape, TileSurface};
use super::{Flight, lock};

/// The newest contents of an image.
#[derive(Debug)]
pub(in super::super) enum Tiles {
    /// They are here.
    Here(TileSurface),
    /// A pass in flight has them.
    Away(Away),
}

impl Tiles {
    /// Their shape.
    pub fn shape(&self) -> Shape {
        match self {
            Tiles::Here(tiles) => tiles.shape(),
            Tiles::Away(away) => away.shape(),
        }
    }

    /// The tiles; waits for the pass that draws them.
    pub fn landed(self) -> TileSurface {
        match self {
            Tiles::Here(tiles) => tiles,
            Tiles::Away(away) => away.take(),
        }
    }
}

/// An attachment of a pass in flight.
pub(in super::super) struct Away {
    pub(super) ticket: Arc<Ticket>,
    pub(super) slot: usize,
    /// A texel of which these bits are known, once the pass has ended.
    pub(super) value: [u32; 4],
    pub(super) known: [u32; 4],
}

/// As long as there is one, the images of a pass may be loaded by another, and its draws are kept.
pub(super) struct Ticket(pub(super) Arc<Flight>);

impl Drop for Ticket {
    fn drop(&mut self) {
        self.0.forget();
    }
}

impl std::fmt::Debug for Away {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "attachment {} of a pass in flight", self.slot)
    }
}

impl Away {
    pub(super) fn flight(&self) -> &Arc<Flight> {
        &self.ticket.0
    }

    /// A texel after a clear, and which bits of it are known.
    pub(super) fn after(&self, clearing: Clearing) -> ([u32; 4], [u32; 4]) {
        let value = |w: usize| self.value[w] & !clearing.mask[w] | clearing.value[w] & clearing.mask[w];
        (std::array::from_fn(value), std::array::from_fn(|w| self.known[w] | clearing.mask[w]))
    }

    /// The value of all texels after a clear, if that can be told.
    pub fn cleared(&self, clearing: Clearing) -> Option<[u32; 4]> {
        if clearing.whole {
            return Some(clearing.value);
        }
        let (value, known) = self.after(clearing);
        known[..self.shape().words()].iter().all(|&bits| bits == u32::MAX).then_some(value)
    }

    /// Its shape.
    pub fn shape(&self) -> Shape {
        self.flight().attached(self.slot).shape
    }

    /// Takes the tiles; waits for the pass.
    pub fn take(self) -> TileSurface {
        self.flight().finish();
        let tiles = lock(&self.flight().painter).tiles[self.slot].take();
        // Without tiles the pass has failed, and that is reported before anything sees this surface.
        tiles.unwrap_or_else(|| TileSurface::new(self.shape()))
    }

    /// Reads the image, as [`TileSurface::read`]; waits for the pass.
    pub fn read(&self, out: &mut [u8]) {
        self.flight().finish();
        if let Some(tiles) = &lock(&self.flight().painter).tiles[self.slot] {
            tiles.read(out);
        }
    }
}

/// The initial contents of an attachment of a pass.
pub(in super::super) enum Source {
    /// These tiles.
    Tiles(TileSurface),
    /// The contents that a pass in flight leaves, with a part of them cleared.
    Behind(Away, Clearing),
}

impl Source {
    /// The tiles; waits for the pass that draws them.
    pub fn landed(self) -> TileSurface {
        match self {
            Source::Tiles(tiles) => tiles,
            Source::Behind(away, clearing) => {
                let mut tiles = away.take();
                tiles.clear_masked(clearing.value, clearing.mask);
                tiles
            }
        }
    }

    /// The tiles, where they are here.
    pub fn tiles(&self) -> Option<&TileSurface> {
        match self {
            Source::Tiles(tiles) => Some(tiles),
            Source::Behind(..) => None,
        }
    }

    /// Their shape.
    pub fn shape(&self) -> Shape {
        match self {
            Source::Tiles(tiles) => tiles.shape(),
            Source::Behind(away, _) => away.shape(),
        }
    }

    /// Whether a pass can only take off with a copy of it.
    pub fn needs_copy(&self) -> bool {
        self.tiles().is_some_and(|tiles| !tiles.is_clear())
    }
}
