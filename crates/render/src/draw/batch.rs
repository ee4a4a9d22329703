//! A batch of primitives: what becomes of them, sorted by screen tile.

use std::ops::Range;
use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use gfx::assemble::PrimitiveKind;
use gfx::setup::{self, Bounds, ScreenVertex, Shape, Triangle, is_small};
use gfx::state::{PolygonMode, Topology};
use num::{SUBPIXEL, prefetch};
use work::{Areas, Funnel, PrimitiveOutcome, TILE};

use super::DrawCall;
use super::areas;
use super::needless::Late;
use super::plan::{Piece, entries_of};
use super::stream::Stream;
use super::vertex::Vertices;
use super::workers::Worker;

/// Primitives of a batch: one task assembles, clips and sorts as many. Every batch has a list for every tile; more batches
/// would be more, and shorter, lists.
pub const BATCH: u32 = 4096;

/// Marks a vertex that clipping made: its number is one among the batch's own.
pub const MADE: u32 = 1 << 31;

/// Marks a reference to a triangle that covers its tile whole.
pub const WHOLE: u32 = 1 << 31;

/// Marks a reference to a triangle that may be set up together with others ([`setup::Eight`]).
pub const SMALL: u32 = 1 << 30;

/// The triangle's number in a reference.
pub const NUMBER: u32 = SMALL - 1;

/// Greatest distance of a sample from its pixel's centre along an axis, in 1/256 pixel.
const SAMPLE_REACH: i32 = 96;

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
    pub outcome: PrimitiveOutcome,
}

/// Consecutive entries of a segment's stream: of a list, or of one strip.
#[derive(Clone, Copy, Debug)]
pub struct StreamRange {
    pub(super) start: u32,
    pub(super) len: u32,
    pub(super) hub: Option<u32>,
}

/// Consecutive primitives and what becomes of them. Memory is kept from segment to segment, but where work is recorded.
#[derive(Default)]
pub struct Batch {
    /// The parts of the segment's stream that the batch takes.
    pub(super) parts: Vec<StreamRange>,
    /// Primitives before this batch in the segment.
    pub first_primitive: u32,
    primitives: u32,
    /// The triangles as set up; empty where setup is left to the tiles ([`Input::late_setup`]).
    pub triangles: Vec<Triangle>,
    /// Pixels of the bounding box of each before it is cut, where work is recorded.
    pub unclipped: Vec<u64>,
    pub corners: Vec<Corners>,
    /// Number in the batch of the primitive that each triangle belongs to.
    pub primitive: Vec<u32>,
    /// Whether a triangle covers a sample.
    pub covered: Vec<AtomicU8>,
    /// Varyings of vertices that clipping made.
    pub made: Vec<u32>,
    /// Window positions of vertices that clipping made.
    pub(super) made_screen: Vec<ScreenVertex>,
    /// How each primitive ended, where work is recorded.
    pub ended: Vec<Ended>,
    /// Primitives that end behind geometry.
    pub late: Vec<Late>,
    /// The tiles that have references, in order.
    tiles: Vec<u32>,
    /// First reference of each tile, or of each that has any (`sparse`), and one more.
    tile_start: Vec<u32>,
    sparse: bool,
    references: Vec<u32>,
    /// Quads that the triangles may touch, roughly and not less than half.
    pub quads_estimate: u64,
    /// The areas that the triangles are expected to cover. Empty unless a survey asks for them.
    pub areas: Areas,
    pub funnel: Funnel,
}

/// Cuts the pieces of a segment into batches; returns their number.
pub fn cut(topology: Topology, pieces: &[Piece], batches: &mut Vec<Batch>) -> usize {
    let (mut n, mut room) = (0, 0);
    for piece in pieces {
        let mut first = 0;
        while first < piece.primitives {
            if room == 0 {
                if batches.len() == n {
                    batches.push(Batch::default());
                }
                let batch = &mut batches[n];
                batch.parts.clear();
                (batch.first_primitive, batch.primitives) = (piece.first_primitive + first, 0);
                (n, room) = (n + 1, BATCH);
            }
            let batch = &mut batches[n - 1];
            // Even, so that a strip is cut where its winding starts again.
            let count = if piece.primitives - first <= room { piece.primitives - first } else { room & !1 };
            if count == 0 {
                room = 0;
                continue;
            }
            // A piece of a fan without its start has the hub as its first entry, so it is a fan itself.
            let (start, len, needs_hub) = entries_of(topology, first, count);
            let part = StreamRange { start: piece.stream + start, len, hub: needs_hub.then_some(piece.stream) };
            match batch.parts.last_mut() {
                // Lists have no state from one primitive to the next.
                Some(last) if !topology.is_strip() && last.start + last.len == part.start => last.len += len,
                _ => batch.parts.push(part),
            }
            batch.primitives += count;
            room -= count;
            first += count;
        }
    }
    n
}

