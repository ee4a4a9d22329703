//! Texture objects: their levels, and the card's texture.

use gfx::format::Format;
use gfx::state::*;
use gl_shader::key::{Base, DepthRead, TextureShape};
use gl_shader::{IMAGES, consts as e};
use num::*;
use trace::command::*;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::copy_key::{Combine, CopyKey, CopySource, Map, SAME, one_image};
use crate::gl::card::device::Card;
use crate::gl::card::pass::Surface;
use crate::gl::names;
use crate::gl::texels::image::StoredFormat;

/// Wrap modes that mirror at 0.
pub const MIRROR_CLAMP: u32 = 0x8742;
pub const MIRROR_CLAMP_TO_EDGE: u32 = 0x8743;
pub const MIRROR_CLAMP_TO_BORDER: u32 = 0x8912;

/// One image of a texture.
#[derive(Clone, Debug)]
pub struct Level {
    /// Width, height, depth.
    pub size: [u32; 3],
    /// Its base format.
    pub base: Base,
    /// The format in which its texels are stored.
    pub format: Format,
    /// Bytes that are not yet on the card. Depths are stored as 32-bit floats.
    pub bytes: Option<Vec<u8>>,
}

impl Level {
    /// An image of texels of a base format.
    pub fn plain(size: [u32; 3], base: Base, bytes: Option<Vec<u8>>) -> Level {
        Level { size, base, format: base.format(), bytes }
    }
}

/// The card's texture.
#[derive(Clone, Debug)]
struct Native {
    id: TextureId,
    /// The level of the texture object that is its first level.
    first: u32,
    size: [u32; 3],
    levels: u32,
    base: Base,
    format: Format,
    /// Views by first level and number of levels.
    views: Vec<([u32; 2], ViewId)>,
    /// Views of single images, by layer and level.
    images: Vec<((u32, u32), ViewId)>,
}

impl Native {
    /// The level of the card's texture that holds a level of the texture object, if an image of it fits there.
    fn place(&self, level: u32, image: &Level) -> Option<u32> {
        let k = level.checked_sub(self.first).filter(|&k| k < self.levels)?;
        let fits = self.size.map(|edge| (edge >> k).max(1)) == image.size;
        (fits && self.base == image.base && self.format == image.format).then_some(k)
    }

    fn all_views(&self) -> Vec<ViewId> {
        self.views.iter().map(|&(_, view)| view).chain(self.images.iter().map(|&(_, view)| view)).collect()
    }
}

/// A texture object.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its shape.
    pub kind: TextureShape,
    /// Images by face and level.
    pub levels: NumberMap<(u32, u32), Level>,
    /// Filters.
    pub min: u32,
    /// Filters.
    pub mag: u32,
    /// Wrap modes of s, t, r.
    pub wrap: [u32; 3],
    /// Border colour.
    pub border: [f32; 4],
    /// Bounds of the level of detail.
    pub lod: [f32; 2],
    /// First and last level.
    pub range: [u32; 2],
    /// Anisotropy.
    pub anisotropy: f32,
    /// Whether smaller levels are generated from the base level.
    pub generate: bool,
    /// Whether the program gave it stencil values, which are not stored.
    pub given_stencil: bool,
    /// Bias of the level of detail.
    pub bias: f32,
    /// The comparison of depths with the third coordinate, if it is enabled.
    pub compare: Option<Compare>,
    /// The comparison that is used if it is enabled.
    pub compare_func: Compare,
    /// The base format as which depths are read.
    pub depth_mode: Base,
    /// The source of each component that is read: a channel, 4 for zero, 5 for one.
    pub swizzle: [u8; 4],
    native: Option<Native>,
}

