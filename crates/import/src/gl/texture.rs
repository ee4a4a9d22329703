//! Texture objects: what is known of their levels, and the card's texture.

use std::collections::BTreeMap;

use gfx::state::*;
use num::*;
use trace::command::*;

use super::call::{Fault, Outcome};
use super::card::Card;
use super::consts as e;
use super::image::Base;
use super::key::Kind;
use super::names;

/// One image of a texture.
#[derive(Clone, Debug)]
pub struct Level {
    /// Width, height, depth.
    pub size: [u32; 3],
    /// What its channels mean.
    pub base: Base,
    /// Bytes that are not yet on the card.
    pub bytes: Option<Vec<u8>>,
}

/// The card's texture.
#[derive(Clone, Debug)]
struct Native {
    id: TextureId,
    size: [u32; 3],
    levels: u32,
    base: Base,
    /// Views by number of levels.
    views: Vec<(u32, ViewId)>,
}

/// A texture object.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its shape.
    pub kind: Kind,
    /// Images by face and level.
    pub levels: BTreeMap<(u32, u32), Level>,
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
    /// Whether smaller levels are made of level 0.
    pub generate: bool,
    /// Bias of the level of detail.
    pub bias: f32,
    native: Option<Native>,
}

/// What a draw binds.
pub struct Bound {
    /// Texture, view, sampler.
    pub bound: (TextureId, ViewId, SamplerId),
    /// Base format.
    pub base: Base,
    /// Coordinates that are clamped before filtering.
    pub clamp: [bool; 3],
    /// Bias of the level of detail.
    pub bias: f32,
}

impl Texture {
    /// An empty texture.
    pub fn new(kind: Kind) -> Texture {
        let rectangle = kind == Kind::Rectangle;
        Texture {
            kind,
            levels: BTreeMap::new(),
            min: if rectangle { e::LINEAR } else { e::NEAREST_MIPMAP_LINEAR },
            mag: e::LINEAR,
            wrap: [if rectangle { e::CLAMP_TO_EDGE } else { e::REPEAT }; 3],
            border: [0.0; 4],
            lod: [-1000.0, 1000.0],
            range: [0, 1000],
            anisotropy: 1.0,
            generate: false,
            bias: 0.0,
            native: None,
        }
    }

    fn faces(&self) -> u32 {
        if self.kind == Kind::Cube { 6 } else { 1 }
    }

    fn mipmapped(&self) -> bool {
        !matches!(self.min, e::NEAREST | e::LINEAR)
    }

    /// Levels that a complete texture of this size has.
    fn full_levels(size: [u32; 3]) -> u32 {
        32 - size.into_iter().max().unwrap_or(1).max(1).leading_zeros()
    }

    /// Number of levels that sampling reads, from the first on; none if the texture is not complete.
    fn complete(&self) -> Option<u32> {
        let first = self.levels.get(&(0, self.range[0]))?;
        if first.size.contains(&0) {
            return None;
        }
        let count = match self.mipmapped() {
            true => Texture::full_levels(first.size).min(self.range[1].checked_sub(self.range[0])?.saturating_add(1)),
            false => 1,
        };
        for face in 0..self.faces() {
            for k in 0..count {
                let level = self.levels.get(&(face, self.range[0] + k))?;
                let wanted = first.size.map(|edge| (edge >> k).max(1));
                if level.size != wanted || level.base != first.base {
                    return None;
                }
            }
        }
        Some(count)
    }

    /// Defines an image.
    pub fn define(&mut self, card: &mut Card, face: u32, level: u32, image: Level) {
        // An image of the same size on the card is written in place.
        if let Some(native) = &self.native {
            let index = level.checked_sub(self.range[0]).filter(|&k| k < native.levels);
            let wanted = index.map(|k| native.size.map(|edge| (edge >> k).max(1)));
            if wanted == Some(image.size) && native.base == image.base {
                let on_card = self.levels.get(&(face, level)).is_some_and(|level| level.bytes.is_none());
                if let (true, Some(bytes)) = (on_card, &image.bytes) {
                    return self.write(card, face, level, [0; 3], image.size, bytes);
                }
            }
        }
        self.levels.insert((face, level), image);
    }

