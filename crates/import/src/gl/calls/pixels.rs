//! Pixel storage and transfer, raster positions, render modes.

use gl_shader::{PLANES, UNITS, consts as e};

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape, parameters};
use crate::gl::draw::lit::{colors, map_coordinate};
use crate::gl::machine::Gl;
use crate::gl::state::framebuffers::RenderMode;
use crate::gl::{call, elements, matrix};

pub fn pixel_store(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (name, value) = (call.u32(0)?, call.f64(1)?);
    let store = &mut gl.context.unpack;
    let size = || if (0.0..=1e6).contains(&value) { Ok(value as u32) } else { Err(INVALID_VALUE) };
    match name {
        e::UNPACK_ALIGNMENT if [1.0, 2.0, 4.0, 8.0].contains(&value) => store.alignment = value as u32,
        e::UNPACK_ALIGNMENT => return Err(INVALID_VALUE),
        e::UNPACK_ROW_LENGTH => store.row_length = size()?,
        e::UNPACK_IMAGE_HEIGHT => store.image_height = size()?,
        e::UNPACK_SKIP_PIXELS => store.skip[0] = size()?,
        e::UNPACK_SKIP_ROWS => store.skip[1] = size()?,
        e::UNPACK_SKIP_IMAGES => store.skip[2] = size()?,
        e::UNPACK_SWAP_BYTES => store.swap = value != 0.0,
        e::UNPACK_LSB_FIRST => store.low_first = value != 0.0,
        // Pixel packing is for reading back.
        e::PACK_SWAP_BYTES..=e::PACK_ALIGNMENT | e::PACK_SKIP_IMAGES | e::PACK_IMAGE_HEIGHT => {}
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

pub fn pixel_transfer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = call.u32(0)?;
    let value = parameters(call, 1)?.first().copied().ok_or(INVALID_VALUE)?;
    let transfer = &mut gl.state.pixels.transfer;
    match name {
        e::RED_SCALE => transfer.scale[0] = value as f32,
        e::GREEN_SCALE => transfer.scale[1] = value as f32,
        e::BLUE_SCALE => transfer.scale[2] = value as f32,
        e::ALPHA_SCALE => transfer.scale[3] = value as f32,
        e::RED_BIAS => transfer.bias[0] = value as f32,
        GREEN_BIAS => transfer.bias[1] = value as f32,
        BLUE_BIAS => transfer.bias[2] = value as f32,
        ALPHA_BIAS => transfer.bias[3] = value as f32,
        e::DEPTH_SCALE => transfer.depth[0] = value as f32,
        e::DEPTH_BIAS => transfer.depth[1] = value as f32,
        e::MAP_COLOR => transfer.map_color = value != 0.0,
        e::MAP_STENCIL => transfer.map_stencil = value != 0.0,
        e::INDEX_SHIFT => transfer.index[0] = value.clamp(-31.0, 31.0) as i32,
        e::INDEX_OFFSET => transfer.index[1] = value as i32,
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

// Each bias enumerant is one more than the scale of its channel.
const GREEN_BIAS: u32 = e::GREEN_SCALE + 1;
const BLUE_BIAS: u32 = e::BLUE_SCALE + 1;
const ALPHA_BIAS: u32 = e::ALPHA_SCALE + 1;

pub fn pixel_map(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (map, size) = (call.u32(0)?.wrapping_sub(e::PIXEL_MAP_I_TO_I) as usize, call.size(1)? as usize);
    if map >= 10 {
        return Err(INVALID_ENUM);
    }
    // Maps of indices have sizes that are powers of two.
    if !(1..=MAP_MAX).contains(&size) || map < 6 && !size.is_power_of_two() {
        return Err(INVALID_VALUE);
    }
    let values = match gl.context.unpack.buffer {
        0 => call.numbers(2)?,
        _ => {
            let bytes = gl.pixel_bytes(call.arg(2))?.unwrap_or_default();
            let element = if shape.scalar == Scalar::Ushort { 2 } else { 4 };
            let bytes = bytes.get(..size * element).ok_or(INVALID_OPERATION)?;
            bytes.chunks_exact(element).map(|bytes| elements::read(shape.scalar, bytes)).collect()
        }
    };
    let values = values.get(..size).ok_or_else(|| Fault::Damaged(format!("a map of fewer than {size} numbers")))?;
    let value = |&value: &f64| if map < 2 { value as f32 } else { shape.scalar.normalized(value) };
    gl.context.pixel_maps.0[map] = values.iter().map(value).collect();
    Ok(())
}

/// Maximum number of elements of a pixel map.
const MAP_MAX: usize = 1 << 16;

pub fn pixel_zoom(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.pixels.zoom = [call.f32(0)?, call.f32(1)?];
    Ok(())
}

pub fn raster_position(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let position = call::components(call, shape, 0)?.0.map(|value| value as f32);
    let eye = matrix::transform(&gl.context.matrices.modelview.top, position);
    let [x, y, z, w] = matrix::transform(&gl.context.matrices.projection.top, eye);
    let cut = |k: usize| gl.state.is(e::CLIP_PLANE0 + k as u32) && matrix::at_plane(gl.state.transform.planes[k], eye) < 0.0;
    let inside = w > 0.0 && [x, y, z].iter().all(|value| value.abs() <= w) && !(0..PLANES).any(cut);
    let [vx, vy, width, height] = gl.state.transform.viewport.map(|value| value as f32);
    let [near, far] = gl.state.transform.depth_range;
    let depth = near + (z / w + 1.0) * 0.5 * (far - near);
    let window = [vx + (x / w + 1.0) * 0.5 * width, vy + (y / w + 1.0) * 0.5 * height, depth, w];
    gl.state.raster.position = inside.then_some(window);
    let mut vertex = gl.state.current.clone();
    vertex.position = position;
    (vertex.color, vertex.secondary) = colors(&gl.state, &gl.context.matrices.modelview.top, &vertex);
    for unit in 0..UNITS {
        let state = &gl.state.texturing.units[unit];
        let mut coordinates = vertex.texture(unit);
        for k in (0..4).filter(|k| state.generated & 1 << k != 0) {
            let generation = state.generation[k];
            coordinates[k] = match generation.mode {
                e::OBJECT_LINEAR => matrix::at_plane(generation.object, position),
                e::EYE_LINEAR => matrix::at_plane(generation.eye, eye),
                mode => map_coordinate(&gl.state, &gl.context.matrices.modelview.top, &vertex, mode, k),
            };
        }
        vertex.set_texture(unit, matrix::transform(&gl.context.matrices.texture[unit].top, coordinates));
    }
    gl.state.raster.vertex = vertex;
    Ok(())
}

pub fn window_position(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let [x, y, z, _] = call::components(call, shape, 0)?.0.map(|value| value as f32);
    let [near, far] = gl.state.transform.depth_range;
    gl.state.raster.position = Some([x, y, near + z.clamp(0.0, 1.0) * (far - near), 1.0]);
    let mut vertex = gl.state.current.clone();
    vertex.color = vertex.color.map(|value| value.clamp(0.0, 1.0));
    gl.state.raster.vertex = vertex;
    Ok(())
}

pub fn render_mode(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mode = call.u32(0)?;
    if !matches!(mode, e::RENDER | e::FEEDBACK | e::SELECT) {
        return Err(INVALID_ENUM);
    }
    gl.flush()?;
    gl.context.render_mode = RenderMode(mode);
    Ok(())
}
