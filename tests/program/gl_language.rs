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

#[test]
fn a_component_of_a_vector_takes_what_a_function_gives() {
    fragments(&[
        (
            "void f(out float x) { x = 0.25; } void main() { vec4 v = vec4(0.5); f(v[int(gl_FragCoord.x) / 8]); f(v.z); gl_FragColor = v; }",
            [0.25, 0.5, 0.25],
        ),
        (
            "void f(inout float x, inout float y) { x += 0.25; y += x; } void main() { mat3 m = mat3(0.25); int i = 1; f(m[0][i], m[0][2]);\n\
             gl_FragColor = vec4(m[0], 1.0); }",
            [0.25, 0.25, 0.25],
        ),
        // In branches and loops; a component of a global variable, and of an array.
        (
            "vec3 g; bool f(inout float x) { x += 0.25; return x < 0.7; } void main() { vec3 v[2]; v[0] = vec3(0.0);\n\
             for (int i = 0; f(v[0][1]); i++) { if (i == 0) f(v[i].x); } f(g[2]); gl_FragColor = vec4(v[0] + g, 1.0); }",
            [0.25, 0.75, 0.25],
        ),
    ]);
}

#[test]
fn a_uniform_has_the_initial_value_of_either_stage() {
    let mut recording = Recording::new();
    let (with, without) = ("#version 120\nuniform vec3 c = vec3(0.5, 0.25, 0.75);", "#version 120\nuniform vec3 c;");
    let vertex = "varying vec3 v; void main() { v = c; gl_Position = gl_Vertex; }";
    let fragment = "varying vec3 v; void main() { gl_FragColor = vec4(v.x, c.y, v.z * c.z, 1.0); }";
    frame(&mut recording, 1, &format!("{with} {vertex}"), &format!("{without} {fragment}"), "");
    frame(&mut recording, 3, &format!("{without} {vertex}"), &format!("{with} {fragment}"), "");
    let set = "glGetUniformLocation(@,\"c\")=1\nglUniform3f(1,0.25,0.5,1)";
    frame(&mut recording, 5, &format!("{without} {vertex}"), &format!("{with} {fragment}"), set);
    let wanted = [0.5, 0.25, 0.5625];
    near(&recording, &[("vertex", wanted), ("fragment", wanted), ("set", [0.25, 0.5, 1.0])]);
}

#[test]
fn a_link_that_fails_leaves_the_current_program_as_it_was() {
    let fragment = "uniform float u; void main() { gl_FragColor = vec4(u); }";
    let mut recording = Recording::new();
    let set = "glGetProgramiv(@,GL_LINK_STATUS,{1})\nglGetUniformLocation(@,\"u\")=1\nglUniform1f(1,0.25)";
    frame(&mut recording, 1, PASS, fragment, set);
    // A second main, which Mesa and this program refuse; then one that only Mesa refuses, of a shader that was not compiled.
    recording.add(
        "glCreateShader(GL_FRAGMENT_SHADER)=90\nglShaderSource(90,1,\"void main() {}\",0)\nglCompileShader(90)\nglAttachShader(12,90)\n\
         glLinkProgram(12)\nglGetProgramiv(12,GL_LINK_STATUS,{0})\nglRectf(-1,-1,1,1)",
    );
    recording.end_frame();
    recording
        .add("glUniform1f(1,0.5)\nglDetachShader(12,90)\nglLinkProgram(12)\nglGetObjectParameterivARB(12,GL_LINK_STATUS,{0})");
    recording.add("glRectf(-1,-1,1,1)").end_frame();
    near(&recording, &[("linked", [0.25; 3]), ("failed", [0.25; 3]), ("failed again", [0.5; 3])]);
    // It cannot be bound any more.
    recording.add("glUseProgram(12)");
    recording.end_frame();
    let (_, report) = recording.import().expect("a recording");
    assert!(report.errors.get("glUseProgram: GL_INVALID_OPERATION").is_some(), "{:?}", report.errors);
}

