//! Depth and stencil: test and update.

use super::{Pitch, load_quad, select_mask, store_quad};
use crate::gfx::format::Format;
use crate::gfx::simd::wide;
use crate::gfx::state::{Compare, DepthStencil, StencilFace, StencilOp};
use crate::gfx::texel::{unorm, unorm24};
use crate::num::{LANES, Lanes, QUADS};

/// How depth is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Storage {
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
struct Accept {
    less: u32,
    equal: u32,
    greater: u32,
    /// One side is NaN.
    unordered: u32,
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
    storage: Storage,
    accept: Accept,
    compare: Compare,
    depth_write: bool,
    /// Depths are clamped to the viewport's range before they are compared.
    range: [f32; 2],
    /// Front and back, where the stencil test does anything.
    stencil: Option<[StencilFace; 2]>,
    reference: u8,
    read_mask: u8,
    write_mask: u8,
}

impl DepthStencilState {
    /// Prepares a state with a stencil reference and the viewport's `[min_depth, max_depth]`.
    pub fn new(state: &DepthStencil, reference: u32, range: [f32; 2]) -> DepthStencilState {
        let storage = match state.format {
            Format::Depth16Unorm => Storage::Unorm16,
            Format::Depth24Plus | Format::Depth24PlusStencil8 => Storage::Unorm24,
            Format::Depth32Float | Format::Depth32FloatStencil8 => Storage::Float,
            _ => Storage::None,
        };
        let faces = [state.stencil_front, state.stencil_back];
        let idle = faces == [StencilFace::default(); 2];
        // With a test that passes always and no write the stored depth does not matter; nor does it without storage.
        let always = storage == Storage::None;
        let compare = if always { Compare::Always } else { state.depth_compare };
        DepthStencilState {
            storage,
            accept: Accept::new(compare),
            compare,
            depth_write: state.depth_write && !always,
            range,
            stencil: (state.format.has_stencil() && !idle).then_some(faces),
            reference: reference as u8,
            read_mask: state.stencil_read_mask as u8,
            write_mask: state.stencil_write_mask as u8,
        }
    }

