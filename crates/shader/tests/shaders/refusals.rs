//! Programs that WGSL allows and that the engine must refuse with a reason, or stop: never run wrongly.

use num::Limits;
use shader::{Executor, Module, ModuleSource, Options, Recorder, Resource, Resources, Stage, compile};

/// What the engine says of a compute stage.
#[track_caller]
fn refused(source: &str, reason: &str) {
    let mut limits = Limits::default();
    limits.set("shader.instructions=20000").expect("a limit of this name");
    let error = match Module::with_limits("refused", ModuleSource::Wgsl(source), &limits) {
        Err(error) => error,
        Ok(module) => {
            match compile(&module, module.entry_points().next().expect("an entry point").0, None, &Options::default()) {
                Err(error) => error,
                Ok(_) => panic!("accepted: {source}"),
            }
        }
    };
    assert!(error.to_string().contains(reason), "{error}\n{source}");
}

const OUT: &str = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;";

#[test]
fn what_cannot_run_is_refused_with_a_reason() {
    let body =
        |globals: &str, body: &str| format!("enable f16; {OUT} {globals} @compute @workgroup_size(1) fn main() {{ {body} }}");
    refused(&body("", "let x = bitcast<u16>(f16(out[1]));"), "16");
    refused(&body("", "for (var i = 0; i < 3; i++) { let x = bitcast<i16>(f16(out[1])); }"), "16");
    refused(&body("var<private> a: array<u32, 70000>;", "a[out[0]] = 1u; out[1] = a[out[2]];"), "components");
    let many = "var<private> a: array<u32, 9000>; var<private> b: array<u32, 9000>;";
    refused(&body(many, "a[out[0]] = 1u; b[out[1]] = 2u; out[1] = a[out[2]] + b[out[3]];"), "registers for arrays");
    refused(&body("var<workgroup> a: array<array<u32, 3000>, 3000>;", "a[0][0] = 1u; out[0] = a[1][1];"), "workgroup");
    refused(&body("override n: u32;", "out[0] = n;"), "n");
    refused(&format!("{OUT} @compute @workgroup_size(1024, 1024) fn main() {{ out[0] = 1u; }}"), "invocations");
    let doubled: String =
        (1..40).map(|k| format!("fn f{k}(x: u32) -> u32 {{ return f{0}(x) * f{0}(x + 1u); }}", k - 1)).collect();
    let doubled = format!("fn f0(x: u32) -> u32 {{ return x; }} {doubled}");
    refused(&body(&doubled, "out[0] = f39(out[1]);"), "shader.instructions");
    refused("@group(0) @binding(0) var t: texture_1d_array<f32>; @fragment fn main() {}", "");
}

#[test]
fn an_endless_loop_is_stopped_with_its_place() {
    let endless = "loop { out[0] += 1u; if (out[1] == 1u) { break; } }";
    for (stage, head) in [(Stage::Compute, "@compute @workgroup_size(1)"), (Stage::Fragment, "@fragment")] {
        let source = format!("{OUT}\n{head} fn main() {{\n{endless}\n}}");
        let module = Module::new("endless", ModuleSource::Wgsl(&source)).expect("the program is valid");
        let program = compile(&module, stage, None, &Options::default()).expect("the program compiles");
        let bindings = [vec![Resource::None]];
        let resources = Resources { bindings: &bindings, ..Resources::default() };
        let uniforms = program.uniforms(&resources);
        let mut executor = Executor::new();
        let mut bound = executor.bind(&program, &resources, &uniforms);
        assert_eq!(bound.program().interface().entry, "main");
        let fault = match stage {
            Stage::Compute => bound.run_groups(0..1, [1; 3], None).expect_err("it never ends"),
            _ => bound.run_recorded(1, 0, &mut Recorder::new()).expect_err("it never ends"),
        };
        assert_eq!(fault.place.and_then(|place| place.line()), Some(3), "{fault}");
    }
}
