//! The rules of a trace beyond its form: what the renderer may take for granted once a trace has passed.
//!
//! The rules are WebGPU's, with these differences: alignments that only matter to hardware (copy pitches, buffer offsets) are not
//! asked for; a depth range may be reversed; what can only be known with the shaders (derived layouts, what a shader binds) is
//! left to the shader compiler.

mod bind;
mod copy;
mod draw;
mod pass;
mod pipeline;
mod resource;
mod setup;
mod summary;
mod table;

use std::collections::BTreeSet;
use std::fmt::Display;

use gfx::format::Format;
use num::*;

use super::command::*;
use super::{Trace, TraceError};
use pass::{Bundle, Scope};
use table::Table;

use summary::Names;
pub use summary::Summary;

/// The rules of objects, as far as they follow from their descriptions: what an importer asks before it creates one.
pub mod rules {
    pub use super::bind::{bind_group_layout, pipeline_layout};
    pub use super::pipeline::{constants, render_pipeline};
    pub use super::resource::{query_set, sampler, texture, view};
}

/// Texels along an edge of a 1D or 2D texture, or pixels of a target, at most.
pub const TEXTURE_EDGE_MAX: u32 = 16_384;
/// Texels along an edge of a 3D texture, at most.
pub const TEXTURE_EDGE_3D_MAX: u32 = 2_048;
/// Layers of a texture at most.
pub const TEXTURE_LAYERS_MAX: u32 = 2_048;
/// Bytes of a buffer or texture at most: shaders and work count bytes inside of one in 32 bits.
pub const OBJECT_MAX: u64 = 4 << 30;
/// Colour targets of a pass at most.
pub const COLOR_TARGETS_MAX: usize = 8;
/// Bind groups of a pipeline at most.
pub const BIND_GROUPS_MAX: u32 = 8;
/// Elements of a binding array at most.
pub const BINDING_ARRAY_MAX: u32 = 65_536;
/// Vertex buffers of a pipeline at most.
pub const VERTEX_BUFFERS_MAX: u32 = 16;
/// Vertex attributes of a pipeline at most.
pub const VERTEX_ATTRIBUTES_MAX: usize = 32;
/// Bytes of immediates at most.
pub const IMMEDIATES_MAX: u32 = 4_096;
/// Queries of a set at most.
pub const QUERIES_MAX: u32 = 1 << 20;
/// Workgroups of a dispatch in each dimension at most.
pub const WORKGROUPS_MAX: u32 = 65_535;

/// Why a command is refused.
enum Reason {
    /// A rule is broken.
    Rule(String),
    /// A blob cannot be used.
    Blob(TraceError),
}

impl From<String> for Reason {
    fn from(reason: String) -> Reason {
        Reason::Rule(reason)
    }
}

impl From<&str> for Reason {
    fn from(reason: &str) -> Reason {
        Reason::Rule(reason.to_owned())
    }
}

impl From<TraceError> for Reason {
    fn from(error: TraceError) -> Reason {
        Reason::Blob(error)
    }
}

type CheckResult = Result<(), Reason>;

/// Fails with a formatted reason unless a condition holds.
macro_rules! ensure {
    ($condition:expr, $($reason:tt)+) => {
        if !$condition {
            return Err(format!($($reason)+).into());
        }
    };
}
use ensure;

/// Checks a whole trace: every command, and every blob that one uses.
pub fn check(trace: &Trace) -> Result<Summary, TraceError> {
    let mut checker = Checker::new(trace);
    trace.for_each_command(|index, command| checker.command(index, command))?;
    checker.finish()
}

/// A check that goes along with a replay: one call a command, in order.
pub struct Checker<'a> {
    trace: &'a Trace,
    summary: Summary,
    names: Names,
    /// Bytes of live buffers and textures.
    memory: u64,
    buffers: Table<u64>,
    textures: Table<TextureDesc>,
    views: Table<resource::View>,
    samplers: Table<()>,
    shaders: Table<()>,
    group_layouts: Table<bind::GroupLayout>,
    pipeline_layouts: Table<bind::PipelineLayout>,
    groups: Table<bind::Group>,
    render_pipelines: Table<pipeline::Render>,
    compute_pipelines: Table<pipeline::Compute>,
    bundles: Table<Bundle>,
    query_sets: Table<(QueryKind, u32)>,
    /// The view of each sprite that is shown.
    sprites: [Option<ViewId>; SPRITES as usize],
    /// The pass or bundle that is open.
    scope: Scope,
    /// The setup of a trace that was cut out of a longer one is open.
    setup: bool,
    debug_groups: u32,
    used_blobs: BTreeSet<String>,
    next: u64,
}