#[test]
fn built_in_functions_that_naga_lacks() {
    fragments(&[
        (
            "#version 120\nvoid main() { mat2x3 m = outerProduct(vec3(1.0, 0.5, 0.25), vec2(0.5, 1.0)); gl_FragColor = vec4(m[0].xy, m[1].z, 1.0); }",
            [0.5, 0.25, 0.25],
        ),
        (
            "void main() { mat2 m = matrixCompMult(mat2(0.5, 0.25, 1.0, 0.5), mat2(0.5, 1.0, 1.0, 0.5)); gl_FragColor = vec4(m[0], m[1].y, 1.0); }",
            [0.25; 3],
        ),
        ("void main() { gl_FragColor = vec4(noise1(0.3) + 0.5, noise2(vec3(0.7)) + 0.25, 1.0); }", [0.5, 0.25, 0.25]),
        (
            "#version 130\nuniform float u; void main() { float zero = u - 0.25; bvec2 i = isinf(vec2(1.0 / zero, u));\n\
             gl_FragColor = vec4(isnan(zero / zero) ? 0.5 : 0.0, i.x ? 0.25 : 0.0, i.y || isnan(u) ? 0.5 : 0.0, 1.0); }",
            [0.5, 0.25, 0.0],
        ),
        // A constant, and a function of the program's own.
        (
            "#version 120\nconst mat2 m = outerProduct(vec2(0.5), vec2(1.0, 0.5)); const vec2 v = m[1]; float noise1(float x) { return x; }\n\
             void main() { gl_FragColor = vec4(v, noise1(0.75), 1.0); }",
            [0.25, 0.25, 0.75],
        ),
        ("float square(const in highp float x) { return x * x; } void main() { gl_FragColor = vec4(square(0.5)); }", [0.25; 3]),
    ]);
}

#[test]
fn arrays_take_the_size_of_their_values() {
    fragments(&[
        (
            "#version 120\nconst vec3 c[] = vec3[](vec3(0.25), vec3(0.5)); void main() { float d[] = float[](1.0, 0.5, 0.25), e = 0.5;\n\
             gl_FragColor = vec4(c[1].x, d[2], e * d[1], 1.0); }",
            [0.5, 0.25, 0.25],
        ),
        (
            "float a[]; void main() { vec2 b[]; b[1] = vec2(0.5); a[2] = 0.25; vec2 b[3]; b[2].x = a[2]; gl_FragColor = vec4(b[1], b[2].x, 1.0); }",
            [0.5, 0.5, 0.25],
        ),
        (
            "#version 120\nvoid main() { float a[]; float a[] = float[](0.25, 0.5); gl_FragColor = vec4(a[0], a[1], 0.0, 1.0); }",
            [0.25, 0.5, 0.0],
        ),
    ]);
}

#[test]
fn a_function_replaces_a_built_in_one_only_where_it_is_declared() {
    let mut recording = Recording::new();
    let main = "float own(float x); float abs(float x) { return x - 0.5; } void main() { gl_FragColor = vec4(abs(1.0), own(-0.25), 0.0, 1.0); }";
    objects(&mut recording, 1, &[main, "float own(float x) { return abs(x); }"]);
    near(&recording, &[("abs", [0.5, 0.25, 0.0])]);
}

#[test]
fn the_scale_of_normals_is_that_of_the_matrix() {
    let mut recording = Recording::new();
    recording.add("glMatrixMode(GL_MODELVIEW)\nglScalef(1,1,4)");
    let fragment = "varying float s; void main() { gl_FragColor = vec4(s / 8.0); }";
    frame(&mut recording, 1, "varying float s; void main() { s = gl_NormalScale; gl_Position = gl_Vertex; }", fragment, "");
    near(&recording, &[("scale", [0.5; 3])]);
}

