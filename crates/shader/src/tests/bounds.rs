//! Bounds against runs: whatever lies in the ranges of the inputs comes out in the ranges of the outputs.

use std::fmt::Write;

use super::*;
use num::{Lanes, Random};

/// Compiles the only vertex entry point.
fn vertex(source: &str) -> Option<Program> {
    let module = Module::new("test", ModuleSource::Wgsl(source)).ok()?;
    Some(compile(&module, Stage::Vertex, None, &Options::default()).unwrap_or_else(|e| panic!("{e}\n{source}")))
}

/// From -1 to 1.
fn unit(random: &mut Random) -> f32 {
    random.range(-1.0, 1.0)
}

/// Ranges of all outputs, or none; and whether every one of 64 runs whose inputs are `inputs` (a lane each) lies in them.
fn check(program: &Program, ranges: &[Range], inputs: &[Lanes], what: &dyn Fn() -> String) -> Option<Vec<Range>> {
    let resources = Resources::default();
    let uniforms = program.uniforms(&resources);
    let registers: Vec<_> = (0..ranges.len()).map(|slot| program.input_register(slot, 0)).collect();
    let mut encloser = Encloser::new();
    let given: Vec<_> = registers.iter().zip(ranges).filter_map(|(register, &range)| Some(((*register)?, range))).collect();
    if !encloser.enclose(program, &resources, &uniforms, &given) {
        return None;
    }
    let mut executor = Executor::new();
    let mut bound = executor.bind(program, &resources, &uniforms);
    for (slot, input) in inputs.iter().enumerate() {
        if let Some(register) = bound.input_mut(slot, 0) {
            *register = *input;
        }
    }
    bound.run(!0, 0).unwrap_or_else(|e| panic!("{e}"));
    let mut out = Vec::new();
    for (slot, output) in program.interface().outputs.iter().enumerate() {
        for c in 0..output.components as usize {
            let range = encloser.output(program, slot, c);
            for (lane, &bits) in bound.output(slot, c).0.iter().enumerate() {
                let given: Vec<u32> = inputs.iter().map(|input| input.0[lane]).collect();
                let x = f32::from_bits(bits);
                assert!(range.holds(bits), "output {slot}.{c} is {bits} ({x:?}), not in {range:?}, for {given:?}; {}", what());
            }
            out.push(range);
        }
    }
    Some(out)
}

#[test]
fn control_flow_on_integers_stays_in_its_bounds() {
    let (mut seen, mut bounded, mut tight) = (0, 0, 0);
    for seed in 0..300 {
        let source = format!(
            "{}
             struct Out {{ @builtin(position) p: vec4f, @location(0) @interpolate(flat) r: u32 }}
             @vertex fn main(@location(0) x: u32) -> Out {{ return Out(vec4f(0, 0, 0, 1), f(x)); }}",
            random::function(seed)
        );
        let Some(program) = vertex(&source) else { continue };
        for (least, greatest) in [(0, 63), (5, 5), (12, 19), (0, 1), (u32::MAX - 63, u32::MAX)] {
            let lanes = Lanes(std::array::from_fn(|i| least + i as u32 % (greatest - least + 1)));
            let ranges = [Range::unsigned(least, greatest)];
            let found = check(&program, &ranges, &[lanes], &|| format!("seed {seed}, {least}..={greatest} of\n{source}"));
            seen += 1;
            let Some(found) = found else { continue };
            bounded += 1;
            assert!(least < greatest || found[4].bits().is_some(), "a single value stays one: seed {seed} of\n{source}");
            tight += u32::from(least < greatest && found[4] != Range::ANY);
        }
    }
    // Of what is known of several values little is left after programs like these, but not nothing.
    assert!(bounded > seen / 2 && tight > 50, "{seen} seen, {bounded} with bounds, {tight} that say something");
}