/// A texture as a draw binds it.
pub struct BoundTexture {
    /// Texture, view, sampler.
    pub bound: (TextureId, ViewId, SamplerId),
    /// Base format.
    pub base: Base,
    /// Coordinates that are clamped before filtering.
    pub clamp: [bool; 3],
    /// Coordinates that are mirrored at 0 before that.
    pub mirror: [bool; 3],
    /// The border's colour in the format of the texels, and a sampler whose border is white; none if the card supports this border colour.
    pub border: Option<([f32; 4], SamplerId)>,
    /// Bias of the level of detail.
    pub bias: f32,
    /// Levels that are read: the first one on the card, and their number.
    pub levels: [u32; 2],
    /// Whether it has depths, and whether they are compared.
    pub depth: DepthRead,
    /// See [`Texture::swizzle`].
    pub swizzle: [u8; 4],
    /// Whether it is a cube whose filters stop at the edges of its faces, unless these are joined.
    pub face_edges: bool,
}

impl Texture {
    /// An empty texture.
    pub fn new(kind: TextureShape) -> Texture {
        let rectangle = kind == TextureShape::Rectangle;
        Texture {
            kind,
            levels: NumberMap::new(),
            min: if rectangle { e::LINEAR } else { e::NEAREST_MIPMAP_LINEAR },
            mag: e::LINEAR,
            wrap: [if rectangle { e::CLAMP_TO_EDGE } else { e::REPEAT }; 3],
            border: [0.0; 4],
            lod: [-1000.0, 1000.0],
            range: [0, 1000],
            anisotropy: 1.0,
            generate: false,
            bias: 0.0,
            given_stencil: false,
            compare: None,
            compare_func: Compare::LessEqual,
            depth_mode: Base::Luminance,
            swizzle: [0, 1, 2, 3],
            native: None,
        }
    }

    /// Exchanges the sampling parameters with another texture. A sampler object that overrides a texture is applied in this way.
    pub fn exchange_sampling(&mut self, other: &mut Texture) {
        std::mem::swap(&mut self.min, &mut other.min);
        std::mem::swap(&mut self.mag, &mut other.mag);
        std::mem::swap(&mut self.wrap, &mut other.wrap);
        std::mem::swap(&mut self.border, &mut other.border);
        std::mem::swap(&mut self.lod, &mut other.lod);
        std::mem::swap(&mut self.bias, &mut other.bias);
        std::mem::swap(&mut self.anisotropy, &mut other.anisotropy);
        std::mem::swap(&mut self.compare, &mut other.compare);
        std::mem::swap(&mut self.compare_func, &mut other.compare_func);
    }

    /// Takes over the parameters of another texture, but not its images.
    pub fn take_parameters(&mut self, of: &Texture) {
        (self.min, self.mag, self.wrap, self.border) = (of.min, of.mag, of.wrap, of.border);
        (self.lod, self.range, self.bias, self.anisotropy) = (of.lod, of.range, of.bias, of.anisotropy);
        (self.compare, self.compare_func, self.depth_mode) = (of.compare, of.compare_func, of.depth_mode);
        (self.generate, self.swizzle) = (of.generate, of.swizzle);
    }

    fn faces(&self) -> u32 {
        if self.kind == TextureShape::Cube { 6 } else { 1 }
    }

    fn mipmapped(&self) -> bool {
        !matches!(self.min, e::NEAREST | e::LINEAR)
    }

    /// Number of levels of a complete texture of this size.
    fn full_levels(size: [u32; 3]) -> u32 {
        32 - size.into_iter().max().unwrap_or(1).max(1).leading_zeros()
    }

    /// Number of levels that sampling reads, from the base level on; none if the texture is not complete.
    fn complete(&self) -> Option<u32> {
        let first = self.levels.get((0, self.range[0]))?;
        if first.size.contains(&0) {
            return None;
        }
        let count = match self.mipmapped() {
            true => Texture::full_levels(first.size).min(self.range[1].checked_sub(self.range[0])?.saturating_add(1)),
            false => 1,
        };
        for face in 0..self.faces() {
            for k in 0..count {
                let level = self.levels.get((face, self.range[0] + k))?;
                let wanted = first.size.map(|edge| (edge >> k).max(1));
                if level.size != wanted || level.base != first.base || level.format != first.format {
                    return None;
                }
            }
        }
        Some(count)
    }

