//! From vertices to triangles in tiles: assembly, clipping, culling, setup, and sorting by screen tile.

use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use crate::gfx::assemble::{Assembler, PrimitiveKind, provoking};
use crate::gfx::clip::{ClipVolume, Clipped, Polygon};
use crate::gfx::setup::{self, Culled, ScreenVertex, Shape, Triangle};
use crate::gfx::state::{PolygonMode, Topology};
use crate::num::SUBPIXEL;
use crate::work::{Funnel, Outcome, TILE};

use super::clip_distance;
use super::frame::{Frame, Worker};
use super::plan::{Piece, entries_of};
use super::stream::Stream;
use super::vertex::Vertices;

/// Primitives of a batch: one task assembles, clips and sets up as many.
pub const BATCH: u32 = 1024;

/// Marks a vertex that clipping made: its number is one among the batch's own.
pub const MADE: u32 = 1 << 31;

/// Marks a reference to a triangle that covers its tile whole.
pub const WHOLE: u32 = 1 << 31;

/// Where a triangle's attributes are: numbers of its vertices, and of the one that flat attributes come from.
#[derive(Clone, Copy, Debug)]
pub struct Corners {
    pub vertices: [u32; 3],
    pub flat: u32,
}

/// How a primitive ended, where work is recorded.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    pub vertices: [u32; 3],
    /// Stream entries read when it is complete.
    pub stream_end: u32,
    pub first_triangle: u32,
    pub triangles: u8,
    pub clipped: bool,
    pub outcome: Outcome,
}

/// Consecutive primitives and what becomes of them. Memory is kept from segment to segment.
#[derive(Default)]
pub struct Batch {
    /// Entries of the segment's stream.
    start: u32,
    len: u32,
    hub: Option<u32>,
    /// Primitives before this batch in the segment.
    pub first_primitive: u32,
    /// Primitives before this batch in its instance.
    pub first_index: u32,
    primitives: u32,
    pub triangles: Vec<Triangle>,
    pub corners: Vec<Corners>,
    /// Number in the batch of the primitive that each triangle belongs to.
    pub primitive: Vec<u32>,
    /// Whether a triangle covers a sample.
    pub covered: Vec<AtomicU8>,
    /// Varyings of vertices that clipping made.
    pub made: Vec<u32>,
    /// How each primitive ended, where work is recorded.
    pub ended: Vec<Ended>,
    /// First reference of each tile, and one more.
    tile_start: Vec<u32>,
    references: Vec<u32>,
    /// Quads that the triangles may touch, roughly and not less than half.
    pub quads_estimate: u64,
    pub funnel: Funnel,
}

/// Cuts the pieces of a segment into batches.
pub fn cut(topology: Topology, pieces: &[Piece], batches: &mut Vec<Batch>) -> usize {
    let mut n = 0;
    let mut first_index = 0;
    let mut instance = None;
    for piece in pieces {
        if instance != Some(piece.instance) {
            (instance, first_index) = (Some(piece.instance), 0);
        }
        for first in (0..piece.primitives).step_by(BATCH as usize) {
            let count = BATCH.min(piece.primitives - first);
            // A piece of a fan without its start has the hub as its first entry, so it is a fan itself.
            let (start, len, needs_hub) = entries_of(topology, first, count);
            if batches.len() == n {
                batches.push(Batch::default());
            }
            let batch = &mut batches[n];
            batch.start = piece.stream + start;
            batch.len = len;
            batch.hub = needs_hub.then_some(piece.stream);
            batch.first_primitive = piece.first_primitive + first;
            batch.first_index = first_index + first;
            batch.primitives = count;
            n += 1;
        }
        first_index += piece.primitives;
    }
    n
}

/// What a batch needs beside itself.
pub struct Input<'a, 'f> {
    pub frame: &'a Frame<'f>,
    pub stream: &'a Stream,
    pub vertices: &'a Vertices,
    /// Tiles across the attachments and in all.
    pub tiles: (u32, u32),
    /// Whether `ended` is wanted.
    pub record: bool,
}

impl Batch {
    /// Triangles that touch a tile, in order; [`WHOLE`] is set where one covers it.
    #[inline(always)]
    pub fn in_tile(&self, tile: usize) -> &[u32] {
        &self.references[self.tile_start[tile] as usize..self.tile_start[tile + 1] as usize]
    }

