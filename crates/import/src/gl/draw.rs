//! Converts the batch to a draw of the card: key, uniforms, vertices, pipeline.

use gfx::state::*;
use gl_shader::arb::program::Output;
use gl_shader::wgsl;
use glam::Mat4;

use super::arb::{Active, Stage, input};
use super::call::{Fault, Outcome};
use super::card::{Draw, Order, Target, VertexRange};
use super::consts as e;
use super::draw_key::varying;
use super::key::*;
use super::machine::Gl;
use super::pack::{Drawn, Packing, STREAM_ALIGN, streams};
use super::primitive::{Batch, Class};
use super::resident::Kept;
use super::state::{Stencil, TARGETS, UNITS, Vertex, capability};
use super::summary::Summary;
use super::texture::Texture;
use super::uniforms::{self, Source, to_clip};

/// The kind of texture of a target.
pub fn kind_of(target: usize) -> Kind {
    [Kind::D1, Kind::D2, Kind::Rectangle, Kind::D3, Kind::Cube][target]
}

/// The colours that a draw's fragments write to the colour buffers.
fn colors_of(target: &Target, fragment: Option<&Active>) -> Colors {
    let count = target.colors().count().max(1) as u8;
    let own = fragment.filter(|active| active.program.code.as_ref().is_some_and(|code| !code.broadcast));
    let written = own.map_or(u8::MAX, |active| {
        let bit = |output: &Output| if let Output::Color(k) = output { 1 << k } else { 0 };
        // An output that a shader does not write is undefined; the first buffer then gets black.
        active.program.outputs.iter().map(bit).fold(1, |all: u8, bit: u8| all | bit)
    });
    let narrow = target.color.and_then(|color| color.narrow);
    Colors { count, written, alike: own.is_none(), narrow, float: target.colors().any(|(color, _)| color.is_float()) }
}

impl Gl {
    /// The texture that is bound to a target of a unit.
    pub fn texture(&mut self, unit: usize, target: usize) -> &mut Texture {
        let name = self.state.units[unit].bound[target];
        let kind = kind_of(target);
        let (table, key) = if name == 0 { (&mut self.default_textures, target as u32) } else { (&mut self.textures, name) };
        table.get_or_insert_with(key, || Texture::new(kind))
    }

    /// Draws the batch.
    pub fn flush(&mut self) -> Outcome {
        self.follows = false;
        if self.batch.indices.is_empty() {
            return Ok(());
        }
        let mut batch = std::mem::take(&mut self.batch);
        if let Some(geometry) = self.lone.take() {
            geometry.alone.set(batch.vertices.len() == geometry.vertices.len());
        }
        let outcome = self.draw(&mut batch, None);
        if self.batch.indices.is_empty() {
            // The memory is reused.
            batch.vertices.clear();
            batch.indices.clear();
            self.batch = Batch { vertices: batch.vertices, indices: batch.indices, ..Batch::default() };
        }
        // The call that ends the batch is not the one with the unsupported draw.
        self.settled(outcome)
    }

    /// Counts the unsupported feature of a draw.
    pub fn settled(&mut self, outcome: Outcome) -> Outcome {
        match outcome {
            Err(Fault::Unsupported(what)) => {
                self.refuse(what);
                Ok(())
            }
            other => other,
        }
    }

    fn viewport(&self, target: &Target) -> Viewport {
        let height = target.size[1] as f32;
        let [x, y, w, h] = self.state.viewport.map(|value| value as f32);
        let [min_depth, max_depth] = self.state.depth_range;
        let y = if target.upward { y } else { height - y - h };
        Viewport { x, y, width: w, height: h, min_depth, max_depth }
    }

