//! Recording: what a draw leaves for a machine to do.

use std::sync::Arc;

use gfx::stage::{Stage, StageMap};
use gfx::traverse::Block;
use shader::{QuadCost, Recorder};
use work::{self, AttributeFetch, Culling, End, Primitive, RecordedState, Segment, ShaderShape, Target, TileWork, Visit};

use super::batch::Batch;
use super::needless::{self, Late};
use super::plan::Piece;
use super::stream::Stream;
use super::tile::quads_in;
use super::{DrawCall, DrawState};

/// A quad that is covered and not shaded; it is that of bit `at` of a block's pixels.
#[inline(always)]
const fn covered(at: u32, coverage: u16) -> work::Quad {
    work::Quad { coverage, kept: coverage, position: (at / 4) as u8, flags: 0, cost: 0, payload: 0, first_request: 0 }
}

/// The quads of a block of pixels with one sample that is covered whole.
const WHOLE: [work::Quad; 16] = {
    let mut quads = [covered(0, 15); 16];
    let mut q = 0;
    while q < 16 {
        quads[q] = covered(4 * q as u32, 15);
        q += 1;
    }
    quads
};

/// Quads of a block up to which they are noted one after another.
pub const FEW: u32 = 3;

/// Notes what shading a quad came to, and where its payload begins.
#[inline(always)]
pub fn shaded(quad: &mut work::Quad, kept: u16, cost: &QuadCost, payload: u32) {
    quad.flags |= work::QUAD_SHADED;
    (quad.kept, quad.cost, quad.first_request, quad.payload) = (kept, cost.cost, cost.first_request, payload);
}

/// The recorded work of a tile.
#[derive(Default)]
pub struct TileRecord {
    /// The tile's work.
    pub work: TileWork,
    /// Batch and number of each triangle that covers samples here, and the end of its blocks.
    visits: Vec<(u32, u32, u32)>,
}

/// The size of the records of recent tiles. It is the maximum, less a 64th for each later tile that has less: neighbours differ, and a list that
/// has to grow is copied.
#[derive(Default)]
pub struct Room {
    blocks: usize,
    quads: usize,
    payload: usize,
    visits: usize,
}

impl TileRecord {
    /// Notes a block and its quads; returns the number of the first.
    #[inline(always)]
    pub fn begin_block<const S: usize>(&mut self, block: &Block<S>, per_sample: bool) -> u32 {
        let quads = &mut self.work.quads;
        let first = quads.len();
        let mut left = quads_in(block.pixels());
        if per_sample {
            while left != 0 {
                let at = left.trailing_zeros();
                left &= left - 1;
                let mask = block.quad_mask(at as usize / 4);
                quads.extend((0..S).map(|s| mask & 15 << (4 * s)).filter(|m| *m != 0).map(|mask| covered(at, mask)));
            }
        } else {
            if S == 1 && left.count_ones() > FEW {
                // The list gets 16 quads, which takes no call to copy them. Most blocks have all their quads covered.
                quads.extend_from_slice(&WHOLE);
                if block.samples[0] != !0 {
                    let mut n = 0;
                    for quad in &mut quads[first..] {
                        if left == 0 {
                            break;
                        }
                        let at = left.trailing_zeros();
                        left &= left - 1;
                        *quad = covered(at, block.quad_mask(at as usize / 4));
                        n += 1;
                    }
                    quads.truncate(first + n);
                }
            } else {
                while left != 0 {
                    let at = left.trailing_zeros();
                    left &= left - 1;
                    quads.push(covered(at, block.quad_mask(at as usize / 4)));
                }
            }
        }
        self.work.blocks.push(work::Block {
            first_quad: first as u32,
            x: block.x / 8,
            y: block.y / 8,
            quads: (quads.len() - first) as u8,
            full: block.full,
        });
        first as u32
    }

    /// Recorded quads of a block before its quad `q`, where the program runs once per sample.
    pub fn samples_before<const S: usize>(block: &Block<S>, q: usize) -> u32 {
        let samples = |q: usize| (0..S).filter(|s| block.quad_mask(q) >> (4 * s) & 15 != 0).count() as u32;
        (0..q).map(samples).sum()
    }

    /// Ends the blocks of a triangle.
    pub fn end_visit(&mut self, batch: u32, number: u32) {
        self.visits.push((batch, number, self.work.blocks.len() as u32));
    }

