//! Programs in WGSL of one expression, run on many operands at once.

use anyhow::{Result, anyhow};

use num::Words;
use shader::{BufferRange, Executor, Module, ModuleSource, Options, Program, Resource, Resources, Stage, compile};

/// Invocations of a workgroup: operands come in a multiple of as many.
pub const GROUP: usize = 64;

/// Compiles `result = EXPRESSION`, a word made of the operands, which are `a`, `b` and `c` as numbers, `x`, `y` and `z` as words, `i`,
/// `j` and `k` as signed words.
pub fn program(expression: &str) -> Result<Program> {
    let source = format!(
        "enable f16;
         @group(0) @binding(0) var<storage, read_write> result: array<u32>;
         @group(0) @binding(1) var<storage, read> one: array<u32>;
         @group(0) @binding(2) var<storage, read> two: array<u32>;
         @group(0) @binding(3) var<storage, read> three: array<u32>;
         @compute @workgroup_size({GROUP}) fn main(@builtin(global_invocation_id) id: vec3u) {{
             let x = one[id.x]; let y = two[id.x]; let z = three[id.x];
             let a = bitcast<f32>(x); let b = bitcast<f32>(y); let c = bitcast<f32>(z);
             let i = bitcast<i32>(x); let j = bitcast<i32>(y); let k = bitcast<i32>(z);
             result[id.x] = {expression};
         }}"
    );
    let module = Module::new(expression, ModuleSource::Wgsl(&source)).map_err(|error| anyhow!("{expression}: {error}"))?;
    compile(&module, Stage::Compute, None, &Options::default()).map_err(|error| anyhow!("{expression}: {error}"))
}

/// Runs a program on operands.
///
/// # Panics
/// If they are no multiple of [`GROUP`].
pub fn run(program: &Program, operands: &[[u32; 3]]) -> Result<Vec<u32>> {
    assert!(operands.len().is_multiple_of(GROUP), "operands come in whole workgroups");
    let buffers: [Words; 4] = std::array::from_fn(|buffer| {
        let words = Words::new(4 * operands.len() as u64);
        if let Some(k) = buffer.checked_sub(1) {
            operands.iter().enumerate().for_each(|(i, operands)| words.store(i, operands[k]));
        }
        words
    });
    let bindings: Vec<Vec<Resource<'_>>> = program
        .interface()
        .bindings
        .iter()
        .map(|b| {
            let words = &buffers[b.binding as usize];
            vec![Resource::Buffer(BufferRange { words, offset: 0, size: words.len(), address: 0 })]
        })
        .collect();
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = program.uniforms(&resources);
    let mut executor = Executor::new();
    let groups = (operands.len() / GROUP) as u32;
    executor.bind(program, &resources, &uniforms).run_groups(0..groups.into(), [groups, 1, 1], None)?;
    Ok((0..operands.len()).map(|i| buffers[0].load(i)).collect())
}
