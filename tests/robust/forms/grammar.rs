//! Hostile WGSL: one form for each production of its grammar that can be nested or repeated, and forms that stand for more than they say.
//! Expressions that [`super::wgsl::DEEP`] nests are not written again.

use super::{TextForm, lines, nested};

/// All forms of WGSL.
pub const ALL: &[&[TextForm]] = &[super::wgsl::DEEP, EXPRESSIONS, STATEMENTS, DECLARATIONS, TOKENS, CONSTANTS, LARGE];

/// A module whose compute entry point has this body. The body may use `x`, `i`, `f`, `t`, `v`, `m`, `a` and `b`; other bindings of a
/// form are in group 1.
pub fn shader(declarations: &str, body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;\n{declarations}\n\
         @compute @workgroup_size(1) fn main() {{\nvar x = b[0]; var i = i32(x); var f = f32(x); var t = x == 1u; var v = vec4(f); \
         var m = mat4x4(v, v, v, v); var a = array(x, x, x, x);\n{body}\n\
         b[1] = x + u32(i) + u32(f) + u32(t) + u32(v.x) + u32(m[0].x) + a[1];\n}}\n"
    )
}

/// A module whose fragment entry point has this body, which may use `v`, the position, and `f`.
fn fragment(declarations: &str, body: &str) -> String {
    format!(
        "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{ return vec4f(f32(i)); }}\n{declarations}\n\
         @fragment fn main(@builtin(position) p: vec4f) -> @location(0) vec4f {{\nvar v = p; var f = p.x;\n{body}\nreturn v + f;\n}}\n"
    )
}

/// Operators and calls, `n` of them in one expression.
const EXPRESSIONS: &[TextForm] = &[
    ("product", |n| shader("", &format!("x = x{};", " * x".repeat(n)))),
    ("quotient", |n| shader("", &format!("f = f{};", " / 3.0".repeat(n)))),
    ("remainder", |n| shader("", &format!("i = i{};", " % 7".repeat(n)))),
    ("shifts", |n| shader("", &format!("x = {};", nested("(", "x", " << 1u)", n)))),
    ("exclusive or", |n| shader("", &format!("x = x{};", " ^ x".repeat(n)))),
    ("bits and", |n| shader("", &format!("x = x{};", " & x".repeat(n)))),
    ("bits or", |n| shader("", &format!("x = x{};", " | x".repeat(n)))),
    ("and of booleans", |n| shader("", &format!("t = t{};", " & t".repeat(n)))),
    ("and inside or", |n| shader("", &format!("t = {};", nested("(t && (t || ", "t", "))", n)))),
    ("relations", |n| shader("", &format!("t = {};", nested("(u32(", "x < 1u", ") < x)", n)))),
    ("matrices multiplied", |n| shader("", &format!("m = m{};", " * m".repeat(n)))),
    ("matrix and vector", |n| shader("", &format!("v = {};", nested("m * (", "v", ")", n)))),
    ("vector and scalar", |n| shader("", &format!("v = v{};", " * f + v".repeat(n)))),
    ("indices", |n| shader("", &format!("x = {};", nested("a[", "x", " & 3u]", n)))),
    ("columns", |n| shader("", &format!("f = {};", nested("m[0][u32(", "f", ")]", n)))),
    ("swizzles", |n| shader("", &format!("v = v{};", ".wzyx".repeat(n)))),
    ("components", |n| shader("", &format!("f = {};", nested("vec2(", "f", ", f).y", n)))),
    ("addresses", |n| shader("", &format!("x = {};", nested("*&(", "x", ")", n)))),
    ("max", |n| shader("", &format!("x = {};", nested("max(x, ", "x", ")", n)))),
    ("select", |n| shader("", &format!("x = {};", nested("select(", "x", ", x, t)", n)))),
    ("select of conditions", |n| shader("", &format!("t = {};", nested("select(t, t, ", "t", ")", n)))),
    ("mix", |n| shader("", &format!("v = {};", nested("mix(", "v", ", v, f)", n)))),
    ("dot", |n| shader("", &format!("f = {};", nested("dot(v, v * ", "f", ")", n)))),
    ("sine", |n| shader("", &format!("f = {};", nested("sin(", "f", ")", n)))),
    ("frexp", |n| shader("", &format!("f = {};", nested("frexp(", "f", ").fract", n)))),
    ("modf", |n| shader("", &format!("v = {};", nested("modf(", "v", ").whole", n)))),
    ("transpose", |n| shader("", &format!("m = {};", nested("transpose(", "m", ")", n)))),
    ("pack", |n| shader("", &format!("x = {};", nested("pack4x8unorm(unpack4x8unorm(", "x", "))", n)))),
    ("conversions", |n| shader("", &format!("x = {};", nested("u32(i32(f32(", "x", ")))", n)))),
    ("bit casts", |n| shader("", &format!("x = {};", nested("bitcast<u32>(", "x", ")", n)))),
    ("vectors", |n| shader("", &format!("v = {};", nested("vec4<f32>(", "v", ")", n)))),
    ("vectors of parts", |n| shader("", &format!("v = {};", nested("vec4(v.x, (", "v", ").yzw)", n)))),
    ("matrices", |n| shader("", &format!("m = {};", nested("mat4x4<f32>(", "m", ")", n)))),
    ("arrays indexed", |n| shader("", &format!("x = {};", nested("array(x, ", "x", ")[1]", n)))),
    ("structures", |n| shader("struct S { s: u32 }", &format!("x = {};", nested("S(", "x", ").s", n)))),
    ("calls", |n| shader("fn g(x: u32, y: u32) -> u32 { return x + y; }", &format!("x = {};", nested("g(", "x", ", x)", n)))),
    ("calls on the right", |n| {
        shader("fn g(x: u32, y: u32) -> u32 { return x; }", &format!("x = {};", nested("g(x, ", "x", ")", n)))
    }),
    ("atomics", |n| shader("var<workgroup> w: atomic<u32>;", &format!("x = {};", nested("atomicAdd(&w, ", "x", ")", n)))),
    ("loads of textures", |n| {
        shader(
            "@group(1) @binding(0) var z: texture_2d<u32>;",
            &format!("x = {};", nested("textureLoad(z, vec2(", "x", "), 0).x", n)),
        )
    }),
    ("derivatives", |n| fragment("", &format!("f = {};", nested("dpdx(", "f", ")", n)))),
    ("samples", |n| {
        fragment(
            "@group(1) @binding(0) var z: texture_2d<f32>; @group(1) @binding(1) var s: sampler;",
            &format!("v = {};", nested("textureSample(z, s, (", "v", ").xy)", n)),
        )
    }),
    ("arguments of array", |n| shader("", &format!("let c = array({}x); x = c[1];", "x, ".repeat(n)))),
    ("pointers of pointers", |n| {
        let all = lines(n, |k| format!("let p{} = &(*p{k});", k + 1));
        shader("", &format!("let p0 = &x;\n{all}\n*p{n} = 1u;"))
    }),
];

