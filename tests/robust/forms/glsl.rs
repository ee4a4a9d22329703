//! Hostile GLSL: shaders that are nested, that repeat one construct, or that stand for more than they say.

use super::{TextForm, lines, nested};

/// A fragment shader with these declarations and this body, which may use the variables `x`, `t`, `i`, `v` and `a`.
pub fn shader(declarations: &str, body: &str) -> String {
    format!(
        "#version 130\n{declarations}\nvoid main() {{\nfloat x = gl_FragCoord.x; bool t = x > 1.0; int i = int(x); vec4 v = vec4(x); \
         float a[4]; a[0] = x;\n{body}\ngl_FragColor = v + vec4(x + float(t) + float(i) + a[0]);\n}}\n"
    )
}

/// Shaders that are nested to this depth, each by another production of the grammar.
pub const DEEP: &[TextForm] = &[
    ("round brackets", |n| shader("", &format!("x = {};", nested("(", "x", ")", n)))),
    ("not", |n| shader("", &format!("t = {}t;", "!".repeat(n)))),
    ("minus", |n| shader("", &format!("x = {}x;", "- ".repeat(n)))),
    ("complement", |n| shader("", &format!("i = {}i;", "~".repeat(n)))),
    ("increment", |n| shader("", &format!("{}x{};", "++".repeat(n), "--".repeat(n)))),
    ("sum", |n| shader("", &format!("x = x{};", " + x".repeat(n)))),
    ("sum on the right", |n| shader("", &format!("x = {};", nested("x + (", "x", ")", n)))),
    ("product", |n| shader("", &format!("x = x{};", " * x".repeat(n)))),
    ("comparison", |n| shader("", &format!("t = t{};", " == t".repeat(n)))),
    ("and", |n| shader("", &format!("t = t{};", " && t".repeat(n)))),
    ("or", |n| shader("", &format!("t = t{};", " || t".repeat(n)))),
    ("shift", |n| shader("", &format!("i = i{};", " << 1".repeat(n)))),
    ("assignments", |n| shader("", &format!("{}x;", "x = ".repeat(n)))),
    ("commas", |n| shader("", &format!("x = (x{});", ", x".repeat(n)))),
    ("choices on the right", |n| shader("", &format!("x = {}x;", "t ? x : ".repeat(n)))),
    ("choices in the middle", |n| shader("", &format!("x = {};", nested("t ? ", "x", " : x", n)))),
    ("choices as conditions", |n| shader("", &format!("t = {};", nested("(", "t", " ? t : t)", n)))),
    ("members", |n| shader("", &format!("x = v{}.x;", ".xyzw".repeat(n)))),
    ("indices", |n| shader("", &format!("x = {};", nested("a[int(", "x", ")]", n)))),
    ("indices of whole numbers", |n| shader("const int b[2] = int[2](0, 1);", &format!("i = {};", nested("b[", "i", "]", n)))),
    ("calls", |n| shader("float f(float x) { return x; }", &format!("x = {};", nested("f(", "x", ")", n)))),
    ("built-in calls", |n| shader("", &format!("x = {};", nested("sin(", "x", ")", n)))),
    ("scalars", |n| shader("", &format!("x = {};", nested("float(", "x", ")", n)))),
    ("vectors", |n| shader("", &format!("v = {};", nested("vec4(", "1.0", ")", n)))),
    ("matrices", |n| shader("", &format!("mat4 m = {}; v = m[0];", nested("mat4(", "1.0", ")", n)))),
    ("matrices of a variable", |n| shader("", &format!("mat4 m = {}; v = m[0];", nested("mat4(", "x", ")", n)))),
    ("arrays", |n| shader("", &format!("x = {};", nested("float[1](", "x", ")[0]", n)))),
    ("sizes of arrays", |n| shader("", &format!("float b[{}];", nested("(", "1", ")", n)))),
    ("blocks", |n| shader("", &nested("{", "x += 1.0;", "}", n))),
    ("ifs", |n| shader("", &nested("if (t) {", "x += 1.0;", "}", n))),
    ("ifs without blocks", |n| shader("", &format!("{}x += 1.0;", "if (t) ".repeat(n)))),
    ("else if", |n| shader("", &format!("if (t) {{}}{}", " else if (x > 2.0) { x += 1.0; }".repeat(n)))),
    ("for", |n| shader("", &nested("for (int k = 0; k < 1; k++) {", "x += 1.0;", "}", n))),
    ("while", |n| shader("", &nested("while (x < 3.0) {", "x += 1.0;", "}", n))),
    ("do", |n| shader("", &nested("do {", "x += 1.0;", "} while (x < 3.0);", n))),
    ("switches", |n| shader("", &nested("switch (i) { default: ", "x += 1.0;", "}", n))),
    ("structures", |n| {
        let all = lines(n, |k| format!("struct S{} {{ S{k} s; }};", k + 1));
        shader(&format!("struct S0 {{ float s; }};\n{all}\nS{n} s;"), "")
    }),
    ("constants", |n| {
        shader(
            &format!("const float c0 = 1.0;\n{}", lines(n, |k| format!("const float c{} = c{k} + 1.0;", k + 1))),
            &format!("x = c{n};"),
        )
    }),
    ("functions", |n| {
        let all = lines(n, |k| format!("float f{}(float x) {{ return f{k}(x); }}", k + 1));
        shader(&format!("float f0(float x) {{ return x; }}\n{all}"), &format!("x = f{n}(x);"))
    }),
    ("brackets of a condition", |n| format!("#if {}\n#endif\n{}", nested("(", "1", ")", n), shader("", ""))),
    ("operators of a condition", |n| format!("#if {}1\n#endif\n{}", "!".repeat(n), shader("", ""))),
    ("conditional blocks", |n| format!("{}{}{}", "#if 1\n".repeat(n), shader("", ""), "#endif\n".repeat(n))),
    ("macros", |n| {
        format!("#define A0 x\n{}\n{}", lines(n, |k| format!("#define A{} (A{k})", k + 1)), shader("", &format!("x = A{n};")))
    }),
    ("arguments of macros", |n| format!("#define F(x) x\n{}", shader("", &format!("x = {};", nested("F(", "x", ")", n))))),
];

