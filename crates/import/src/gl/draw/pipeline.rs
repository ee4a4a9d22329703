//! State that is fixed in a pipeline: culling, depth and stencil tests, blending.

use gfx::format::Format;
use gfx::state::*;
use gl_shader::arb::program::Output;
use gl_shader::consts as e;
use gl_shader::key::{Expand, ShaderKey};

use crate::gl::call::{Fault, GlResult, INVALID_OPERATION};
use crate::gl::card::pass::{Layouts, PipelineState, Target, stored_channels};
use crate::gl::geometry::primitive::{Batch, Class, OFFSET_STEPS};
use crate::gl::machine::Gl;
use crate::gl::state::arb::ActiveProgram;
use crate::gl::state::fragments::{ColorWrites, Stencil, blend_factor, blend_operation, compare, stencil_operation};
use crate::gl::state::server::State;

/// Blend factors of the constant's alpha, and of its colour.
const ALPHAS: [u32; 2] = [e::CONSTANT_ALPHA, e::ONE_MINUS_CONSTANT_ALPHA];
const COLORS: [u32; 2] = [e::CONSTANT_COLOR, e::ONE_MINUS_CONSTANT_COLOR];

/// The source's factor of red, green and blue in the first colour buffer, if it and the destination's are of both kinds.
pub fn source_scale(state: &State) -> Option<[f32; 3]> {
    let ColorWrites { blended, factors: [source, destination, ..], ops: [op, _], .. } = state.color.writes[0];
    let mixed =
        ALPHAS.contains(&source) && COLORS.contains(&destination) || COLORS.contains(&source) && ALPHAS.contains(&destination);
    if !blended || !mixed || matches!(op, e::MIN | e::MAX) {
        return None;
    }
    let [r, g, b, a] = state.color.blend_constant;
    Some(match source {
        e::CONSTANT_COLOR => [r, g, b],
        e::ONE_MINUS_CONSTANT_COLOR => [1.0 - r, 1.0 - g, 1.0 - b],
        e::CONSTANT_ALPHA => [a; 3],
        _ => [1.0 - a; 3],
    })
}

/// Blend factors of the second source.
const SECOND: [u32; 4] = [e::SRC1_COLOR, e::SRC1_ALPHA, e::ONE_MINUS_SRC1_COLOR, e::ONE_MINUS_SRC1_ALPHA];

impl Stencil {
    /// The card's stencil state of this side.
    pub fn face(&self) -> GlResult<StencilFace> {
        let [fail, depth_fail, pass] = self.ops;
        Ok(StencilFace {
            compare: compare(self.compare),
            fail_op: stencil_operation(fail)?,
            depth_fail_op: stencil_operation(depth_fail)?,
            pass_op: stencil_operation(pass)?,
        })
    }
}

impl Gl {
    /// Whether shaders multiply the source's red, green and blue by its factor: one of the two factors is the constant's colour, the other
    /// is its alpha, and the card has one constant.
    pub fn scales_source(&self, target: Option<Target>) -> bool {
        let single = target.is_some_and(|target| target.more[0].is_none());
        single && !self.state.is(e::COLOR_LOGIC_OP) && source_scale(&self.state).is_some()
    }

    /// Whether blend factors use the constant's alpha and not its colour: then all channels of the card's constant are that alpha.
    pub fn constant_alpha(&self) -> bool {
        if self.scales_source(self.card.target()) {
            return ALPHAS.contains(&self.state.color.writes[0].factors[1]);
        }
        let uses = |factors: [u32; 2]| {
            let of = |writes: &ColorWrites| writes.factors[..2].iter().any(|factor| factors.contains(factor));
            self.state.color.writes.iter().any(of)
        };
        uses(ALPHAS) && !uses(COLORS)
    }

