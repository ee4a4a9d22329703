//! GLSL, replayed: what naga's front end does not do as the language says, against arithmetic that is written here.

use super::gl_shaders::{PASS, frame, near};
use fillrate::accuracy::gl::recording::Recording;

/// A case: the text of a fragment shader, and the colour that it gives.
type Case = (&'static str, [f64; 3]);

/// Draws each fragment shader. A uniform `u` has the value 0.25.
fn fragments(cases: &[Case]) {
    let mut recording = Recording::new();
    for (k, (text, _)) in cases.iter().enumerate() {
        let calls = if text.contains("uniform float u;") { "glGetUniformLocation(@,\"u\")=1\nglUniform1f(1,0.25)" } else { "" };
        frame(&mut recording, 2 * k + 1, PASS, text, calls);
    }
    near(&recording, cases);
}

/// Draws with a program of several objects for the fragment stage, after the `n` programs before it.
fn objects(recording: &mut Recording, n: usize, texts: &[&str]) {
    let program = 100 * n + 99;
    recording.add(&format!("glCreateProgram()={program}"));
    for (k, text) in std::iter::once(&PASS).chain(texts).enumerate() {
        let (name, stage) = (100 * n + k + 1, if k == 0 { "VERTEX" } else { "FRAGMENT" });
        recording.add(&format!(
            "glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{text}\",0)\nglCompileShader({name})\n\
             glAttachShader({program},{name})"
        ));
    }
    recording.add(&format!("glLinkProgram({program})\nglUseProgram({program})\nglRectf(-1,-1,1,1)")).end_frame();
}

#[test]
fn global_variables_are_initialised_at_the_start_of_main() {
    fragments(&[
        ("uniform float u; float g = u * 2.0; void main() { gl_FragColor = vec4(g, u, 0.0, 1.0); }", [0.5, 0.25, 0.0]),
        // In order, with functions, of all types; one that is read by a function.
        (
            "#version 120\nuniform float u; float a = 0.5, b[2] = float[2](u, a + u), c = b[1]; struct S { vec2 v; } s = S(vec2(c));\n\
             float f() { return s.v.y; } float d = f() - u; void main() { gl_FragColor = vec4(b[0], f(), d, 1.0); }",
            [0.25, 0.75, 0.5],
        ),
        // What is built in, and a local variable of the same name.
        (
            "vec2 p = gl_FragCoord.xy / 8.0; float g = sin(p.x); void main() { float g = g; gl_FragColor = vec4(g, p, 1.0); }",
            [(4.5_f64 / 8.0).sin(), 4.5 / 8.0, 3.5 / 8.0],
        ),
        // A function that changes one that has a constant.
        (
            "float k = 0.25; float f() { k += 0.25; return k; } float a = f(); float b = f();\n\
             void main() { gl_FragColor = vec4(a, b, k, 1.0); }",
            [0.5, 0.75, 0.75],
        ),
    ]);
}

#[test]
fn right_sides_of_and_and_or_run_only_where_they_decide() {
    let head = "float n = 0.0; bool f(bool b) { n += 0.25; return b; }";
    let color = "gl_FragColor = vec4(n, b ? 1.0 : 0.0, 0.0, 1.0);";
    let cases = [
        ("bool b = false && f(true);", [0.0, 0.0, 0.0]),
        ("bool b = true && f(true);", [0.25, 1.0, 0.0]),
        ("bool b = true || f(true);", [0.0, 1.0, 0.0]),
        ("bool b = false || f(false) || f(true) || f(true);", [0.5, 1.0, 0.0]),
        ("bool b = true || f(true) && f(true);", [0.0, 1.0, 0.0]),
        ("bool b = f(true) && f(false) && f(true) || f(true);", [0.75, 1.0, 0.0]),
        ("bool b = f(false) ^^ (f(true) || f(true));", [0.5, 1.0, 0.0]),
        ("bool b = false; if (b && (n += 0.5) > 0.0) { b = true; }", [0.0, 0.0, 0.0]),
        ("bool b = false; for (int i = 0; i < 3 && f(true); i++) b = true;", [0.75, 1.0, 0.0]),
        ("bool b = n > 1.0 ? f(true) && f(true) : f(true) || f(true);", [0.25, 1.0, 0.0]),
    ];
    let mut recording = Recording::new();
    for (k, (text, _)) in cases.iter().enumerate() {
        frame(&mut recording, 2 * k + 1, PASS, &format!("{head} void main() {{ {text} {color} }}"), "");
    }
    near(&recording, &cases);
}

#[test]
fn continue_in_do_goes_on_with_the_condition() {
    fragments(&[
        (
            "void main() { float s = 0.0; int i = 0; do { i++; if (i > 2) continue; s += 0.25; } while (i < 4);\n\
             gl_FragColor = vec4(s, float(i) / 8.0, 0.0, 1.0); }",
            [0.5, 0.5, 0.0],
        ),
        // Once if the condition is false; a loop in a loop; a condition with an effect.
        (
            "void main() { float a = 0.0, b = 0.0; do { a += 0.25; continue; } while (false);\n\
             int i = 0; do { int j = 0; do { b += 0.125; if (j == 1) continue; } while (j++ < 1); if (i == 0) continue; } while (i++ < 1);\n\
             gl_FragColor = vec4(a, b, 0.0, 1.0); }",
            [0.25, 0.5, 0.0],
        ),
    ]);
}

#[test]
fn shader_objects_of_one_stage_share_variables_and_functions() {
    let cases: [(&[&str], [f64; 3]); 3] = [
        // One variable, whose value the other object sets.
        (
            &[
                "float x; void set(); void main() { set(); gl_FragColor = vec4(x, 0.0, 0.0, 1.0); }",
                "float x; void set() { x = 0.5; }",
            ],
            [0.5, 0.0, 0.0],
        ),
        (
            &[
                "float x, y = 0.25; float f(); void main() { gl_FragColor = vec4(x, y, f(), 1.0); }",
                "const float k = 0.5; float x = k; float y; float f() { return x + y; }",
            ],
            [0.5, 0.25, 0.75],
        ),
        // Functions that call each other to and fro, with a structure that both know.
        (
            &[
                "struct S { float x; }; float f(S s); float h(float x) { return x * 0.5; } void main() { gl_FragColor = vec4(f(S(1.0))); }",
                "struct S { float x; }; float h(float x); float g(float x); float f(S s) { return g(s.x) * 0.5; }",
                "float h(float x); float g(float x) { return h(x); }",
            ],
            [0.25; 3],
        ),
    ];
    let mut recording = Recording::new();
    let mut wanted = Vec::new();
    for (k, (texts, color)) in cases.iter().enumerate() {
        objects(&mut recording, k + 1, texts);
        wanted.push((texts[0], *color));
    }
    near(&recording, &wanted);
    for (texts, reason) in [
        (["float x; void main() {}", "vec2 x;"], "the variable x in two shader objects in different ways is not supported"),
        (["void f(); void main() { f(); }", "void g() {}"], "the function f has no body"),
    ] {
        let mut recording = Recording::new();
        objects(&mut recording, 1, &texts);
        let refused = recording.import().expect("a recording").1.refusal().unwrap_or_default();
        assert!(refused.contains(reason), "{refused}");
    }
}
