//! Depth tests after shading with one sample per pixel: the depths of two quads at a time are interpolated and tested in AVX2 registers.
//!
//! The same operations as [`crate::interpolate::depth`], [`DepthStencilState::codes`] and [`DepthStencilState::test_batch`] in the same order,
//! hence the same bits. Loops over lanes, each with its results in memory, took twice the instructions.

use std::arch::x86_64::*;

use super::block::{ANY, FLOAT, LESS, LESS_EQUAL, UNORM16, UNORM24, beside};
use super::depth::{DepthStencilState, Storage};
use crate::interpolate::Site;
use crate::setup::{DepthPlane, Triangle};
use crate::state::Compare;
use num::QUADS;

/// The depth planes of two quads, a quad in each half.
struct Planes {
    x0: __m256,
    y0: __m256,
    z0: __m256,
    dzdx: __m256,
    dzdy: __m256,
    min: __m256,
    max: __m256,
}

impl Planes {
    #[target_feature(enable = "avx2")]
    #[inline]
    fn new(a: &DepthPlane, b: &DepthPlane) -> Planes {
        let two = |of: fn(&DepthPlane) -> f32| _mm256_set_m128(_mm_set1_ps(of(b)), _mm_set1_ps(of(a)));
        Planes {
            x0: two(|plane| plane.x0),
            y0: two(|plane| plane.y0),
            z0: two(|plane| plane.z0),
            dzdx: two(|plane| plane.dzdx),
            dzdy: two(|plane| plane.dzdy),
            min: two(|plane| plane.min),
            max: two(|plane| plane.max),
        }
    }

    /// [`DepthPlane::at`] in the pixels of the quads at two sites.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn at(&self, sites: [Site; 2]) -> __m256 {
        // The place of a site follows its triangle.
        let column = _mm256_setr_epi8(
            4, 5, -1, -1, 4, 5, -1, -1, 4, 5, -1, -1, 4, 5, -1, -1, 12, 13, -1, -1, 12, 13, -1, -1, 12, 13, -1, -1, 12, 13, -1,
            -1,
        );
        let row = _mm256_add_epi8(column, _mm256_set1_epi32(0x0202));
        let sites = _mm256_broadcastsi128_si256(bytemuck::cast(sites));
        let number = |bytes: __m256i| _mm256_cvtepi32_ps(_mm256_shuffle_epi8(sites, bytes));
        let x = _mm256_add_ps(number(column), _mm256_setr_ps(0.5, 1.5, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5));
        let y = _mm256_add_ps(number(row), _mm256_setr_ps(0.5, 0.5, 1.5, 1.5, 0.5, 0.5, 1.5, 1.5));
        let across = _mm256_mul_ps(self.dzdx, _mm256_sub_ps(x, self.x0));
        let down = _mm256_mul_ps(self.dzdy, _mm256_sub_ps(y, self.y0));
        let z = _mm256_add_ps(self.z0, _mm256_add_ps(across, down));
        // Of equal or unordered operands these instructions give the second, as the scalar selections do.
        _mm256_min_ps(_mm256_max_ps(z, self.min), self.max)
    }
}

/// The quads of a batch whose depths are tested.
#[derive(Clone, Copy)]
pub struct LateQuads<'a> {
    /// Triangles of the batch.
    pub triangles: &'a [Triangle],
    /// How many quads are present.
    pub count: usize,
    /// Their sites.
    pub sites: &'a [Site; QUADS],
    /// Their places in the tile, in quads.
    pub at: &'a [u32; QUADS],
}

