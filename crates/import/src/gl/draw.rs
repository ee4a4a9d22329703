//! From what waits to a draw of the card: key, uniforms, vertices, pipeline.

use gfx::state::*;

use super::arb::{Active, GENERICS, Stage, input};
use super::call::{Fault, Outcome};
use super::card::{Draw, Fixed, Target};
use super::consts as e;
use super::fragments::{blend_factor, blend_operation, stencil_operation};
use super::image::Base;
use super::key::*;
use super::machine::Gl;
use super::matrix::{IDENTITY, Matrix};
use super::pack::{STREAM_ALIGN, STREAMS_MAX, expand, pack, streams};
use super::primitive::{Batch, Class, Sent};
use super::state::{PLANES, TARGETS, UNITS, Vertex};
use super::texture::{Bound, Texture};
use super::uniforms::{self, Source, to_clip};
use super::wgsl;

/// A comparison of the card.
pub fn compare(value: u32) -> Compare {
    match value {
        e::NEVER => Compare::Never,
        e::LESS => Compare::Less,
        e::EQUAL => Compare::Equal,
        e::LEQUAL => Compare::LessEqual,
        e::GREATER => Compare::Greater,
        e::NOTEQUAL => Compare::NotEqual,
        e::GEQUAL => Compare::GreaterEqual,
        _ => Compare::Always,
    }
}

const CLEAR_TEXT: &str = "struct Uniforms { color: vec4f, depth: vec4f }\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
    @vertex fn vs(@location(0) position: vec2f) -> @builtin(position) vec4f { return vec4f(position, u.depth.x, 1); }\n\
    @fragment fn fs() -> @location(0) vec4f { return u.color; }\n";

/// The kind of texture of a target.
pub fn kind_of(target: usize) -> Kind {
    [Kind::D1, Kind::D2, Kind::Rectangle, Kind::D3, Kind::Cube][target]
}

impl Gl {
    /// The texture that a unit's target is bound to.
    pub fn texture(&mut self, unit: usize, target: usize) -> &mut Texture {
        let name = self.state.units[unit].bound[target];
        let kind = kind_of(target);
        let (table, key) = if name == 0 { (&mut self.default_textures, target as u32) } else { (&mut self.textures, name) };
        table.entry(key).or_insert_with(|| Texture::new(kind))
    }

    /// Draws what waits.
    pub fn flush(&mut self) -> Outcome {
        if self.batch.indices.is_empty() {
            return Ok(());
        }
        let mut batch = std::mem::take(&mut self.batch);
        let outcome = self.draw(&mut batch);
        if self.batch.indices.is_empty() {
            // The room is used again.
            batch.vertices.clear();
            batch.indices.clear();
            self.batch = Batch { vertices: batch.vertices, indices: batch.indices, ..Batch::default() };
        }
        match outcome {
            // The call that ends the batch is not the one that cannot be drawn.
            Err(Fault::Unsupported(what)) => {
                self.refuse(what);
                Ok(())
            }
            other => other,
        }
    }

    /// The scissor in the card's rows; none if it is empty.
    pub fn scissor(&self) -> Option<Rect> {
        let target = self.card.target()?;
        let [width, height] = target.size.map(i64::from);
        let [mut x0, mut y0, mut x1, mut y1] = [0, 0, width, height];
        if self.state.is(e::SCISSOR_TEST) {
            let [x, y, w, h] = self.state.scissor.map(i64::from);
            (x0, y0, x1, y1) = (x0.max(x), y0.max(y), x1.min(x + w), y1.min(y + h));
        }
        if x0 >= x1 || y0 >= y1 {
            return None;
        }
        let y = if target.upward { y0 } else { height - y1 };
        Some(Rect { x: x0 as u32, y: y as u32, width: (x1 - x0) as u32, height: (y1 - y0) as u32 })
    }

    fn viewport(&self, target: &Target) -> Viewport {
        let height = target.size[1] as f32;
        let [x, y, w, h] = self.state.viewport.map(|value| value as f32);
        let [min_depth, max_depth] = self.state.depth_range;
        let y = if target.upward { y } else { height - y - h };
        Viewport { x, y, width: w, height: h, min_depth, max_depth }
    }

    /// Channels that are written: a window may have no alpha.
    pub fn mask(&self) -> u8 {
        let Some(target) = self.card.target().filter(|target| target.color.is_some()) else { return 0 };
        let off = self.draw_framebuffer == 0 && self.state.draw_buffer == e::NONE;
        if off { 0 } else { self.state.color_mask & if target.alpha { 15 } else { 7 } }
    }