    /// Defines an image.
    pub fn define(&mut self, card: &mut Card, face: u32, level: u32, image: Level) {
        // An image of the same size on the card is overwritten in place.
        if let Some(native) = self.native.as_ref().filter(|native| native.place(level, &image).is_some()) {
            // The one that was there may be of another size, and then is not on the card.
            let placed = |old: &Level| old.bytes.is_none() && native.place(level, old).is_some();
            let on_card = self.levels.get((face, level)).is_some_and(placed);
            if let (true, Some(bytes)) = (on_card, &image.bytes) {
                return self.write(card, face, level, [0; 3], image.size, bytes);
            }
        }
        self.levels.insert((face, level), image);
    }

    /// Writes a part of an image that is defined; `bytes` are texels in the stored format.
    pub fn write(&mut self, card: &mut Card, face: u32, level: u32, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) {
        let Some(image) = self.levels.get_mut((face, level)) else { return };
        if image.bytes.is_none() && self.native.as_ref().is_none_or(|native| native.place(level, image).is_none()) {
            // It was defined without contents, and the card does not have it yet.
            let texels = image.size.iter().map(|&edge| edge as usize).product::<usize>();
            image.bytes = Some(vec![0; texels * image.format.block_bytes() as usize]);
        }
        let (block, texel) = (image.format.block_dim(), image.format.block_bytes() as usize);
        if let Some(kept) = &mut image.bytes {
            // Sizes in blocks of texels; a block of most formats is one texel.
            let blocks = |edge: u32| edge.div_ceil(block) as usize;
            let [width, height] = [blocks(image.size[0]), blocks(image.size[1])];
            let (row, rows) = (blocks(size[0]) * texel, blocks(size[1]));
            let [x, y, z] = [(origin[0] / block) as usize, (origin[1] / block) as usize, origin[2] as usize];
            for (k, line) in bytes.chunks_exact(row.max(1)).enumerate() {
                let at = (((z + k / rows) * height + y + k % rows) * width + x) * texel;
                kept[at..at + row].copy_from_slice(line);
            }
            return;
        }
        let image = image.clone();
        let Some(native) = &self.native else { return };
        let Some(k) = native.place(level, &image) else { return };
        let layer = if self.kind == TextureShape::Cube { face } else { origin[2] };
        upload(card, native, k, [origin[0], origin[1], layer], size, bytes);
    }

    /// Levels from the base level on that are defined, each half as large as the one before.
    fn chain(&self) -> u32 {
        let base = self.range[0];
        let Some(first) = self.levels.get((0, base)) else { return 0 };
        let follows = |after: &u32| {
            let half = first.size.map(|edge| (edge >> after).max(1));
            let fits = |level: &Level| level.size == half && level.base == first.base && level.format == first.format;
            self.levels.get((0, base.saturating_add(*after))).is_some_and(fits)
        };
        (1..Texture::full_levels(first.size)).take_while(follows).count() as u32 + 1
    }

