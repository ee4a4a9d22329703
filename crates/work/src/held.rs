//! What the stores of a machine hold: one description, which the renderer and the machine keep with the same code.
//!
//! A machine has the images of attachments in stores of its own, and a pass that loads an image takes it from there. The renderer hands on
//! [`Contents`](super::Contents) of an image that is loaded and not held. Both sides know what is held by the same means: [`Holdings`] follows
//! from the events alone. The renderer applies an event when it hands the event on, the machine when it takes the event. An event that asks for
//! something that is not held is an error on both sides, never an image of zeros.
//!
//! What is held is the words of texels. Views of one image that take the words for different values (with and without sRGB) share them.

use std::collections::BTreeMap;
use std::sync::Arc;

use gfx::format::Format;

use super::pass::{Attachment, Pass, Surface, SurfaceKey};
use super::{Event, Transfer};

/// Some of the aspects of a texel, each of which a pass clears, loads and keeps apart from the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Aspects {
    /// Colour, or depth.
    pub main: bool,
    /// Stencil.
    pub stencil: bool,
}

impl Aspects {
    /// No aspect.
    pub const NONE: Aspects = Aspects { main: false, stencil: false };

    /// The aspects that texels of a format have.
    pub fn of(format: Format) -> Aspects {
        Aspects { main: !format.is_depth_stencil() || format.has_depth(), stencil: format.has_stencil() }
    }

    /// Those that are also in `other`.
    pub fn and(self, other: Aspects) -> Aspects {
        Aspects { main: self.main && other.main, stencil: self.stencil && other.stencil }
    }

    /// Those that are not in `other`.
    pub fn without(self, other: Aspects) -> Aspects {
        Aspects { main: self.main && !other.main, stencil: self.stencil && !other.stencil }
    }

    /// Whether there is an aspect among them.
    pub fn any(self) -> bool {
        self != Aspects::NONE
    }
}

/// How the texels of a store lie, and what they can be taken for. Images of equal shapes can have the same words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StoreShape {
    texel: TexelClass,
    width: u32,
    height: u32,
    samples: u32,
}

/// The formats whose stored texels are the same words.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum TexelClass {
    /// Colours, by the number of their bytes. A view decides what they stand for.
    Color(u32),
    /// Depth and stencil have one format only, whatever aspect a view names.
    DepthStencil(Format),
}

impl Surface {
    /// The shape of the store that has its texels.
    pub fn store_shape(&self) -> StoreShape {
        let texel = match self.format {
            format if format.is_depth_stencil() => TexelClass::DepthStencil(format),
            format => TexelClass::Color(format.block_bytes()),
        };
        StoreShape { texel, width: self.width, height: self.height, samples: self.samples }
    }
}

/// One image in a store.
#[derive(Clone, Copy, Debug)]
struct HeldImage {
    shape: StoreShape,
    /// The aspects whose texels are those of the image. A pass may have discarded the others.
    aspects: Aspects,
    /// A pass has written the image, not the host.
    drawn: bool,
}

/// What the stores of a machine hold of images. See the [module](self).
#[derive(Clone, Debug, Default)]
pub struct Holdings {
    images: BTreeMap<SurfaceKey, HeldImage>,
    /// The pass that has begun.
    pass: Option<Arc<Pass>>,
}

/// An event asks a machine for an image that its stores do not hold.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error(
    "{what} takes {aspect} of texture {}, level {}, layer {} from the machine's stores, which do not hold them. {}",
    key.texture, key.level, key.layer, num::OUR_FAULT
)]
pub struct NotHeld {
    /// What asks for it.
    what: String,
    aspect: &'static str,
    key: SurfaceKey,
}

impl Holdings {
    /// The aspects of an image that are held.
    pub fn aspects(&self, surface: &Surface) -> Aspects {
        let held = self.images.get(&surface.key).filter(|held| held.shape == surface.store_shape());
        held.map_or(Aspects::NONE, |held| held.aspects)
    }

    /// Whether these aspects of an image are held.
    pub fn holds(&self, surface: &Surface, aspects: Aspects) -> bool {
        !aspects.without(self.aspects(surface)).any()
    }

    /// Whether all aspects of an image are held, and a pass was the last to write it.
    pub fn is_drawn(&self, surface: &Surface) -> bool {
        self.holds(surface, Aspects::of(surface.format)) && self.images.get(&surface.key).is_some_and(|held| held.drawn)
    }