    /// The blending of a colour buffer.
    pub fn blending(&self, writes: &ColorWrites) -> GlResult<Option<Blend>> {
        if !writes.blended || self.state.is(e::COLOR_LOGIC_OP) {
            return Ok(None);
        }
        let alone = self.constant_alpha();
        let component = |src: u32, dst: u32, op: u32, alpha: bool| -> GlResult<BlendComponent> {
            let op = blend_operation(op)?;
            // The card's rule: minimum and maximum ignore blend factors.
            if matches!(op, BlendOp::Min | BlendOp::Max) {
                return Ok(BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op });
            }
            Ok(BlendComponent { src: blend_factor(src, alpha || alone)?, dst: blend_factor(dst, alpha || alone)?, op })
        };
        let [source, destination, source_alpha, destination_alpha] = writes.factors;
        let source = if self.scales_source(self.card.target()) { e::ONE } else { source };
        let color = component(source, destination, writes.ops[0], false)?;
        Ok(Some(Blend { color, alpha: component(source_alpha, destination_alpha, writes.ops[1], true)? }))
    }

    /// The logic operation on colours of a format; none where new colours replace what is stored.
    pub fn logic(&self, format: Format) -> Option<LogicOp> {
        let state = &self.state;
        let known = LogicOp::ALL.get(state.color.logic.wrapping_sub(e::CLEAR) as usize).copied();
        known.filter(|op| state.is(e::COLOR_LOGIC_OP) && *op != LogicOp::Copy && LogicOp::applies_to(format))
    }

    /// Whether the first colour buffer is blended with the second source of the fragment program.
    pub fn blends_second(&self, target: &Target, fragment: Option<&ActiveProgram>) -> GlResult<bool> {
        let blends = |writes: &ColorWrites| {
            let factors = [0, 1].into_iter().filter(|&k| !matches!(writes.ops[k], e::MIN | e::MAX));
            let mut factors = factors.flat_map(|k| [writes.factors[2 * k], writes.factors[2 * k + 1]]);
            writes.blended && factors.any(|factor| SECOND.contains(&factor))
        };
        if self.state.is(e::COLOR_LOGIC_OP) || !self.state.color.writes[..target.colors().count()].iter().any(blends) {
            return Ok(false);
        }
        // One buffer may be drawn to then.
        if target.more[0].is_some() {
            return Err(INVALID_OPERATION);
        }
        match fragment.is_some_and(|active| active.program.outputs.contains(&Output::Second)) {
            true => Ok(true),
            false => Err(Fault::Unsupported("blending with a second source that no fragment shader writes".into())),
        }
    }

    /// State that is fixed in a pipeline.
    pub fn fixed(
        &self,
        target: &Target,
        shader: num::ShaderId,
        buffers: Layouts,
        batch: &Batch,
        key: &ShaderKey,
        textures: usize,
    ) -> GlResult<PipelineState> {
        let state = &self.state;
        let (class, topology) = (batch.class, batch.topology);
        let triangles = class == Class::Triangles;
        let cull_mode = match state.polygon.cull {
            _ if !triangles || !state.is(e::CULL_FACE) => CullMode::None,
            e::FRONT => CullMode::Front,
            _ => CullMode::Back,
        };
        let topology = match class {
            _ if key.expand != Expand::No => Topology::TriangleList,
            Class::Points => Topology::PointList,
            Class::Lines => topology.unwrap_or(Topology::LineList),
            Class::Triangles => topology.unwrap_or(Topology::TriangleList),
        };
        let primitive = Primitive {
            topology,
            front_face: if (state.polygon.front == e::CW) ^ target.upward ^ batch.turned {
                FrontFace::Cw
            } else {
                FrontFace::Ccw
            },
            cull_mode,
            provoking_last: true,
            // Ties follow OpenGL's rows, which a window's surface has in the other order. Mesa's points are an exception.
            lower_edges: !target.upward && class != Class::Points,
            ..Primitive::default()
        };
        let tested = state.is(e::DEPTH_TEST) && target.has_depth;
        let stencil = state.is(e::STENCIL_TEST) && target.has_stencil;
        let [front, back] = self.stencil_tests(class);
        // The offsets of polygons as lines and points are in their vertices.
        let [factor, units] = if triangles && state.is(e::POLYGON_OFFSET_FILL) { state.polygon.offset } else { [0.0; 2] };
        let [stencil_front, stencil_back] = if stencil { [front.face()?, back.face()?] } else { [StencilFace::default(); 2] };
        let masks = |test: Stencil| StencilMasks { read: test.read & 0xff, write: test.write & 0xff };
        let depth = target.depth.map(|surface| DepthStencil {
            format: surface.format,
            depth_write: tested && state.depth.write,
            depth_compare: if tested { compare(state.depth.func) } else { Compare::Always },
            stencil_front,
            stencil_back,
            stencil_read_mask: if stencil { front.read & 0xff } else { 0xff },
            stencil_write_mask: if stencil { front.write & 0xff } else { 0xff },
            stencil_back_masks: (stencil && masks(back) != masks(front)).then(|| masks(back)),
            bias: units * OFFSET_STEPS,
            bias_slope: factor,
            bias_clamp: 0.0,
        });
        let color = target.color.map(|surface| surface.format);
        let blend = self.blending(&state.color.writes[0])?;
        let keeps = |format: Format| self.logic(format) == Some(LogicOp::NoOp);
        let mask = if color.is_some_and(keeps) { 0 } else { self.mask() };
        let logic = color.and_then(|format| self.logic(format));
        let mut more = Vec::new();
        for ((color, alpha), (k, writes)) in target.more.iter().flatten().zip(state.color.writes.iter().enumerate().skip(1)) {
            let format = color.format;
            let written = key.colors.written & 1 << k != 0 && !keeps(format);
            let write_mask = if written { writes.mask & stored_channels(*alpha) } else { 0 };
            more.push(ColorTarget { format, blend: self.blending(writes)?, logic: self.logic(format), write_mask });
        }
        Ok(PipelineState { shader, buffers, primitive, color, more, depth, blend, logic, mask, textures })
    }
}
