//! WGSL for a key: the fixed-function vertex and fragment stages.

use std::fmt::Write;

use crate::UNITS;
use crate::arb;
use crate::arb::program::{GENERICS, Output, Program};
use crate::consts as e;
use crate::expand::{expand, far_locations};
use crate::key::{DepthRead, Expand, FogDistance, ShaderKey, TexGenMode, TextureShape, UnitKey};
use crate::lit::{colors, light};
use crate::texels;

/// Locations of vertex attributes.
pub mod location {
    /// Position.
    pub const POSITION: u32 = 0;
    /// Primary colour.
    pub const COLOR: u32 = 1;
    /// Normal.
    pub const NORMAL: u32 = 2;
    /// Secondary colour.
    pub const SECONDARY: u32 = 3;
    /// Fog coordinate.
    pub const FOG: u32 = 4;
    /// The corner of an expanded point or line.
    pub const CORNER: u32 = 5;
    /// The other end of an expanded line.
    pub const OTHER: u32 = 6;
    /// Texture coordinates of unit 0.
    pub const TEXTURE: u32 = 8;
    /// Generic attribute 0.
    pub const GENERIC: u32 = 16;
    /// The depth offset of a polygon: generic attribute 0 is the position, so its location is free.
    pub const OFFSET: u32 = GENERIC;
}

/// The inputs of a module, beside its key.
pub struct ModuleInputs<'a> {
    /// Fields of the block of uniforms, in order.
    pub uniforms: &'a [Field],
    /// The vertex program.
    pub vertex: Option<&'a Program>,
    /// The fragment program.
    pub fragment: Option<&'a Program>,
}

/// A field of the block of uniforms.
pub struct Field {
    /// Its name.
    pub name: &'static str,
    /// The number after its name, if it has one.
    pub index: Option<usize>,
    /// Its vectors.
    pub count: usize,
}

/// The module of a key.
pub fn module(key: &ShaderKey, source: &ModuleInputs) -> String {
    let mut out = String::new();
    if key.planes != 0 {
        line!(out, "enable clip_distances;");
    }
    if key.colors.second {
        line!(out, "enable dual_source_blending;");
    }
    out.push_str(&declaration(source.uniforms));
    for (slot, unit) in key.units.iter().filter(|unit| unit.sampled).enumerate() {
        let compared = if unit.depth == DepthRead::Compared { "_comparison" } else { "" };
        let kind = match unit.kind {
            _ if unit.depth != DepthRead::No => "texture_depth_2d",
            TextureShape::D1 | TextureShape::D2 | TextureShape::Rectangle => "texture_2d<f32>",
            TextureShape::D3 => "texture_3d<f32>",
            TextureShape::Cube => "texture_cube<f32>",
        };
        line!(out, "@group(1) @binding({}) var image{}: {kind};", 2 * slot, unit.unit);
        line!(out, "@group(1) @binding({}) var sampler{}: sampler{compared};", 2 * slot + 1, unit.unit);
    }
    if key.pixels {
        line!(out, "@group(1) @binding({}) var pixels: texture_2d<f32>;", 2 * sampled(key));
    }
    let first = sampled(key) + usize::from(key.pixels);
    for (slot, unit) in (first..).zip(key.units.iter().filter(|unit| unit.border)) {
        line!(out, "@group(1) @binding({}) var white{}: sampler;", 2 * slot + 1, unit.unit);
    }
    interface(key, source, &mut out);
    if key.lighting.is_some() {
        light(key, &mut out);
    }
    let programs: Vec<_> = [source.vertex, source.fragment].into_iter().flatten().collect();
    arb::stage::texels(key, &programs, &mut out);
    match source.vertex {
        Some(program) => {
            functions(program, &mut out);
            arb::stage::vertex_program(key, program, &mut out);
        }
        None => vertex(key, &mut out),
    }
    fragment(key, source, &mut out);
    out
}