    /// The same tests without any update: what an early test may do when the fragment can still be discarded.
    pub fn read_only(mut self) -> DepthStencilState {
        self.depth_write = false;
        self.write_mask = 0;
        self
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
        let acts = |f: &StencilFace| [f.fail_op, f.depth_fail_op, f.pass_op].iter().any(|op| *op != StencilOp::Keep);
        self.write_mask != 0 && self.stencil.is_some_and(|faces| faces.iter().any(acts))
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

    /// [`DepthStencilState::code`] of every lane.
    pub fn codes(&self, depth: &Lanes, out: &mut Lanes) {
        codes(self, depth, out);
    }

    #[inline(always)]
    fn codes_body(&self, depth: &Lanes, out: &mut Lanes) {
        let (depth, range) = (depth.f32(), self.range);
        match self.storage {
            Storage::None => *out = Lanes::ZERO,
            Storage::Unorm16 => (0..LANES).for_each(|i| out.0[i] = unorm(clamp(depth[i], range), 65535.0)),
            Storage::Unorm24 => (0..LANES).for_each(|i| out.0[i] = unorm24(clamp(depth[i], range))),
            Storage::Float => (0..LANES).for_each(|i| out.0[i] = clamp(depth[i], range).to_bits()),
        }
    }

    /// Tests one sample of a quad and updates what is stored.
    ///
    /// `coverage` has a bit for each of the four pixels; `codes` are the fragments' depths, `depth` and `stencil` the stored
    /// values. Returns the pixels that passed both tests.
    #[inline(always)]
    pub fn test_quad(&self, back: bool, coverage: u8, codes: [u32; 4], depth: &mut [u32; 4], stencil: &mut [u8; 4]) -> u8 {
        let pass = match &self.stencil {
            None => return self.depth_quad(coverage, codes, depth),
            Some(faces) => &faces[usize::from(back)],
        };
        let masked = self.reference & self.read_mask;
        let test = Accept::new(pass.compare);
        let mut alive = 0_u8;
        for p in 0..4 {
            let stored = stencil[p] & self.read_mask;
            alive |= (test.test(masked < stored, masked == stored, masked > stored) as u8 & 1) << p;
        }
        alive &= coverage;
        let passed = self.depth_quad(alive, codes, depth);
        for p in 0..4 {
            if coverage >> p & 1 != 0 {
                let op = if alive >> p & 1 == 0 {
                    pass.fail_op
                } else if passed >> p & 1 == 0 {
                    pass.depth_fail_op
                } else {
                    pass.pass_op
                };
                let new = apply(op, stencil[p], self.reference);
                stencil[p] = stencil[p] & !self.write_mask | new & self.write_mask;
            }
        }
        passed
    }

    /// The depth half of [`DepthStencilState::test_quad`].
    #[inline(always)]
    fn depth_quad(&self, coverage: u8, codes: [u32; 4], depth: &mut [u32; 4]) -> u8 {
        let accept = self.accept;
        let mut pass = [0_u32; 4];
        if self.storage == Storage::Float {
            for p in 0..4 {
                let (new, old) = (f32::from_bits(codes[p]), f32::from_bits(depth[p]));
                pass[p] = accept.test(new < old, new == old, new > old);
            }
        } else {
            for p in 0..4 {
                pass[p] = accept.test(codes[p] < depth[p], codes[p] == depth[p], codes[p] > depth[p]);
            }
        }
        let covered = select_mask(coverage);
        let mut passed = 0;
        for p in 0..4 {
            pass[p] &= covered[p];
            passed |= (pass[p] as u8) & 1 << p;
        }
        if self.depth_write {
            for p in 0..4 {
                depth[p] = depth[p] & !pass[p] | codes[p] & pass[p];
            }
        }
        passed
    }

    /// Tests the quads of a batch in order against tile buffers.
    ///
    /// `quads` of the 16 are present; quad `q` is at `at[q]` in the buffers ([`Pitch`]). `coverage[q]` holds a bit a pixel and
    /// sample (bit `4 sample + pixel`), of `samples` samples, and keeps those that passed. `codes[s]` are the fragments' codes at
    /// sample `s`, a lane a pixel. Bit `q` of `back` says that the quad belongs to a back face. `stencil` may be empty where the
    /// state does not use it.
    ///
    /// # Panics
    /// If a quad with coverage lies outside a buffer.
    pub fn test_batch(
        &self,
        samples: usize,
        quads: usize,
        back: u16,
        at: &[u32; QUADS],
        pitch: Pitch,
        codes: &[Lanes],
        depth: &mut [u32],
        stencil: &mut [u8],
        coverage: &mut [u16; QUADS],
    ) {
        if !self.is_idle() {
            test_batch(self, samples, quads, back, at, pitch, codes, depth, stencil, coverage);
        }
    }

    #[inline(always)]
    fn test_batch_body(
        &self,
        samples: usize,
        quads: usize,
        back: u16,
        at: &[u32; QUADS],
        pitch: Pitch,
        codes: &[Lanes],
        depth: &mut [u32],
        stencil: &mut [u8],
        coverage: &mut [u16; QUADS],
    ) {
        for q in 0..quads.min(QUADS) {
            let covered = coverage[q];
            let mut passed = 0;
            for s in 0..samples {
                let mask = (covered >> (4 * s)) as u8 & 15;
                if mask == 0 {
                    continue;
                }
                let place = at[q] as usize + s * pitch.sample;
                let code: [u32; 4] = std::array::from_fn(|p| codes[s].0[4 * q + p]);
                let pass = if self.stencil.is_none() {
                    let mut stored = load_quad(depth, place, pitch.row);
                    let pass = self.depth_quad(mask, code, &mut stored);
                    if self.depth_write {
                        store_quad(depth, place, pitch.row, stored);
                    }
                    pass
                } else {
                    let has_depth = self.storage != Storage::None;
                    let mut stored = if has_depth { load_quad(depth, place, pitch.row) } else { [0; 4] };
                    let mut values = load_quad(stencil, place, pitch.row);
                    let pass = self.test_quad(back >> q & 1 != 0, mask, code, &mut stored, &mut values);
                    if has_depth {
                        store_quad(depth, place, pitch.row, stored);
                    }
                    store_quad(stencil, place, pitch.row, values);
                    pass
                };
                passed |= u16::from(pass) << (4 * s);
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
        pitch: Pitch,
        codes: &[Lanes],
        depth: &mut [u32],
        stencil: &mut [u8],
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