    /// Whether it has anything in a tile.
    #[inline(always)]
    pub fn touches(&self, tile: usize) -> bool {
        self.tile_start[tile] != self.tile_start[tile + 1]
    }

    /// Assembles, clips, culls, sets up and sorts.
    pub fn run(&mut self, input: &Input<'_, '_>, worker: &mut Worker) {
        self.triangles.clear();
        self.corners.clear();
        self.primitive.clear();
        self.made.clear();
        self.ended.clear();
        self.quads_estimate = 0;
        self.funnel = Funnel::default();
        worker.pairs.clear();
        self.assemble(input, &mut worker.pairs);
        self.funnel.primitives_in = u64::from(self.primitives);
        self.funnel.triangles_setup = self.triangles.len() as u64;
        self.covered.clear();
        self.covered.resize_with(self.triangles.len(), AtomicU8::default);
        self.sort(&worker.pairs, input.tiles.1 as usize);
    }

    fn assemble(&mut self, input: &Input<'_, '_>, pairs: &mut Vec<(u32, u32)>) {
        let frame = input.frame;
        let entries = &input.stream.entries[self.start as usize..][..self.len as usize];
        let primitive = &frame.pipeline.primitive;
        let kind = PrimitiveKind::of(frame.topology);
        let plain = kind == PrimitiveKind::Triangle
            && primitive.polygon_mode == PolygonMode::Fill
            && input.vertices.distance_stride == 0
            && !input.record;
        let flat = provoking(kind, primitive.provoking_last);
        if plain && frame.topology == Topology::TriangleList {
            // The case that matters: no assembler, and the cull reasons only counted.
            for (number, v) in entries.chunks_exact(3).enumerate() {
                self.triangle(input, number as u32, [v[0], v[1], v[2]], flat, pairs);
            }
            return;
        }
        let mut assembler = Assembler::new(frame.topology, primitive.provoking_last);
        let mut number = 0;
        let hub = self.hub.map(|at| input.stream.entries[at as usize]);
        let before = self.start;
        let mut polygon = Polygon::EMPTY;
        for (at, vertex) in hub.iter().copied().map(|v| (0, v)).chain((1..).zip(entries.iter().copied())) {
            assembler.push(vertex, &mut |v| {
                let first = self.triangles.len();
                let (outcome, clipped) = match (kind, primitive.polygon_mode) {
                    (PrimitiveKind::Triangle, PolygonMode::Fill) if plain => self.triangle(input, number, v, flat, pairs),
                    (PrimitiveKind::Triangle, PolygonMode::Fill) => {
                        self.general_triangle(input, number, v, flat, &mut polygon, pairs)
                    }
                    (PrimitiveKind::Triangle, mode) => self.outline(input, number, v, flat, mode, &mut polygon, pairs),
                    (PrimitiveKind::Line, _) => self.line(input, number, [v[0], v[1]], v[flat], true, &mut polygon, pairs),
                    (PrimitiveKind::Point, _) => self.point(input, number, v[0], v[0], true, pairs),
                };
                if input.record {
                    self.ended.push(Ended {
                        vertices: v,
                        stream_end: before + at,
                        first_triangle: first as u32,
                        triangles: (self.triangles.len() - first) as u8,
                        clipped,
                        outcome,
                    });
                }
                number += 1;
            });
        }
    }

    /// A filled triangle without clip distances. Counts what becomes of it.
    #[inline(always)]
    fn triangle(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: [u32; 3],
        flat: usize,
        pairs: &mut Vec<(u32, u32)>,
    ) -> (Outcome, bool) {
        let vertices = input.vertices;
        let at = v.map(|v| v as usize);
        let codes = at.map(|v| vertices.codes[v]);
        match ClipVolume::trivial(&codes) {
            Some(Clipped::Rejected) => (self.end(Outcome::Frustum), false),
            Some(_) => {
                let screen = at.map(|v| vertices.screen[v]);
                match setup::triangle(&input.frame.setup, &screen) {
                    Ok(triangle) => {
                        self.put(input, number, triangle, Corners { vertices: v, flat: v[flat] }, pairs);
                        (Outcome::Drawn, false)
                    }
                    Err(reason) => (self.end(outcome_of(reason)), false),
                }
            }
            None => self.general_triangle(input, number, v, flat, &mut Polygon::EMPTY.clone(), pairs),
        }
    }