/// The declaration of the block of uniforms.
fn declaration(fields: &[Field]) -> String {
    let mut text = String::from("struct Uniforms {\n");
    for &Field { name, index, count } in fields {
        let kind = match (name, count) {
            ("mvp" | "modelview" | "texture_matrix" | "object_planes" | "eye_planes", _) => "mat4x4f".to_owned(),
            ("normal_matrix", _) => "mat3x3f".to_owned(),
            ("vertex_params" | "fragment_params", count) => format!("array<vec4f, {count}>"),
            ("stipple", count) => format!("array<vec4u, {count}>"),
            (_, 1) => "vec4f".to_owned(),
            (_, count) => format!("array<vec4f, {count}>"),
        };
        let index = index.map_or_else(String::new, |index| index.to_string());
        text.push_str(&format!("    {name}{index}: {kind},\n"));
    }
    text.push_str("}\n@group(0) @binding(0) var<uniform> u: Uniforms;\n");
    text
}

/// Writes the module-scope text of a GLSL stage.
fn functions(program: &Program, out: &mut String) {
    if let Some(code) = &program.code {
        out.push_str(&code.functions);
    }
}

/// Number of textures that are read.
fn sampled(key: &ShaderKey) -> usize {
    key.units.iter().filter(|unit| unit.sampled).count()
}

/// The inputs and outputs of the vertex stage.
fn interface(key: &ShaderKey, source: &ModuleInputs, out: &mut String) {
    line!(out, "struct Input {{");
    line!(out, "    @location({}) position: vec4f,", location::POSITION);
    for (location, name, kind) in attributes(key) {
        line!(out, "    @location({location}) {name}: {kind},");
    }
    let others = [
        (key.expand != Expand::No, location::CORNER, "corner: vec2f"),
        (matches!(key.expand, Expand::Line | Expand::SmoothLine), location::OTHER, "other: vec4f"),
        (key.offset, location::OFFSET, "offset: f32"),
    ];
    for (wanted, location, declaration) in others {
        if wanted {
            line!(out, "    @location({location}) {declaration},");
        }
    }
    if key.both_ends() {
        for ((_, name, kind), location) in attributes(key).into_iter().zip(far_locations(key)) {
            line!(out, "    @location({location}) far_{name}: {kind},");
        }
    }
    line!(out, "}}\nstruct Varying {{\n    @builtin(position) position: vec4f,");
    let flat = if key.flat { "@interpolate(flat) " } else { "" };
    line!(out, "    @location(0) {flat}color: vec4f,");
    if key.secondary() {
        line!(out, "    @location(1) {flat}secondary: vec3f,");
    }
    if key.two_side() {
        line!(out, "    @location(2) {flat}back_color: vec4f,");
        if key.secondary() {
            line!(out, "    @location(3) {flat}back_secondary: vec3f,");
        }
    }
    if key.fogged() {
        line!(out, "    @location(4) fog: f32,");
    }
    if key.expand != Expand::No {
        line!(out, "    @location(5) corner: vec4f,");
    }
    if key.offset {
        line!(out, "    @location(7) @interpolate(flat) offset: f32,");
    }
    for unit in key.units.iter().filter(|unit| unit.coordinates && !unit.sprite) {
        let kind = if unit.projective { "vec4f" } else { "vec3f" };
        line!(out, "    @location({}) texture{}: {kind},", location::TEXTURE + unit.unit as u32, unit.unit);
    }
    // Varyings from a vertex shader to a fragment shader.
    let varyings = source.vertex.and(source.fragment).and_then(|program| program.code.as_ref());
    for (k, varying) in varyings.iter().flat_map(|code| &code.varyings).enumerate() {
        let how = varying.interpolation.map_or(String::new(), |how| format!("@interpolate({how}) "));
        line!(out, "    @location({}) {how}user{k}: {},", location::GENERIC as usize + k, varying.kind);
    }
    line!(out, "}}");
    if key.planes != 0 {
        // Only the vertex stage may have clip distances.
        let fields = out[out.rfind("struct Varying {").unwrap_or(0)..].trim_end().trim_end_matches('}').to_owned();
        let clipped = fields.replacen("Varying", "Clipped", 1);
        line!(out, "{clipped}    @builtin(clip_distances) clip: array<f32, {}>,\n}}", key.planes.count_ones());
    }
}

