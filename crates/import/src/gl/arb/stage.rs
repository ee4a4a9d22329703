//! The stages that programs are: inputs and results joined to what the fixed functions of the other stage have.

use std::fmt::Write;

use super::program::{Output, Program, input};
use super::wgsl;
use crate::gl::key::{ShaderKey, UnitKey};
use crate::gl::state::UNITS;
use crate::gl::wgsl as fixed;

/// A line of code.
macro_rules! line {
    ($out:expr, $($text:tt)*) => { writeln!($out, $($text)*).expect("text in memory") };
}

/// A vertex program in the place of the fixed functions.
pub fn vertex_program(key: &ShaderKey, program: &Program, out: &mut String) {
    let result = if key.planes != 0 { "Clipped" } else { "Varying" };
    line!(out, "@vertex fn vs(v: Input) -> {result} {{\n    var o: {result};");
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
    wgsl::body(program, "vertex_params", &[false; UNITS], out);
    if program.invariant {
        line!(out, "    o.position = u.mvp * v.position;");
    } else if program.outputs.contains(&Output::Position) {
        // Depths from -w to w become 0 to w.
        line!(out, "    let p4 = out_position;\n    o.position = vec4f(p4.x, u.upward.x * p4.y, 0.5 * (p4.z + p4.w), p4.w);");
    }
    if key.planes != 0 {
        line!(out, "    let eye4 = u.modelview * v.position;");
        for (bit, plane) in (0..8).filter(|bit| key.planes & 1 << bit != 0).enumerate() {
            line!(out, "    o.clip[{bit}] = dot(u.plane{plane}, eye4);");
        }
    }
    // What a program does not write is undefined.
    let mut hand = |field: &str, output: Output, from: &dyn Fn(&str) -> String, missing: &str| {
        let written = program.outputs.contains(&output);
        let value = if written { from(&wgsl::output_name(output)) } else { missing.to_owned() };
        line!(out, "    o.{field} = {value};");
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
    if key.line_stipple {
        line!(out, "    o.along = v.along;");
    }
    fixed::expand(key, out);
    line!(out, "    return o;\n}}");
}

/// A fragment program in the place of texturing, colour sum and fog; its colour goes to `c`.
pub fn fragment_program(key: &ShaderKey, program: &Program, out: &mut String) {
    for bit in (0..32).filter(|bit| program.inputs & 1 << bit != 0) {
        let value = match bit {
            // Rows from the bottom.
            input::POSITION => "vec4f(v.position.x, u.height.x + u.height.y * v.position.y, v.position.zw)".to_owned(),
            input::COLOR => "primary".to_owned(),
            input::SECONDARY if key.secondary() => format!("vec4f({}, 0)", fixed::secondary(key)),
            input::SECONDARY => "vec4f()".to_owned(),
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
    let mut bound = [false; UNITS];
    for unit in key.units.iter().filter(|unit| unit.sampled) {
        bound[unit.unit] = true;
    }
    wgsl::body(program, "fragment_params", &bound, out);
    let color = program.outputs.contains(&Output::Color(0));
    line!(out, "    var c = {};", if color { "saturate(out_color)" } else { "vec4f(0, 0, 0, 1)" });
}

/// The function of a fragment program that reads a unit's texture.
pub fn texel(unit: &UnitKey, out: &mut String) {
    let k = unit.unit;
    let bias = if unit.dynamic { ", bias: f32" } else { "" };
    line!(out, "fn texel{k}(coordinates: vec3f{bias}) -> vec4f {{\n    var at{k} = coordinates;");
    fixed::read(unit, out);
    line!(out, "    return texel{k};\n}}");
}
