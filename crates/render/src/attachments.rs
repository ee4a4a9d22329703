//! The attachments of render passes: out of their textures when a pass begins, and back when it ends.

use gfx::format::{Format, TexelKind};
use gfx::state::TextureDimension;
use gfx::texel;
use num::TextureId;
use work::{Contents, Event, Surface};

use super::execute::{Fault, Renderer};
use super::flight::{Source, Tiles};
use super::ledger::Claim;
use super::resources::{ImageState, Resources};
use super::surface::{ALL, Shape, TileSurface, aspect_masks};

/// Where an attachment's image is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Place {
    pub texture: TextureId,
    pub level: u32,
    pub layer: u32,
}

/// What a pass keeps of an attachment; the rest becomes zeros, as WebGPU has it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Keep {
    /// Colour, or depth.
    pub main: bool,
    /// Stencil.
    pub stencil: bool,
}

impl Keep {
    /// Whether anything is kept.
    pub fn any(self) -> bool {
        self.main || self.stencil
    }

    /// The bits of stored texels that are lost though others are kept. Colours have no such parts.
    pub fn lost(self, format: Format) -> [u32; 4] {
        let (depth, stencil) = aspect_masks(format);
        let lost = |kept: bool, bits: u32| if kept || !self.any() { 0 } else { bits };
        std::array::from_fn(|w| lost(self.main, depth[w]) | lost(self.stencil, stencil[w]))
    }

    /// Clears what is not kept.
    pub fn apply(self, tiles: &mut TileSurface) {
        let lost = self.lost(tiles.shape().format);
        if !self.any() {
            tiles.clear([0; 4]);
        } else if lost != [0; 4] {
            tiles.clear_masked([0; 4], lost);
        }
    }
}

/// The image that a view used as an attachment names, and the format it is drawn in.
pub(super) fn place_of(renderer: &Renderer<'_, '_>, view: u32, slice: Option<u32>) -> Result<(Place, Format), Fault> {
    let view = renderer.res.views.get(view)?;
    let texture = renderer.res.textures.get(view.texture.0)?;
    let layer = match texture.image.dimension {
        TextureDimension::D3 => slice.ok_or("a 3D attachment without a depth slice")?,
        _ => view.range.base_layer,
    };
    if layer >= texture.image.level_size(view.range.base_level)[2] {
        return Err(format!("slice {layer} of texture {} is not there", view.texture.0).into());
    }
    if view.range.levels != 1 || view.range.layers != 1 && texture.image.dimension != TextureDimension::D3 {
        return Err(format!("an attachment of {} levels and {} layers", view.range.levels, view.range.layers).into());
    }
    Ok((Place { texture: view.texture, level: view.range.base_level, layer }, view.range.format))
}

/// What a pass clears of an attachment when it begins: the bits of stored texels in `mask` become those of `value`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clearing {
    /// Bits that are cleared.
    pub mask: [u32; 4],
    /// Words of a stored texel.
    pub value: [u32; 4],
    /// All bits that a texel has are cleared.
    pub whole: bool,
}

impl Clearing {
    /// Nothing is cleared.
    pub const NONE: Clearing = Clearing { mask: [0; 4], value: [0; 4], whole: false };

    /// Everything is.
    pub fn to(value: [u32; 4]) -> Clearing {
        Clearing { mask: ALL, value, whole: true }
    }
}

/// An image's contents, out of the texture for the length of the pass, with some or all of them cleared.
pub(super) fn take_tiles(res: &mut Resources, place: Place, clearing: Clearing) -> Result<Source, Fault> {
    let Resources { textures, flights, ledger, .. } = res;
    let texture = textures.get_mut(place.texture.0)?;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    let [width, height, _] = texture.image.level_size(place.level);
    let shape = Shape { width, height, samples: texture.image.samples, format: texture.image.format };
    let partial = !clearing.whole && clearing.mask != [0; 4];
    state.stored = false;
    let mut tiles = match state.tiles.take() {
        Some(Tiles::Here(tiles)) => tiles,
        Some(Tiles::Away(away)) => {
            if partial {
                ledger.bytes.charge(shape.bytes())?;
            }
            let Some(value) = away.cleared(clearing) else { return Ok(Source::Behind(away, clearing)) };
            let mut fresh = flights.surface(shape, away);
            fresh.clear(value);
            return Ok(Source::Tiles(fresh));
        }
        None => {
            state.working = None;
            state.working = Some(ledger.claim("the tiles of an attachment", shape.tiled_bytes())?);
            ledger.bytes.charge(shape.tiled_bytes())?;
            let mut tiles = TileSurface::new(shape);
            if !clearing.whole {
                state.loaded = true;
                tiles.load(&texture.words, texture.image.offset(place.level, place.layer));
            }
            tiles
        }
    };
    if clearing.whole {
        tiles.clear(clearing.value);
    } else if partial {
        ledger.bytes.charge(shape.bytes())?;
        tiles.clear_masked(clearing.value, clearing.mask);
    }
    Ok(Source::Tiles(tiles))
}

/// Puts an image's contents back after a pass; whether they were kept ([`Keep`]). A claim replaces that of the tiles that the image had.
pub(super) fn put_tiles(
    renderer: &mut Renderer<'_, '_>,
    place: Place,
    tiles: Tiles,
    keep: bool,
    claim: Option<Claim>,
) -> Result<(), Fault> {
    let followed = renderer.recording();
    let texture = renderer.res.textures.get_mut(place.texture.0)?;
    texture.version += 1;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    (state.tiles, state.stored) = (Some(tiles), false);
    if claim.is_some() {
        state.working = claim;
    }
    // What a pass did not keep is zeros here and whatever it was in the machine: the machine must be told before it loads.
    state.machine_knows = followed && keep;
    state.drawn = keep;
    Ok(())
}

/// Tells a machine the contents of an attachment that it is about to load and cannot know.
pub(super) fn announce(
    renderer: &mut Renderer<'_, '_>,
    place: Place,
    surface: &Surface,
    loads: bool,
    tiles: Option<&TileSurface>,
) -> Result<(), Fault> {
    if !loads || !renderer.recording() {
        return Ok(());
    }
    let state = renderer
        .res
        .textures
        .get_mut(place.texture.0)?
        .images
        .get_or_insert_with((place.level, place.layer), ImageState::default);
    if state.machine_knows {
        return Ok(());
    }
    state.machine_knows = true;
    if let Some(tiles) = tiles {
        renderer.ledger.bytes.charge(tiles.shape().bytes())?;
        renderer.ledger.passing("the contents of an attachment", 2 * tiles.shape().bytes())?;
    }
    let bytes = tiles.map(TileSurface::to_bytes).unwrap_or_default();
    renderer.emit(Event::Contents(Contents { surface: *surface, bytes: bytes.into() }))
}

/// A clear value as the bits that `texel::encode` takes.
pub(super) fn clear_bits(kind: TexelKind, value: [f64; 4]) -> [u32; 4] {
    value.map(|c| match kind {
        TexelKind::Uint => c as u32,
        TexelKind::Sint => c as i32 as u32,
        TexelKind::Float | TexelKind::Depth => (c as f32).to_bits(),
    })
}

/// A value as the words of a stored texel.
pub(super) fn stored_words(format: Format, bits: [u32; 4]) -> [u32; 4] {
    let bytes = texel::encode(format, bits);
    std::array::from_fn(|i| u32::from_le_bytes(std::array::from_fn(|k| bytes[4 * i + k])))
}
