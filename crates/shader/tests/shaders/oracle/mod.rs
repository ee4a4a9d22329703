//! The oracle: what a shader program means, found in the plainest way.
//!
//! It walks the tree of naga's IR, one invocation at a time, and shares no code with the compiler and the executor. It knows no
//! registers, no masks, no lanes in step and no optimisation. Every number carries its type, so that a mistake in the types ends
//! in a fault and not in wrong bits.
//!
//! # How to use it
//! Resolve the pipeline constants first (`naga::back::pipeline_constants::process_overrides`). Fill [`Bindings`] with bytes as
//! the host would. [`run_compute`] runs a dispatch; [`run_batch`] runs up to 64 invocations of a vertex or fragment stage. Both
//! leave what the program wrote in the bindings.
//!
//! # Order
//! Invocations run one after the other, in the order of their index, each until it ends or waits for others: at a barrier, a
//! subgroup operation, a derivative or a sample with an implicit level. Those that wait at the same place (the same statement,
//! in the same turn of every loop around it) go on together; the place that comes first in the program's text goes on first.
//! So invocations that took different branches meet again after them. A program with data races, or one that uses the order
//! of atomics, means nothing certain: compare none.
//!
//! # Where WGSL leaves the choice
//! * An index out of the bounds of a vector, a matrix or a sized array takes the last element; a negative one too.
//! * An index out of a runtime-sized array: reads zero, writes nothing. Its offset in bytes wraps in 32 bits.
//! * Memory outside a bound buffer or texture reads as zero; writes there have no effect. An element out of the bounds of a
//!   binding array is the last one.
//! * Workgroup memory starts as zeros, as do variables without an initial value.
//! * A discarded invocation goes on as a helper. A helper leaves nothing in memory; its atomics give zero.
//!   Where all of a quad are discarded, all of it ends.
//! * A subgroup is 64 invocations with neighbouring indices; in it, helpers take part. To shuffle from an invocation that does
//!   not take part gives zero.
//! * Arithmetic: each operation is rounded once, to nearest even, and keeps subnormal numbers. `f16` is computed in `f32` and
//!   rounded. `dot` and products of matrices add from the first component on; `fma` rounds twice; `mix` is `x * (1 - t) + y * t`.
//!   Transcendental functions are those of `gfx::math`, whose accuracy has tests of its own.
//!   `pow` with a constant whole exponent up to 64 is a product. The compiler may find more constants than stand in the program
//!   (a variable that only ever held one): let the exponent be a literal, or come from memory.
//! * A derivative without a stated precision is a fine one.
//! * Which NaN an operation gives is not told: compare any two NaN as equal.

#![allow(dead_code, reason = "each of the tests that include it uses a part")]

mod bits;
mod builtins;
mod entry;
mod expressions;
mod geometry;
mod groups;
mod machine;
mod memory;
mod number;
mod statements;
mod textures;
mod value;

use std::collections::BTreeMap;

use gfx::image::ImageDesc;
use gfx::state::SamplerDesc;
use gfx::texture::ViewRange;

/// Invocations of a batch and of a subgroup.
pub const LANES: usize = 64;

/// What connects an input or output with the rest of the pipeline. A `Position` is always written with `invariant: false`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Io {
    /// `@location`; `second` is `@blend_src(1)`.
    Location { location: u32, second: bool },
    /// `@builtin`
    BuiltIn(naga::BuiltIn),
}

impl Io {
    /// A location of the first source.
    pub fn location(location: u32) -> Io {
        Io::Location { location, second: false }
    }
}

/// A texture with the part of it that is bound.
#[derive(Clone, Debug)]
pub struct Texture {
    /// Its shape.
    pub desc: ImageDesc,
    /// What is bound. A storage texture is one level.
    pub range: ViewRange,
    /// Its texels, encoded and ordered as `gfx::image` says (a level is padded to 16 bytes).
    pub bytes: Vec<u8>,
}

/// Something bound.
#[derive(Clone, Debug)]
pub enum Resource {
    /// A uniform or storage buffer.
    Buffer(Vec<u8>),
    /// A sampled or storage texture.
    Texture(Texture),
    /// A sampler.
    Sampler(SamplerDesc),
}

/// All that a program is bound to.
#[derive(Clone, Debug, Default)]
pub struct Bindings {
    /// By group and binding: one resource, or those of a binding array. What is not here is not bound.
    pub resources: BTreeMap<(u32, u32), Vec<Resource>>,
    /// Immediates; missing ones are zero.
    pub immediates: Vec<u32>,
}

impl Bindings {
    /// Binds a buffer.
    pub fn set_buffer(&mut self, group: u32, binding: u32, bytes: Vec<u8>) {
        self.resources.insert((group, binding), vec![Resource::Buffer(bytes)]);
    }

    /// The bytes of a buffer, if one is bound.
    pub fn buffer(&self, group: u32, binding: u32) -> Option<&[u8]> {
        match self.resources.get(&(group, binding))?.first()? {
            Resource::Buffer(bytes) => Some(bytes),
            _ => None,
        }
    }
}

/// Why a run was given up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// More statements ran than were allowed: the program may never end.
    Steps,
    /// The specification gives this program no meaning (a barrier that only some reach). Compare nothing.
    Undefined(String),
    /// The oracle does not know this. Nothing that the engine runs may end here.
    Unsupported(String),
}

/// Up to 64 invocations of a vertex or fragment stage; four neighbouring ones of a fragment stage are a quad.
#[derive(Clone, Debug, Default)]
pub struct Batch {
    /// Invocations that count.
    pub active: u64,
    /// Invocations that only take part in derivatives.
    pub helpers: u64,
    /// By connection: for each component, the 32 bits of each invocation. A `bool` is 0 or 1, an `f16` the `f32` of its value. A
    /// missing input is zero, `subgroup_invocation_id` the number of the invocation. An array (clip distances) has a component for each element.
    pub inputs: BTreeMap<Io, Vec<[u32; LANES]>>,
}

/// What a batch leaves.
#[derive(Clone, Debug, Default)]
pub struct BatchResult {
    /// Invocations that were active and not discarded.
    pub live: u64,
    /// As [`Batch::inputs`]. Only the bits of live invocations mean anything.
    pub outputs: BTreeMap<Io, Vec<[u32; LANES]>>,
}

/// Runs a compute entry point for all workgroups of a dispatch, the first dimension fastest. `steps` bounds the statements and
/// expressions of all invocations together.
///
/// # Errors
/// See [`Fault`]; what the program wrote before stays in the bindings.
pub fn run_compute(
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    entry: &str,
    groups: [u32; 3],
    bindings: &mut Bindings,
    steps: u64,
) -> Result<(), Fault> {
    entry::run_compute(module, info, entry, groups, bindings, steps)
}

/// Runs a batch of a vertex or fragment entry point.
///
/// # Errors
/// As [`run_compute`].
pub fn run_batch(
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    stage: naga::ShaderStage,
    entry: &str,
    batch: &Batch,
    bindings: &mut Bindings,
    steps: u64,
) -> Result<BatchResult, Fault> {
    entry::run_batch(module, info, stage, entry, batch, bindings, steps)
}
