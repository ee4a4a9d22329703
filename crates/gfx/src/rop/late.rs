//! Depth tests after shading with one sample per pixel: the depths of two quads at a time are interpolated and tested in vectors.
//!
//! The same operations as [`crate::interpolate::depth`], [`DepthStencilState::codes`] and [`DepthStencilState::test_batch`] in the same order,
//! hence the same bits. Loops over lanes, each with its results in memory, took twice the instructions.

use fearless_simd::{f32x4, f32x8, i32x8, mask32x8, prelude::*, u32x4, u32x8};

use super::block::{ANY, FLOAT, LESS, LESS_EQUAL, UNORM16, UNORM24};
use super::depth::{DepthStencilState, Storage};
use crate::interpolate::Site;
use crate::setup::{DepthPlane, Triangle};
use crate::simd::{Simd, inlined, least, most};
use crate::state::Compare;
use num::QUADS;

/// The depth planes of two quads, a quad in each half.
struct Planes<V: Simd> {
    x0: f32x8<V>,
    y0: f32x8<V>,
    z0: f32x8<V>,
    dzdx: f32x8<V>,
    dzdy: f32x8<V>,
    min: f32x8<V>,
    max: f32x8<V>,
}

impl<V: Simd> Planes<V> {
    #[inline(always)]
    fn new(simd: V, a: &DepthPlane, b: &DepthPlane) -> Planes<V> {
        let two = inlined(
            #[inline(always)]
            |of: fn(&DepthPlane) -> f32| f32x4::splat(simd, of(a)).combine(f32x4::splat(simd, of(b))),
        );
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
    #[inline(always)]
    fn at(&self, simd: V, sites: [Site; 2]) -> f32x8<V> {
        // Column and row of a site in one word.
        let [a, b] = sites.map(|site| u32x4::splat(simd, u32::from(site.x) | u32::from(site.y) << 16));
        let places: u32x8<V> = a.combine(b);
        let number = inlined(
            #[inline(always)]
            |v: u32x8<V>| v.bitcast::<i32x8<V>>().to_float::<f32x8<V>>(),
        );
        let x = number(places & 0xffff) + f32x8::simd_from(simd, [0.5, 1.5, 0.5, 1.5, 0.5, 1.5, 0.5, 1.5]);
        let y = number(places >> 16) + f32x8::simd_from(simd, [0.5, 0.5, 1.5, 1.5, 0.5, 0.5, 1.5, 1.5]);
        let across = self.dzdx * (x - self.x0);
        let down = self.dzdy * (y - self.y0);
        least(most(self.z0 + (across + down), self.min), self.max)
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
    /// that passed, of those in `mask`, which has a bit per lane. The state is one for [`DepthStencilState::test_block`].
    ///
    /// # Panics
    /// If a quad that is present lies outside the tile, or its triangle is not there.
    #[inline(always)]
    pub fn test_quads_late<V: Simd>(&self, simd: V, quads: LateQuads<'_>, mask: u64, tile: &mut [u32]) -> u64 {
        debug_assert!(self.tests_blocks());
        match (self.storage, self.compare) {
            (Storage::Float, Compare::Less) => self.test_late::<_, FLOAT, LESS>(simd, quads, mask, tile),
            (Storage::Float, Compare::LessEqual) => self.test_late::<_, FLOAT, LESS_EQUAL>(simd, quads, mask, tile),
            (Storage::Float, _) => self.test_late::<_, FLOAT, ANY>(simd, quads, mask, tile),
            (Storage::Unorm24, _) => self.test_late::<_, UNORM24, ANY>(simd, quads, mask, tile),
            _ => self.test_late::<_, UNORM16, ANY>(simd, quads, mask, tile),
        }
    }

    #[inline(always)]
    fn test_late<V: Simd, const STORAGE: u8, const COMPARE: u8>(
        &self,
        simd: V,
        quads: LateQuads<'_>,
        mask: u64,
        tile: &mut [u32],
    ) -> u64 {
        simd.vectorize(
            #[inline(always)]
            || self.test_late_here::<V, STORAGE, COMPARE>(simd, quads, mask, tile),
        )
    }

    #[inline(always)]
    fn test_late_here<V: Simd, const STORAGE: u8, const COMPARE: u8>(
        &self,
        simd: V,
        quads: LateQuads<'_>,
        mask: u64,
        tile: &mut [u32],
    ) -> u64 {
        let LateQuads { triangles, count, sites, at } = quads;
        let tile = tile.as_chunks_mut::<4>().0;
        let [near, far] = self.range.map(|v| f32x8::splat(simd, v));
        let (sites, at) = (sites.as_chunks::<2>().0, at.as_chunks::<2>().0);
        let mut passed = 0;
        let mut left = mask;
        // The quads of a triangle follow each other.
        let nothing = DepthPlane::default();
        let (mut current, mut planes) = (None, Planes::new(simd, &nothing, &nothing));
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
                (current, planes) = (Some(names), Planes::new(simd, a, b));
            }
            let z = least(far, most(near, planes.at(simd, here)));
            let places = places.map(|place| place as usize);
            // Quads of one place are tested one after the other.
            let (mut now, mut then) = (covered, 0);
            if places[0] == places[1] {
                (now, then) = (covered & 15, covered & 0xf0);
            }
            loop {
                let [first, second] = places.map(|place| u32x4::simd_from(simd, tile[place]));
                let old = first.combine(second);
                let (new, pass) = self.compared::<_, STORAGE, COMPARE>(z, old);
                let pass = pass & mask32x8::from_bitmask(simd, u64::from(now));
                let these = pass.to_bitmask();
                passed |= these << (8 * pair);
                if self.depth_write && these != 0 {
                    let (first, second) = pass.select(new, old).split();
                    if these & 15 != 0 {
                        tile[places[0]] = first.into();
                    }
                    if these > 15 {
                        tile[places[1]] = second.into();
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
    use crate::interpolate::{self, PixelPoint};
    use crate::rop::block::tests::Cases;
    use crate::setup::{self, Bounds, DepthBias, ScreenVertex, SetupState};
    use crate::simd::dispatch;
    use crate::state::{CullMode, FrontFace};
    use num::{Lanes, Random};

    #[test]
    fn quads_after_shading_give_the_bits_of_lanes() {
        let setup = SetupState {
            bounds: Bounds { x0: 0, y0: 0, x1: 64, y1: 64 },
            depth_range: [0.0, 1.0],
            bias: DepthBias::NONE,
            front_face: FrontFace::Ccw,
            cull: CullMode::None,
            samples: 1,
            lower_edges: false,
            unclipped_depth: false,
            half_width: None,
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
            let passed = dispatch!(simd => state.test_quads_late(simd, quads, mask, &mut tile));
            let (mut z, mut codes) = (Lanes::ZERO, Lanes::ZERO);
            interpolate::depth(&triangles, &sites[..n], PixelPoint::Center, &mut z);
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