/// Statements, `n` of them one after the other or inside each other.
const STATEMENTS: &[TextForm] = &[
    ("assignments", |n| shader("", &lines(n, |k| format!("x = x * {k}u + a[1];")))),
    ("compound assignments", |n| shader("", &lines(n, |_| "x += x; i -= 1; v *= f; x <<= 1u; x ^= 3u;".to_owned()))),
    ("increments", |n| shader("", &"x++; i--; ".repeat(n))),
    ("phony assignments", |n| shader("", &"_ = x; ".repeat(n))),
    ("assignments of components", |n| {
        shader("", &lines(n, |k| format!("v.{} = f; m[{}].y = f; a[x & 3u] = x;", ["x", "y", "z"][k % 3], k % 4)))
    }),
    ("assignments of swizzles", |n| shader("", &"v.zx = v.xy; ".repeat(n))),
    ("vars", |n| shader("", &lines(n, |k| format!("var y{k} = x;")))),
    ("vars used", |n| shader("", &lines(n, |k| format!("var y{k} = x; x += y{k};")))),
    ("vars of arrays", |n| shader("", &lines(n, |k| format!("var y{k}: array<u32, 8>; y{k}[x & 7u] = x; x += y{k}[1];")))),
    ("lets", |n| shader("", &lines(n, |k| format!("let y{k} = x;")))),
    ("lets in a chain", |n| {
        shader("", &format!("let y0 = x;\n{}\nx = y{n};", lines(n, |k| format!("let y{} = y{k} + x;", k + 1))))
    }),
    ("shadowing", |n| shader("", &nested("{ let x = x + 1u; ", "a[0] = x;", "}", n))),
    ("ifs", |n| shader("", &lines(n, |k| format!("if x > {k}u {{ x += 1u; }}")))),
    ("ifs with else", |n| shader("", &lines(n, |k| format!("if x > {k}u {{ x += 1u; }} else {{ f += 1.0; }}")))),
    ("ifs of constants", |n| shader("", &"if false { x += 1u; } else { x += 2u; } ".repeat(n))),
    ("ifs around state", |n| shader("", &nested("if x > 1u { x += 1u; f *= 2.0; v.x = f; ", "", "}", n))),
    ("switches", |n| shader("", &"switch x { case 1u, 2u: { x += 1u; } default: { i += 1; } } ".repeat(n))),
    ("cases", |n| {
        shader("", &format!("switch x {{ {} default: {{}} }}", lines(n, |k| format!("case {k}u: {{ x += {k}u; }}"))))
    }),
    ("selectors", |n| {
        shader("", &format!("switch x {{ case {} {{ x = 1u; }} default: {{}} }}", lines(n, |k| format!("{k}u,"))))
    }),
    ("cases that break", |n| {
        shader(
            "",
            &format!("switch x {{ {} default: {{}} }}", lines(n, |k| format!("case {k}u: {{ if t {{ break; }} x += {k}u; }}"))),
        )
    }),
    ("loops", |n| shader("", &"loop { x += 1u; if x > 3u { break; } continuing { i += 1; } } ".repeat(n))),
    ("breaks of loops", |n| {
        shader("", &format!("loop {{ {} break; }}", lines(n, |k| format!("if x == {k}u {{ break; }} x += 1u;"))))
    }),
    ("continues", |n| {
        shader(
            "",
            &format!("for (var k = 0u; k < 2u; k++) {{ {} }}", lines(n, |k| format!("if x == {k}u {{ continue; }} x += 1u;"))),
        )
    }),
    ("break ifs", |n| shader("", &"loop { x += 1u; continuing { break if x > 3u; } } ".repeat(n))),
    ("nested continuing", |n| shader("", &nested("loop { x += 1u; continuing { ", "", " break if x > 3u; } }", n))),
    ("fors", |n| shader("", &"for (var k = 0u; k < 3u; k++) { x += k; } ".repeat(n))),
    ("nested fors", |n| shader("", &nested("for (var k = 0u; k < 1u; k++) { x += k; ", "", "}", n))),
    ("whiles", |n| shader("", &"while x < 3u { x += 1u; } ".repeat(n))),
    ("nested whiles", |n| shader("", &nested("while x < 3u { x += 1u; ", "", "}", n))),
    ("returns", |n| shader("", &lines(n, |k| format!("if x == {k}u {{ return; }}")))),
    ("returns of functions", |n| {
        shader(
            &format!("fn g(x: u32) -> u32 {{ {} return x; }}", lines(n, |k| format!("if x == {k}u {{ return {k}u; }}"))),
            "x = g(x);",
        )
    }),
    ("statements after return", |n| shader(&format!("fn g() {{ return; {} }}", "b[2] = 1u; ".repeat(n)), "g();")),
    ("discards", |n| fragment("", &lines(n, |k| format!("if f == {k}.0 {{ discard; }}")))),
    ("calls", |n| shader("fn g(x: u32) -> u32 { return x + 1u; }", &"x = g(x); ".repeat(n))),
    ("calls of pointers", |n| shader("fn g(p: ptr<function, u32>) { *p += 1u; }", &"g(&x); ".repeat(n))),
    ("calls without value", |n| shader("fn g() { b[3] += 1u; }", &"g(); ".repeat(n))),
    ("built-in calls", |n| shader("", &"v = normalize(v) + cross(v.xyz, v.yzx).xyzx; f = pow(f, length(v)); ".repeat(n))),
    ("barriers", |n| shader("", &"workgroupBarrier(); storageBarrier(); ".repeat(n))),
    ("atomics", |n| {
        shader("var<workgroup> w: atomic<u32>;", &"atomicAdd(&w, 1u); x = atomicMax(&w, x); atomicStore(&w, x); ".repeat(n))
    }),
    ("compare exchanges", |n| {
        shader("var<workgroup> w: atomic<u32>;", &"x = atomicCompareExchangeWeak(&w, x, 1u).old_value; ".repeat(n))
    }),
    ("samples", |n| {
        fragment(
            "@group(1) @binding(0) var z: texture_2d<f32>; @group(1) @binding(1) var s: sampler;",
            &"v = textureSample(z, s, v.xy) + textureSampleLevel(z, s, v.xy, 1.0); ".repeat(n),
        )
    }),
    ("stores of textures", |n| {
        shader(
            "@group(1) @binding(0) var z: texture_storage_2d<rgba8unorm, write>;",
            &"textureStore(z, vec2(x, 1u), v); ".repeat(n),
        )
    }),
    ("assertions", |n| shader("", &"const_assert 1 < 2; ".repeat(n))),
    ("diagnostics of a statement", |n| {
        shader("", &format!("{} if t {{ x += 1u; }}", "@diagnostic(off, derivative_uniformity) ".repeat(n)))
    }),
    ("diagnostics of statements", |n| shader("", &"@diagnostic(off, derivative_uniformity) if t { x += 1u; } ".repeat(n))),
    ("empty statements", |n| shader("", &";".repeat(n))),
    ("empty blocks", |n| shader("", &"{} ".repeat(n))),
    ("arrays copied", |n| shader("", &lines(n, |k| format!("var y{k} = a; a[1] = y{k}[x & 3u];")))),
    ("matrices", |n| shader("", &"m = m * m; m[x & 3u] = v; v = m[x & 3u]; ".repeat(n))),
];

