//! Depth tests with one sample per pixel in vectors: of 8x8 blocks, eight pixels at a time, and of the quads of small triangles.
//!
//! The same operations as [`DepthPlane::at`] and [`DepthStencilState::test_quad`] in the same order, hence the same bits. As loops over arrays of
//! lanes the test takes five times the instructions, since the compiler neither keeps the lanes in a vector nor makes a mask of them by one
//! instruction.

use fearless_simd::{f32x4, f32x8, i32x8, mask32x8, prelude::*, u32x4, u32x8};

use super::depth::{DepthStencilState, Storage};
use crate::setup::{DepthPlane, Eight, EightQuad};
use crate::simd::{Simd, inlined, least, most};
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
    #[inline(always)]
    pub fn test_block<V: Simd>(&self, simd: V, plane: &DepthPlane, at: [u16; 2], mask: u64, stored: &mut [u32; LANES]) -> u64 {
        debug_assert!(self.tests_blocks());
        match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => self.test::<_, FLOAT, LESS>(simd, plane, at, mask, stored),
            (Storage::Float, Compare::LessEqual) => self.test::<_, FLOAT, LESS_EQUAL>(simd, plane, at, mask, stored),
            (Storage::Float, _) => self.test::<_, FLOAT, ANY>(simd, plane, at, mask, stored),
            (Storage::Unorm24, _) => self.test::<_, UNORM24, ANY>(simd, plane, at, mask, stored),
            _ => self.test::<_, UNORM16, ANY>(simd, plane, at, mask, stored),
        }
    }

    /// Tests a quad of a small triangle and updates its codes. Returns the pixels that passed. The state is one for
    /// [`DepthStencilState::test_block`].
    #[inline(always)]
    pub fn test_quad_of<V: Simd>(&self, simd: V, eight: &Eight, quad: EightQuad, stored: &mut [u32; 4]) -> u32 {
        debug_assert!(self.tests_blocks());
        // The quad fills both halves of a vector.
        let twice = |v: f32x4<V>| v.combine(v);
        let [near, far] = self.range.map(|v| f32x8::splat(simd, v));
        let z = least(far, most(near, twice(eight.depths(simd, quad))));
        let old = twice(u32x4::simd_from(simd, *stored).bitcast()).bitcast();
        let (new, pass) = match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => self.compared::<_, FLOAT, LESS>(z, old),
            (Storage::Float, Compare::LessEqual) => self.compared::<_, FLOAT, LESS_EQUAL>(z, old),
            (Storage::Float, _) => self.compared::<_, FLOAT, ANY>(z, old),
            (Storage::Unorm24, _) => self.compared::<_, UNORM24, ANY>(z, old),
            _ => self.compared::<_, UNORM16, ANY>(z, old),
        };
        let pass = pass & mask32x8::from_bitmask(simd, u64::from(quad.coverage()));
        if self.depth_write {
            *stored = pass.select(new, old).split().0.into();
        }
        pass.to_bitmask() as u32
    }

    #[inline(always)]
    fn test<V: Simd, const STORAGE: u8, const COMPARE: u8>(
        &self,
        simd: V,
        plane: &DepthPlane,
        at: [u16; 2],
        mask: u64,
        stored: &mut [u32; LANES],
    ) -> u64 {
        simd.vectorize(
            #[inline(always)]
            || self.test_here::<V, STORAGE, COMPARE>(simd, plane, at, mask, stored),
        )
    }

    #[inline(always)]
    fn test_here<V: Simd, const STORAGE: u8, const COMPARE: u8>(
        &self,
        simd: V,
        plane: &DepthPlane,
        [x, y]: [u16; 2],
        mask: u64,
        stored: &mut [u32; LANES],
    ) -> u64 {
        let splat = |v: f32| f32x8::splat(simd, v);
        // Two quads side by side: their columns in the left half of the block, and their rows.
        let columns = f32x8::simd_from(simd, [0.5, 1.5, 0.5, 1.5, 2.5, 3.5, 2.5, 3.5]);
        let rows = f32x8::simd_from(simd, [0.5, 0.5, 1.5, 1.5, 0.5, 0.5, 1.5, 1.5]);
        let across = inlined(
            #[inline(always)]
            |x: f32| splat(plane.dzdx) * ((splat(x) + columns) - splat(plane.x0)),
        );
        let across = [across(f32::from(x)), across(f32::from(x) + 4.0)];
        let (z0, y0, dzdy) = (splat(plane.z0), splat(plane.y0), splat(plane.dzdy));
        let (min, max) = (splat(plane.min), splat(plane.max));
        let [near, far] = self.range.map(splat);
        let eights = stored.as_chunks_mut::<8>().0;
        let mut passed = 0;
        let mut left = mask;
        while left != 0 {
            let group = left.trailing_zeros() as usize / 8;
            left &= !(0xff << (8 * group));
            let row = f32::from(y) + (2 * (group / 2)) as f32;
            let down = dzdy * ((splat(row) + rows) - y0);
            let z = z0 + (across[group % 2] + down);
            let z = least(most(z, min), max);
            let z = least(far, most(near, z));
            let old = u32x8::simd_from(simd, eights[group]);
            let (new, pass) = self.compared::<_, STORAGE, COMPARE>(z, old);
            let pass = pass & mask32x8::from_bitmask(simd, mask >> (8 * group) & 0xff);
            passed |= pass.to_bitmask() << (8 * group);
            if self.depth_write {
                eights[group] = pass.select(new, old).into();
            }
        }
        passed
    }

    /// The words to be stored for depths in the viewport's range, and where they pass beside those that are stored.
    #[inline(always)]
    pub(super) fn compared<V: Simd, const STORAGE: u8, const COMPARE: u8>(
        &self,
        z: f32x8<V>,
        old: u32x8<V>,
    ) -> (u32x8<V>, mask32x8<V>) {
        match STORAGE {
            FLOAT => {
                let depth = old.bitcast();
                let pass = match COMPARE {
                    LESS => z.simd_lt(depth),
                    LESS_EQUAL => z.simd_le(depth),
                    _ => self.accept_floats(z, depth),
                };
                (z.bitcast(), pass)
            }
            UNORM24 => {
                // The upper byte of the word is not the depth's.
                let (new, stencil) = (unorm24(z), old & 0xff00_0000);
                (new | stencil, self.accept_codes(new, old ^ stencil))
            }
            _ => {
                let new = unorm16(z);
                (new, self.accept_codes(new, old))
            }
        }
    }

    #[inline(always)]
    fn accept_floats<V: Simd>(&self, new: f32x8<V>, old: f32x8<V>) -> mask32x8<V> {
        let mask = |m: u32| mask32x8::from_vector(i32x8::splat(new.simd, m as i32));
        let (less, equal, greater) = (new.simd_lt(old), new.simd_eq(old), new.simd_gt(old));
        let ordered = less & mask(self.accept.less) | equal & mask(self.accept.equal) | greater & mask(self.accept.greater);
        ordered | !(less | equal | greater) & mask(self.accept.unordered)
    }

    /// Codes have at most 24 bits, so that signed comparison will do.
    #[inline(always)]
    fn accept_codes<V: Simd>(&self, new: u32x8<V>, old: u32x8<V>) -> mask32x8<V> {
        let mask = |m: u32| mask32x8::from_vector(i32x8::splat(new.simd, m as i32));
        let (new, old): (i32x8<V>, i32x8<V>) = (new.bitcast(), old.bitcast());
        let less = new.simd_lt(old) & mask(self.accept.less);
        less | new.simd_eq(old) & mask(self.accept.equal) | new.simd_gt(old) & mask(self.accept.greater)
    }
}

