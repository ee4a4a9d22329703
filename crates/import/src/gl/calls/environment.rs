//! Environments of texture units, and texture generation.

use gl_shader::{UNITS, consts as e};
use glam::Mat4;

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_VALUE, Scalar, Shape, padded};
use crate::gl::machine::Gl;
use crate::gl::matrix;
use crate::gl::state::texturing::{COMBINE4, DOT3_RGB, DOT3_RGBA};

const SRC3_RGB: u32 = 0x8583;
const SRC3_ALPHA: u32 = 0x858b;
const OPERAND3_RGB: u32 = 0x8593;
const OPERAND3_ALPHA: u32 = 0x859b;
/// Functions of `ATI_texture_env_combine3`.
const MODULATE_ADD: u32 = 0x8744;
const MODULATE_SUBTRACT: u32 = 0x8746;

pub fn environment(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (target, name, values) = (call.u32(0)?, call.u32(1)?, padded(call, shape, 2)?);
    let value = *values.first().ok_or(INVALID_VALUE)?;
    let word = value as i64 as u32;
    let unit = gl.state.texturing.active;
    let env = &mut gl.state.texturing.units[unit].environment;
    match (target, name) {
        (e::TEXTURE_FILTER_CONTROL, e::TEXTURE_LOD_BIAS) => env.bias = value as f32,
        (e::POINT_SPRITE, e::COORD_REPLACE) => {
            let bit = 1 << unit;
            gl.state.point.sprites = gl.state.point.sprites & !bit | if value != 0.0 { bit } else { 0 };
        }
        (e::TEXTURE_ENV, e::TEXTURE_ENV_MODE) => match word {
            e::MODULATE | e::DECAL | e::BLEND | e::REPLACE | e::ADD | e::COMBINE | COMBINE4 => env.mode = word,
            _ => return Err(INVALID_ENUM),
        },
        (e::TEXTURE_ENV, e::TEXTURE_ENV_COLOR) => {
            let float = matches!(shape.scalar, Scalar::Float | Scalar::Double);
            let values = values.get(..4).ok_or_else(|| Fault::Damaged("a colour of fewer than 4 numbers".into()))?;
            let color: [f32; 4] =
                std::array::from_fn(|k| if float { values[k] as f32 } else { shape.scalar.normalized(values[k]) });
            env.color = color.map(|value| value.clamp(0.0, 1.0));
        }
        (e::TEXTURE_ENV, e::COMBINE_RGB | e::COMBINE_ALPHA) => {
            let plain = matches!(word, e::REPLACE | e::MODULATE | e::ADD | e::ADD_SIGNED | e::INTERPOLATE | e::SUBTRACT);
            let with_three = (MODULATE_ADD..=MODULATE_SUBTRACT).contains(&word);
            let dot = matches!(word, e::DOT3_RGB | e::DOT3_RGBA | DOT3_RGB | DOT3_RGBA);
            if !plain && !with_three && (name == e::COMBINE_ALPHA || !dot) {
                return Err(INVALID_ENUM);
            }
            env.combine[usize::from(name == e::COMBINE_ALPHA)] = word;
        }
        (e::TEXTURE_ENV, e::SRC0_RGB..=SRC3_RGB) => env.sources[0][(name - e::SRC0_RGB) as usize] = source(word)?,
        (e::TEXTURE_ENV, e::SRC0_ALPHA..=SRC3_ALPHA) => env.sources[1][(name - e::SRC0_ALPHA) as usize] = source(word)?,
        (e::TEXTURE_ENV, e::OPERAND0_RGB..=OPERAND3_RGB) => env.operands[0][(name - e::OPERAND0_RGB) as usize] = operand(word)?,
        (e::TEXTURE_ENV, e::OPERAND0_ALPHA..=OPERAND3_ALPHA) => {
            env.operands[1][(name - e::OPERAND0_ALPHA) as usize] = match operand(word)? {
                e::SRC_COLOR | e::ONE_MINUS_SRC_COLOR => return Err(INVALID_ENUM),
                word => word,
            };
        }
        (e::TEXTURE_ENV, e::RGB_SCALE | e::ALPHA_SCALE) => {
            if ![1.0, 2.0, 4.0].contains(&value) {
                return Err(INVALID_VALUE);
            }
            env.scales[usize::from(name == e::ALPHA_SCALE)] = value as f32;
        }
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

fn source(word: u32) -> GlResult<u32> {
    let unit = word.wrapping_sub(e::TEXTURE0) < UNITS as u32;
    let known = matches!(word, e::TEXTURE | e::CONSTANT | e::PRIMARY_COLOR | e::PREVIOUS | e::ZERO | e::ONE);
    if unit || known { Ok(word) } else { Err(INVALID_ENUM) }
}

fn operand(word: u32) -> GlResult<u32> {
    let known = matches!(word, e::SRC_COLOR | e::ONE_MINUS_SRC_COLOR | e::SRC_ALPHA | e::ONE_MINUS_SRC_ALPHA);
    if known { Ok(word) } else { Err(INVALID_ENUM) }
}

pub fn generation(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (coordinate, name, values) = (call.u32(0)?.wrapping_sub(e::S) as usize, call.u32(1)?, padded(call, shape, 2)?);
    let inverse = matrix::inverse(&gl.context.matrices.modelview.top).unwrap_or(Mat4::IDENTITY);
    let unit = &mut gl.state.texturing.units[gl.state.texturing.active];
    let generation = unit.generation.get_mut(coordinate).ok_or(INVALID_ENUM)?;
    let plane = || -> GlResult<[f32; 4]> {
        let values = values.get(..4).ok_or_else(|| Fault::Damaged("a plane of fewer than 4 numbers".into()))?;
        Ok(std::array::from_fn(|k| values[k] as f32))
    };
    match name {
        e::TEXTURE_GEN_MODE => match values.first().map(|&value| value as u32) {
            Some(mode @ (e::OBJECT_LINEAR | e::EYE_LINEAR)) => generation.mode = mode,
            Some(mode @ e::SPHERE_MAP) if coordinate < 2 => generation.mode = mode,
            Some(mode @ (e::REFLECTION_MAP | e::NORMAL_MAP)) if coordinate < 3 => generation.mode = mode,
            _ => return Err(INVALID_ENUM),
        },
        e::OBJECT_PLANE => generation.object = plane()?,
        e::EYE_PLANE => generation.eye = matrix::transform_plane(plane()?, &inverse),
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}