/// The inputs that all batches of a segment share.
pub struct Input<'a, 'f> {
    pub call: &'a DrawCall<'f>,
    pub stream: &'a Stream,
    pub vertices: &'a Vertices,
    /// Tiles across the attachments and in all.
    pub tiles: (u32, u32),
    /// Only the bounds of triangles are found here, and the tiles set them up: what is set up is eight times as large as its
    /// vertices' numbers, and writing and reading it back costs more than doing it again in the few tiles it touches.
    pub late_setup: bool,
    /// Whether small triangles are marked ([`SMALL`]).
    pub mark_small: bool,
    /// Whether [`Batch::areas`] is wanted.
    pub areas: bool,
}

/// Whether setup may be left to the tiles.
pub fn late_setup(call: &DrawCall<'_>) -> bool {
    let triangles = PrimitiveKind::of(call.topology) == PrimitiveKind::Triangle;
    triangles && call.pipeline.primitive.polygon_mode == PolygonMode::Fill && !call.options.record
}

/// Whether small triangles may be set up together, given that setup is left to the tiles.
pub fn mark_small(call: &DrawCall<'_>) -> bool {
    let tests = !call.early || call.depth.is_none() || call.tests_blocks;
    tests && call.samples == 1 && call.sample_mask & 1 == 1 && call.setup.bias.is_none()
}

impl Batch {
    /// Triangles that touch a tile, in order: numbers ([`NUMBER`]) with marks ([`WHOLE`], [`SMALL`]).
    #[inline(always)]
    pub fn in_tile(&self, tile: usize) -> &[u32] {
        let at = if self.sparse {
            let Ok(at) = self.tiles.binary_search(&(tile as u32)) else { return &[] };
            at
        } else {
            tile
        };
        &self.references[self.tile_start[at] as usize..self.tile_start[at + 1] as usize]
    }

    /// The tiles in which it has anything, in order.
    pub fn tiles(&self) -> &[u32] {
        &self.tiles
    }

    /// References of all tiles together.
    pub fn references(&self) -> u64 {
        self.references.len() as u64
    }

    /// Whether the batch has a primitive in a tile.
    #[inline(always)]
    pub fn touches(&self, tile: usize) -> bool {
        !self.in_tile(tile).is_empty()
    }

    /// Gives back the memory of what a recorded segment has taken over: the segment holds as much again.
    pub fn release(&mut self) {
        self.triangles = Vec::new();
        self.unclipped = Vec::new();
        self.corners = Vec::new();
        self.primitive = Vec::new();
        self.covered = Vec::new();
        self.ended = Vec::new();
        self.late = Vec::new();
    }

    /// Asks for the data of a triangle.
    #[inline(always)]
    pub fn prefetch(&self, number: usize) {
        if let Some(triangle) = self.triangles.get(number) {
            prefetch(triangle);
        }
        prefetch(&self.corners[number]);
    }

    /// Asks for a triangle's vertices.
    #[inline(always)]
    pub fn prefetch_vertices(&self, number: usize, vertices: &Vertices) {
        for v in self.corners[number].vertices {
            if let (Some(screen), Some(word)) =
                (vertices.screen.get(v as usize), vertices.varyings.get(v as usize * vertices.varying_stride))
            {
                prefetch(screen);
                prefetch(word);
            }
        }
    }

    /// Assembles, clips, culls, sets up and sorts.
    pub fn run(&mut self, input: &Input<'_, '_>, worker: &mut Worker) {
        self.triangles.clear();
        self.unclipped.clear();
        self.corners.clear();
        self.primitive.clear();
        self.made.clear();
        self.made_screen.clear();
        self.ended.clear();
        self.late.clear();
        self.quads_estimate = 0;
        self.areas = Areas::default();
        self.funnel = Funnel::default();
        worker.pairs.clear();
        if input.call.options.record {
            // The memory of the last segment is gone, and lists that grow are copied.
            let primitives = self.primitives as usize;
            self.ended.reserve_exact(primitives);
            self.triangles.reserve(primitives);
            self.unclipped.reserve(primitives);
            self.corners.reserve(primitives);
            self.primitive.reserve(primitives);
        }
        self.assemble(input, &mut worker.pairs);
        self.funnel.primitives_in = u64::from(self.primitives);
        self.funnel.triangles_setup = self.corners.len() as u64;
        self.covered.clear();
        self.covered.resize_with(self.corners.len(), AtomicU8::default);
        self.sort(&mut worker.pairs, input.tiles.1 as usize);
    }

