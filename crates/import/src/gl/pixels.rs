//! Pixel storage and transfer, raster positions, render modes. Rectangles of pixels that are drawn are refused by name.

use super::call::{Call, Fault, INVALID_ENUM, INVALID_VALUE, Outcome, Shape};
use super::consts as e;
use super::machine::{Gl, components, parameters};
use super::matrix;
use super::names;

pub(super) fn pixel_store(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (name, value) = (call.u32(0)?, call.f64(1)?);
    let store = &mut gl.unpack;
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
        // Packing is reading back.
        e::PACK_SWAP_BYTES..=e::PACK_ALIGNMENT | e::PACK_SKIP_IMAGES | e::PACK_IMAGE_HEIGHT => {}
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

pub(super) fn pixel_transfer(_: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (name, value) = (call.u32(0)?, parameters(call, 1)?[0]);
    let scale = matches!(name, e::RED_SCALE | e::GREEN_SCALE | e::BLUE_SCALE | e::ALPHA_SCALE | e::DEPTH_SCALE);
    if value == if scale { 1.0 } else { 0.0 } {
        return Ok(());
    }
    Err(Fault::Unsupported(format!("pixel transfer {}", names::name(name))))
}

pub(super) fn raster_position(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let position = components(call, shape, 0)?.0.map(|value| value as f32);
    let [x, y, z, w] = matrix::transform(&matrix::product(&gl.projection.top, &gl.modelview.top), position);
    let inside = [x, y, z].iter().all(|value| value.abs() <= w);
    let [vx, vy, width, height] = gl.state.viewport.map(|value| value as f32);
    let window = [vx + (x / w + 1.0) * 0.5 * width, vy + (y / w + 1.0) * 0.5 * height, (z / w + 1.0) * 0.5, w];
    gl.state.raster = inside.then_some(window);
    gl.state.raster_color = gl.state.current.color;
    Ok(())
}

pub(super) fn window_position(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let [x, y, z, _] = components(call, shape, 0)?.0.map(|value| value as f32);
    gl.state.raster = Some([x, y, z.clamp(0.0, 1.0), 1.0]);
    gl.state.raster_color = gl.state.current.color;
    Ok(())
}

pub(super) fn render_mode(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let mode = call.u32(0)?;
    if !matches!(mode, e::RENDER | e::FEEDBACK | e::SELECT) {
        return Err(INVALID_ENUM);
    }
    gl.flush()?;
    gl.render_mode = mode;
    Ok(())
}
