//! Appends primitives to the batch.

use gfx::state::Topology;

use crate::gl::call::GlResult;
use crate::gl::geometry::primitive::{Batch, Class, SentAttributes};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;

/// A batch is drawn when it has this number of vertices.
const BATCH_MAX: usize = 1 << 17;

impl Gl {
    /// Appends primitives to the batch, or draws them alone where they must be.
    pub fn append(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> GlResult {
        if indices.is_empty() {
            return Ok(());
        }
        let batch = &self.drawing.batch;
        let other = batch.class != class || batch.polygon != polygon;
        if !batch.indices.is_empty() && (other || batch.vertices.len() + vertices.len() > BATCH_MAX) {
            self.flush()?;
        }
        if self.options.keep_draws && class == Class::Triangles && polygon.is_none() {
            self.flush()?;
            self.keep(vertices, indices.iter().copied(), None);
            return Ok(());
        }
        let made = self.drawing.batch.indices.is_empty().then(|| self.made());
        let batch = &mut self.drawing.batch;
        batch.made = made.or(batch.made.take());
        (batch.class, batch.polygon) = (class, polygon);
        let base = batch.vertices.len() as u32;
        batch.vertices.extend_from_slice(vertices);
        batch.indices.extend(indices.iter().map(|index| base + index));
        Ok(())
    }

    /// Appends primitives whose vertices have been lit, as draws of their own.
    pub fn append_lit(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> GlResult {
        let enabled = self.without_lighting();
        self.with_enabled(enabled, |gl| gl.append(class, polygon, vertices, indices))
    }

    /// Draws with other enabled capabilities than the program's.
    pub fn with_enabled(&mut self, enabled: u64, draw: impl FnOnce(&mut Gl) -> GlResult) -> GlResult {
        self.flush()?;
        let own = std::mem::replace(&mut self.state.enabled, enabled);
        let outcome = draw(self).and_then(|()| self.flush());
        self.state.enabled = own;
        outcome
    }

    /// Makes triangles a draw of their own. They need no indices if the card assembles them from all vertices in order and the program
    /// sends no indices.
    pub fn keep(&mut self, vertices: &[Vertex], indices: impl Iterator<Item = u32>, topology: Option<Topology>) {
        let elements = self.drawing.elements.take();
        let sequence = topology.is_some() && elements.as_ref().is_none_or(|of| !of.indexed);
        let (vertices, indices, sent) = match elements {
            // The draw's own vertices, before its indices expanded them.
            Some(of) if of.numbers.len() == vertices.len() => {
                (of.vertices, indices.map(|index| of.numbers[index as usize]).collect(), of.sent)
            }
            _ => (vertices.to_vec(), indices.collect::<Vec<u32>>(), SentAttributes::Read),
        };
        let vertices =
            if sequence { indices.iter().map(|&index| vertices[index as usize].clone()).collect() } else { vertices };
        let indices = if sequence { (0..vertices.len() as u32).collect() } else { indices };
        let batch =
            Batch { class: Class::Triangles, polygon: None, sent: Some(sent), made: Some(self.made()), ..Batch::default() };
        self.drawing.batch = Batch { vertices, indices, topology, sequence, ..batch };
    }
}
