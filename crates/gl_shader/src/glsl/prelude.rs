//! Built-in functions that naga or WGSL does not have, as text before the shader.

use std::fmt::Write;

/// Functions of this kind.
const NAMES: [&str; 8] = ["outerProduct", "matrixCompMult", "noise1", "noise2", "noise3", "noise4", "isnan", "isinf"];

/// The name in the text for naga of a built-in function that is written here.
pub fn renamed(name: &str) -> Option<String> {
    NAMES.contains(&name).then(|| format!("glx_{name}"))
}

/// The type of a matrix with `columns` columns and `rows` rows.
fn matrix(columns: usize, rows: usize) -> String {
    if columns == rows { format!("mat{rows}") } else { format!("mat{columns}x{rows}") }
}

/// `count` texts with their numbers, with commas between them.
fn list(count: usize, one: impl Fn(usize) -> String) -> String {
    (0..count).map(one).collect::<Vec<_>>().join(", ")
}

/// The overloads of a function, by its name in the text for naga.
pub fn text(name: &str, out: &mut String) {
    let component = |k: usize| ["x", "y", "z", "w"][k];
    match name {
        "glx_outerProduct" | "glx_matrixCompMult" => {
            for (columns, rows) in (2..=4).flat_map(|columns| (2..=4).map(move |rows| (columns, rows))) {
                let kind = matrix(columns, rows);
                if name == "glx_outerProduct" {
                    let values = list(columns, |k| format!("c * r.{}", component(k)));
                    line!(out, "{kind} {name}(vec{rows} c, vec{columns} r) {{ return {kind}({values}); }}");
                } else {
                    let values = list(columns, |k| format!("a[{k}] * b[{k}]"));
                    line!(out, "{kind} {name}({kind} a, {kind} b) {{ return {kind}({values}); }}");
                }
            }
        }
        // Mesa's noise is 0.
        "glx_noise1" | "glx_noise2" | "glx_noise3" | "glx_noise4" => {
            let result = match name.trim_start_matches("glx_noise") {
                "1" => "float".to_owned(),
                n => format!("vec{n}"),
            };
            for kind in ["float", "vec2", "vec3", "vec4"] {
                line!(out, "{result} {name}({kind} x) {{ return {result}(0.0); }}");
            }
        }
        // By the bits: a comparison may be taken as one of finite numbers.
        "glx_isnan" | "glx_isinf" => {
            let test = if name == "glx_isnan" { ">" } else { "==" };
            line!(out, "bool {name}(float x) {{ return (floatBitsToUint(x) & 0x7fffffffu) {test} 0x7f800000u; }}");
            for n in 2..=4 {
                let values = list(n, |k| format!("{name}(x.{})", component(k)));
                line!(out, "bvec{n} {name}(vec{n} x) {{ return bvec{n}({values}); }}");
            }
        }
        _ => {}
    }
}