    /// Writes a part of an image that is defined; `bytes` are kept texels.
    pub fn write(&mut self, card: &mut Card, face: u32, level: u32, origin: [u32; 3], size: [u32; 3], bytes: &[u8]) {
        let Some(image) = self.levels.get_mut(&(face, level)) else { return };
        let texel = image.base.format().block_bytes() as usize;
        if let Some(kept) = &mut image.bytes {
            let [width, height, _] = image.size.map(|edge| edge as usize);
            let row = size[0] as usize * texel;
            for (k, line) in bytes.chunks_exact(row.max(1)).enumerate() {
                let (y, z) = (k % size[1] as usize, k / size[1] as usize);
                let at = (((origin[2] as usize + z) * height + origin[1] as usize + y) * width + origin[0] as usize) * texel;
                kept[at..at + row].copy_from_slice(line);
            }
            return;
        }
        let Some(native) = &self.native else { return };
        if card.pass.textures.contains(&native.id) {
            card.end_pass();
        }
        let layer = if self.kind == Kind::Cube { face } else { origin[2] };
        let to = TextureEnd {
            texture: native.id,
            level: level - self.range[0],
            origin: [origin[0], origin[1], layer],
            aspect: Aspect::All,
        };
        let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
        card.recorder.write_texture(to, layout, size, "texture", bytes);
    }

    /// Makes the card's texture have this many levels, with all that is known of them.
    fn install(&mut self, card: &mut Card, count: u32) -> Option<()> {
        let first = self.levels.get(&(0, self.range[0]))?.clone();
        let fits = self.native.as_ref().is_some_and(|n| n.size == first.size && n.base == first.base && n.levels >= count);
        if !fits {
            let old = self.native.take();
            let dimension = if self.kind == Kind::D3 { TextureDimension::D3 } else { TextureDimension::D2 };
            let layers = if self.kind == Kind::D3 { first.size[2] } else { self.faces() };
            let desc = TextureDesc {
                dimension,
                size: [first.size[0], first.size[1], layers],
                levels: count,
                samples: 1,
                format: first.base.format(),
            };
            let id = card.recorder.create_texture("texture", desc);
            let native = Native { id, size: first.size, levels: count, base: first.base, views: Vec::new() };
            if let Some(old) = old {
                for (&(face, level), image) in &self.levels {
                    let Some(k) = level.checked_sub(self.range[0]) else { continue };
                    let there = |n: &Native| {
                        k < n.levels && n.size.map(|edge| (edge >> k).max(1)) == image.size && n.base == image.base
                    };
                    if image.bytes.is_none() && there(&old) && there(&native) {
                        let end = |texture| TextureEnd { texture, level: k, origin: [0, 0, face], aspect: Aspect::All };
                        card.end_pass();
                        card.recorder.copy_texture_to_texture(end(old.id), end(id), image.size);
                    }
                }
                let views: Vec<ViewId> = old.views.iter().map(|&(_, view)| view).collect();
                card.destroy(old.id, &views);
            }
            self.native = Some(native);
        }
        let native = self.native.as_ref()?;
        let (id, all) = (native.id, native.levels);
        for face in 0..self.faces() {
            for k in 0..all {
                let Some(image) = self.levels.get_mut(&(face, self.range[0] + k)) else { continue };
                if image.size != native.size.map(|edge| (edge >> k).max(1)) || image.base != native.base {
                    continue;
                }
                let Some(bytes) = image.bytes.take() else { continue };
                if card.pass.textures.contains(&id) {
                    card.end_pass();
                }
                let to = TextureEnd { texture: id, level: k, origin: [0, 0, face], aspect: Aspect::All };
                let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
                card.recorder.write_texture(to, layout, image.size, "texture", &bytes);
            }
        }
        Some(())
    }

    /// Copies a part of the window into an image that is defined.
    pub fn copy(&mut self, card: &mut Card, face: u32, level: u32, to: [u32; 2], from: [i32; 2], size: [u32; 2]) -> Outcome {
        if size.contains(&0) {
            return Ok(());
        }
        let refused = || Fault::Unsupported("copies into a level of a texture before its first one".into());
        let first = self.levels.get(&(0, self.range[0])).ok_or_else(refused)?;
        let k = level.checked_sub(self.range[0]).ok_or_else(refused)?;
        let base = first.base;
        if self.levels.get(&(face, level)).is_none_or(|image| image.base != base || self.kind == Kind::D3) {
            return Err(refused());
        }
        let needed = self.complete().unwrap_or(1).max(k + 1).min(Texture::full_levels(first.size).max(k + 1));
        self.install(card, needed).ok_or_else(refused)?;
        let id = self.native.as_ref().ok_or_else(refused)?.id;
        card.copy_to_texture(base, id, face, k, to, from, size);
        Ok(())
    }