    /// A filled triangle that may have to be cut.
    #[inline(never)]
    fn general_triangle(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: [u32; 3],
        flat: usize,
        polygon: &mut Polygon,
        pairs: &mut Vec<(u32, u32)>,
    ) -> (Outcome, bool) {
        let (frame, vertices) = (input.frame, input.vertices);
        let at = v.map(|v| v as usize);
        let codes = at.map(|v| vertices.codes[v]);
        let position = at.map(|v| vertices.clip[v]);
        let mut clipped = frame.clip.triangle(&position, codes, polygon);
        if vertices.distance_stride > 0 {
            clipped = clip_distance::triangle(vertices, v, &position, clipped, polygon);
        }
        match clipped {
            Clipped::Rejected => (self.end(Outcome::Frustum), false),
            Clipped::Whole => {
                let screen = at.map(|v| vertices.screen[v]);
                match setup::triangle(&frame.setup, &screen) {
                    Ok(triangle) => {
                        self.put(input, number, triangle, Corners { vertices: v, flat: v[flat] }, pairs);
                        (Outcome::Drawn, false)
                    }
                    Err(reason) => (self.end(outcome_of(reason)), false),
                }
            }
            Clipped::Cut => {
                self.funnel.clipped += 1;
                let first = self.triangles.len();
                let screen: Vec<ScreenVertex> = polygon.vertices().iter().map(|p| frame.screen.vertex(p.position)).collect();
                let made = self.make_vertices(input, v, polygon);
                // Of the reasons for which no part is drawn the one that is furthest down the pipeline is the primitive's.
                let mut reason = Outcome::Degenerate;
                for [a, b, c] in polygon.triangles() {
                    match setup::triangle(&frame.setup, &[screen[a], screen[b], screen[c]]) {
                        Ok(triangle) => {
                            let vertices = [a, b, c].map(|i| made + i as u32);
                            self.put(input, number, triangle, Corners { vertices, flat: v[flat] }, pairs);
                        }
                        Err(why) => reason = further(reason, outcome_of(why)),
                    }
                }
                if self.triangles.len() > first { (Outcome::Drawn, true) } else { (self.end(reason), true) }
            }
        }
    }

    /// The varyings of a polygon's vertices, from those of the original ones. Returns the number of the first.
    fn make_vertices(&mut self, input: &Input<'_, '_>, v: [u32; 3], polygon: &Polygon) -> u32 {
        let vertices = input.vertices;
        let stride = vertices.varying_stride;
        let first = if stride == 0 { 0 } else { self.made.len() / stride };
        for vertex in polygon.vertices() {
            for word in 0..stride {
                let original = v.map(|v| f32::from_bits(vertices.varyings[v as usize * stride + word]));
                self.made.push(vertex.combine(original).to_bits());
            }
        }
        first as u32 | MADE
    }

    /// The edges or corners of a triangle.
    #[inline(never)]
    fn outline(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: [u32; 3],
        flat: usize,
        mode: PolygonMode,
        polygon: &mut Polygon,
        pairs: &mut Vec<(u32, u32)>,
    ) -> (Outcome, bool) {
        let (frame, vertices) = (input.frame, input.vertices);
        let at = v.map(|v| v as usize);
        let codes = at.map(|v| vertices.codes[v]);
        // Facing is that of the visible part.
        let facing = match frame.clip.triangle(&at.map(|v| vertices.clip[v]), codes, polygon) {
            Clipped::Rejected => return (self.end(Outcome::Frustum), false),
            Clipped::Whole => setup::facing(&frame.setup, &at.map(|v| vertices.screen[v])),
            Clipped::Cut => {
                let screen = |i: usize| frame.screen.vertex(polygon.vertices()[i].position);
                polygon
                    .triangles()
                    .map(|t| setup::facing(&frame.setup, &t.map(screen)))
                    .find(|f| *f != Err(Culled::Degenerate))
                    .unwrap_or(Err(Culled::Degenerate))
            }
        };
        let front = match facing {
            Ok(front) => front,
            Err(reason) => return (self.end(outcome_of(reason)), false),
        };
        let first = self.triangles.len();
        let before = self.funnel;
        let (mut reason, mut clipped) = (Outcome::Degenerate, false);
        for i in 0..3 {
            let (outcome, cut) = if mode == PolygonMode::Line {
                self.line(input, number, [v[i], v[(i + 1) % 3]], v[flat], front, polygon, pairs)
            } else {
                self.point(input, number, v[i], v[flat], front, pairs)
            };
            reason = further(reason, outcome);
            clipped |= cut;
        }
        // The parts counted themselves; the primitive counts once.
        self.funnel = before;
        self.funnel.clipped += u64::from(clipped);
        if self.triangles.len() > first { (Outcome::Drawn, clipped) } else { (self.end(reason), clipped) }
    }