    /// Clears buffers, or the part of them that scissor and masks leave.
    pub fn clear_buffers(&mut self, mask: u32) -> Outcome {
        let Some(target) = self.aim()? else { return Ok(()) };
        let Some(scissor) = self.scissor() else { return Ok(()) };
        let [width, height] = target.size;
        let all = if target.alpha { 15 } else { 7 };
        let whole = scissor == Rect { x: 0, y: 0, width, height };
        let state = &self.state;
        let wanted = |bit: u32| mask & bit != 0;
        let channels = if wanted(e::COLOR_BUFFER_BIT) { self.mask() } else { 0 };
        let depth = wanted(e::DEPTH_BUFFER_BIT) && state.depth_write && target.has_depth;
        let stencil_mask = if wanted(e::STENCIL_BUFFER_BIT) && target.has_stencil { state.stencil[0].write & 0xff } else { 0 };
        let (color, z, stencil) = (state.clear_color, state.clear_depth, state.clear_stencil as u32 & 0xff);
        let partial = !whole || channels != 0 && channels != all || !matches!(stencil_mask, 0 | 0xff);
        if !partial {
            self.card.clear((channels == all).then_some(color), depth.then_some(z), (stencil_mask == 0xff).then_some(stencil));
            return Ok(());
        }
        let face = StencilFace { pass_op: StencilOp::Replace, depth_fail_op: StencilOp::Replace, ..StencilFace::default() };
        let fixed = Fixed {
            shader: self.card.plain_shader("clear", CLEAR_TEXT),
            attributes: vec![(0, VertexFormat::Float32x2)],
            streams: false,
            primitive: Primitive::default(),
            color: target.color.map(|surface| surface.format),
            depth: target.depth.map(|surface| DepthStencil {
                format: surface.format,
                depth_write: depth,
                depth_compare: Compare::Always,
                stencil_front: if stencil_mask != 0 { face } else { StencilFace::default() },
                stencil_back: if stencil_mask != 0 { face } else { StencilFace::default() },
                stencil_read_mask: 0xff,
                stencil_write_mask: stencil_mask,
                bias: 0,
                bias_slope: 0.0,
                bias_clamp: 0.0,
            }),
            blend: None,
            mask: channels,
            textures: 0,
        };
        let pipeline = self.card.pipeline(&fixed);
        let alpha = if target.alpha { color[3] } else { 1.0 };
        let values = [color[0], color[1], color[2], alpha, z, 0.0, 0.0, 0.0];
        let uniforms = self.card.uniforms(&values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>());
        let pass = &mut self.card.pass;
        let (vertices, first) = (pass.vertices.len() as u64, pass.indices.len() as u32);
        pass.vertices.extend([-1.0_f32, -1.0, 3.0, -1.0, -1.0, 3.0].iter().flat_map(|value| value.to_le_bytes()));
        pass.indices.extend([0, 1, 2]);
        let viewport = Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 };
        let blend = [0.0; 4];
        self.card.draw(Draw {
            pipeline,
            uniforms,
            vertices,
            streams: Vec::new(),
            first: Some(first),
            count: 3,
            textures: None,
            viewport,
            scissor,
            blend,
            stencil,
            writes: fixed.writes(),
            query: None,
        });
        Ok(())
    }

    /// Draws a batch.
    fn draw(&mut self, batch: &mut Batch) -> Outcome {
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
        if self.state.is(e::POLYGON_SMOOTH) && batch.class == Class::Triangles {
            return Err(Fault::Unsupported("GL_POLYGON_SMOOTH".into()));
        }
        let vertex = self.active_program(Stage::Vertex)?;
        let fragment = self.active_program(Stage::Fragment)?;
        if self.pixels.is_some() && (vertex.is_some() || fragment.is_some()) {
            return Err(Fault::Unsupported("pixel rectangles with programs".into()));
        }
        let mut bound = Vec::new();
        let mut units = Vec::new();
        let mut biases = [0.0; UNITS];
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
                // What is done with a texture is the program's affair.
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
                if [target.color, target.depth].into_iter().flatten().any(read) {
                    return Err(Fault::Unsupported("drawing into a texture that the draw reads".into()));
                }
                biases[unit] = texture.bias + self.state.units[unit].environment.bias;
                bound.push(texture);
            }
            if key.sampled || key.coordinates {
                units.push(key);
            }
        }
        let mut key = self.key(batch, units)?;
        self.programmed(&mut key, batch, vertex.as_ref(), fragment.as_ref())?;
        if self.cuts_fog(&key, batch) {
            // The distance of an end that is cut off is known here alone.
            let modelview = self.modelview.top;
            for vertex in &mut batch.vertices {
                vertex.fog = super::matrix::transform(&modelview, vertex.position)[2].abs();
            }
            key.fog_coordinate = true;
        }
        let mut bound: Vec<_> = bound.iter().map(|bound| bound.bound).collect();
        if key.logic.is_some() {
            // The stored colours, as they are before this primitive.
            match target.color.filter(|surface| surface.level == 0 && surface.layer == 0) {
                Some(surface) => bound.push(self.card.frame_copy(surface, target.size)),
                None => return Err(Fault::Unsupported("logic operations on levels and layers of textures".into())),
            }
        }
        bound.extend(self.pixels.map(|pixels| pixels.bound));
        // What textures needed may have been drawn meanwhile.
        self.card.aim(Some(target));
        let constant = batch.vertices[batch.indices[0] as usize].clone();
        if !self.survey {
            key.varying = varying(batch, &constant, &key);
        }
        let mut blob = Vec::new();
        let textures: [Matrix; UNITS] = std::array::from_fn(|unit| self.texture_matrices[unit].top);
        let source = Source {
            state: &self.state,
            modelview: &self.modelview.top,
            projection: &self.projection.top,
            texture: &textures,
            constant: &constant,
            biases,
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
                let text = wgsl::module(&key, &source);
                let shader = self.card.recorder.create_shader(&label, &text);
                self.texts.push((label, text));
                self.shaders.insert(key.clone(), shader);
                shader
            }
        };
        let (attributes, bytes, indices) = if self.survey {
            (Vec::new(), Vec::new(), vec![0])
        } else if key.expand == Expand::No {
            pack(&key, batch)
        } else {
            let clip = to_clip(&self.projection.top, &self.modelview.top);
            expand(&key, batch, &clip, self.state.flat)
        };
        if indices.is_empty() {
            return Ok(());
        }
        let fixed = self.fixed(&target, shader, attributes, batch, &key, bound.len())?;
        let pipeline = self.card.pipeline(&fixed);
        let group = (!bound.is_empty()).then(|| self.card.textures(&bound));
        let uniforms = self.card.uniforms(&blob);
        let viewport = self.viewport(&target);
        let blend = if self.constant_alpha() { [self.state.blend_color[3]; 4] } else { self.state.blend_color };
        let stencil = self.state.stencil[0].reference as u32;
        let pass = &mut self.card.pass;
        pass.textures.extend(bound.iter().map(|&(texture, ..)| texture));
        let streams = if fixed.streams {
            let (end, start) = (pass.vertices.len(), pass.vertices.len().next_multiple_of(STREAM_ALIGN));
            pass.vertices.resize(start, 0);
            let streams = streams(&fixed.attributes, batch.vertices.len());
            pass.gaps.push([end, start]);
            for (pair, (_, format)) in streams.windows(2).zip(&fixed.attributes) {
                let [this, next] = [pair[0], pair[1]].map(|stream| start + stream as usize);
                pass.gaps.push([this + batch.vertices.len() * format.bytes() as usize, next]);
            }
            streams
        } else {
            Vec::new()
        };
        let (vertices, count) = (pass.vertices.len() as u64, indices.len() as u32);
        let first = (!batch.sequence).then_some(pass.indices.len() as u32);
        pass.vertices.extend_from_slice(&bytes);
        if first.is_some() {
            pass.indices.extend_from_slice(&indices);
        }
        let (writes, query) = (fixed.writes(), self.query);
        let textures = group;
        let draw = Draw {
            pipeline,
            uniforms,
            vertices,
            streams,
            first,
            count,
            textures,
            viewport,
            scissor,
            blend,
            stencil,
            writes,
            query,
        };
        self.card.draw(draw);
        Ok(())
    }

    /// Whether lines that become triangles are cut at the near plane and fogged by distance. The card's clipper interpolates distances that
    /// vertices have, as it does for triangles; these lines are cut before.
    fn cuts_fog(&self, key: &ShaderKey, batch: &Batch) -> bool {
        let lines = matches!(key.expand, Expand::Line | Expand::SmoothLine);
        let clip = to_clip(&self.projection.top, &self.modelview.top);
        let behind = |vertex: &Vertex| !(super::matrix::transform(&clip, vertex.position)[2] >= 0.0);
        lines && key.fogged() && !key.fog_coordinate && batch.vertices.iter().any(behind)
    }

    /// The key of a unit, and the texture of a target if it is complete.
    fn unit(&mut self, unit: usize, target: Option<usize>, class: Class) -> Outcome<(UnitKey, Option<Bound>)> {
        let bound = match target {
            None => None,
            Some(target) => {
                let name = self.state.units[unit].bound[target];
                self.texture(unit, target);
                let (table, key) =
                    if name == 0 { (&mut self.default_textures, target as u32) } else { (&mut self.textures, name) };
                match table.get_mut(&key) {
                    Some(texture) => texture.bind(&mut self.card)?,
                    None => None,
                }
            }
        };
        let state = &self.state.units[unit];
        let made: [Option<Made>; 4] = std::array::from_fn(|k| {
            let on = state.generated & 1 << k != 0;
            on.then(|| match state.generation[k].mode {
                e::OBJECT_LINEAR => Made::Object,
                e::SPHERE_MAP => Made::Sphere,
                e::REFLECTION_MAP => Made::Reflection,
                e::NORMAL_MAP => Made::Normal,
                _ => Made::Eye,
            })
        });
        let m = &self.texture_matrices[unit].top;
        let env = &state.environment;
        let environment = match env.mode {
            e::COMBINE => EnvironmentKey::Combine(env.combine, env.sources, env.operands, env.scales != [1.0; 2]),
            mode => EnvironmentKey::Mode(mode),
        };
        let sprite = class == Class::Points && self.state.is(e::POINT_SPRITE) && self.state.point_sprites & 1 << unit != 0;
        let key = UnitKey {
            unit,
            coordinates: false,
            sampled: false,
            kind: target.map_or(Kind::D2, kind_of),
            base: bound.as_ref().map_or(Base::Rgba, |bound| bound.base),
            clamp: bound.as_ref().map_or([false; 3], |bound| bound.clamp),
            depth: bound.as_ref().map_or(super::texture::DepthRead::No, |bound| bound.depth),
            matrix: *m != IDENTITY && !sprite,
            projective: made[3].is_some() || [m[3], m[7], m[11], m[15]] != [0.0, 0.0, 0.0, 1.0],
            bias: env.bias + bound.as_ref().map_or(0.0, |bound| bound.bias) != 0.0,
            made,
            sprite,
            environment,
        };
        Ok((key, bound))
    }

    fn key(&self, batch: &Batch, mut units: Vec<UnitKey>) -> Outcome<ShaderKey> {
        let state = &self.state;
        for unit in units.iter_mut().filter(|unit| !unit.projective && !unit.sprite) {
            unit.projective = batch.vertices.iter().any(|vertex| vertex.texture(unit.unit)[3] != 1.0);
        }
        let back = batch.polygon == Some(true) && state.two_side;
        let lighting = state.is(e::LIGHTING).then(|| {
            let lights = state.lights.iter().enumerate().filter(|(k, _)| state.is(e::LIGHT0 + *k as u32));
            let lights: Vec<LightKey> = lights
                .map(|(_, light)| LightKey {
                    directional: light.position[3] == 0.0,
                    spot: light.spot_cutoff != 180.0,
                    attenuated: light.attenuation != [1.0, 0.0, 0.0],
                })
                .collect();
            let tracked = match state.color_material[1] {
                _ if !state.is(e::COLOR_MATERIAL) => 0,
                e::AMBIENT => 1,
                e::DIFFUSE => 2,
                e::AMBIENT_AND_DIFFUSE => 3,
                e::SPECULAR => 4,
                _ => 8,
            };
            let face = |face: u32| {
                if matches!(state.color_material[0], f if f == face || f == e::FRONT_AND_BACK) { tracked } else { 0 }
            };
            let two_side = state.two_side && batch.class == Class::Triangles;
            let shiny = |face: usize| state.materials[face].specular[..3] != [0.0; 3] || tracked == 4;
            LightingKey {
                specular: !lights.is_empty() && (shiny(0) || two_side && shiny(1) || back && shiny(1)),
                lights,
                local_viewer: state.local_viewer,
                two_side,
                separate: state.separate_specular,
                color_material: [face(e::FRONT), face(e::BACK)],
            }
        });
        let normalize = if state.is(e::NORMALIZE) { 1 } else { 2 * u8::from(state.is(e::RESCALE_NORMAL)) };
        let attenuated_point = batch.class == Class::Points && state.point_attenuation != [1.0, 0.0, 0.0];
        let sprite = units.iter().any(|unit| unit.sprite);
        let expand = match batch.class {
            Class::Points if state.is(e::POINT_SMOOTH) && !state.is(e::POINT_SPRITE) => Expand::SmoothPoint,
            Class::Points if state.point_size > 1.0 || attenuated_point || sprite => Expand::Point,
            Class::Lines if state.is(e::LINE_SMOOTH) => Expand::SmoothLine,
            Class::Lines if state.line_width >= 1.5 => Expand::Line,
            _ => Expand::No,
        };
        Ok(ShaderKey {
            varying: Varying::default(),
            lighting,
            normalize,
            units,
            color_sum: state.is(e::COLOR_SUM) && !state.is(e::LIGHTING),
            flat: state.flat,
            fog: state.is(e::FOG).then_some(state.fog_mode),
            fog_coordinate: state.is(e::FOG) && state.fog_from_coordinate,
            alpha: (state.is(e::ALPHA_TEST) && state.alpha.0 != e::ALWAYS).then_some(state.alpha.0),
            planes: (0..PLANES).filter(|&k| state.is(e::CLIP_PLANE0 + k as u32)).fold(0, |all, k| all | 1 << k),
            stipple: batch.class == Class::Triangles && state.is(e::POLYGON_STIPPLE),
            line_stipple: batch.class == Class::Lines && self.line_stippled(),
            pixels: self.pixels.is_some(),
            expand,
            attenuated_point,
            logic: (state.is(e::COLOR_LOGIC_OP) && !matches!(state.logic, e::COPY | e::NOOP)).then_some(state.logic),
            back,
            vertex: None,
            fragment: None,
        })
    }

    /// Whether colours are blended by the constant's alpha, and none by its colour: then the card's constant has it in all channels.
    fn constant_alpha(&self) -> bool {
        let [source, destination, ..] = self.state.blend;
        let uses = |factors: [u32; 2]| factors.contains(&source) || factors.contains(&destination);
        uses([e::CONSTANT_ALPHA, e::ONE_MINUS_CONSTANT_ALPHA]) && !uses([e::CONSTANT_COLOR, e::ONE_MINUS_CONSTANT_COLOR])
    }

    /// State that is fixed in a pipeline.
    fn fixed(
        &self,
        target: &Target,
        shader: num::ShaderId,
        attributes: Vec<(u32, VertexFormat)>,
        batch: &Batch,
        key: &ShaderKey,
        textures: usize,
    ) -> Outcome<Fixed> {
        let state = &self.state;
        let (class, topology) = (batch.class, batch.topology);
        let triangles = class == Class::Triangles;
        let cull_mode = match state.cull {
            _ if !triangles || !state.is(e::CULL_FACE) => CullMode::None,
            e::FRONT => CullMode::Front,
            _ => CullMode::Back,
        };
        let topology = match class {
            _ if key.expand != Expand::No => Topology::TriangleList,
            Class::Points => Topology::PointList,
            Class::Lines => Topology::LineList,
            Class::Triangles => topology.unwrap_or(Topology::TriangleList),
        };
        let primitive = Primitive {
            topology,
            front_face: if (state.front == e::CW) ^ target.upward ^ batch.turned { FrontFace::Cw } else { FrontFace::Ccw },
            cull_mode,
            provoking_last: true,
            ..Primitive::default()
        };
        let tested = state.is(e::DEPTH_TEST) && target.has_depth;
        let stencil = state.is(e::STENCIL_TEST) && target.has_stencil;
        let two_side =
            state.is(e::STENCIL_TEST_TWO_SIDE_EXT) || state.stencil_face.is_none() && state.stencil[0] != state.stencil[1];
        let [front, back] = [0, usize::from(two_side)].map(|k| state.stencil[k]);
        if stencil
            && (front.reference, front.read & 255, front.write & 255) != (back.reference, back.read & 255, back.write & 255)
        {
            return Err(Fault::Unsupported("stencil references or masks that differ between faces".into()));
        }
        let face = |side: super::state::Stencil| -> Outcome<StencilFace> {
            if !stencil {
                return Ok(StencilFace::default());
            }
            let [fail, depth_fail, pass] = side.ops;
            Ok(StencilFace {
                compare: compare(side.compare),
                fail_op: stencil_operation(fail)?,
                depth_fail_op: stencil_operation(depth_fail)?,
                pass_op: stencil_operation(pass)?,
            })
        };
        let offset = match class {
            Class::Triangles => e::POLYGON_OFFSET_FILL,
            Class::Lines => e::POLYGON_OFFSET_LINE,
            Class::Points => e::POLYGON_OFFSET_POINT,
        };
        let [factor, units] = match state.is(offset) {
            true if triangles => state.polygon_offset,
            true if self.state.polygon_modes != [e::FILL; 2] && state.polygon_offset != [0.0; 2] => {
                return Err(Fault::Unsupported("polygon offset of lines and points".into()));
            }
            _ => [0.0; 2],
        };
        let (stencil_front, stencil_back) = (face(front)?, face(back)?);
        let depth = target.depth.map(|surface| DepthStencil {
            format: surface.format,
            depth_write: tested && state.depth_write,
            depth_compare: if tested { compare(state.depth_func) } else { Compare::Always },
            stencil_front,
            stencil_back,
            stencil_read_mask: if stencil { front.read & 0xff } else { 0xff },
            stencil_write_mask: if stencil { front.write & 0xff } else { 0xff },
            bias: if units >= 0.0 { (units + 0.5) as i32 } else { (units - 0.5) as i32 },
            bias_slope: factor,
            bias_clamp: 0.0,
        });
        let color = target.color.map(|surface| surface.format);
        let [source, destination, source_alpha, destination_alpha] = state.blend;
        let alone = self.constant_alpha();
        let blend = if state.is(e::BLEND) && !state.is(e::COLOR_LOGIC_OP) {
            let component = |src: u32, dst: u32, op: u32, alpha: bool| -> Outcome<BlendComponent> {
                let op = blend_operation(op)?;
                // The card's own rule: these do not weight.
                if matches!(op, BlendOp::Min | BlendOp::Max) {
                    return Ok(BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op });
                }
                Ok(BlendComponent { src: blend_factor(src, alpha || alone)?, dst: blend_factor(dst, alpha || alone)?, op })
            };
            let color = component(source, destination, state.blend_ops[0], false)?;
            Some(Blend { color, alpha: component(source_alpha, destination_alpha, state.blend_ops[1], true)? })
        } else {
            None
        };
        let noop = state.is(e::COLOR_LOGIC_OP) && state.logic == e::NOOP;
        let mask = if noop { 0 } else { self.mask() };
        let streams = batch.sent.is_some() && attributes.len() <= STREAMS_MAX;
        Ok(Fixed { shader, attributes, streams, primitive, color, depth, blend, mask, textures })
    }
}