impl DepthStencilState {
    /// Tests the quads of a batch in order against a tile, the codes of many quads one after the other, and updates its codes. Returns the pixels
    /// that passed, of those in `mask`, which has a bit per lane. The state is one for [`DepthStencilState::test_block_avx2`].
    ///
    /// # Panics
    /// If a quad that is present lies outside the tile, or its triangle is not there.
    ///
    /// # Safety
    /// As for any function compiled for AVX2: the host has it.
    #[target_feature(enable = "avx2")]
    pub fn test_late_avx2(&self, quads: LateQuads<'_>, mask: u64, tile: &mut [u32]) -> u64 {
        debug_assert!(self.tests_blocks());
        match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => self.test_late::<FLOAT, LESS>(quads, mask, tile),
            (Storage::Float, Compare::LessEqual) => self.test_late::<FLOAT, LESS_EQUAL>(quads, mask, tile),
            (Storage::Float, _) => self.test_late::<FLOAT, ANY>(quads, mask, tile),
            (Storage::Unorm24, _) => self.test_late::<UNORM24, ANY>(quads, mask, tile),
            _ => self.test_late::<UNORM16, ANY>(quads, mask, tile),
        }
    }

    #[target_feature(enable = "avx2")]
    fn test_late<const STORAGE: u8, const COMPARE: u8>(&self, quads: LateQuads<'_>, mask: u64, tile: &mut [u32]) -> u64 {
        let LateQuads { triangles, count, sites, at } = quads;
        let tile = tile.as_chunks_mut::<4>().0;
        let (near, far) = (_mm256_set1_ps(self.range[0]), _mm256_set1_ps(self.range[1]));
        let beside = beside::<STORAGE>();
        let bits = _mm256_setr_epi32(1, 2, 4, 8, 16, 32, 64, 128);
        let (sites, at) = (sites.as_chunks::<2>().0, at.as_chunks::<2>().0);
        let mut passed = 0;
        let mut left = mask;
        // The quads of a triangle follow each other.
        let nothing = DepthPlane::default();
        let (mut current, mut planes) = (None, Planes::new(&nothing, &nothing));
        while left != 0 {
            let pair = left.trailing_zeros() as usize / 8;
            let covered = (left >> (8 * pair)) as u8;
            left &= !(0xff << (8 * pair));
            // Where the second is absent the first stands for it, and is not written twice.
            let (mut here, mut places) = (sites[pair], at[pair]);
            if 2 * pair + 1 >= count {
                (here, places) = ([here[0]; 2], [places[0]; 2]);
            }
            let names = here.map(|site| site.triangle);
            if current != Some(names) {
                let [a, b] = names.map(|name| &triangles[name as usize].depth);
                (current, planes) = (Some(names), Planes::new(a, b));
            }
            // Of equal or unordered operands these instructions give the second.
            let z = _mm256_min_ps(far, _mm256_max_ps(near, planes.at(here)));
            let places = places.map(|place| place as usize);
            // Quads of one place are tested one after the other.
            let (mut now, mut then) = (covered, 0);
            if places[0] == places[1] {
                (now, then) = (covered & 15, covered & 0xf0);
            }
            loop {
                let old: __m256i = bytemuck::cast(places.map(|place| tile[place]));
                let (new, pass) = self.compared::<STORAGE, COMPARE>(z, old);
                let covered = _mm256_cmpeq_epi32(_mm256_and_si256(_mm256_set1_epi32(i32::from(now)), bits), bits);
                let pass = _mm256_and_si256(pass, covered);
                let these = _mm256_movemask_ps(_mm256_castsi256_ps(pass)) as u64;
                passed |= these << (8 * pair);
                if self.depth_write && these != 0 {
                    let new = _mm256_blendv_epi8(old, new, _mm256_andnot_si256(beside, pass));
                    let [first, second]: [[u32; 4]; 2] = bytemuck::cast(new);
                    if these & 15 != 0 {
                        tile[places[0]] = first;
                    }
                    if these > 15 {
                        tile[places[1]] = second;
                    }
                }
                if then == 0 {
                    break;
                }
                (now, then) = (then, 0);
            }
        }
        passed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::interpolate::{self, Place};
    use crate::rop::block::tests::Cases;
    use crate::setup::{self, Bounds, DepthBias, ScreenVertex, SetupState};
    use crate::state::{CullMode, FrontFace};
    use num::{Lanes, Random};

    #[test]
    fn quads_after_shading_give_the_bits_of_lanes() {
        if !crate::simd::host_has!("avx2") {
            return;
        }
        let setup = SetupState {
            bounds: Bounds { x0: 0, y0: 0, x1: 64, y1: 64 },
            depth_range: [0.0, 1.0],
            bias: DepthBias::NONE,
            front_face: FrontFace::Ccw,
            cull: CullMode::None,
            samples: 1,
            lower_edges: false,
            unclipped_depth: false,
        };
        let corners = [[0, 0], [9000, 0], [0, 9000]].map(|[x, y]| ScreenVertex { x, y, z: 0.0, inv_w: 1.0 });
        let whole = setup::triangle(&setup, &corners).expect("a triangle");
        let mut random = Cases(Random::new(11));
        let (mut some, mut all) = (0, 0);
        for case in 0..6000 {
            let state = random.state(case);
            // Without a comparison and a write there is no state of a draw.
            if state.is_idle() {
                continue;
            }
            let origin = [0, 0].map(|_: u32| random.next() as u16 & 0x1fc0);
            let triangles: Vec<Triangle> = (0..1 + random.next() % 5)
                .map(|_| {
                    let mut depth = random.plane(case, origin);
                    if random.next().is_multiple_of(32) {
                        depth.z0 = f32::NAN;
                    }
                    Triangle { depth, ..whole }
                })
                .collect();
            let n = if case.is_multiple_of(2) { QUADS } else { 1 + random.next() as usize % QUADS };
            // What is beyond the quads that are present has no place and no triangle.
            let (mut sites, mut at) = ([Site { triangle: 1 << 20, x: 9, y: 9 }; QUADS], [1 << 20; QUADS]);
            let mut triangle = 0;
            for q in 0..n {
                if random.next().is_multiple_of(4) {
                    triangle = (random.next() % triangles.len() as u64) as u32;
                }
                let place = random.next() as u32 % if case % 5 == 0 { 4 } else { 256 };
                let [x, y] = [place % 16, place / 16].map(|v| 2 * v as u16);
                (sites[q], at[q]) = (Site { triangle, x: origin[0] + x, y: origin[1] + y }, place);
            }
            let mask = [!0, random.next(), random.next() & random.next(), 0xf << (4 * (case % 16))][case / 32 % 4]
                & u64::MAX >> (64 - 4 * n);
            let before: Vec<u32> = (0..1024).map(|_| random.code(case, &state, triangles[0].depth.z0)).collect();
            let (mut tile, mut expected) = (before.clone(), before);
            let quads = LateQuads { triangles: &triangles, count: n, sites: &sites, at: &at };
            // SAFETY: the host has AVX2.
            let passed = unsafe { state.test_late_avx2(quads, mask, &mut tile) };
            let (mut z, mut codes) = (Lanes::ZERO, Lanes::ZERO);
            interpolate::depth(&triangles, &sites[..n], Place::Center, &mut z);
            state.codes(&z, &mut codes);
            let mut kept: [u16; QUADS] = std::array::from_fn(|q| (mask >> (4 * q) & 15) as u16);
            state.test_batch(1, n, 0, &at, &[codes], &mut expected, &mut kept);
            let kept = kept.iter().rev().fold(0, |all, &kept| all << 4 | u64::from(kept));
            assert_eq!((passed, tile), (kept, expected), "{state:?} {sites:?} {mask:x}");
            some += passed.count_ones();
            all += mask.count_ones();
        }
        assert!(some > all / 4 && some < all / 4 * 3, "{some} of {all}");
    }
}
