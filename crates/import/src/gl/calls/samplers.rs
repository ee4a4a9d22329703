//! Parameters of textures, and sampler objects, which have the parameters of sampling.

use gl_shader::key::{Base, TextureShape};
use gl_shader::{IMAGES, consts as e};

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape, parameters};
use crate::gl::calls::texturing::with;
use crate::gl::machine::Gl;
use crate::gl::state::fragments::compare;
use crate::gl::state::texture::{MIRROR_CLAMP, MIRROR_CLAMP_TO_BORDER, MIRROR_CLAMP_TO_EDGE, Texture};
use crate::gl::state::texturing::target_of;

pub fn parameter(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (target, name, values) = (target_of(call.u32(0)?)?, call.u32(1)?, parameters(call, 2)?);
    with(gl, target, |texture, _| set_parameter(texture, name, &values, shape))
}

/// `glSamplerParameter(sampler, name, values)`
pub fn sampler_parameter(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (name, values) = (call.u32(1)?, parameters(call, 2)?);
    let own = matches!(
        name,
        e::TEXTURE_MIN_FILTER
            | e::TEXTURE_MAG_FILTER
            | e::TEXTURE_WRAP_S
            | e::TEXTURE_WRAP_T
            | e::TEXTURE_WRAP_R
            | e::TEXTURE_BORDER_COLOR
            | e::TEXTURE_MIN_LOD
            | e::TEXTURE_MAX_LOD
            | e::TEXTURE_LOD_BIAS
            | e::TEXTURE_COMPARE_FUNC
            | e::TEXTURE_COMPARE_MODE
            | e::TEXTURE_MAX_ANISOTROPY_EXT
            | SRGB_DECODE
            | REDUCTION_MODE
            | e::TEXTURE_CUBE_MAP_SEAMLESS
    );
    if !own {
        return Err(INVALID_ENUM);
    }
    let sampler = call.u32(0)?;
    if sampler == 0 {
        return Err(INVALID_OPERATION);
    }
    set_parameter(gl.objects.samplers.get_or_insert_with(sampler, || Texture::new(TextureShape::D2)), name, &values, shape)
}

/// `glBindSampler(unit, sampler)`
pub fn bind(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (unit, sampler) = (call.u32(0)? as usize, call.u32(1)?);
    if unit >= IMAGES {
        return Err(INVALID_VALUE);
    }
    if sampler != 0 {
        gl.objects.samplers.get_or_insert_with(sampler, || Texture::new(TextureShape::D2));
    }
    gl.context.samplers.bound[unit] = sampler;
    Ok(())
}

pub fn delete(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        if gl.objects.samplers.remove(name as u32).is_some() {
            gl.contexts.sharing().for_each(|context| context.lose_sampler(name as u32));
        }
        gl.context.samplers.bound.iter_mut().filter(|bound| **bound == name as u32).for_each(|bound| *bound = 0);
    }
    Ok(())
}