    /// Gives the card's texture this number of levels and uploads their texels.
    fn install(&mut self, card: &mut Card, count: u32) -> Option<()> {
        let base_level = self.range[0];
        let first = self.levels.get((0, base_level))?.clone();
        let fits = self
            .native
            .as_ref()
            .is_some_and(|n| n.place(base_level, &first).is_some() && n.levels >= count + base_level - n.first);
        if !fits {
            let old = self.native.take();
            // Larger images before the base level stay on the card too: the program may set the base level back to them.
            let (mut lowest, mut largest) = (base_level, first.clone());
            while let Some(before) = lowest.checked_sub(1).and_then(|level| self.levels.get((0, level))) {
                let follows = !before.size.contains(&0) && before.size.map(|edge| (edge >> 1).max(1)) == largest.size;
                if !follows || before.base != first.base || before.format != first.format {
                    break;
                }
                (lowest, largest) = (lowest - 1, before.clone());
            }
            let dimension = if self.kind == TextureShape::D3 { TextureDimension::D3 } else { TextureDimension::D2 };
            let layers = if self.kind == TextureShape::D3 { largest.size[2] } else { self.faces() };
            let levels = count + base_level - lowest;
            let size = [largest.size[0], largest.size[1], layers];
            let desc = TextureDesc { dimension, size, levels, samples: 1, format: first.format, opaque: false };
            let id = card.recorder.create_texture("texture", desc);
            let (size, base, format) = (largest.size, first.base, first.format);
            let native = Native { id, first: lowest, size, levels, base, format, views: Vec::new(), images: Vec::new() };
            if let Some(old) = old {
                for ((face, level), image) in self.levels.iter().filter(|(_, image)| image.bytes.is_none()) {
                    if let (Some(from), Some(to)) = (old.place(level, image), native.place(level, image)) {
                        let end = |texture, level| TextureEnd { texture, level, origin: [0, 0, face], aspect: Aspect::All };
                        card.end_pass();
                        card.recorder.copy_texture_to_texture(end(old.id, from), end(id, to), whole_blocks(format, image.size));
                    }
                }
                card.destroy(old.id, &old.all_views());
            }
            self.native = Some(native);
        }
        // Asked for each draw with the texture; keys in order are a list that is made.
        if self.levels.values_mut().all(|image| image.bytes.is_none()) {
            return Some(());
        }
        let native = self.native.as_ref()?;
        for (face, level) in self.levels.keys() {
            let Some(image) = self.levels.get_mut((face, level)) else { continue };
            if image.bytes.is_none() || native.place(level, image).is_none() {
                continue;
            }
            let Some(bytes) = image.bytes.take() else { continue };
            let k = level - native.first;
            upload(card, native, k, [0, 0, face], image.size, &bytes);
        }
        Some(())
    }

    /// Copies a part of the window into an image that is defined.
    pub fn copy(
        &mut self,
        card: &mut Card,
        face: u32,
        level: u32,
        to: [u32; 2],
        from_target: FromTarget,
        from: [i32; 2],
        size: [u32; 2],
    ) -> GlResult {
        if size.contains(&0) {
            return Ok(());
        }
        let refused = || Fault::Unsupported("copies into a level of a texture before its first one".into());
        let image = self.surface(card, face, level)?.ok_or_else(refused)?;
        let base = self.levels.get((0, self.range[0])).ok_or_else(refused)?.base;
        if image.format != base.format() {
            return Err(Fault::Unsupported("copies into compressed textures".into()));
        }
        let (source, ..) = from_target;
        if image.texture == source.texture && image.level == source.level {
            return Err(Fault::Unsupported("copies of a texture into itself".into()));
        }
        card.copy_to_texture(base, from_target, image, to, from, size);
        Ok(())
    }

    /// Copies a part of the window into a slice of a 3D image that is defined.
    pub fn copy_slice(
        &mut self,
        card: &mut Card,
        level: u32,
        to: [u32; 3],
        (source, extent, upward): FromTarget,
        from: [i32; 2],
        size: [u32; 2],
    ) -> GlResult {
        let refused = || Fault::Unsupported("copies into a level of a texture before its first one".into());
        let after = level.checked_sub(self.range[0]).ok_or_else(refused)?;
        let first = self.levels.get((0, self.range[0])).ok_or_else(refused)?;
        if first.size.contains(&0) || after >= Texture::full_levels(first.size) {
            return Err(refused());
        }
        let needed = self.complete().unwrap_or(1).max(after + 1);
        if size.contains(&0) || self.install(card, needed).is_none() {
            return Ok(());
        }
        let (Some(native), Some(image)) = (&self.native, self.levels.get((0, level))) else { return Ok(()) };
        let (Some(k), id, base) = (native.place(level, image), native.id, native.base) else { return Ok(()) };
        if native.format != base.format() {
            return Err(Fault::Unsupported("copies into compressed textures".into()));
        }
        // A slice cannot be drawn to: the copy is made in a separate surface.
        let beside = card.create_surface("slice", size, base.format());
        card.copy_to_texture(base, (source, extent, upward), beside, [0; 2], from, size);
        let end = |texture, level, origin| TextureEnd { texture, level, origin, aspect: Aspect::All };
        card.release(id);
        let ends = [end(beside.texture, 0, [0; 3]), end(id, k, to)];
        card.recorder.copy_texture_to_texture(ends[0].clone(), ends[1].clone(), [size[0], size[1], 1]);
        card.destroy_surface(beside);
        Ok(())
    }

