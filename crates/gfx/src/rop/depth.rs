//! Depth and stencil: test and update.

use super::{four, select_mask};
use crate::format::Format;
use crate::simd::wide;
use crate::state::{Compare, DepthStencil, StencilFace, StencilMasks, StencilOp};
use crate::texel::{unorm, unorm24};
use num::{LANES, Lanes, QUADS};

/// How depth is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Storage {
    /// No depth: every fragment passes.
    None,
    /// 16-bit unsigned normalised.
    Unorm16,
    /// 24-bit unsigned normalised.
    Unorm24,
    /// The bits of an `f32`.
    Float,
}

/// A comparison as four masks, so that one straight line of code serves all eight.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Accept {
    pub(super) less: u32,
    pub(super) equal: u32,
    pub(super) greater: u32,
    /// One side is NaN.
    pub(super) unordered: u32,
}

impl Accept {
    fn new(compare: Compare) -> Accept {
        let (less, equal, greater) = match compare {
            Compare::Never => (false, false, false),
            Compare::Less => (true, false, false),
            Compare::Equal => (false, true, false),
            Compare::LessEqual => (true, true, false),
            Compare::Greater => (false, false, true),
            Compare::NotEqual => (true, false, true),
            Compare::GreaterEqual => (false, true, true),
            Compare::Always => (true, true, true),
        };
        let all = |b: bool| if b { !0 } else { 0 };
        Accept { less: all(less), equal: all(equal), greater: all(greater), unordered: all(less && greater) }
    }

    /// All ones where the comparison passes.
    #[inline(always)]
    fn test(self, less: bool, equal: bool, greater: bool) -> u32 {
        let all = |b: bool| 0_u32.wrapping_sub(u32::from(b));
        let (l, e, g) = (all(less), all(equal), all(greater));
        l & self.less | e & self.equal | g & self.greater | !(l | e | g) & self.unordered
    }
}

/// Depth and stencil state made ready: formats, masks and the viewport's depth range resolved.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthStencilState {
    pub(super) storage: Storage,
    /// Where the stencil value is: word of a sample's code, and shift.
    stencil_place: (usize, u32),
    words: usize,
    pub(super) accept: Accept,
    pub(super) compare: Compare,
    pub(super) depth_write: bool,
    /// Depths are clamped to the viewport's range before they are compared.
    pub(super) range: [f32; 2],
    /// Front and back, where the stencil test does anything.
    stencil: Option<[FaceTest; 2]>,
}

/// The stencil test of one face.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FaceTest {
    face: StencilFace,
    reference: u8,
    read_mask: u8,
    write_mask: u8,
}

impl FaceTest {
    fn new(face: StencilFace, masks: StencilMasks, reference: u32) -> FaceTest {
        FaceTest { face, reference: reference as u8, read_mask: masks.read as u8, write_mask: masks.write as u8 }
    }

    /// Whether an operation may change stencil values.
    fn writes(&self) -> bool {
        let StencilFace { fail_op, depth_fail_op, pass_op, .. } = self.face;
        self.write_mask != 0 && [fail_op, depth_fail_op, pass_op].iter().any(|op| *op != StencilOp::Keep)
    }

    /// Whether samples that fail a test, of stencil or depth, may change stencil values.
    fn counts_failures(&self) -> bool {
        let StencilFace { compare, fail_op, depth_fail_op, .. } = self.face;
        let fails = depth_fail_op != StencilOp::Keep || compare != Compare::Always && fail_op != StencilOp::Keep;
        self.write_mask != 0 && fails
    }
}

impl DepthStencilState {
    /// Prepares a state with the stencil references of front and back faces and the viewport's `[min_depth, max_depth]`.
    pub fn new(state: &DepthStencil, references: [u32; 2], range: [f32; 2]) -> DepthStencilState {
        let storage = match state.format {
            Format::Depth16Unorm => Storage::Unorm16,
            Format::Depth24Plus | Format::Depth24PlusStencil8 => Storage::Unorm24,
            Format::Depth32Float | Format::Depth32FloatStencil8 => Storage::Float,
            _ => Storage::None,
        };
        let faces = [state.stencil_front, state.stencil_back];
        let idle = faces == [StencilFace::default(); 2];
        let masks = state.stencil_masks();
        let tests = [0, 1].map(|side| FaceTest::new(faces[side], masks[side], references[side]));
        // With a test that passes always and no write the stored depth does not matter; nor does it without storage.
        let always = storage == Storage::None;
        let compare = if always { Compare::Always } else { state.depth_compare };
        DepthStencilState {
            storage,
            stencil_place: match state.format {
                Format::Depth24PlusStencil8 => (0, 24),
                Format::Depth32FloatStencil8 => (1, 0),
                _ => (0, 0),
            },
            words: super::code_words(state.format),
            accept: Accept::new(compare),
            compare,
            depth_write: state.depth_write && !always,
            range,
            stencil: (state.format.has_stencil() && !idle).then_some(tests),
        }
    }

