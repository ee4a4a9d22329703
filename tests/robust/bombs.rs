//! Short shaders that become large when compiled: loops stay loops, all others are refused, in bounded time and memory.

use super::deep_shaders::{compile, compiling, spirv};
use super::forms::wgsl as made;
use super::process::{Output, below_mib, done, refused};

/// Asserts that a shader was refused for a limit, in bounded memory.
#[track_caller]
fn limited(output: &Output, limit: &str) {
    refused(output, &["hostile", "more than the limit of", &format!("--limit {limit}=N")]);
    below_mib(output, 1024);
}

#[track_caller]
fn compiled(output: &Output) {
    done(output);
    below_mib(output, 1024);
}

#[test]
fn loops_in_loops_stay_loops() {
    compiled(&compile(&made::loops(4, 64), &[]));
    compiled(&compile(&made::loops(120, 64), &[]));
    compiled(&compile(&made::loops_that_break(4, 64), &[]));
    compiled(&compile(&made::loops_that_break(20, 64), &[]));
    compiled(&compile(&made::small_loops(2_000), &[]));
}

#[test]
fn arrays_that_double_are_refused() {
    limited(&compile(&made::doubled_constants(27), &[]), "shader.constants");
    limited(&compile(&made::doubled_local_constants(27), &[]), "shader.constants");
    limited(&compile(&made::doubled_values(27), &[]), "shader.components");
    limited(&compile(&made::doubled_structures(27), &[]), "shader.constants");
    limited(&compile(&made::constant_array(10_000, 10_000), &[]), "shader.constants");
    compiled(&compile(&made::doubled_constants(10), &[]));
    compiled(&compile(&made::doubled_structures(10), &[]));
    compiled(&compile(&made::constant_array(1000, 100), &[]));
}

#[test]
fn calls_that_double_are_refused() {
    limited(&compile(&made::doubled_calls(40), &[]), "shader.instructions");
    limited(&compile(&made::doubled_empty_calls(40), &[]), "shader.instructions");
    compiled(&compile(&made::doubled_calls(10), &[]));
    limited(&compile(&made::many_functions(50_000, 100), &[]), "shader.constants");
    limited(&compile(&made::many_declarations(10_000), &[]), "shader.declarations");
    compiled(&compile(&made::many_functions(5_000, 100), &[]));
}

#[test]
fn many_of_one_kind_take_time_in_proportion() {
    compiled(&compile(&made::many_declarations(3_000), &[]));
    compiled(&compile(&made::many_entry_points(5_000), &[]));
    compiled(&compile(&made::cases(5_000), &[]));
    compiled(&compile(&made::statements(4_000), &[]));
    compiled(&compile(&made::branches(2_000, 200), &[]));
    compiled(&compile(&made::relay(2_000), &[]));
    compiled(&compile(&made::empty_branches(100), &[]));
    compiled(&compile(&made::members(2_000), &[]));
    limited(&compile(&made::cases(65_536), &[]), "shader.constants");
    limited(&compile(&made::statements(80_000), &[]), "shader.constants");
    limited(&compile(&made::members(15_000), &["shader.pairs=100000000000"]), "shader.instructions");
}

#[test]
fn functions_that_naga_reads_in_the_square_of_their_length_are_refused() {
    for text in [
        made::statements(8_000),
        made::cases(12_000),
        made::small_loops(8_000),
        made::branches(12_000, 1),
        made::shader("", &format!("x = x{};", " + x".repeat(4_000)).repeat(9)),
        made::shader("", &(0..16_000).map(|k| format!("let a{k} = x;")).collect::<String>()),
    ] {
        limited(&compile(&text, &[]), "shader.pairs");
    }
    // As SPIR-V.
    let binary = spirv(made::statements(1_000));
    let (_folder, run) = compiling(|card| card.create_shader_spirv("hostile", &binary));
    limited(&run.clone().arg("--limit").arg("shader.pairs=1000000").run(), "shader.pairs");
    compiled(&run.run());
    // It is part of the work of all modules together: this text has 20 kB.
    let text = made::statements(1_000);
    refused(&compile(&text, &["work.shader_source=100000"]), &["bytes of shader source", "--limit work.shader_source=N"]);
    compiled(&compile(&text, &["work.shader_source=300000"]));
}

