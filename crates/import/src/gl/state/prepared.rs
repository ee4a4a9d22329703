//! A draw that is prepared, so that others can use it.

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
    /// What it depends on.
    pub draw_key: DrawKey,
    /// Whether other draws may use it.
    pub reusable: bool,
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
    /// Its pipeline, once it is made.
    pub pipeline: Option<RenderPipelineId>,
    /// Its textures, each with its view and sampler.
    pub bound: Vec<(TextureId, ViewId, SamplerId)>,
    /// The group of its textures, once it is made.
    pub group: Option<BindGroupId>,
    /// Viewport.
    pub viewport: Viewport,
    /// Scissor.
    pub scissor: Rect,
    /// Blend constant.
    pub blend: [f32; 4],
    /// The uniforms of lighting, until a material changes.
    pub lit: Option<Vec<[f32; 4]>>,
    /// The memory of the last draw's uniforms, for reuse.
    pub block: Vec<u8>,
}

/// Maximum number of draws that are prepared for one state. Programs alternate between primitives that differ in the attributes that vary.
const DRAWS_MAX: usize = 4;

/// The draws that are prepared for the present state, the last one at the end.
#[derive(Default)]
pub struct PreparedDraws(Vec<Prepared>);

impl PreparedDraws {
    /// Discards all: something has changed that draws are prepared for.
    pub fn discard(&mut self) {
        self.0.clear();
    }

    /// Discards the uniforms of lighting: materials have changed.
    pub fn change_materials(&mut self) {
        self.0.iter_mut().for_each(|prepared| prepared.lit = None);
    }

    /// Takes out a draw, if one matches.
    pub fn take(&mut self, matches: impl Fn(&Prepared) -> bool) -> Option<Prepared> {
        let at = self.0.iter().rposition(matches)?;
        Some(self.0.remove(at))
    }

    /// Puts back a draw. One that no other draw may use discards all.
    pub fn put(&mut self, prepared: Prepared) {
        if !prepared.reusable {
            return self.discard();
        }
        if self.0.len() == DRAWS_MAX {
            self.0.remove(0);
        }
        self.0.push(prepared);
    }
}

/// The key of a prepared draw: all that it depends on, except state whose change discards it.
#[derive(Debug, PartialEq)]
pub struct DrawKey {
    /// Points, lines or triangles.
    pub class: Class,
    /// See [`crate::gl::geometry::primitive::Batch::polygon`].
    pub polygon: Option<bool>,
    /// How the card assembles vertices.
    pub topology: Option<Topology>,
    /// Whether the winding is reversed.
    pub turned: bool,
    /// Attributes that are sent in any case.
    pub sent: Option<SentAttributes>,
    /// Which attributes vary.
    pub summary: Summary,
    /// Whether the modelview matrix computes a w.
    pub projective: bool,
    /// Whether the texture matrix of a unit of the key is not the identity, and whether it computes a q: a bit each.
    pub matrices: [u8; 2],
    /// Whether colour material leaves materials as `glMaterial` set them, as long as the colour is the same: then no other draw is served.
    pub keeps_material: bool,
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
