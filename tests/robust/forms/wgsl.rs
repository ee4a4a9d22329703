//! Hostile WGSL, made by rule: texts that are nested, and texts that become large when they are compiled.

use std::fmt::Write;

use super::{TextForm, lines};

/// A compute shader with these declarations and this body, which may use `b`, a buffer, and `x`, a number of it.
pub fn shader(declarations: &str, body: &str) -> String {
    format!(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;\n{declarations}\n\
         @compute @workgroup_size(1) fn main() {{\nvar x = b[0]; var t = x == 1u;\n{body}\nb[1] = x + u32(t);\n}}\n"
    )
}

/// Texts that are nested to this depth, each by another construct.
pub const DEEP: &[TextForm] = &[
    ("not", |n| shader("", &format!("t = {}t;", "!".repeat(n)))),
    ("complement", |n| shader("", &format!("x = {}x;", "~".repeat(n)))),
    ("minus", |n| shader("", &format!("x = u32({}i32(x));", "- ".repeat(n)))),
    ("sum", |n| shader("", &format!("x = x{};", " + x".repeat(n)))),
    ("sum of constants", |n| shader("", &format!("x = 1u{};", "+0u".repeat(n)))),
    ("sum on the right", |n| shader("", &format!("x = {}x{};", "x + (".repeat(n), ")".repeat(n)))),
    ("and", |n| shader("", &format!("t = t{};", " && t".repeat(n)))),
    ("or", |n| shader("", &format!("t = t{};", " || t".repeat(n)))),
    ("comparison", |n| shader("", &format!("t = t{};", " == t".repeat(n)))),
    ("round brackets", |n| shader("", &format!("x = {}x{};", "(".repeat(n), ")".repeat(n)))),
    ("square brackets", |n| shader("", &format!("x = {}0{};", "b[".repeat(n), "]".repeat(n)))),
    ("members", |n| shader("", &format!("x = vec4(x){}.x;", ".xyzw".repeat(n)))),
    ("dereference", |n| shader("", &format!("x = {}x;", "*&".repeat(n)))),
    ("dereference on the left", |n| shader("", &format!("{}x = 1u;", "*&".repeat(n)))),
    ("else if", |n| shader("", &format!("if t {{}}{}", " else if t { x += 1u; }".repeat(n)))),
    ("templates", |n| shader(&format!("alias A = {}f32{};", "array<".repeat(n), ",1>".repeat(n)), "")),
    ("blocks", |n| shader("", &format!("{}{}", "{".repeat(n), "}".repeat(n)))),
    ("ifs", |n| shader("", &format!("{}x = 1u;{}", "if t {".repeat(n), "}".repeat(n)))),
    ("loops", |n| shader("", &format!("{}x = 1u;{}", "loop { if t { break; }".repeat(n), "}".repeat(n)))),
    ("switches", |n| shader("", &format!("{}x = 1u;{}", "switch x { default {".repeat(n), "}}".repeat(n)))),
    ("calls inside calls", |n| {
        shader("fn f(x: u32) -> u32 { return x; }", &format!("x = {}x{};", "f(".repeat(n), ")".repeat(n)))
    }),
    ("constants", |n| {
        shader(&(lines(n, |k| format!("const a{} = a{k} + 1;", k + 1)) + "\nconst a0 = 1;"), &format!("x = u32(a{n});"))
    }),
    ("constants in reverse", |n| {
        let all = lines(n, |k| format!("const a{} = a{} + 1;", n - k, n - k - 1));
        shader(&(all + "\nconst a0 = 1;"), &format!("x = u32(a{n});"))
    }),
    ("overrides in reverse", |n| {
        let all = lines(n, |k| format!("override a{} = a{} + 1;", n - k, n - k - 1));
        shader(&(all + "\noverride a0 = 1;"), &format!("x = u32(a{n});"))
    }),
    ("aliases in reverse", |n| {
        let all = lines(n, |k| format!("alias A{} = A{};", n - k, n - k - 1));
        shader(&(all + "\nalias A0 = u32;"), &format!("x = A{n}(x);"))
    }),
    ("arrays of arrays", |n| {
        let all = lines(n, |k| format!("alias A{} = array<A{}, 1>;", n - k, n - k - 1));
        shader(&(all + "\nalias A0 = u32;"), &format!("var a = A{n}();"))
    }),
    ("structures of structures", |n| {
        let all = lines(n, |k| format!("struct S{} {{ s: S{} }}", n - k, n - k - 1));
        shader(&(all + "\nstruct S0 { s: u32 }"), &format!("var s: S{n};"))
    }),
    ("values of values", |n| {
        let all = lines(n, |k| format!("let a{} = array(a{k});", k + 1));
        shader("", &format!("let a0 = x;\n{all}\nvar a = a{n};"))
    }),
    ("functions in reverse", |n| {
        let all = lines(n, |k| format!("fn f{}() -> u32 {{ return f{}(); }}", n - k, n - k - 1));
        shader(&(all + "\nfn f0() -> u32 { return 1u; }"), &format!("x = f{n}();"))
    }),
    ("functions with early returns", |n| {
        let all = lines(n, |k| format!("fn f{}(x: u32) -> u32 {{ if x == 7u {{ return 1u; }} return f{k}(x); }}", k + 1));
        shader(&("fn f0(x: u32) -> u32 { return x; }\n".to_owned() + &all), &format!("x = f{n}(x);"))
    }),
];

