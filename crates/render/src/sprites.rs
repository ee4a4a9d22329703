//! The sprites of the display: their images go to it at the end of each frame.

use num::{TextureId, ViewId};
use trace::command::{Command, SPRITES};
use work::{Event, Sprite, Transfer, TransferKind};

use super::execute::Renderer;
use super::fault::Fault;
use super::resources::{NoObject, Resources};
use super::state::StateError;
use gfx::format::Format;

/// A sprite as a trace has set it.
#[derive(Clone, Copy, Debug)]
struct Set {
    view: ViewId,
    at: [i32; 2],
}

/// All sprites, by index.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Sprites([Option<Set>; SPRITES as usize]);

impl Sprites {
    /// Shows a sprite from the next frame on, or does not show it any more.
    ///
    /// # Errors
    /// If there is no such sprite.
    pub fn set(&mut self, index: u32, view: Option<ViewId>, at: [i32; 2]) -> Result<(), StateError> {
        let sprite = self.0.get_mut(index as usize).ok_or(StateError::Sprite(index))?;
        *sprite = view.map(|view| Set { view, at });
        Ok(())
    }

    /// The commands that show the sprites that are shown.
    pub fn commands(&self) -> impl Iterator<Item = Command> {
        self.shown().map(|(index, Set { view, at: [x, y] })| Command::SetSprite { index: index.into(), view: Some(view), x, y })
    }

    /// The views that are shown.
    pub fn views(&self) -> impl Iterator<Item = ViewId> + '_ {
        self.0.iter().flatten().map(|set| set.view)
    }

    /// The sprites, with their indices.
    fn shown(&self) -> impl Iterator<Item = (u8, Set)> {
        self.0.into_iter().zip(0..).filter_map(|(set, index)| Some((index, set?)))
    }
}

/// Whether the channels of a format come in the order blue, green, red.
fn swapped(format: Format) -> bool {
    matches!(format, Format::Bgra8Unorm | Format::Bgra8UnormSrgb)
}

/// The texture of a view, its level and layer, and width and height.
fn image(res: &Resources, view: ViewId) -> Result<(TextureId, [u32; 2], [u32; 2]), NoObject> {
    let view = res.views.get(view.0)?;
    let (level, layer) = (view.range.base_level, view.range.base_layer);
    let [width, height, _] = res.textures.get(view.texture.0)?.image.level_size(level);
    Ok((view.texture, [level, layer], [width, height]))
}

impl Renderer<'_, '_> {
    /// Moves the images of all sprites to the display; with their texels, as those of a picture of this format, where it is known and wanted.
    ///
    /// # Errors
    /// If the view of one is gone, or memory is short.
    pub(super) fn show_sprites(&mut self, picture: Option<Format>) -> Result<Vec<Sprite>, Fault> {
        let mut sprites = Vec::new();
        let set = self.sprites;
        for (index, set) in set.shown() {
            let (id, [level, layer], size) = image(&self.res, set.view)?;
            let texture = self.res.textures.get(id.0)?;
            let (bytes, from) = (texture.image.layer_bytes(level), texture.surface(id, level, layer).address);
            self.ledger.bytes.charge(bytes)?;
            let reads = Some(texture.extent());
            let moved =
                Transfer { kind: TransferKind::Sprite, from: Some(from), to: None, bytes, reads, writes: None, surfaces: None };
            self.emit(Event::Transfer(moved))?;
            let Some(format) = picture else { continue };
            let texture = self.res.flushed(id)?;
            let mut texels = texture.image_bytes(level, layer).to_vec();
            if swapped(format) != swapped(texture.image.format) {
                texels.chunks_exact_mut(4).for_each(|texel| texel.swap(0, 2));
            }
            sprites.push(Sprite { index, at: set.at, size, texels: texels.into() });
        }
        Ok(sprites)
    }
}