/// A random expression of three numbers `a`, `b`, `c`.
fn expression(random: &mut Random, depth: u32) -> String {
    if depth == 0 {
        return match random.below(5) {
            0 => format!("{:.3}", 4.0 * unit(random)),
            k => ["a", "b", "c", "a"][k as usize - 1].to_owned(),
        };
    }
    let x = expression(random, depth - 1);
    let y = expression(random, depth - 1);
    match random.below(24) {
        0..=2 => format!("({x} + {y})"),
        3..=5 => format!("({x} - {y})"),
        6..=8 => format!("({x} * {y})"),
        9 => format!("({x} / {y})"),
        10 => format!("sqrt({x})"),
        11 => format!("inverseSqrt({x})"),
        12 => format!("min({x}, {y})"),
        13 => format!("max({x}, {y})"),
        14 => format!("abs({x})"),
        15 => format!("floor({x}) + fract({y})"),
        16 => format!("clamp({x}, -0.5, {y})"),
        17 => format!("select({x}, {y}, {x} < {y})"),
        18 => format!("dot(vec3f({x}, {y}, a), vec3f(b, {x}, {y}))"),
        19 => format!("normalize(vec3f({x}, {y}, 0.5)).y"),
        20 => format!("length(vec2f({x}, {y}))"),
        21 => format!("f32(i32({x}) / 2 + i32({y}) % 3)"),
        22 => format!("(mix({x}, {y}, 0.25) * sign({x}) + round({y}) - trunc({x}) + ceil({y}))"),
        _ => format!("select(1.0, 0.0, {x} == {y}) + saturate({y}) - smoothstep(-1.0, 1.0, {x})"),
    }
}

#[test]
fn arithmetic_stays_in_its_bounds() {
    let (mut seen, mut finite) = (0, 0);
    for seed in 0..400 {
        let mut random = Random::new(u64::from(seed * 77));
        let mut text = String::new();
        for i in 0..3 {
            writeln!(text, "let r{i} = {};", expression(&mut random, 1 + seed % 4)).expect("text");
        }
        let source = format!(
            "@vertex fn main(@location(0) a: f32, @location(1) b: f32, @location(2) c: f32) -> @builtin(position) vec4f {{
                 var w = 1.0;
                 {text}
                 if (r0 > 0.25) {{ w = r1; }} else if (r1 < c) {{ w += r0; }}
                 return vec4f(r0, r1, r2, w);
             }}"
        );
        // What is certain to divide by zero is refused.
        let Some(program) = vertex(&source) else { continue };
        for size in [0.0, 1e-6, 0.01, 0.3, 2.0, 1e20] {
            let boxes: [(f32, f32); 3] = std::array::from_fn(|_| {
                let (at, by) = (3.0 * unit(&mut random), size * unit(&mut random).abs());
                (at - by, at + by)
            });
            let ranges = boxes.map(|(least, greatest)| Range::floats(least, greatest));
            // Corners first, then anything.
            let lanes = |random: &mut Random, axis: usize| {
                Lanes(std::array::from_fn(|i| {
                    let (least, greatest) = boxes[axis];
                    let t = 0.5 + 0.5 * unit(random);
                    let x = match (i < 8, i >> axis & 1) {
                        (true, 0) => least,
                        (true, _) => greatest,
                        (false, _) => (least + (greatest - least) * t).clamp(least, greatest),
                    };
                    x.to_bits()
                }))
            };
            let inputs = [0, 1, 2].map(|axis| lanes(&mut random, axis));
            let found = check(&program, &ranges, &inputs, &|| format!("seed {seed}, box {boxes:?} of\n{source}"));
            let found = found.expect("straight-line code has bounds");
            seen += found.len();
            finite += found.iter().filter(|range| range.ends().is_some()).count();
        }
    }
    assert!(seen > 4_000 && finite > seen / 3, "{finite} of {seen} outputs have bounds");
}

