//! Converts the batch to a draw of the card: key, uniforms, vertices, pipeline.

use gfx::state::IndexFormat;
use glam::Mat4;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::pass::{Draw, Order, VertexRange};
use crate::gl::draw::prepare::Preparation;
use crate::gl::draw::streams::OnCard;
use crate::gl::draw::uniforms;
use crate::gl::geometry::clip::to_clip;
use crate::gl::geometry::pack::{DrawInput, STREAM_ALIGN, streams};
use crate::gl::geometry::primitive::Batch;
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::state::prepared::Prepared;

impl Gl {
    /// Draws the batch.
    pub fn flush(&mut self) -> GlResult {
        self.drawing.after_small_list = false;
        if self.drawing.batch.indices.is_empty() {
            return Ok(());
        }
        let mut batch = std::mem::take(&mut self.drawing.batch);
        if let Some(geometry) = self.drawing.first_listed.take() {
            geometry.alone.set(batch.vertices.len() == geometry.vertices.len());
        }
        let outcome = self.draw(&mut batch, None);
        if self.drawing.batch.indices.is_empty() {
            // The memory is reused.
            batch.vertices.clear();
            batch.indices.clear();
            self.drawing.batch = Batch { vertices: batch.vertices, indices: batch.indices, ..Batch::default() };
        }
        // The call that ends the batch is not the one with the unsupported draw.
        self.settled(outcome)
    }

    /// Counts the unsupported feature or the error of a draw. The call that follows it runs.
    pub fn settled(&mut self, outcome: GlResult) -> GlResult {
        match outcome {
            Err(Fault::Unsupported(what)) => {
                self.log.refuse(what);
                Ok(())
            }
            Err(Fault::Error(error)) => {
                self.log.note_error(&format!("a draw: {error}"));
                Ok(())
            }
            other => other,
        }
    }

    /// Draws a batch, or vertices that stay on the card: then the batch gives only their type.
    pub fn draw(&mut self, batch: &mut Batch, on_card: Option<OnCard<'_>>) -> GlResult {
        let (mut constant, mut summary) = match on_card {
            Some(OnCard::List(geometry)) => geometry.over(&self.state.current),
            Some(OnCard::Buffers(resident)) => (resident.constant.clone(), resident.summary),
            None => (batch.vertices[batch.indices[0] as usize].clone(), Summary::of(&batch.vertices)),
        };
        match self.prepare(batch, on_card, &mut constant, &mut summary)? {
            Preparation::Nothing => {}
            Preparation::Ready(prepared) => self.submit(&prepared, batch, on_card, &constant),
        }
        Ok(())
    }

    /// Records a prepared draw.
    fn submit(&mut self, prepared: &Prepared, batch: &Batch, on_card: Option<OnCard<'_>>, constant: &Vertex) {
        let packing = &prepared.packing;
        let own = |offset: u64| VertexRange { buffer: None, offset };
        let (vertices, order, count) = match on_card {
            Some(OnCard::List(geometry)) => {
                let ([vertices, indices], count) = self.card.list_buffers(geometry, packing);
                let order = Order::Indices { buffer: Some(indices), format: IndexFormat::Uint32, first: 0, base: 0 };
                (vec![VertexRange { buffer: Some(vertices), offset: 0 }], order, count)
            }
            Some(OnCard::Buffers(resident)) => {
                let vertices = prepared.streams.as_ref().map_or_else(Vec::new, |streams| self.vertex_ranges(resident, streams));
                (vertices, self.order(resident), resident.count)
            }
            None => {
                let clip = if packing.cuts() {
                    to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top)
                } else {
                    Mat4::IDENTITY
                };
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
                let drawn = DrawInput { vertices: &batch.vertices, indices: &batch.indices };
                packing.write(drawn, &clip, self.state.lighting.flat, &mut pass.vertices, &mut pass.indices);
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
            return;
        }
        let pipeline = self.card.pipeline(&prepared.fixed);
        let bound = &prepared.bound;
        let textures = (!bound.is_empty()).then(|| self.card.textures(bound));
        let uniforms = uniforms::bytes(&prepared.key, &prepared.source(self, constant));
        let uniforms = self.card.uniforms(&uniforms);
        for &(texture, ..) in &prepared.bound {
            self.card.pass.textures.insert(texture, ());
        }
        self.card.draw(Draw {
            pipeline,
            uniforms,
            vertices,
            order,
            count,
            textures,
            viewport: prepared.viewport,
            scissor: prepared.scissor,
            blend: prepared.blend,
            stencil: self.stencil_tests(batch.class).map(|test| test.reference as u32),
            writes: prepared.writes,
            query: self.context.query,
            made: batch.made.clone().unwrap_or_else(|| self.made()),
        });
    }
}
