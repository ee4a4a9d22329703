//! Texture environments (OpenGL 1.5, tables 3.22 to 3.24) and generated coordinates (section 2.11.4).

use anyhow::Result;
use glam::{DVec3, DVec4, dvec3};

use super::super::{Row, Setting};
use super::{Cases, list, point, unit, vector};
use num::Random;

/// A texel of a base format: its bytes, how they are given, and its colour and alpha where the format has them.
struct Texel {
    base: &'static str,
    format: &'static str,
    bytes: Vec<u8>,
    rgb: Option<[f64; 3]>,
    alpha: Option<f64>,
}

fn texel(base: &'static str, random: &mut Random) -> Texel {
    let mut byte = || random.below(256) as u8;
    let of = |byte: u8| f64::from(byte) / 255.0;
    let (format, count) = match base {
        "ALPHA" => ("ALPHA", 1),
        "LUMINANCE" | "INTENSITY" => ("LUMINANCE", 1),
        "LUMINANCE_ALPHA" => ("LUMINANCE_ALPHA", 2),
        "RGB" => ("RGB", 3),
        _ => ("RGBA", 4),
    };
    let bytes: Vec<u8> = (0..count).map(|_| byte()).collect();
    let rgb = match count {
        _ if base == "ALPHA" => None,
        1 | 2 => Some([of(bytes[0]); 3]),
        _ => Some([of(bytes[0]), of(bytes[1]), of(bytes[2])]),
    };
    let alpha = match base {
        "ALPHA" | "INTENSITY" => Some(of(bytes[0])),
        "LUMINANCE_ALPHA" => Some(of(bytes[1])),
        "RGBA" => Some(of(bytes[3])),
        _ => None,
    };
    Texel { base, format, bytes, rgb, alpha }
}

impl Texel {
    /// Calls that make it the texture of the active unit.
    fn install(&self, cases: &mut Cases, fault: bool) {
        let bytes: Vec<u8> = self.bytes.iter().map(|&byte| if fault { !byte } else { byte }).collect();
        cases.recording.texture(&format!("GL_{}", self.base), [1, 1], &format!("GL_{}", self.format), &bytes);
    }
}

pub(super) fn environments(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x14);
    let mut cases = Cases::default();
    for _ in 0..setting.pick(2, 8, 40) {
        for base in ["ALPHA", "LUMINANCE", "LUMINANCE_ALPHA", "INTENSITY", "RGB", "RGBA"] {
            let texel = texel(base, &mut random);
            texel.install(&mut cases, setting.inject_fault);
            let [f, k]: [[f64; 4]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| unit(&mut random)));
            for mode in ["REPLACE", "MODULATE", "DECAL", "BLEND", "ADD"] {
                if mode == "DECAL" && !matches!(base, "RGB" | "RGBA") {
                    continue;
                }
                let color = |c: usize| match (mode, texel.rgb) {
                    (_, None) => f[c],
                    ("REPLACE", Some(t)) => t[c],
                    ("MODULATE", Some(t)) => f[c] * t[c],
                    ("DECAL", Some(t)) => f[c] * (1.0 - texel.alpha.unwrap_or(1.0)) + t[c] * texel.alpha.unwrap_or(1.0),
                    ("BLEND", Some(t)) => f[c] * (1.0 - t[c]) + k[c] * t[c],
                    (_, Some(t)) => f[c] + t[c],
                };
                let alpha = match (mode, texel.alpha) {
                    (_, None) | ("DECAL", _) => f[3],
                    ("REPLACE", Some(t)) => t,
                    ("BLEND", Some(t)) if base == "INTENSITY" => f[3] * (1.0 - t) + k[3] * t,
                    ("ADD", Some(t)) if base == "INTENSITY" => f[3] + t,
                    (_, Some(t)) => f[3] * t,
                };
                let calls = format!(
                    "glEnable(GL_TEXTURE_2D)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_{mode})\n\
                     glTexEnvfv(GL_TEXTURE_ENV,GL_TEXTURE_ENV_COLOR,{{{}}})\nglColor4f({})\nglRectf(-1,-1,1,1)",
                    list(&k),
                    list(&f)
                );
                let name = format!("{} of {}", mode.to_lowercase(), base.to_lowercase());
                cases.frame(format!("{name}, colour"), &calls, std::array::from_fn(color));
                cases.alpha(format!("{name}, alpha"), &calls, alpha);
            }
        }
    }
    cases.rows()
}