    /// The same tests without any update: what an early test may do when the fragment can still be discarded.
    pub fn read_only(mut self) -> DepthStencilState {
        self.depth_write = false;
        self.stencil.iter_mut().flatten().for_each(|test| test.write_mask = 0);
        self
    }

    /// The depth test that can be made ahead, against a depth that was stored before: `upper` says that what is stored by now can be no
    /// greater than it, `lower` that it can be no less. What fails it fails this state's depth test too. None: nothing is certain to
    /// fail. The stencil is left aside; depths are written as this state does, which keeps a bound one.
    pub fn ahead(&self, upper: bool, lower: bool) -> Option<DepthStencilState> {
        let compare = match self.compare {
            Compare::Always => return None,
            compare if upper && lower || compare == Compare::Never => compare,
            compare @ (Compare::Less | Compare::LessEqual) if upper => compare,
            compare @ (Compare::Greater | Compare::GreaterEqual) if lower => compare,
            Compare::Equal if upper => Compare::LessEqual,
            Compare::Equal if lower => Compare::GreaterEqual,
            _ => return None,
        };
        Some(DepthStencilState { accept: Accept::new(compare), compare, stencil: None, ..*self })
    }

    /// Whether every fragment passes and nothing is written.
    pub fn is_idle(&self) -> bool {
        self.compare == Compare::Always && !self.depth_write && self.stencil.is_none()
    }

    /// Whether the test may write depth.
    pub fn writes_depth(&self) -> bool {
        self.depth_write
    }

    /// Whether stored depth is read (compared or conditionally replaced).
    pub fn reads_depth(&self) -> bool {
        self.compare != Compare::Always && self.compare != Compare::Never || self.depth_write && self.stencil.is_some()
    }

    /// Whether the stencil is tested or updated.
    pub fn uses_stencil(&self) -> bool {
        self.stencil.is_some()
    }

    /// Whether stencil values may change.
    pub fn writes_stencil(&self) -> bool {
        self.stencil.iter().flatten().any(FaceTest::writes)
    }

    /// Whether samples that fail a test, of stencil or depth, may change stencil values.
    pub fn counts_failures(&self) -> bool {
        self.stencil.iter().flatten().any(FaceTest::counts_failures)
    }

    /// Whether blocks of one sample per pixel can be tested at once (`block`): depth alone, in codes of one word.
    pub fn tests_blocks(&self) -> bool {
        self.storage != Storage::None && self.words == 1 && self.stencil.is_none()
    }

    /// The depth comparison.
    pub fn compare(&self) -> Compare {
        self.compare
    }

    /// The code of a fragment's depth: clamped to the viewport's range, then converted to the format.
    #[inline(always)]
    pub fn code(&self, depth: f32) -> u32 {
        let depth = clamp(depth, self.range);
        match self.storage {
            Storage::None => 0,
            Storage::Unorm16 => unorm(depth, 65535.0),
            Storage::Unorm24 => unorm24(depth),
            Storage::Float => depth.to_bits(),
        }
    }

    /// [`DepthStencilState::code`] of a quad.
    #[inline(always)]
    pub fn code_quad(&self, depth: [f32; 4]) -> [u32; 4] {
        let mut clamped = depth;
        for p in 0..4 {
            clamped[p] = clamp(depth[p], self.range);
        }
        let mut out = [0; 4];
        match self.storage {
            Storage::None => {}
            Storage::Unorm16 => (0..4).for_each(|p| out[p] = unorm(clamped[p], 65535.0)),
            Storage::Unorm24 => (0..4).for_each(|p| out[p] = unorm24(clamped[p])),
            Storage::Float => (0..4).for_each(|p| out[p] = clamped[p].to_bits()),
        }
        out
    }

    /// [`DepthStencilState::code`] of every lane.
    pub fn codes(&self, depth: &Lanes, out: &mut Lanes) {
        codes(self, depth, out);
    }

    #[inline(always)]
    fn codes_body(&self, depth: &Lanes, out: &mut Lanes) {
        let (depth, range) = (depth.f32(), self.range);
        match self.storage {
            Storage::None => *out = Lanes::ZERO,
            Storage::Unorm16 => {
                for i in 0..LANES {
                    out.0[i] = unorm(clamp(depth[i], range), 65535.0);
                }
            }
            Storage::Unorm24 => {
                for i in 0..LANES {
                    out.0[i] = unorm24(clamp(depth[i], range));
                }
            }
            Storage::Float => {
                for i in 0..LANES {
                    out.0[i] = clamp(depth[i], range).to_bits();
                }
            }
        }
    }

