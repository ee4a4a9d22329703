//! The vectors: a triangle in each lane.

use fearless_simd::{f32x4, f32x8, f64x4, i32x4, i32x8, mask32x8, prelude::*, u32x8};

use super::{Bounds, Eight, EightBounds, EightQuad, NEAR, ScreenVertex, SetupState, WINDOW};
use crate::simd::{Simd, inlined, least, most};
use crate::state::{CullMode, FrontFace};
use num::{SUBPIXEL, SUBPIXEL_BITS};

/// Greatest extent of a triangle that is not large, in 1/256 pixel: its doubled area fits 32 bits.
const EXTENT: i32 = 64 * SUBPIXEL;

/// The slopes of an edge along x and y, or the halves of eight numbers.
type Two<T> = (T, T);

impl EightBounds {
    /// Finds the bounds of eight triangles.
    #[inline(always)]
    pub fn find<V: Simd>(simd: V, state: &SetupState, triangles: &[[ScreenVertex; 3]; 8]) -> EightBounds {
        let [x0, y0, _] = transpose(simd, triangles, 0);
        let [x1, y1, _] = transpose(simd, triangles, 1);
        let [x2, y2, _] = transpose(simd, triangles, 2);
        let set = |v: u16| i32x8::splat(simd, i32::from(v));
        let bits = |mask: mask32x8<V>| mask.to_bitmask() as u32;
        let area = doubled_area([x0, x1, x2], [y0, y1, y2]);
        let (left, right) = (x0.min(x1).min(x2), x0.max(x1).max(x2));
        let (upper, lower) = (y0.min(y1).min(y2), y0.max(y1).max(y2));
        let large = (right - left).simd_gt(EXTENT) | (lower - upper).simd_gt(EXTENT);
        let front = bits(area.simd_gt(0)) ^ if state.front_face == FrontFace::Cw { 0 } else { 0xff };
        // The least and greatest sample offsets from the left (upper) edge of a pixel.
        let (first, last) = if state.samples == 1 { (128, 128) } else { (32, 224) };
        let down = i32::from(state.lower_edges);
        let low = [pixel(left, last), pixel(upper, last - down)];
        let high = [pixel(right, first), pixel(lower, first - down)];
        let some = high[0].simd_gt(low[0]) & high[1].simd_gt(low[1]);
        let b = &state.bounds;
        let low = [low[0].max(set(b.x0)), low[1].max(set(b.y0))];
        let high = [high[0].min(set(b.x1)), high[1].min(set(b.y1))];
        let inside = high[0].simd_gt(low[0]) & high[1].simd_gt(low[1]);
        let far = inlined(
            #[inline(always)]
            |(c, first, last): (usize, i32x8<V>, i32x8<V>)| {
                let corner = low[c] << SUBPIXEL_BITS;
                let window = high[c] - (low[c] & !1);
                (corner - first).simd_gt(NEAR) | (last - corner).simd_gt(NEAR) | window.simd_gt(i32::from(WINDOW[c]))
            },
        );
        let far = far((0, left, right)) | far((1, upper, lower));
        EightBounds {
            large: bits(large),
            small: bits(!(far | large)),
            degenerate: bits(area.simd_eq(0)),
            face: match state.cull {
                CullMode::None => 0,
                CullMode::Front => front,
                CullMode::Back => !front & 0xff,
            },
            no_sample: bits(!some),
            scissor: bits(!inside),
            bounds: [low[0].into(), low[1].into(), high[0].into(), high[1].into()],
        }
    }
}

/// Twice the signed areas of triangles that are not large, positive where the winding is clockwise on the screen.
#[inline(always)]
fn doubled_area<V: Simd>([x0, x1, x2]: [i32x8<V>; 3], [y0, y1, y2]: [i32x8<V>; 3]) -> i32x8<V> {
    (x1 - x0) * (y2 - y0) - (y1 - y0) * (x2 - x0)
}

