//! Programs in WGSL, run and compared with what they must compute.

mod bounds;
mod builtins;
mod control;
mod fragment;
mod memory;
mod modules;
mod random;
mod special;

use super::*;
use num::{Limits, Words};

/// Compiles the only compute entry point.
fn program(source: &str) -> Program {
    let module = Module::new("test", ModuleSource::Wgsl(source)).unwrap_or_else(|e| panic!("{e}"));
    compile(&module, Stage::Compute, None, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Buffers bound to a program, by binding number of group 0.
fn run_with(program: &Program, groups: [u32; 3], buffers: &[(u32, &Words)]) {
    let bindings: Vec<Vec<Resource<'_>>> = program
        .interface()
        .bindings
        .iter()
        .map(|b| {
            let (_, words) = buffers.iter().find(|(n, _)| *n == b.binding).expect("the binding is given");
            vec![Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 })]
        })
        .collect();
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(program, &resources, &uniforms);
    let n = groups.iter().map(|&g| u64::from(g)).product();
    bound.run_groups(0..n, groups, None).unwrap_or_else(|e| panic!("{e}"));
}

fn words_of(data: &[u32]) -> Words {
    let words = Words::new(4 * data.len() as u64);
    for (i, &d) in data.iter().enumerate() {
        words.store(i, d);
    }
    words
}

/// Runs a body for 64 invocations: `x` is the invocation's `input` and `r` what it leaves.
fn each_u32(body: &str, input: impl Fn(u32) -> u32) -> Vec<u32> {
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
         @group(0) @binding(1) var<storage, read> input: array<u32>;
         @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{
             let i = id.x; let x = input[i]; var r = 0u;
             {body}
             result[i] = r;
         }}"
    );
    each(&source, input)
}

/// Runs a whole program on 64 inputs (binding 1); the results (binding 0).
fn each(source: &str, input: impl Fn(u32) -> u32) -> Vec<u32> {
    let p = program(source);
    let out = Words::new(256);
    let inp = words_of(&(0..64).map(input).collect::<Vec<_>>());
    run_with(&p, [1, 1, 1], &[(0, &out), (1, &inp)]);
    (0..64).map(|i| out.load(i)).collect()
}