/// A combiner's function: its name, how many of its arguments it reads, and the function.
type Function = (&'static str, usize, fn(f64, f64, f64) -> f64);

/// The functions of combiners that both colour and alpha have.
const FUNCTIONS: [Function; 6] = [
    ("REPLACE", 1, |a, _, _| a),
    ("MODULATE", 2, |a, b, _| a * b),
    ("ADD", 2, |a, b, _| a + b),
    ("ADD_SIGNED", 2, |a, b, _| a + b - 0.5),
    ("INTERPOLATE", 3, |a, b, c| a * c + b * (1.0 - c)),
    ("SUBTRACT", 2, |a, b, _| a - b),
];

pub(super) fn combiners(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x15);
    let mut cases = Cases::default();
    for _ in 0..setting.pick(2, 8, 40) {
        let texel = texel("RGBA", &mut random);
        texel.install(&mut cases, setting.inject_fault);
        let rgb = texel.rgb.unwrap_or_default();
        let t = [rgb[0], rgb[1], rgb[2], texel.alpha.unwrap_or(1.0)];
        let [f, k]: [[f64; 4]; 2] = std::array::from_fn(|_| std::array::from_fn(|_| unit(&mut random)));
        let base = format!(
            "glEnable(GL_TEXTURE_2D)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_COMBINE)\n\
             glTexEnvfv(GL_TEXTURE_ENV,GL_TEXTURE_ENV_COLOR,{{{}}})\nglColor4f({})\n",
            list(&k),
            list(&f)
        );
        let end = "glRectf(-1,-1,1,1)";
        let env = |name: &str, value: &str| format!("glTexEnvi(GL_TEXTURE_ENV,GL_{name},{value})\n");
        // Arguments: texture, primary colour, constant.
        let sources = |part: &str| {
            ["TEXTURE", "PRIMARY_COLOR", "CONSTANT"]
                .iter()
                .enumerate()
                .map(|(k, source)| env(&format!("SRC{k}_{part}"), &format!("GL_{source}")))
                .collect::<String>()
        };
        // The third argument of colours is the constant's colour here, not its alpha.
        let third = env("OPERAND2_RGB", "GL_SRC_COLOR");
        for (name, arguments, apply) in FUNCTIONS {
            for scale in [1.0, 2.0, 4.0] {
                let lower = name.to_lowercase();
                let calls = format!(
                    "{base}{}{third}{}{}{end}",
                    sources("RGB"),
                    env("COMBINE_RGB", &format!("GL_{name}")),
                    env("RGB_SCALE", &scale.to_string())
                );
                let wanted = std::array::from_fn(|c| scale * apply(t[c], f[c], k[c]));
                cases.frame(format!("{lower} of {arguments}, colour, times {scale}"), &calls, wanted);
                let calls = format!(
                    "{base}{}{}{}{end}",
                    sources("ALPHA"),
                    env("COMBINE_ALPHA", &format!("GL_{name}")),
                    env("ALPHA_SCALE", &scale.to_string())
                );
                cases.alpha(format!("{lower} of {arguments}, alpha, times {scale}"), &calls, scale * apply(t[3], f[3], k[3]));
            }
        }
        let product = 4.0 * (0..3).map(|c| (t[c] - 0.5) * (f[c] - 0.5)).sum::<f64>();
        for name in ["DOT3_RGB", "DOT3_RGBA"] {
            let calls = format!("{base}{}{}{end}", sources("RGB"), env("COMBINE_RGB", &format!("GL_{name}")));
            cases.frame(format!("{}, colour", name.to_lowercase()), &calls, [product; 3]);
        }
        let calls = format!("{base}{}{}{end}", sources("RGB"), env("COMBINE_RGB", "GL_DOT3_RGBA"));
        cases.alpha("dot3_rgba, alpha", &calls, product.clamp(0.0, 1.0));
        // PREVIOUS is the primary colour in unit 0; TEXTURE0 is the crossbar.
        for (source, v) in [("TEXTURE", t), ("PRIMARY_COLOR", f), ("CONSTANT", k), ("PREVIOUS", f), ("TEXTURE0", t)] {
            for operand in ["SRC_COLOR", "ONE_MINUS_SRC_COLOR", "SRC_ALPHA", "ONE_MINUS_SRC_ALPHA"] {
                let inverse = operand.starts_with("ONE_MINUS");
                let value = |c: usize| {
                    let part = if operand.ends_with("ALPHA") { v[3] } else { v[c] };
                    if inverse { 1.0 - part } else { part }
                };
                let calls = format!(
                    "{base}{}{}{}{end}",
                    env("COMBINE_RGB", "GL_REPLACE"),
                    env("SRC0_RGB", &format!("GL_{source}")),
                    env("OPERAND0_RGB", &format!("GL_{operand}"))
                );
                let name = format!("{} as {}", source.to_lowercase(), operand.to_lowercase());
                cases.frame(name, &calls, std::array::from_fn(value));
            }
        }
    }
    cases.rows()
}

