//! What a draw needs beside its vertices and its values: shader, pipeline, textures, the layout of its vertices.

use std::collections::BTreeSet;
use std::rc::Rc;

use gl_shader::arb::program::{Output, ProgramStage, input};
use gl_shader::glsl::stage::way;
use gl_shader::key::*;
use gl_shader::{TARGETS, UNITS, consts as e, wgsl};
use num::*;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::pass::{Layouts, Surface, Target};
use crate::gl::draw::key::varying;
use crate::gl::draw::streams::OnCard;
use crate::gl::draw::uniforms::{self, UniformInputs};
use crate::gl::draw::viewport::wider;
use crate::gl::geometry::clip::to_clip;
use crate::gl::geometry::pack::Packing;
use crate::gl::geometry::primitive::{Batch, Class};
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix::transform;
use crate::gl::state::arb::ActiveProgram;
use crate::gl::state::prepared::{Prepared, Sampling};

/// What preparing a draw gives.
pub enum Preparation {
    /// Nothing is drawn.
    Nothing,
    /// A draw.
    Ready(Box<Prepared>),
}

impl Prepared {
    /// The values of the uniforms, with these attributes where all vertices have the same.
    pub fn source<'a>(&'a self, gl: &'a Gl, constant: &'a Vertex) -> UniformInputs<'a> {
        let [vertex, fragment] = self.programs.each_ref().map(Option::as_ref);
        source(gl, constant, (self.target, &self.sampling), [vertex, fragment])
    }
}

/// The colours that a draw's fragments write to the colour buffers.
fn colors_of(target: &Target, fragment: Option<&ActiveProgram>) -> Colors {
    let count = target.colors().count().max(1) as u8;
    let own = fragment.filter(|active| active.program.code.as_ref().is_some_and(|code| !code.broadcast));
    let written = own.map_or(u8::MAX, |active| {
        let bit = |output: &Output| if let Output::Color(k) = output { 1 << k } else { 0 };
        // An output that a shader does not write is undefined; the first buffer then gets black.
        active.program.outputs.iter().map(bit).fold(1, |all: u8, bit: u8| all | bit)
    });
    let narrow = target.color.and_then(|color| color.narrow);
    Colors {
        second: false,
        count,
        written,
        alike: own.is_none(),
        scaled: false,
        narrow,
        float: target.colors().any(|(color, _)| color.is_float()),
    }
}

/// The texture units of a draw.
struct Units {
    keys: Vec<UnitKey>,
    bound: Vec<(TextureId, ViewId, SamplerId)>,
    /// How each of them is sampled.
    sampling: Vec<Sampling>,
    /// Whether one of them is the depth image that is drawn to.
    reads_depth: bool,
    /// What shaders read where the card does not support a border colour.
    white: Vec<(TextureId, ViewId, SamplerId)>,
}

fn source<'a>(
    gl: &'a Gl,
    constant: &'a Vertex,
    (target, sampling): (Target, &'a [Sampling]),
    [vertex, fragment]: [Option<&'a ActiveProgram>; 2],
) -> UniformInputs<'a> {
    UniformInputs {
        state: &gl.state,
        modelview: &gl.context.matrices.modelview.top,
        projection: &gl.context.matrices.projection.top,
        texture: &gl.context.matrices.texture,
        constant,
        sampling,
        height: target.size[1],
        upward: target.upward,
        wider: wider(gl.state.transform.viewport, target.size),
        pixels: gl.drawing.pixels.map_or([[0.0; 4]; 4], |pixels| pixels.uniforms),
        vertex,
        fragment,
    }
}