#[test]
fn arrays_and_structures_are_compared() {
    let head = "#version 120\nstruct T { float a[2]; bool b; }; struct S { vec2 v; T t[2]; mat3 m; }; uniform float u;\n\
        S make(float x) { T t; t.a[0] = x; t.a[1] = 1.0; t.b = true;\n\
        S s; s.v = vec2(x); s.t[0] = t; s.t[1] = t; s.m = mat3(x); return s; }";
    let main = "void main() { S s = make(0.5), o = make(0.5); float f[2] = float[2](0.25, 1.0); vec3 c = vec3(0.0);";
    let cases = [
        ("c.x = s == o ? 0.5 : 0.0; c.y = s != o ? 0.5 : 0.0; c.z = s == make(0.25) ? 0.5 : 0.0;", [0.5, 0.0, 0.0]),
        (
            "o.t[1].a[0] = u; c.x = s != o ? 0.5 : 0.0; c.y = s.t[0] == o.t[0] ? 0.5 : 0.0; c.z = s.t == o.t ? 0.5 : 0.0;",
            [0.5, 0.5, 0.0],
        ),
        (
            "c.x = f == float[2](u, 1.0) ? 0.5 : 0.0; c.y = f != s.t[0].a ? 0.5 : 0.0; o.m[1].x += u; c.z = s == o ? 0.5 : 0.0;",
            [0.5, 0.5, 0.0],
        ),
    ];
    let mut recording = Recording::new();
    for (k, (text, _)) in cases.iter().enumerate() {
        let set = "glGetUniformLocation(@,\"u\")=1\nglUniform1f(1,0.25)";
        frame(&mut recording, 2 * k + 1, PASS, &format!("{head} {main} {text} gl_FragColor = vec4(c, 1.0); }}"), set);
    }
    near(&recording, &cases);
}

#[test]
fn components_of_components_are_written() {
    fragments(&[(
        "void main() { vec4 c = vec4(0.0); c.xzy.z = 0.5; c.wzyx.yw.y += 0.25; c.bgr[0] = 0.75; gl_FragColor = c; }",
        [0.25, 0.5, 0.75],
    )]);
}

#[test]
fn a_declaration_that_is_a_body_has_its_own_scope() {
    fragments(&[(
        "void main() { int i = 1; int j = 0; do int i = (j++, 0); while (i < 1); if (j == 1) float j = 0.0; else float j = 1.0;\n\
         gl_FragColor = vec4(float(i), float(j), 0.0, 1.0) * 0.5; }",
        [0.5, 0.5, 0.0],
    )]);
}

#[test]
fn varyings_that_no_shader_writes_are_0_or_not_needed() {
    let mut recording = Recording::new();
    recording.add("glColor3f(0.5,0.25,1)");
    frame(&mut recording, 1, "", "varying vec4 v; void main() { gl_FragColor = gl_Color + v; }", "");
    let vertex = "varying vec4 v; void main() { v = vec4(0.25); gl_Position = gl_Vertex; }";
    frame(&mut recording, 3, vertex, "varying vec4 v, missing; void main() { gl_FragColor = v; }", "");
    near(&recording, &[("none", [0.5, 0.25, 1.0]), ("not read", [0.25; 3])]);
}

#[test]
fn names_of_samplers_may_be_hidden() {
    let fragment = "uniform sampler2D t; vec4 half_of(vec4 t) { return t * 0.5; }\n\
        void main() { vec4 c = texture2D(t, vec2(0.5)); { vec4 t = half_of(c); c = half_of(t) + vec4(0.5); } gl_FragColor = half_of(c); }";
    let mut recording = Recording::new();
    frame(&mut recording, 1, PASS, fragment, "");
    near(&recording, &[("hidden", [0.25; 3])]);
}

#[test]
fn a_function_may_end_with_a_loop() {
    fragments(&[(
        "uniform float u; float f(float x) { for (int i = 0; i < 4; i++) { if (float(i) > x) return float(i) * 0.25; } }\n\
         void main() { gl_FragColor = vec4(f(u), f(1.5), f(2.0), 1.0); }",
        [0.25, 0.5, 0.75],
    )]);
}
