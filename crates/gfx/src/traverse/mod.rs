//! Tiled traversal: which samples of which pixels a primitive covers.
//!
//! A primitive is walked inside one screen area (a tile of at most 64x64 pixels) in aligned 8x8 blocks, row by row. A block
//! holds 16 quads and its coverage is 64 bits per sample, in lane order: a block's mask is a lane mask. Blocks without coverage
//! are not visited. Edge functions are exact ([`super::setup`], `kernel`), ties go by the top-left rule.
//!
//! Lines of width 1 follow the diamond-exit rule (`line`) with one sample per pixel. With four samples a line is a rectangle of
//! width 1 about its segment. A point is a square of side 1 about its position, which, as two triangles would, holds its upper and
//! left borders: a point on the border of two pixels belongs to the left or upper one.

mod kernel;
mod line;

use std::ops::Deref;

use num::{Fx8, SUBPIXEL};

use super::setup::{Bounds, Edge, SAMPLES_1, SAMPLES_4, Shape, Triangle};
use super::simd::{Simd, dispatch};
use kernel::{BLOCK_SHIFT, COLUMNS_BELOW, PIXEL_SHIFT, ROWS_BELOW, reduce};

/// Edge length of the largest area that one call walks, in pixels.
pub const TILE: u16 = 64;

/// Blocks of such an area.
const TILE_BLOCKS: usize = 64;

/// Coverage of an aligned block of 8x8 pixels with `S` samples each.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block<const S: usize> {
    /// Left column; a multiple of 8.
    pub x: u16,
    /// Upper row; a multiple of 8.
    pub y: u16,
    /// Whether every sample of every pixel is covered.
    pub full: bool,
    /// For each sample the pixels in which it is covered: bit `4 q + p`, quad q = column + 4 row of quads, p its pixel.
    pub samples: [u64; S],
}

/// Coverage of one quad.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct QuadCoverage {
    /// Left column; even.
    pub x: u16,
    /// Upper row; even.
    pub y: u16,
    /// Covered samples: bit `4 sample + p`. Not 0.
    pub mask: u16,
}

impl<const S: usize> Block<S> {
    /// Pixels with at least one covered sample.
    #[inline(always)]
    pub fn pixels(&self) -> u64 {
        self.samples.iter().fold(0, |all, &s| all | s)
    }

    /// The coverage of quad `q` of the block: bit `4 sample + p`.
    #[inline(always)]
    pub fn quad_mask(&self, q: usize) -> u16 {
        let mut mask = 0;
        for s in 0..S {
            mask |= (self.samples[s] >> (4 * q) & 15) << (4 * s);
        }
        mask as u16
    }

    /// The covered quads, row by row.
    #[inline(always)]
    pub fn quads(&self) -> impl Iterator<Item = QuadCoverage> + use<S> {
        let block = *self;
        let mut left = block.pixels();
        std::iter::from_fn(move || {
            if left == 0 {
                return None;
            }
            let q = left.trailing_zeros() as usize / 4;
            left &= !(15 << (4 * q));
            let (x, y) = (block.x + 2 * (q as u16 % 4), block.y + 2 * (q as u16 / 4));
            Some(QuadCoverage { x, y, mask: block.quad_mask(q) })
        })
    }
}

/// The sample positions of `S` samples, in 1/256 pixel from the pixel's centre.
#[inline(always)]
const fn positions<const S: usize>() -> [[Fx8; 2]; S] {
    let mut out = [[0; 2]; S];
    let mut s = 0;
    while s < S {
        out[s] = if S == 1 { SAMPLES_1[s] } else { SAMPLES_4[s] };
        s += 1;
    }
    out
}

/// The blocks of an area that a primitive covers, in row-major order.
///
/// A list and no visitor, so that the code that finds them exists once for all that is done with them.
pub struct Blocks<const S: usize> {
    all: [Block<S>; TILE_BLOCKS],
    n: usize,
    /// Whether a block that lies inside of all edges is taken whole, without a test of its samples.
    pub takes_whole: bool,
}

impl<const S: usize> Blocks<S> {
    /// Room for a tile's; none yet.
    pub fn new() -> Blocks<S> {
        Blocks { all: [Block { x: 0, y: 0, full: false, samples: [0; S] }; TILE_BLOCKS], n: 0, takes_whole: true }
    }

    #[inline(always)]
    fn push(&mut self, block: Block<S>) {
        // An area has no more: the mask only tells the compiler so.
        self.all[self.n & (TILE_BLOCKS - 1)] = block;
        self.n += 1;
    }

