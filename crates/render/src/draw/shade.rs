//! Shading: up to 16 quads at a time, whatever triangles they belong to, from interpolation to the attachments.

use gfx::interpolate::{self, PixelPoint, Weights};
use gfx::simd::{Simd, dispatch};
use num::{LANES, Lanes, QUADS};
use shader::{BoundProgram, BuiltIn, Interpolation, Sampling};

use super::DrawCall;
use super::batch::{Batch, MADE};
use super::pending::{Pending, lanes, quads};
use super::record::shaded;
use super::tile::{SegmentInput, TileRun};
use super::workers::FragmentWeights;
use crate::pipeline::VaryingClass;

/// Triangles of a batch up to which attributes that are the same at all vertices are looked for.
const FEW: usize = 4;

impl TileRun<'_, '_, '_> {
    /// Shades what waits and writes it, with the host's widest vectors.
    #[inline(never)]
    pub fn flush<const S: usize, const RECORD: bool>(&mut self) {
        dispatch!(simd => self.flush_here::<S, RECORD, _>(simd));
    }

    #[inline(always)]
    fn flush_here<const S: usize, const RECORD: bool, V: Simd>(&mut self, simd: V) {
        let n = self.pending.n;
        if n == 0 || self.fault.is_some() {
            self.pending.clear();
            return;
        }
        let call = self.call;
        let active = if call.shade_covered { lanes(&self.pending.coverage[..n]) } else { self.pending.active };
        let present = u64::MAX >> (64 - 4 * n);
        self.counts.quads_shaded += n as u64;
        self.counts.fragments_shaded += u64::from(active.count_ones());
        self.counts.helper_fragments += u64::from((present & !active).count_ones());
        let owner = (!RECORD && S == 1 && call.repeats && self.pending.owners == 1).then(|| self.pending.names[0]);
        let survivors = if owner.is_some() && owner == self.shaded {
            active
        } else {
            let constant = self.interpolate::<S, _>(simd);
            // The batches that follow have the same outputs, whatever lanes they have.
            self.shaded = owner.filter(|_| constant && n == QUADS);
            let (active, helpers) = match self.shaded {
                Some(_) => (u64::MAX, 0),
                None => (active, if call.helpers { present & !active } else { 0 }),
            };
            let Some(bound) = &mut self.bound else { return };
            let outcome = if RECORD { bound.run_recorded(active, helpers, self.recorder) } else { bound.run(active, helpers) };
            match outcome {
                Ok(outcome) => outcome.mask,
                Err(fault) => {
                    self.fault = Some(fault);
                    self.pending.clear();
                    return;
                }
            }
        };
        // A bit a lane says all of one sample.
        if S == 1 {
            let mut alive = self.pending.active;
            if call.shrinks {
                alive = self.shrink_lanes::<RECORD>(survivors, alive);
            }
            if RECORD {
                self.record_quads::<S>();
            }
            if !call.early && call.depth.is_some() {
                alive = self.test_lanes(simd, alive);
            }
            let written = u64::from(alive.count_ones());
            self.counts.fragments_written += written;
            self.samples_passed += written;
            if written > 0 {
                let kept = if call.early && !call.shrinks {
                    let mut kept = *self.pending.passed();
                    if n < QUADS {
                        kept[n..].fill(0);
                    }
                    kept
                } else {
                    quads(alive)
                };
                self.write::<S, RECORD>(n, &kept);
            }
            self.pending.clear();
            return;
        }
        let mut kept = *self.pending.passed();
        kept[n..].fill(0);
        if call.shrinks {
            self.shrink::<S>(survivors, &mut kept);
        }
        if RECORD {
            self.record_quads::<S>();
        }
        if !call.early && call.depth.is_some() {
            self.test_late::<S>(&mut kept);
        }
        self.counts.fragments_written += u64::from(lanes(&kept).count_ones());
        self.samples_passed += kept.iter().map(|k| u64::from(k.count_ones())).sum::<u64>();
        self.write::<S, RECORD>(n, &kept);
        self.pending.clear();
    }

    /// Blends the outputs into the colour attachments.
    #[inline(always)]
    fn write<const S: usize, const RECORD: bool>(&mut self, n: usize, kept: &[u16; QUADS]) {
        let Some(bound) = &self.bound else { return };
        let pending = &*self.pending;
        for (target, tile) in self.call.targets.iter().zip(&mut self.job.colors) {
            let Some(tile) = tile else { continue };
            tile.materialise(target.words);
            if RECORD && target.packed && !target.state.takes_pairs() {
                // The ROPs' payload has the codes already.
                let (size, each) = (4 * S * target.words, 4 * self.call.payload_words);
                let payload = &self.job.record.work.payload;
                let quads = payload[payload.len() - each * n..].chunks_exact(each);
                for (q, payload) in quads.enumerate().take(QUADS).filter(|(q, _)| kept[*q] != 0) {
                    let packed = &payload[4 * target.payload..][..4 * target.payload_words];
                    target.state.put_quad(S, kept[q], packed, &mut tile.codes[pending.at[q] as usize * size..][..size]);
                }
                continue;
            }
            let color = colors(bound, target.output);
            let at = pending.places();
            match target.second {
                None => target.state.blend_batch(S, n, at, kept, color, color, tile.codes),
                Some(second) => {
                    let second = colors(bound, second);
                    target.state.blend_batch(S, n, at, kept, color, second, tile.codes);
                }
            }
        }
    }

    /// Writes the inputs of the fragment program; whether varyings are the same all over each triangle.
    #[inline(always)]
    fn interpolate<const S: usize, V: Simd>(&mut self, simd: V) -> bool {
        let call = self.call;
        let pending = &*self.pending;
        let n = pending.n;
        let sites = &pending.sites[..n];
        let triangles = pending.triangles.as_slice();
        let ends = &pending.ends[..pending.owners];
        let Some(bound) = &mut self.bound else { return false };
        let mut all_constant = true;
        // Place of every lane for what is evaluated at samples, where the program runs once per sample.
        let mut at_sample = [0_u8; LANES];
        if S > 1 && call.per_sample {
            for lane in 0..LANES {
                at_sample[lane] = pending.sample[lane / 4] + 1;
            }
        }
        let FragmentWeights { weights, inv_w } = &mut *self.weights;
        // Whether `inv_w` is that of the pixels' centres.
        let mut has_inv_w = false;
        for class in &call.pipeline.classes {
            let flat = class.interpolation == Interpolation::Flat;
            let mut centroid = [0; LANES];
            let place = match class.sampling {
                Sampling::Center => PixelPoint::Center,
                Sampling::Sample => PixelPoint::PerLane(&at_sample),
                Sampling::Centroid => {
                    interpolate::centroids(&pending.coverage[..n], &mut centroid);
                    PixelPoint::PerLane(&centroid)
                }
            };
            // Colours of many programs are those of a whole triangle. Where triangles are small, to find that out takes longer than to interpolate.
            let fills = !flat && pending.owners <= FEW;
            let constant = fills && self.input.is_constant(pending, class);
            all_constant &= flat || constant;
            if constant {
                // Weights are not needed.
            } else if class.interpolation == Interpolation::Perspective {
                has_inv_w = class.sampling == Sampling::Center;
                interpolate::perspective(triangles, sites, place, weights, inv_w);
            } else if !flat {
                interpolate::linear(triangles, sites, place, weights);
            }
            let mut finite = constant.then_some(true);
            let mut start = 0;
            for (&(batch, number), &end) in pending.names.iter().zip(ends) {
                let end = usize::from(end);
                let batch = &self.input.batches[batch as usize];
                let corners = batch.corners[number as usize];
                let words = |v: u32| self.input.varyings(batch, v);
                if flat {
                    let words = words(corners.flat);
                    for &(register, word) in &class.inputs {
                        fill(bound.register_mut(register), start..end, words[word]);
                    }
                } else {
                    let [a, b, c] = corners.vertices.map(words);
                    let mut inputs = class.inputs.iter();
                    // With a loop of its own: the other one is the tighter for it.
                    while fills && let Some(&(register, word)) = inputs.next() {
                        let values = [a[word], b[word], c[word]];
                        let register = bound.register_mut(register);
                        if interpolate::is_constant(values) && *finite.get_or_insert_with(|| weights.are_finite()) {
                            fill(register, start..end, values[0]);
                        } else {
                            interpolate::attribute_run(simd, weights, start..end, values.map(f32::from_bits), register);
                        }
                    }
                    for &(register, word) in inputs {
                        let values = [a[word], b[word], c[word]].map(f32::from_bits);
                        interpolate::attribute_run(simd, weights, start..end, values, bound.register_mut(register));
                    }
                }
                start = end;
            }
        }
        if call.fragment().is_some_and(|bound| !bound.stage.builtins.is_empty()) {
            let place = if S > 1 && call.per_sample { PixelPoint::PerLane(&at_sample) } else { PixelPoint::Center };
            self.builtins::<S>(place, has_inv_w);
        }
        all_constant
    }

    /// Writes the built-in inputs.
    fn builtins<const S: usize>(&mut self, place: PixelPoint<'_>, has_inv_w: bool) {
        let call = self.call;
        let pending = &*self.pending;
        let n = pending.n;
        let sites = &pending.sites[..n];
        let triangles = pending.triangles.as_slice();
        let (Some(bound), Some(fragment)) = (&mut self.bound, call.fragment()) else { return };
        for &(slot, builtin) in &fragment.stage.builtins {
            match builtin {
                BuiltIn::Position => {
                    let (mut x, mut y) = (Lanes::ZERO, Lanes::ZERO);
                    interpolate::window(sites, place, &mut x, &mut y);
                    for (c, value) in [x, y].into_iter().enumerate() {
                        if let Some(input) = bound.input_mut(slot, c) {
                            *input = value;
                        }
                    }
                    if let Some(input) = bound.input_mut(slot, 2) {
                        interpolate::position_depth(triangles, sites, place, input);
                    }
                    if let Some(input) = bound.input_mut(slot, 3) {
                        if has_inv_w && !call.per_sample {
                            *input = self.weights.inv_w;
                        } else {
                            interpolate::perspective(triangles, sites, place, &mut Weights::default(), input);
                        }
                    }
                }
                BuiltIn::Barycentric { perspective } => {
                    let (mut weights, mut w) = (Weights::default(), Lanes::ZERO);
                    if perspective {
                        interpolate::perspective(triangles, sites, place, &mut weights, &mut w);
                    } else {
                        interpolate::linear(triangles, sites, place, &mut weights);
                    }
                    let (one, two) = (weights.one.f32(), weights.two.f32());
                    let zero: [f32; LANES] = std::array::from_fn(|i| (1.0 - one[i]) - two[i]);
                    for (c, value) in [&zero, one, two].into_iter().enumerate() {
                        if let Some(input) = bound.input_mut(slot, c) {
                            *input.f32_mut() = *value;
                        }
                    }
                }
                BuiltIn::FrontFacing => {
                    let Some(input) = bound.input_mut(slot, 0) else { continue };
                    let backs = pending.back & u16::MAX >> (QUADS - n);
                    if backs == 0 || backs.count_ones() as usize == n {
                        input.0.fill(u32::from(backs == 0));
                        continue;
                    }
                    for (q, quad) in input.0.chunks_exact_mut(4).enumerate() {
                        quad.fill(u32::from(backs >> q & 1 == 0));
                    }
                }
                _ => {
                    let Some(input) = bound.input_mut(slot, 0) else { continue };
                    for q in 0..n {
                        let site = &sites[q];
                        let value = match builtin {
                            BuiltIn::SampleIndex if S > 1 => u32::from(pending.sample[q]),
                            BuiltIn::PrimitiveIndex => {
                                let (batch, number) = pending.names[site.triangle as usize];
                                let batch = &self.input.batches[batch as usize];
                                let primitive = batch.first_primitive + batch.primitive[number as usize];
                                let pieces = self.input.pieces;
                                let after = pieces.partition_point(|p| p.first_primitive <= primitive);
                                let piece = &pieces[after - 1];
                                piece.first_index + (primitive - piece.first_primitive)
                            }
                            BuiltIn::SubgroupSize => LANES as u32,
                            BuiltIn::PointCoord => 0.5_f32.to_bits(),
                            _ => 0,
                        };
                        input.0[4 * q..4 * q + 4].fill(value);
                    }
                    match builtin {
                        BuiltIn::SampleMask => {
                            for lane in 0..4 * n {
                                let coverage = u32::from(pending.coverage[lane / 4]) >> (lane % 4);
                                input.0[lane] = (0..S).map(|s| (coverage >> (4 * s) & 1) << s).sum();
                            }
                        }
                        BuiltIn::SubgroupInvocationId => input.0 = std::array::from_fn(|i| i as u32),
                        _ => {}
                    }
                    if builtin == BuiltIn::PointCoord
                        && let Some(input) = bound.input_mut(slot, 1)
                    {
                        *input = Lanes::splat_f32(0.5);
                    }
                }
            }
        }
    }

    /// Fills in what the recorded quads cost, what is left of them, and their depths and colours.
    #[inline(always)]
    fn record_quads<const S: usize>(&mut self) {
        let Some(bound) = &self.bound else { return };
        let (call, pending) = (self.call, &*self.pending);
        let record = &mut self.job.record;
        let first = record.work.payload.len();
        let (mut payload, each) = (first as u32, 4 * call.payload_words as u32);
        let (quads, costs) = (&mut record.work.quads[..], &self.recorder.quads);
        let (n, places) = (pending.n.min(QUADS), &pending.record);
        let (begin, end) = (places[0] as usize, places[n.max(1) - 1] as usize + 1);
        // The records' positions rise: if `QUADS` of them span `QUADS` positions, they are adjacent.
        if end - begin == QUADS
            && n == QUADS
            && let Some(quads) = quads[begin..].first_chunk_mut::<QUADS>()
        {
            for q in 0..QUADS {
                shaded(&mut quads[q], pending.coverage[q], &costs[q], payload + q as u32 * each);
            }
        } else {
            for q in 0..n {
                shaded(&mut quads[places[q] as usize], pending.coverage[q], &costs[q], payload);
                payload += each;
            }
        }
        if n == QUADS
            && let Some(color) = call.sole_color()
        {
            return append_whole(&mut record.work.payload, colors(bound, color));
        }
        record.work.payload.resize(first + 4 * call.payload_words * pending.n, 0);
        put_payload::<S>(call, bound, &mut record.work.payload[first..]);
    }
}