    /// Whether a machine can make one image the copy of another by itself.
    pub fn can_copy(&self, from: &Surface, to: &Surface) -> bool {
        self.holds(from, Aspects::of(from.format)) && from.store_shape() == to.store_shape()
    }

    /// Something that is not among the events has written an image, or a machine does not see what has: no store holds it any more.
    pub fn forget(&mut self, key: SurfaceKey) {
        self.images.remove(&key);
    }

    /// No store holds any image of a texture.
    pub fn forget_texture(&mut self, texture: u32) {
        self.images.retain(|key, _| key.texture != texture);
    }

    /// No store holds any image: another machine begins.
    pub fn forget_all(&mut self) {
        self.images.clear();
    }

    /// Applies an event: checks that what it needs is held, and notes what is held after it.
    ///
    /// # Errors
    /// If it needs an image that is not held.
    pub fn apply(&mut self, event: &Event) -> Result<(), NotHeld> {
        match event {
            Event::Contents(contents) => {
                let aspects = Aspects::of(contents.surface.format);
                self.hold(&contents.surface, aspects, false);
            }
            Event::BeginPass(pass) => {
                for attachment in pass.attachments() {
                    let (surface, loads) = (&attachment.surface, attachment.loads());
                    self.ask(surface, loads, || format!("pass {}", pass.number))?;
                }
                self.pass = Some(pass.clone());
            }
            Event::EndPass(_) => {
                let Some(pass) = self.pass.take() else { return Ok(()) };
                for Attachment { surface, keeps, resolve, .. } in pass.attachments() {
                    self.hold(surface, keeps.and(Aspects::of(surface.format)), true);
                    if let Some(to) = resolve {
                        self.hold(to, Aspects::of(to.format), true);
                    }
                }
            }
            Event::Transfer(Transfer { surfaces: Some((from, to)), .. }) => {
                self.ask(from, Aspects::of(from.format), || "a copy of a whole image".to_owned())?;
                let drawn = self.is_drawn(from);
                self.hold(to, Aspects::of(to.format), drawn);
            }
            Event::EndFrame(end) => {
                if let Some(shown) = end.shown.filter(|shown| end.drawn && !self.is_drawn(shown)) {
                    return Err(not_held(&shown, Aspects::of(shown.format), format!("the picture of frame {}", end.number)));
                }
            }
            _ => {}
        }
        Ok(())
    }

    fn hold(&mut self, surface: &Surface, aspects: Aspects, drawn: bool) {
        self.images.insert(surface.key, HeldImage { shape: surface.store_shape(), aspects, drawn });
    }

    fn ask(&self, surface: &Surface, aspects: Aspects, what: impl Fn() -> String) -> Result<(), NotHeld> {
        let lacks = aspects.without(self.aspects(surface));
        if lacks.any() { Err(not_held(surface, lacks, what())) } else { Ok(()) }
    }
}