    #[inline(never)]
    fn line(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: [u32; 2],
        flat: u32,
        front: bool,
        polygon: &mut Polygon,
        pairs: &mut Vec<(u32, u32)>,
    ) -> (Outcome, bool) {
        let (frame, vertices) = (input.frame, input.vertices);
        let at = v.map(|v| v as usize);
        let position = at.map(|v| vertices.clip[v]);
        let mut clipped = frame.clip.line(&position, at.map(|v| vertices.codes[v]), polygon);
        if vertices.distance_stride > 0 {
            clipped = clip_distance::line(vertices, v, &position, clipped, polygon);
        }
        let (screen, corners) = match clipped {
            Clipped::Rejected => return (self.end(Outcome::Frustum), false),
            Clipped::Whole => (at.map(|v| vertices.screen[v]), [v[0], v[1], v[1]]),
            Clipped::Cut => {
                self.funnel.clipped += 1;
                let made = self.make_vertices(input, [v[0], v[1], v[0]], polygon);
                let screen = |i: usize| frame.screen.vertex(polygon.vertices()[i].position);
                ([screen(0), screen(1)], [made, made + 1, made + 1])
            }
        };
        let cut = clipped == Clipped::Cut;
        match setup::line(&frame.setup, &screen, front) {
            Ok(line) => {
                self.put(input, number, line, Corners { vertices: corners, flat }, pairs);
                (Outcome::Drawn, cut)
            }
            Err(reason) => (self.end(outcome_of(reason)), cut),
        }
    }

    #[inline(never)]
    fn point(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        v: u32,
        flat: u32,
        front: bool,
        pairs: &mut Vec<(u32, u32)>,
    ) -> (Outcome, bool) {
        let (frame, vertices) = (input.frame, input.vertices);
        let at = v as usize;
        let n = vertices.distance_stride;
        let outside = vertices.distances[at * n..(at + 1) * n].iter().any(|d| !(*d >= 0.0));
        if outside || !frame.clip.point(vertices.codes[at]) {
            return (self.end(Outcome::Frustum), false);
        }
        match setup::point(&frame.setup, &vertices.screen[at], front) {
            Ok(point) => {
                self.put(input, number, point, Corners { vertices: [v; 3], flat }, pairs);
                (Outcome::Drawn, false)
            }
            Err(reason) => (self.end(outcome_of(reason)), false),
        }
    }

    /// Counts a primitive that is not drawn.
    #[inline(always)]
    fn end(&mut self, outcome: Outcome) -> Outcome {
        match outcome {
            Outcome::Degenerate => self.funnel.culled_degenerate += 1,
            Outcome::Backface => self.funnel.culled_backface += 1,
            Outcome::Frustum => self.funnel.culled_frustum += 1,
            Outcome::Scissor => self.funnel.culled_scissor += 1,
            Outcome::NoSample => self.funnel.culled_no_sample += 1,
            Outcome::Drawn => {}
        }
        outcome
    }

    /// Keeps a triangle that setup let through, and notes the tiles it may touch.
    #[inline(always)]
    fn put(&mut self, input: &Input<'_, '_>, number: u32, triangle: Triangle, corners: Corners, pairs: &mut Vec<(u32, u32)>) {
        let reference = self.triangles.len() as u32;
        let b = triangle.bounds;
        let tile = TILE as u16;
        let [x0, y0, x1, y1] = [b.x0 / tile, b.y0 / tile, (b.x1 - 1) / tile, (b.y1 - 1) / tile].map(u32::from);
        if input.record {
            let (w, h) = (u64::from(b.x1 - b.x0), u64::from(b.y1 - b.y0));
            self.quads_estimate += match triangle.shape {
                // Half the box, and its circumference.
                Shape::Triangle => w * h / 8 + (w + h) / 2 + 2,
                _ => w + h + 1,
            };
        }
        if x0 == x1 && y0 == y1 {
            pairs.push((y0 * input.tiles.0 + x0, reference));
        } else {
            spread(input, &triangle, reference, [x0, y0, x1, y1], pairs);
        }
        self.triangles.push(triangle);
        self.corners.push(corners);
        self.primitive.push(number);
    }

