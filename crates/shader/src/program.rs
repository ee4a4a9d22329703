//! Compiled programs: a flat list of operations over a register file, with side tables for memory and texture accesses.

use std::ops::Range;

use super::code::Code;
use super::interface::Interface;
use super::module::ShaderLocation;
use super::scalar::Counted;
use work::{Class, InFlight};

/// Index of a register of a batch.
pub(super) type Reg = u16;

/// No register: an unused destination or an absent operand.
pub(super) const NO_REG: Reg = u16::MAX;

/// One operation. Which of `r` are destinations and which operands is stated by each code; control operations keep their jump
/// target in `imm` and mask slots in `r`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Op {
    pub code: Code,
    pub r: [Reg; 9],
    pub imm: u32,
}

/// What a memory access addresses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Space {
    /// A buffer binding: index in the interface's bindings.
    Buffer(u16),
    /// Workgroup memory.
    Shared,
    /// Immediates.
    Immediate,
}

/// How a component lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Width {
    /// 32 bits.
    Word,
    /// A 16-bit float, held as `f32` in registers.
    Half,
}

impl Width {
    /// Bytes of a component.
    pub fn bytes(self) -> u64 {
        match self {
            Width::Word => 4,
            Width::Half => 2,
        }
    }
}

/// A load or store of up to four consecutive components, or an atomic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct MemoryOp {
    pub space: Space,
    /// Element of the binding array, a register.
    pub element: Reg,
    /// Destinations of a load, sources of a store; atomics: result, value, comparand, exchanged flag.
    pub data: [Reg; 4],
    /// Components.
    pub count: u8,
    pub width: Width,
    /// Register with byte offsets, or none.
    pub address: Reg,
    /// Constant byte offset.
    pub offset: u32,
    /// All lanes have the same address.
    pub uniform: bool,
    /// A load from a uniform buffer.
    pub constant: bool,
    pub atomic: AtomicOp,
}

/// Components of loads from a buffer at places that are known when the program is compiled: they go to registers with consecutive numbers.
#[derive(Clone, Debug)]
pub(super) struct Placed {
    /// The first register.
    pub register: Reg,
    /// Index in the interface's bindings.
    pub binding: u16,
    /// Byte offset of the first component; the others follow without gaps.
    pub offset: u64,
    pub width: Width,
    /// Number of components.
    pub count: u16,
    /// Which words of the binding they are, where they are whole words.
    pub words: Option<Range<u32>>,
}

/// What an atomic does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum AtomicOp {
    Add,
    Sub,
    And,
    Or,
    Xor,
    MinS,
    MinU,
    MaxS,
    MaxU,
    Exchange,
    CompareExchange,
    AddF,
    SubF,
}

/// Which level a texture is sampled at.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Level {
    /// From differences inside the quad.
    Auto,
    /// The same, with a bias.
    Bias,
    /// Level 0.
    Zero,
    /// Explicit.
    Exact,
    /// From explicit gradients.
    Gradient,
}

/// What a texture access does.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum TextureAction {
    /// Filtered; with a reference value: compared.
    Sample(Level),
    /// Four texels of one component; with a reference value: compared.
    Gather(u8),
    /// One texel, unfiltered.
    Load,
    /// One texel written.
    Store,
    /// One texel changed.
    Atomic(AtomicOp),
    /// Width, height, depth of a level.
    Size,
    /// Number of levels.
    Levels,
    /// Number of layers.
    Layers,
    /// Number of samples.
    Samples,
}

/// A texture access.
#[derive(Clone, Copy, Debug)]
pub(super) struct TextureOp {
    pub action: TextureAction,
    /// Binding of the texture.
    pub texture: u16,
    /// Element of the texture's binding array.
    pub texture_element: Reg,
    /// Binding of the sampler.
    pub sampler: u16,
    pub sampler_element: Reg,
    /// Results, or sources of a store or atomic.
    pub data: [Reg; 4],
    pub coordinate: [Reg; 3],
    pub layer: Reg,
    /// Layers above the greatest `i32` are layers, not negative numbers.
    pub unsigned_layer: bool,
    pub sample: Reg,
    /// Level, or bias.
    pub level: Reg,
    pub gradient_x: [Reg; 3],
    pub gradient_y: [Reg; 3],
    pub reference: Reg,
    pub offset: [i8; 3],
    pub clamp_to_edge: bool,
}

/// A subgroup operation; a subgroup is a batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum SubgroupOp {
    Ballot,
    All,
    Any,
    BroadcastFirst,
    Broadcast,
    Shuffle,
    ShuffleDown,
    ShuffleUp,
    ShuffleXor,
    QuadBroadcast,
    QuadSwap(u8),
    Reduce(Fold),
    Inclusive(Fold),
    Exclusive(Fold),
}