/// Declarations, types, templates and attributes.
const DECLARATIONS: &[TextForm] = &[
    ("private variables", |n| {
        shader(&lines(n, |k| format!("var<private> y{k}: u32 = {k}u;")), &lines(n, |k| format!("x += y{k};")))
    }),
    ("workgroup variables", |n| {
        shader(&lines(n, |k| format!("var<workgroup> y{k}: u32;")), &lines(n, |k| format!("y{k} = x; x += y{k};")))
    }),
    ("buffers", |n| {
        shader(
            &lines(n, |k| format!("@group(1) @binding({k}) var<storage> y{k}: array<u32>;")),
            &lines(n, |k| format!("x += y{k}[1];")),
        )
    }),
    ("textures", |n| {
        shader(
            &lines(n, |k| format!("@group(1) @binding({k}) var y{k}: texture_2d<f32>;")),
            &lines(n, |k| format!("v += textureLoad(y{k}, vec2(x), 0);")),
        )
    }),
    ("unused variables", |n| shader(&lines(n, |k| format!("var<private> y{k}: array<vec4<f32>, {}>;", k + 1)), "")),
    ("functions", |n| {
        shader(&lines(n, |k| format!("fn g{k}(x: u32) -> u32 {{ return x + {k}u; }}")), &lines(n, |k| format!("x = g{k}(x);")))
    }),
    ("unused functions", |n| shader(&lines(n, |k| format!("fn g{k}(x: u32) -> u32 {{ return x + {k}u; }}")), "")),
    ("functions that call all", |n| {
        let all = lines(n, |k| {
            format!(
                "fn g{k}() {{ {} b[2] += 1u; }}",
                if k > 1 { format!("g{}(); g{}();", k - 1, k / 2) } else { String::new() }
            )
        });
        shader(&all, "")
    }),
    ("must use", |n| shader(&lines(n, |k| format!("@must_use fn g{k}() -> u32 {{ return 1u; }}")), "")),
    ("parameters", |n| {
        let parameters = lines(n, |k| format!("y{k}: u32,"));
        shader(&format!("fn g({parameters}) -> u32 {{ return y0; }}"), &format!("x = g({});", "x, ".repeat(n)))
    }),
    ("pointer parameters", |n| {
        let parameters = lines(n, |k| format!("y{k}: ptr<function, u32>,"));
        shader(&format!("fn g({parameters}) {{ *y0 = 1u; }}"), &format!("g({});", "&x, ".repeat(n)))
    }),
    ("functions of pointers", |n| {
        let all = lines(n, |k| format!("fn g{}(p: ptr<storage, array<u32>, read_write>) {{ g{k}(p); }}", k + 1));
        shader(&format!("fn g0(p: ptr<storage, array<u32>, read_write>) {{ (*p)[1] = 1u; }}\n{all}"), &format!("g{n}(&b);"))
    }),
    ("entry points", |n| shader(&lines(n, |k| format!("@compute @workgroup_size(1) fn e{k}() {{ b[{k}] = 1u; }}")), "")),
    ("inputs", |n| fragment(&format!("struct I {{ {} }}", lines(n, |k| format!("@location({k}) y{k}: f32,"))), "")),
    ("structures", |n| shader(&lines(n, |k| format!("struct S{k} {{ s: u32 }}")), "")),
    ("members", |n| {
        shader(
            &format!("struct S {{ {} }} @group(1) @binding(0) var<storage> s: S;", lines(n, |k| format!("m{k}: u32,"))),
            &lines(n, |k| format!("x += s.m{k};")),
        )
    }),
    ("members with attributes", |n| {
        let members = lines(n, |k| format!("@align({}) @size({}) m{k}: u32,", 16 << (k % 3), 64 + k % 5 * 4));
        shader(&format!("struct S {{ {members} }} @group(1) @binding(0) var<storage> s: S;"), "x += s.m0;")
    }),
    ("structures by value", |n| {
        let members = lines(n, |k| format!("m{k}: u32,"));
        shader(
            &format!("struct S {{ {members} }}"),
            &format!("var s: S; s.m0 = x; var u = s; {} x += u.m0;", "u = s; ".repeat(8)),
        )
    }),
    ("structures nested with attributes", |n| {
        let all = lines(n, |k| format!("struct S{} {{ @align(32) s: S{k}, u: u32 }}", k + 1));
        shader(&format!("struct S0 {{ s: u32 }}\n{all}"), "")
    }),
    ("aliases", |n| shader(&lines(n, |k| format!("alias A{k} = array<u32, {}>;", k + 1)), "")),
    ("aliases of one type", |n| shader(&lines(n, |k| format!("alias A{k} = u32;")), &lines(n, |k| format!("x = A{k}(x);")))),
    ("lengths of arrays", |n| shader(&format!("var<private> y: array<u32, 1{}>;", " + 0".repeat(n)), "")),
    ("brackets in templates", |n| shader(&format!("var<private> y: array<u32, {}>;", nested("(", "1", ")", n)), "")),
    ("arrays of arrays", |n| shader(&format!("var<private> y: {};", nested("array<", "u32", ", 1>", n)), "")),
    ("pointers", |n| shader(&format!("fn g(p: {}) {{}}", nested("ptr<function, ", "u32", ">", n)), "")),
    ("templates not closed", |n| shader(&format!("alias A = {}", "array<".repeat(n)), "")),
    ("comparisons like templates", |n| shader("", &format!("t = {} x;", "x < ".repeat(n)))),
    ("templates in templates", |n| shader("", &format!("x = {};", nested("bitcast<u32>(vec2<u32>(", "x", ").x)", n)))),
    ("attributes of one item", |n| shader(&format!("struct S {{ {} m: u32 }}", "@size(4) ".repeat(n)), "")),
    ("attributes of a function", |n| shader(&format!("{} fn g() -> u32 {{ return 1u; }}", "@must_use ".repeat(n)), "")),
    ("unknown attributes", |n| shader(&format!("{} fn g() {{}}", "@nothing(1, 2) ".repeat(n)), "")),
    ("expressions of attributes", |n| shader(&format!("struct S {{ @size(4{}) m: u32 }}", " + 0".repeat(n)), "")),
    ("workgroup sizes", |n| format!("@compute @workgroup_size(1{}) fn main() {{}}", " * 1".repeat(n))),
    ("enables", |n| format!("{}{}", "enable f16;\n".repeat(n), shader("", ""))),
    ("names of one enable", |n| format!("enable f16{};\n{}", ", f16".repeat(n), shader("", ""))),
    ("requires", |n| format!("{}{}", "requires readonly_and_readwrite_storage_textures;\n".repeat(n), shader("", ""))),
    ("diagnostics", |n| format!("{}{}", "diagnostic(off, derivative_uniformity);\n".repeat(n), shader("", ""))),
    ("overrides", |n| shader(&lines(n, |k| format!("override o{k}: u32 = {k}u;")), &lines(n, |k| format!("x += o{k};")))),
    ("overrides with ids", |n| shader(&lines(n, |k| format!("@id({k}) override o{k} = 1.5;")), "")),
    ("overrides in a chain", |n| {
        shader(
            &format!("override o0 = 1u;\n{}", lines(n, |k| format!("override o{} = o{k} + 1u;", k + 1))),
            &format!("x = o{n};"),
        )
    }),
    ("expressions of overrides", |n| shader(&format!("override o = 1u; override p = o{};", " + o".repeat(n)), "x = p;")),
    ("brackets of overrides", |n| {
        shader(&format!("override o = 1u; override p = {};", nested("(o + ", "o", ")", n)), "x = p;")
    }),
    ("overrides in a function", |n| shader("override o = 1u;", &"x += o * 2u + 1u; ".repeat(n))),
    ("arrays of overrides", |n| {
        let all = lines(n, |k| format!("override o{k} = 1u; var<workgroup> w{k}: array<u32, o{k}>;"));
        shader(&all, &lines(n, |k| format!("w{k}[0] = x;")))
    }),
    ("assertions", |n| shader(&"const_assert 1 < 2; ".repeat(n), "")),
    ("assertions nested", |n| shader(&format!("const_assert {};", nested("(", "true", " && true)", n)), "")),
];

