//! A draw that is prepared: everything but its vertices and the values of its uniforms.

use std::rc::Rc;

use gfx::state::*;
use gl_shader::key::*;
use num::*;

use crate::gl::card::pass::{Layouts, PipelineState, Target};
use crate::gl::geometry::pack::Packing;
use crate::gl::geometry::primitive::{Class, SentAttributes};
use crate::gl::geometry::summary::Summary;
use crate::gl::state::arb::ActiveProgram;
use crate::gl::state::placement::VertexStreams;

/// What uniforms hold of how a texture is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Sampling {
    /// Bias of the level of detail.
    pub bias: f32,
    /// Border colour, in the format of the texels.
    pub border: [f32; 4],
}

/// A prepared draw.
pub struct Prepared {
    /// What it draws to.
    pub target: Target,
    /// The key of its shader.
    pub key: ShaderKey,
    /// Its vertex and its fragment program.
    pub programs: [Option<ActiveProgram>; 2],
    /// How its textures are sampled.
    pub sampling: Vec<Sampling>,
    /// The layout of its vertices.
    pub packing: Rc<Packing>,
    /// The vertex buffers of a draw from buffer objects.
    pub streams: Option<VertexStreams>,
    /// The state of its pipeline.
    pub fixed: PipelineState,
    /// The buffers that it may write, as [`crate::gl::card::pass::writes`] has them.
    pub writes: u8,
    /// Its textures, each with its view and sampler.
    pub bound: Vec<(TextureId, ViewId, SamplerId)>,
    /// Viewport.
    pub viewport: Viewport,
    /// Scissor.
    pub scissor: Rect,
    /// Blend constant.
    pub blend: [f32; 4],
}

/// Layouts of vertices: for which summary, class and attributes that are sent; in a buffer; and of the buffers.
pub type Packings = Vec<((Summary, Class, Option<SentAttributes>), Rc<Packing>, Layouts)>;

/// The colours that the fragments of a rectangle have.
#[derive(Clone, Copy, Debug)]
pub struct PixelRectangle {
    /// Texture, view, sampler.
    pub bound: (TextureId, ViewId, SamplerId),
    /// The lower left corner in the window, and the zoom (window pixels for one source pixel); the first pixel of the source, and the
    /// direction of its rows; scale and bias of colours.
    pub uniforms: [[f32; 4]; 4],
}