fn not_held(surface: &Surface, lacks: Aspects, what: String) -> NotHeld {
    let aspect = match lacks {
        Aspects { main: false, .. } => "the stencil values",
        _ if surface.format.is_depth_stencil() => "the depths",
        _ => "the colours",
    };
    NotHeld { what, aspect, key: surface.key }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Contents, Load, TransferKind};

    fn surface(texture: u32, format: Format, samples: u32) -> Surface {
        Surface {
            key: SurfaceKey { texture, level: 0, layer: 0 },
            format,
            width: 8,
            height: 8,
            samples,
            address: 0,
            opaque: false,
        }
    }

    /// A pass over one attachment that clears both aspects and keeps these.
    fn pass(surface: Surface, keeps: Aspects, resolve: Option<Surface>) -> [Event; 2] {
        let load = Load::Clear([0; 4]);
        let attachment =
            Attachment { surface, load, store: keeps.main, stencil_load: load, stencil_store: keeps.stencil, keeps, resolve };
        let depth = surface.format.is_depth_stencil().then_some(attachment);
        let color = if depth.is_some() { Vec::new() } else { vec![Some(attachment)] };
        let (width, height, samples) = (8, 8, surface.samples);
        let pass = Pass { number: 3, label: String::new(), width, height, samples, color, depth };
        [Event::BeginPass(Arc::new(pass)), Event::EndPass(None)]
    }

    fn copy(from: Surface, to: Surface) -> Event {
        let (kind, surfaces) = (TransferKind::Copy, Some((from, to)));
        Event::Transfer(Transfer { kind, from: None, to: None, bytes: 0, reads: None, writes: None, surfaces })
    }

    fn after(events: &[Event]) -> Holdings {
        let mut holdings = Holdings::default();
        events.iter().for_each(|event| holdings.apply(event).expect("all that it needs is held"));
        holdings
    }

    const BOTH: Aspects = Aspects { main: true, stencil: true };
    const MAIN: Aspects = Aspects { main: true, stencil: false };
    const STENCIL: Aspects = Aspects { main: false, stencil: true };

    #[test]
    fn a_pass_leaves_the_aspects_that_it_keeps_and_its_format_has() {
        for (format, keeps, held) in [
            (Format::Depth24PlusStencil8, BOTH, BOTH),
            (Format::Depth24PlusStencil8, MAIN, MAIN),
            (Format::Depth32FloatStencil8, STENCIL, STENCIL),
            (Format::Depth32Float, STENCIL, Aspects::NONE),
            (Format::Depth16Unorm, BOTH, MAIN),
            (Format::Stencil8, MAIN, Aspects::NONE),
            (Format::Stencil8, BOTH, STENCIL),
            (Format::Rgba8Unorm, MAIN, MAIN),
            (Format::Rgba8Unorm, Aspects::NONE, Aspects::NONE),
        ] {
            let image = surface(1, format, 4);
            let holdings = after(&pass(image, keeps, None));
            assert_eq!(holdings.aspects(&image), held, "{format:?} {keeps:?}");
            assert_eq!(holdings.is_drawn(&image), held == Aspects::of(format), "{format:?} {keeps:?}");
        }
    }

    #[test]
    fn views_share_an_image_and_another_shape_is_another_image() {
        let image = surface(1, Format::Rgba8UnormSrgb, 1);
        let holdings = after(&pass(image, MAIN, None));
        assert!(holdings.holds(&Surface { format: Format::Rgba8Unorm, ..image }, MAIN));
        for other in [
            Surface { format: Format::Rgba16Float, ..image },
            Surface { format: Format::Depth32Float, ..image },
            Surface { width: 9, ..image },
            Surface { samples: 4, ..image },
            Surface { key: SurfaceKey { layer: 1, ..image.key }, ..image },
        ] {
            assert!(!holdings.holds(&other, MAIN), "{other:?}");
        }
    }

    #[test]
    fn copies_and_resolved_images_are_held_until_something_else_writes_them() {
        let [many, resolved, target] =
            [(1, 4), (2, 1), (3, 1)].map(|(texture, samples)| surface(texture, Format::Rgba8Unorm, samples));
        let [begin, end] = pass(many, Aspects::NONE, Some(resolved));
        let mut holdings = after(&[begin, end, copy(resolved, target)]);
        assert_eq!([many, resolved, target].map(|image| holdings.is_drawn(&image)), [false, true, true]);
        assert!(!holdings.can_copy(&many, &target) && !holdings.can_copy(&resolved, &many));
        // What the host has put there is held, and is no picture of a draw's.
        let contents = Contents { surface: target, bytes: [].into() };
        holdings.apply(&Event::Contents(contents)).expect("it needs nothing");
        assert!(holdings.holds(&target, MAIN) && !holdings.is_drawn(&target));
        holdings.forget(target.key);
        assert!(!holdings.holds(&target, MAIN) && holdings.holds(&resolved, MAIN));
        holdings.forget_texture(2);
        assert!(!holdings.holds(&resolved, MAIN));
    }

    #[test]
    fn what_is_not_held_is_named() {
        let image = surface(5, Format::Depth24PlusStencil8, 1);
        let mut holdings = after(&pass(image, MAIN, None));
        let [begin, _] = pass(image, BOTH, None);
        let Event::BeginPass(begun) = begin else { panic!("the first event begins the pass") };
        let mut loads = begun.as_ref().clone();
        let depth = loads.depth.as_mut().expect("depth");
        (depth.load, depth.stencil_load) = (Load::Load, Load::Load);
        let wrong = holdings.apply(&Event::BeginPass(Arc::new(loads.clone()))).unwrap_err().to_string();
        let start = "pass 3 takes the stencil values of texture 5, level 0, layer 0 from the machine's stores, which do not hold them. This is a fault";
        assert!(wrong.starts_with(start), "{wrong}");
        // The depths alone are there.
        loads.depth.as_mut().expect("depth").stencil_load = Load::Clear([0; 4]);
        holdings.apply(&Event::BeginPass(Arc::new(loads))).expect("depths are held");
        let wrong = holdings.apply(&copy(image, surface(6, image.format, 1))).unwrap_err().to_string();
        assert!(wrong.starts_with("a copy of a whole image takes the stencil values of texture 5"), "{wrong}");
    }
}
