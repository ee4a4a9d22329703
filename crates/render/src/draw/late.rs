//! The work on a batch of fragments after its program: discard, masks, and the tests of depth and stencil that could not be made before.

use gfx::interpolate::{self, PixelPoint};
use gfx::rop;
use gfx::simd::Simd;
use num::{LANES, Lanes, QUADS};

use super::pending::{lanes, pixels, quads};
use super::tile::TileRun;

impl TileRun<'_, '_, '_> {
    /// [`TileRun::shrink`] with one sample per pixel: of the pixels that are `alive` those that stay, a bit per lane.
    pub(super) fn shrink_lanes<const RECORD: bool>(&mut self, survivors: u64, alive: u64) -> u64 {
        let call = self.call;
        let Some(bound) = &self.bound else { return alive };
        let mut allowed = survivors;
        if let Some(slot) = call.mask_output {
            let mask = bound.output(slot, 0);
            allowed &= (0..LANES).fold(0, |all, lane| all | u64::from(mask.0[lane] & 1) << lane);
        }
        if let Some(slot) = call.alpha_output {
            let alpha = bound.output(slot, 3).f32();
            allowed &= (0..LANES).fold(0, |all, lane| all | u64::from(rop::alpha_to_coverage(alpha[lane], 1) & 1) << lane);
        }
        self.counts.fragments_discarded += u64::from((alive & !allowed).count_ones());
        // Record the quads.
        if RECORD {
            for (coverage, allowed) in self.pending.coverage.iter_mut().zip(quads(allowed)) {
                *coverage &= allowed;
            }
        }
        alive & allowed
    }

    /// Discard, the program's sample mask and alpha to coverage.
    pub(super) fn shrink<const S: usize>(&mut self, survivors: u64, kept: &mut [u16; QUADS]) {
        let call = self.call;
        let Some(bound) = &self.bound else { return };
        let mask = call.mask_output.map(|slot| bound.output(slot, 0));
        let alpha = call.alpha_output.map(|slot| bound.output(slot, 3));
        for q in 0..self.pending.n {
            let before = kept[q];
            let mut allowed = 0_u16;
            for p in 0..4 {
                let lane = 4 * q + p;
                let mut samples = if survivors >> lane & 1 == 1 { (1_u32 << S) - 1 } else { 0 };
                if let Some(mask) = mask {
                    samples &= mask.0[lane];
                }
                if let Some(alpha) = alpha {
                    samples &= rop::alpha_to_coverage(alpha.f32()[lane], S as u32);
                }
                for s in 0..S {
                    allowed |= ((samples >> s & 1) as u16) << (4 * s + p);
                }
            }
            kept[q] &= allowed;
            self.counts.fragments_discarded += u64::from((pixels(before) & !pixels(kept[q])).count_ones());
            self.pending.coverage[q] &= allowed;
        }
    }

    /// Tests depth and stencil with one sample per pixel: of the pixels that are `alive` those that pass, a bit per lane.
    #[inline(always)]
    pub(super) fn test_lanes<V: Simd>(&mut self, simd: V, alive: u64) -> u64 {
        let call = self.call;
        if call.tests_blocks
            && call.frag_depth.is_none()
            && let (Some(state), Some(tile), Some(sites)) = (&call.depth, &mut self.job.depth, self.pending.sites.first_chunk())
        {
            tile.materialise(call.depth_words);
            let quads =
                rop::LateQuads { triangles: &self.pending.triangles, count: self.pending.n, sites, at: self.pending.places() };
            let passed = state.test_quads_late(simd, quads, alive, tile.codes);
            self.counts.fragments_late_failed += u64::from((alive & !passed).count_ones());
            return passed;
        }
        let mut kept = quads(alive);
        self.test_late::<1>(&mut kept);
        lanes(&kept)
    }

    /// Tests depth and stencil.
    #[inline(never)]
    pub(super) fn test_late<const S: usize>(&mut self, kept: &mut [u16; QUADS]) {
        let call = self.call;
        let before = lanes(kept);
        let mut codes = [Lanes::ZERO; S];
        self.late_depths::<S>(&mut codes);
        if let (Some(state), Some(tile)) = (&call.depth, &mut self.job.depth) {
            tile.materialise(call.depth_words);
            state.test_batch(S, self.pending.n, self.pending.back, self.pending.places(), &codes, tile.codes, kept);
        }
        self.counts.fragments_late_failed += u64::from((before & !lanes(kept)).count_ones());
    }

    /// Depth codes at each sample, from the program or the plane.
    fn late_depths<const S: usize>(&mut self, codes: &mut [Lanes; S]) {
        let call = self.call;
        let (Some(state), Some(bound)) = (&call.depth, &self.bound) else { return };
        if let Some(slot) = call.frag_depth {
            let mut code = Lanes::ZERO;
            state.codes(bound.output(slot, 0), &mut code);
            *codes = [code; S];
            return;
        }
        let sites = &self.pending.sites[..self.pending.n];
        for (s, codes) in codes.iter_mut().enumerate() {
            let place = if S == 1 { PixelPoint::Center } else { PixelPoint::Sample(s) };
            let mut z = Lanes::ZERO;
            interpolate::depth(&self.pending.triangles, sites, place, &mut z);
            state.codes(&z, codes);
        }
    }
}
