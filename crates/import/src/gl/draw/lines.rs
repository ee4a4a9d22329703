//! Points, lines and triangles before they are appended: patterns of lines, and lines that are clipped before the card lights them.

use gl_shader::arb::program::ProgramStage;
use gl_shader::consts as e;

use crate::gl::call::GlResult;
use crate::gl::geometry::clip::{VIEW_VOLUME, to_clip};
use crate::gl::geometry::primitive::Class;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;

impl Gl {
    /// Appends primitives to the batch.
    pub fn add(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> GlResult {
        if indices.is_empty() {
            return Ok(());
        }
        if class == Class::Lines && self.line_stippled() {
            return self.dashed(polygon, vertices, indices);
        }
        if class == Class::Lines
            && self.state.is(e::LIGHTING)
            && self.widens_lines()
            && self.active_program(ProgramStage::Vertex)?.is_none()
        {
            let clip = to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top);
            let outside = |vertex: &Vertex| {
                let position = matrix::transform(&clip, vertex.position);
                VIEW_VOLUME.iter().any(|plane| !(plane(position) >= 0.0))
            };
            if vertices.iter().any(outside) {
                // They are clipped before the card lights them, and what lies between ends has a colour between theirs.
                let mut vertices = vertices.to_vec();
                self.light(&mut vertices, polygon == Some(true));
                return self.append_lit(class, polygon, &vertices, indices);
            }
        }
        self.append(class, polygon, vertices, indices)
    }
}