/// Literals, names, comments and blanks.
const TOKENS: &[TextForm] = &[
    ("digits", |n| shader("", &format!("x = {}u;", "1".repeat(n)))),
    ("zeros", |n| shader("", &format!("f = 0.{}1;", "0".repeat(n)))),
    ("hexadecimal digits", |n| shader("", &format!("x = 0x{}u;", "f".repeat(n)))),
    ("hexadecimal fractions", |n| shader("", &format!("f = 0x1.{}p0;", "8".repeat(n)))),
    ("exponents", |n| shader("", &format!("f = 1e{};", "9".repeat(n)))),
    ("literals", |n| shader("", &lines(n, |k| format!("f += {k}.5e-3;")))),
    ("long names", |n| shader(&format!("var<private> y{}: u32;", "y".repeat(n)), "")),
    ("unknown names", |n| shader("", &lines(n, |k| format!("x = y{k};")))),
    ("line comments", |n| format!("{}{}", "// a comment\n".repeat(n), shader("", ""))),
    ("block comments", |n| format!("{}{}", "/* a */ ".repeat(n), shader("", ""))),
    ("nested comments", |n| format!("{}{}", nested("/*", "", "*/", n), shader("", ""))),
    ("comments not closed", |n| format!("{}{}", "/*".repeat(n), shader("", ""))),
    ("blanks", |n| format!("{}{}", " \n\t".repeat(n), shader("", ""))),
    ("letters of other scripts", |n| shader(&format!("var<private> {}: u32;", "é".repeat(n)), "")),
    ("operators", |n| shader("", &format!("x = x {} x;", "<".repeat(n)))),
    ("brackets not closed", |n| shader("", &"(".repeat(n))),
    ("brackets not opened", |n| shader("", &")".repeat(n))),
    ("braces not closed", |n| shader("", &"{".repeat(n))),
    ("semicolons outside", |n| shader(&";".repeat(n), "")),
    ("nonsense", |n| "@fn<(:;".repeat(n)),
];

