//! Depth tests with one sample per pixel in AVX2 registers: of 8x8 blocks, eight pixels at a time, and of the quads of small
//! triangles.
//!
//! The same operations as [`DepthPlane::at`] and [`DepthStencilState::test_quad`] in the same order, hence the same bits. They
//! are written with intrinsics because the mask of what passed leaves the registers in one instruction, for which the compiler
//! has no other word; as plain loops the test took twice the time.

use std::arch::x86_64::*;

use super::depth::{DepthStencilState, Storage};
use super::select_mask;
use crate::setup::{DepthPlane, Eight, EightQuad};
use crate::state::Compare;
use num::LANES;

/// How depths are stored.
pub(super) const FLOAT: u8 = 0;
pub(super) const UNORM24: u8 = 1;
pub(super) const UNORM16: u8 = 2;

/// Comparisons that have code of their own, and the others.
pub(super) const LESS: u8 = 0;
pub(super) const LESS_EQUAL: u8 = 1;
pub(super) const ANY: u8 = 2;

impl DepthStencilState {
    /// Tests the pixels of `mask` in the block whose upper left pixel is (x, y) against the depths of a plane and updates their
    /// codes. Returns the pixels that passed. The state has no stencil test and codes of one word
    /// ([`DepthStencilState::tests_blocks`]).
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn test_block_avx2(&self, plane: &DepthPlane, at: [u16; 2], mask: u64, stored: &mut [u32; LANES]) -> u64 {
        debug_assert!(self.tests_blocks());
        match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => self.test::<FLOAT, LESS>(plane, at, mask, stored),
            (Storage::Float, Compare::LessEqual) => self.test::<FLOAT, LESS_EQUAL>(plane, at, mask, stored),
            (Storage::Float, _) => self.test::<FLOAT, ANY>(plane, at, mask, stored),
            (Storage::Unorm24, _) => self.test::<UNORM24, ANY>(plane, at, mask, stored),
            _ => self.test::<UNORM16, ANY>(plane, at, mask, stored),
        }
    }

    /// Tests a quad of a small triangle and updates its codes. Returns the pixels that passed. The state is one for
    /// [`DepthStencilState::test_block_avx2`].
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub fn test_quad_avx2(&self, eight: &Eight, quad: EightQuad, stored: &mut [u32; 4]) -> u32 {
        debug_assert!(self.tests_blocks());
        let z = eight.depths(quad);
        let z = _mm_min_ps(_mm_set1_ps(self.range[1]), _mm_max_ps(_mm_set1_ps(self.range[0]), z));
        let wide = |v: __m128| _mm256_castps128_ps256(v);
        let new = match self.storage {
            Storage::Float => _mm_castps_si128(z),
            Storage::Unorm24 => _mm256_castsi256_si128(unorm24(wide(z))),
            _ => _mm256_castsi256_si128(unorm16(wide(z))),
        };
        let beside = _mm_set1_epi32(if self.storage == Storage::Unorm24 { 0xff00_0000_u32 as i32 } else { 0 });
        let old: __m128i = bytemuck::cast(*stored);
        let old_z = _mm_castsi128_ps(old);
        let pass = match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => _mm_castps_si128(_mm_cmplt_ps(z, old_z)),
            (Storage::Float, Compare::LessEqual) => _mm_castps_si128(_mm_cmple_ps(z, old_z)),
            (Storage::Float, _) => _mm256_castsi256_si128(self.accept_floats(wide(z), wide(old_z))),
            _ => {
                let wide = |v: __m128i| _mm256_castsi128_si256(v);
                _mm256_castsi256_si128(self.accept_integers(wide(new), wide(_mm_andnot_si128(beside, old))))
            }
        };
        let pass = _mm_and_si128(pass, bytemuck::cast(select_mask(quad.coverage() as u8)));
        if self.depth_write {
            *stored = bytemuck::cast(_mm_blendv_epi8(old, new, _mm_andnot_si128(beside, pass)));
        }
        _mm_movemask_ps(_mm_castsi128_ps(pass)) as u32
    }

    #[target_feature(enable = "avx2")]
    fn test<const STORAGE: u8, const COMPARE: u8>(
        &self,
        plane: &DepthPlane,
        [x, y]: [u16; 2],
        mask: u64,
        stored: &mut [u32; LANES],
    ) -> u64 {
        let splat = |v: f32| _mm256_set1_ps(v);
        // Two quads side by side: their columns in the left half of the block, and their rows.
        let columns = _mm256_setr_ps(0.5, 1.5, 0.5, 1.5, 2.5, 3.5, 2.5, 3.5);
        let rows = _mm256_setr_ps(0.5, 0.5, 1.5, 1.5, 0.5, 0.5, 1.5, 1.5);
        let across = |x: f32| {
            let distance = _mm256_sub_ps(_mm256_add_ps(splat(x), columns), splat(plane.x0));
            _mm256_mul_ps(splat(plane.dzdx), distance)
        };
        let across = [across(f32::from(x)), across(f32::from(x) + 4.0)];
        let (z0, dzdy) = (splat(plane.z0), splat(plane.dzdy));
        let (min, max) = (splat(plane.min), splat(plane.max));
        let (near, far) = (splat(self.range[0]), splat(self.range[1]));
        let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let beside = beside::<STORAGE>();
        let eights = stored.as_chunks_mut::<8>().0;
        let mut passed = 0;
        let mut left = mask;
        while left != 0 {
            let group = left.trailing_zeros() as usize / 8;
            left &= !(0xff << (8 * group));
            let row = f32::from(y) + (2 * (group / 2)) as f32;
            let down = _mm256_mul_ps(dzdy, _mm256_sub_ps(_mm256_add_ps(splat(row), rows), splat(plane.y0)));
            let z = _mm256_add_ps(z0, _mm256_add_ps(across[group % 2], down));
            // Of equal or unordered operands these instructions give the second, as the scalar selections do.
            let z = _mm256_min_ps(_mm256_max_ps(z, min), max);
            let z = _mm256_min_ps(far, _mm256_max_ps(near, z));
            let old: __m256i = bytemuck::cast(eights[group]);
            let (new, pass) = self.compared::<STORAGE, COMPARE>(z, old);
            let byte = _mm256_set1_epi32((mask >> (8 * group)) as i32);
            let covered = _mm256_cmpeq_epi32(_mm256_and_si256(byte, bits), bits);
            let pass = _mm256_and_si256(pass, covered);
            passed |= (_mm256_movemask_ps(_mm256_castsi256_ps(pass)) as u64) << (8 * group);
            if self.depth_write {
                let write = _mm256_andnot_si256(beside, pass);
                eights[group] = bytemuck::cast(_mm256_blendv_epi8(old, new, write));
            }
        }
        passed
    }

    /// The codes of depths in the viewport's range, and where they pass beside stored words.
    #[target_feature(enable = "avx2")]
    #[inline]
    pub(super) fn compared<const STORAGE: u8, const COMPARE: u8>(&self, z: __m256, old: __m256i) -> (__m256i, __m256i) {
        let new = match STORAGE {
            FLOAT => _mm256_castps_si256(z),
            UNORM24 => unorm24(z),
            _ => unorm16(z),
        };
        let pass = match (STORAGE, COMPARE) {
            (FLOAT, LESS) => _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(z, _mm256_castsi256_ps(old))),
            (FLOAT, LESS_EQUAL) => _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LE_OQ>(z, _mm256_castsi256_ps(old))),
            (FLOAT, _) => self.accept_floats(z, _mm256_castsi256_ps(old)),
            _ => self.accept_integers(new, _mm256_andnot_si256(beside::<STORAGE>(), old)),
        };
        (new, pass)
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn accept_floats(&self, new: __m256, old: __m256) -> __m256i {
        let mask = |m: u32| _mm256_castsi256_ps(_mm256_set1_epi32(m as i32));
        let less = _mm256_and_ps(_mm256_cmp_ps::<_CMP_LT_OQ>(new, old), mask(self.accept.less));
        let equal = _mm256_and_ps(_mm256_cmp_ps::<_CMP_EQ_OQ>(new, old), mask(self.accept.equal));
        let greater = _mm256_and_ps(_mm256_cmp_ps::<_CMP_GT_OQ>(new, old), mask(self.accept.greater));
        let unordered = _mm256_and_ps(_mm256_cmp_ps::<_CMP_UNORD_Q>(new, old), mask(self.accept.unordered));
        _mm256_castps_si256(_mm256_or_ps(_mm256_or_ps(less, equal), _mm256_or_ps(greater, unordered)))
    }

    /// Codes have at most 24 bits, so that signed comparison will do.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn accept_integers(&self, new: __m256i, old: __m256i) -> __m256i {
        let mask = |m: u32| _mm256_set1_epi32(m as i32);
        let less = _mm256_and_si256(_mm256_cmpgt_epi32(old, new), mask(self.accept.less));
        let equal = _mm256_and_si256(_mm256_cmpeq_epi32(new, old), mask(self.accept.equal));
        let greater = _mm256_and_si256(_mm256_cmpgt_epi32(new, old), mask(self.accept.greater));
        _mm256_or_si256(_mm256_or_si256(less, equal), greater)
    }
}