/// The attributes in the buffer beside the position: location, name, type.
pub(crate) fn attributes(key: &ShaderKey) -> Vec<(u32, String, &'static str)> {
    let v = &key.varying;
    let plain = [
        (v.color && key.color(), location::COLOR, "color", "vec4f"),
        (v.normal && key.normal(), location::NORMAL, "normal", "vec3f"),
        (v.secondary && key.vertex_secondary(), location::SECONDARY, "secondary", "vec3f"),
        (v.fog && key.vertex_fog(), location::FOG, "fog", "f32"),
    ];
    let plain = plain.into_iter().filter(|of| of.0).map(|(_, at, name, kind)| (at, name.to_owned(), kind));
    let units = (0..UNITS).filter(|&k| reads_coordinates(key, k));
    let units = units.map(|k| (location::TEXTURE + k as u32, format!("texture{k}"), "vec4f"));
    let generics = (0..GENERICS).filter(|&k| v.generic & 1 << k != 0);
    let generics = generics.map(|k| (location::GENERIC + k as u32, format!("generic{k}"), "vec4f"));
    plain.chain(units).chain(generics).collect()
}

/// Whether the coordinates of a unit are an attribute in the buffer.
#[inline]
pub fn reads_coordinates(key: &ShaderKey, unit: usize) -> bool {
    key.varying.texture[unit] && key.vertex_texture(unit)
}

fn vertex(key: &ShaderKey, out: &mut String) {
    let result = if key.planes != 0 { "Clipped" } else { "Varying" };
    line!(out, "@vertex fn vs(v: Input) -> {result} {{\n    var o: {result};\n    o.position = u.mvp * v.position;");
    if key.eye() {
        let w = if key.projective_eye { " / eye4.w" } else { "" };
        line!(out, "    let eye4 = u.modelview * v.position;\n    let eye = eye4.xyz{w};");
    }
    if key.normal() {
        let from = if key.varying.normal { "v.normal" } else { "u.normal.xyz" };
        line!(out, "    var n = u.normal_matrix * {from};");
        match key.normalize {
            // A normal of length 0 stays 0.
            1 => line!(out, "    n *= select(0.0, inverseSqrt(max(dot(n, n), 1e-37)), dot(n, n) > 0.0);"),
            2 => line!(out, "    n *= u.rescale.x;"),
            _ => {}
        }
    }
    if key.color() {
        let from = if key.varying.color { "v.color" } else { "u.color" };
        line!(out, "    let color = {from};");
    }
    colors(key, out);
    for (bit, plane) in (0..8).filter(|bit| key.planes & 1 << bit != 0).enumerate() {
        line!(out, "    o.clip[{bit}] = dot(u.plane{plane}, eye4);");
    }
    if key.fogged() {
        let distance = match (key.fog_coordinate, key.varying.fog) {
            (true, true) => "v.fog",
            (true, false) => "u.fog_coordinate.x",
            _ => match key.fog_distance {
                FogDistance::Absolute => "abs(eye.z)",
                FogDistance::Signed => "eye.z",
                FogDistance::Radial => "length(eye)",
            },
        };
        line!(out, "    o.fog = {distance};");
    }
    for unit in key.units.iter().filter(|unit| unit.coordinates) {
        coordinates(key, unit, out);
    }
    offset(key, out);
    expand(key, out);
    line!(out, "    return o;\n}}");
}

/// Hands over what lines and points have from the machine.
pub(crate) fn offset(key: &ShaderKey, out: &mut String) {
    if key.offset {
        line!(out, "    o.offset = v.offset;");
    }
}