pub(super) fn generation(setting: &Setting) -> Result<Vec<Row>> {
    let mut random = Random::nth(setting.seed, 0x16);
    let mut cases = Cases::default();
    // Texel k has the colour k: what is read at s is 256 s - 0.5.
    let ramp: Vec<u8> = (0..=255).collect();
    cases.recording.texture("GL_LUMINANCE", [256, 1], "GL_LUMINANCE", &ramp);
    cases.recording.add(
        "glTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MIN_FILTER,GL_LINEAR)\nglTexParameteri(GL_TEXTURE_2D,GL_TEXTURE_MAG_FILTER,GL_LINEAR)",
    );
    let turned = |[x, y, z, w]: [f64; 4]| if setting.inject_fault { [y, x, z, w] } else { [x, y, z, w] };
    for _ in 0..setting.pick(3, 12, 60) {
        let random = &mut random;
        let mut signed = |most: f64| most * (2.0 * unit(random) - 1.0);
        let object = vector(|| signed(0.4));
        let by = vector(|| signed(0.3));
        let eye = object + by;
        let normal = dvec3(signed(1.0), signed(1.0), 0.4 + signed(0.3)).normalize();
        let plane = DVec4::from_array(std::array::from_fn(|_| signed(0.5)));
        let on_plane = |p: DVec3| plane.dot(p.extend(1.0));
        let reflected = eye.normalize().reflect(normal);
        let m = 2.0 * (reflected + DVec3::Z).length();
        for (coordinate, letter) in ["S", "T", "R", "Q"].into_iter().enumerate() {
            let modes = [
                ("OBJECT_LINEAR", 4, on_plane(object)),
                ("EYE_LINEAR", 4, on_plane(eye)),
                ("SPHERE_MAP", 2, reflected.extend(0.0)[coordinate] / m + 0.5),
                ("REFLECTION_MAP", 3, reflected.extend(0.0)[coordinate]),
                ("NORMAL_MAP", 3, normal.extend(0.0)[coordinate]),
            ];
            for (mode, _, value) in modes.into_iter().filter(|&(_, count, _)| coordinate < count) {
                // The texture matrix takes the coordinate to s, from 0.05 to 0.95, and another one, which is 1, to q.
                let one = if coordinate == 3 { 0 } else { 3 };
                let mut matrix = [0.0; 16];
                (matrix[4 * coordinate], matrix[4 * one], matrix[4 * one + 3]) = (0.3, 0.5, 1.0);
                let given = if coordinate == 3 { "1,0,0,1" } else { "0,0,0,1" };
                let [nx, ny, nz, _] = turned(normal.extend(0.0).to_array());
                let calls = format!(
                    "glEnable(GL_TEXTURE_2D)\nglTexEnvi(GL_TEXTURE_ENV,GL_TEXTURE_ENV_MODE,GL_REPLACE)\nglMatrixMode(GL_TEXTURE)\n\
                     glLoadMatrixf({{{}}})\nglMatrixMode(GL_MODELVIEW)\nglTexGeni(GL_{letter},GL_TEXTURE_GEN_MODE,GL_{mode})\n\
                     glTexGenfv(GL_{letter},GL_OBJECT_PLANE,{{{2}}})\nglTexGenfv(GL_{letter},GL_EYE_PLANE,{{{2}}})\n\
                     glEnable(GL_TEXTURE_GEN_{letter})\nglPushMatrix()\nglTranslatef({1})\nglTexCoord4f({given})\nglNormal3f({3})\n{4}\n\
                     glPopMatrix()",
                    list(&matrix),
                    list(&by.to_array()),
                    list(&turned(plane.to_array())),
                    list(&[nx, ny, nz]),
                    point(object)
                );
                let name = format!("{}, {}", mode.to_lowercase().replace('_', " "), letter.to_lowercase());
                cases.frame(name, &calls, [(256.0 * (0.3 * value + 0.5) - 0.5) / 255.0; 3]);
            }
        }
    }
    cases.rows()
}
