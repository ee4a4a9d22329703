//! Stages from programs: connects inputs and results to the fixed functions of the other stage.

use std::collections::BTreeSet;
use std::fmt::Write;

use super::program::{Output, Program, input};
use super::wgsl;
use crate::expand;
use crate::glsl::stage::{self as glsl, Clip, way};
use crate::key::{Colors, DepthRead, ShaderKey, TextureShape};
use crate::texels::{self, Detail};
use crate::wgsl as fixed;

/// Writes a vertex program in place of the fixed functions.
pub fn vertex_program(key: &ShaderKey, program: &Program, out: &mut String) {
    let result = if key.planes != 0 { "Clipped" } else { "Varying" };
    let name = if key.both_ends() { "fn line_end" } else { "@vertex fn vs" };
    line!(out, "{name}(v: Input) -> {result} {{\n    var o: {result};");
    let inputs = (0..32).filter(|bit| program.inputs & 1 << bit != 0);
    for bit in inputs {
        let v = &key.varying;
        let from = |varying: bool| if varying { "v" } else { "u" };
        let value = match bit {
            input::POSITION => "v.position".to_owned(),
            input::COLOR => format!("{}.color", from(v.color)),
            input::NORMAL => format!("vec4f({}.normal.xyz, 1)", from(v.normal)),
            input::SECONDARY => format!("vec4f({}.secondary.xyz, 1)", from(v.secondary)),
            input::FOG => format!("vec4f({}, 0, 0, 1)", if v.fog { "v.fog" } else { "u.fog_coordinate.x" }),
            input::TEXTURE..16 => {
                let k = bit - input::TEXTURE;
                format!("{}.texture{k}", from(v.texture[k as usize]))
            }
            _ => {
                let k = bit - input::GENERIC;
                format!("{}.generic{k}", from(v.generic & 1 << k != 0))
            }
        };
        line!(out, "    let {} = {value};", wgsl::input_name(bit));
    }
    match &program.code {
        Some(code) => glsl::body(key, code, program.stage, out),
        None => wgsl::body(program, "vertex_params", &[], out),
    }
    if program.invariant {
        line!(out, "    o.position = u.mvp * v.position;");
    } else if program.outputs.contains(&Output::Position) {
        // Maps depths from [-w, w] to [0, w].
        line!(out, "    let p4 = out_position;\n    o.position = vec4f(p4.x, u.upward.x * p4.y, 0.5 * (p4.z + p4.w), p4.w);");
    }
    if key.planes != 0 {
        let clip = program.code.as_ref().and_then(|code| code.clip.as_ref());
        match clip {
            Some(Clip::Position(clip)) => line!(out, "    let eye4 = {clip};"),
            Some(Clip::Distances(_)) => {}
            None => line!(out, "    let eye4 = u.modelview * v.position;"),
        }
        for (bit, plane) in (0..8).filter(|bit| key.planes & 1 << bit != 0).enumerate() {
            match clip {
                Some(Clip::Distances(clip)) => line!(out, "    o.clip[{bit}] = {clip}[{plane}];"),
                _ => line!(out, "    o.clip[{bit}] = dot(u.plane{plane}, eye4);"),
            }
        }
    }
    // Values that the fragment stage gets, and whether they are those of one vertex of a line.
    let mut handed: Vec<(String, bool)> = Vec::new();
    // Results that a program does not write are undefined.
    let mut hand = |field: &str, output: Output, from: &dyn Fn(&str) -> String, missing: &str| {
        let written = program.outputs.contains(&output);
        let value = if written { from(&wgsl::output_name(output)) } else { missing.to_owned() };
        line!(out, "    o.{field} = {value};");
        handed.push((field.to_owned(), key.flat && matches!(output, Output::Color(_))));
    };
    let rgba = |name: &str| format!("saturate({name})");
    let rgb = |name: &str| format!("saturate({name}.rgb)");
    hand("color", Output::Color(0), &rgba, "vec4f(0, 0, 0, 1)");
    if key.secondary() {
        hand("secondary", Output::Color(1), &rgb, "vec3f()");
    }
    if key.two_side() {
        hand("back_color", Output::Color(2), &rgba, "vec4f(0, 0, 0, 1)");
        if key.secondary() {
            hand("back_secondary", Output::Color(3), &rgb, "vec3f()");
        }
    }
    if key.fogged() {
        hand("fog", Output::Fog, &|name| format!("{name}.x"), "0.0");
    }
    for unit in key.units.iter().filter(|unit| unit.coordinates && !unit.sprite) {
        hand(&format!("texture{}", unit.unit), Output::Texture(unit.unit as u8), &str::to_owned, "vec4f(0, 0, 0, 1)");
    }
    fixed::offset(key, out);
    if key.both_ends() {
        line!(out, "    return o;\n}}");
        let own = program.code.iter().flat_map(|code| &code.varyings).enumerate();
        handed.extend(own.map(|(k, varying)| (format!("user{k}"), varying.interpolation == Some("flat"))));
        return expand::line_of_program(key, &handed, out);
    }
    expand::expand(key, out);
    line!(out, "    return o;\n}}");
}

