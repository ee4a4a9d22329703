//! The attachments of render passes: out of their textures when a pass begins, and back when it ends.

use gfx::format::{Format, TexelKind};
use gfx::state::TextureDimension;
use gfx::texel;
use num::TextureId;
use work::{Aspects, Contents, Event, Surface, SurfaceKey};

use super::execute::Renderer;
use super::fault::Fault;
use super::ledger::Claim;
use super::resources::{ImageState, Resources};
use super::state::StateError;
use super::surface::{ALL, Shape, TileSurface};

/// Where an attachment's image is.
#[derive(Clone, Copy, Debug)]
pub(super) struct Subresource {
    pub texture: TextureId,
    pub level: u32,
    pub layer: u32,
}

impl Subresource {
    /// The image's name among surfaces.
    pub fn key(self) -> SurfaceKey {
        SurfaceKey { texture: self.texture.0, level: self.level, layer: self.layer }
    }
}

/// The aspects of an attachment's format that a pass keeps. What it does not keep becomes zeros, as WebGPU has it.
pub(super) fn kept(keeps: Aspects, format: Format) -> Aspects {
    keeps.and(Aspects::of(format))
}

/// The bits of stored texels that are lost though the other aspect is kept.
pub(super) fn lost(keeps: Aspects, format: Format) -> [u32; 4] {
    let (depth, stencil) = texel::aspect_masks(format);
    let kept = kept(keeps, format);
    let lost = |kept: bool, bits: u32| if kept { 0 } else { bits };
    match kept.any() {
        true => std::array::from_fn(|w| lost(kept.main, depth[w]) | lost(kept.stencil, stencil[w])),
        false => [0; 4],
    }
}

/// Clears what a pass does not keep of an attachment.
pub(super) fn discard(keeps: Aspects, tiles: &mut TileSurface) {
    let format = tiles.shape().format;
    let lost = lost(keeps, format);
    if !kept(keeps, format).any() {
        tiles.clear([0; 4]);
    } else if lost != [0; 4] {
        tiles.clear_masked([0; 4], lost);
    }
}

/// The image that a view used as an attachment names, and the format it is drawn in.
pub(super) fn place_of(renderer: &Renderer<'_, '_>, view: u32, slice: Option<u32>) -> Result<(Subresource, Format), Fault> {
    let view = renderer.res.views.get(view)?;
    let texture = renderer.res.textures.get(view.texture.0)?;
    let layer = match texture.image.dimension {
        TextureDimension::D3 => slice.ok_or(StateError::NoSlice)?,
        _ => view.range.base_layer,
    };
    if layer >= texture.image.level_size(view.range.base_level)[2] {
        return Err(StateError::Slice { slice: layer, texture: view.texture.0 }.into());
    }
    if view.range.levels != 1 || view.range.layers != 1 && texture.image.dimension != TextureDimension::D3 {
        return Err(StateError::AttachmentParts { levels: view.range.levels, layers: view.range.layers }.into());
    }
    Ok((Subresource { texture: view.texture, level: view.range.base_level, layer }, view.range.format))
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
pub(super) fn take_tiles(res: &mut Resources, place: Subresource, clearing: Clearing) -> Result<TileSurface, Fault> {
    let Resources { textures, ledger, .. } = res;
    let texture = textures.get_mut(place.texture.0)?;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    let [width, height, _] = texture.image.level_size(place.level);
    let shape = Shape { width, height, samples: texture.image.samples, format: texture.image.format };
    let partial = !clearing.whole && clearing.mask != [0; 4];
    state.stored = false;
    let mut tiles = match state.tiles.take() {
        Some(tiles) => tiles,
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
    Ok(tiles)
}

/// Puts an image's contents back after a pass. A claim replaces that of the tiles that the image had.
pub(super) fn put_tiles(
    res: &mut Resources,
    place: Subresource,
    tiles: TileSurface,
    claim: Option<Claim>,
) -> Result<(), Fault> {
    let texture = res.textures.get_mut(place.texture.0)?;
    texture.version += 1;
    let state = texture.images.get_or_insert_with((place.level, place.layer), ImageState::default);
    (state.tiles, state.stored) = (Some(tiles), false);
    if claim.is_some() {
        state.working = claim;
    }
    Ok(())
}

/// Hands a machine the contents of an attachment of which a pass is about to load some aspects, where its stores do not hold these.
pub(super) fn announce(
    renderer: &mut Renderer<'_, '_>,
    surface: &Surface,
    loads: Aspects,
    tiles: &TileSurface,
) -> Result<(), Fault> {
    if !renderer.recording() || renderer.res.holdings.holds(surface, loads) {
        return Ok(());
    }
    let bytes = tiles.shape().bytes();
    renderer.ledger.bytes.charge(bytes)?;
    renderer.ledger.passing("the contents of an attachment", 2 * bytes)?;
    renderer.emit(Event::Contents(Contents { surface: *surface, bytes: tiles.to_bytes().into() }))
}

/// A clear value as the bits that `texel::encode` takes.
pub(super) fn clear_bits(kind: TexelKind, value: [f64; 4]) -> [u32; 4] {
    value.map(|c| match kind {
        TexelKind::Uint => c as u32,
        TexelKind::Sint => c as i32 as u32,
        TexelKind::Float | TexelKind::Depth => (c as f32).to_bits(),
    })
}