impl<'a> Checker<'a> {
    /// A check at the beginning of a trace.
    pub fn new(trace: &'a Trace) -> Checker<'a> {
        Checker {
            trace,
            summary: Summary::default(),
            names: Names::default(),
            memory: 0,
            buffers: Table::new("buffer"),
            textures: Table::new("texture"),
            views: Table::new("view"),
            samplers: Table::new("sampler"),
            shaders: Table::new("shader"),
            group_layouts: Table::new("bind group layout"),
            pipeline_layouts: Table::new("pipeline layout"),
            groups: Table::new("bind group"),
            render_pipelines: Table::new("render pipeline"),
            compute_pipelines: Table::new("compute pipeline"),
            bundles: Table::new("bundle"),
            query_sets: Table::new("query set"),
            sprites: [None; SPRITES as usize],
            scope: Scope::Outside,
            setup: false,
            debug_groups: 0,
            used_blobs: BTreeSet::new(),
            next: 0,
        }
    }

    /// Checks the next command. What passes ask for every draw is compiled where a replay calls it: this package is not optimised.
    #[inline]
    pub fn command(&mut self, index: u64, command: &Command) -> Result<(), TraceError> {
        self.names.count(command);
        self.next = index + 1;
        self.rule(command).map_err(|reason| match reason {
            Reason::Rule(reason) => self.trace.error_at(index, format!("{}: {reason}", command.name())),
            Reason::Blob(error) => error.in_command(index),
        })
    }

    /// Checks what must hold at the end, and answers what the trace holds.
    pub fn finish(mut self) -> Result<Summary, TraceError> {
        let open = self.scope.name().or_else(|| self.setup.then_some("setup"));
        if let Some(open) = open {
            let reason = format!("the trace ends inside a {open}");
            return Err(self.trace.error_at(self.next.saturating_sub(1), reason));
        }
        self.summary.finish(self.names);
        Ok(self.summary)
    }

    /// Counts a blob when it is used first.
    fn use_blob(&mut self, name: &str) {
        if !self.used_blobs.contains(name) {
            self.used_blobs.insert(name.to_owned());
            self.summary.blobs += 1;
            self.summary.blob_bytes += self.trace.blob_size(name).unwrap_or(0);
        }
    }

    #[inline]
    fn rule(&mut self, command: &Command) -> CheckResult {
        use Command::*;
        if self.setup {
            self.inside_setup(command)?;
        }
        match command {
            // Creation and destruction are allowed everywhere: they are no part of a pass.
            CreateBuffer { id, size, .. } => self.create_buffer(*id, *size),
            CreateTexture { id, desc, .. } => self.create_texture(*id, desc),
            CreateView { id, texture, desc } => self.create_view(*id, *texture, desc),
            CreateSampler { id, desc } => self.create_sampler(*id, desc),
            CreateShader { id, source, .. } => self.create_shader(*id, source),
            CreateBindGroupLayout { id, entries } => self.create_bind_group_layout(*id, entries),
            CreatePipelineLayout { id, groups, immediate_size } => self.create_pipeline_layout(*id, groups, *immediate_size),
            CreateBindGroup { id, layout, entries } => self.create_bind_group(*id, *layout, entries),
            CreateRenderPipeline { id, desc, .. } => self.create_render_pipeline(*id, desc),
            CreateComputePipeline { id, layout, stage, .. } => self.create_compute_pipeline(*id, *layout, stage),
            GetBindGroupLayout { id, pipeline, group } => self.get_bind_group_layout(*id, *pipeline, *group),
            CreateQuerySet { id, kind, count } => self.create_query_set(*id, *kind, *count),
            Destroy(object) => self.destroy(*object),

            PushDebugGroup(_) => {
                self.debug_groups += 1;
                Ok(())
            }
            PopDebugGroup => {
                ensure!(self.debug_groups > 0, "no debug group is open");
                self.debug_groups -= 1;
                Ok(())
            }
            InsertDebugMarker(_) | SetCallSite(_) => Ok(()),

            BeginSetup => self.begin_setup(),
            EndSetup { .. } | SkipAddresses { .. } | RestoreTexture { .. } | RestoreQueries { .. } => self.setup(command),

            WriteBuffer { .. }
            | WriteTexture { .. }
            | CopyBufferToBuffer { .. }
            | CopyBufferToTexture { .. }
            | CopyTextureToBuffer { .. }
            | CopyTextureToTexture { .. }
            | ClearBuffer { .. }
            | ClearTexture { .. }
            | ResolveQuerySet { .. }
            | SetSprite { .. }
            | Present { .. } => {
                if let Some(open) = self.scope.name() {
                    return Err(format!("not allowed inside a {open}").into());
                }
                self.between_passes(command)
            }

            // wgpu's time stamps may also be written inside passes.
            WriteTimestamp { set, index } => {
                ensure!(!matches!(self.scope, Scope::Bundle(_)), "not allowed inside a bundle");
                self.query(*set, *index, |kind| kind == QueryKind::Timestamp)
            }

            BeginRenderPass { color, depth, occlusion, timestamps, .. } => {
                self.begin_render_pass(color, depth.as_ref(), *occlusion, timestamps.as_ref())
            }
            BeginComputePass { timestamps, .. } => self.begin_compute_pass(timestamps.as_ref()),
            BeginBundle { id } => self.begin_bundle(*id),
            EndRenderPass => self.end_render_pass(),
            EndComputePass => self.end_compute_pass(),
            EndBundle => self.end_bundle(),

            _ => self.inside_pass(command),
        }
    }
}

/// Whether two formats differ in nothing but the sRGB transfer function.
fn same_but_srgb(a: Format, b: Format) -> bool {
    a == b || a.name().trim_end_matches("-srgb") == b.name().trim_end_matches("-srgb")
}

/// The end of a range, or why it does not fit into `length`.
#[inline]
fn range_fits(what: &dyn Display, offset: u64, size: u64, length: u64) -> Result<(), String> {
    match offset.checked_add(size) {
        Some(end) if end <= length => Ok(()),
        _ => Err(format!("bytes {offset} + {size} reach past the {length} of {what}")),
    }
}

/// The size of a range that may be left open.
#[inline]
fn open_range(what: &dyn Display, offset: u64, size: Option<u64>, length: u64) -> Result<u64, String> {
    let size = size.unwrap_or(length.saturating_sub(offset));
    range_fits(what, offset, size, length).map(|()| size)
}