/// The first pixels whose sample, `offset` from their left (upper) edge, is not left of (above) positions.
#[inline(always)]
fn pixel<V: Simd>(v: i32x8<V>, offset: i32) -> i32x8<V> {
    (v + (SUBPIXEL - 1 - offset)) >> SUBPIXEL_BITS
}

/// Of pixels that come in pairs of columns or rows, `bits` of a mask each pair and `half` the first of it: those in the first `n`.
#[inline(always)]
fn below<V: Simd>(n: i32x8<V>, bits: i32, half: i32) -> i32x8<V> {
    (((n & 1) * half + 1) << ((n & !1) * (bits / 2))) - 1
}

impl Eight {
    /// Sets up triangles that [`super::is_small`] allows and finds what they cover in `area`, which begins at multiples of
    /// 8. There is no depth bias, and one sample per pixel.
    #[inline(always)]
    pub fn set_up<V: Simd>(&mut self, simd: V, state: &SetupState, area: &Bounds, triangles: &[[ScreenVertex; 3]; 8]) {
        simd.vectorize(
            #[inline(always)]
            || self.set_up_here(simd, state, area, triangles),
        );
    }

    #[inline(always)]
    fn set_up_here<V: Simd>(&mut self, simd: V, state: &SetupState, area: &Bounds, triangles: &[[ScreenVertex; 3]; 8]) {
        let [x0, y0, z0] = transpose(simd, triangles, 0);
        let [x1, y1, z1] = transpose(simd, triangles, 1);
        let [x2, y2, z2] = transpose(simd, triangles, 2);
        let [z0, z1, z2]: [f32x8<V>; 3] = [z0.bitcast(), z1.bitcast(), z2.bitcast()];
        let set = |v: u16| i32x8::splat(simd, i32::from(v));
        let words = |v: i32x8<V>| -> [u32; 8] { v.bitcast::<u32x8<V>>().into() };
        let area2 = doubled_area([x0, x1, x2], [y0, y1, y2]);
        let clockwise = area2.simd_gt(0).to_bitmask() as u32;
        self.front = if state.front_face == FrontFace::Cw { clockwise } else { !clockwise };

        // Bounds: of one sample in the pixel's centre, scissored, in the area.
        let down = i32::from(state.lower_edges);
        let half = SUBPIXEL / 2;
        let all = &state.bounds;
        let left = pixel(x0.min(x1).min(x2), half).max(set(all.x0));
        let upper = pixel(y0.min(y1).min(y2), half - down).max(set(all.y0));
        let right = pixel(x0.max(x1).max(x2), half).min(set(all.x1.min(area.x1)));
        let lower = pixel(y0.max(y1).max(y2), half - down).min(set(all.y1.min(area.y1)));
        let base = [left & !7, upper & !7];
        let (left, upper) = (left.max(set(area.x0)), upper.max(set(area.y0)));
        let window = [left & !1, upper & !1];
        let allowed = {
            // An empty span has no pixels: its end is not above its beginning.
            let [columns, rows] = [right - window[0], lower - window[1]];
            let columns = below(columns.max(0).min(i32::from(WINDOW[0])), 4, 0x5) & !below(left - window[0], 4, 0x5);
            let rows = below(rows.max(0).min(i32::from(WINDOW[1])), 12, 0x333) & !below(upper - window[1], 12, 0x333);
            // The columns are those of one row of quads; there are two.
            (columns * 0x1001) & rows
        };

        // Edges that are positive inside, for either winding, at the centre of the window's first pixel.
        let (cx, cy) = ((window[0] << SUBPIXEL_BITS) + half, (window[1] << SUBPIXEL_BITS) + half);
        let sign = area2 >> 31;
        let e0 = (((y1 - y2) ^ sign) - sign, ((x2 - x1) ^ sign) - sign);
        let e1 = (((y2 - y0) ^ sign) - sign, ((x0 - x2) ^ sign) - sign);
        let e2 = (((y0 - y1) ^ sign) - sign, ((x1 - x0) ^ sign) - sign);
        let lower_edges = mask32x8::splat(simd, state.lower_edges);
        let value = inlined(
            #[inline(always)]
            |((a, b), x, y): (Two<i32x8<V>>, i32x8<V>, i32x8<V>)| {
                // Less one, but for edges that own what lies on them: left ones, and top or bottom ones.
                let owns = a.simd_gt(0) | a.simd_eq(0) & (b.simd_gt(0) ^ lower_edges);
                (a * (cx - x) + b * (cy - y)) + (!owns).to_vector()
            },
        );
        let start = [value((e0, x1, y1)), value((e1, x2, y2)), value((e2, x0, y0))];
        let right_by = [e0.0 << SUBPIXEL_BITS, e1.0 << SUBPIXEL_BITS, e2.0 << SUBPIXEL_BITS];
        let down_by = [e0.1 << SUBPIXEL_BITS, e1.1 << SUBPIXEL_BITS, e2.1 << SUBPIXEL_BITS];
        let mut mask = i32x8::splat(simd, 0);
        let mut row = start;
        for j in 0..i32::from(WINDOW[1]) {
            let mut at = row;
            for i in 0..i32::from(WINDOW[0]) {
                let outside = (at[0] | at[1] | at[2]) >> 31;
                mask |= !outside & (1 << (4 * (i / 2 + 3 * (j / 2)) + i % 2 + 2 * (j % 2)));
                for n in 0..3 {
                    at[n] += right_by[n];
                }
            }
            for n in 0..3 {
                row[n] += down_by[n];
            }
        }
        let mask = mask & allowed;
        self.mask = words(mask);
        self.corner = [words(window[0]), words(window[1])];

        // Where the quads lie in the tile; first the quad column and row of the corner.
        let (column, row) = ((window[0] & 63) >> 1, (window[1] & 63) >> 1);
        // Quads are four per row of a block, blocks eight per row of the tile.
        let split = |k: i32x8<V>| (k >> 2, k & 3);
        let lanes = i32x8::simd_from(simd, [0, 1 << 13, 2 << 13, 3 << 13, 4 << 13, 5 << 13, 6 << 13, 7 << 13]);
        for r in 0..2 {
            let (blocks, quads) = split(row + r);
            let down = (blocks << 7) + (quads << 2);
            for c in 0..3 {
                let (blocks, quads) = split(column + c);
                let at = (down + ((blocks << 4) + quads)) & 0x3ff;
                let q = c + 3 * r;
                let coverage = (mask >> (4 * q as u32)) & 15;
                self.quads[q as usize] = words(at | lanes | (q << 10) | (coverage << 16));
            }
        }
        // Pixels of the quads that lie in the block of the corner's column, and of its row.
        let one = i32x8::splat(simd, 1);
        let near =
            [(((one << (((column & 3) ^ 3) * 4 + 4)) - 1) & 0xfff) * 0x1001, (one << ((((row & 3) ^ 3) + 1).min(2) * 12)) - 1];
        let halves = |mask: i32x8<V>, by: i32x8<V>| [mask & by, mask & !by];
        for (c, part) in halves(mask, near[0]).into_iter().enumerate() {
            for (r, part) in halves(part, near[1]).into_iter().enumerate() {
                self.parts[2 * r + c] = (!part.simd_eq(0)).to_bitmask() as u32;
            }
        }

        // Depth. Slopes and distances are exact in single precision, and halves of areas.
        let area2 = area2.abs();
        let (areas_high, areas_low) = (exact(area2 >> 8), exact(area2 & 255));
        let slopes = [[exact(e1.0), exact(e2.0)], [exact(e1.1), exact(e2.1)]];
        let (right, below) = (exact((base[0] << SUBPIXEL_BITS) - x0), exact((base[1] << SUBPIXEL_BITS) - y0));
        let z: [Two<f64x4<V>>; 3] = [z0.widen(), z1.widen(), z2.widen()];
        let four = inlined(
            #[inline(always)]
            |of: fn(&Two<f64x4<V>>) -> f64x4<V>| {
                let inv_area = f64x4::splat(simd, 1.0) / (of(&areas_high) * 256.0 + of(&areas_low));
                let (d1, d2) = (of(&z[1]) - of(&z[0]), of(&z[2]) - of(&z[0]));
                let sx = (of(&slopes[0][0]) * d1 + of(&slopes[0][1]) * d2) * inv_area;
                let sy = (of(&slopes[1][0]) * d1 + of(&slopes[1][1]) * d2) * inv_area;
                let at_origin = of(&z[0]) + (sx * of(&right) + sy * of(&below));
                [at_origin, sx * f64::from(SUBPIXEL), sy * f64::from(SUBPIXEL)]
            },
        );
        let (low, high) = (four(|pair| pair.0), four(|pair| pair.1));
        self.z0 = low[0].narrow(high[0]).into();
        self.slope = [low[1].narrow(high[1]).into(), low[2].narrow(high[2]).into()];
        self.first = [(float(window[0] - base[0]) + 0.5).into(), (float(window[1] - base[1]) + 0.5).into()];
        self.origin = [float(base[0]).into(), float(base[1]).into()];
        let (near, far) = (f32x8::splat(simd, state.depth_range[0]), f32x8::splat(simd, state.depth_range[1]));
        let (low, high) = (least(least(z0, z1), z2), most(most(z0, z1), z2));
        self.range = [least(most(low, near), far).into(), least(most(high, near), far).into()];
    }