    /// Keeps a triangle that is drawn, set up now or later.
    #[inline(always)]
    pub(super) fn put_bounds(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        screen: &[ScreenVertex; 3],
        bounds: Bounds,
        corners: Corners,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        if !input.late_setup {
            return self.put(input, number, setup::within(&input.call.setup, screen, bounds), corners, pairs);
        }
        let small = input.mark_small && is_small(screen, &bounds);
        self.put_late(input, number, screen, bounds, small, corners, pairs);
    }

    /// Keeps a triangle that the tiles set up.
    #[inline(always)]
    pub(super) fn put_late(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        screen: &[ScreenVertex; 3],
        bounds: Bounds,
        small: bool,
        corners: Corners,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        let reference = self.corners.len() as u32 | if small { SMALL } else { 0 };
        // Half the box: whether other threads are worth it needs no more.
        self.quads_estimate += u64::from(bounds.x1 - bounds.x0) * u64::from(bounds.y1 - bounds.y0) / 8;
        if input.areas {
            self.areas += areas::of_triangle(screen, bounds);
        }
        let tiles = tiles_of(&bounds);
        let [x0, y0, x1, y1] = tiles;
        if x0 == x1 && y0 == y1 {
            pairs.push((y0 * input.tiles.0 + x0, reference));
        } else {
            spread(input, &setup::within(&input.call.setup, screen, bounds), reference, tiles, pairs);
        }
        self.corners.push(corners);
        self.primitive.push(number);
    }

    /// Keeps a primitive that setup let through, and notes the tiles it may touch.
    pub(super) fn put(
        &mut self,
        input: &Input<'_, '_>,
        number: u32,
        triangle: Triangle,
        corners: Corners,
        pairs: &mut Vec<(u32, u32)>,
    ) {
        let reference = self.triangles.len() as u32;
        let b = triangle.bounds;
        let at = |v: u32| {
            let made = v & MADE != 0;
            if made { self.made_screen[(v & !MADE) as usize] } else { input.vertices.screen[v as usize] }
        };
        if input.areas {
            self.areas += match triangle.shape {
                Shape::Triangle => areas::of_triangle(&corners.vertices.map(at), b),
                _ => areas::of_thin(b),
            };
        }
        if input.call.options.record {
            let corners = corners.vertices.map(at);
            self.unclipped.push(input.call.setup.unclipped(triangle.shape, &corners));
            let (w, h) = (u64::from(b.x1 - b.x0), u64::from(b.y1 - b.y0));
            self.quads_estimate += match triangle.shape {
                // Half the box, and its circumference.
                Shape::Triangle => w * h / 8 + (w + h) / 2 + 2,
                _ => w + h + 1,
            };
        }
        let tiles = tiles_of(&b);
        let [x0, y0, x1, y1] = tiles;
        if x0 == x1 && y0 == y1 {
            pairs.push((y0 * input.tiles.0 + x0, reference));
        } else {
            spread(input, &triangle, reference, tiles, pairs);
        }
        self.triangles.push(triangle);
        self.corners.push(corners);
        self.primitive.push(number);
    }

    /// Copies the window positions of a triangle's vertices, one by one: an array by value would be written in halves and read
    /// whole, which processors do not like.
    #[inline(always)]
    pub fn screen_into(&self, number: usize, vertices: &Vertices, out: &mut [ScreenVertex; 3]) {
        for (out, v) in out.iter_mut().zip(self.corners[number].vertices) {
            *out = if v & MADE == 0 { vertices.screen[v as usize] } else { self.made_screen[(v & !MADE) as usize] };
        }
    }

    /// A triangle, set up here where that was left to the tiles.
    #[inline(always)]
    pub fn set_up(&self, number: usize, call: &DrawCall<'_>, vertices: &Vertices) -> Triangle {
        if let Some(triangle) = self.triangles.get(number) {
            return *triangle;
        }
        let mut screen = [ScreenVertex::default(); 3];
        self.screen_into(number, vertices, &mut screen);
        // The bounds were not empty when the triangle was kept.
        setup::within(&call.setup, &screen, setup::bounds(&call.setup, &screen).unwrap_or_default())
    }