    /// Makes it ready to be sampled; none if it is not complete, so that its unit is off.
    pub fn bind(&mut self, card: &mut Card) -> Outcome<Option<Bound>> {
        let Some(count) = self.complete() else { return Ok(None) };
        let kind = self.kind;
        if self.install(card, count).is_none() {
            return Ok(None);
        }
        let sampler = self.sampler()?;
        let Some(native) = &mut self.native else { return Ok(None) };
        let view = match native.views.iter().find(|&&(levels, _)| levels == count) {
            Some(&(_, view)) => view,
            None => {
                let dimension = match kind {
                    Kind::Cube => ViewDimension::Cube,
                    Kind::D3 => ViewDimension::D3,
                    _ => ViewDimension::D2,
                };
                let desc = ViewDesc { dimension: Some(dimension), levels: Some(count), ..ViewDesc::default() };
                let view = card.recorder.create_view_of(native.id, desc);
                native.views.push((count, view));
                view
            }
        };
        let linear =
            self.mag == e::LINEAR || matches!(self.min, e::LINEAR | e::LINEAR_MIPMAP_NEAREST | e::LINEAR_MIPMAP_LINEAR);
        let bound = (native.id, view, card.sampler(sampler));
        Ok(Some(Bound { bound, bias: self.bias, base: native.base, clamp: self.wrap.map(|wrap| wrap == e::CLAMP && linear) }))
    }

    fn sampler(&self) -> Outcome<SamplerDesc> {
        let filter = |linear: bool| if linear { FilterMode::Linear } else { FilterMode::Nearest };
        let linear = matches!(self.min, e::LINEAR | e::LINEAR_MIPMAP_NEAREST | e::LINEAR_MIPMAP_LINEAR);
        let between = matches!(self.min, e::NEAREST_MIPMAP_LINEAR | e::LINEAR_MIPMAP_LINEAR);
        let any = linear || self.mag == e::LINEAR;
        let mut address = [AddressMode::Repeat; 3];
        for (mode, wrap) in address.iter_mut().zip(self.wrap) {
            *mode = match wrap {
                e::REPEAT => AddressMode::Repeat,
                e::MIRRORED_REPEAT => AddressMode::MirrorRepeat,
                // With linear filters the border is half of what is read at 0 and 1.
                e::CLAMP if any => AddressMode::ClampToBorder,
                e::CLAMP | e::CLAMP_TO_EDGE => AddressMode::ClampToEdge,
                e::CLAMP_TO_BORDER => AddressMode::ClampToBorder,
                other => return Err(Fault::Unsupported(format!("wrap mode {}", names::name(other)))),
            };
        }
        // Coordinates that the shape does not have cannot reach a border.
        let used = match self.kind {
            Kind::D1 => 1,
            Kind::D2 | Kind::Rectangle => 2,
            Kind::D3 => 3,
            Kind::Cube => 0,
        };
        for mode in &mut address[used..] {
            *mode = AddressMode::ClampToEdge;
        }
        let bordered = address.contains(&AddressMode::ClampToBorder);
        let alpha = matches!(
            self.native.as_ref().map(|native| native.base),
            Some(Base::Alpha | Base::LuminanceAlpha | Base::Intensity)
        );
        let opaque = matches!(self.native.as_ref().map(|native| native.base), Some(Base::Rgb | Base::Luminance));
        let border = match self.border.map(|value| value.clamp(0.0, 1.0)) {
            _ if !bordered => BorderColor::TransparentBlack,
            // These keep alpha in another channel than the card's border has it.
            border if alpha && border != [0.0; 4] => {
                return Err(Fault::Unsupported("borders of textures of alpha, luminance-alpha or intensity".into()));
            }
            [0.0, 0.0, 0.0, a] if opaque || a == 1.0 => BorderColor::OpaqueBlack,
            [0.0, 0.0, 0.0, 0.0] => BorderColor::TransparentBlack,
            [1.0, 1.0, 1.0, a] if opaque || a == 1.0 => BorderColor::OpaqueWhite,
            _ => return Err(Fault::Unsupported("texture borders of a colour other than black and white".into())),
        };
        // Without mipmaps only the choice between the two filters depends on the level of detail.
        let lod = if self.mipmapped() { self.lod.map(|lod| lod.max(0.0)) } else { [0.0, 0.25] };
        Ok(SamplerDesc {
            address,
            mag: filter(self.mag == e::LINEAR),
            min: filter(linear),
            mipmap: filter(between),
            lod_min: lod[0],
            lod_max: lod[1].max(lod[0]),
            compare: None,
            anisotropy: if any && linear && between { (self.anisotropy as u16).clamp(1, 16) } else { 1 },
            border,
        })
    }

    /// Frees the card's texture.
    pub fn free(&mut self, card: &mut Card) {
        if let Some(native) = self.native.take() {
            let views: Vec<ViewId> = native.views.iter().map(|&(_, view)| view).collect();
            card.destroy(native.id, &views);
        }
    }
}