    /// Tests a quad and updates its stored codes (one run, see [`super`]).
    ///
    /// `codes[s]` are the fragments' depths at sample `s`, from [`DepthStencilState::code`]; `back` says that they belong to a
    /// back face. Returns the part of `coverage` that passed both tests.
    ///
    /// # Panics
    /// If `codes` or `run` is shorter than `samples` ask.
    #[inline(always)]
    pub fn test_quad(&self, samples: usize, back: bool, coverage: u16, codes: &[[u32; 4]], run: &mut [u32]) -> u16 {
        let mut passed = 0;
        for s in 0..samples {
            let mask = (coverage >> (4 * s)) as u8 & 15;
            if mask != 0 {
                let stored = &mut run[4 * self.words * s..4 * self.words * (s + 1)];
                let alive = if self.stencil.is_none() {
                    self.depth_sample(mask, codes[s], stored)
                } else {
                    self.stencil_sample(back, mask, codes[s], stored)
                };
                passed |= u16::from(alive) << (4 * s);
            }
        }
        passed
    }

    /// [`DepthStencilState::test_sample`] apart from the code around it: few draws have a stencil test.
    #[inline(never)]
    fn stencil_sample(&self, back: bool, mask: u8, codes: [u32; 4], stored: &mut [u32]) -> u8 {
        self.test_sample(back, mask, codes, stored)
    }

    /// [`DepthStencilState::test_quad`] of one sample.
    #[inline(always)]
    fn test_sample(&self, back: bool, mask: u8, codes: [u32; 4], stored: &mut [u32]) -> u8 {
        let Some(tests) = &self.stencil else {
            return self.depth_sample(mask, codes, stored);
        };
        let FaceTest { face, reference, read_mask, write_mask } = &tests[usize::from(back)];
        let (word, shift) = self.stencil_place;
        let values: [u8; 4] = four(stored, 4 * word).map(|code| (code >> shift) as u8);
        let masked = reference & read_mask;
        let test = Accept::new(face.compare);
        let mut alive = 0_u8;
        for p in 0..4 {
            let value = values[p] & read_mask;
            alive |= (test.test(masked < value, masked == value, masked > value) as u8 & 1) << p;
        }
        alive &= mask;
        let passed = self.depth_sample(alive, codes, stored);
        for p in 0..4 {
            if mask >> p & 1 != 0 {
                let op = if alive >> p & 1 == 0 {
                    face.fail_op
                } else if passed >> p & 1 == 0 {
                    face.depth_fail_op
                } else {
                    face.pass_op
                };
                let new = apply(op, values[p], *reference);
                let kept = values[p] & !write_mask | new & write_mask;
                let code = &mut stored[4 * word + p];
                *code = *code & !(0xff << shift) | u32::from(kept) << shift;
            }
        }
        passed
    }

    /// The depth half of a sample's test.
    #[inline(always)]
    fn depth_sample(&self, mask: u8, codes: [u32; 4], stored: &mut [u32]) -> u8 {
        let accept = self.accept;
        let old = four(stored, 0);
        let mut pass = [0_u32; 4];
        // What is stored beside the depth in the same word.
        let beside = if self.storage == Storage::Unorm24 { 0xff00_0000 } else { 0 };
        if self.storage == Storage::Float {
            for p in 0..4 {
                let (new, old) = (f32::from_bits(codes[p]), f32::from_bits(old[p]));
                pass[p] = accept.test(new < old, new == old, new > old);
            }
        } else {
            for p in 0..4 {
                let old = old[p] & !beside;
                pass[p] = accept.test(codes[p] < old, codes[p] == old, codes[p] > old);
            }
        }
        let covered = select_mask(mask);
        let mut passed = 0;
        for p in 0..4 {
            pass[p] &= covered[p];
            passed |= (pass[p] as u8) & 1 << p;
        }
        if self.depth_write {
            for p in 0..4 {
                let write = pass[p] & !beside;
                stored[p] = old[p] & !write | codes[p] & write;
            }
        }
        passed
    }