    /// Sorts the references by tile; those of a tile stay in order.
    fn sort(&mut self, pairs: &mut [(u32, u32)], tiles: usize) {
        self.tiles.clear();
        self.tile_start.clear();
        self.references.clear();
        self.sparse = pairs.len() < tiles / 8;
        if self.sparse {
            pairs.sort_by_key(|&(tile, _)| tile);
            for &(tile, reference) in &*pairs {
                if self.tiles.last() != Some(&tile) {
                    self.tiles.push(tile);
                    self.tile_start.push(self.references.len() as u32);
                }
                self.references.push(reference);
            }
            self.tile_start.push(self.references.len() as u32);
            return;
        }
        self.tile_start.resize(tiles + 1, 0);
        for &(tile, _) in &*pairs {
            self.tile_start[tile as usize] += 1;
        }
        let mut sum = 0;
        for (tile, start) in (0..).zip(&mut self.tile_start) {
            if *start > 0 {
                self.tiles.push(tile);
            }
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
        while at < self.corners.len() {
            let primitive = self.primitive[at];
            let (first, mut covered) = (at, false);
            while at < self.corners.len() && self.primitive[at] == primitive {
                covered |= self.covered[at].load(Relaxed) != 0;
                at += 1;
            }
            self.funnel.setup_parts += (at - first) as u64 - 1;
            self.funnel.setup_culled += u64::from(!covered);
            self.funnel.culled_no_sample += u64::from(!covered);
        }
    }
}

/// First and last column and row of the tiles that hold some of the pixels: x0, y0, x1, y1.
#[inline(always)]
fn tiles_of(b: &Bounds) -> [u32; 4] {
    let tile = TILE as u16;
    [u32::from(b.x0 / tile), u32::from(b.y0 / tile), u32::from((b.x1 - 1) / tile), u32::from((b.y1 - 1) / tile)]
}

/// Tiles in a row from which on it is worth finding where a triangle's edges enter and leave it.
const LONG_ROW: u32 = 4;

/// Notes the tiles that may hold samples of a primitive that spans several.
fn spread(input: &Input<'_, '_>, triangle: &Triangle, reference: u32, [x0, y0, x1, y1]: [u32; 4], pairs: &mut Vec<(u32, u32)>) {
    let call = input.call;
    if triangle.shape != Shape::Triangle {
        pairs.extend((y0..=y1).flat_map(|ty| (x0..=x1).map(move |tx| (ty * input.tiles.0 + tx, reference))));
        return;
    }
    let (b, base) = (triangle.bounds, triangle.base());
    let reach = if call.samples == 1 { 0 } else { SAMPLE_REACH };
    let at = |p: i32, origin: i32| (p - origin) * SUBPIXEL;
    for ty in y0..=y1 {
        // The rectangle of a tile's samples: first its rows.
        let py0 = (ty * TILE) as i32;
        let py1 = (py0 + TILE as i32).min(call.height as i32);
        let (top, bottom) = (at(py0, base[1]) - reach, at(py1 - 1, base[1]) + reach);
        let long = x1 - x0 >= LONG_ROW;
        let columns = if long { columns(triangle, [x0, x1], [top, bottom], base[0], reach) } else { x0..x1 + 1 };
        for tx in columns {
            let px0 = (tx * TILE) as i32;
            let px1 = (px0 + TILE as i32).min(call.width as i32);
            let (left, right) = (at(px0, base[0]) - reach, at(px1 - 1, base[0]) + reach);
            let (mut touched, mut covered) = (true, true);
            for edge in &triangle.edges {
                let (xi, xo) = if edge.a >= 0 { (right, left) } else { (left, right) };
                let (yi, yo) = if edge.b >= 0 { (bottom, top) } else { (top, bottom) };
                touched &= edge.at(xi, yi) >= 0;
                covered &= edge.at(xo, yo) >= i64::from(!edge.owns(triangle.lower_edges));
            }
            if !touched {
                continue;
            }
            let inside = i32::from(b.x0) <= px0 && i32::from(b.y0) <= py0 && i32::from(b.x1) >= px1 && i32::from(b.y1) >= py1;
            let whole = if call.overwrites && covered && inside { WHOLE } else { 0 };
            pairs.push((ty * input.tiles.0 + tx, reference | whole));
        }
    }
}

/// The columns of tiles, of those from `x0` to `x1`, that the edges of a triangle leave in a row of samples between `top` and `bottom`. Each
/// edge cuts off tiles on one side: those whose nearest samples are outside of it.
fn columns(triangle: &Triangle, [x0, x1]: [u32; 2], [top, bottom]: [i32; 2], origin: i32, reach: i32) -> Range<u32> {
    let (mut first, mut last) = (i64::from(x0), i64::from(x1));
    let column = |x: i64| (x.div_euclid(i64::from(SUBPIXEL)) + i64::from(origin)).div_euclid(i64::from(TILE));
    for edge in &triangle.edges {
        let (a, rest) = (i64::from(edge.a), edge.at(0, if edge.b >= 0 { bottom } else { top }));
        match a.signum() {
            // x is at least -rest / a.
            1 => first = first.max(column((-rest).div_euclid(a) - i64::from(reach))),
            -1 => last = last.min(column(rest.div_euclid(-a) + i64::from(reach))),
            _ if rest < 0 => return 0..0,
            _ => {}
        }
    }
    // Both are within the row by now, or the row is empty.
    if first > last { 0..0 } else { first as u32..last as u32 + 1 }
}

#[cfg(test)]
mod tests {
    use gfx::setup::{DepthBias, SetupState};
    use gfx::state::{CullMode, FrontFace};
    use num::Random;

