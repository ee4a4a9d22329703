//! Rules of commands between passes: writes, copies, clears, query results, present.

use gfx::format::Format;
use gfx::state::{Aspect, TextureDimension, ViewDimension};

use super::super::geometry::copy_block_bytes;
use super::*;

impl Checker<'_> {
    pub(super) fn between_passes(&mut self, command: &Command) -> CheckResult {
        match command {
            Command::WriteBuffer { id, offset, data } => {
                let length = *self.buffers.get(id.0)?;
                self.use_data(data)?;
                range_fits(&id, *offset, data.size, length)?;
                self.summary.written_bytes += data.size;
            }
            Command::WriteTexture { to, data, layout, size } => {
                self.use_data(data)?;
                let end = self.linear_end(to, layout, *size)?;
                range_fits(&"the data", layout.offset, end.saturating_sub(layout.offset), data.size)?;
                self.summary.written_bytes += data.size;
            }
            Command::CopyBufferToBuffer { from, from_offset, to, to_offset, size } => {
                range_fits(&from, *from_offset, *size, *self.buffers.get(from.0)?)?;
                range_fits(&to, *to_offset, *size, *self.buffers.get(to.0)?)?;
                let apart = from != to || from_offset.abs_diff(*to_offset) >= *size;
                ensure!(apart, "source and destination overlap in {from}");
            }
            Command::CopyBufferToTexture { from: buffer, layout, to: end, size }
            | Command::CopyTextureToBuffer { from: end, to: buffer, layout, size } => {
                let length = *self.buffers.get(buffer.0)?;
                let last = self.linear_end(end, layout, *size)?;
                range_fits(&buffer, layout.offset, last.saturating_sub(layout.offset), length)?;
            }
            Command::CopyTextureToTexture { from, to, size } => self.copy_texture(from, to, *size)?,
            Command::ClearBuffer { buffer, offset, size } => {
                open_range(&buffer, *offset, *size, *self.buffers.get(buffer.0)?)?;
            }
            Command::ClearTexture { texture, aspect, base_level, levels, base_layer, layers } => {
                let desc = self.textures.get(texture.0)?;
                ensure!(has_aspect(desc, *aspect), "{} has no aspect {aspect:?}", desc.format.name());
                for (what, base, count, all) in
                    [("levels", *base_level, *levels, desc.levels), ("layers", *base_layer, *layers, desc.layers())]
                {
                    let count = count.unwrap_or(all.saturating_sub(base));
                    let end = base.checked_add(count);
                    ensure!(end.is_some_and(|end| end <= all), "{what} {base} + {count} are not in the texture's {all}");
                }
            }
            Command::ResolveQuerySet { set, first, count, to, to_offset } => {
                let (kind, all) = *self.query_sets.get(set.0)?;
                let end = first.checked_add(*count);
                ensure!(end.is_some_and(|end| end <= all), "queries {first} + {count} are not in the set's {all}");
                let bytes = u64::from(*count) * u64::from(kind.results()) * 8;
                range_fits(&to, *to_offset, bytes, *self.buffers.get(to.0)?)?;
            }
            &Command::SetSprite { index, view, .. } => {
                ensure!(index < SPRITES, "sprite {index}: a display has {SPRITES}, from 0 to {}", SPRITES - 1);
                if let Some(view) = view {
                    let found = self.views.get(view.0)?;
                    let (name, [width, height, _]) = (found.format.name(), found.size);
                    let edge = SPRITE_EDGE;
                    ensure!(found.samples == 1, "{view} is multisampled: a sprite has one sample a texel; resolve it first");
                    ensure!(
                        in_sprites(found.format),
                        "{view} is {name}: a sprite is rgba8unorm or bgra8unorm, with or without -srgb"
                    );
                    let flat = found.dimension == ViewDimension::D2 && found.levels == 1 && found.layers == 1;
                    ensure!(flat, "{view} is more than one level and layer of a 2D texture");
                    ensure!(
                        width.max(height) <= edge,
                        "{view} has {width} x {height} texels: a sprite has at most {edge} x {edge}; cut it into several"
                    );
                }
                self.sprites[index as usize] = view;
            }
            Command::Present { texture } => {
                let desc = self.textures.get(texture.0)?;
                let flat = desc.dimension == TextureDimension::D2 && desc.samples == 1;
                let shown = flat && resource::renderable(desc.format);
                ensure!(shown, "{texture} is no single-sampled 2D colour texture");
                for (index, view) in self.sprites.iter().enumerate().filter_map(|(index, view)| Some((index, (*view)?))) {
                    self.views
                        .get(view.0)
                        .map_err(|reason| format!("sprite {index}: {reason}; SetSprite without a view ends it"))?;
                    let name = desc.format.name();
                    ensure!(
                        in_sprites(desc.format),
                        "sprites lie over pictures of rgba8unorm or bgra8unorm, with or without -srgb; {texture} is {name}"
                    );
                }
                self.summary.presented = Some([desc.size[0], desc.size[1]]);
            }
            _ => unreachable!("only commands between passes come here"),
        }
        Ok(())
    }

    pub(super) fn use_data(&mut self, data: &Data) -> CheckResult {
        self.trace.data(data)?;
        self.use_blob(&data.blob);
        Ok(())
    }

    /// Checks that a query exists and is of a kind.
    pub(super) fn query(&self, set: QuerySetId, index: u32, right: impl Fn(QueryKind) -> bool) -> CheckResult {
        let (kind, count) = *self.query_sets.get(set.0)?;
        ensure!(right(kind), "{set} counts {kind:?}");
        ensure!(index < count, "query {index} is not in the {count} of {set}");
        Ok(())
    }

    /// Checks one end of a copy and answers where the other, linear end stops.
    fn linear_end(&self, end: &TextureEnd, layout: &LinearLayout, size: [u32; 3]) -> Result<u64, Reason> {
        let desc = self.texture_end(end, size)?;
        ensure!(desc.samples == 1, "{} is multisampled", end.texture);
        let block = copy_block_bytes(desc.format, end.aspect)
            .ok_or_else(|| format!("aspect {:?} of {} is not one plane of texels", end.aspect, desc.format.name()))?;
        Ok(layout.extent(desc.format, block, size)?.end)
    }

    /// Checks that a box of texels is inside a level of a texture.
    fn texture_end(&self, end: &TextureEnd, size: [u32; 3]) -> Result<&TextureDesc, Reason> {
        let desc = self.textures.get(end.texture.0)?;
        ensure!(end.level < desc.levels, "level {} is not in the {} of {}", end.level, desc.levels, end.texture);
        ensure!(has_aspect(desc, end.aspect), "{} has no aspect {:?}", desc.format.name(), end.aspect);
        let level = desc.level_size(end.level);
        let dim = desc.format.block_dim();
        for axis in 0..3 {
            let (origin, size) = (end.origin[axis], size[axis]);
            let dim = if axis < 2 { dim } else { 1 };
            // A level of a compressed texture holds whole blocks, also where fewer texels are left.
            let length = level[axis].next_multiple_of(dim);
            let stop = origin.checked_add(size);
            let texture = end.texture;
            let name = ["x", "y", "z"][axis];
            ensure!(
                stop.is_some_and(|stop| stop <= length),
                "{name} {origin} + {size} reaches past the {length} texels of level {} of {texture}",
                end.level
            );
            let whole = origin.is_multiple_of(dim) && (size.is_multiple_of(dim) || stop == Some(level[axis]));
            ensure!(whole, "{name} {origin} + {size} cuts blocks of {texture}");
        }
        Ok(desc)
    }

    fn copy_texture(&self, from: &TextureEnd, to: &TextureEnd, size: [u32; 3]) -> CheckResult {
        let (a, b) = (self.texture_end(from, size)?, self.texture_end(to, size)?);
        ensure!(
            same_but_srgb(a.format, b.format) || (from.aspect != Aspect::All && from.aspect == to.aspect),
            "from {} to {}",
            a.format.name(),
            b.format.name()
        );
        ensure!(from.aspect == to.aspect, "from aspect {:?} to {:?}", from.aspect, to.aspect);
        ensure!(a.samples == b.samples, "from {} samples to {}", a.samples, b.samples);
        if from.texture == to.texture && from.level == to.level {
            // Layers of one texture may be copied to each other, texels of one layer not.
            let shared = (0..3).all(|axis| from.origin[axis].abs_diff(to.origin[axis]) < size[axis]);
            ensure!(!shared, "source and destination overlap in {}", from.texture);
        }
        Ok(())
    }
}

fn has_aspect(desc: &TextureDesc, aspect: Aspect) -> bool {
    match aspect {
        Aspect::All => true,
        Aspect::DepthOnly => desc.format.has_depth(),
        Aspect::StencilOnly => desc.format.has_stencil(),
    }
}

/// Whether a display can lay texels of this format over its lines, and over lines of it.
fn in_sprites(format: Format) -> bool {
    matches!(format, Format::Rgba8Unorm | Format::Rgba8UnormSrgb | Format::Bgra8Unorm | Format::Bgra8UnormSrgb)
}