fn coordinates(key: &ShaderKey, unit: &UnitKey, out: &mut String) {
    if unit.sprite {
        return;
    }
    let k = unit.unit;
    let given = if reads_coordinates(key, k) { format!("v.texture{k}") } else { format!("u.texture{k}") };
    if unit.made.iter().any(Option::is_some) {
        line!(out, "    var t{k}: vec4f;");
        if unit.made.iter().flatten().any(|made| matches!(made, TexGenMode::Sphere | TexGenMode::Reflection)) {
            line!(out, "    let reflected{k} = reflect(normalize(eye), n);");
            line!(out, "    let sphere{k} = 0.5 / length(reflected{k} + vec3f(0, 0, 1));");
        }
        for (i, (made, part)) in unit.made.iter().zip(["x", "y", "z", "w"]).enumerate() {
            let value = match made {
                None => format!("{given}.{part}"),
                Some(TexGenMode::Object) => format!("dot(u.object_planes{k}[{i}], v.position)"),
                Some(TexGenMode::Eye) => format!("dot(u.eye_planes{k}[{i}], eye4)"),
                Some(TexGenMode::Sphere) => format!("reflected{k}.{part} * sphere{k} + 0.5"),
                Some(TexGenMode::Reflection) => format!("reflected{k}.{part}"),
                Some(TexGenMode::Normal) => format!("n.{part}"),
            };
            line!(out, "    t{k}.{part} = {value};");
        }
    } else {
        line!(out, "    let t{k} = {given};");
    }
    let value = if unit.matrix { format!("(u.texture_matrix{k} * t{k})") } else { format!("t{k}") };
    line!(out, "    o.texture{k} = {value}{};", if unit.projective { "" } else { ".xyz" });
}