/// A depth between 0 and 1; 0 for NaN.
#[inline(always)]
fn unit<V: Simd>(depth: f32x8<V>) -> f32x8<V> {
    least(most(depth, f32x8::splat(depth.simd, 0.0)), f32x8::splat(depth.simd, 1.0))
}

/// [`crate::texel::unorm24`].
#[inline(always)]
fn unorm24<V: Simd>(depth: f32x8<V>) -> u32x8<V> {
    let half = f32x8::splat(depth.simd, 8_388_608.0);
    let offset: u32x8<V> = half.bitcast();
    let scaled = unit(depth) * 16_777_215.0;
    let small = (scaled + half).bitcast::<u32x8<V>>() - offset;
    let large = (scaled.bitcast::<u32x8<V>>() - offset) + (1 << 23);
    scaled.simd_lt(half).select(small, large)
}

/// [`crate::texel::unorm`] with 16 bits.
#[inline(always)]
fn unorm16<V: Simd>(depth: f32x8<V>) -> u32x8<V> {
    (unit(depth) * 65535.0 + 8_388_608.0).bitcast::<u32x8<V>>() & 0x007f_ffff
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::format::Format;
    use crate::setup::{self, Bounds, DepthBias, ScreenVertex, SetupState, is_small};
    use crate::simd::dispatch;
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
                stencil_back_masks: None,
                bias: 0.0,
                bias_slope: 0.0,
                bias_clamp: 0.0,
            };
            let range = [[0.0, 1.0], [0.25, 0.75]][self.next() as usize % 2];
            let state = DepthStencilState::new(&state, [0; 2], range);
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
            let passed = dispatch!(simd => state.test_block(simd, &plane, at, mask, &mut block));
            let mut base = before;
            assert_eq!((state.test_block(crate::simd::base(), &plane, at, mask, &mut base), base), (passed, block));
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
            half_width: None,
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
            dispatch!(simd => eight.set_up(simd, &setup, &area, &triangles));
            let mut list = [EightQuad::default(); 48];
            let n = eight.quads(8, &mut list);
            for &quad in &list[..n] {
                let [x, y] = eight.pixel(quad).map(i32::from);
                let depths = eight.depth(quad.triangle()).quad(x, y);
                let before: [u32; 4] = std::array::from_fn(|p| random.code(case, &state, depths[p]));
                let (mut stored, mut expected) = (before, before);
                let passed = dispatch!(simd => state.test_quad_of(simd, &eight, quad, &mut stored));
                let pass = state.test_quad(1, false, quad.coverage() as u16, &[state.code_quad(depths)], &mut expected);
                assert_eq!((passed, stored), (u32::from(pass), expected), "{state:?} {before:x?} {depths:?}");
                some += passed.count_ones();
                all += quad.coverage().count_ones();
            }
        }
        assert!(some > all / 4 && some < all / 4 * 3, "{some} of {all}");
    }
}