/// Loops in loops that run so often each, all counts known.
pub fn loops(nested: usize, turns: usize) -> String {
    let open: String = (0..nested).map(|k| format!("for (var i{k} = 0u; i{k} < {turns}u; i{k}++) {{\n")).collect();
    let body: String = (0..nested).map(|k| format!("x += i{k};\n")).collect();
    shader("", &format!("{open}{body}{}", "}".repeat(nested)))
}

/// As [`loops`], and the innermost one breaks on a condition that nobody knows: no attempt to unroll it succeeds.
pub fn loops_that_break(nested: usize, turns: usize) -> String {
    let open: String = (0..nested).map(|k| format!("for (var i{k} = 0u; i{k} < {turns}u; i{k}++) {{\n")).collect();
    shader("", &format!("{open}if b[i0] == 7u {{ break; }} x += 1u;{}", "}".repeat(nested)))
}

/// Arrays of two arrays each, of constants at the top.
pub fn doubled_constants(n: usize) -> String {
    let all = lines(n, |k| format!("const a{} = array(a{k}, a{k});", k + 1));
    shader(&format!("const a0 = 1;\n{all}\nconst c = a{n}{};", "[0]".repeat(n)), "x = u32(c);")
}

/// As [`doubled_constants`], inside a function.
pub fn doubled_local_constants(n: usize) -> String {
    let all = lines(n, |k| format!("const a{} = array(a{k}, a{k});", k + 1));
    shader("", &format!("const a0 = 1;\n{all}\nvar v = a{n};\nx = u32(v{}[x]);", "[0]".repeat(n - 1)))
}

/// As [`doubled_constants`], of values that are no constants.
pub fn doubled_values(n: usize) -> String {
    let all = lines(n, |k| format!("let a{} = array(a{k}, a{k});", k + 1));
    shader("", &format!("let a0 = x;\n{all}\nvar v = a{n};\nx = v{}[x];", "[0]".repeat(n - 1)))
}

/// Structures of two structures each: a type of 2^n members.
pub fn doubled_structures(n: usize) -> String {
    let all = lines(n, |k| format!("struct S{} {{ a: S{k}, b: S{k} }}", k + 1));
    shader(&format!("struct S0 {{ a: u32 }}\n{all}"), &format!("var v: S{n};"))
}

/// Functions that call the one before twice: 2^n calls.
pub fn doubled_calls(n: usize) -> String {
    let all = lines(n, |k| format!("fn f{}(x: u32) -> u32 {{ return f{k}(f{k}(x)); }}", k + 1));
    shader(&format!("fn f0(x: u32) -> u32 {{ return x; }}\n{all}"), &format!("x = f{n}(x);"))
}