    /// Tests the quads of a batch in order against a tile, the codes of many quads one run after the other.
    ///
    /// `quads` of the 16 are present; quad `q` is the `at[q]`-th of the tile. `coverage[q]` keeps what passed. `codes[s]` are the
    /// fragments' codes at sample `s`, a lane a pixel. Bit `q` of `back` says that the quad belongs to a back face.
    ///
    /// # Panics
    /// If a quad with coverage lies outside the tile, or there are fewer `codes` than `samples`.
    pub fn test_batch(
        &self,
        samples: usize,
        quads: usize,
        back: u16,
        at: &[u32; QUADS],
        codes: &[Lanes],
        tile: &mut [u32],
        coverage: &mut [u16; QUADS],
    ) {
        if !self.is_idle() {
            test_batch(self, samples, quads, back, at, codes, tile, coverage);
        }
    }

    #[inline(always)]
    fn test_batch_body(
        &self,
        samples: usize,
        quads: usize,
        back: u16,
        at: &[u32; QUADS],
        codes: &[Lanes],
        tile: &mut [u32],
        coverage: &mut [u16; QUADS],
    ) {
        let words = 4 * self.words * samples;
        for q in 0..quads.min(QUADS) {
            let covered = coverage[q];
            if covered == 0 {
                continue;
            }
            let run = &mut tile[at[q] as usize * words..][..words];
            let mut passed = 0;
            for s in 0..samples {
                let mask = (covered >> (4 * s)) as u8 & 15;
                let stored = &mut run[4 * self.words * s..4 * self.words * (s + 1)];
                passed |= u16::from(self.test_sample(back >> q & 1 != 0, mask, four(&codes[s].0, 4 * q), stored)) << (4 * s);
            }
            coverage[q] = passed;
        }
    }
}

wide! {
    fn test_batch(
        state: &DepthStencilState,
        samples: usize,
        quads: usize,
        back: u16,
        at: &[u32; QUADS],
        codes: &[Lanes],
        tile: &mut [u32],
        coverage: &mut [u16; QUADS],
    ) = DepthStencilState::test_batch_body;
    fn codes(state: &DepthStencilState, depth: &Lanes, out: &mut Lanes) = DepthStencilState::codes_body;
}

/// Clamps to a range; NaN stays.
#[inline(always)]
fn clamp(depth: f32, range: [f32; 2]) -> f32 {
    let depth = if depth < range[0] { range[0] } else { depth };
    if depth > range[1] { range[1] } else { depth }
}

/// The value a stencil operation makes of a stored one.
#[inline(always)]
fn apply(op: StencilOp, stored: u8, reference: u8) -> u8 {
    match op {
        StencilOp::Keep => stored,
        StencilOp::Zero => 0,
        StencilOp::Replace => reference,
        StencilOp::Invert => !stored,
        StencilOp::IncrementClamp => stored.saturating_add(1),
        StencilOp::DecrementClamp => stored.saturating_sub(1),
        StencilOp::IncrementWrap => stored.wrapping_add(1),
        StencilOp::DecrementWrap => stored.wrapping_sub(1),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_fails_ahead_fails_later() {
        let depths = [0.0_f32, -0.0, 0.25, 0.5, 0.75, 1.0, f32::NAN];
        let mut certain = [0; 2];
        for &compare in Compare::ALL {
            for format in [Format::Depth32Float, Format::Depth16Unorm, Format::Depth24PlusStencil8] {
                let faces = StencilFace::default();
                let state = DepthStencil {
                    format,
                    depth_write: false,
                    depth_compare: compare,
                    stencil_front: faces,
                    stencil_back: faces,
                    stencil_read_mask: !0,
                    stencil_write_mask: !0,
                    stencil_back_masks: None,
                    bias: 0.0,
                    bias_slope: 0.0,
                    bias_clamp: 0.0,
                };
                let state = DepthStencilState::new(&state, [0; 2], [0.0, 1.0]);
                let passes = |state: &DepthStencilState, new: f32, old: f32| {
                    let code = |depth| [[state.code(depth); 4]];
                    state.test_quad(1, false, 1, &code(new), &mut code(old)[0]) == 1
                };
                for (upper, lower) in [(true, false), (false, true), (true, true), (false, false)] {
                    let Some(ahead) = state.ahead(upper, lower) else { continue };
                    for &known in &depths {
                        for &stored in &depths {
                            // What is stored has moved only as it may; where it is no number, nothing moves it.
                            let same = known.to_bits() == stored.to_bits();
                            let moved = upper && !lower && stored <= known || lower && !upper && stored >= known;
                            if !same && (!moved || known.is_nan()) {
                                continue;
                            }
                            for &new in &depths {
                                if !passes(&ahead, new, known) {
                                    assert!(!passes(&state, new, stored), "{compare:?} {format:?}: {new} {known} {stored}");
                                    certain[usize::from(upper && lower)] += 1;
                                }
                            }
                        }
                    }
                }
            }
        }
        assert!(certain.iter().all(|&n| n > 300), "{certain:?}");
    }
}