impl Gl {
    /// Prepares a draw. `constant` are the attributes that all vertices
    /// have, where they are the same. The vertices of fogged lines get their distances, and both facts about them change with that.
    pub fn prepare(
        &mut self,
        batch: &mut Batch,
        on_card: Option<OnCard<'_>>,
        constant: &mut Vertex,
        summary: &mut Summary,
    ) -> GlResult<Preparation> {
        let mut target = self.aim()?;
        let Some(scissor) = self.scissor() else { return Ok(Preparation::Nothing) };
        if self.state.transform.viewport[2] <= 0 || self.state.transform.viewport[3] <= 0 {
            return Ok(Preparation::Nothing);
        }
        let culled =
            batch.class == Class::Triangles && self.state.is(e::CULL_FACE) && self.state.polygon.cull == e::FRONT_AND_BACK;
        if culled {
            return Ok(Preparation::Nothing);
        }
        let vertex = self.active_program(ProgramStage::Vertex)?;
        let fragment = self.active_program(ProgramStage::Fragment)?;
        if self.drawing.pixels.is_some() && (vertex.is_some() || fragment.is_some()) {
            return Err(Fault::Unsupported("pixel rectangles with programs".into()));
        }
        let Units { keys, mut bound, sampling, reads_depth, white } = self.units(&target, batch.class, [&vertex, &fragment])?;
        if reads_depth {
            // A depth image that no test and no write needs is read while it is attached.
            if self.state.is(e::DEPTH_TEST) || self.state.is(e::STENCIL_TEST) {
                return Err(Fault::Unsupported("drawing into a texture that the draw reads".into()));
            }
            (target.depth, target.has_depth, target.has_stencil) = (None, false, false);
        }
        let mut key = self.key(batch, summary, keys, target.size)?;
        if let Some(lighting) = &mut key.lighting {
            self.context.material_tracking.untrack_unchanged(lighting, constant, summary);
        }
        self.programmed(&mut key, batch, vertex.as_ref(), fragment.as_ref())?;
        let flat = || key.flat || vertex.as_ref().is_some_and(|active| active.program.has_flat());
        if self.state.lighting.provoking_first && batch.class != Class::Points && flat() {
            return Err(Fault::Unsupported("flat values of the first vertex (glProvokingVertex)".into()));
        }
        key.colors = colors_of(&target, fragment.as_ref());
        key.colors.scaled = self.scales_source(Some(target));
        key.colors.second = self.blends_second(&target, fragment.as_ref())?;
        if key.colors.narrow.is_some() && self.mask() != 0 {
            // Drawn, but what is combined with stored colours keeps all eight bits.
            let combined = if self.blending(&self.state.color.writes[0])?.is_some() {
                Some("blending into")
            } else {
                target.color.and_then(|color| self.logic(color.format)).map(|_| "logic operations on")
            };
            if let Some(combined) = combined {
                self.log.refuse(format!("{combined} colours of fewer than eight bits a channel"));
                key.colors.narrow = None;
            }
        }
        let other = key.fog_distance != FogDistance::Absolute && key.fog.is_some() && !key.fog_coordinate && vertex.is_none();
        if other && batch.class == Class::Lines && (self.line_stippled() || self.cuts_fog(&key, batch)) {
            return Err(Fault::Unsupported("stippled or clipped lines with a mode of the fog's distance".into()));
        }
        if batch.class == Class::Lines && self.line_stippled() && vertex.is_none() {
            // The pattern's runs have the distances that fog needs.
            key.fog_coordinate = true;
        } else if self.cuts_fog(&key, batch) {
            // Only here is the distance of a clipped end known.
            let modelview = self.context.matrices.modelview.top;
            for vertex in &mut batch.vertices {
                vertex.fog = transform(&modelview, vertex.position)[2].abs();
            }
            key.fog_coordinate = true;
            (*constant, *summary) = (batch.vertices[batch.indices[0] as usize].clone(), Summary::of(&batch.vertices));
        }
        key.projective_eye &= key.eye();
        bound.extend(self.drawing.pixels.map(|pixels| pixels.bound));
        bound.extend(white);
        // Preparing the textures may have drawn to other targets.
        self.card.aim(Some(target));
        if !self.options.survey {
            key.varying = varying(batch, summary, &key);
        }
        let of = (target, &sampling[..]);
        let shader = match self.drawing.shaders.get(&key) {
            Some(&shader) => shader,
            None => {
                let fields = uniforms::fields(&key, &source(self, constant, of, [vertex.as_ref(), fragment.as_ref()]));
                self.module(&key, &fields, [vertex.as_ref(), fragment.as_ref()])
            }
        };
        if self.options.survey {
            return self.fixed(&target, shader, [].into(), batch, &key, bound.len()).map(|_| Preparation::Nothing);
        }
        let (packing, layouts) = self.packing(shader, &key, summary, batch);
        let streams = match on_card {
            Some(OnCard::Buffers(resident)) => Some(resident.streams(&packing.attributes)),
            _ => None,
        };
        let layouts = streams.as_ref().map_or(layouts, |streams| streams.layouts.clone().into());
        let fixed = self.fixed(&target, shader, layouts, batch, &key, bound.len())?;
        Ok(Preparation::Ready(Box::new(Prepared {
            target,
            programs: [vertex, fragment],
            sampling,
            packing,
            streams,
            writes: fixed.writes(),
            fixed,
            bound,
            viewport: self.viewport(&target, &key, batch.class),
            scissor,
            blend: if self.constant_alpha() {
                [self.state.color.blend_constant[3]; 4]
            } else {
                self.state.color.blend_constant
            },
            key,
        })))
    }

