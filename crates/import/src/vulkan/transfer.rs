//! Copies, fills, clears, blits and resolves.

use gfx::format::{Format, TexelKind};
use gfx::state::{Aspect, FilterMode, TextureDimension};
use num::{BufferId, TextureId};
use trace::command::*;

use super::args::{Args, EXTENT, OFFSET};
use super::fault::{Fault, Outcome, unsupported};
use super::formats;
use super::generated::Blit;
use super::machine::Vulkan;
use super::objects::{Handle, known};
use super::pass::{Open, clear_color};
use super::state::Area;
use super::submission::Encoder;

/// Bytes of a fill with a value at most: they are written as they are.
const FILL_MAX: u64 = 64 << 20;

/// Layers of a level of an image.
#[derive(Clone, Copy)]
struct Layers {
    aspects: u32,
    level: u32,
    first: u32,
    count: u32,
}

impl Layers {
    fn new(of: Args<'_>, all: u32) -> Outcome<Layers> {
        let first = of.u32("baseArrayLayer")?;
        let count = match of.u32("layerCount")? {
            u32::MAX => all.saturating_sub(first),
            count => count,
        };
        Ok(Layers { aspects: of.u32("aspectMask")?, level: of.u32("mipLevel")?, first, count })
    }
}

/// One end of a copy, and its size in the third dimension.
fn end(texture: TextureId, desc: &TextureDesc, layers: Layers, offset: [u32; 3]) -> Outcome<TextureEnd> {
    let z = if desc.dimension == TextureDimension::D3 { offset[2] } else { layers.first };
    let aspect = formats::aspect(layers.aspects, desc.format)?;
    Ok(TextureEnd { texture, level: layers.level, origin: [offset[0], offset[1], z], aspect })
}

/// A size in whole blocks.
fn whole_blocks([width, height, depth]: [u32; 3], format: Format) -> [u32; 3] {
    let dim = format.block_dim();
    let whole = |size: u32| size.checked_next_multiple_of(dim).unwrap_or(u32::MAX);
    [whole(width), whole(height), depth]
}

impl Vulkan {
    /// Runs a command that copies, fills or clears. Answers whether it is one.
    pub fn transfer_command(&mut self, name: &str, call: Args<'_>, encoder: &mut Encoder) -> Outcome<bool> {
        if name == "vkCmdClearAttachments" {
            self.clear_attachments(call, encoder)?;
            return Ok(true);
        }
        const TRANSFERS: [(&str, &str); 12] = [
            ("vkCmdCopyBuffer", "pCopyBufferInfo"),
            ("vkCmdCopyImage", "pCopyImageInfo"),
            ("vkCmdCopyBufferToImage", "pCopyBufferToImageInfo"),
            ("vkCmdCopyImageToBuffer", "pCopyImageToBufferInfo"),
            ("vkCmdBlitImage", "pBlitImageInfo"),
            ("vkCmdResolveImage", "pResolveImageInfo"),
            ("vkCmdFillBuffer", ""),
            ("vkCmdUpdateBuffer", ""),
            ("vkCmdClearColorImage", ""),
            ("vkCmdClearDepthStencilImage", ""),
            ("vkCmdCopyQueryPoolResults", ""),
            ("vkCmdResetQueryPool", ""),
        ];
        let base = name.strip_suffix('2').unwrap_or(name);
        let Some(&(base, info)) = TRANSFERS.iter().find(|(known, _)| *known == base) else { return Ok(false) };
        if matches!(encoder.open, Open::Render(_)) {
            return unsupported("this command inside a pass");
        }
        self.close(&mut encoder.open);
        let call = if base.len() < name.len() { call.of(info)? } else { call };
        match base {
            "vkCmdCopyBuffer" => self.copy_buffer(call)?,
            "vkCmdCopyImage" => self.copy_image(call)?,
            "vkCmdCopyBufferToImage" => self.copy_buffer_image(call, true)?,
            "vkCmdCopyImageToBuffer" => self.copy_buffer_image(call, false)?,
            "vkCmdBlitImage" => self.blit_image(call)?,
            "vkCmdResolveImage" => self.resolve_image(call)?,
            "vkCmdFillBuffer" => self.fill_buffer(call)?,
            "vkCmdUpdateBuffer" => {
                let bytes = call.bytes("pData")?;
                let (id, offset, _) = self.range(call.u64("dstBuffer")?, call.u64("dstOffset")?, Some(bytes.len() as u64))?;
                self.card.write_buffer(id, offset, "update", bytes);
            }
            "vkCmdClearColorImage" => self.clear_color_image(call)?,
            "vkCmdClearDepthStencilImage" => self.clear_depth_image(call)?,
            "vkCmdCopyQueryPoolResults" => self.copy_results(call)?,
            _ => {}
        }
        Ok(true)
    }