/// The operation of a reduction.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Fold {
    AddI,
    AddF,
    MulI,
    MulF,
    MinS,
    MinU,
    MinF,
    MaxS,
    MaxU,
    MaxF,
    And,
    Or,
    Xor,
}

/// A list of operations with its side tables.
#[derive(Clone, Debug, Default)]
pub(super) struct Body {
    pub ops: Vec<Op>,
    pub memory: Vec<MemoryOp>,
    pub textures: Vec<TextureOp>,
    pub subgroup: Vec<SubgroupOp>,
    /// Constants indexed at run time.
    pub table: Vec<u32>,
    /// Registers in the file.
    pub registers: usize,
    /// Mask slots, those that count loop iterations included.
    pub slots: usize,
    /// First slot that counts a loop's iterations.
    pub first_counter: usize,
    /// Places of loops, by number.
    pub loops: Vec<Option<ShaderLocation>>,
    /// Line of the source of each operation, from 1; 0 where that is not known.
    pub lines: Vec<u32>,
    /// Running instruction counts: entry `i` counts operations before `i`.
    pub counts: Vec<Counted>,
    /// The same of instructions that work on four components.
    pub vectors: Vec<Counted>,
    /// Where a block begins with operation `i`, how many requests may be unanswered there.
    pub in_flight: Vec<InFlight>,
    /// Running sum of steps ([`Code::steps`]): entry `i` counts operations before `i`.
    pub steps: Vec<u64>,
    /// Turns that a loop may make between its entry and its end.
    pub loop_turns: u64,
}

/// A compiled entry point.
#[derive(Clone, Debug)]
pub struct Program {
    pub(super) module: String,
    pub(super) interface: Interface,
    /// Number of uniforms: the first registers of the body.
    pub(super) uniforms: usize,
    /// Uniforms that are loaded from buffers at places that are known: the register of each is its number.
    pub(super) placed_uniforms: Vec<Placed>,
    /// What the prologue reads from such places, and how many loads these and those of uniforms were.
    pub(super) placed: Vec<Placed>,
    pub(super) placed_loads: usize,
    /// Where the loads from storage buffers at known places are: a warp makes each of them.
    pub(super) shared_loads: Vec<(u16, u64)>,
    /// Instructions of the prologue without its loads: a warp executes each of them.
    pub(super) shared_counted: Counted,
    /// Computes the other uniforms, on one lane, once per draw.
    pub(super) prologue: Body,
    /// These, each with its register in the prologue.
    pub(super) computed_uniforms: Vec<(Reg, Reg)>,
    /// Constants of the prologue: its first registers.
    pub(super) prologue_constants: Vec<u32>,
    /// Constants of the body.
    pub(super) constants: Vec<u32>,
    /// The batch program. Registers: uniforms, then constants, then the rest.
    pub(super) body: Body,
    /// Bytes of workgroup memory as the executor lays it out.
    pub(super) shared_bytes: u32,
    /// Registers of each input's components.
    pub(super) inputs: Vec<Vec<Reg>>,
    /// Registers of each output's components.
    pub(super) outputs: Vec<Vec<Reg>>,
}

impl Body {
    /// Steps of all operations, each once.
    pub fn all_steps(&self) -> u64 {
        self.steps.last().copied().unwrap_or(0)
    }
}

impl Program {
    /// Steps of a batch of 64 invocations whose loops make one turn: each operation counts once.
    pub fn steps(&self) -> u64 {
        self.body.all_steps()
    }

    /// Steps of the prologue and of the loads before it, which run once per draw or dispatch for all invocations.
    pub fn uniform_steps(&self) -> u64 {
        self.prologue.all_steps()
    }

    /// Instructions by class of an invocation whose loops make one turn: each operation counts once.
    pub fn instructions(&self) -> [u32; Class::COUNT] {
        self.body.counts.last().map_or([0; Class::COUNT], |counted| counted.instructions)
    }

    /// Whether all invocations cost the same and make no memory request: there is no branch, and no request.
    pub fn is_straight(&self) -> bool {
        self.body.ops.iter().all(|op| !op.code.breaks_block() || op.code == Code::End)
    }

    /// Bytes of the registers of a batch of 64 invocations.
    pub fn register_bytes(&self) -> u64 {
        (self.body.registers * size_of::<num::Lanes>()) as u64
    }

    /// The interface of the program.
    pub fn interface(&self) -> &Interface {
        &self.interface
    }

    /// Name of the module it comes from.
    pub fn module(&self) -> &str {
        &self.module
    }

    /// Operations in the batch program and in the prologue that computes uniforms: a measure of the compiler, not of the card.
    pub fn operations(&self) -> (usize, usize) {
        (self.body.ops.len(), self.placed_loads + self.prologue.ops.len())
    }
}
