//! Capabilities, lighting, fog, and how primitives are rasterised.

use gl_shader::arb::program::ProgramStage;
use gl_shader::key::FogDistance;
use gl_shader::{LIGHTS, TARGETS, consts as e};

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape, padded};
use crate::gl::draw::lit::colors;
use crate::gl::machine::Gl;
use crate::gl::state::arb::switch_of;
use crate::gl::state::lighting::Material;
use crate::gl::state::materials::{ChangingMaterial, tracked_parameters, tracks};
use crate::gl::state::restart::RESTART_CLIENT;
use crate::gl::state::server::capability;
use crate::gl::texels::transfer::values;
use crate::gl::{matrix, names};

fn set(gl: &mut Gl, cap: u32, on: bool) -> GlResult {
    if cap == e::COLOR_MATERIAL && on != gl.state.is(cap) {
        gl.settle_color_material()?;
        gl.context.material_tracking.note_switched();
    }
    if let Some(bit) = capability(cap) {
        let switched = on != gl.state.is(cap);
        gl.state.enabled = if on { gl.state.enabled | bit } else { gl.state.enabled & !bit };
        return if cap == e::COLOR_MATERIAL && switched { gl.apply_materials() } else { Ok(()) };
    }
    if let Some(bit) = switch_of(cap) {
        gl.state.programs = if on { gl.state.programs | bit } else { gl.state.programs & !bit };
        return Ok(());
    }
    if cap == e::BLEND {
        gl.state.color.writes.iter_mut().for_each(|writes| writes.blended = on);
        return Ok(());
    }
    if cap != RESTART_CLIENT && gl.context.arrays.restart.switch(cap, on) {
        return Ok(());
    }
    // Mesa switches arrays so, too.
    if let Ok(slot) = gl.context.arrays.slot(cap) {
        gl.context.arrays.switch(slot, on);
        return Ok(());
    }
    let unit = &mut gl.state.texturing.units[gl.state.texturing.active];
    if let Some(k) = TARGETS.iter().position(|&target| target == cap) {
        unit.enabled = unit.enabled & !(1 << k) | u8::from(on) << k;
        return Ok(());
    }
    if (e::TEXTURE_GEN_S..=e::TEXTURE_GEN_Q).contains(&cap) {
        let k = cap - e::TEXTURE_GEN_S;
        unit.generated = unit.generated & !(1 << k) | u8::from(on) << k;
        return Ok(());
    }
    if cap == e::TEXTURE_CUBE_MAP_SEAMLESS {
        gl.context.samplers.seamless = on;
        return Ok(());
    }
    // Capabilities that are off already, or that do not change the picture.
    let harmless = [e::INDEX_LOGIC_OP, e::DEBUG_OUTPUT, e::DEBUG_OUTPUT_SYNCHRONOUS];
    if !on || harmless.contains(&cap) {
        return Ok(());
    }
    Err(Fault::Unsupported(format!("glEnable({})", names::name(cap))))
}

/// `glEnablei(capability, buffer)`, `glDisablei`: of one colour buffer.
pub fn set_of_buffer<const ON: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (cap, k) = (call.u32(0)?, call.u32(1)? as usize);
    if cap != e::BLEND {
        return Err(Fault::Unsupported(format!("{}({})", call.function.name, names::name(cap))));
    }
    gl.state.color.writes.get_mut(k).ok_or(INVALID_VALUE)?.blended = ON;
    Ok(())
}

pub fn enable(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set(gl, call.u32(0)?, true)
}

pub fn disable(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set(gl, call.u32(0)?, false)
}

pub fn shade_model(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.lighting.flat = match call.u32(0)? {
        e::FLAT => true,
        e::SMOOTH => false,
        _ => return Err(INVALID_ENUM),
    };
    Ok(())
}

pub fn provoking_vertex(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.lighting.provoking_first = match call.u32(0)? {
        e::FIRST_VERTEX_CONVENTION => true,
        e::LAST_VERTEX_CONVENTION => false,
        _ => return Err(INVALID_ENUM),
    };
    Ok(())
}

fn color(values: &[f64], shape: Shape) -> GlResult<[f32; 4]> {
    let float = matches!(shape.scalar, Scalar::Float | Scalar::Double);
    let values = values.get(..4).ok_or_else(|| Fault::Damaged("a colour of fewer than 4 numbers".into()))?;
    Ok(std::array::from_fn(|k| if float { values[k] as f32 } else { shape.scalar.normalized(values[k]) }))
}

fn vector<const N: usize>(values: &[f64]) -> GlResult<[f32; N]> {
    let values = values.get(..N).ok_or_else(|| Fault::Damaged(format!("fewer than {N} numbers")))?;
    Ok(std::array::from_fn(|k| values[k] as f32))
}