/// Attributes that differ between vertices.
fn varying(batch: &Batch, first: &Vertex, key: &ShaderKey) -> Varying {
    let mut varying = Varying::default();
    if batch.sent == Some(Sent::Read) {
        varying = Varying { color: true, normal: true, secondary: true, fog: true, texture: [true; UNITS], generic: u16::MAX };
    }
    for vertex in &batch.vertices {
        varying.color |= vertex.color != first.color;
        varying.normal |= vertex.normal != first.normal;
        varying.secondary |= vertex.secondary != first.secondary;
        varying.fog |= vertex.fog != first.fog;
        varying.texture[0] |= vertex.texture(0) != first.texture(0);
        if vertex.shares(first) {
            continue;
        }
        for unit in 1..UNITS {
            varying.texture[unit] |= vertex.texture(unit) != first.texture(unit);
        }
        if key.vertex.is_some() {
            for k in 1..GENERICS {
                varying.generic |= u16::from(vertex.generic(k) != first.generic(k)) << k;
            }
        }
    }
    varying.color &= key.color();
    varying.normal &= key.normal();
    varying.secondary &= key.vertex_secondary();
    varying.fog &= key.vertex_fog();
    for unit in 0..UNITS {
        varying.texture[unit] &= key.vertex_texture(unit);
    }
    for k in 0..GENERICS {
        varying.generic &= !(u16::from(!key.reads(input::GENERIC + k as u32)) << k);
    }
    varying
}
