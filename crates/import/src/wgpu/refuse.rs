//! What wgpu refuses of actions that it writes down before it checks them.
//!
//! A write that wgpu refuses does nothing, whatever its data, so that it must do nothing here. The rules are those of wgpu-core 30
//! (`Queue::write_buffer`, `Queue::write_texture`, `validate_texture_copy_range`, `validate_linear_texture_data`).

use gfx::format::Format;
use gfx::state::{Aspect, TextureDimension};
use trace::command::*;

use super::objects::{Buffer, Texture};
use super::schema::Limits;

/// What offsets and sizes of a buffer's writes are multiples of.
const ALIGNMENT: u64 = 4;

/// Refuses a write to a buffer. What unmapping a buffer writes has been checked when it was mapped.
pub fn buffer_write(buffer: &Buffer, offset: u64, size: u64, queued: bool) -> Result<(), String> {
    let bytes = buffer.size;
    if queued && !buffer.writable {
        return Err("the buffer has no usage COPY_DST".into());
    }
    if queued && !(size.is_multiple_of(ALIGNMENT) && offset.is_multiple_of(ALIGNMENT)) {
        return Err(format!("{size} bytes at offset {offset}, both must be multiples of {ALIGNMENT}"));
    }
    if offset.checked_add(size).is_none_or(|end| end > bytes) {
        return Err(format!("{size} bytes at offset {offset} reach past the end of the buffer of {bytes} bytes"));
    }
    Ok(())
}

/// Refuses a texture that is larger than the limits of its device allow.
pub fn texture(desc: &TextureDesc, limits: &Limits) -> Result<(), String> {
    let edge = match desc.dimension {
        TextureDimension::D1 => "maxTextureDimension1D",
        TextureDimension::D2 => "maxTextureDimension2D",
        TextureDimension::D3 => "maxTextureDimension3D",
    };
    let depth = if desc.dimension == TextureDimension::D2 { "maxTextureArrayLayers" } else { edge };
    let names = [("width", edge), ("height", edge), ("depth or layers", depth)];
    for ((what, limit), size) in names.into_iter().zip(desc.size) {
        if let Some(most) = limits.get(limit).filter(|&most| u64::from(size) > most) {
            return Err(format!("{what} is {size}, the device allows {most} ({limit})"));
        }
    }
    Ok(())
}

/// Refuses a write to a texture; else answers how many bytes of data it needs, from their beginning.
pub fn texture_write(texture: &Texture, to: &TextureEnd, layout: LinearLayout, size: [u32; 3]) -> Result<u64, String> {
    let desc = &texture.desc;
    let (format, name) = (desc.format, desc.format.name());
    if !texture.writable {
        return Err("the texture has no usage COPY_DST".into());
    }
    range(desc, to, size)?;
    let has_aspect = match to.aspect {
        Aspect::All => true,
        Aspect::DepthOnly => format.has_depth(),
        Aspect::StencilOnly => format.has_stencil(),
    };
    if !has_aspect {
        return Err(format!("{name} has no aspect {:?}", to.aspect));
    }
    let depth = format.has_depth() && to.aspect != Aspect::StencilOnly;
    if depth && format.has_stencil() && to.aspect == Aspect::All {
        return Err(format!("a write to both aspects of {name}"));
    }
    if depth && format != Format::Depth16Unorm {
        return Err(format!("the depth of {name} cannot be written"));
    }
    if desc.samples != 1 {
        return Err(format!("a write to a texture of {} samples", desc.samples));
    }
    bytes_needed(format, to.aspect, layout, size)
}

/// Refuses a part of a texture that is not in it.
fn range(desc: &TextureDesc, to: &TextureEnd, size: [u32; 3]) -> Result<(), String> {
    let TextureEnd { level, origin, .. } = *to;
    if level >= desc.levels {
        return Err(format!("level {level}, the texture has {}", desc.levels));
    }
    let block = desc.format.block_dim();
    let [width, height, depth] = desc.level_size(level);
    let depth = if desc.dimension == TextureDimension::D3 { depth } else { desc.layers() };
    // Blocks at an edge are whole.
    let extent = [width.next_multiple_of(block), height.next_multiple_of(block), depth];
    let whole = desc.format.is_depth_stencil() || desc.samples > 1;
    for axis in 0..3 {
        let (start, length, all) = (origin[axis], size[axis], extent[axis]);
        if start > all || all - start < length {
            return Err(format!("texels {start} + {length} reach past the {all} of level {level}"));
        }
        if whole && axis < 2 && length != all {
            return Err(format!("a part of level {level}: {} is written whole", desc.format.name()));
        }
        if axis < 2 && !(start.is_multiple_of(block) && length.is_multiple_of(block)) {
            return Err(format!("texels {start} + {length} of {} are no whole blocks", desc.format.name()));
        }
    }
    Ok(())
}

/// Bytes from the start of the data to the end of the last row of a copy: WebGPU's "required bytes in copy" plus the offset.
fn bytes_needed(format: Format, aspect: Aspect, layout: LinearLayout, size: [u32; 3]) -> Result<u64, String> {
    let block_bytes = if aspect == Aspect::StencilOnly { 1 } else { format.block_bytes() };
    let columns = u64::from(size[0].div_ceil(format.block_dim()));
    let rows = u64::from(size[1].div_ceil(format.block_dim()));
    let images = u64::from(size[2]);
    let row = columns * u64::from(block_bytes);
    let stride = layout.bytes_per_row.map_or(row, u64::from);
    let image_rows = layout.rows_per_image.map_or(rows, u64::from);
    if stride < row {
        return Err(format!("rows of {row} bytes are {stride} bytes apart"));
    }
    if image_rows < rows {
        return Err(format!("images of {rows} rows are {image_rows} rows apart"));
    }
    if layout.bytes_per_row.is_none() && (images > 1 || rows > 1) {
        return Err("several rows without the number of bytes between them".into());
    }
    if layout.rows_per_image.is_none() && images > 1 {
        return Err("several images without the number of rows between them".into());
    }
    if images == 0 {
        return Ok(layout.offset);
    }
    // Of a copy of no rows, the images before the last take room all the same.
    let before = (images - 1).checked_mul(image_rows).and_then(|rows| rows.checked_mul(stride));
    let last = rows.checked_sub(1).map_or(Some(0), |rows| rows.checked_mul(stride).and_then(|bytes| bytes.checked_add(row)));
    let needed = before.zip(last).and_then(|(before, last)| before.checked_add(last));
    needed.and_then(|n| n.checked_add(layout.offset)).ok_or_else(|| "the data of the copy is larger than any file".into())
}