/// Constants and expressions that the front end computes.
const CONSTANTS: &[TextForm] = &[
    ("constants", |n| shader(&lines(n, |k| format!("const c{k} = {k};")), &lines(n, |k| format!("x += u32(c{k});")))),
    ("local constants", |n| shader("", &lines(n, |k| format!("const c{k} = {k};")))),
    ("local constants in a chain", |n| {
        shader("", &format!("const c0 = 1;\n{}", lines(n, |k| format!("const c{} = c{k} + 1;", k + 1))))
    }),
    ("constants of vectors", |n| {
        shader(
            &format!("const c0 = vec4(1.0);\n{}", lines(n, |k| format!("const c{} = c{k} * 1.0;", k + 1))),
            &format!("v = c{n};"),
        )
    }),
    ("constants of matrices", |n| {
        shader(
            &format!("const c0 = mat2x2(1.0, 0, 0, 1);\n{}", lines(n, |k| format!("const c{} = c{k};", k + 1))),
            &format!("f = c{n}[0].x;"),
        )
    }),
    ("constants of structures", |n| {
        shader(
            &format!("struct S {{ s: u32, u: f32 }}\n{}", lines(n, |k| format!("const c{k} = S({k}u, 1.0);"))),
            &lines(n, |k| format!("x += c{k}.s;")),
        )
    }),
    ("elements", |n| shader(&format!("const c = array({});", lines(n, |k| format!("{k}u,"))), "x = c[x & 1u];")),
    ("elements of vectors", |n| {
        shader(&format!("const c = array({});", lines(n, |k| format!("vec4({k}, 1, 2, 3),"))), "i = c[x & 1u].x;")
    }),
    ("elements of variables", |n| {
        shader(&format!("var<private> c = array({});", lines(n, |k| format!("{k}u,"))), "x = c[x & 1u];")
    }),
    ("elements of local variables", |n| {
        shader("", &format!("var c = array({}); x = c[x & 1u];", lines(n, |k| format!("{k}u,"))))
    }),
    ("arrays of a long array", |n| {
        shader(
            &format!("const c = array({});", lines(n, |k| format!("{k}u,"))),
            "const d = c; const e = array(d, d); x = e[x & 1u][x & 1u];",
        )
    }),
    ("reads of a long array", |n| {
        shader(&format!("const c = array({});", lines(n, |k| format!("{k}u,"))), &lines(n / 8, |k| format!("x += c[{k}];")))
    }),
    ("reads of a long local array", |n| {
        shader(
            "",
            &format!("const c = array({});\n{}", lines(n, |k| format!("{k}u,")), lines(n / 8, |k| format!("x += c[{k}];"))),
        )
    }),
    ("sum", |n| shader(&format!("const c = 1{};", " + 1".repeat(n)), "i = c;")),
    ("brackets", |n| shader(&format!("const c = {};", nested("(1 + ", "1", ")", n)), "i = c;")),
    ("conditions", |n| shader(&format!("const c = true{};", " && true".repeat(n)), "t = c;")),
    ("choices", |n| shader(&format!("const c = {};", nested("select(1, ", "2", ", true)", n)), "i = c;")),
    ("indices", |n| shader(&format!("const c = array(1, 0); const d = {};", nested("c[", "0", "]", n)), "i = d;")),
    ("built-in functions", |n| shader(&format!("const c = {};", nested("sin(", "1.0", ")", n)), "f = c;")),
    ("built-in functions of two", |n| shader(&format!("const c = {};", nested("max(1, ", "2", ")", n)), "i = c;")),
    ("mix", |n| shader(&format!("const c = {};", nested("mix(", "1.0", ", 2.0, 0.5)", n)), "f = c;")),
    ("transposed", |n| shader(&format!("const c = {};", nested("transpose(", "mat2x2(1.0, 0, 0, 1)", ")", n)), "f = c[0].x;")),
    ("conversions", |n| shader(&format!("const c = {};", nested("i32(f32(", "1", "))", n)), "i = c;")),
    ("vectors", |n| shader(&format!("const c = {};", nested("vec4(", "1.0", ")", n)), "v = c;")),
    ("lengths", |n| {
        shader(
            &format!("const n0 = 1;\n{}", lines(n, |k| format!("const n{} = n{k}; alias A{k} = array<u32, n{k}>;", k + 1))),
            "",
        )
    }),
    ("zero values", |n| shader("", &"x += array<u32, 64>()[1]; ".repeat(n))),
    ("zero values of a length", |n| shader("", &lines(n, |k| format!("x += array<u32, {}>()[0];", k + 1)))),
    ("literal operands", |n| shader("", &"x += 1u + 2u * 3u - 4u; ".repeat(n))),
    ("literals that the front end computes", |n| {
        shader("", &"f += mix(1.0, 2.0, 0.5) + smoothstep(0.0, 1.0, 0.5) + determinant(mat2x2(1.0, 0, 0, 1)); ".repeat(n))
    }),
];