    /// Begins with room for half as much again as other tiles had: memory that is not written costs nothing, and what is left is given back.
    pub fn begin(&mut self, room: &Room) {
        let more = |room: usize| room + room / 2;
        self.work.blocks.reserve_exact(more(room.blocks));
        self.work.quads.reserve_exact(more(room.quads));
        self.work.payload.reserve_exact(more(room.payload));
        self.visits.reserve_exact(more(room.visits));
    }

    /// Takes costs and requests over.
    pub fn finish(&mut self, recorder: &mut Recorder, room: &mut Room) {
        self.work.invocations = recorder.take();
        let work = &self.work;
        let (blocks, quads, payload) = (work.blocks.len(), work.quads.len(), work.payload.len());
        let most = |had: usize, has: usize| has.max(had - had / 64);
        *room = Room {
            blocks: most(room.blocks, blocks),
            quads: most(room.quads, quads),
            payload: most(room.payload, payload),
            visits: most(room.visits, self.visits.len()),
        };
        // Segments wait for the machine.
        self.work.quads.shrink_to_fit();
        self.work.blocks.shrink_to_fit();
        self.work.payload.shrink_to_fit();
        self.work.invocations.shrink_to_fit();
    }
}

/// The state of draws as a machine needs it.
pub fn state(state: &DrawState, has_depth: bool) -> RecordedState {
    let pipeline = &*state.pipeline;
    let shape = |kind: Stage| {
        let interface = pipeline.stage(kind).filter(|_| state.runs(kind))?.interface();
        let inputs = match kind {
            Stage::Vertex => pipeline.attributes.iter().map(|a| a.components).sum(),
            Stage::Fragment => pipeline.interpolated,
            Stage::Compute => 0,
        };
        Some(ShaderShape {
            registers: interface.registers,
            inputs: inputs as u32,
            outputs: interface.outputs.iter().map(|slot| slot.components).sum(),
        })
    };
    let mut targets: Vec<Option<Target>> = pipeline
        .targets
        .iter()
        .map(|target| {
            let none = |t: &super::super::pipeline::TargetOutput| Target {
                blend: None,
                logic: None,
                write_mask: t.state.write_mask,
                payload: None,
                words: 0,
                packed: false,
                second: None,
            };
            target.as_ref().map(none)
        })
        .collect();
    for target in &state.targets {
        let of = pipeline.targets[target.location].expect("a target of the pipeline").state;
        targets[target.location] = Some(Target {
            blend: of.blend.filter(|_| !target.packed),
            logic: of.logic,
            write_mask: of.write_mask,
            payload: Some(4 * target.payload as u8),
            words: target.payload_words as u8,
            packed: target.packed,
            second: target.payload_second.map(|word| 4 * word as u8),
        });
    }
    let viewport = state.dynamic.viewport;
    RecordedState {
        number: state.number,
        label: pipeline.label.clone(),
        shapes: StageMap::from_fn(shape),
        depth_stencil: pipeline.depth_stencil.filter(|_| has_depth),
        stencil_references: state.dynamic.stencil_references.map(|reference| reference as u8),
        targets,
        blend_constant: state.dynamic.blend_constant,
        depth_words: 4 * state.depth_payload as u8,
        payload_words: 4 * state.payload_words as u8,
        early: state.early,
        // Only what is certain to fail is culled, so that failures must not change the stencil.
        hierarchical_z: state.early && state.depth.is_some_and(|d| !d.counts_failures() && d.reads_depth()),
        depth_range: [viewport.min_depth.min(viewport.max_depth), viewport.min_depth.max(viewport.max_depth)],
    }
}

/// A draw as a machine needs it.
pub fn draw(call: &DrawCall<'_>, state: &Arc<RecordedState>, culling: Culling) -> work::Draw {
    // Attributes that are read come first: consumers that take the first attribute for the position get one that is read.
    let attributes = call.pipeline.attributes.iter().chain(&call.pipeline.unread).map(|attribute| {
        let address = call.vertex_buffers.get(attribute.buffer).and_then(Option::as_ref).map_or(0, |b| b.address);
        AttributeFetch {
            address: address + attribute.offset,
            stride: attribute.stride,
            step: attribute.step,
            bytes: attribute.format.bytes(),
        }
    });
    work::Draw {
        number: call.number,
        site: call.site,
        groups: call.groups.clone(),
        state: state.clone(),
        attributes: attributes.collect(),
        signature: call.signature,
        culling,
        reach: call.reach.clone(),
    }
}

