//! Primitives become lists of points, lines or triangles. They are batched into one draw until the state changes.

use gl_shader::consts as e;

use crate::gl::call::{Fault, GlResult, INVALID_ENUM};
use crate::gl::draw::lit::colors;
use crate::gl::geometry::primitive::{Class, class_of, points_and_lines, triangles};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::state::materials::ChangingMaterial;
use crate::gl::state::server::capability;

/// Maximum number of vertices between Begin and End.
const VERTICES_MAX: usize = 1 << 22;

impl Gl {
    /// Draws a primitive of these vertices.
    pub fn primitive(&mut self, mode: u32, vertices: &[Vertex]) -> GlResult {
        self.joined(mode, vertices)?;
        // A call that changes a buffer does not end a batch.
        if self.options.keep_draws || self.objects.glsl.reads_blocks(self.context.glsl_program) { self.flush() } else { Ok(()) }
    }

    /// Appends a primitive of these vertices to those that wait.
    fn joined(&mut self, mode: u32, vertices: &[Vertex]) -> GlResult {
        if !self.context.render_mode.draws() || vertices.is_empty() {
            return Ok(());
        }
        if mode > e::POLYGON {
            return Err(INVALID_ENUM);
        }
        let class = class_of(mode);
        if class == Class::Triangles {
            return self.polygons(mode, vertices);
        }
        self.add(class, None, vertices, &points_and_lines(mode, vertices.len() as u32))
    }

    /// Triangles, quadrilaterals and polygons.
    fn polygons(&mut self, mode: u32, vertices: &[Vertex]) -> GlResult {
        let n = vertices.len() as u32;
        if let Some((topology, count)) = self.assembled(mode, n).filter(|_| self.options.keep_draws) {
            self.flush()?;
            // A triangle strip has the other diagonal, unless each pair of vertices is exchanged.
            let turned = mode == e::QUAD_STRIP;
            self.keep(vertices, (0..count).map(|i| if turned { i ^ 1 } else { i }), Some(topology));
            self.drawing.batch.turned = turned;
            return Ok(());
        }
        if mode == e::QUADS && self.fills() {
            return self.quads(vertices);
        }
        let triangles = triangles(mode, n, &[]);
        if self.fills() {
            return self.add(Class::Triangles, None, vertices, triangles.as_flattened());
        }
        self.outlines(mode, vertices, &triangles)
    }
}

impl Gl {
    /// Draws the vertices between Begin and End, or those before a change of material. If their materials differ, colour material gives them.
    pub fn send(&mut self, mode: u32, vertices: &[Vertex]) -> GlResult {
        let key = match self.context.changing_material.take() {
            None => return self.primitive(mode, vertices),
            Some(ChangingMaterial::Color(key, _)) => key,
            Some(ChangingMaterial::Lit) => {
                let enabled = self.without_lighting();
                return self.with_enabled(enabled, |gl| gl.primitive(mode, vertices));
            }
        };
        self.flush()?;
        let (enabled, saved) = (self.state.enabled, self.state.lighting.color_material);
        self.state.enabled |= capability(e::COLOR_MATERIAL).unwrap_or(0);
        self.state.lighting.color_material = key;
        let outcome = self.primitive(mode, vertices).and_then(|()| self.flush());
        (self.state.enabled, self.state.lighting.color_material) = (enabled, saved);
        outcome
    }

    /// Sends a vertex with the current attributes. Outside Begin and End it has no effect.
    pub fn vertex_at(&mut self, position: [f32; 4]) -> GlResult {
        let mut vertex = self.state.current.clone();
        vertex.position = position;
        match self.context.changing_material {
            None => {}
            Some(ChangingMaterial::Color(_, color)) => vertex.color = color,
            Some(ChangingMaterial::Lit) => {
                (vertex.color, vertex.secondary) = colors(&self.state, &self.context.matrices.modelview.top, &vertex);
            }
        }
        let Some((_, vertices)) = &mut self.context.open_primitive else { return Ok(()) };
        if vertices.len() >= VERTICES_MAX {
            return Err(Fault::Limit(format!("more than {VERTICES_MAX} vertices between glBegin and glEnd")));
        }
        vertices.push(vertex);
        Ok(())
    }
}
