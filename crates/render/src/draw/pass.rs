//! A render pass: its attachments, and draws into them.

use std::sync::{Arc, Mutex};

use crate::ledger::TooMuchAlive;
use crate::pipeline::RenderPipeline;
use crate::surface::{Shape, TileSurface};
use gfx::format::Format;
use host::one_line;
use num::{LimitExceeded, LimitOverrun};
use shader::ShaderFault;
use work::Event;

use super::fragments::Images;
use super::geometry::{Segments, Stages, plan};
use super::record;
use super::state::{Attachments, DrawState};
use super::tile::MAX_COLORS;
use super::workers::Workers;
use super::{DrawCall, Drawn, DynamicState, OpenQueries, PassOptions};

/// Why a draw cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Pipeline and pass do not fit each other.
    #[error("render pipeline `{}`: {misfit}", one_line(.label))]
    Pipeline {
        /// The pipeline's label.
        label: String,
        /// What does not fit.
        misfit: Misfit,
    },
    /// Too many attachments.
    #[error("{0} colour attachments, at most {MAX_COLORS} are possible")]
    Attachments(usize),
    /// A shader was stopped.
    #[error(transparent)]
    Shader(#[from] ShaderFault),
    /// It asks for more than is allowed.
    #[error(transparent)]
    Limit(#[from] LimitExceeded),
    /// It came to more than is allowed.
    #[error(transparent)]
    Overrun(#[from] LimitOverrun),
    /// There is not as much memory as it asks for.
    #[error(transparent)]
    Memory(#[from] TooMuchAlive),
}

/// What of a pipeline does not fit the pass.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum Misfit {
    #[error("{pipeline} samples per pixel in a pass of {pass}")]
    Samples { pipeline: u32, pass: u32 },
    #[error("depth format {} in a pass with {}", .pipeline.name(), .pass.name())]
    DepthFormat { pipeline: Format, pass: Format },
    #[error("depth state in a pass without a depth attachment")]
    NoDepth,
    #[error("target {0} in a pass without such an attachment")]
    NoTarget(usize),
    #[error("target {location} is {} in a pass with {}", .pipeline.name(), .pass.name())]
    TargetFormat { location: usize, pipeline: Format, pass: Format },
}

/// Scratch of a draw's stages; what one draw allocated serves the next.
struct Scratch {
    workers: Workers,
    stages: Stages,
}

/// Scratch that no pass uses at the moment: passes come one after the other, and fresh memory costs page faults.
static IDLE: Mutex<Vec<Scratch>> = Mutex::new(Vec::new());

impl Scratch {
    fn take() -> Box<Scratch> {
        let idle = IDLE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).pop();
        let fresh = || Scratch { workers: Workers::new(), stages: Stages::default() };
        Box::new(idle.filter(|s| s.workers.suffice()).unwrap_or_else(fresh))
    }

    fn give(self: Box<Scratch>) {
        IDLE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).push(*self);
    }
}

/// A render pass between begin and end.
pub struct RenderPass {
    attachments: Attachments,
    images: Images,
    options: PassOptions,
    scratch: Box<Scratch>,
    /// The state of the last draw.
    state: Option<Arc<DrawState>>,
}

/// The attachments of a pass that has ended.
#[derive(Debug)]
pub struct EndedPass {
    /// Colour attachments by location.
    pub color: Vec<Option<TileSurface>>,
    /// Depth and stencil.
    pub depth: Option<TileSurface>,
}

impl RenderPass {
    /// Begins a pass on attachments of the given extent, loaded or cleared already. A colour attachment comes with the format it
    /// is seen in, which may differ in sRGB-ness from what is stored.
    pub fn begin(
        width: u32,
        height: u32,
        samples: u32,
        color: Vec<Option<(TileSurface, Format)>>,
        depth: Option<TileSurface>,
        options: PassOptions,
    ) -> RenderPass {
        let fits = |s: &TileSurface| matches!(s.shape(), Shape { width: w, height: h, samples: n, .. } if (w, h, n) == (width, height, samples));
        assert!(color.iter().flatten().all(|(s, _)| fits(s)) && depth.iter().all(fits), "attachments of one extent");
        let shaped = |(surface, format): &(TileSurface, Format)| (surface.shape(), *format);
        let attachments = Attachments {
            width,
            height,
            samples,
            color: color.iter().map(|color| color.as_ref().map(shaped)).collect(),
            depth: depth.as_ref().map(TileSurface::shape),
        };
        let tiles = Shape { format: Format::R8Unorm, width, height, samples }.tiles();
        RenderPass { attachments, images: Images { color, depth, tiles }, options, scratch: Scratch::take(), state: None }
    }

    /// The state of draws with this pipeline and dynamic state while these queries are open.
    ///
    /// # Errors
    /// If pipeline and attachments do not fit each other.
    pub fn state(
        &mut self,
        pipeline: &Arc<RenderPipeline>,
        dynamic: &DynamicState,
        queries: OpenQueries,
    ) -> Result<Arc<DrawState>, DrawError> {
        let RenderPass { attachments, options, state, .. } = self;
        if attachments.color.len() > MAX_COLORS {
            return Err(DrawError::Attachments(attachments.color.len()));
        }
        let next = DrawState::next(state.take(), pipeline, dynamic, queries, (attachments, options))?;
        Ok(state.insert(next).clone())
    }

    /// Draws a call with a [state](RenderPass::state) of this pass. If work is recorded, the draw and its segments go to `sink`, in order.
    ///
    /// # Errors
    /// If a shader does not end, or something asks for more than is allowed.
    pub fn draw(&mut self, call: &DrawCall<'_>, sink: &mut dyn FnMut(Event)) -> Result<Drawn, DrawError> {
        let RenderPass { images, scratch, .. } = self;
        let Scratch { workers, stages } = &mut **scratch;
        let culling = plan(call, &mut stages.planner)?;
        if let Some(state) = &call.recorded {
            sink(Event::Draw(Arc::new(record::draw(call, state, culling))));
        }
        let mut segments = Segments::new(call, images.tiles);
        let mut drawn = Drawn::default();
        while let Some(made) = segments.next(call, workers, stages)? {
            drawn += images.fragments(call, workers, stages, made, sink)?;
        }
        Ok(drawn)
    }

    /// Ends the pass and gives its attachments back.
    pub fn end(self) -> EndedPass {
        self.scratch.give();
        let Images { color, depth, .. } = self.images;
        EndedPass { color: color.into_iter().map(|c| c.map(|(surface, _)| surface)).collect(), depth }
    }
}