    /// One image on the card, to be drawn to or read; none if it does not exist.
    pub fn surface(&mut self, card: &mut Card, layer: u32, level: u32) -> GlResult<Option<Surface>> {
        let base_level = self.range[0];
        let (Some(first), Some(after)) = (self.levels.get((0, base_level)), level.checked_sub(base_level)) else {
            return Ok(None);
        };
        let face = if self.kind == TextureShape::Cube { layer } else { 0 };
        let full = Texture::full_levels(first.size);
        // A level beyond the smallest one belongs to no texture of the card.
        if self.kind == TextureShape::D3 || first.size.contains(&0) || after >= full || !self.levels.contains((face, level)) {
            return Ok(None);
        }
        let needed = self.complete().unwrap_or(1).max(after + 1).min(full);
        if self.install(card, needed).is_none() {
            return Ok(None);
        }
        let (Some(native), Some(image)) = (&mut self.native, self.levels.get((face, level))) else { return Ok(None) };
        let Some(k) = native.place(level, image) else { return Ok(None) };
        let view = match native.images.iter().find(|&&(key, _)| key == (layer, k)) {
            Some(&(_, view)) => view,
            None => {
                let view = card.recorder.create_view_of(native.id, one_image(k, layer, Aspect::All));
                native.images.push(((layer, k), view));
                view
            }
        };
        let narrow = image.base.narrow();
        Ok(Some(Surface { texture: native.id, view, format: native.format, level: k, layer, narrow }))
    }

    /// Prepares the texture for sampling; none if it is not complete, which disables its unit.
    pub fn bind(&mut self, card: &mut Card) -> GlResult<Option<BoundTexture>> {
        let Some(count) = self.complete() else { return Ok(None) };
        let kind = self.kind;
        let kept = if card.all_levels { self.chain() } else { 0 };
        if self.install(card, count.max(kept)).is_none() {
            return Ok(None);
        }
        let (sampler, border) = self.sampler()?;
        let Some(native) = &mut self.native else { return Ok(None) };
        let levels = [self.range[0] - native.first, count];
        let view = match native.views.iter().find(|&&(known, _)| known == levels) {
            Some(&(_, view)) => view,
            None => {
                let dimension = match kind {
                    TextureShape::Cube => ViewDimension::Cube,
                    TextureShape::D3 => ViewDimension::D3,
                    _ => ViewDimension::D2,
                };
                let aspect = if native.base == Base::Depth { Aspect::DepthOnly } else { Aspect::All };
                let [base_level, count] = levels;
                let desc =
                    ViewDesc { dimension: Some(dimension), base_level, levels: Some(count), aspect, ..ViewDesc::default() };
                let view = card.recorder.create_view_of(native.id, desc);
                native.views.push((levels, view));
                view
            }
        };
        let linear =
            self.mag == e::LINEAR || matches!(self.min, e::LINEAR | e::LINEAR_MIPMAP_NEAREST | e::LINEAR_MIPMAP_LINEAR);
        let white = SamplerDesc { border: BorderColor::OpaqueWhite, ..sampler };
        let border = border.map(|color| (color, card.sampler(white)));
        let bound = (native.id, view, card.sampler(sampler));
        let (base, depth) = match (native.base, self.compare) {
            (Base::Depth, Some(_)) => (self.depth_mode, DepthRead::Compared),
            (Base::Depth, None) => (self.depth_mode, DepthRead::Plain),
            (base, _) => (base.plain(), DepthRead::No),
        };
        if depth != DepthRead::No && !matches!(kind, TextureShape::D1 | TextureShape::D2 | TextureShape::Rectangle) {
            return Err(Fault::Unsupported("depth textures that are cube maps".into()));
        }
        // A direction is not clamped.
        let clamp = self.wrap.map(|wrap| matches!(wrap, e::CLAMP | MIRROR_CLAMP) && linear && kind != TextureShape::Cube);
        let mirrors = [MIRROR_CLAMP, MIRROR_CLAMP_TO_EDGE, MIRROR_CLAMP_TO_BORDER];
        let mirror = self.wrap.map(|wrap| mirrors.contains(&wrap) && kind != TextureShape::Cube);
        // As in Mesa, whatever the wrap modes are.
        let face_edges = kind == TextureShape::Cube && linear;
        let (bias, swizzle) = (self.bias, self.swizzle);
        Ok(Some(BoundTexture { bound, border, bias, base, clamp, mirror, levels, depth, swizzle, face_edges }))
    }