/// Shaders that repeat one production of the grammar so often.
pub const LONG: &[TextForm] = &[
    ("variables", |n| shader("", &lines(n, |k| format!("float x{k} = x;")))),
    ("variables of one declaration", |n| shader("", &format!("float y{};", lines(n, |k| format!(", x{k}"))))),
    ("variables outside", |n| shader(&lines(n, |k| format!("float x{k};")), &lines(n, |k| format!("x{k} = x;")))),
    ("uniforms", |n| shader(&lines(n, |k| format!("uniform float u{k};")), &lines(n, |k| format!("x += u{k};")))),
    ("constants", |n| shader(&lines(n, |k| format!("const float c{k} = {k}.0;")), &lines(n, |k| format!("x += c{k};")))),
    ("assignments", |n| shader("", &lines(n, |k| format!("x = x * {k}.0 + v.y;")))),
    ("ifs", |n| shader("", &lines(n, |k| format!("if (x > {k}.0) x += 1.0;")))),
    ("loops", |n| shader("", &lines(n, |_| "for (int k = 0; k < 3; k++) x += 1.0;".to_owned()))),
    ("cases", |n| {
        shader("", &format!("switch (i) {{ {} default: break; }}", lines(n, |k| format!("case {k}: x += {k}.0; break;"))))
    }),
    ("functions", |n| {
        shader(&lines(n, |k| format!("float f{k}(float x) {{ return x + {k}.0; }}")), &lines(n, |k| format!("x = f{k}(x);")))
    }),
    ("overloads", |n| shader(&lines(n, |k| format!("float f(float x[{}]) {{ return x[0]; }}", k + 1)), "x = f(float[1](x));")),
    ("prototypes", |n| shader(&lines(n, |_| "float f(float x);".to_owned()), "")),
    ("structures", |n| shader(&lines(n, |k| format!("struct S{k} {{ float s; }};")), "")),
    ("members", |n| shader(&format!("struct S {{ {} }}; uniform S s;", lines(n, |k| format!("float m{k};"))), "x += s.m0;")),
    ("calls", |n| shader("float f(float x) { return x; }", &lines(n, |_| "x = f(x);".to_owned()))),
    ("outs", |n| shader("void f(out float y) { y = 1.0; }", &lines(n, |_| "f(v.x);".to_owned()))),
    ("arguments", |n| {
        let parameters = lines(n, |k| format!("{}float x{k}", if k > 0 { ", " } else { "" }));
        let arguments = lines(n, |k| format!("{}x", if k > 0 { ", " } else { "" }));
        shader(&format!("float f({parameters}) {{ return x0; }}"), &format!("x = f({arguments});"))
    }),
    ("elements", |n| {
        shader("", &format!("float b[{n}] = float[{n}]({});", lines(n, |k| format!("{}x", if k > 0 { ", " } else { "" }))))
    }),
    ("arrays compared", |n| shader("", &lines(n, |k| format!("float b{k}[4]; t = t && a == b{k};")))),
    ("macros", |n| {
        format!("{}\n{}", lines(n, |k| format!("#define A{k} x")), shader("", &lines(n, |k| format!("x += A{k};"))))
    }),
    ("conditions", |n| format!("{}\n{}", lines(n, |k| format!("#if {k} > 3\n#endif")), shader("", ""))),
    ("comments", |n| format!("{}\n{}", "/* a */ // b\n".repeat(n), shader("", ""))),
    ("semicolons", |n| shader("", &";".repeat(n))),
    ("blanks", |n| shader("", &" \n".repeat(n))),
    ("samplers", |n| {
        shader(&lines(n, |k| format!("uniform sampler2D s{k};")), &lines(n, |k| format!("v += texture2D(s{k}, v.xy);")))
    }),
    ("texture reads", |n| shader("uniform sampler2D s;", &lines(n, |_| "v += texture2D(s, v.xy);".to_owned()))),
];

