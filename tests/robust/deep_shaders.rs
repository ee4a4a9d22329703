//! Shaders that are nested: beyond the limit they are refused with the place and the way out, up to it they compile, on a stack that is
//! large enough.

use fillrate::trace::record::{self, Recorder};
use tempfile::TempDir;

use super::forms::TextForm;
use super::forms::wgsl::DEEP;
use super::process::{Output, Run, done, fillrate, refused};

/// A replay of a trace that compiles a compute shader which `create` adds, and runs nothing.
pub fn compiling(create: impl FnOnce(&mut Recorder) -> num::ShaderId) -> (TempDir, Run) {
    let mut card = Recorder::new("hostile");
    let shader = create(&mut card);
    let pipeline = card.create_compute_pipeline("hostile", None, record::stage_entry(shader, "main"));
    // A pipeline is compiled when it is first used; no workgroup runs.
    let mut pass = card.begin_compute_pass();
    pass.set_pipeline(pipeline);
    pass.dispatch(0, 1, 1);
    drop(pass);
    let folder = TempDir::new().expect("a folder");
    card.save(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    let arguments = ["replay".into(), folder.path().as_os_str().to_owned(), "--fidelity".into(), "functional".into()];
    let run = fillrate(arguments);
    (folder, run)
}

/// Compiles a text in a process of its own, with these limits.
pub fn compile(wgsl: &str, limits: &[&str]) -> Output {
    let (_folder, run) = compiling(|card| card.create_shader("hostile", wgsl));
    limits.iter().fold(run, |run, limit| run.arg("--limit").arg(limit)).run()
}

/// What naga's parser bounds itself: brackets, templates, and blocks.
const BRACKETS: &[&str] = &[
    "sum on the right",
    "round brackets",
    "square brackets",
    "calls inside calls",
    "templates",
    "dereference on the left",
    "blocks",
    "ifs",
    "loops",
    "switches",
];

/// What is nested by declarations that need each other.
const DECLARED: &[&str] = &[
    "constants",
    "constants in reverse",
    "overrides in reverse",
    "aliases in reverse",
    "arrays of arrays",
    "structures of structures",
    "values of values",
    "functions in reverse",
    "functions with early returns",
];

/// For each kind of nesting, what holds of it: processes of their own, two at a time.
fn each(check: impl Fn(&TextForm) + Sync) {
    std::thread::scope(|scope| {
        for part in 0..2 {
            let check = &check;
            scope.spawn(move || DEEP.iter().skip(part).step_by(2).for_each(check));
        }
    });
}

/// Asserts that a text was refused for one of these limits, with its place.
#[track_caller]
fn limited(name: &str, output: &Output, limits: &[&str]) {
    refused(output, &["hostile", "more than the limit of"]);
    let named = limits.iter().any(|limit| output.stderr.contains(&format!("--limit {limit}=N")));
    assert!(named, "{name}: none of {limits:?} in {output:?}");
    let number = |text: &str| text.parse::<u32>().is_ok_and(|n| n > 0);
    let is_place =
        |word: &str| word.trim_end_matches(':').split_once(':').is_some_and(|(line, column)| number(line) && number(column));
    // The error for a text that is too long has no place.
    assert!(
        output.stderr.contains("shader.source") || output.stderr.split_whitespace().any(is_place),
        "{name}: no place in {output:?}"
    );
}

#[test]
fn a_hundred_thousand_levels_are_refused() {
    each(|(name, make)| {
        let limits = ["shader.nesting", "shader.declarations", "shader.constants", "shader.source"];
        let some = if DECLARED.contains(name) { &limits[..] } else { &limits[..1] };
        limited(name, &compile(&make(100_000), &[]), some);
    });
}

#[test]
fn chains_of_declarations_are_nesting() {
    each(|(name, make)| {
        if DECLARED.contains(name) {
            limited(name, &compile(&make(8_000), &[]), &["shader.nesting"]);
        }
    });
}

#[test]
fn what_the_limit_allows_compiles() {
    each(|(name, make)| {
        let levels = if BRACKETS.contains(name) { 60 } else { 700 };
        let output = compile(&make(levels), &[]);
        assert_eq!(output.status.code(), Some(0), "{name}: {output:?}");
        done(&output);
    });
}

#[test]
fn brackets_that_the_parser_cannot_follow_are_refused() {
    for (name, make) in DEEP.iter().filter(|(name, _)| BRACKETS.contains(name)) {
        let output = compile(&make(400), &[]);
        refused(&output, &["hostile"]);
        let fixed = ["200 levels", "127 blocks"];
        assert!(fixed.iter().any(|fixed| output.stderr.contains(fixed)), "{name}: {output:?}");
    }
}

#[test]
fn a_raised_limit_has_a_stack_that_suits_it() {
    for kind in ["not", "sum", "else if", "dereference", "functions in reverse"] {
        let (_, make) = DEEP.iter().find(|(name, _)| *name == kind).expect("a kind");
        done(&compile(&make(6_000), &["shader.nesting=60000"]));
    }
    let output = compile(&DEEP[0].1(10), &["shader.nesting=1000000000000"]);
    refused(&output, &["a stack of", "shader.nesting"]);
}

/// Compiles a text to a SPIR-V binary, on a large stack.
pub fn spirv(wgsl: String) -> Vec<u8> {
    let make = move || {
        let module = naga::front::wgsl::parse_str(&wgsl).expect("a shader");
        let info = naga::valid::Validator::new(Default::default(), naga::valid::Capabilities::all()).validate(&module);
        let words =
            naga::back::spv::write_vec(&module, &info.expect("a valid one"), &Default::default(), None).expect("a binary");
        words.into_iter().flat_map(u32::to_le_bytes).collect()
    };
    std::thread::Builder::new().stack_size(1 << 28).spawn(make).expect("a thread").join().expect("a binary")
}

#[test]
fn nested_spirv_is_refused() {
    let (_, make) = DEEP.iter().find(|(name, _)| *name == "else if").expect("a kind");
    for (levels, fits) in [(6_000, false), (1_000, true)] {
        let binary = spirv(make(levels));
        let (_folder, run) = compiling(|card| card.create_shader_spirv("hostile", &binary));
        let output = run.run();
        if fits {
            done(&output);
        } else {
            refused(&output, &["hostile", ", word ", "levels of nesting in a shader", "--limit shader.nesting=N"]);
        }
    }
}

/// A sum of a number of terms in naga's form. Only the last partial sum is emitted, so that computing it computes all others.
fn sum_on_demand(terms: usize) -> String {
    use naga::{Expression, Statement};
    let text = "@group(0) @binding(0) var<storage, read_write> b: array<u32>; @compute @workgroup_size(1) fn main() { b[1] = b[0] + b[0]; }";
    let mut module = naga::front::wgsl::parse_str(text).expect("a shader");
    let function = &mut module.entry_points[0].function;
    let is_sum = |e: &Expression| matches!(e, Expression::Binary { .. });
    let first = function.expressions.iter().find(|(_, e)| is_sum(e)).map(|(h, _)| h).expect("a sum");
    let mut last = first;
    for _ in 1..terms {
        let sum = Expression::Binary { op: naga::BinaryOperator::Add, left: last, right: first };
        last = function.expressions.append(sum, Default::default());
    }
    for statement in function.body.iter_mut() {
        if let Statement::Store { value, .. } = statement {
            *value = last;
        }
    }
    let emitted = Statement::Emit(naga::Range::new_from_bounds(last, last));
    let at = function.body.iter().position(|s| matches!(s, Statement::Store { .. })).expect("a store");
    let mut body = std::mem::take(&mut function.body).span_into_iter().collect::<Vec<_>>();
    body.insert(at, (emitted, Default::default()));
    for (statement, span) in body {
        function.body.push(statement, span);
    }
    ron::to_string(&module).expect("a module is text")
}

#[test]
fn expressions_that_are_nested_in_nagas_form_only_are_refused() {
    let ron = sum_on_demand(30_000);
    let (_folder, run) = compiling(|card| card.create_shader_naga_ir("hostile", &ron));
    refused(&run.run(), &["hostile", "levels of nesting", "--limit shader.nesting=N"]);
}
