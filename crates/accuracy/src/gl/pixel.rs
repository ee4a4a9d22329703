//! Fog (OpenGL 1.5, section 3.10) and blending (section 4.1.7).

use anyhow::Result;
use glam::dvec3;

use super::super::{Row, Setting};
use super::{Cases, list, point, unit};
use num::Random;

pub(super) fn fog(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x12);
    let mut cases = Cases::default();
    cases.recording.add("glMatrixMode(GL_PROJECTION)\nglOrtho(-1,1,-1,1,0,16)\nglMatrixMode(GL_MODELVIEW)");
    for _ in 0..setting.pick(4, 16, 100) {
        let color: [f64; 3] = std::array::from_fn(|_| unit(&mut random));
        let fog: [f64; 3] = std::array::from_fn(|_| unit(&mut random));
        let (distance, density) = (0.1 + 8.0 * unit(&mut random), 0.5 * unit(&mut random));
        let (start, end) = (1.0 + unit(&mut random), 6.0 + unit(&mut random));
        let drawn = if setting.inject_fault { 1.3 * distance } else { distance };
        for (mode, factor) in [
            ("LINEAR", (end - distance) / (end - start)),
            ("EXP", (-density * distance).exp()),
            ("EXP2", (-(density * distance).powi(2)).exp()),
        ] {
            let factor = factor.clamp(0.0, 1.0);
            let expected = std::array::from_fn(|c| factor * color[c] + (1.0 - factor) * fog[c]);
            let calls = format!(
                "glEnable(GL_FOG)\nglFogi(GL_FOG_MODE,GL_{mode})\nglFogf(GL_FOG_DENSITY,{density})\nglFogf(GL_FOG_START,{start})\n\
                 glFogf(GL_FOG_END,{end})\nglFogfv(GL_FOG_COLOR,{{{},1}})\nglColor3f({})\n",
                list(&fog),
                list(&color)
            );
            let name = mode.to_lowercase();
            cases.frame(format!("{name}, by the distance"), &format!("{calls}{}", point(dvec3(0.0, 0.0, -drawn))), expected);
            let calls = format!("{calls}glFogi(GL_FOG_COORD_SRC,GL_FOG_COORD)\nglFogCoordf({drawn})\n");
            cases.frame(format!("{name}, by the coordinate"), &format!("{calls}{}", point(dvec3(0.0, 0.0, -1.0))), expected);
        }
    }
    cases.rows()
}

/// Factors by name: what they are of source, destination and constant. The window's alpha is 1.
fn factor(name: &str, s: [f64; 4], d: [f64; 4], k: [f64; 4], c: usize) -> f64 {
    match name {
        "ZERO" => 0.0,
        "ONE" => 1.0,
        "SRC_COLOR" => s[c],
        "ONE_MINUS_SRC_COLOR" => 1.0 - s[c],
        "DST_COLOR" => d[c],
        "ONE_MINUS_DST_COLOR" => 1.0 - d[c],
        "SRC_ALPHA" => s[3],
        "ONE_MINUS_SRC_ALPHA" => 1.0 - s[3],
        "DST_ALPHA" => d[3],
        "ONE_MINUS_DST_ALPHA" => 1.0 - d[3],
        "CONSTANT_COLOR" => k[c],
        "ONE_MINUS_CONSTANT_COLOR" => 1.0 - k[c],
        "CONSTANT_ALPHA" => k[3],
        "ONE_MINUS_CONSTANT_ALPHA" => 1.0 - k[3],
        _ => s[3].min(1.0 - d[3]),
    }
}

const FACTORS: [&str; 15] = [
    "ZERO",
    "ONE",
    "SRC_COLOR",
    "ONE_MINUS_SRC_COLOR",
    "DST_COLOR",
    "ONE_MINUS_DST_COLOR",
    "SRC_ALPHA",
    "ONE_MINUS_SRC_ALPHA",
    "DST_ALPHA",
    "ONE_MINUS_DST_ALPHA",
    "CONSTANT_COLOR",
    "ONE_MINUS_CONSTANT_COLOR",
    "CONSTANT_ALPHA",
    "ONE_MINUS_CONSTANT_ALPHA",
    "SRC_ALPHA_SATURATE",
];

pub(super) fn blend(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x13);
    let mut cases = Cases::default();
    for _ in 0..setting.pick(2, 8, 40) {
        let random = &mut random;
        // Colours of 8 bits: the card rounds them so before it blends, which may cost a half on either side.
        let mut byte = || f64::from(random.below(256)) / 255.0;
        let [s, k]: [[f64; 4]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| byte()));
        let [r, g, b]: [f64; 3] = std::array::from_fn(|_| byte());
        let d = [r, g, b, 1.0];
        let clear = if setting.inject_fault { [1.0 - r, 1.0 - g, 1.0 - b] } else { [r, g, b] };
        let state = format!(
            "glClearColor({},1)\nglClear(GL_COLOR_BUFFER_BIT)\nglEnable(GL_BLEND)\nglBlendColor({})\nglColor4f({})\n",
            list(&clear),
            list(&k),
            list(&s)
        );
        let mut add = |name: String, source: &str, destination: &str, equation: &str, expected: [f64; 3]| {
            let calls =
                format!("{state}glBlendFunc(GL_{source},GL_{destination})\nglBlendEquation(GL_{equation})\nglRectf(-1,-1,1,1)");
            cases.frame(name, &calls, expected);
        };
        for name in FACTORS {
            let of = |c: usize| factor(name, s, d, k, c);
            let lower = name.to_lowercase();
            let expected = std::array::from_fn(|c| s[c] * of(c) + d[c] * (1.0 - s[3]));
            add(format!("source times {lower}"), name, "ONE_MINUS_SRC_ALPHA", "FUNC_ADD", expected);
            if name != "SRC_ALPHA_SATURATE" {
                let expected = std::array::from_fn(|c| s[c] * s[3] + d[c] * of(c));
                add(format!("destination times {lower}"), "SRC_ALPHA", name, "FUNC_ADD", expected);
            }
        }
        let weighted = |c: usize| (s[c] * s[3], d[c] * (1.0 - s[3]));
        for (equation, apply) in [
            ("FUNC_ADD", (|_, _, a, b| a + b) as fn(f64, f64, f64, f64) -> f64),
            ("FUNC_SUBTRACT", |_, _, a, b| a - b),
            ("FUNC_REVERSE_SUBTRACT", |_, _, a, b| b - a),
            // These do not weight.
            ("MIN", |s, d, _, _| s.min(d)),
            ("MAX", |s, d, _, _| s.max(d)),
        ] {
            let expected = std::array::from_fn(|c| apply(s[c], d[c], weighted(c).0, weighted(c).1));
            let name = format!("equation {}", equation.to_lowercase());
            add(name, "SRC_ALPHA", "ONE_MINUS_SRC_ALPHA", equation, expected);
        }
    }
    cases.rows()
}