    /// Its sampler, and the border colour in the format of the texels if the card does not support that colour.
    fn sampler(&self) -> GlResult<(SamplerDesc, Option<[f32; 4]>)> {
        let filter = |linear: bool| if linear { FilterMode::Linear } else { FilterMode::Nearest };
        let linear = matches!(self.min, e::LINEAR | e::LINEAR_MIPMAP_NEAREST | e::LINEAR_MIPMAP_LINEAR);
        let between = matches!(self.min, e::NEAREST_MIPMAP_LINEAR | e::LINEAR_MIPMAP_LINEAR);
        let any = linear || self.mag == e::LINEAR;
        let mut address = [AddressMode::Repeat; 3];
        for (mode, wrap) in address.iter_mut().zip(self.wrap) {
            *mode = match wrap {
                e::REPEAT => AddressMode::Repeat,
                e::MIRRORED_REPEAT => AddressMode::MirrorRepeat,
                // With linear filters, a sample at 0 or 1 is half border.
                e::CLAMP | MIRROR_CLAMP if any => AddressMode::ClampToBorder,
                e::CLAMP | MIRROR_CLAMP | e::CLAMP_TO_EDGE | MIRROR_CLAMP_TO_EDGE => AddressMode::ClampToEdge,
                // Where it is mirrored, filters reach the border too, as in Mesa.
                e::CLAMP_TO_BORDER | MIRROR_CLAMP_TO_BORDER => AddressMode::ClampToBorder,
                other => return Err(Fault::Unsupported(format!("wrap mode {}", names::name(other)))),
            };
        }
        // Coordinates that the texture's dimension does not use cannot reach a border.
        let used = match self.kind {
            TextureShape::D1 => 1,
            TextureShape::D2 | TextureShape::Rectangle => 2,
            TextureShape::D3 => 3,
            TextureShape::Cube => 0,
        };
        for mode in &mut address[used..] {
            *mode = AddressMode::ClampToEdge;
        }
        let base = self.native.as_ref().map_or(Base::Rgba, |native| native.base);
        let [r, g, b, a] = self.border.map(|value| if base.is_float() { value } else { value.clamp(0.0, 1.0) });
        let kept = match base.plain() {
            Base::Alpha => [a, 0.0, 0.0, 0.0],
            Base::Luminance | Base::Intensity | Base::Depth | Base::Red => [r, 0.0, 0.0, 0.0],
            Base::Rg => [r, g, 0.0, 0.0],
            Base::LuminanceAlpha => [r, a, 0.0, 0.0],
            Base::Rgb | Base::Srgb => [r, g, b, 1.0],
            Base::Rgba | Base::SrgbAlpha | Base::Float(..) | Base::Narrow(_) => [r, g, b, a],
        };
        let channels = base.format().components() as usize;
        let (border, color) = match kept {
            _ if !address.contains(&AddressMode::ClampToBorder) => (BorderColor::TransparentBlack, None),
            [0.0, 0.0, 0.0, 0.0] => (BorderColor::TransparentBlack, None),
            [0.0, 0.0, 0.0, 1.0] => (BorderColor::OpaqueBlack, None),
            kept if kept[..channels].iter().all(|&value| value == 1.0) => (BorderColor::OpaqueWhite, None),
            _ if base == Base::Depth => {
                return Err(Fault::Unsupported("borders of depth textures of a value other than 0 and 1".into()));
            }
            kept => (BorderColor::TransparentBlack, Some(kept)),
        };
        // Without mipmaps, the level of detail only selects between the two filters.
        let lod = if self.mipmapped() { self.lod.map(|lod| lod.max(0.0)) } else { [0.0, 0.25] };
        // The card's samplers are anisotropic only with a linear filter between levels; with one level that filter changes nothing.
        let ellipse = self.anisotropy > 1.0 && any && linear && self.mag == e::LINEAR && (between || !self.mipmapped());
        let sampler = SamplerDesc {
            address,
            mag: filter(self.mag == e::LINEAR),
            min: filter(linear),
            mipmap: filter(between || ellipse),
            lod_min: lod[0],
            lod_max: lod[1].max(lod[0]),
            compare: self.compare.filter(|_| self.native.as_ref().is_some_and(|native| native.base == Base::Depth)),
            anisotropy: if ellipse { (self.anisotropy as u16).clamp(1, 16) } else { 1 },
            border,
        };
        Ok((sampler, color))
    }