/// A parameter of a texture or a sampler.
fn set_parameter(texture: &mut Texture, name: u32, values: &[f64], shape: Shape) -> GlResult {
    let value = *values.first().ok_or(INVALID_VALUE)?;
    let word = value as i64 as u32;
    let filters = [e::NEAREST, e::LINEAR];
    if !shape.vector && matches!(name, e::TEXTURE_BORDER_COLOR | SWIZZLE_RGBA) {
        return Err(INVALID_ENUM);
    }
    match name {
        e::TEXTURE_MIN_FILTER
            if filters.contains(&word) || (e::NEAREST_MIPMAP_NEAREST..=e::LINEAR_MIPMAP_LINEAR).contains(&word) =>
        {
            texture.min = word;
        }
        e::TEXTURE_MAG_FILTER if filters.contains(&word) => texture.mag = word,
        e::TEXTURE_MIN_FILTER | e::TEXTURE_MAG_FILTER => return Err(INVALID_ENUM),
        e::TEXTURE_WRAP_S => texture.wrap[0] = wrapping(texture.kind, word)?,
        e::TEXTURE_WRAP_T => texture.wrap[1] = wrapping(texture.kind, word)?,
        e::TEXTURE_WRAP_R => texture.wrap[2] = wrapping(texture.kind, word)?,
        e::TEXTURE_BORDER_COLOR => {
            let float = matches!(shape.scalar, Scalar::Float | Scalar::Double);
            let values = values.get(..4).ok_or_else(|| Fault::Damaged("a colour of fewer than 4 numbers".into()))?;
            texture.border = std::array::from_fn(|k| if float { values[k] as f32 } else { shape.scalar.normalized(values[k]) });
        }
        e::TEXTURE_MIN_LOD => texture.lod[0] = value as f32,
        e::TEXTURE_MAX_LOD => texture.lod[1] = value as f32,
        e::TEXTURE_BASE_LEVEL if (0.0..=1000.0).contains(&value) => texture.range[0] = word,
        e::TEXTURE_BASE_LEVEL => return Err(INVALID_VALUE),
        e::TEXTURE_MAX_LEVEL if value >= 0.0 => texture.range[1] = word,
        e::TEXTURE_MAX_LEVEL => return Err(INVALID_VALUE),
        e::TEXTURE_MAX_ANISOTROPY_EXT => texture.anisotropy = value as f32,
        e::GENERATE_MIPMAP => texture.generate = value != 0.0,
        e::TEXTURE_PRIORITY => {}
        e::DEPTH_TEXTURE_MODE => match word {
            e::LUMINANCE => texture.depth_mode = Base::Luminance,
            e::INTENSITY => texture.depth_mode = Base::Intensity,
            e::ALPHA => texture.depth_mode = Base::Alpha,
            e::RED => texture.depth_mode = Base::Red,
            _ => return Err(INVALID_ENUM),
        },
        e::TEXTURE_COMPARE_FUNC if (e::NEVER..=e::ALWAYS).contains(&word) => {
            texture.compare_func = compare(word);
            texture.compare = texture.compare.map(|_| texture.compare_func);
        }
        e::TEXTURE_COMPARE_MODE if matches!(word, e::NONE | e::COMPARE_REF_TO_TEXTURE) => {
            texture.compare = (word != e::NONE).then_some(texture.compare_func);
        }
        e::TEXTURE_LOD_BIAS => texture.bias = value as f32,
        SWIZZLE_R..=SWIZZLE_A => texture.swizzle[(name - SWIZZLE_R) as usize] = swizzled(word)?,
        SWIZZLE_RGBA => {
            let values = values.get(..4).ok_or_else(|| Fault::Damaged("a swizzle of fewer than 4 numbers".into()))?;
            for (part, &value) in texture.swizzle.iter_mut().zip(values) {
                *part = swizzled(value as i64 as u32)?;
            }
        }
        SRGB_DECODE if word == SKIP_DECODE => {
            return Err(Fault::Unsupported("textures of sRGB that are read without decoding".into()));
        }
        SRGB_DECODE => {}
        REDUCTION_MODE if word != WEIGHTED_AVERAGE => {
            return Err(Fault::Unsupported("filters that take the least or greatest texel".into()));
        }
        DEPTH_STENCIL_MODE if word != e::DEPTH_COMPONENT => {
            return Err(Fault::Unsupported("textures of stencil values".into()));
        }
        e::TEXTURE_CUBE_MAP_SEAMLESS if word != 0 => {
            return Err(Fault::Unsupported("single cube maps whose filters cross edges".into()));
        }
        REDUCTION_MODE | DEPTH_STENCIL_MODE | e::TEXTURE_CUBE_MAP_SEAMLESS => {}
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

/// A wrap mode that textures of this kind may have.
fn wrapping(kind: TextureShape, word: u32) -> GlResult<u32> {
    match word {
        e::CLAMP | e::CLAMP_TO_EDGE | e::CLAMP_TO_BORDER => Ok(word),
        _ if kind == TextureShape::Rectangle => Err(INVALID_ENUM),
        e::REPEAT | e::MIRRORED_REPEAT | MIRROR_CLAMP | MIRROR_CLAMP_TO_EDGE | MIRROR_CLAMP_TO_BORDER => Ok(word),
        _ => Err(INVALID_ENUM),
    }
}

const REDUCTION_MODE: u32 = 0x9366;
const WEIGHTED_AVERAGE: u32 = 0x9367;
const DEPTH_STENCIL_MODE: u32 = 0x90ea;
const SWIZZLE_R: u32 = 0x8e42;
const SWIZZLE_A: u32 = 0x8e45;
const SWIZZLE_RGBA: u32 = 0x8e46;
const SRGB_DECODE: u32 = 0x8a48;
const SKIP_DECODE: u32 = 0x8a4a;

/// The source of a component as a number: a channel, 4 for zero, 5 for one.
fn swizzled(word: u32) -> GlResult<u8> {
    Ok(match word {
        e::RED => 0,
        e::GREEN => 1,
        e::BLUE => 2,
        e::ALPHA => 3,
        e::ZERO => 4,
        e::ONE => 5,
        _ => return Err(INVALID_ENUM),
    })
}