#[test]
fn a_matrix_gives_exactly_the_ends_of_its_rows() {
    let source = "@vertex fn main(@location(0) a: f32, @location(1) b: f32, @location(2) c: f32) -> @builtin(position) vec4f {
        return mat4x4f(2, 0, 0, 1, 0, 3, 0, 0, 0, 0, -1, 0.5, 10, 20, 30, 40) * vec4f(a, b, c, 1.0);
    }";
    let program = vertex(source).expect("a program");
    let range = Range::floats;
    let lanes = [(-1.0, 1.0), (0.0, 2.0), (4.0, 8.0)]
        .map(|(a, b): (f32, f32)| Lanes(std::array::from_fn(|i| if i % 2 == 0 { a } else { b }.to_bits())));
    let found = check(&program, &[range(-1.0, 1.0), range(0.0, 2.0), range(4.0, 8.0)], &lanes, &String::new);
    let ends: Vec<_> = found.expect("bounds").iter().map(|range| range.ends()).collect();
    assert_eq!(ends, [Some((8.0, 12.0)), Some((20.0, 26.0)), Some((22.0, 26.0)), Some((41.0, 45.0))]);
}

#[test]
fn what_cannot_be_told_is_anything() {
    let ends = |body: &str, least: f32, greatest: f32| {
        let source = format!(
            "@group(0) @binding(0) var image: texture_2d<f32>;
             @group(0) @binding(1) var<storage, read> places: array<f32>;
             @vertex fn main(@location(0) a: f32) -> @builtin(position) vec4f {{ {body} }}"
        );
        let program = vertex(&source).expect("a program");
        let resources = Resources::default();
        let uniforms = program.uniforms(&resources);
        let mut encloser = Encloser::new();
        let register = program.input_register(0, 0).expect("an input that is read");
        let range = if least == greatest { Range::point(least.to_bits()) } else { Range::floats(least, greatest) };
        encloser.enclose(&program, &resources, &uniforms, &[(register, range)]).then(|| encloser.output(&program, 0, 0).ends())
    };
    // By what they are.
    assert_eq!(ends("return vec4f(textureLoad(image, vec2u(u32(a), 0), 0).x + a);", 0.0, 1.0), Some(None));
    assert_eq!(ends("return vec4f(places[u32(a)] + a);", 0.0, 3.0), Some(None));
    assert_eq!(ends("return vec4f(places[u32(a)] + a);", 2.0, 2.0), Some(Some((2.0, 2.0))), "one place holds one value");
    assert_eq!(ends("return vec4f(sin(a));", 0.0, 1.0), Some(None));
    // By where they may go: through zero, below zero, beyond what is finite.
    assert_eq!(ends("return vec4f(1.0 / a);", -1.0, 1.0), Some(None));
    assert_eq!(ends("return vec4f(1.0 / a);", 0.5, 1.0), Some(Some((1.0, 2.0))));
    assert_eq!(ends("return vec4f(sqrt(a));", -1.0, 1.0), Some(None));
    assert_eq!(ends("return vec4f(a * a);", -1e20, 2.0), Some(None));
    assert_eq!(ends("return vec4f(a * a);", -2.0, 1.0), Some(Some((0.0, 4.0))), "a square is not below zero");
    assert_eq!(ends("return vec4f(a);", f32::NAN, 1.0), Some(None));
    assert_eq!(ends("return vec4f(a);", 1.0, f32::INFINITY), Some(None));
    // Loops: as often as is known, and never without end.
    let rounds = "var x = a; for (var i = 0; i < 300; i++) { x += 1.0; } return vec4f(x);";
    assert_eq!(ends(rounds, 0.0, 1.0), Some(Some((300.0, 301.0))));
    let until = "var x = a; while (x < 4.0) { x += 1.0; } return vec4f(x);";
    assert_eq!(ends(until, 0.0, 0.5), Some(Some((4.0, 4.5))), "all leave in the same round");
    assert!(ends("var x = a; while (x != 4.0) { x += 0.5; } return vec4f(x);", 0.0, 0.75).is_none());
}