/// Forms that stand for 2 to the power of `n`, or for more.
pub const LARGE: &[TextForm] = &[
    ("aliases of arrays", |n| {
        shader(
            &format!("alias A0 = u32;\n{}", lines(n, |k| format!("alias A{} = array<A{k}, 2>;", k + 1))),
            &format!("var y: A{n};"),
        )
    }),
    ("arrays in one type", |n| shader("", &format!("var y: {};", nested("array<", "u32", ", 2>", n)))),
    ("structures of arrays", |n| {
        let all = lines(n, |k| format!("struct S{} {{ a: array<S{k}, 2> }}", k + 1));
        shader(&format!("struct S0 {{ s: u32 }}\n{all}"), &format!("var y: S{n};"))
    }),
    ("structures in a buffer", |n| {
        let all = lines(n, |k| format!("struct S{} {{ a: S{k}, b: S{k} }}", k + 1));
        shader(&format!("struct S0 {{ s: u32 }}\n{all}\n@group(1) @binding(0) var<storage> y: S{n};"), "")
    }),
    ("overrides", |n| {
        shader(
            &format!("override o0 = 1u;\n{}", lines(n, |k| format!("override o{} = o{k} + o{k};", k + 1))),
            &format!("x = o{n};"),
        )
    }),
    ("constants", |n| {
        shader(
            &format!("const c0 = 1.0;\n{}", lines(n, |k| format!("const c{} = max(c{k}, c{k});", k + 1))),
            &format!("f = c{n};"),
        )
    }),
    ("constants of vectors", |n| {
        shader(
            &format!("const c0 = vec2(1.0);\n{}", lines(n, |k| format!("const c{} = vec2(c{k}.x, c{k}.y);", k + 1))),
            &format!("f = c{n}.x;"),
        )
    }),
    ("local constants", |n| {
        shader("", &format!("const c0 = true;\n{}\nt = c{n};", lines(n, |k| format!("const c{} = c{k} && c{k};", k + 1))))
    }),
    ("zero values", |n| {
        shader(
            &format!("alias A0 = array<u32, 2>;\n{}", lines(n, |k| format!("alias A{} = array<A{k}, 2>;", k + 1))),
            &format!("let y = A{n}(); t = y[0][0][0] == 0u;"),
        )
    }),
    ("calls", |n| {
        let all =
            lines(n, |k| format!("fn g{}(x: u32) -> u32 {{ if x > 1u {{ return g{k}(x); }} return g{k}(x + 1u); }}", k + 1));
        shader(&format!("fn g0(x: u32) -> u32 {{ return x; }}\n{all}"), &format!("x = g{n}(x);"))
    }),
    ("calls in loops", |n| {
        let all = lines(n, |k| format!("fn g{}() {{ for (var k = 0u; k < 2u; k++) {{ g{k}(); }} }}", k + 1));
        shader(&format!("fn g0() {{ b[2] += 1u; }}\n{all}"), &format!("g{n}();"))
    }),
    ("calls of pointers", |n| {
        let all = lines(n, |k| format!("fn g{}(p: ptr<function, u32>) {{ g{k}(p); g{k}(p); }}", k + 1));
        shader(&format!("fn g0(p: ptr<function, u32>) {{ *p += 1u; }}\n{all}"), &format!("g{n}(&x);"))
    }),
    ("values of values", |n| {
        let all = lines(n, |k| format!("let y{} = array(y{k}, y{k});", k + 1));
        shader("", &format!("let y0 = x;\n{all}\nvar z = y{n};"))
    }),
    ("loops", |n| {
        let open: String = (0..n).map(|k| format!("for (var k{k} = 0u; k{k} < 2u; k{k}++) {{ ")).collect();
        shader("", &format!("{open} b[2] += 1u; {}", "}".repeat(n)))
    }),
    ("loops of registers", |n| {
        let open: String = (0..n).map(|k| format!("for (var k{k} = 0u; k{k} < 2u; k{k}++) {{ ")).collect();
        shader("", &format!("{open} x = x * 3u + 1u; {}", "}".repeat(n)))
    }),
    ("loops of calls", |n| {
        shader("fn g(x: u32) -> u32 { return x * 3u; }", &nested("for (var k = 0u; k < 2u; k++) { x = g(x); ", "", "}", n))
    }),
    ("breaks of nested loops", |n| {
        shader("", &nested("loop { if x > 3u { break; } x += 1u; ", "", " continuing { i += 1; } }", n))
    }),
    ("matrices of arrays", |n| {
        let all = lines(n, |k| format!("struct S{} {{ a: array<S{k}, 4>, m: mat4x4<f32> }}", k + 1));
        shader(&format!("struct S0 {{ s: f32 }}\n{all}\nvar<private> y: S{n};"), &format!("var z = y; z = S{n}();"))
    }),
    ("workgroup memory", |n| {
        let all = lines(n, |k| format!("alias A{} = array<A{k}, 2>;", k + 1));
        shader(&format!("alias A0 = u32;\n{all}\nvar<workgroup> y: A{n};"), "")
    }),
];