    /// Depths at the four pixel centres of a quad: those of [`crate::setup::DepthPlane::quad`].
    #[inline(always)]
    pub fn depths<V: Simd>(&self, simd: V, quad: EightQuad) -> f32x4<V> {
        // All distances are exact, in whatever order they are found.
        const ACROSS: [[f32; 4]; 3] = [[0.0, 1.0, 0.0, 1.0], [2.0, 3.0, 2.0, 3.0], [4.0, 5.0, 4.0, 5.0]];
        const DOWN: [[f32; 4]; 2] = [[0.0, 0.0, 1.0, 1.0], [2.0, 2.0, 3.0, 3.0]];
        let (i, [column, row]) = (quad.triangle(), quad.place());
        let splat = |v: f32| f32x4::splat(simd, v);
        let distance = |first: f32, step: [f32; 4]| splat(first) + f32x4::simd_from(simd, step);
        let x = splat(self.slope[0][i]) * distance(self.first[0][i], ACROSS[column]);
        let y = splat(self.slope[1][i]) * distance(self.first[1][i], DOWN[row]);
        let z = splat(self.z0[i]) + (x + y);
        least(most(z, splat(self.range[0][i])), splat(self.range[1][i]))
    }
}

#[inline(always)]
fn float<V: Simd>(v: i32x8<V>) -> f32x8<V> {
    v.to_float()
}