    /// Sorts the references by tile; those of a tile stay in order.
    fn sort(&mut self, pairs: &[(u32, u32)], tiles: usize) {
        self.tile_start.clear();
        self.tile_start.resize(tiles + 1, 0);
        for &(tile, _) in pairs {
            self.tile_start[tile as usize] += 1;
        }
        let mut sum = 0;
        for start in &mut self.tile_start {
            // To the end of the tile's part; filling from the back makes it the start.
            sum += *start;
            *start = sum;
        }
        self.references.resize(pairs.len(), 0);
        for &(tile, reference) in pairs.iter().rev() {
            let at = &mut self.tile_start[tile as usize];
            *at -= 1;
            self.references[*at as usize] = reference;
        }
    }

    /// Counts the primitives that covered no sample; tiles have been drawn.
    pub fn count_uncovered(&mut self) {
        let mut at = 0;
        while at < self.triangles.len() {
            let primitive = self.primitive[at];
            let mut covered = false;
            while at < self.triangles.len() && self.primitive[at] == primitive {
                covered |= self.covered[at].load(Relaxed) != 0;
                at += 1;
            }
            self.funnel.culled_no_sample += u64::from(!covered);
        }
    }
}

/// Notes the tiles of a triangle that spans several.
fn spread(input: &Input<'_, '_>, triangle: &Triangle, reference: u32, [x0, y0, x1, y1]: [u32; 4], pairs: &mut Vec<(u32, u32)>) {
    let frame = input.frame;
    let test = triangle.shape == Shape::Triangle && frame.skips.tile_reject;
    let (b, base) = (triangle.bounds, triangle.base());
    for ty in y0..=y1 {
        for tx in x0..=x1 {
            let mut whole = 0;
            if test {
                // The rectangle of the tile's pixels, from the left edge of the first to the right one of the last.
                let (px0, py0) = ((tx * TILE) as i32, (ty * TILE) as i32);
                let px1 = (px0 + TILE as i32).min(frame.width as i32);
                let py1 = (py0 + TILE as i32).min(frame.height as i32);
                let half = SUBPIXEL / 2;
                let at = |p: i32, origin: i32| (p - origin) * SUBPIXEL - half;
                let (left, right) = (at(px0, base[0]), at(px1, base[0]));
                let (top, bottom) = (at(py0, base[1]), at(py1, base[1]));
                let (mut touched, mut covered) = (true, true);
                for edge in &triangle.edges {
                    let (xi, xo) = if edge.a >= 0 { (right, left) } else { (left, right) };
                    let (yi, yo) = if edge.b >= 0 { (bottom, top) } else { (top, bottom) };
                    touched &= edge.at(xi, yi) >= 0;
                    covered &= edge.at(xo, yo) > 0;
                }
                if !touched {
                    continue;
                }
                let inside =
                    i32::from(b.x0) <= px0 && i32::from(b.y0) <= py0 && i32::from(b.x1) >= px1 && i32::from(b.y1) >= py1;
                if covered && inside {
                    whole = WHOLE;
                }
            }
            pairs.push((ty * input.tiles.0 + tx, reference | whole));
        }
    }
}

fn outcome_of(reason: Culled) -> Outcome {
    match reason {
        Culled::Degenerate => Outcome::Degenerate,
        Culled::Face => Outcome::Backface,
        Culled::NoSample => Outcome::NoSample,
        Culled::Scissor => Outcome::Scissor,
    }
}

/// The outcome that is further down the pipeline.
fn further(a: Outcome, b: Outcome) -> Outcome {
    let depth = |o: Outcome| match o {
        Outcome::Degenerate => 0,
        Outcome::Frustum => 1,
        Outcome::Backface => 2,
        Outcome::Scissor => 3,
        Outcome::NoSample => 4,
        Outcome::Drawn => 5,
    };
    if depth(a) >= depth(b) { a } else { b }
}
