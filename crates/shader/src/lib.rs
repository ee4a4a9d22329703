//! Floor 2: shaders. naga's IR to a register program of our own, run on 64 lanes at once.
//!
//! * [`Module`]: WGSL, SPIR-V or naga IR, parsed and validated.
//! * [`compile`]: an entry point with its pipeline constants becomes a [`Program`]: a flat list of operations on scalar
//!   registers of 64 lanes. Its [`Interface`] says what it needs.
//! * [`Executor`]: a thread's register file. [`Executor::bind`] joins it with a program, [`Resources`] and the [`Uniforms`] of
//!   a draw; [`BoundProgram::run`] runs a batch, [`BoundProgram::run_groups`] workgroups.
//! * [`Encloser`]: bounds of what a program leaves for inputs in given ranges, without running it.
//! * [`Recorder`]: what runs cost, for the simulated card; without one nothing is recorded and nothing spent on it.
//!
//! The order of a draw: `program.uniforms(&resources)` once; then on each thread `executor.bind(..)`, and for each batch
//! `input_mut`, `run`, `output`.
//!
//! Rules where WGSL leaves a choice: arithmetic as [`code`](self) says; out-of-bounds indices of sized arrays take the last
//! element; reads outside a bound buffer give zero and writes are dropped (offsets in runtime-sized arrays wrap in 32 bits);
//! derivatives without a stated precision are fine ones; a discarded lane goes on as a helper; a subgroup is a batch of 64;
//! workgroup memory starts as zeros.
//!
//! # Example
//!
//! ```
//! use num::Lanes;
//! use shader::{Executor, Module, ModuleSource, Options, Resources, Stage, compile};
//!
//! let text = "@fragment fn main(@location(0) x: f32) -> @location(0) vec4f { return vec4f(x, 2 * x, 0, 1); }";
//! let module = Module::new("double", ModuleSource::Wgsl(text))?;
//! let program = compile(&module, Stage::Fragment, None, &Options::default())?;
//!
//! let resources = Resources::default();
//! let uniforms = program.uniforms(&resources);
//! let mut executor = Executor::new();
//! let mut batch = executor.bind(&program, &resources, &uniforms);
//! *batch.input_mut(0, 0).expect("the program reads x") = Lanes::splat_f32(0.25);
//! batch.run(!0, 0)?;
//! assert_eq!(batch.output(0, 1).f32(), &[0.5; 64]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod assemble;
mod bounds;
mod code;
mod compile;
mod exec;
mod extent;
mod graph;
mod interface;
mod ir;
mod live;
mod lower;
mod module;
mod nesting;
mod optimize;
mod options;
mod program;
mod resources;
mod scalar;
mod spirv;
mod tokens;
mod types;
mod unsupported;
mod vector;
mod wgsl;
mod zeros;

#[cfg(test)]
mod tests;

pub use bounds::{Encloser, Range};
pub use compile::compile;
pub use exec::{
    BoundProgram, ExceededLimit, Executor, Extra, InputRegister, QuadCost, Recorder, ShaderFault, Survivors, Uniforms,
};
pub use gfx::stage::Stage;
pub use interface::*;
pub use module::{Module, ModuleSource, ShaderError, ShaderLocation};
pub use options::{Fault, Optimisations, Options};
pub use program::Program;
pub use resources::{BufferRange, Resource, Resources, StorageImage};