/// Shaders that stand for 2 to the power of this number of tokens, members or steps, or for more.
pub const LARGE: &[TextForm] = &[
    ("macros", |n| {
        format!(
            "#define A0 x+x\n{}\n{}",
            lines(n, |k| format!("#define A{} A{k}+A{k}", k + 1)),
            shader("", &format!("x = A{n};"))
        )
    }),
    ("macros in conditions", |n| {
        format!(
            "#define A0 1+1\n{}\n#if A{n}\n#endif\n{}",
            lines(n, |k| format!("#define A{} A{k}+A{k}", k + 1)),
            shader("", "")
        )
    }),
    ("macros of nothing", |n| {
        format!(
            "#define A0\n{}\n{}",
            lines(n, |k| format!("#define A{} A{k} A{k}", k + 1)),
            shader("", &format!("x = x A{n};"))
        )
    }),
    ("arguments of macros", |n| {
        let all = lines(n, |k| format!("#define A{}(x) A{k}(A{k}(x))", k + 1));
        format!("#define A0(x) x+x\n{all}\n{}", shader("", &format!("x = A{n}(x);")))
    }),
    ("arguments of macros that drop them", |n| {
        let all = lines(n, |k| format!("#define A{} A{k}+A{k}", k + 1));
        format!("#define NONE(x)\n#define A0 x+x\n{all}\n{}", shader("", &format!("x = x NONE(A{n});")))
    }),
    ("constants", |n| {
        let all = lines(n, |k| format!("const mat4 c{} = c{k} + c{k};", k + 1));
        shader(&format!("const mat4 c0 = mat4(1.0);\n{all}"), &format!("x = c{n}[0].x;"))
    }),
    ("structures", |n| {
        let all = lines(n, |k| format!("struct S{} {{ S{k} a; S{k} b; }};", k + 1));
        shader(&format!("struct S0 {{ float f; }};\n{all}\nS{n} s;"), "")
    }),
    ("structures of a uniform", |n| {
        let all = lines(n, |k| format!("struct S{} {{ S{k} a, b; }};", k + 1));
        shader(&format!("struct S0 {{ float f; }};\n{all}\nuniform S{n} s;"), "")
    }),
    ("structures compared", |n| {
        let all = lines(n, |k| format!("struct S{} {{ S{k} a, b; }};", k + 1));
        shader(&format!("struct S0 {{ float f; }};\n{all}"), &format!("S{n} s, u; t = s == u;"))
    }),
    ("calls", |n| {
        let all = lines(n, |k| format!("float f{}(float x) {{ return f{k}(f{k}(x)); }}", k + 1));
        shader(&format!("float f0(float x) {{ return x + 1.0; }}\n{all}"), &format!("x = f{n}(x);"))
    }),
    ("functions of samplers", |n| {
        let all = lines(n, |k| format!("vec4 f{}(sampler2D a, sampler2D b) {{ return f{k}(a, b) + f{k}(b, a); }}", k + 1));
        let first = "vec4 f0(sampler2D a, sampler2D b) { return texture2D(a, vec2(0)) + texture2D(b, vec2(1)); }";
        shader(&format!("uniform sampler2D s, u;\n{first}\n{all}"), &format!("v = f{n}(s, u);"))
    }),
];