impl SegmentInput<'_, '_> {
    /// The varyings of a vertex of a batch.
    #[inline(always)]
    fn varyings<'b>(&'b self, batch: &'b Batch, v: u32) -> &'b [u32] {
        let stride = self.vertices.varying_stride;
        let (from, v) = if v & MADE == 0 { (&self.vertices.varyings, v as usize) } else { (&batch.made, (v & !MADE) as usize) };
        &from[v * stride..(v + 1) * stride]
    }

    /// Whether the inputs of a class are the same all over each triangle for all weights. The weights are finite then.
    #[inline(always)]
    fn is_constant(&self, pending: &Pending, class: &VaryingClass) -> bool {
        let names = pending.names.iter().take(pending.owners).zip(pending.triangles.as_slice());
        for (&(batch, number), triangle) in names {
            let batch = &self.batches[batch as usize];
            let [a, b, c] = batch.corners[number as usize].vertices.map(|v| self.varyings(batch, v));
            let mut words = class.inputs.iter().map(|&(_, word)| word);
            if !words.all(|word| interpolate::is_constant([a[word], b[word], c[word]]))
                || !interpolate::has_finite_weights(triangle)
            {
                return false;
            }
        }
        true
    }
}

/// The same value in all lanes of quads.
#[inline(always)]
fn fill(out: &mut Lanes, quads: std::ops::Range<usize>, value: u32) {
    // A register that belongs to one triangle takes a few stores, without a loop.
    if quads.len() == QUADS { *out = Lanes([value; LANES]) } else { out.0[4 * quads.start..4 * quads.end].fill(value) }
}