/// The bits of a word that are not of its depth.
#[target_feature(enable = "avx2")]
#[inline]
pub(super) fn beside<const STORAGE: u8>() -> __m256i {
    _mm256_set1_epi32(if STORAGE == UNORM24 { 0xff00_0000_u32 as i32 } else { 0 })
}

/// [`crate::texel::unorm24`].
#[target_feature(enable = "avx2")]
#[inline]
fn unorm24(depth: __m256) -> __m256i {
    let half = _mm256_set1_ps(8_388_608.0);
    let d = _mm256_min_ps(_mm256_max_ps(depth, _mm256_setzero_ps()), _mm256_set1_ps(1.0));
    let scaled = _mm256_mul_ps(d, _mm256_set1_ps(16_777_215.0));
    let offset = _mm256_castps_si256(half);
    let small = _mm256_sub_epi32(_mm256_castps_si256(_mm256_add_ps(scaled, half)), offset);
    let large = _mm256_add_epi32(_mm256_sub_epi32(_mm256_castps_si256(scaled), offset), _mm256_set1_epi32(1 << 23));
    let is_small = _mm256_castps_si256(_mm256_cmp_ps::<_CMP_LT_OQ>(scaled, half));
    _mm256_blendv_epi8(large, small, is_small)
}

/// [`crate::texel::unorm`] with 16 bits.
#[target_feature(enable = "avx2")]
#[inline]
fn unorm16(depth: __m256) -> __m256i {
    let d = _mm256_min_ps(_mm256_max_ps(depth, _mm256_setzero_ps()), _mm256_set1_ps(1.0));
    let sum = _mm256_add_ps(_mm256_mul_ps(d, _mm256_set1_ps(65535.0)), _mm256_set1_ps(8_388_608.0));
    _mm256_and_si256(_mm256_castps_si256(sum), _mm256_set1_epi32(0x007f_ffff))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::format::Format;
    use crate::setup::{self, Bounds, DepthBias, ScreenVertex, SetupState, is_small};
    use crate::state::{CullMode, DepthStencil, FrontFace, StencilFace};
    use num::Random;

    const FORMATS: [Format; 4] = [Format::Depth32Float, Format::Depth24Plus, Format::Depth24PlusStencil8, Format::Depth16Unorm];

    /// Random cases.
    pub struct Cases(pub Random);

    impl Cases {
        /// Any number.
        pub fn next(&mut self) -> u64 {
            u64::from(self.0.bits()) << 32 | u64::from(self.0.bits())
        }

        /// A number in [0, 1).
        pub fn unit(&mut self) -> f32 {
            self.0.unit()
        }

        /// All formats and comparisons, as cases go on.
        pub fn state(&mut self, case: usize) -> DepthStencilState {
            let state = DepthStencil {
                format: FORMATS[case % 4],
                depth_write: !self.next().is_multiple_of(4),
                depth_compare: Compare::ALL[case / 4 % 8],
                stencil_front: StencilFace::default(),
                stencil_back: StencilFace::default(),
                stencil_read_mask: 0xff,
                stencil_write_mask: 0xff,
                bias: 0,
                bias_slope: 0.0,
                bias_clamp: 0.0,
            };
            let range = [[0.0, 1.0], [0.25, 0.75]][self.next() as usize % 2];
            let state = DepthStencilState::new(&state, 0, range);
            assert!(state.tests_blocks());
            state
        }

        /// The depths of a triangle near a place, of one that faces the screen now and then.
        pub fn plane(&mut self, case: usize, at: [u16; 2]) -> DepthPlane {
            let mut slope = || if case.is_multiple_of(3) { 0.0 } else { (self.unit() - 0.5) * 0.1 };
            let (dzdx, dzdy) = (slope(), slope());
            DepthPlane {
                x0: f32::from(at[0]),
                y0: f32::from(at[1]),
                z0: self.unit(),
                dzdx,
                dzdy,
                min: self.unit() * 0.5,
                max: 0.5 + self.unit() * 0.5,
            }
        }

        /// What a pixel may hold when `depth` comes: now and then just that, or what only a copy can bring.
        pub fn code(&mut self, case: usize, state: &DepthStencilState, depth: f32) -> u32 {
            let code = match self.next() % 8 {
                0..3 => state.code(depth),
                3 if case.is_multiple_of(4) => f32::NAN.to_bits(),
                4 if case.is_multiple_of(4) => (-0.0_f32).to_bits(),
                _ => state.code(self.unit()),
            };
            if FORMATS[case % 4] == Format::Depth24PlusStencil8 { code | (self.next() as u32) << 24 } else { code }
        }
    }

    #[test]
    fn blocks_give_the_bits_of_quads() {
        if !crate::simd::host_has!("avx2") {
            return;
        }
        let mut random = Cases(Random::new(7));
        let mut some = 0;
        for case in 0..4000 {
            let state = random.state(case);
            let at = [random.next() as u16 & 0x1ff8, random.next() as u16 & 0x1ff8];
            let plane = random.plane(case, at);
            let before: [u32; LANES] = std::array::from_fn(|i| {
                // Codes are quad by quad.
                let (column, row) = (i / 4 % 4 * 2 + i % 2, i / 16 * 2 + i / 2 % 2);
                let depth = plane.at(f32::from(at[0]) + column as f32 + 0.5, f32::from(at[1]) + row as f32 + 0.5);
                random.code(case, &state, depth)
            });
            let mask = [random.next(), !0, random.next() & random.next(), 0xff << 24][random.next() as usize % 4];
            let mut block = before;
            // SAFETY: the host has AVX2.
            let passed = unsafe { state.test_block_avx2(&plane, at, mask, &mut block) };
            let mut quads = before;
            let mut expected = 0;
            for q in 0..16 {
                let (x, y) = (i32::from(at[0]) + 2 * (q as i32 % 4), i32::from(at[1]) + 2 * (q as i32 / 4));
                let codes = state.code_quad(plane.quad(x, y));
                let coverage = (mask >> (4 * q) & 15) as u16;
                let pass = state.test_quad(1, false, coverage, &[codes], &mut quads[4 * q..4 * q + 4]);
                expected |= u64::from(pass) << (4 * q);
            }
            assert_eq!((passed, block), (expected, quads), "{state:?} {plane:?} {mask:x}");
            some += passed.count_ones();
        }
        assert!(some > 20_000, "{some}");
    }

    #[test]
    fn quads_of_small_triangles_give_the_bits_of_quads() {
        if !crate::simd::host_has!("avx2") {
            return;
        }
        let area = Bounds { x0: 0, y0: 0, x1: 64, y1: 64 };
        let setup = SetupState {
            bounds: area,
            depth_range: [0.0, 1.0],
            bias: DepthBias::NONE,
            front_face: FrontFace::Ccw,
            cull: CullMode::None,
            samples: 1,
            lower_edges: false,
            unclipped_depth: false,
        };
        let mut random = Cases(Random::new(9));
        let (mut some, mut all) = (0, 0);
        for case in 0..4000 {
            let state = random.state(case);
            let mut triangles = [[ScreenVertex::default(); 3]; 8];
            for triangle in &mut triangles {
                loop {
                    let corner = [random.next() % 60 * 256, random.next() % 60 * 256];
                    *triangle = std::array::from_fn(|_| ScreenVertex {
                        x: (corner[0] + random.next() % 1000) as i32,
                        y: (corner[1] + random.next() % 900) as i32,
                        z: random.unit(),
                        inv_w: 1.0,
                    });
                    if setup::bounds(&setup, triangle).is_ok_and(|bounds| is_small(triangle, &bounds)) {
                        break;
                    }
                }
            }
            let mut eight = Eight::default();
            // SAFETY: the host has AVX2.
            unsafe { eight.set_up(&setup, &area, &triangles) };
            let mut list = [EightQuad::default(); 48];
            let n = eight.quads(8, &mut list);
            for &quad in &list[..n] {
                let [x, y] = eight.pixel(quad).map(i32::from);
                let depths = eight.depth(quad.triangle()).quad(x, y);
                let before: [u32; 4] = std::array::from_fn(|p| random.code(case, &state, depths[p]));
                let (mut stored, mut expected) = (before, before);
                // SAFETY: the host has AVX2.
                let passed = unsafe { state.test_quad_avx2(&eight, quad, &mut stored) };
                let pass = state.test_quad(1, false, quad.coverage() as u16, &[state.code_quad(depths)], &mut expected);
                assert_eq!((passed, stored), (u32::from(pass), expected), "{state:?} {before:x?} {depths:?}");
                some += passed.count_ones();
                all += quad.coverage().count_ones();
            }
        }
        assert!(some > all / 4 && some < all / 4 * 3, "{some} of {all}");
    }
}