    fn copy_buffer(&mut self, call: Args<'_>) -> Outcome {
        let (from, to) = (call.u64("srcBuffer")?, call.u64("dstBuffer")?);
        for region in call.list("pRegions")? {
            let size = Some(region.u64("size")?);
            let (source, from, bytes) = self.range(from, region.u64("srcOffset")?, size)?;
            let (target, to, _) = self.range(to, region.u64("dstOffset")?, size)?;
            if source == target && from.abs_diff(to) < bytes {
                return unsupported("a copy of bytes that overlap in memory");
            }
            self.card.copy_buffer_to_buffer((source, from), (target, to), bytes);
        }
        Ok(())
    }

    fn fill_buffer(&mut self, call: Args<'_>) -> Outcome {
        let size = Some(call.u64("size")?).filter(|&size| size != !0);
        let (buffer, offset, mut size) = self.range(call.u64("dstBuffer")?, call.u64("dstOffset")?, size)?;
        size -= size % 4;
        match call.u32("data")? {
            0 => self.card.push(Command::ClearBuffer { buffer, offset, size: Some(size) }),
            _ if size > FILL_MAX => return unsupported(format!("a fill of {size} bytes")),
            value => self.card.write_buffer(buffer, offset, "fill", value.to_le_bytes().repeat((size / 4) as usize)),
        }
        Ok(())
    }

    fn copy_image(&mut self, call: Args<'_>) -> Outcome {
        let (from, to) = (call.u64("srcImage")?, call.u64("dstImage")?);
        let (source, a) = (self.texture(from)?, self.texture_desc(from)?);
        let (target, b) = (self.texture(to)?, self.texture_desc(to)?);
        for region in call.list("pRegions")? {
            let layers = Layers::new(region.of("srcSubresource")?, a.layers())?;
            let others = Layers::new(region.of("dstSubresource")?, b.layers())?;
            let [width, height, depth] = region.triple("extent", EXTENT)?;
            let from_end = end(source, &a, layers, region.triple("srcOffset", OFFSET)?)?;
            let to_end = end(target, &b, others, region.triple("dstOffset", OFFSET)?)?;
            let size = whole_blocks([width, height, depth.max(layers.count).max(others.count)], a.format);
            let same =
                a.format == b.format || a.format.name().trim_end_matches("-srgb") == b.format.name().trim_end_matches("-srgb");
            let apart = source != target || from_end.level != to_end.level || {
                (0..3).any(|axis| from_end.origin[axis].abs_diff(to_end.origin[axis]) >= size[axis])
            };
            if same && apart {
                self.card.copy_texture_to_texture(from_end, to_end, size);
            } else {
                self.copy_by_buffer((from_end, a.format), (to_end, b.format), size)?;
            }
        }
        if !self.windows && known(self.objects.images.get(to), "image", to)?.linear {
            self.copied_out(from, 0, 0)?;
        }
        Ok(())
    }

