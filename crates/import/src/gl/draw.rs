//! Converts the batch to a draw of the card: key, uniforms, vertices, pipeline.

use gfx::state::IndexFormat;
use glam::Mat4;

use super::call::{Fault, Outcome};
use super::card::{Draw, Order, VertexRange};
use super::consts as e;
use super::key::*;
use super::machine::Gl;
use super::pack::{Drawn, STREAM_ALIGN, streams};
use super::prepare::Prepared;
use super::primitive::{Batch, Class};
use super::resident::Kept;
use super::state::{Stencil, Vertex, capability};
use super::summary::Summary;
use super::texture::Texture;
use super::uniforms::{self, to_clip};

/// The kind of texture of a target.
pub fn kind_of(target: usize) -> Kind {
    [Kind::D1, Kind::D2, Kind::Rectangle, Kind::D3, Kind::Cube][target]
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

    /// Counts the unsupported feature or the error of a draw. The call that follows it runs.
    pub fn settled(&mut self, outcome: Outcome) -> Outcome {
        match outcome {
            Err(Fault::Unsupported(what)) => {
                self.refuse(what);
                Ok(())
            }
            Err(Fault::Error(error)) => {
                self.note_error(&format!("a draw: {error}"));
                Ok(())
            }
            other => other,
        }
    }

    /// Draws a batch, or vertices that stay on the card: then the batch gives only their type.
    pub fn draw(&mut self, batch: &mut Batch, kept: Option<Kept<'_>>) -> Outcome {
        let (mut constant, mut summary) = match kept {
            Some(Kept::List(geometry)) => geometry.over(&self.state.current),
            Some(Kept::Buffers(resident)) => (resident.constant.clone(), resident.summary),
            None => (batch.vertices[batch.indices[0] as usize].clone(), Summary::of(&batch.vertices)),
        };
        let resident = matches!(kept, Some(Kept::Buffers(_)));
        let known = self.prepared.take().filter(|known| !resident && known.serves(self, batch, &summary));
        let mut prepared = match known {
            Some(known) => {
                debug_assert!(known.is_up_to_date(self, batch, &mut constant, &mut summary));
                known
            }
            None => match self.prepare(batch, kept, &mut constant, &mut summary)? {
                Some(prepared) => Box::new(prepared),
                None => return Ok(()),
            },
        };
        self.submit(&mut prepared, batch, kept, &constant);
        self.prepared = Some(prepared).filter(|prepared| prepared.lasts);
        Ok(())
    }

    /// Records a prepared draw.
    fn submit(&mut self, prepared: &mut Prepared, batch: &Batch, kept: Option<Kept<'_>>, constant: &Vertex) {
        let packing = &prepared.packing;
        let own = |offset: u64| VertexRange { buffer: None, offset };
        let (vertices, order, count) = match kept {
            Some(Kept::List(geometry)) => {
                let ([vertices, indices], count) = self.card.kept(geometry, packing);
                let order = Order::Indices { buffer: Some(indices), format: IndexFormat::Uint32, first: 0, base: 0 };
                (vec![VertexRange { buffer: Some(vertices), offset: 0 }], order, count)
            }
            Some(Kept::Buffers(resident)) => {
                let vertices = prepared.placed.as_ref().map_or_else(Vec::new, |placed| self.vertex_ranges(resident, placed));
                (vertices, self.order(resident), resident.count)
            }
            None => {
                let clip = if packing.cuts() { to_clip(&self.projection.top, &self.modelview.top) } else { Mat4::IDENTITY };
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
                packing.write(drawn, &clip, self.state.flat, &mut pass.vertices, &mut pass.indices);
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
        let pipeline = *prepared.pipeline.get_or_insert_with(|| self.card.pipeline(&prepared.fixed));
        let bound = &prepared.bound;
        let textures = (!bound.is_empty()).then(|| *prepared.group.get_or_insert_with(|| self.card.textures(bound)));
        let mut block = std::mem::take(&mut prepared.block);
        block.clear();
        let lit = prepared.lit.take();
        let lit = uniforms::bytes(&prepared.key, &prepared.source(self, constant), lit, &mut block);
        let uniforms = self.card.uniforms(&block);
        (prepared.block, prepared.lit) = (block, lit);
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
            stencil: self.state.stencil[0].reference as u32,
            writes: prepared.writes,
            query: self.query,
        });
    }

    /// Whether the stencil test has other references or masks for back-facing triangles.
    pub fn sides_differ(&self, batch: &Batch) -> bool {
        let of = |side: &Stencil| (side.reference, side.read & 255, side.write & 255);
        let [front, back] = &self.state.stencil;
        batch.class == Class::Triangles && self.state.is(e::STENCIL_TEST) && self.stencil_sides() && of(front) != of(back)
    }

    /// The card has one reference and one mask for both sides: each triangle is drawn twice, and one of the two is culled.
    pub(super) fn draw_sides(&mut self, batch: &Batch) -> Outcome {
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
                self.prepared = None;
                if outcome.is_err() {
                    break 'triangles;
                }
            }
        }
        (self.state.enabled, self.state.cull, self.state.stencil) = (enabled, cull, stencil);
        outcome
    }
}