fn fragment(key: &ShaderKey, source: &ModuleInputs, out: &mut String) {
    let asks = source.fragment.is_some_and(|program| program.code.as_ref().is_some_and(|code| code.facing));
    let facing = if key.two_side() || asks { ", @builtin(front_facing) front: bool" } else { "" };
    let own_depth = source.fragment.is_some_and(|program| program.outputs.contains(&Output::Depth));
    // A depth that a program computes is not offset.
    let depth = match (own_depth, key.offset) {
        (true, _) => Some("out_depth.z"),
        (false, true) => Some("v.position.z + v.offset"),
        (false, false) => None,
    };
    if let Some(program) = source.fragment {
        functions(program, out);
    }
    let more: Vec<u8> =
        if key.colors.alike { (1..key.colors.count).collect() } else { arb::stage::further_colors(key).collect() };
    let several = depth.is_some() || !more.is_empty() || key.colors.second;
    if several {
        let colors: String = more.iter().map(|k| format!("@location({k}) color{k}: vec4f, ")).collect();
        let depth = if depth.is_some() { "@builtin(frag_depth) depth: f32 " } else { "" };
        let (first, second) = match key.colors.second {
            true => ("@location(0) @blend_src(0)", "@location(0) @blend_src(1) second: vec4f, "),
            false => ("@location(0)", ""),
        };
        line!(out, "struct Pixel {{ {first} color: vec4f, {second}{colors}{depth}}}");
    }
    let result = if several { "Pixel" } else { "@location(0) vec4f" };
    line!(out, "@fragment fn fs(v: Varying{facing}) -> {result} {{");
    if key.pixels {
        line!(out, "    let here = vec2f(v.position.x, u.height.x + u.height.y * v.position.y);");
        line!(out, "    let step = vec2i(floor((here - u.pixels[0].xy) * u.pixels[0].zw));");
        line!(out, "    let last = vec2i(textureDimensions(pixels)) - 1;");
        line!(out, "    let pixel = clamp(vec2i(u.pixels[1].xy) + step * vec2i(u.pixels[1].zw), vec2i(), last);");
        line!(out, "    let primary = saturate(textureLoad(pixels, pixel, 0) * u.pixels[2] + u.pixels[3]);");
    } else if key.two_side() {
        line!(out, "    let primary = select(v.back_color, v.color, front);");
    } else {
        line!(out, "    let primary = v.color;");
    }
    if let Some(program) = source.fragment {
        arb::stage::fragment_program(key, program, out);
    } else {
        line!(out, "    var c = primary;");
        for unit in &key.units {
            texels::sample(unit, out);
        }
        for unit in &key.units {
            texels::environment(unit, &key.units, out);
        }
    }
    if key.secondary() && source.fragment.is_none() {
        let secondary = secondary(key);
        line!(out, "    c = vec4f(saturate(c.rgb + {secondary}), c.a);");
    }
    if let Some(mode) = key.fog {
        let factor = match mode {
            e::LINEAR => "(u.fog_terms.z - v.fog) * u.fog_terms.w",
            e::EXP => "exp(-u.fog_terms.x * v.fog)",
            _ => "exp(-(u.fog_terms.x * v.fog) * (u.fog_terms.x * v.fog))",
        };
        line!(out, "    c = vec4f(mix(u.fog_color.rgb, c.rgb, saturate({factor})), c.a);");
    }
    match key.expand {
        // As Mesa's llvmpipe does: discs with hard edges, whose inner parts are less transparent.
        Expand::SmoothPoint => {
            line!(out, "    let within = dot(v.corner.xy, v.corner.xy) / (v.corner.z * v.corner.z);");
            line!(out, "    if within > 1.0 {{ discard; }}");
            line!(out, "    let rim = (1.0 - 1.0 / v.corner.z) * (1.0 - 1.0 / v.corner.z);");
            line!(out, "    c.a = saturate(c.a * max((1.0 - within) / (1.0 - rim), 1.0));");
        }
        Expand::SmoothLine => {
            line!(out, "    c.a *= saturate(v.corner.z - abs(v.corner.x)) * saturate(v.corner.w - abs(v.corner.y));")
        }
        _ => {}
    }
    if key.stipple {
        line!(out, "    let row = u32(u.height.x + u.height.y * v.position.y) & 31u;");
        line!(out, "    if (u.stipple[row >> 2][row & 3] >> (31u - (u32(v.position.x) & 31u)) & 1u) == 0u {{ discard; }}");
    }
    if let Some(compare) = key.alpha {
        let passes = match compare {
            e::LESS => "c.a < a",
            e::LEQUAL => "c.a <= a",
            e::GREATER => "c.a > a",
            e::GEQUAL => "c.a >= a",
            // Half a step of eight bits, or none where alpha is a floating-point number.
            e::EQUAL => "abs(c.a - a) <= u.alpha_reference.y",
            e::NOTEQUAL => "!(abs(c.a - a) <= u.alpha_reference.y)",
            _ => "false",
        };
        line!(out, "    let a = u.alpha_reference.x;\n    if !({passes}) {{ discard; }}");
    }
    if key.colors.scaled {
        let source = if key.colors.float { "c" } else { "saturate(c)" };
        line!(out, "    c = {source} * u.blend_scale;");
    }
    if let Some(narrow) = key.colors.narrow {
        line!(out, "    c = {};", narrow.unswizzle());
    }
    let further = |k: &u8| if key.colors.alike { ", c".to_owned() } else { format!(", c{k}") };
    let further: String = more.iter().map(further).collect();
    let further = if key.colors.second { ", second".to_owned() + &further } else { further };
    let depth = depth.map_or(String::new(), |depth| format!(", saturate({depth})"));
    if several {
        line!(out, "    return Pixel(c{further}{depth});\n}}");
    } else {
        line!(out, "    return c;\n}}");
    }
}

/// The secondary colour of the visible side.
pub(crate) fn secondary(key: &ShaderKey) -> &'static str {
    if key.two_side() { "select(v.back_secondary, v.secondary, front)" } else { "v.secondary" }
}