/// Depths and colours of the batch's quads, as `work::Draw` describes them.
#[inline(always)]
fn put_payload<const S: usize>(call: &DrawCall<'_>, bound: &BoundProgram<'_>, out: &mut [u32]) {
    let size = call.payload_words;
    let out = out.as_chunks_mut::<4>().0;
    if let Some(slot) = call.frag_depth {
        put::<S>(out, size, 0, [bound.output(slot, 0); S]);
    }
    for target in &call.targets {
        let color = colors(bound, target.output);
        if target.packed {
            let mut packed = [Lanes::ZERO; 4];
            target.state.pack_batch(color, &mut packed);
            for (words, word) in packed[..target.payload_words].iter().zip(target.payload..) {
                put(out, size, word, [words]);
            }
        } else {
            put(out, size, target.payload, color);
        }
        if let (Some(second), Some(word)) = (target.second, target.payload_second) {
            put(out, size, word, colors(bound, second));
        }
    }
}

/// Appends the payloads of a whole batch that have four values of each pixel and nothing else. By itself: where it is inlined, places are
/// calculated before it is known that they are needed.
#[inline(never)]
fn append_whole(payload: &mut Vec<u32>, values: [&Lanes; 4]) {
    const WORDS: usize = 4 * LANES;
    payload.reserve(WORDS);
    let [a, b, c, d] = values.map(|values| values.0.as_chunks::<4>().0);
    // Nothing is cleared first: that takes a hundredth of the renderer's instructions on `traces/sprites`.
    for q in 0..QUADS {
        payload.extend_from_slice([a[q], b[q], c[q], d[q]].as_flattened());
    }
}

/// Puts `N` values of each pixel into the quads' payloads, which have `size` words per pixel, from word `word` on.
#[inline(never)]
fn put<const N: usize>(out: &mut [[u32; 4]], size: usize, word: usize, values: [&Lanes; N]) {
    let values = values.map(|values| values.0.as_chunks::<4>().0);
    for (q, quad) in out.chunks_exact_mut(size).enumerate().take(QUADS) {
        let quad = &mut quad[word..word + N];
        for i in 0..N {
            quad[i] = values[i][q];
        }
    }
}

/// Zeros and ones for what a program does not write.
static ZERO: Lanes = Lanes::ZERO;
static ONE: Lanes = Lanes([0x3f80_0000; LANES]);

/// A colour output; components that the program does not write are 0, alpha is 1.
#[inline(always)]
fn colors<'a>(bound: &'a BoundProgram<'_>, (slot, components): (usize, usize)) -> [&'a Lanes; 4] {
    let one = |c: usize| match c {
        c if c < components => bound.output(slot, c),
        3 => &ONE,
        _ => &ZERO,
    };
    [one(0), one(1), one(2), one(3)]
}