#[test]
fn large_arrays_are_refused_by_name() {
    limited(&compile(&made::large_array("function", 100_000_000), &[]), "shader.components");
    limited(&compile(&made::large_array("private", 100_000_000), &[]), "shader.components");
    limited(&compile(&made::large_array("workgroup", 100_000_000), &[]), "shader.workgroup");
    limited(&compile(&made::large_array("function", 20_000), &[]), "shader.array_registers");
    compiled(&compile(&made::large_array("function", 20_000), &["shader.array_registers=40000"]));
    refused(
        &compile(&made::large_array("function", 65_000), &["shader.array_registers=70000"]),
        &["65006 registers", "operations can number"],
    );
}

#[test]
fn operators_on_long_zero_values_are_refused() {
    for (declarations, body) in [
        ("const X = array<i32, 500000000>() == array<i32, 500000000>();", ""),
        ("", "let c = array<i32, 30000000>() == array<i32, 30000000>();"),
        ("", "let c = array<array<i32, 50000>, 50000>() + array<array<i32, 50000>, 50000>();"),
        ("const N = 1 << 20u; alias A = array<vec4<f32>, N * 64 - 1>;", "let c = -A();"),
        ("struct S { a: u32, b: array<i32, 100000000> }", "let c = !S();"),
        ("const Z = array<u32, 400000000>();", "let c = ~Z;"),
        ("const Z = array<u32, 400000000>();", "let c = select(Z, Z, true);"),
        ("override o: u32; override p = array<u32, 400000000>() == o;", "x = p;"),
        ("", "let c = vec3(array<f32, 100000000>(), 1.0, 2.0);"),
        ("", "let c = f32(array<i32, 100000000>());"),
        ("", "x = max(array<u32, 100000000>(), 1u);"),
        ("", "x = array<u32, 100000000>()[5];"),
        ("fn f(a: array<u32, 100000000>) -> u32 { return a[1]; }", "x = f(array<u32, 100000000>());"),
    ] {
        let output = compile(&made::shader(declarations, body), &[]);
        refused(&output, &["hostile", "more than the limit of", "--limit shader.constants=N"]);
        below_mib(&output, 200);
    }
    // Many of middling length.
    let many = "t = array<u32, 60000>() == array<u32, 60000>();".repeat(1000);
    limited(&compile(&made::shader("", &many), &[]), "shader.constants");
    // One whose length only naga could tell.
    let output = compile(&made::shader("const N = array(400000000, 1);", "t = array<u32, N[0]>() == array<u32, N[0]>();"), &[]);
    refused(&output, &["hostile", "length is not known"]);
    below_mib(&output, 200);
    // A zero value of SPIR-V is stored only.
    let text = made::shader("var<private> z: array<u32, 30000000> = array<u32, 30000000>();", "z[x] = x; x = z[x + 1u];");
    let binary = spirv(text.clone());
    let (_folder, run) = compiling(|card| card.create_shader_spirv("hostile", &binary));
    limited(&run.run(), "shader.components");
    limited(&compile(&text, &[]), "shader.components");
}

#[test]
fn zero_values_of_arrays_go_on_working() {
    for (declarations, body) in [
        ("var<workgroup> w: array<u32, 4096>;", "w[x & 7u] = 1u; w = array<u32, 4096>(); x += w[x & 4095u];"),
        ("var<private> p: array<u32, 4096> = array<u32, 4096>();", "p[x & 7u] = 1u; x += p[x & 4095u];"),
        ("const N = 8u; struct S { a: array<vec2<u32>, N * N> }", "var s = S(); s.a[x & 7u].y = x; x += s.a[x & 3u].y;"),
        ("const Z = array<u32, 5000>();", "x += Z[4999] + Z[x % 5000u];"),
        (
            "fn f(a: array<u32, 64>) -> u32 { return a[1]; } const N = array(64, 1);",
            "x += f(array<u32, 64>()); var v = array<u32, N[0]>();",
        ),
    ] {
        compiled(&compile(&made::shader(declarations, body), &[]));
    }
}