    /// Copies texels whose formats differ, or that overlap, by a buffer.
    fn copy_by_buffer(&mut self, from: (TextureEnd, Format), to: (TextureEnd, Format), size: [u32; 3]) -> Outcome {
        let (Some(bytes), Some(others)) =
            (trace::copy_block_bytes(from.1, from.0.aspect), trace::copy_block_bytes(to.1, to.0.aspect))
        else {
            return unsupported("a copy of depth and stencil at once between formats");
        };
        if bytes != others {
            return unsupported(format!("a copy from {} to {}", from.1.name(), to.1.name()));
        }
        let blocks = |size: [u32; 3], dim: u32| [size[0].div_ceil(dim), size[1].div_ceil(dim), size[2]];
        let [columns, rows, images] = blocks(size, from.1.block_dim());
        let row = columns.saturating_mul(bytes);
        let all = u64::from(row).saturating_mul(rows.into()).saturating_mul(images.into());
        if let Err(error) = self.limits.memory_bytes.check(all) {
            return Err(Fault::Limit(error.to_string()));
        }
        let buffer = self.card.create_buffer("copy", all);
        let layout = LinearLayout { offset: 0, bytes_per_row: Some(row), rows_per_image: Some(rows) };
        self.card.copy_texture_to_buffer(from.0, buffer, layout, size);
        let dim = to.1.block_dim();
        self.card.copy_buffer_to_texture(buffer, layout, to.0, [columns.saturating_mul(dim), rows.saturating_mul(dim), images]);
        self.card.push(Command::Destroy(Object::Buffer(buffer)));
        Ok(())
    }

    fn copy_buffer_image(&mut self, call: Args<'_>, to_image: bool) -> Outcome {
        let (buffer, image) = if to_image { ("srcBuffer", "dstImage") } else { ("dstBuffer", "srcImage") };
        let (buffer, image) = (call.u64(buffer)?, call.u64(image)?);
        let (texture, desc) = (self.texture(image)?, self.texture_desc(image)?);
        let (id, first, bytes): (BufferId, u64, u64) = self.range(buffer, 0, None)?;
        let mut last = None;
        for region in call.list("pRegions")? {
            let layers = Layers::new(region.of("imageSubresource")?, desc.layers())?;
            let end = end(texture, &desc, layers, region.triple("imageOffset", OFFSET)?)?;
            let [width, height, depth] = region.triple("imageExtent", EXTENT)?;
            let size = whole_blocks([width, height, depth.max(layers.count)], desc.format);
            let block = trace::copy_block_bytes(desc.format, end.aspect);
            let Some(block) = block else { return unsupported("a copy of depth and stencil at once") };
            let dim = desc.format.block_dim();
            let given = |name: &str| -> Outcome<Option<u32>> { Ok(Some(region.u32(name)?).filter(|&length| length != 0)) };
            let row = given("bufferRowLength")?.map(|texels| texels.div_ceil(dim).saturating_mul(block));
            let rows = given("bufferImageHeight")?.map(|rows| rows.div_ceil(dim));
            let offset = first.saturating_add(region.u64("bufferOffset")?);
            let layout = LinearLayout { offset, bytes_per_row: row, rows_per_image: rows };
            let extent = layout.extent(desc.format, block, size).map_err(Fault::Damaged)?;
            if extent.end > first + bytes {
                return Err(Fault::Damaged(format!("a copy reaches past the {bytes} bytes of buffer {buffer}")));
            }
            if to_image {
                self.card.copy_buffer_to_texture(id, layout, end, size);
            } else {
                self.card.copy_texture_to_buffer(end, id, layout, size);
                last = Some((layers.level, layers.first));
            }
        }
        if let (false, Some((level, layer))) = (self.windows, last) {
            self.copied_out(image, level, layer)?;
        }
        Ok(())
    }

    /// Keeps what a program without a window copies out: the last is its picture.
    fn copied_out(&mut self, image: Handle, level: u32, layer: u32) -> Outcome {
        let desc = self.texture_desc(image)?;
        let renderable =
            !desc.format.is_compressed() && desc.format.kind() == TexelKind::Float && desc.format != Format::Rgb9e5Ufloat;
        if !renderable || desc.dimension != TextureDimension::D2 || desc.samples != 1 {
            return Ok(());
        }
        let [width, height, _] = desc.level_size(level);
        let own = TextureDesc { size: [width, height, 1], levels: 1, opaque: true, ..desc };
        let id = match &self.copied_out {
            Some((id, known)) if *known == own => *id,
            _ => {
                let id = self.card.create_texture("copied out", own.clone());
                if let Some((old, _)) = self.copied_out.replace((id, own)) {
                    self.card.push(Command::Destroy(Object::Texture(old)));
                }
                id
            }
        };
        let whole = |texture, level, layer| TextureEnd { texture, level, origin: [0, 0, layer], aspect: Aspect::All };
        let source = self.texture(image)?;
        self.card.copy_texture_to_texture(whole(source, level, layer), whole(id, 0, 0), [width, height, 1]);
        Ok(())
    }