/// In double precision, of numbers that are exact in single precision: the lower and the upper half.
#[inline(always)]
fn exact<V: Simd>(v: i32x8<V>) -> Two<f64x4<V>> {
    float(v).widen()
}

/// x, y and the bits of z of one vertex of all triangles.
#[inline(always)]
fn transpose<V: Simd>(simd: V, triangles: &[[ScreenVertex; 3]; 8], v: usize) -> [i32x8<V>; 3] {
    let vertex = inlined(
        #[inline(always)]
        |i: usize| {
            let ScreenVertex { x, y, z, inv_w } = triangles[i][v];
            i32x4::simd_from(simd, [x, y, z.to_bits() as i32, inv_w.to_bits() as i32])
        },
    );
    let four = inlined(
        #[inline(always)]
        |i: usize| {
            let (r0, r1, r2, r3) = (vertex(i), vertex(i + 1), vertex(i + 2), vertex(i + 3));
            let (even, odd) = (r0.zip_low(r2), r1.zip_low(r3));
            [even.zip_low(odd), even.zip_high(odd), r0.zip_high(r2).zip_low(r1.zip_high(r3))]
        },
    );
    let (low, high) = (four(0), four(4));
    [low[0].combine(high[0]), low[1].combine(high[1]), low[2].combine(high[2])]
}