    /// Finds the blocks of `area` in which the primitive covers a sample, in place of those from before.
    ///
    /// `S` is 1 or 4, the sample count that the primitive was set up with. `area` is at most [`TILE`] pixels wide and high and its
    /// upper left corner a multiple of 8.
    pub fn find(&mut self, primitive: &Triangle, area: Bounds) {
        dispatch!(simd => self.find_here(simd, primitive, area));
    }

    /// As [`Self::find`] with a given instruction set.
    #[inline(always)]
    pub fn find_with<V: Simd>(&mut self, simd: V, primitive: &Triangle, area: Bounds) {
        simd.vectorize(
            #[inline(always)]
            || self.find_here(simd, primitive, area),
        );
    }

    #[inline(always)]
    fn find_here<V: Simd>(&mut self, simd: V, primitive: &Triangle, area: Bounds) {
        self.n = 0;
        walk(simd, primitive, area, self);
    }
}

impl<const S: usize> Default for Blocks<S> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const S: usize> Deref for Blocks<S> {
    type Target = [Block<S>];

    #[inline(always)]
    fn deref(&self) -> &[Block<S>] {
        &self.all[..self.n.min(TILE_BLOCKS)]
    }
}

/// Visits the blocks of `area` in which the primitive covers a sample: [`Blocks::find`] where time does not matter.
pub fn blocks<const S: usize>(primitive: &Triangle, area: Bounds, visit: impl FnMut(Block<S>)) {
    let mut found = Blocks::new();
    found.find(primitive, area);
    found.iter().copied().for_each(visit);
}

#[inline(always)]
fn walk<V: Simd, const S: usize>(simd: V, primitive: &Triangle, area: Bounds, found: &mut Blocks<S>) {
    const { assert!(S == 1 || S == 4, "samples a pixel") };
    let bounds = primitive.bounds.intersect(&area);
    if bounds.is_empty() {
        return;
    }
    match primitive.shape {
        Shape::Triangle => {
            // A sample on an edge that is neither left nor, but for the other rule, top is outside: E > 0, that is E - 1 >= 0.
            let [e0, e1, e2] = &primitive.edges;
            let tie = |e: &Edge| i64::from(!e.owns(primitive.lower_edges));
            let ties = [tie(e0), tie(e1), tie(e2)];
            convex(simd, &primitive.edges, &ties, primitive.base(), bounds, found);
        }
        Shape::Line if primitive.half_width == 0 => line::diamond_exit(primitive, bounds, found),
        Shape::Line => convex(simd, &line::rectangle(primitive), &[0; 4], primitive.base(), bounds, found),
        Shape::Point if S == 1 => {
            // The bounds are the pixel.
            let (x, y) = (bounds.x0 & !7, bounds.y0 & !7);
            found.push(Block { x, y, full: false, samples: [rectangle_mask(bounds, x, y); S] });
        }
        Shape::Point => convex(simd, &line::square(primitive), &[0; 4], primitive.base(), bounds, found),
    }
}

/// The pixels of the block at (x, y) that lie in `bounds`.
#[inline(always)]
fn rectangle_mask(bounds: Bounds, x: u16, y: u16) -> u64 {
    let within = |v: u16, start: u16| (i32::from(v) - i32::from(start)).clamp(0, 8) as usize;
    let columns = COLUMNS_BELOW[within(bounds.x1, x)] & !COLUMNS_BELOW[within(bounds.x0, x)];
    let rows = ROWS_BELOW[within(bounds.y1, y)] & !ROWS_BELOW[within(bounds.y0, y)];
    columns & rows
}

/// Walks the intersection of half planes `E - tie >= 0`, whose constants hold at the centre of pixel `base`.
#[inline(always)]
fn convex<V: Simd, const N: usize, const S: usize>(
    simd: V,
    edges: &[Edge; N],
    ties: &[i64; N],
    base: [i32; 2],
    bounds: Bounds,
    found: &mut Blocks<S>,
) {
    let (bx, by) = (bounds.x0 & !7, bounds.y0 & !7);
    let columns = (bounds.x1 - bx).div_ceil(8);
    let rows = (bounds.y1 - by).div_ceil(8);
    let (wx, wy) = (bounds.x0 & !1, bounds.y0 & !1);
    if bounds.x1 - wx <= 8 && bounds.y1 - wy <= 8 {
        return small(simd, edges, ties, base, [wx, wy], bounds, found);
    }
    // The constants at the first block of this area.
    let (dx, dy) = ((i32::from(bx) - base[0]) * SUBPIXEL, (i32::from(by) - base[1]) * SUBPIXEL);
    let mut first = [0; N];
    for n in 0..N {
        first[n] = edges[n].at(dx, dy) - ties[n];
    }
    // Where no constant of a block reaches the ends of the reduced range, it is the sum of the first block's and whole pixels: the floor of a sum
    // with a whole number is the sum of the floor and that number. Samples of several a pixel do not lie whole pixels apart.
    let mut fits = S == 1;
    let mut near = [0; N];
    for n in 0..N {
        let Edge { a, b, .. } = edges[n];
        let c = first[n] >> PIXEL_SHIFT;
        fits &= c.unsigned_abs() + u64::from(TILE) * u64::from(a.unsigned_abs() + b.unsigned_abs()) < 1 << 30;
        near[n] = c as i32;
    }
    let grid = Grid::new([bx, by], [columns, rows], bounds);
    if fits {
        visit::<_, N, S, true>(simd, edges, &first, &near, &grid, found)
    } else {
        visit::<_, N, S, false>(simd, edges, &first, &near, &grid, found)
    }
}

