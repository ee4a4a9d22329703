//! WGSL that reads textures and applies the environments of their units.

use std::fmt::Write;

use crate::consts as e;
use crate::key::{Base, DepthRead, EnvironmentKey, FOUR, TextureShape, UnitKey};

/// Reads the texture of a unit into `texelK`.
pub fn sample(unit: &UnitKey, out: &mut String) {
    let k = unit.unit;
    let source = match (unit.sprite, unit.projective) {
        (true, _) => {
            let down = if unit.sprite_up { "0.5" } else { "-0.5" };
            format!("vec3f(0.5 + vec2f(0.5, {down}) * v.corner.xy / v.corner.z, 0.0)")
        }
        // Division does not change a direction.
        (false, true) if unit.kind == TextureShape::Cube => format!("v.texture{k}.xyz"),
        (false, true) => format!("v.texture{k}.xyz / v.texture{k}.w"),
        (false, false) => format!("v.texture{k}"),
    };
    line!(out, "    var at{k} = {source};");
    read(unit, Detail::Implicit, out);
}

/// How the level of detail of a read is computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// From the coordinates of neighbouring fragments.
    Implicit,
    /// As [`Detail::Implicit`], plus `bias`.
    Biased,
    /// It is `level`.
    Level,
    /// From the derivatives `dx` and `dy`.
    Gradient,
}

/// Reads the texture of a unit at `atK`.
pub fn read(unit: &UnitKey, detail: Detail, out: &mut String) {
    let k = unit.unit;
    if unit.kind == TextureShape::Rectangle {
        line!(out, "    at{k} = vec3f(at{k}.xy / vec2f(textureDimensions(image{k})), at{k}.z);");
    }
    for (part, _) in ["x", "y", "z"].iter().zip(unit.mirror).filter(|&(_, mirror)| mirror) {
        line!(out, "    at{k}.{part} = abs(at{k}.{part});");
    }
    for (part, _) in ["x", "y", "z"].iter().zip(unit.clamp).filter(|&(_, clamp)| clamp) {
        line!(out, "    at{k}.{part} = saturate(at{k}.{part});");
    }
    if unit.face_edges {
        // The card's cube maps are seamless. Coordinates at least half a texel inside the face's edge are not filtered with the next face.
        line!(out, "    {{\n        let side = abs(at{k});\n        let major = max(max(side.x, side.y), side.z);");
        line!(out, "        let most = vec3f(major * (1.0 - 1.0 / f32(textureDimensions(image{k}).x)));");
        line!(out, "        at{k} = select(clamp(at{k}, -most, most), at{k}, side >= vec3f(major));\n    }}");
    }
    let at = match unit.kind {
        TextureShape::D1 => format!("vec2f(at{k}.x, 0.5)"),
        TextureShape::D2 | TextureShape::Rectangle => format!("at{k}.xy"),
        TextureShape::D3 | TextureShape::Cube => format!("at{k}"),
    };
    let own = if unit.bias { format!(" + u.bias{k}.x") } else { String::new() };
    let explicit = matches!(detail, Detail::Level | Detail::Gradient);
    let with = |sampler: &str| match (unit.depth, detail) {
        (DepthRead::Compared, _) => {
            let level = if explicit { "Level" } else { "" };
            format!("vec4f(textureSampleCompare{level}(image{k}, {sampler}, {at}, saturate(at{k}.z)))")
        }
        (DepthRead::Plain, Detail::Level) => format!("vec4f(textureSampleLevel(image{k}, {sampler}, {at}, i32(level + 0.5)))"),
        (DepthRead::Plain, Detail::Gradient) => format!("vec4f(textureSampleLevel(image{k}, {sampler}, {at}, 0))"),
        (DepthRead::Plain, _) => format!("vec4f(textureSample(image{k}, {sampler}, {at}))"),
        (_, Detail::Level) => format!("textureSampleLevel(image{k}, {sampler}, {at}, level{own})"),
        // Derivatives that are larger by a factor move the level by its logarithm.
        (_, Detail::Gradient) if unit.bias => {
            format!("textureSampleGrad(image{k}, {sampler}, {at}, dx * exp2(u.bias{k}.x), dy * exp2(u.bias{k}.x))")
        }
        (_, Detail::Gradient) => format!("textureSampleGrad(image{k}, {sampler}, {at}, dx, dy)"),
        (_, Detail::Biased) => format!("textureSampleBias(image{k}, {sampler}, {at}, bias{own})"),
        (_, Detail::Implicit) if unit.bias => format!("textureSampleBias(image{k}, {sampler}, {at}, u.bias{k}.x)"),
        (_, Detail::Implicit) => format!("textureSample(image{k}, {sampler}, {at})"),
    };
    let mut read = with(&format!("sampler{k}"));
    if unit.border {
        // Reads with a black and with a white border: the difference is the weight of the border.
        line!(out, "    let inner{k} = {read};");
        let white = with(&format!("white{k}"));
        line!(out, "    let bordered{k} = inner{k} + ({white}.r - inner{k}.r) * u.border{k};");
        read = format!("bordered{k}");
    }
    let swizzled = swizzled(unit);
    if swizzled == "t" {
        line!(out, "    let texel{k} = {read};");
    } else {
        line!(out, "    var texel{k}: vec4f;\n    {{ let t = {read}; texel{k} = {swizzled}; }}");
    }
}

/// WGSL of the value read from a texture, from a stored texel `t`: its base format is applied first, then its swizzle.
pub fn swizzled(unit: &UnitKey) -> String {
    let base = unit.base.swizzle();
    if unit.swizzle == [0, 1, 2, 3] {
        return base.to_owned();
    }
    let [a, b, c, d] = unit.swizzle.map(|from| match from {
        4 => "0.0".to_owned(),
        5 => "1.0".to_owned(),
        channel => format!("({base})[{channel}]"),
    });
    format!("vec4f({a}, {b}, {c}, {d})")
}