    /// The subresources of the ranges of a clear: level, layers or slices, aspects.
    fn ranges(&self, image: Handle, call: Args<'_>) -> Outcome<Vec<(u32, u32, u32)>> {
        let desc = self.texture_desc(image)?;
        let mut all = Vec::new();
        for range in call.list("pRanges")? {
            let rest = |name: &str, first: u32, all: u32| -> Outcome<u32> {
                Ok(Some(range.u32(name)?).filter(|&count| count != !0).unwrap_or(all.saturating_sub(first)))
            };
            let (level, layer) = (range.u32("baseMipLevel")?, range.u32("baseArrayLayer")?);
            let (levels, aspects) = (rest("levelCount", level, desc.levels)?, range.u32("aspectMask")?);
            for level in level..level.saturating_add(levels).min(desc.levels) {
                let (layer, layers) = match desc.dimension {
                    TextureDimension::D3 => (0, desc.level_size(level)[2]),
                    _ => (layer, rest("layerCount", layer, desc.layers())?),
                };
                let end = layer.saturating_add(layers).min(desc.level_size(level)[2]);
                all.extend((layer..end).map(|layer| (level, layer, aspects)));
            }
        }
        Ok(all)
    }

    fn clear_color_image(&mut self, call: Args<'_>) -> Outcome {
        let image = call.u64("image")?;
        let format = self.texture_desc(image)?.format;
        let words = call.words("pColor")?;
        let bits = std::array::from_fn(|at| words.get(at).copied().unwrap_or(0));
        for (level, layer, _) in self.ranges(image, call)? {
            if format.is_compressed() || matches!(format, Format::Rgb9e5Ufloat | Format::R64Uint) {
                return unsupported(format!("a clear of {}", format.name()));
            }
            let (view, depth_slice) = self.subresource(image, None, level, layer)?;
            let clear = Some(clear_color(bits, format));
            let target = ColorAttachment { view, depth_slice, resolve: None, clear, store: true };
            drop(self.card.begin_render_pass([target], None));
        }
        Ok(())
    }

    fn clear_depth_image(&mut self, call: Args<'_>) -> Outcome {
        let image = call.u64("image")?;
        let format = self.texture_desc(image)?.format;
        let value = call.of("pDepthStencil")?;
        let (depth, stencil) = (value.f32("depth")?.clamp(0.0, 1.0), value.u32("stencil")? & 255);
        for (level, layer, aspects) in self.ranges(image, call)? {
            let (view, _) = self.subresource(image, None, level, layer)?;
            let depth_clear = Some(depth).filter(|_| format.has_depth() && aspects & 2 != 0);
            let stencil_clear = Some(stencil).filter(|_| format.has_stencil() && aspects & 4 != 0);
            let target = DepthAttachment { depth_clear, stencil_clear, ..trace::record::load_depth(view) };
            drop(self.card.begin_render_pass([], Some(target)));
        }
        Ok(())
    }

    fn resolve_image(&mut self, call: Args<'_>) -> Outcome {
        let (from, to) = (call.u64("srcImage")?, call.u64("dstImage")?);
        let (a, b) = (self.texture_desc(from)?, self.texture_desc(to)?);
        for region in call.list("pRegions")? {
            let layers = Layers::new(region.of("srcSubresource")?, a.layers())?;
            let others = Layers::new(region.of("dstSubresource")?, b.layers())?;
            let [width, height, _] = region.triple("extent", EXTENT)?;
            let zero = region.triple("srcOffset", OFFSET)? == [0; 3] && region.triple("dstOffset", OFFSET)? == [0; 3];
            let whole = [width, height] == a.size[..2] && [width, height] == b.level_size(others.level)[..2];
            if !zero || !whole || a.format != b.format {
                return unsupported("a resolve of a part of an image, or to another format");
            }
            let (view, _) = self.subresource(from, None, layers.level, layers.first)?;
            let (resolve, _) = self.subresource(to, None, others.level, others.first)?;
            let target = ColorAttachment { resolve: Some(resolve), ..trace::record::load(view) };
            drop(self.card.begin_render_pass([target], None));
        }
        Ok(())
    }