    /// Draws a batch, or vertices that stay on the card: then the batch gives only their type.
    pub fn draw(&mut self, batch: &mut Batch, kept: Option<Kept<'_>>) -> Outcome {
        let Some(target) = self.aim()? else {
            return Err(Fault::Unsupported("drawing before the size of the window is known".into()));
        };
        let Some(scissor) = self.scissor() else { return Ok(()) };
        if self.state.viewport[2] <= 0 || self.state.viewport[3] <= 0 {
            return Ok(());
        }
        let culled = batch.class == Class::Triangles && self.state.is(e::CULL_FACE) && self.state.cull == e::FRONT_AND_BACK;
        if culled {
            return Ok(());
        }
        if kept.is_none() && self.sides_differ(batch) {
            return self.draw_sides(batch);
        }
        let vertex = self.active_program(Stage::Vertex)?;
        let fragment = self.active_program(Stage::Fragment)?;
        if self.pixels.is_some() && (vertex.is_some() || fragment.is_some()) {
            return Err(Fault::Unsupported("pixel rectangles with programs".into()));
        }
        let mut bound = Vec::new();
        let mut units = Vec::new();
        let (mut biases, mut borders, mut white) = ([0.0; UNITS], [[0.0; 4]; UNITS], Vec::new());
        for unit in 0..UNITS {
            let enabled = self.state.units[unit].enabled;
            let read = |active: &Option<Active>| active.as_ref().and_then(|active| active.program.targets[unit]);
            let (bound_to, coordinates) = match &fragment {
                None if read(&vertex).is_some() => {
                    return Err(Fault::Unsupported("textures of a vertex shader beside fixed-function fragments".into()));
                }
                None => ((0..TARGETS.len()).rev().find(|&k| enabled & 1 << k != 0), true),
                Some(active) => {
                    let target = match (active.program.targets[unit], read(&vertex)) {
                        (Some(a), Some(b)) if a != b => {
                            return Err(Fault::Unsupported(format!("texture unit {unit} as textures of two kinds")));
                        }
                        (a, b) => a.or(b),
                    };
                    (target, active.program.inputs & 1 << (input::TEXTURE + unit as u32) != 0)
                }
            };
            let (mut key, texture) = self.unit(unit, bound_to, batch.class)?;
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
                let read = |surface: super::card::Surface| {
                    let [first, count] = texture.levels;
                    surface.texture == texture.bound.0 && (first..first + count).contains(&surface.level)
                };
                if target.surfaces().any(read) {
                    return Err(Fault::Unsupported("drawing into a texture that the draw reads".into()));
                }
                biases[unit] = texture.bias + self.state.units[unit].environment.bias;
                if let Some((color, sampler)) = texture.border {
                    borders[unit] = color;
                    let (id, view, _) = texture.bound;
                    white.push((id, view, sampler));
                }
                bound.push(texture);
            }
            if key.sampled || key.coordinates {
                units.push(key);
            }
        }
        let (mut constant, mut summary) = match kept {
            Some(Kept::List(geometry)) => geometry.over(&self.state.current),
            Some(Kept::Buffers(resident)) => (resident.constant.clone(), resident.summary.clone()),
            None => (batch.vertices[batch.indices[0] as usize].clone(), Summary::of(&batch.vertices)),
        };
        let mut key = self.key(batch, &summary, units)?;
        if let Some(lighting) = &mut key.lighting {
            self.given.limit(lighting, &constant, &summary);
        }
        self.programmed(&mut key, batch, vertex.as_ref(), fragment.as_ref())?;
        key.colors = colors_of(&target, fragment.as_ref());
        if key.colors.narrow.is_some() && self.mask() != 0 && self.blending(&self.state.writes[0])?.is_some() {
            // Drawn, but what is blended keeps all eight bits.
            self.refuse("blending into colours of fewer than eight bits a channel".into());
            key.colors.narrow = None;
        }
        if batch.class == Class::Lines && self.line_stippled() && vertex.is_none() {
            // The pattern's runs have the distances that fog needs.
            key.fog_coordinate = true;
        } else if self.cuts_fog(&key, batch) {
            // Only here is the distance of a clipped end known.
            let modelview = self.modelview.top;
            for vertex in &mut batch.vertices {
                vertex.fog = super::matrix::transform(&modelview, vertex.position)[2].abs();
            }
            key.fog_coordinate = true;
            (constant, summary) = (batch.vertices[batch.indices[0] as usize].clone(), Summary::of(&batch.vertices));
        }
        key.projective_eye &= key.eye();
        let mut bound: Vec<_> = bound.iter().map(|bound| bound.bound).collect();
        if key.logic.is_some() && (target.more[0].is_some() || target.color.is_some_and(|color| color.is_float())) {
            return Err(Fault::Unsupported("logic operations on several colour buffers and on floating-point ones".into()));
        }
        if key.logic.is_some() {
            // The stored colours before this primitive.
            match target.color.filter(|surface| surface.level == 0 && surface.layer == 0) {
                Some(surface) => bound.push(self.card.frame_copy(surface, target.size)),
                None => return Err(Fault::Unsupported("logic operations on levels and layers of textures".into())),
            }
        }
        bound.extend(self.pixels.map(|pixels| pixels.bound));
        bound.extend(white);
        // Preparing the textures may have drawn to other targets.
        self.card.aim(Some(target));
        if !self.survey {
            key.varying = varying(batch, &summary, &key);
        }
        let mut blob = Vec::new();
        let textures: [Mat4; UNITS] = std::array::from_fn(|unit| self.texture_matrices[unit].top);
        let source = Source {
            state: &self.state,
            modelview: &self.modelview.top,
            projection: &self.projection.top,
            texture: &textures,
            constant: &constant,
            biases,
            borders,
            height: target.size[1],
            upward: target.upward,
            pixels: self.pixels.map_or([[0.0; 4]; 4], |pixels| pixels.uniforms),
            vertex: vertex.as_ref(),
            fragment: fragment.as_ref(),
        };
        uniforms::bytes(&key, &source, &mut blob);
        let shader = match self.shaders.get(&key) {
            Some(&shader) => shader,
            None => {
                let programs = [("vertex", &vertex), ("fragment", &fragment)];
                let of = |(stage, active): (&str, &Option<Active>)| {
                    Some(format!(" with {stage} program {}", active.as_ref()?.number))
                };
                let label = format!("fixed-{}{}", self.shaders.len(), programs.into_iter().filter_map(of).collect::<String>());
                let uniforms = uniforms::fields(&key, &source);
                let [vertex, fragment] = [&vertex, &fragment].map(|active| active.as_ref().map(|active| &*active.program));
                let source = wgsl::Source { uniforms: &uniforms, vertex, fragment };
                let text = wgsl::module(&key, &source);
                let shader = self.card.recorder.create_shader(&label, &text);
                self.texts.push((label, text));
                self.shaders.insert(key.clone(), shader);
                shader
            }
        };
        if self.survey {
            return self.fixed(&target, shader, Vec::new(), batch, &key, bound.len()).map(|_| ());
        }
        let packing = Packing::new(&key, &summary, batch.class, batch.sent);
        let placed = match kept {
            Some(Kept::Buffers(resident)) => Some(resident.placed(&packing.attributes)),
            _ => None,
        };
        let layouts = placed.as_ref().map_or_else(|| packing.buffers(), |placed| placed.layouts.clone());
        let fixed = self.fixed(&target, shader, layouts, batch, &key, bound.len())?;
        let clip = if packing.cuts() { to_clip(&self.projection.top, &self.modelview.top) } else { Mat4::IDENTITY };
        let (flat, upright, viewport) = (self.state.flat, self.keeps_upright(), self.viewport(&target));
        let own = |offset: u64| VertexRange { buffer: None, offset };
        let (vertices, order, count) = match kept {
            Some(Kept::List(geometry)) => {
                let ([vertices, indices], count) = self.card.kept(geometry, packing, upright);
                let order = Order::Indices { buffer: Some(indices), format: IndexFormat::Uint32, first: 0, base: 0 };
                (vec![VertexRange { buffer: Some(vertices), offset: 0 }], order, count)
            }
            Some(Kept::Buffers(resident)) => {
                let vertices = placed.map_or_else(Vec::new, |placed| self.vertex_ranges(resident, &placed));
                (vertices, self.order(resident), resident.count)
            }
            None => {
                let pass = &mut self.card.pass;
                let mut streams_of = Vec::new();
                if packing.streams {
                    let (end, start) = (pass.vertices.len(), pass.vertices.len().next_multiple_of(STREAM_ALIGN));
                    pass.vertices.resize(start, 0);
                    streams_of = streams(&packing.attributes, batch.vertices.len());
                    pass.gaps.push([end, start]);
                    for (pair, (_, format)) in streams_of.windows(2).zip(&packing.attributes) {
                        let [this, next] = [pair[0], pair[1]].map(|stream| start + stream as usize);
                        pass.gaps.push([this + batch.vertices.len() * format.bytes() as usize, next]);
                    }
                }
                let (start, first) = (pass.vertices.len() as u64, pass.indices.len());
                let drawn = Drawn { vertices: &batch.vertices, indices: &batch.indices };
                packing.write(drawn, &clip, flat, &mut pass.vertices, &mut pass.indices);
                let count = pass.indices.len() - first;
                if batch.sequence {
                    pass.indices.truncate(first);
                }
                let vertices = match packing.streams {
                    true => streams_of.iter().map(|stream| own(start + stream)).collect(),
                    false => vec![own(start)],
                };
                (vertices, if batch.sequence { Order::Sequence(0) } else { Order::pass(first as u32) }, count as u32)
            }
        };
        if count == 0 {
            return Ok(());
        }
        let pipeline = self.card.pipeline(&fixed);
        let textures = (!bound.is_empty()).then(|| self.card.textures(&bound));
        let uniforms = self.card.uniforms(&blob);
        for &(texture, ..) in &bound {
            self.card.pass.textures.insert(texture, ());
        }
        let blend = if self.constant_alpha() { [self.state.blend_color[3]; 4] } else { self.state.blend_color };
        self.card.draw(Draw {
            pipeline,
            uniforms,
            vertices,
            order,
            count,
            textures,
            viewport,
            scissor,
            blend,
            stencil: self.state.stencil[0].reference as u32,
            writes: fixed.writes(),
            query: self.query,
        });
        Ok(())
    }

    /// Whether the stencil test has other references or masks for back-facing triangles.
    pub fn sides_differ(&self, batch: &Batch) -> bool {
        let of = |side: &Stencil| (side.reference, side.read & 255, side.write & 255);
        let [front, back] = &self.state.stencil;
        batch.class == Class::Triangles && self.state.is(e::STENCIL_TEST) && self.stencil_sides() && of(front) != of(back)
    }

    /// The card has one reference and one mask for both sides: each triangle is drawn twice, and one of the two is culled.
    fn draw_sides(&mut self, batch: &Batch) -> Outcome {
        if batch.topology.is_some() {
            return Err(Fault::Unsupported(
                "draws that are kept with stencil references or masks that differ between faces".into(),
            ));
        }
        let (enabled, cull, stencil) = (self.state.enabled, self.state.cull, self.state.stencil);
        let culled = if self.state.is(e::CULL_FACE) { cull } else { e::NONE };
        self.state.enabled |= capability(e::CULL_FACE).unwrap_or(0);
        self.state.enabled &= !capability(e::STENCIL_TEST_TWO_SIDE_EXT).unwrap_or(0);
        let mut outcome = Ok(());
        'triangles: for triangle in batch.indices.chunks_exact(3) {
            for (side, other) in [(e::FRONT, e::BACK), (e::BACK, e::FRONT)] {
                if culled == side {
                    continue;
                }
                (self.state.cull, self.state.stencil) = (other, [stencil[usize::from(side == e::BACK)]; 2]);
                let vertices = triangle.iter().map(|&index| batch.vertices[index as usize].clone()).collect();
                let mut one = Batch { class: batch.class, vertices, indices: vec![0, 1, 2], ..Batch::default() };
                outcome = self.draw(&mut one, None);
                if outcome.is_err() {
                    break 'triangles;
                }
            }
        }
        (self.state.enabled, self.state.cull, self.state.stencil) = (enabled, cull, stencil);
        outcome
    }

    /// Whether these are lines that become triangles, are clipped to the near plane, and are fogged by distance. For triangles, the card's
    /// clipper interpolates the distances of the vertices; these lines are clipped before that.
    fn cuts_fog(&self, key: &ShaderKey, batch: &Batch) -> bool {
        let lines = matches!(key.expand, Expand::Line | Expand::SmoothLine);
        let clip = to_clip(&self.projection.top, &self.modelview.top);
        let behind = |vertex: &Vertex| !(super::matrix::transform(&clip, vertex.position)[2] >= 0.0);
        lines && key.fogged() && !key.fog_coordinate && batch.vertices.iter().any(behind)
    }
}