fn faces(face: u32) -> GlResult<std::ops::Range<usize>> {
    match face {
        e::FRONT => Ok(0..1),
        e::BACK => Ok(1..2),
        e::FRONT_AND_BACK => Ok(0..2),
        _ => Err(INVALID_ENUM),
    }
}

pub fn material(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (face, name, values) = (faces(call.u32(0)?)?, call.u32(1)?, call.numbers(2)?);
    // What a colour of a single number gives is left open: Mesa reads beyond that number.
    if !shape.vector && name != e::SHININESS {
        return Err(INVALID_ENUM);
    }
    let mut materials = gl.state.lighting.materials.clone();
    let tracked = tracked_parameters(&gl.state);
    for (side, material) in materials.iter_mut().enumerate().filter(|(side, _)| face.contains(side)) {
        let old = material.clone();
        match name {
            e::AMBIENT => material.ambient = color(&values, shape)?,
            e::DIFFUSE => material.diffuse = color(&values, shape)?,
            e::AMBIENT_AND_DIFFUSE => {
                material.ambient = color(&values, shape)?;
                material.diffuse = material.ambient;
            }
            e::SPECULAR => material.specular = color(&values, shape)?,
            e::EMISSION => material.emission = color(&values, shape)?,
            e::SHININESS => {
                let [shininess] = vector(&values)?;
                if !(0.0..=128.0).contains(&shininess) {
                    return Err(INVALID_VALUE);
                }
                material.shininess = shininess;
            }
            e::COLOR_INDEXES => {}
            _ => return Err(INVALID_ENUM),
        }
        // What colour material tracks has the colour, or the value from before it was enabled ([`super::materials`]).
        for bit in [tracks::AMBIENT, tracks::DIFFUSE, tracks::SPECULAR, tracks::EMISSION] {
            match tracked[side] & bit {
                tracks::AMBIENT => material.ambient = old.ambient,
                tracks::DIFFUSE => material.diffuse = old.diffuse,
                tracks::SPECULAR => material.specular = old.specular,
                tracks::EMISSION => material.emission = old.emission,
                _ => {}
            }
        }
    }
    if gl.context.open_primitive.is_none() {
        gl.context.material_tracking.note_set(&gl.state, face, name);
    }
    if materials == gl.state.lighting.materials {
        return Ok(());
    }
    // Primitives before this call use the old material.
    if let Some((mode, vertices)) = &mut gl.context.open_primitive {
        let whole = match *mode {
            e::POINTS => 1,
            e::LINES => 2,
            e::TRIANGLES => 3,
            e::QUADS => 4,
            _ => 0,
        };
        let complete = vertices.is_empty() || whole > 0 && vertices.len().is_multiple_of(whole);
        let key = [call.u32(0)?, name];
        let goes_on = match gl.context.changing_material {
            None => false,
            Some(ChangingMaterial::Color(known, _)) => known == key,
            Some(ChangingMaterial::Lit) => true,
        };
        if (goes_on || !complete) && gl.state.is(e::LIGHTING) {
            return track(gl, key, materials);
        }
        if complete {
            let (mode, vertices) = (*mode, std::mem::take(vertices));
            gl.send(mode, &vertices)?;
        }
    }
    gl.flush()?;
    gl.state.lighting.materials = materials;
    Ok(())
}

/// The material changes from a vertex to the next. If that is always the same colour of it, this becomes the colour of the vertices, as with
/// colour material. Else they are lit here, each with its own material.
fn track(gl: &mut Gl, [face, name]: [u32; 2], materials: [Material; 2]) -> GlResult {
    let of = |materials: &[Material; 2]| {
        let material = &materials[usize::from(face == e::BACK)];
        match name {
            e::AMBIENT => Some(material.ambient),
            e::DIFFUSE => Some(material.diffuse),
            e::AMBIENT_AND_DIFFUSE => Some(material.diffuse).filter(|&diffuse| diffuse == material.ambient),
            e::SPECULAR => Some(material.specular),
            e::EMISSION => Some(material.emission),
            _ => None,
        }
    };
    let key = [face, name];
    let goes_on = match gl.context.changing_material {
        None => !gl.state.is(e::COLOR_MATERIAL),
        Some(ChangingMaterial::Color(known, _)) => known == key,
        Some(ChangingMaterial::Lit) => false,
    };
    let (old, new) = (of(&gl.state.lighting.materials), of(&materials));
    if gl.context.changing_material.is_none() {
        // Primitives before this one use the old material.
        gl.flush()?;
    }
    if let (true, Some(old), Some(new)) = (goes_on, old, new) {
        if let (None, Some((_, vertices))) = (gl.context.changing_material, &mut gl.context.open_primitive) {
            vertices.iter_mut().for_each(|vertex| vertex.color = old);
        }
        gl.context.changing_material = Some(ChangingMaterial::Color(key, new));
    } else if gl.state.lighting.two_side || gl.context.glsl_program != 0 || gl.state.programs & ProgramStage::Vertex as u8 != 0
    {
        return Err(Fault::Unsupported("several materials within a primitive, lit on two sides or by a program".into()));
    } else if gl.context.changing_material != Some(ChangingMaterial::Lit) {
        // The vertices before the change have the materials from before it.
        let mut before = gl.state.clone();
        if let Some(ChangingMaterial::Color(key, _)) = gl.context.changing_material {
            before.enabled |= capability(e::COLOR_MATERIAL).unwrap_or(0);
            before.lighting.color_material = key;
        }
        let modelview = gl.context.matrices.modelview.top;
        for vertex in gl.context.open_primitive.iter_mut().flat_map(|(_, vertices)| vertices) {
            (vertex.color, vertex.secondary) = colors(&before, &modelview, vertex);
        }
        gl.context.changing_material = Some(ChangingMaterial::Lit);
    }
    gl.state.lighting.materials = materials;
    Ok(())
}