    use super::*;

    /// Every tile that no edge leaves outside is in the columns of its row; of thin diagonals the columns are few.
    #[test]
    fn edges_leave_the_columns_that_they_touch() {
        const SIZE: i32 = 4096;
        let state = SetupState {
            bounds: Bounds { x0: 0, y0: 0, x1: SIZE as u16, y1: SIZE as u16 - 5 },
            depth_range: [0.0, 1.0],
            bias: DepthBias::NONE,
            front_face: FrontFace::Ccw,
            cull: CullMode::None,
            samples: 1,
            lower_edges: false,
            unclipped_depth: false,
            half_width: None,
        };
        let (mut random, mut thin, mut boxes) = (Random::new(7), 0, 0);
        let mut checked = 0;
        for number in 0..600 {
            let mut at = || random.between(-SIZE * SUBPIXEL / 4, SIZE * SUBPIXEL * 5 / 4);
            let mut corners = [0; 3].map(|_| ScreenVertex { x: at(), y: at(), z: 0.5, inv_w: 1.0 });
            // Every third is a diagonal, or a line of pixels along an axis.
            if number % 3 == 0 {
                (corners[2].x, corners[2].y) = (corners[0].x + 2, corners[0].y + 1);
                corners[1].y = if number % 2 == 0 { corners[0].y } else { corners[1].y };
            }
            let Ok(triangle) = setup::triangle(&state, &corners) else { continue };
            let [x0, y0, x1, y1] = tiles_of(&triangle.bounds);
            for (ty, reach) in (y0..=y1).flat_map(|ty| [(ty, 0), (ty, SAMPLE_REACH)]) {
                let at = |pixel: u32, axis: usize| (pixel as i32 - triangle.base()[axis]) * SUBPIXEL;
                let rows = [at(ty * TILE, 1) - reach, at((ty + 1) * TILE - 1, 1) + reach];
                let found = columns(&triangle, [x0, x1], rows, triangle.base()[0], reach);
                assert!(found.is_empty() || found.start >= x0 && found.end <= x1 + 1);
                let touched = (x0..=x1).filter(|tx| {
                    let ends = [at(tx * TILE, 0) - reach, at((tx + 1) * TILE - 1, 0) + reach];
                    let corner = |slope: i32, [low, high]: [i32; 2]| if slope >= 0 { high } else { low };
                    triangle.edges.iter().all(|edge| edge.at(corner(edge.a, ends), corner(edge.b, rows)) >= 0)
                });
                for tx in touched {
                    assert!(found.contains(&tx), "triangle {number}, tile {tx}, {ty}: {found:?}");
                    checked += 1;
                }
                if number % 3 == 0 && reach == 0 {
                    (thin, boxes) = (thin + found.len(), boxes + (x1 + 1 - x0) as usize);
                }
            }
        }
        assert!(checked > 50_000, "{checked} tiles");
        assert!(thin * 8 < boxes, "{thin} tiles of {boxes}");
    }
}