/// Visits the blocks of a grid in which a sample is covered. `first` are the constants at the first block. `NEAR`: those of all blocks are the
/// sums of `near`, which are the first block's, reduced, and whole pixels.
#[inline(always)]
fn visit<V: Simd, const N: usize, const S: usize, const NEAR: bool>(
    simd: V,
    edges: &[Edge; N],
    first: &[i64; N],
    near: &[i32; N],
    grid: &Grid,
    found: &mut Blocks<S>,
) {
    let [columns, rows] = grid.size;
    if columns * rows <= 4 {
        for row in 0..rows {
            for column in 0..columns {
                block::<_, N, S, NEAR>(simd, edges, first, near, grid, [column, row], found);
            }
        }
        return;
    }
    // Classify up to 8x8 blocks at once by the samples of each that are furthest in and furthest out.
    let spread = if S == 1 { 0 } else { 96 };
    let (mut touched, mut inside) = ([0; N], [0; N]);
    for n in 0..N {
        let Edge { a, b, .. } = edges[n];
        let (wa, wb) = (i64::from(a), i64::from(b));
        let reach = i64::from(7 * SUBPIXEL);
        let samples = spread * (wa.abs() + wb.abs());
        let most = reach * (wa.max(0) + wb.max(0)) + samples;
        let least = reach * (wa.min(0) + wb.min(0)) - samples;
        touched[n] = reduce(first[n] + most, BLOCK_SHIFT);
        inside[n] = reduce(first[n] + least, BLOCK_SHIFT);
    }
    // Blocks that exist: `columns` in each of `rows` rows, both at most 8.
    let row_bits = (1u64 << columns) - 1;
    let exist = (row_bits * 0x0101_0101_0101_0101) & (!0 >> (64 - 8 * rows));
    let mut left = kernel::rows(simd, edges, &touched) & exist;
    let inside = if found.takes_whole { kernel::rows(simd, edges, &inside) } else { 0 };
    while left != 0 {
        let bit = left.trailing_zeros() as u16;
        left &= left - 1;
        let at = [bit & 7, bit >> 3];
        if inside >> bit & 1 == 1 {
            let (mask, [x, y]) = (grid.allowed(at), grid.corner_of(at));
            found.push(Block { x, y, full: mask == !0, samples: [mask; S] });
        } else {
            block::<_, N, S, NEAR>(simd, edges, first, near, grid, at, found);
        }
    }
}

/// Tests the pixels of one block and visits it if any sample is covered.
#[inline(always)]
fn block<V: Simd, const N: usize, const S: usize, const NEAR: bool>(
    simd: V,
    edges: &[Edge; N],
    first: &[i64; N],
    near: &[i32; N],
    grid: &Grid,
    at: [u16; 2],
    found: &mut Blocks<S>,
) {
    let samples = if NEAR {
        let [dx, dy] = at.map(|v| i32::from(v) * 8);
        let mut c = [0; N];
        for n in 0..N {
            c[n] = near[n] + edges[n].a * dx + edges[n].b * dy;
        }
        [kernel::quads(simd, edges, &c); S]
    } else {
        let [dx, dy] = at.map(|v| i32::from(v) * 8 * SUBPIXEL);
        let mut c = [0; N];
        for n in 0..N {
            c[n] = Edge { c: first[n], ..edges[n] }.at(dx, dy);
        }
        masks(simd, edges, &c)
    };
    let (allowed, [x, y]) = (grid.allowed(at), grid.corner_of(at));
    emit(Block { x, y, full: false, samples: samples.map(|mask| mask & allowed) }, found);
}

/// The masks of all samples on the 8x8 pixels whose first pixel has the constants `c`.
#[inline(always)]
fn masks<V: Simd, const N: usize, const S: usize>(simd: V, edges: &[Edge; N], c: &[i64; N]) -> [u64; S] {
    let mut out = [0; S];
    for (s, &[x, y]) in positions::<S>().iter().enumerate() {
        let mut reduced = [0; N];
        for n in 0..N {
            let Edge { a, b, .. } = edges[n];
            let offset = i64::from(a) * i64::from(x) + i64::from(b) * i64::from(y);
            reduced[n] = reduce(c[n] + offset, PIXEL_SHIFT);
        }
        out[s] = kernel::quads(simd, edges, &reduced);
    }
    out
}