    fn blit_image(&mut self, call: Args<'_>) -> Outcome {
        let (from, to) = (call.u64("srcImage")?, call.u64("dstImage")?);
        let (a, b) = (self.texture_desc(from)?, self.texture_desc(to)?);
        let filter = formats::filter(call.u32("filter")?)?;
        for region in call.list("pRegions")? {
            let layers = Layers::new(region.of("srcSubresource")?, a.layers())?;
            let others = Layers::new(region.of("dstSubresource")?, b.layers())?;
            let corners = |name: &str| -> Outcome<[[i32; 3]; 2]> {
                let list = region.list(name)?;
                let corner = |of: &Args<'_>| -> Outcome<[i32; 3]> { Ok([of.i32("x")?, of.i32("y")?, of.i32("z")?]) };
                match &list[..] {
                    [first, last] => Ok([corner(first)?, corner(last)?]),
                    _ => Err(Fault::Damaged("a blit without two corners".into())),
                }
            };
            let (source, target) = (corners("srcOffsets")?, corners("dstOffsets")?);
            let flat = |[first, last]: [[i32; 3]; 2]| last[2].checked_sub(first[2]) == Some(1);
            if a.dimension == TextureDimension::D3 && !(flat(source) && flat(target)) {
                return unsupported("a blit of several slices of a 3D image");
            }
            let slice = |desc: &TextureDesc, own: Layers, z: i32, by: u32| match desc.dimension {
                TextureDimension::D3 => z as u32,
                _ => own.first.saturating_add(by),
            };
            for by in 0..others.count {
                let ends = |[first, last]: [[i32; 3]; 2]| [first[0], first[1], last[0], last[1]];
                self.blit(&Blit {
                    from,
                    from_level: layers.level,
                    from_layer: slice(&a, layers, source[0][2], by),
                    to,
                    to_level: others.level,
                    to_layer: slice(&b, others, target[0][2], by),
                    aspects: layers.aspects,
                    source: ends(source),
                    target: ends(target),
                    linear: filter == FilterMode::Linear,
                })?;
            }
        }
        Ok(())
    }

    fn clear_attachments(&mut self, call: Args<'_>, encoder: &mut Encoder) -> Outcome {
        if encoder.pass_refused {
            return Ok(());
        }
        let mut open = std::mem::take(&mut encoder.open);
        let waiting = if let Open::Render(pass) = &open { pass.commands.len() } else { 0 };
        let mut cleared = self.clear_in(call, &mut open);
        if let (Open::Render(pass), Some(_)) = (&mut open, encoder.condition) {
            for command in &mut pass.commands[waiting..] {
                let draw = self.draw_under(command.clone(), encoder.condition);
                cleared = cleared.and(draw.map(|draw| *command = draw));
            }
        }
        encoder.open = open;
        cleared
    }

    fn clear_in(&mut self, call: Args<'_>, open: &mut Open) -> Outcome {
        let Open::Render(pass) = open else { return unsupported("a clear of targets outside of a pass") };
        for rect in call.list("pRects")? {
            let area = Area::new(rect.of("rect")?)?;
            if rect.u32("baseArrayLayer")? != 0 || rect.u32("layerCount")? != 1 {
                return unsupported("a clear of several layers of targets");
            }
            for attachment in call.list("pAttachments")? {
                let words = attachment.words("clearValue")?;
                let bits: [u32; 4] = std::array::from_fn(|at| words.get(at).copied().unwrap_or(0));
                let aspects = attachment.u32("aspectMask")?;
                if aspects & 1 != 0 {
                    let number = attachment.u32("colorAttachment")?;
                    if number != !0 {
                        self.clear_color_part(pass, number as usize, bits, area)?;
                    }
                } else {
                    self.clear_depth_part(pass, aspects, bits, area)?;
                }
            }
        }
        Ok(())
    }
}