/// Writes a fragment program in place of texturing, colour sum and fog; its colour goes to `c`.
pub fn fragment_program(key: &ShaderKey, program: &Program, out: &mut String) {
    for bit in (0..32).filter(|bit| program.inputs & 1 << bit != 0) {
        let value = match bit {
            // Rows from the bottom.
            input::POSITION => {
                let zw = if key.offset { "saturate(v.position.z + v.offset), v.position.w" } else { "v.position.zw" };
                format!("vec4f(v.position.x, u.height.x + u.height.y * v.position.y, {zw})")
            }
            input::COLOR => "primary".to_owned(),
            input::SECONDARY => {
                // That of fixed functions has an alpha of 1, as in Mesa, unless lighting has no secondary colour.
                let colored = key.lighting.as_ref().is_none_or(|lighting| lighting.separate);
                let alpha = u8::from(key.vertex.is_none() && colored);
                format!("vec4f({}, {alpha})", if key.secondary() { fixed::secondary(key) } else { "vec3f()" })
            }
            input::FOG => "vec4f(v.fog, 0, 0, 1)".to_owned(),
            _ => {
                let k = (bit - input::TEXTURE) as usize;
                match key.units.iter().any(|unit| unit.unit == k && unit.sprite) {
                    true => "vec4f(0.5 + vec2f(0.5, -0.5) * v.corner.xy / v.corner.z, 0, 1)".to_owned(),
                    false => format!("v.texture{k}"),
                }
            }
        };
        line!(out, "    let {} = {value};", wgsl::input_name(bit));
    }
    let bound: Vec<usize> = key.units.iter().filter(|unit| unit.sampled).map(|unit| unit.unit).collect();
    match &program.code {
        Some(code) => glsl::body(key, code, program.stage, out),
        None => wgsl::body(program, "fragment_params", &bound, out),
    }
    let color = program.outputs.contains(&Output::Color(0));
    let bounded = |value: String| if key.colors.float { value } else { format!("saturate({value})") };
    line!(out, "    var c = {};", if color { bounded("out_color".into()) } else { "vec4f(0, 0, 0, 1)".into() });
    for k in further_colors(key) {
        line!(out, "    let c{k} = {};", bounded(wgsl::output_name(Output::Color(k))));
    }
    if key.colors.second {
        line!(out, "    let second = {};", bounded(wgsl::output_name(Output::Second)));
    }
}

/// Colour buffers after the first that get a separate colour.
pub fn further_colors(key: &ShaderKey) -> impl Iterator<Item = u8> {
    let Colors { count, written, alike, .. } = key.colors;
    (1..count).filter(move |k| !alike && written & 1 << k != 0)
}

/// The functions of programs that read textures.
pub fn texels(key: &ShaderKey, programs: &[&Program], out: &mut String) {
    let ways = |k: usize| programs.iter().fold(0, |all, program| all | program.ways(k));
    let units: BTreeSet<usize> = programs.iter().flat_map(|program| &program.images).map(|image| image.unit).collect();
    // Assembly programs have one function for each unit, with one name.
    let biased = if programs.iter().all(|program| program.code.is_none()) { "" } else { "_bias" };
    for k in units {
        let unit = key.units.iter().find(|unit| unit.unit == k && unit.sampled);
        let forms = [
            (way::PLAIN, "", "", Detail::Implicit),
            (way::BIAS, biased, ", bias: f32", Detail::Biased),
            (way::LEVEL, "_level", ", level: f32", Detail::Level),
            (way::GRADIENT, "_gradient", "", Detail::Gradient),
        ];
        for (way, ending, parameters, detail) in forms {
            if ways(k) & way == 0 {
                continue;
            }
            let parameters = match (detail, unit.map(|unit| unit.kind)) {
                (Detail::Gradient, Some(TextureShape::D3 | TextureShape::Cube)) => ", dx: vec3f, dy: vec3f",
                (Detail::Gradient, _) => ", dx: vec2f, dy: vec2f",
                _ => parameters,
            };
            line!(out, "fn texel{k}{ending}(coordinates: vec3f{parameters}) -> vec4f {{");
            match unit {
                Some(unit) => {
                    line!(out, "    var at{k} = coordinates;");
                    texels::read(unit, detail, out);
                    line!(out, "    return texel{k};\n}}");
                }
                // A texture that is not complete.
                None => line!(out, "    return vec4f(0, 0, 0, 1);\n}}"),
            }
        }
        if ways(k) & way::SIZE != 0 {
            let size = match unit.map(|unit| unit.kind) {
                Some(TextureShape::D3) => format!("vec3i(textureDimensions(image{k}, level))"),
                Some(_) => format!("vec3i(vec2i(textureDimensions(image{k}, level)), 1)"),
                None => "vec3i()".to_owned(),
            };
            line!(out, "fn texel{k}_size(level: i32) -> vec3i {{\n    return {size};\n}}");
        }
        if ways(k) & way::FETCH != 0 {
            line!(out, "fn texel{k}_fetch(at: vec3i, level: i32) -> vec4f {{");
            match unit {
                Some(unit) => {
                    let at = if unit.kind == TextureShape::D3 { "at" } else { "at.xy" };
                    let read = format!("textureLoad(image{k}, {at}, level)");
                    let read = if unit.depth == DepthRead::No { read } else { format!("vec4f({read})") };
                    line!(out, "    let t = {read};\n    return {};\n}}", texels::swizzled(unit));
                }
                None => line!(out, "    return vec4f(0, 0, 0, 1);\n}}"),
            }
        }
    }
}
