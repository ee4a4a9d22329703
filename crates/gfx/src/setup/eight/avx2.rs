//! The registers.

use std::arch::x86_64::*;

use super::{Bounds, Eight, EightBounds, EightQuad, NEAR, ScreenVertex, SetupState, WINDOW};
use crate::state::{CullMode, FrontFace};
use num::{SUBPIXEL, SUBPIXEL_BITS};

/// Greatest extent of a triangle that is not large, in 1/256 pixel: its doubled area fits 32 bits.
const EXTENT: i32 = 64 * SUBPIXEL;

impl EightBounds {
    /// Finds the bounds of eight triangles.
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn find(state: &SetupState, triangles: &[[ScreenVertex; 3]; 8]) -> EightBounds {
        let vertex = |v: usize| transpose(triangles, v);
        let ((x0, y0, _), (x1, y1, _), (x2, y2, _)) = (vertex(0), vertex(1), vertex(2));
        let set = |v: i32| _mm256_set1_epi32(v);
        let sub = |a: __m256i, b: __m256i| _mm256_sub_epi32(a, b);
        let bits = |v: __m256i| _mm256_movemask_ps(_mm256_castsi256_ps(v)) as u32;
        let above = |a: __m256i, b: __m256i| _mm256_cmpgt_epi32(a, b);
        let area = doubled_area([x0, x1, x2], [y0, y1, y2]);
        let least = |a, b, c| _mm256_min_epi32(_mm256_min_epi32(a, b), c);
        let most = |a, b, c| _mm256_max_epi32(_mm256_max_epi32(a, b), c);
        let (left, right) = (least(x0, x1, x2), most(x0, x1, x2));
        let (upper, lower) = (least(y0, y1, y2), most(y0, y1, y2));
        let wide = _mm256_or_si256(above(sub(right, left), set(EXTENT)), above(sub(lower, upper), set(EXTENT)));
        let front = bits(above(area, _mm256_setzero_si256())) ^ if state.front_face == FrontFace::Cw { 0 } else { 0xff };
        // The least and greatest sample offsets from the left (upper) edge of a pixel.
        let (first, last) = if state.samples == 1 { (128, 128) } else { (32, 224) };
        let pixel = |v: __m256i, offset: i32| {
            _mm256_srai_epi32::<{ SUBPIXEL_BITS as i32 }>(_mm256_add_epi32(v, set(SUBPIXEL - 1 - offset)))
        };
        let down = i32::from(state.lower_edges);
        let low = [pixel(left, last), pixel(upper, last - down)];
        let high = [pixel(right, first), pixel(lower, first - down)];
        let some = _mm256_and_si256(above(high[0], low[0]), above(high[1], low[1]));
        let b = &state.bounds;
        let low = [_mm256_max_epi32(low[0], set(i32::from(b.x0))), _mm256_max_epi32(low[1], set(i32::from(b.y0)))];
        let high = [_mm256_min_epi32(high[0], set(i32::from(b.x1))), _mm256_min_epi32(high[1], set(i32::from(b.y1)))];
        let inside = _mm256_and_si256(above(high[0], low[0]), above(high[1], low[1]));
        let far = |c: usize, first: __m256i, end: __m256i, least: __m256i, most: __m256i| {
            let corner = _mm256_slli_epi32::<{ SUBPIXEL_BITS as i32 }>(first);
            let window = sub(end, _mm256_and_si256(first, set(!1)));
            let beyond = _mm256_or_si256(above(sub(corner, least), set(NEAR)), above(sub(most, corner), set(NEAR)));
            _mm256_or_si256(beyond, above(window, set(i32::from(WINDOW[c]))))
        };
        let far = _mm256_or_si256(far(0, low[0], high[0], left, right), far(1, low[1], high[1], upper, lower));
        let words = |v: __m256i| bytemuck::cast(v);
        EightBounds {
            large: bits(wide),
            small: !bits(_mm256_or_si256(far, wide)) & 0xff,
            degenerate: bits(_mm256_cmpeq_epi32(area, _mm256_setzero_si256())),
            face: match state.cull {
                CullMode::None => 0,
                CullMode::Front => front,
                CullMode::Back => !front & 0xff,
            },
            no_sample: !bits(some) & 0xff,
            scissor: !bits(inside) & 0xff,
            bounds: [words(low[0]), words(low[1]), words(high[0]), words(high[1])],
        }
    }
}

/// Twice the signed areas of triangles that are not large, positive where the winding is clockwise on the screen.
#[target_feature(enable = "avx2")]
#[inline]
fn doubled_area([x0, x1, x2]: [__m256i; 3], [y0, y1, y2]: [__m256i; 3]) -> __m256i {
    let sub = |a: __m256i, b: __m256i| _mm256_sub_epi32(a, b);
    sub(_mm256_mullo_epi32(sub(x1, x0), sub(y2, y0)), _mm256_mullo_epi32(sub(y1, y0), sub(x2, x0)))
}