    /// The texture units of a draw.
    fn units(&mut self, target: &Target, class: Class, [vertex, fragment]: [&Option<ActiveProgram>; 2]) -> GlResult<Units> {
        let mut bound = Vec::new();
        let mut keys = Vec::new();
        let (mut sampling, mut white, mut reads_depth) = (Vec::new(), Vec::new(), false);
        // Fixed functions have the first units. Of the others a draw has those that its programs read.
        let images = [vertex, fragment].into_iter().flatten().flat_map(|active| &active.program.images);
        let further: BTreeSet<usize> = images.map(|image| image.unit).filter(|&unit| unit >= UNITS).collect();
        for unit in (0..UNITS).chain(further) {
            self.state.texturing.reach(unit);
            let enabled = self.state.texturing.units[unit].enabled;
            let target_of = |active: &ActiveProgram| active.program.image(unit).map(|image| image.target);
            let read = |active: &Option<ActiveProgram>| active.as_ref().and_then(target_of);
            let (bound_to, coordinates) = match fragment {
                None if read(vertex).is_some() => {
                    return Err(Fault::Unsupported("textures of a vertex shader beside fixed-function fragments".into()));
                }
                None => ((0..TARGETS.len()).rev().find(|&k| enabled & 1 << k != 0), true),
                Some(active) => {
                    let target = match (target_of(active), read(vertex)) {
                        (Some(a), Some(b)) if a != b => {
                            return Err(Fault::Unsupported(format!("texture unit {unit} as textures of two kinds")));
                        }
                        (a, b) => a.or(b),
                    };
                    (target, unit < UNITS && active.program.inputs & 1 << (input::TEXTURE + unit as u32) != 0)
                }
            };
            if bound_to.is_none() && fragment.is_none() {
                continue;
            }
            let (mut key, texture) = self.unit(unit, bound_to, class)?;
            let mut sampled = Sampling::default();
            key.sampled = texture.is_some();
            key.coordinates = coordinates && (key.sampled || fragment.is_some());
            if fragment.is_some() {
                // The fragment program decides how a texture is used.
                key.environment = EnvironmentKey::Mode(e::REPLACE);
                key.projective = true;
            }
            if vertex.is_some() {
                (key.made, key.matrix, key.projective) = ([None; 4], false, true);
            }
            if let Some(texture) = texture {
                let read = |surface: Surface| {
                    let [first, count] = texture.levels;
                    surface.texture == texture.bound.0 && (first..first + count).contains(&surface.level)
                };
                if target.colors().any(|(color, _)| read(color)) {
                    return Err(Fault::Unsupported("drawing into a texture that the draw reads".into()));
                }
                reads_depth |= target.depth.is_some_and(read);
                sampled.bias = texture.bias + self.state.texturing.units[unit].environment.bias;
                let programs = [vertex, fragment].into_iter().flatten();
                let ways = programs.fold(0, |all, active| all | active.program.ways(unit));
                // WGSL reads depths at the level of the coordinates, or without comparison at one that is named.
                let moved = match key.depth {
                    DepthRead::No => 0,
                    DepthRead::Plain => way::BIAS | way::GRADIENT,
                    DepthRead::Compared => way::BIAS | way::LEVEL | way::GRADIENT,
                };
                if texture.levels[1] > 1 && (ways & moved != 0 || key.bias && key.depth != DepthRead::No) {
                    return Err(Fault::Unsupported(
                        "depth textures with several levels and a bias or a level that is given".into(),
                    ));
                }
                if let Some((color, sampler)) = texture.border {
                    sampled.border = color;
                    let (id, view, _) = texture.bound;
                    white.push((id, view, sampler));
                }
                bound.push(texture.bound);
            }
            if key.sampled || key.coordinates {
                keys.push(key);
                sampling.push(sampled);
            }
        }
        Ok(Units { keys, bound, sampling, reads_depth, white })
    }

    /// The layout of vertices for a shader, and that of their buffers; made once.
    fn packing(&mut self, shader: ShaderId, key: &ShaderKey, summary: &Summary, batch: &Batch) -> (Rc<Packing>, Layouts) {
        let all = self.drawing.packings.get_or_insert_with(shader, Vec::new);
        let of = (*summary, batch.class, batch.sent);
        if let Some((_, packing, layouts)) = all.iter().find(|(known, ..)| *known == of) {
            return (packing.clone(), layouts.clone());
        }
        let packing = Rc::new(Packing::new(key, summary, batch.class, batch.sent));
        let layouts: Layouts = packing.buffers().into();
        all.push((of, packing.clone(), layouts.clone()));
        (packing, layouts)
    }

    /// Makes the shader of a key, with these uniforms and programs.
    fn module(&mut self, key: &ShaderKey, uniforms: &[wgsl::Field], programs: [Option<&ActiveProgram>; 2]) -> ShaderId {
        let of = |(stage, active): (&str, Option<&ActiveProgram>)| Some(format!(" with {stage} program {}", active?.number));
        let numbers: String = ["vertex", "fragment"].into_iter().zip(programs).filter_map(of).collect();
        let label = format!("fixed-{}{numbers}", self.drawing.shaders.len());
        let [vertex, fragment] = programs.map(|active| active.map(|active| &*active.program));
        let text = wgsl::module(key, &wgsl::ModuleInputs { uniforms, vertex, fragment });
        let shader = self.card.recorder.create_shader(&label, &text);
        self.drawing.texts.push((label, text));
        self.drawing.shaders.insert(key.clone(), shader);
        shader
    }

    /// Whether these are lines that become triangles, are clipped to the near plane, and are fogged by distance. For triangles, the card's
    /// clipper interpolates the distances of the vertices; these lines are clipped before that.
    fn cuts_fog(&self, key: &ShaderKey, batch: &Batch) -> bool {
        let lines = matches!(key.expand, Expand::Line | Expand::SmoothLine);
        let clip = to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top);
        let behind = |vertex: &Vertex| !(transform(&clip, vertex.position)[2] >= 0.0);
        lines && key.fogged() && !key.fog_coordinate && batch.vertices.iter().any(behind)
    }
}
