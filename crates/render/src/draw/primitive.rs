//! From vertices to triangles: assembly, clipping, culling, setup.

use gfx::assemble::{Assembler, PrimitiveKind, provoking};
use gfx::clip::{ClipVolume, Clipped, MAX_VERTICES, Polygon};
use gfx::setup::{self, Culled, EightBounds, ScreenVertex};
use gfx::simd::{Simd, dispatch};
use gfx::state::{PolygonMode, Topology};
use work::PrimitiveOutcome;

use super::batch::{Batch, Corners, Ended, Input, MADE, StreamRange};
use super::clip_distance;

impl Batch {
    /// Assembles, clips, culls and sets up, for the host's widest vectors.
    pub fn assemble(&mut self, input: &Input<'_, '_>, pairs: &mut Vec<(u32, u32)>) {
        if input.call.options.record { self.assemble_as::<true>(input, pairs) } else { self.assemble_as::<false>(input, pairs) }
    }

    fn assemble_as<const RECORD: bool>(&mut self, input: &Input<'_, '_>, pairs: &mut Vec<(u32, u32)>) {
        dispatch!(simd => self.assemble_here::<RECORD, _>(simd, input, pairs));
    }

    /// `RECORD`: work is recorded.
    #[inline(always)]
    fn assemble_here<const RECORD: bool, V: Simd>(&mut self, simd: V, input: &Input<'_, '_>, pairs: &mut Vec<(u32, u32)>) {
        let call = input.call;
        let primitive = &call.pipeline.primitive;
        let kind = PrimitiveKind::of(call.topology);
        let plain = kind == PrimitiveKind::Triangle
            && primitive.polygon_mode == PolygonMode::Fill
            && input.vertices.distance_stride == 0;
        let flat = provoking(kind, primitive.provoking_last);
        let mut number = 0;
        let parts = std::mem::take(&mut self.parts);
        for part in &parts {
            let entries = &input.stream.entries[part.start as usize..][..part.len as usize];
            // One past the entries of the next triangle.
            let mut end = part.start + 3;
            if plain && call.topology == Topology::TriangleList {
                // The case that matters: no assembler, and the cull reasons only counted.
                let (eights, entries) = entries.as_chunks::<24>();
                for eight in eights {
                    self.eight::<RECORD, _>(simd, input, number, end, eight, flat, pairs);
                    number += 8;
                    end += 24;
                }
                for v in entries.chunks_exact(3) {
                    let (v, left) = ([v[0], v[1], v[2]], (self.corners.len(), self.made_screen.len()));
                    let ended = self.triangle(input, number, v, flat, pairs);
                    if RECORD {
                        self.note(input, number, v, end, left, ended);
                    }
                    number += 1;
                    end += 3;
                }
            } else {
                self.assemble_part(input, part, entries, &mut number, (kind, plain, flat), pairs);
            }
        }
        self.parts = parts;
    }

    /// One part, whatever its topology.
    #[inline(never)]
    fn assemble_part(
        &mut self,
        input: &Input<'_, '_>,
        part: &StreamRange,
        entries: &[u32],
        number: &mut u32,
        (kind, plain, flat): (PrimitiveKind, bool, usize),
        pairs: &mut Vec<(u32, u32)>,
    ) {
        let primitive = &input.call.pipeline.primitive;
        let mut assembler = Assembler::new(input.call.topology, primitive.provoking_last);
        let hub = part.hub.map(|at| input.stream.entries[at as usize]);
        let before = part.start;
        let mut polygon = Polygon::EMPTY;
        for (at, vertex) in hub.iter().copied().map(|v| (0, v)).chain((1..).zip(entries.iter().copied())) {
            let number = &mut *number;
            assembler.push(vertex, &mut |v| {
                let (first, made) = (self.corners.len(), self.made_screen.len());
                let (outcome, clipped) = match (kind, primitive.polygon_mode) {
                    (PrimitiveKind::Triangle, PolygonMode::Fill) if plain => self.triangle(input, *number, v, flat, pairs),
                    (PrimitiveKind::Triangle, PolygonMode::Fill) => {
                        self.general_triangle(input, *number, v, flat, &mut polygon, pairs)
                    }
                    (PrimitiveKind::Triangle, mode) => self.outline(input, *number, v, flat, mode, &mut polygon, pairs),
                    (PrimitiveKind::Line, _) => self.line(input, *number, [v[0], v[1]], v[flat], true, &mut polygon, pairs),
                    (PrimitiveKind::Point, _) => self.point(input, *number, v[0], v[0], true, pairs),
                };
                if input.call.options.record {
                    self.note(input, *number, v, before + at, (first, made), (outcome, clipped));
                }
                *number += 1;
            });
        }
    }

