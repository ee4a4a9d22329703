//! The interface of a compiled entry point: bindings, inputs, outputs, flags.

use gfx::format::Format;
use gfx::stage::Stage;
use gfx::state::ViewDimension;

/// The stage of naga's name for it; none for those that are not implemented (task, mesh, ray tracing).
pub(super) fn stage_of(stage: naga::ShaderStage) -> Option<Stage> {
    Stage::ALL.into_iter().find(|&known| naga_stage(known) == stage)
}

/// Naga's name for a stage.
pub(super) fn naga_stage(stage: Stage) -> naga::ShaderStage {
    match stage {
        Stage::Vertex => naga::ShaderStage::Vertex,
        Stage::Fragment => naga::ShaderStage::Fragment,
        Stage::Compute => naga::ShaderStage::Compute,
    }
}

/// How the 32 bits of a value are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scalar {
    /// `f32`, or an `f16` held as the `f32` of the same value.
    Float,
    /// `u32`
    Uint,
    /// `i32`
    Sint,
    /// 0 or 1.
    Bool,
}

/// How a varying is interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Perspective-correct.
    Perspective,
    /// Linear in window space.
    Linear,
    /// The provoking vertex's value.
    Flat,
}

/// Where a varying is interpolated.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Sampling {
    /// At the pixel's centre.
    Center,
    /// At a covered place of the pixel.
    Centroid,
    /// At each sample; the stage then runs once per sample.
    Sample,
}

/// A value whose meaning the pipeline defines, not the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BuiltIn {
    /// Vertex stage, out: clip position. Fragment stage, in: x, y in pixels, depth, 1/w.
    Position,
    /// Vertex stage, in.
    VertexIndex,
    /// Vertex stage, in.
    InstanceIndex,
    /// Vertex stage, in: first vertex of the draw.
    BaseVertex,
    /// Vertex stage, in: first instance of the draw.
    BaseInstance,
    /// Vertex stage, in: number of the draw in a multi-draw.
    DrawIndex,
    /// Vertex stage, out; ignored (points are one pixel).
    PointSize,
    /// Vertex stage, out: up to 8 distances.
    ClipDistances,
    /// Fragment stage, in: 1 for front faces.
    FrontFacing,
    /// Fragment stage, in.
    PrimitiveIndex,
    /// Fragment stage, in: number of the sample; the stage then runs once per sample.
    SampleIndex,
    /// Fragment stage, in and out: bits of covered samples.
    SampleMask,
    /// Fragment stage, out.
    FragDepth,
    /// Fragment stage, in: weights of the three vertices.
    Barycentric {
        /// Perspective-correct, or linear in window space.
        perspective: bool,
    },
    /// Fragment stage, in: place inside a point.
    PointCoord,
    /// Compute stage, in.
    GlobalInvocationId,
    /// Compute stage, in.
    LocalInvocationId,
    /// Compute stage, in.
    LocalInvocationIndex,
    /// Compute stage, in.
    WorkGroupId,
    /// Compute stage, in.
    NumWorkGroups,
    /// In: invocations in a subgroup, always 64.
    SubgroupSize,
    /// In: place in the subgroup.
    SubgroupInvocationId,
    /// Compute stage, in.
    SubgroupId,
    /// Compute stage, in.
    NumSubgroups,
}

/// What a value of the interface is connected to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Connection {
    /// A user-defined attribute, varying or colour.
    Location {
        /// `@location`
        location: u32,
        /// How it is interpolated (varyings).
        interpolation: Interpolation,
        /// Where it is interpolated (varyings).
        sampling: Sampling,
        /// `@blend_src`: 1 for the second source of dual-source blending.
        blend_src: u32,
    },
    /// A built-in value.
    BuiltIn(BuiltIn),
}

/// One input or output.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Slot {
    /// What it is connected to.
    pub connection: Connection,
    /// Components, 1 to 4 (clip distances: to 8).
    pub components: u32,
    /// How the bits are to be read.
    pub scalar: Scalar,
    /// Inputs: whether the program reads it after dead code is removed; unread inputs need not be written. Outputs: true.
    pub used: bool,
}

impl Slot {
    /// The location, if it has one and belongs to the first source.
    pub fn location(&self) -> Option<u32> {
        match self.connection {
            Connection::Location { location, blend_src: 0, .. } => Some(location),
            _ => None,
        }
    }