/// The blocks that hold some bounds.
struct Grid {
    /// Upper left corner.
    corner: [u16; 2],
    /// Columns and rows of blocks.
    size: [u16; 2],
    /// Pixels of a block in the first and in the last column that lie in the bounds.
    columns: [u64; 2],
    /// The same of rows.
    rows: [u64; 2],
}

impl Grid {
    #[inline(always)]
    fn new(corner: [u16; 2], size: [u16; 2], bounds: Bounds) -> Grid {
        let before = |v: u16| usize::from(v & 7);
        let end = |v: u16| usize::from((v - 1) & 7) + 1;
        Grid {
            corner,
            size,
            columns: [!COLUMNS_BELOW[before(bounds.x0)], COLUMNS_BELOW[end(bounds.x1)]],
            rows: [!ROWS_BELOW[before(bounds.y0)], ROWS_BELOW[end(bounds.y1)]],
        }
    }

    /// The pixels of a block that lie in the bounds.
    #[inline(always)]
    fn allowed(&self, [column, row]: [u16; 2]) -> u64 {
        let only = |at: bool, mask: u64| if at { mask } else { !0 };
        only(column == 0, self.columns[0])
            & only(column + 1 == self.size[0], self.columns[1])
            & only(row == 0, self.rows[0])
            & only(row + 1 == self.size[1], self.rows[1])
    }

    /// The first pixel of a block.
    #[inline(always)]
    fn corner_of(&self, [column, row]: [u16; 2]) -> [u16; 2] {
        [self.corner[0] + 8 * column, self.corner[1] + 8 * row]
    }
}

#[inline(always)]
fn emit<const S: usize>(mut block: Block<S>, found: &mut Blocks<S>) {
    if block.pixels() != 0 {
        block.full = block.samples.iter().all(|&m| m == !0);
        found.push(block);
    }
}

/// A primitive inside an 8x8 window with even corner: one evaluation, whatever blocks the window straddles.
#[inline(always)]
fn small<V: Simd, const N: usize, const S: usize>(
    simd: V,
    edges: &[Edge; N],
    ties: &[i64; N],
    base: [i32; 2],
    [wx, wy]: [u16; 2],
    bounds: Bounds,
    found: &mut Blocks<S>,
) {
    let (bx, by) = (wx & !7, wy & !7);
    let (dx, dy) = ((i32::from(wx) - base[0]) * SUBPIXEL, (i32::from(wy) - base[1]) * SUBPIXEL);
    let mut c = [0; N];
    for n in 0..N {
        c[n] = edges[n].at(dx, dy) - ties[n];
    }
    // The bounds lie in the window and begin in its first quad.
    let (x1, y1) = (usize::from(bounds.x1 - wx) & 15, usize::from(bounds.y1 - wy) & 15);
    let columns = COLUMNS_BELOW[x1] & !COLUMNS_BELOW[usize::from(bounds.x0 & 1)];
    let allowed = columns & ROWS_BELOW[y1] & !ROWS_BELOW[usize::from(bounds.y0 & 1)];
    let samples = masks(simd, edges, &c).map(|m| m & allowed);
    // Quad columns and rows of the window that lie in the first block.
    let (qx, qy) = (u32::from(8 - (wx - bx)) / 2, u32::from(8 - (wy - by)) / 2);
    if bounds.x1 <= bx + 8 && bounds.y1 <= by + 8 {
        // A quad to the right is 4 bits up, a quad down 16.
        let up = 4 * (4 - qx) + 16 * (4 - qy);
        return emit(Block { x: bx, y: by, full: false, samples: samples.map(|m| m << up) }, found);
    }
    let upper = ROWS_BELOW[2 * qy as usize];
    let left = COLUMNS_BELOW[2 * qx as usize];
    for (j, y) in [(0, by), (1, by + 8)] {
        for (i, x) in [(0, bx), (1, bx + 8)] {
            let keep = (if j == 0 { upper } else { !upper }) & (if i == 0 { left } else { !left });
            let place = |m: u64| {
                let m = m & keep;
                let m = if i == 0 { m << (4 * (4 - qx)) } else { m.checked_shr(4 * qx).unwrap_or(0) };
                if j == 0 { m << (16 * (4 - qy)) } else { m.checked_shr(16 * qy).unwrap_or(0) }
            };
            emit(Block { x, y, full: false, samples: samples.map(place) }, found);
        }
    }
}