impl Eight {
    /// Sets up triangles that [`super::is_small`] allows and finds what they cover in `area`, which begins at multiples of
    /// 8. There is no depth bias, and one sample per pixel.
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    pub fn set_up(&mut self, state: &SetupState, area: &Bounds, triangles: &[[ScreenVertex; 3]; 8]) {
        let vertex = |v: usize| transpose(triangles, v);
        let ((x0, y0, z0), (x1, y1, z1), (x2, y2, z2)) = (vertex(0), vertex(1), vertex(2));
        let set = |v: i32| _mm256_set1_epi32(v);
        let sub = |a: __m256i, b: __m256i| _mm256_sub_epi32(a, b);
        let area2 = doubled_area([x0, x1, x2], [y0, y1, y2]);
        let clockwise = _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpgt_epi32(area2, _mm256_setzero_si256()))) as u32;
        self.front = if state.front_face == FrontFace::Cw { clockwise } else { !clockwise };

        // Bounds: of one sample in the pixel's centre, scissored, in the area.
        let down = i32::from(state.lower_edges);
        let pixel = |v: __m256i, down: i32| {
            _mm256_srai_epi32::<{ SUBPIXEL_BITS as i32 }>(_mm256_add_epi32(v, set(SUBPIXEL / 2 - 1 + down)))
        };
        let least = |a, b, c, down| pixel(_mm256_min_epi32(_mm256_min_epi32(a, b), c), down);
        let most = |a, b, c, down| pixel(_mm256_max_epi32(_mm256_max_epi32(a, b), c), down);
        let all = &state.bounds;
        let left = _mm256_max_epi32(least(x0, x1, x2, 0), set(i32::from(all.x0)));
        let upper = _mm256_max_epi32(least(y0, y1, y2, down), set(i32::from(all.y0)));
        let right = _mm256_min_epi32(most(x0, x1, x2, 0), set(i32::from(all.x1.min(area.x1))));
        let lower = _mm256_min_epi32(most(y0, y1, y2, down), set(i32::from(all.y1.min(area.y1))));
        let base = [_mm256_and_si256(left, set(!7)), _mm256_and_si256(upper, set(!7))];
        let left = _mm256_max_epi32(left, set(i32::from(area.x0)));
        let upper = _mm256_max_epi32(upper, set(i32::from(area.y0)));
        let window = [_mm256_and_si256(left, set(!1)), _mm256_and_si256(upper, set(!1))];
        let allowed = {
            // Pixels of the window in columns below 0 to 6, and in rows below 0 to 4.
            let columns = _mm256_setr_epi32(0, 0x00_5005, 0x00_f00f, 0x05_f05f, 0x0f_f0ff, 0x5f_f5ff, 0xff_ffff, 0);
            let rows = _mm256_setr_epi32(0, 0x00_0333, 0x00_0fff, 0x33_3fff, 0xff_ffff, 0, 0, 0);
            let span = |table: __m256i, most: u16, first: __m256i, end: __m256i, corner: __m256i| {
                // An empty span has no pixels: its end is not above its beginning.
                let end = _mm256_max_epi32(sub(end, corner), _mm256_setzero_si256());
                let end = _mm256_min_epi32(end, set(i32::from(most)));
                let below = |n: __m256i| _mm256_permutevar8x32_epi32(table, n);
                _mm256_andnot_si256(below(sub(first, corner)), below(end))
            };
            let columns = span(columns, WINDOW[0], left, right, window[0]);
            _mm256_and_si256(columns, span(rows, WINDOW[1], upper, lower, window[1]))
        };

        // Edges that are positive inside, for either winding, at the centre of the window's first pixel.
        let center = |v: __m256i| _mm256_add_epi32(_mm256_slli_epi32::<{ SUBPIXEL_BITS as i32 }>(v), set(SUBPIXEL / 2));
        let [cx, cy] = [center(window[0]), center(window[1])];
        let slopes = |jx, jy, kx, ky| (_mm256_sign_epi32(sub(jy, ky), area2), _mm256_sign_epi32(sub(kx, jx), area2));
        let e0 = slopes(x1, y1, x2, y2);
        let e1 = slopes(x2, y2, x0, y0);
        let e2 = slopes(x0, y0, x1, y1);
        let zero = _mm256_setzero_si256();
        let value = |(a, b): (__m256i, __m256i), jx, jy| {
            let at = _mm256_add_epi32(_mm256_mullo_epi32(a, sub(cx, jx)), _mm256_mullo_epi32(b, sub(cy, jy)));
            // Less one, but for edges that own what lies on them: left ones, and top or bottom ones.
            let below = _mm256_xor_si256(_mm256_cmpgt_epi32(b, zero), set(-down));
            let owns = _mm256_or_si256(_mm256_cmpgt_epi32(a, zero), _mm256_and_si256(_mm256_cmpeq_epi32(a, zero), below));
            _mm256_add_epi32(at, _mm256_xor_si256(owns, set(-1)))
        };
        let start = [value(e0, x1, y1), value(e1, x2, y2), value(e2, x0, y0)];
        let step = |v: __m256i| _mm256_slli_epi32::<{ SUBPIXEL_BITS as i32 }>(v);
        let right_by = [step(e0.0), step(e1.0), step(e2.0)];
        let down_by = [step(e0.1), step(e1.1), step(e2.1)];
        let mut mask = zero;
        let mut row = start;
        for j in 0..i32::from(WINDOW[1]) {
            let mut at = row;
            for i in 0..i32::from(WINDOW[0]) {
                let outside = _mm256_or_si256(_mm256_or_si256(at[0], at[1]), at[2]);
                let bit = 1 << (4 * (i / 2 + 3 * (j / 2)) + i % 2 + 2 * (j % 2));
                mask = _mm256_or_si256(mask, _mm256_andnot_si256(_mm256_srai_epi32::<31>(outside), set(bit)));
                for n in 0..3 {
                    at[n] = _mm256_add_epi32(at[n], right_by[n]);
                }
            }
            for n in 0..3 {
                row[n] = _mm256_add_epi32(row[n], down_by[n]);
            }
        }
        let mask = _mm256_and_si256(mask, allowed);
        self.mask = bytemuck::cast(mask);
        self.corner = [bytemuck::cast(window[0]), bytemuck::cast(window[1])];

        // Where the quads lie in the tile; first the quad column and row of the corner.
        let half = |v: __m256i| _mm256_srli_epi32::<1>(_mm256_and_si256(v, set(63)));
        let (column, row) = (half(window[0]), half(window[1]));
        // Quads are four per row of a block, blocks eight per row of the tile.
        let split = |k: __m256i| (_mm256_srli_epi32::<2>(k), _mm256_and_si256(k, set(3)));
        let lanes = _mm256_setr_epi32(0, 1 << 13, 2 << 13, 3 << 13, 4 << 13, 5 << 13, 6 << 13, 7 << 13);
        for r in 0..2 {
            let (blocks, quads) = split(_mm256_add_epi32(row, set(r)));
            let down = _mm256_add_epi32(_mm256_slli_epi32::<7>(blocks), _mm256_slli_epi32::<2>(quads));
            for c in 0..3 {
                let (blocks, quads) = split(_mm256_add_epi32(column, set(c)));
                let across = _mm256_add_epi32(_mm256_slli_epi32::<4>(blocks), quads);
                let at = _mm256_and_si256(_mm256_add_epi32(down, across), set(0x3ff));
                let q = c + 3 * r;
                let shift = _mm_cvtsi32_si128(4 * q);
                let coverage = _mm256_and_si256(_mm256_srl_epi32(mask, shift), set(15));
                let named = _mm256_or_si256(_mm256_or_si256(at, lanes), set(q << 10));
                self.quads[q as usize] = bytemuck::cast(_mm256_or_si256(named, _mm256_slli_epi32::<16>(coverage)));
            }
        }
        // Quads that lie in the block of the corner's column, and of its row.
        let table = |table: __m256i, k: __m256i| _mm256_permutevar8x32_epi32(table, _mm256_and_si256(k, set(3)));
        let near = [
            table(_mm256_setr_epi32(0xff_ffff, 0xff_ffff, 0x0f_f0ff, 0x00_f00f, 0, 0, 0, 0), column),
            table(_mm256_setr_epi32(0xff_ffff, 0xff_ffff, 0xff_ffff, 0x00_0fff, 0, 0, 0, 0), row),
        ];
        let halves = |mask: __m256i, by: __m256i| [_mm256_and_si256(mask, by), _mm256_andnot_si256(by, mask)];
        for (c, part) in halves(mask, near[0]).into_iter().enumerate() {
            for (r, part) in halves(part, near[1]).into_iter().enumerate() {
                let none = _mm256_castsi256_ps(_mm256_cmpeq_epi32(part, zero));
                self.parts[2 * r + c] = !_mm256_movemask_ps(none) as u32 & 0xff;
            }
        }

        // Depth.
        let minimum = |a, b| _mm256_min_ps(a, b);
        let maximum = |a, b| _mm256_max_ps(a, b);
        let (near, far) = (_mm256_set1_ps(state.depth_range[0]), _mm256_set1_ps(state.depth_range[1]));
        let limit = |z: __m256| minimum(maximum(z, near), far);
        let area2 = _mm256_abs_epi32(area2);
        let origin = |v: __m256i, at: __m256i| sub(_mm256_slli_epi32::<{ SUBPIXEL_BITS as i32 }>(v), at);
        let [dx, dy] = [origin(base[0], x0), origin(base[1], y0)];
        let half = |upper: bool| {
            let int = |v: __m256i| {
                _mm256_cvtepi32_pd(if upper { _mm256_extracti128_si256::<1>(v) } else { _mm256_castsi256_si128(v) })
            };
            let float =
                |v: __m256| _mm256_cvtps_pd(if upper { _mm256_extractf128_ps::<1>(v) } else { _mm256_castps256_ps128(v) });
            let inv_area = _mm256_div_pd(_mm256_set1_pd(1.0), int(area2));
            let z = float(z0);
            let (d1, d2) = (_mm256_sub_pd(float(z1), z), _mm256_sub_pd(float(z2), z));
            let slope = |s1: __m256i, s2: __m256i| {
                let sum = _mm256_add_pd(_mm256_mul_pd(int(s1), d1), _mm256_mul_pd(int(s2), d2));
                _mm256_mul_pd(sum, inv_area)
            };
            let (sx, sy) = (slope(e1.0, e2.0), slope(e1.1, e2.1));
            let at_origin = _mm256_add_pd(z, _mm256_add_pd(_mm256_mul_pd(sx, int(dx)), _mm256_mul_pd(sy, int(dy))));
            let per_pixel = _mm256_set1_pd(f64::from(SUBPIXEL));
            let narrow = |v: __m256d| _mm256_cvtpd_ps(v);
            [narrow(at_origin), narrow(_mm256_mul_pd(sx, per_pixel)), narrow(_mm256_mul_pd(sy, per_pixel))]
        };
        let (low, high) = (half(false), half(true));
        let float = |v: __m256i| _mm256_cvtepi32_ps(v);
        let first = |c: usize| _mm256_add_ps(float(sub(window[c], base[c])), _mm256_set1_ps(0.5));
        self.first = [bytemuck::cast(first(0)), bytemuck::cast(first(1))];
        self.origin = [bytemuck::cast(float(base[0])), bytemuck::cast(float(base[1]))];
        let join = |n: usize| bytemuck::cast(_mm256_set_m128(high[n], low[n]));
        (self.z0, self.slope) = (join(0), [join(1), join(2)]);
        let range = [minimum(minimum(z0, z1), z2), maximum(maximum(z0, z1), z2)];
        self.range = [bytemuck::cast(limit(range[0])), bytemuck::cast(limit(range[1]))];
    }

    /// Depths at the four pixel centres of a quad: those of [`crate::setup::DepthPlane::quad`].
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn depths(&self, quad: EightQuad) -> __m128 {
        // All distances are exact, in whatever order they are found.
        const ACROSS: [[f32; 4]; 3] = [[0.0, 1.0, 0.0, 1.0], [2.0, 3.0, 2.0, 3.0], [4.0, 5.0, 4.0, 5.0]];
        const DOWN: [[f32; 4]; 2] = [[0.0, 0.0, 1.0, 1.0], [2.0, 2.0, 3.0, 3.0]];
        let (i, [column, row]) = (quad.triangle(), quad.place());
        let distance = |first: f32, step: [f32; 4]| _mm_add_ps(_mm_set1_ps(first), bytemuck::cast(step));
        let x = _mm_mul_ps(_mm_set1_ps(self.slope[0][i]), distance(self.first[0][i], ACROSS[column]));
        let y = _mm_mul_ps(_mm_set1_ps(self.slope[1][i]), distance(self.first[1][i], DOWN[row]));
        let z = _mm_add_ps(_mm_set1_ps(self.z0[i]), _mm_add_ps(x, y));
        _mm_min_ps(_mm_max_ps(z, _mm_set1_ps(self.range[0][i])), _mm_set1_ps(self.range[1][i]))
    }
}

/// x, y and z of one vertex of all triangles.
#[target_feature(enable = "avx2")]
#[inline]
fn transpose(triangles: &[[ScreenVertex; 3]; 8], v: usize) -> (__m256i, __m256i, __m256) {
    let vertex = |i: usize| {
        let ScreenVertex { x, y, z, inv_w } = triangles[i][v];
        _mm_setr_epi32(x, y, z.to_bits() as i32, inv_w.to_bits() as i32)
    };
    let row = |i: usize| _mm256_set_m128i(vertex(i + 4), vertex(i));
    let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
    let (a, b) = (_mm256_unpacklo_epi32(r0, r1), _mm256_unpackhi_epi32(r0, r1));
    let (c, d) = (_mm256_unpacklo_epi32(r2, r3), _mm256_unpackhi_epi32(r2, r3));
    (_mm256_unpacklo_epi64(a, c), _mm256_unpackhi_epi64(a, c), _mm256_castsi256_ps(_mm256_unpacklo_epi64(b, d)))
}