    /// Whether it is this built-in.
    pub fn is_builtin(&self, builtin: BuiltIn) -> bool {
        self.connection == Connection::BuiltIn(builtin)
    }
}

/// The type of the texels of a sampled texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum SampleKind {
    /// `f32`
    Float,
    /// `u32`
    Uint,
    /// `i32`
    Sint,
    /// Depth, as one `f32`.
    Depth,
}

/// What is bound.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform {
        /// Bytes that the program's type needs at least (a runtime array counts one element).
        min_size: u64,
    },
    /// A storage buffer.
    Storage {
        /// Bytes that the program's type needs at least (a runtime array counts one element).
        min_size: u64,
        /// Whether it is declared `read_write`.
        writable: bool,
    },
    /// A sampled texture.
    Texture {
        /// Dimension of the view.
        dimension: ViewDimension,
        /// Whether it has several samples per texel.
        multisampled: bool,
        /// What texels give.
        sample: SampleKind,
    },
    /// A storage texture.
    StorageTexture {
        /// Dimension of the view.
        dimension: ViewDimension,
        /// Texel format.
        format: Format,
        /// Whether texels are read.
        readable: bool,
        /// Whether texels are written.
        writable: bool,
        /// Whether texels are changed by atomics.
        atomic: bool,
    },
    /// A sampler.
    Sampler {
        /// Whether it compares.
        comparison: bool,
    },
}

/// One binding.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Binding {
    /// `@group`
    pub group: u32,
    /// `@binding`
    pub binding: u32,
    /// What is bound.
    pub kind: BindingKind,
    /// Elements of a binding array (0: as many as are bound); none: not an array.
    pub count: Option<u32>,
    /// Whether the program writes it (stores or atomics that are still in the program).
    pub written: bool,
}

/// What a fragment stage that writes depth promises about it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum DepthPromise {
    /// Nothing.
    Any,
    /// Not less than the interpolated depth.
    GreaterEqual,
    /// Not more than the interpolated depth.
    LessEqual,
    /// The interpolated depth.
    Unchanged,
}

/// The interface of a compiled entry point.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Interface {
    /// The stage.
    pub stage: Stage,
    /// Name of the entry point.
    pub entry: String,
    /// Bindings that the entry point's code names (also where dead code drops the use), sorted by group and binding.
    /// `Resources::bindings` stand in this order.
    pub bindings: Vec<Binding>,
    /// Inputs by slot.
    pub inputs: Vec<Slot>,
    /// Outputs by slot.
    pub outputs: Vec<Slot>,
    /// Invocations of a workgroup along x, y, z (compute; else 1, 1, 1).
    pub workgroup_size: [u32; 3],
    /// Bytes of workgroup memory.
    pub workgroup_bytes: u32,
    /// Bytes of immediates read at most.
    pub immediate_bytes: u32,
    /// The 32-bit registers that an invocation occupies, without values that all invocations share.
    pub registers: u32,
    /// Uses derivatives, explicitly or through implicit texture levels: helper lanes matter.
    pub uses_derivatives: bool,
    /// May discard.
    pub discards: bool,
    /// Writes depth, with this promise.
    pub writes_depth: Option<DepthPromise>,
    /// Depth and stencil must be tested before the stage runs, whatever it does (`@early_depth_test(force)`).
    pub force_early_depth: bool,
    /// Writes the sample mask.
    pub writes_sample_mask: bool,
    /// Runs once per sample: reads the sample index, or has a varying interpolated per sample.
    pub per_sample: bool,
    /// Writes memory: stores or atomics in storage buffers or textures.
    pub side_effects: bool,
    /// Has workgroup barriers.
    pub barriers: bool,
    /// Uses subgroup operations.
    pub subgroups: bool,
}

impl Interface {
    /// The slot of an input built-in.
    pub fn input(&self, builtin: BuiltIn) -> Option<usize> {
        self.inputs.iter().position(|s| s.is_builtin(builtin))
    }

    /// The slot of an output built-in.
    pub fn output(&self, builtin: BuiltIn) -> Option<usize> {
        self.outputs.iter().position(|s| s.is_builtin(builtin))
    }

    /// The slot of an output location (first blend source).
    pub fn output_location(&self, location: u32) -> Option<usize> {
        self.outputs.iter().position(|s| s.location() == Some(location))
    }
}