pub fn color_material(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (face, mode) = (call.u32(0)?, call.u32(1)?);
    faces(face)?;
    if !matches!(mode, e::EMISSION | e::AMBIENT | e::DIFFUSE | e::SPECULAR | e::AMBIENT_AND_DIFFUSE) {
        return Err(INVALID_ENUM);
    }
    if gl.state.lighting.color_material != [face, mode] {
        gl.settle_color_material()?;
        gl.state.lighting.color_material = [face, mode];
        gl.context.material_tracking.note_switched();
    }
    Ok(())
}

pub fn light(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (k, name, values) = (call.u32(0)?.wrapping_sub(e::LIGHT0) as usize, call.u32(1)?, padded(call, shape, 2)?);
    let modelview = gl.context.matrices.modelview.top;
    let light = gl.state.lighting.lights.get_mut(k).filter(|_| k < LIGHTS).ok_or(INVALID_ENUM)?;
    match name {
        e::AMBIENT => light.ambient = color(&values, shape)?,
        e::DIFFUSE => light.diffuse = color(&values, shape)?,
        e::SPECULAR => light.specular = color(&values, shape)?,
        e::POSITION => light.position = matrix::transform(&modelview, vector(&values)?),
        e::SPOT_DIRECTION => {
            let [x, y, z] = vector(&values)?;
            let [x, y, z, _] = matrix::transform(&modelview, [x, y, z, 0.0]);
            light.spot_direction = [x, y, z];
        }
        _ => {
            let [value] = vector(&values)?;
            match name {
                e::SPOT_EXPONENT if (0.0..=128.0).contains(&value) => light.spot_exponent = value,
                e::SPOT_CUTOFF if (0.0..=90.0).contains(&value) || value == 180.0 => light.spot_cutoff = value,
                e::CONSTANT_ATTENUATION if value >= 0.0 => light.attenuation[0] = value,
                e::LINEAR_ATTENUATION if value >= 0.0 => light.attenuation[1] = value,
                e::QUADRATIC_ATTENUATION if value >= 0.0 => light.attenuation[2] = value,
                e::SPOT_EXPONENT..=e::QUADRATIC_ATTENUATION => return Err(INVALID_VALUE),
                _ => return Err(INVALID_ENUM),
            }
        }
    }
    light.derive();
    Ok(())
}