    /// Notes how a primitive ended: what it left begins at these triangles and vertices.
    #[inline(always)]
    fn note(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        vertices: [u32; 3],
        stream_end: u32,
        (first, made): (usize, usize),
        (outcome, clipped): (PrimitiveOutcome, bool),
    ) {
        self.note_late(input, number, vertices, outcome, made);
        let triangles = (self.corners.len() - first) as u8;
        self.ended.push(Ended { vertices, stream_end, first_triangle: first as u32, triangles, clipped, outcome });
    }

    /// Eight filled triangles without clip distances; `end` is one past the entries of the first.
    #[inline(always)]
    fn eight<const RECORD: bool, V: Simd>(
        &mut self,
        simd: V,
        input: &Input<'_, '_>,
        first: u32,
        end: u32,
        entries: &[u32; 24],
        flat: usize,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        let vertices = input.vertices;
        let triangles = entries.as_chunks::<3>().0;
        let mut screen = [[ScreenVertex::default(); 3]; 8];
        let mut codes = 0;
        for (screen, v) in screen.iter_mut().zip(triangles) {
            for c in 0..3 {
                codes |= vertices.codes[v[c] as usize];
                screen[c] = vertices.screen[v[c] as usize];
            }
        }
        let eight = EightBounds::find(simd, &input.call.setup, &screen);
        // Where a vertex is outside of anything, all of them go the long way.
        let alone = if codes == 0 { eight.large } else { 0xff };
        for (i, &v) in triangles.iter().enumerate() {
            let (number, end) = (first + i as u32, end + 3 * i as u32);
            let left = (self.corners.len(), self.made_screen.len());
            let ended = if alone >> i & 1 == 1 {
                self.triangle(input, number, v, flat, pairs)
            } else {
                match eight.get(i) {
                    Ok(bounds) => {
                        let corners = Corners { vertices: v, flat: v[flat] };
                        if !RECORD && input.late_setup {
                            let small = input.mark_small && eight.small >> i & 1 == 1;
                            self.put_late(input, number, &screen[i], bounds, small, corners, pairs);
                        } else {
                            self.put_bounds(input, number, &screen[i], bounds, corners, pairs);
                        }
                        (PrimitiveOutcome::Drawn, false)
                    }
                    Err(reason) => (self.end(outcome_of(reason)), false),
                }
            };
            if RECORD {
                self.note(input, number, v, end, left, ended);
            }
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
    ) -> (PrimitiveOutcome, bool) {
        let vertices = input.vertices;
        let [a, b, c] = [v[0] as usize, v[1] as usize, v[2] as usize];
        let codes = [vertices.codes[a], vertices.codes[b], vertices.codes[c]];
        match ClipVolume::trivial(&codes) {
            Some(Clipped::Rejected) => (self.end(PrimitiveOutcome::Frustum), false),
            Some(_) => {
                let screen = [vertices.screen[a], vertices.screen[b], vertices.screen[c]];
                match setup::bounds(&input.call.setup, &screen) {
                    Ok(bounds) => {
                        self.put_bounds(input, number, &screen, bounds, Corners { vertices: v, flat: v[flat] }, pairs);
                        (PrimitiveOutcome::Drawn, false)
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
    ) -> (PrimitiveOutcome, bool) {
        let (call, vertices) = (input.call, input.vertices);
        let at = v.map(|v| v as usize);
        let codes = at.map(|v| vertices.codes[v]);
        let position = at.map(|v| vertices.clip[v]);
        let mut clipped = call.clip.triangle(&position, codes, polygon);
        if vertices.distance_stride > 0 {
            clipped = clip_distance::triangle(vertices, v, &position, clipped, polygon);
        }
        match clipped {
            Clipped::Rejected => (self.end(PrimitiveOutcome::Frustum), false),
            Clipped::Whole => {
                let screen = at.map(|v| vertices.screen[v]);
                match setup::bounds(&call.setup, &screen) {
                    Ok(bounds) => {
                        self.put_bounds(input, number, &screen, bounds, Corners { vertices: v, flat: v[flat] }, pairs);
                        (PrimitiveOutcome::Drawn, false)
                    }
                    Err(reason) => (self.end(outcome_of(reason)), false),
                }
            }
            Clipped::Cut => {
                self.funnel.clipped += 1;
                let first = self.corners.len();
                let made = self.make_vertices(input, v, polygon);
                // If no part is drawn, the primitive's reason is the part's reason that is furthest down the pipeline.
                let mut reason = PrimitiveOutcome::Degenerate;
                for corners in setup::fan(&self.made_screen[(made & !MADE) as usize..]) {
                    let screen = corners.map(|i| self.made_screen[(made & !MADE) as usize + i]);
                    match setup::bounds(&call.setup, &screen) {
                        Ok(bounds) => {
                            let vertices = corners.map(|i| made + i as u32);
                            self.put_bounds(input, number, &screen, bounds, Corners { vertices, flat: v[flat] }, pairs);
                        }
                        Err(why) => reason = further(reason, outcome_of(why)),
                    }
                }
                if self.corners.len() > first { (PrimitiveOutcome::Drawn, true) } else { (self.end(reason), true) }
            }
        }
    }

    /// Keeps a polygon's vertices, with their varyings from those of the original ones. Returns the number of the first.
    fn make_vertices(&mut self, input: &Input<'_, '_>, v: [u32; 3], polygon: &Polygon) -> u32 {
        let vertices = input.vertices;
        let stride = vertices.varying_stride;
        let first = self.made_screen.len();
        for vertex in polygon.vertices() {
            self.made_screen.push(input.call.screen.clipped(vertex));
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
    ) -> (PrimitiveOutcome, bool) {
        let (call, vertices) = (input.call, input.vertices);
        let at = v.map(|v| v as usize);
        let codes = at.map(|v| vertices.codes[v]);
        // Facing is that of the visible part.
        let facing = match call.clip.triangle(&at.map(|v| vertices.clip[v]), codes, polygon) {
            Clipped::Rejected => return (self.end(PrimitiveOutcome::Frustum), false),
            Clipped::Whole => setup::facing(&call.setup, &at.map(|v| vertices.screen[v])),
            Clipped::Cut => {
                let vertices = polygon.vertices();
                let mut screen = [ScreenVertex::default(); MAX_VERTICES];
                for (screen, vertex) in screen.iter_mut().zip(vertices) {
                    *screen = call.screen.clipped(vertex);
                }
                let facing = |t: [usize; 3]| setup::facing(&call.setup, &t.map(|i| screen[i]));
                setup::fan(&screen[..vertices.len()]).next().map_or(Err(Culled::Degenerate), facing)
            }
        };
        let front = match facing {
            Ok(front) => front,
            Err(reason) => return (self.end(outcome_of(reason)), false),
        };
        let first = self.corners.len();
        let before = self.funnel;
        let (mut reason, mut clipped) = (PrimitiveOutcome::Degenerate, false);
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
        if self.corners.len() > first { (PrimitiveOutcome::Drawn, clipped) } else { (self.end(reason), clipped) }
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
    ) -> (PrimitiveOutcome, bool) {
        let (call, vertices) = (input.call, input.vertices);
        let at = v.map(|v| v as usize);
        let position = at.map(|v| vertices.clip[v]);
        let mut clipped = call.clip.line(&position, at.map(|v| vertices.codes[v]), polygon);
        if vertices.distance_stride > 0 {
            clipped = clip_distance::line(vertices, v, &position, clipped, polygon);
        }
        let (screen, corners) = match clipped {
            Clipped::Rejected => return (self.end(PrimitiveOutcome::Frustum), false),
            Clipped::Whole => (at.map(|v| vertices.screen[v]), [v[0], v[1], v[1]]),
            Clipped::Cut => {
                self.funnel.clipped += 1;
                let made = self.make_vertices(input, [v[0], v[1], v[0]], polygon);
                let screen = |i: usize| call.screen.clipped(&polygon.vertices()[i]);
                ([screen(0), screen(1)], [made, made + 1, made + 1])
            }
        };
        let cut = clipped == Clipped::Cut;
        match setup::line(&call.setup, &screen, front) {
            Ok(line) => {
                self.put(input, number, line, Corners { vertices: corners, flat }, pairs);
                (PrimitiveOutcome::Drawn, cut)
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
    ) -> (PrimitiveOutcome, bool) {
        let (call, vertices) = (input.call, input.vertices);
        let at = v as usize;
        let n = vertices.distance_stride;
        let outside = vertices.distances[at * n..(at + 1) * n].iter().any(|d| !(*d >= 0.0));
        if outside || !call.clip.point(vertices.codes[at]) {
            return (self.end(PrimitiveOutcome::Frustum), false);
        }
        match setup::point(&call.setup, &vertices.screen[at], front) {
            Ok(point) => {
                self.put(input, number, point, Corners { vertices: [v; 3], flat }, pairs);
                (PrimitiveOutcome::Drawn, false)
            }
            Err(reason) => (self.end(outcome_of(reason)), false),
        }
    }

    /// Counts a primitive that is not drawn.
    #[inline(always)]
    fn end(&mut self, outcome: PrimitiveOutcome) -> PrimitiveOutcome {
        match outcome {
            PrimitiveOutcome::Degenerate => self.funnel.culled_degenerate += 1,
            PrimitiveOutcome::Backface => self.funnel.culled_backface += 1,
            PrimitiveOutcome::Frustum => self.funnel.culled_frustum += 1,
            PrimitiveOutcome::Scissor => self.funnel.culled_scissor += 1,
            PrimitiveOutcome::NoSample => self.funnel.culled_no_sample += 1,
            PrimitiveOutcome::Drawn => {}
        }
        outcome
    }
}

fn outcome_of(reason: Culled) -> PrimitiveOutcome {
    match reason {
        Culled::Degenerate => PrimitiveOutcome::Degenerate,
        Culled::Face => PrimitiveOutcome::Backface,
        Culled::NoSample => PrimitiveOutcome::NoSample,
        Culled::Scissor => PrimitiveOutcome::Scissor,
    }
}

/// The outcome that is further down the pipeline.
fn further(a: PrimitiveOutcome, b: PrimitiveOutcome) -> PrimitiveOutcome {
    let depth = |o: PrimitiveOutcome| match o {
        PrimitiveOutcome::Degenerate => 0,
        PrimitiveOutcome::Frustum => 1,
        PrimitiveOutcome::Backface => 2,
        PrimitiveOutcome::Scissor => 3,
        PrimitiveOutcome::NoSample => 4,
        PrimitiveOutcome::Drawn => 5,
    };
    if depth(a) >= depth(b) { a } else { b }
}
