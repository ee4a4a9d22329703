//! A render pass: its attachments, and draws into them.

use std::sync::{Arc, Mutex};

use crate::surface::{Shape, TileSurface};
use gfx::format::Format;
use host::one_line;
use num::{LimitExceeded, LimitOverrun};
use shader::{ShaderFault, Uniforms};
use work::Event;

use super::fragments::Images;
use super::frame::{PreparedDraw, Workers};
use super::geometry::{Segments, Stages, plan};
use super::record;
use super::settings::{Attachments, Settings};
use super::tile::MAX_COLORS;
use super::{DrawCall, Drawn};

/// Why a draw cannot be done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DrawError {
    /// Pipeline and pass do not fit each other.
    #[error("render pipeline `{}`: {message}", one_line(.label))]
    Pipeline {
        /// The pipeline's label.
        label: String,
        /// What does not fit.
        message: String,
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
    #[error("{0}")]
    Memory(String),
}

impl From<DrawError> for String {
    fn from(error: DrawError) -> String {
        error.to_string()
    }
}

/// Scratch of a draw's stages; what one draw allocated serves the next.
struct Scratch {
    workers: Workers,
    stages: Stages,
    uniforms: [Uniforms; 2],
}

/// Scratch that no pass uses at the moment: passes come one after the other, and fresh memory costs page faults.
static IDLE: Mutex<Vec<Scratch>> = Mutex::new(Vec::new());

impl Scratch {
    fn take() -> Box<Scratch> {
        let idle = IDLE.lock().unwrap_or_else(std::sync::PoisonError::into_inner).pop();
        let fresh = || Scratch { workers: Workers::new(), stages: Stages::default(), uniforms: <[Uniforms; 2]>::default() };
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
    scratch: Box<Scratch>,
    /// The settings of the last draw.
    settings: Option<Arc<Settings>>,
}

/// The attachments of a pass that has ended.
#[derive(Debug)]
pub struct EndedPass {
    /// Colour attachments by location.
    pub color: Vec<Option<TileSurface>>,
    /// Depth and stencil.
    pub depth: Option<TileSurface>,
}

/// The settings of a call with these attachments. Reuses `last`, the settings of the draw before it, if they fit the call.
fn resolve(last: Option<Arc<Settings>>, call: &DrawCall<'_>, attachments: &Attachments) -> Result<Arc<Settings>, DrawError> {
    if attachments.color.len() > MAX_COLORS {
        return Err(DrawError::Attachments(attachments.color.len()));
    }
    match last.filter(|settings| settings.fit(call)) {
        Some(settings) => Ok(settings),
        None => Ok(Arc::new(Settings::new(call, attachments)?)),
    }
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
        RenderPass { attachments, images: Images { color, depth, tiles }, scratch: Scratch::take(), settings: None }
    }

    /// Draws. With `call.record` the draw and its segments go to `sink`, in order.
    ///
    /// # Errors
    /// If pipeline and attachments do not fit each other, or a shader does not end.
    pub fn draw(&mut self, call: &DrawCall<'_>, sink: &mut dyn FnMut(Event)) -> Result<Drawn, DrawError> {
        let RenderPass { attachments, images, scratch, settings: last } = self;
        let Scratch { workers, stages, uniforms } = &mut **scratch;
        let settings = resolve(last.take(), call, attachments)?;
        let frame = PreparedDraw::new(call, &settings, uniforms);
        let culling = plan(call, &frame, &mut stages.planner)?;
        if call.record {
            sink(Event::Draw(Arc::new(record::draw(call, &frame, attachments.depth.is_some(), culling))));
        }
        let mut segments = Segments::new(call, &frame, images.tiles);
        let mut drawn = Drawn::default();
        while let Some(made) = segments.next(call, &frame, workers, stages)? {
            drawn += images.fragments(call, &frame, workers, stages, made, sink)?;
        }
        *last = Some(settings);
        Ok(drawn)
    }

    /// Ends the pass and gives its attachments back.
    pub fn end(self) -> EndedPass {
        self.scratch.give();
        let Images { color, depth, .. } = self.images;
        EndedPass { color: color.into_iter().map(|c| c.map(|(surface, _)| surface)).collect(), depth }
    }
}