pub fn light_model(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (name, values) = (call.u32(0)?, padded(call, shape, 1)?);
    let [value] = vector(&values)?;
    match name {
        e::LIGHT_MODEL_AMBIENT => gl.state.lighting.model_ambient = color(&values, shape)?,
        e::LIGHT_MODEL_LOCAL_VIEWER => gl.state.lighting.local_viewer = value != 0.0,
        e::LIGHT_MODEL_TWO_SIDE => gl.state.lighting.two_side = value != 0.0,
        e::LIGHT_MODEL_COLOR_CONTROL => {
            gl.state.lighting.separate_specular = match value as u32 {
                e::SEPARATE_SPECULAR_COLOR => true,
                e::SINGLE_COLOR => false,
                _ => return Err(INVALID_ENUM),
            }
        }
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

const FRAGMENT_DEPTH: u32 = 0x8452;
const FOG_DISTANCE_MODE: u32 = 0x855a;
const EYE_RADIAL: u32 = 0x855b;
const EYE_PLANE_ABSOLUTE: u32 = 0x855c;

pub fn fog(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (name, values) = (call.u32(0)?, padded(call, shape, 1)?);
    let [value] = vector(&values)?;
    match name {
        e::FOG_MODE => match value as u32 {
            mode @ (e::LINEAR | e::EXP | e::EXP2) => gl.state.fog.mode = mode,
            _ => return Err(INVALID_ENUM),
        },
        e::FOG_DENSITY if value < 0.0 => return Err(INVALID_VALUE),
        e::FOG_DENSITY => gl.state.fog.terms[0] = value,
        e::FOG_START => gl.state.fog.terms[1] = value,
        e::FOG_END => gl.state.fog.terms[2] = value,
        e::FOG_COLOR => gl.state.fog.color = color(&values, shape)?.map(|value| value.clamp(0.0, 1.0)),
        e::FOG_COORD_SRC => match value as u32 {
            e::FOG_COORD => gl.state.fog.from_coordinate = true,
            FRAGMENT_DEPTH => gl.state.fog.from_coordinate = false,
            _ => return Err(INVALID_ENUM),
        },
        FOG_DISTANCE_MODE => {
            gl.state.fog.distance = match value as u32 {
                EYE_RADIAL => FogDistance::Radial,
                e::EYE_PLANE => FogDistance::Signed,
                EYE_PLANE_ABSOLUTE => FogDistance::Absolute,
                _ => return Err(INVALID_ENUM),
            }
        }
        e::FOG_INDEX => {}
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

pub fn cull_face(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let face = call.u32(0)?;
    faces(face)?;
    gl.state.polygon.cull = face;
    Ok(())
}

pub fn front_face(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match call.u32(0)? {
        winding @ (e::CW | e::CCW) => gl.state.polygon.front = winding,
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

pub fn polygon_mode(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (face, mode) = (faces(call.u32(0)?)?, call.u32(1)?);
    if !matches!(mode, e::POINT | e::LINE | e::FILL) {
        return Err(INVALID_ENUM);
    }
    gl.state.polygon.modes[face].fill(mode);
    Ok(())
}

pub fn polygon_offset(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    // A trace has finite ones; no number counts as none.
    let finite = |value: f32| if value.is_nan() { 0.0 } else { value.clamp(f32::MIN, f32::MAX) };
    gl.state.polygon.offset = [finite(call.f32(0)?), finite(call.f32(1)?)];
    Ok(())
}

pub fn polygon_stipple(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let bytes = gl.pixel_bytes(call.arg(0))?.ok_or_else(|| Fault::Damaged("argument 0 is no pattern".into()))?;
    gl.unpacking(2, |gl| {
        let bits = values(&gl.context.unpack, [32, 32, 1], e::BITMAP, &bytes, false)?;
        for (row, bits) in gl.state.polygon.stipple.iter_mut().zip(bits.chunks_exact(32)) {
            *row = bits.iter().fold(0, |row, &bit| row << 1 | u32::from(bit != 0.0));
        }
        Ok(())
    })
}

pub fn line_width(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let width = call.f32(0)?;
    if !(width > 0.0) {
        return Err(INVALID_VALUE);
    }
    gl.state.line.width = width;
    Ok(())
}

pub fn line_stipple(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.line.stipple = (call.i32(0)?.clamp(1, 256) as u32, call.u32(1)? & 0xffff);
    Ok(())
}

pub fn point_size(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let size = call.f32(0)?;
    if !(size > 0.0) {
        return Err(INVALID_VALUE);
    }
    gl.state.point.size = size;
    Ok(())
}

pub fn point_parameter(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (name, values) = (call.u32(0)?, padded(call, shape, 1)?);
    let [value] = vector(&values)?;
    match name {
        e::POINT_SIZE_MIN if value >= 0.0 => gl.state.point.limits[0] = value,
        e::POINT_SIZE_MAX if value >= 0.0 => gl.state.point.limits[1] = value,
        e::POINT_FADE_THRESHOLD_SIZE if value >= 0.0 => gl.state.point.limits[2] = value,
        e::POINT_SIZE_MIN | e::POINT_SIZE_MAX | e::POINT_FADE_THRESHOLD_SIZE => return Err(INVALID_VALUE),
        e::POINT_DISTANCE_ATTENUATION => gl.state.point.attenuation = vector(&values)?,
        e::POINT_SPRITE_COORD_ORIGIN => {
            gl.state.point.sprites_up = match value as u32 {
                e::UPPER_LEFT => false,
                e::LOWER_LEFT => true,
                _ => return Err(INVALID_VALUE),
            };
        }
        _ => return Err(INVALID_ENUM),
    }
    if gl.context.open_primitive.is_some() { Err(INVALID_OPERATION) } else { Ok(()) }
}
