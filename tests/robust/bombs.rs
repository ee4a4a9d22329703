//! Short shaders that become large when they are compiled: loops are left as loops, all else is refused, in bounded time and memory.

use super::deep_shaders::compile;
use super::generated as made;
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
    limited(&compile(&made::members(15_000), &[]), "shader.instructions");
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