/// Puts a segment together from its batches and tiles; `segment` holds the vertices already. The batches give their memory back.
pub fn assemble(
    call: &DrawCall<'_>,
    pieces: &[Piece],
    stream: &Stream,
    batches: &mut [Batch],
    tiles: Vec<(u32, u32, TileRecord)>,
    mut segment: Segment,
) -> Segment {
    if let Some(index) = call.index {
        let bytes = index.format.bytes();
        segment.index_bytes = bytes;
        let first = pieces.first().map_or(0, |p| p.start);
        segment.index_address = Some(index.range.address + u64::from(bytes) * (u64::from(call.range.first) + u64::from(first)));
    }
    // A restart takes a place in the stream: where each piece's entries begin there.
    let mut shifts = Vec::with_capacity(pieces.len());
    segment.stream.reserve(stream.entries.len() + pieces.len());
    for (i, piece) in pieces.iter().enumerate() {
        if piece.restart && i > 0 {
            segment.stream.push(u32::MAX);
        }
        shifts.push(segment.stream.len() as u32 - piece.stream);
        segment.stream.extend_from_slice(&stream.entries[piece.stream as usize..][..piece.entries() as usize]);
    }
    let mut first_triangle = Vec::with_capacity(batches.len());
    let (mut piece, mut late) = (0, Vec::new());
    segment.primitives.reserve_exact(batches.iter().map(|b| b.ended.len()).sum());
    segment.triangles.reserve_exact(batches.iter().map(|b| b.triangles.len()).sum());
    for batch in batches {
        let triangles = segment.triangles.len() as u32;
        first_triangle.push(triangles);
        for (number, ended) in (batch.first_primitive..).zip(&batch.ended) {
            while pieces.get(piece + 1).is_some_and(|p| p.first_primitive <= number) {
                piece += 1;
            }
            segment.primitives.push(Primitive {
                vertices: ended.vertices,
                stream_end: ended.stream_end + shifts[piece],
                first_triangle: triangles + ended.first_triangle,
                triangles: ended.triangles,
                clipped: ended.clipped,
                cut_away: false,
                outcome: ended.outcome,
            });
        }
        for ((triangle, primitive), &unclipped) in batch.triangles.iter().zip(&batch.primitive).zip(&batch.unclipped) {
            let b = triangle.bounds;
            segment.triangles.push(work::Triangle {
                primitive: batch.first_primitive + primitive,
                depth: triangle.depth,
                back: !triangle.front,
                bounds: [b.x0 / 8, b.y0 / 8, b.x1.div_ceil(8), b.y1.div_ceil(8)],
                pixels: [b.x0, b.y0, b.x1, b.y1],
                unclipped,
                first_visit: 0,
                visits: 0,
                end: End::Nowhere,
            });
        }
        late.extend(batch.late.iter().map(|one| Late { primitive: batch.first_primitive + one.primitive, ..*one }));
        batch.release();
    }
    // Visits by triangle, and in row-major order of tiles inside: counted, then filled in tile by tile.
    let triangle_of = |batch: u32, number: u32| (first_triangle[batch as usize] + number) as usize;
    for (_, _, tile) in &tiles {
        for &(batch, number, _) in &tile.visits {
            segment.triangles[triangle_of(batch, number)].visits += 1;
        }
    }
    let mut visits = 0;
    for triangle in &mut segment.triangles {
        triangle.first_visit = visits;
        visits += triangle.visits;
        triangle.visits = 0;
    }
    segment.visits.resize(visits as usize, Visit { tile: 0, first_block: 0, blocks: 0 });
    for (x, y, tile) in tiles {
        let number = segment.tiles.len() as u32;
        let mut first_block = 0;
        for &(batch, triangle, end) in &tile.visits {
            let triangle = &mut segment.triangles[triangle_of(batch, triangle)];
            let at = (triangle.first_visit + triangle.visits) as usize;
            segment.visits[at] = Visit { tile: number, first_block, blocks: end - first_block };
            triangle.visits += 1;
            first_block = end;
        }
        if !tile.visits.is_empty() {
            segment.tiles.push(TileWork { x: x as u16, y: y as u16, ..tile.work });
        }
    }
    // A primitive that was set up and covers nothing ended for that reason.
    for primitive in &mut segment.primitives {
        let triangles = &segment.triangles[primitive.first_triangle as usize..][..usize::from(primitive.triangles)];
        if primitive.outcome == work::PrimitiveOutcome::Drawn && triangles.iter().all(|t| t.visits == 0) {
            primitive.outcome = work::PrimitiveOutcome::NoSample;
        }
    }
    needless::insert(&mut segment, &late, call.options.key.needless.no_sample);
    segment
}