/// As [`doubled_calls`], of functions that do nothing.
pub fn doubled_empty_calls(n: usize) -> String {
    let all = lines(n, |k| format!("fn f{}() {{ f{k}(); f{k}(); }}", k + 1));
    shader(&format!("fn f0() {{ }}\n{all}"), &format!("f{n}();"))
}

/// Functions that call the one before and the first, `depth` of them in each chain: all are reached.
pub fn many_functions(n: usize, depth: usize) -> String {
    let callee = |k: usize| if k.is_multiple_of(depth) { 0 } else { k };
    let all = lines(n, |k| format!("fn f{}(x: u32) -> u32 {{ return f{}(x); }}", k + 1, callee(k)));
    let calls = lines(n / depth, |k| format!("x = f{}(x);", (k + 1) * depth));
    shader(&format!("fn f0(x: u32) -> u32 {{ return x; }}\n{all}"), &calls)
}

/// `n` module variables, and the same number of functions.
pub fn many_declarations(n: usize) -> String {
    let all = lines(n, |k| format!("var<private> v{k}: u32; fn f{k}() {{ v{k} = 1u; }}"));
    shader(&all, &lines(n, |k| format!("f{k}();")))
}

/// Many entry points.
pub fn many_entry_points(n: usize) -> String {
    let all = lines(n, |k| format!("@compute @workgroup_size(1) fn m{k}() {{ b[{k}] = 1u; }}"));
    shader(&all, "")
}

/// A switch with this number of cases.
pub fn cases(n: usize) -> String {
    let all = lines(n, |k| format!("case {k}u: {{ x += {k}u; }}"));
    shader("", &format!("switch x {{ {all} default {{}} }}"))
}

/// `n` statements one after the other.
pub fn statements(n: usize) -> String {
    shader("", &lines(n, |k| format!("x = x * {k}u + b[x];")))
}

/// A number of `if`s one after the other, over a state of a number of variables.
pub fn branches(n: usize, variables: usize) -> String {
    let declared = lines(variables, |k| format!("var v{k} = x;"));
    shader("", &format!("{declared}\n{}", lines(n, |k| format!("if b[{k}] == x {{ v{} = {k}u; }}", k % variables))))
}

/// `n` small loops.
pub fn small_loops(n: usize) -> String {
    shader("", &lines(n, |_| "for (var i = 0u; i < x; i++) { x += b[i]; }".to_owned()))
}

/// Variables that a loop hands on, each from the next: what the first one needs is found out last.
pub fn relay(n: usize) -> String {
    let declared = lines(n, |k| format!("var v{k} = x + {k}u;"));
    let handed = lines(n - 1, |k| format!("v{k} = v{};", k + 1));
    shader("", &format!("{declared}\nloop {{ if b[2] == x {{ break; }}\n{handed}\nv{} += 1u; }}\nx = v0;", n - 1))
}

/// Branches inside each other, each empty once the one inside is gone.
pub fn empty_branches(n: usize) -> String {
    let open: String = (0..n).map(|k| format!("if b[x + {k}u] == 1u {{ ")).collect();
    shader("", &format!("{open}{}", "}".repeat(n)))
}

/// A structure with a number of members. Its last member is read the same number of times.
pub fn members(n: usize) -> String {
    let mut all = String::new();
    for k in 0..n {
        write!(all, "m{k}: u32,").expect("a text");
    }
    let read = lines(n, |_| format!("x += s.m{};", n - 1));
    shader(&format!("struct S {{ {all} }}\n@group(0) @binding(1) var<storage> s: S;"), &read)
}

/// An array of constants, and a number of reads of it.
pub fn constant_array(n: usize, readings: usize) -> String {
    let all = lines(n, |k| format!("{k}u,"));
    shader(&format!("const a = array<u32, {n}>({all});"), &lines(readings, |k| format!("x += a[{}];", k % n)))
}

/// A large array in an address space.
pub fn large_array(space: &str, n: usize) -> String {
    let variable = format!("var<{space}> a: array<u32, {n}>;");
    let (top, local) = if space == "function" { (String::new(), variable) } else { (variable, String::new()) };
    shader(&top, &format!("{local}\na[x] = x; x = a[1];"))
}