/// Applies the environment of a unit to `c` (OpenGL 1.5, tables 3.22 to 3.24).
pub fn environment(unit: &UnitKey, units: &[UnitKey], out: &mut String) {
    let (k, base) = (unit.unit, unit.base);
    let t = format!("texel{k}");
    let mode = match &unit.environment {
        EnvironmentKey::Mode(mode) => *mode,
        EnvironmentKey::Combine(functions, sources, operands, scaled) => {
            return combine(unit, units, *functions, *sources, *operands, *scaled, out);
        }
    };
    let alone = base == Base::Alpha;
    let alpha = format!("c.a * {t}.a");
    let (rgb, a) = match mode {
        e::REPLACE => {
            let a = if matches!(base, Base::Luminance | Base::Rgb | Base::Srgb) { "c.a".into() } else { format!("{t}.a") };
            (if alone { "c.rgb".into() } else { format!("{t}.rgb") }, a)
        }
        e::DECAL => (format!("mix(c.rgb, {t}.rgb, {t}.a)"), "c.a".into()),
        e::BLEND => {
            let a = if base == Base::Intensity { format!("mix(c.a, u.environment{k}.a, {t}.a)") } else { alpha };
            (if alone { "c.rgb".into() } else { format!("mix(c.rgb, u.environment{k}.rgb, {t}.rgb)") }, a)
        }
        e::ADD => {
            let a = if base == Base::Intensity { format!("saturate(c.a + {t}.a)") } else { alpha };
            (if alone { "c.rgb".into() } else { format!("saturate(c.rgb + {t}.rgb)") }, a)
        }
        _ => (if alone { "c.rgb".into() } else { format!("c.rgb * {t}.rgb") }, alpha),
    };
    line!(out, "    c = vec4f({rgb}, {a});");
}

/// Functions of four arguments.
const ADD_FOUR: u32 = e::ADD | FOUR;
const ADD_SIGNED_FOUR: u32 = e::ADD_SIGNED | FOUR;
/// Functions of `ATI_texture_env_combine3`.
const MODULATE_ADD: u32 = 0x8744;
const MODULATE_SIGNED_ADD: u32 = 0x8745;
const MODULATE_SUBTRACT: u32 = 0x8746;

fn combine(
    unit: &UnitKey,
    units: &[UnitKey],
    functions: [u32; 2],
    sources: [[u32; 4]; 2],
    operands: [[u32; 4]; 2],
    scaled: bool,
    out: &mut String,
) {
    let k = unit.unit;
    let source = |source: u32| match source {
        e::TEXTURE => format!("texel{k}"),
        e::CONSTANT => format!("u.environment{k}"),
        e::PRIMARY_COLOR => "primary".into(),
        e::PREVIOUS => "c".into(),
        e::ZERO => "vec4f()".into(),
        e::ONE => "vec4f(1)".into(),
        // Crossbar; a unit that is not enabled gives undefined results.
        other => {
            let from = (other.wrapping_sub(e::TEXTURE0)) as usize;
            if units.iter().any(|unit| unit.unit == from) { format!("texel{from}") } else { "vec4f(1)".into() }
        }
    };
    let arguments = |part: usize| -> [String; 4] {
        std::array::from_fn(|i| {
            let from = source(sources[part][i]);
            let component = match operands[part][i] {
                e::SRC_ALPHA | e::ONE_MINUS_SRC_ALPHA if part == 0 => format!("{from}.aaa"),
                e::SRC_ALPHA | e::ONE_MINUS_SRC_ALPHA => format!("{from}.a"),
                _ => format!("{from}.rgb"),
            };
            match operands[part][i] {
                e::ONE_MINUS_SRC_COLOR | e::ONE_MINUS_SRC_ALPHA => format!("(1.0 - {component})"),
                _ => component,
            }
        })
    };
    let apply = |function: u32, [a, b, c, d]: [String; 4]| match function {
        ADD_FOUR => format!("{a} * {b} + {c} * {d}"),
        ADD_SIGNED_FOUR => format!("{a} * {b} + {c} * {d} - 0.5"),
        MODULATE_ADD => format!("{a} * {c} + {b}"),
        MODULATE_SIGNED_ADD => format!("{a} * {c} + {b} - 0.5"),
        MODULATE_SUBTRACT => format!("{a} * {c} - {b}"),
        e::REPLACE => a,
        e::ADD => format!("{a} + {b}"),
        e::ADD_SIGNED => format!("{a} + {b} - 0.5"),
        e::SUBTRACT => format!("{a} - {b}"),
        e::INTERPOLATE => format!("{a} * {c} + {b} * (1.0 - {c})"),
        e::DOT3_RGB | e::DOT3_RGBA => format!("vec3f(4.0 * dot({a} - 0.5, {b} - 0.5))"),
        _ => format!("{a} * {b}"),
    };
    let scale = |part: &str| if scaled { format!(" * u.scales{k}.{part}") } else { String::new() };
    line!(out, "    {{\n        let rgb = saturate(({}){});", apply(functions[0], arguments(0)), scale("rgb"));
    if functions[0] == e::DOT3_RGBA {
        line!(out, "        c = rgb.rrrr;\n    }}");
    } else {
        line!(out, "        let a = saturate(({}){});", apply(functions[1], arguments(1)), scale("a"));
        line!(out, "        c = vec4f(rgb, a);\n    }}");
    }
}