    /// Frees the card's texture.
    pub fn free(&mut self, card: &mut Card) {
        if let Some(native) = self.native.take() {
            card.destroy(native.id, &native.all_views());
        }
    }
}

/// A framebuffer that is copied from: its image, its size, and whether its first row is the lowest.
pub type FromTarget = (Surface, [u32; 2], bool);

/// A size rounded up to whole blocks, as copies of compressed images require.
fn whole_blocks(format: Format, size: [u32; 3]) -> [u32; 3] {
    let block = format.block_dim();
    [size[0].next_multiple_of(block), size[1].next_multiple_of(block), size[2]]
}

/// Writes a part of an image on the card.
fn upload(card: &mut Card, native: &Native, level: u32, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) {
    if size.contains(&0) {
        return;
    }
    card.release(native.id);
    let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
    let to = TextureEnd { texture: native.id, level, origin, aspect: Aspect::All };
    if native.base != Base::Depth {
        return card.recorder.write_texture(to, layout, whole_blocks(native.format, size), "texture", bytes);
    }
    // Depths are written by a draw.
    let source = card.create_surface("depths", [size[0], size[1]], Format::R32Float);
    let from = TextureEnd { texture: source.texture, level: 0, origin: [0; 3], aspect: Aspect::All };
    card.recorder.write_texture(from, layout, size, "depths", bytes);
    let view = card.recorder.create_view_of(native.id, one_image(level, origin[2], Aspect::All));
    let image = Surface { texture: native.id, view, format: native.format, level, layer: origin[2], narrow: None };
    let key =
        CopyKey { from: CopySource::Color, result: "c.r", format: native.format.name(), combine: Combine::Replace, mask: 15 };
    let map = Map { to: [origin[0] as f32, origin[1] as f32], ..SAME };
    let area = Rect { x: origin[0], y: origin[1], width: size[0], height: size[1] };
    card.copy_pixels(key, native.format, source, image, map, 0.0, area);
    card.recorder.push(Command::Destroy(Object::View(view)));
    card.destroy_surface(source);
}

/// How the textures of a context are sampled.
pub struct SamplerBindings {
    /// Whether filters cross the edges of cube map faces.
    pub seamless: bool,
    /// The samplers of the units; 0: none.
    pub bound: [u32; IMAGES],
}

impl Default for SamplerBindings {
    fn default() -> Self {
        SamplerBindings { seamless: false, bound: [0; IMAGES] }
    }
}
