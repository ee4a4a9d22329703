//! The interpreter loop: one `match` an operation and batch.

use crate::code::{self, Code};
use crate::program::{Body, NO_REG, Op};
use crate::resources::Resources;
use gfx::math;
use gfx::simd::{self, Simd};
use num::{Lanes, Mask, Words};

use super::kernels::{self, Apply, CHUNKS, File, apply, truth};
use super::record::Scratch;

/// Why the loop returned.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stop {
    /// The program's end.
    End,
    /// A workgroup barrier; the machine goes on from its program counter when run again.
    Barrier,
    /// The loop of this number exceeded its bound.
    Loop(u32),
    /// [`BatchState::spent`] has reached [`PAUSE`]; the machine goes on from its program counter when run again.
    Pause,
}

/// Steps in loops after which a run pauses to count them against the limit. They take some hundredths of a second. Tests of limits pause
/// earlier.
pub(super) const PAUSE: u64 = if cfg!(test) { 1 << 14 } else { 1 << 20 };

/// The state of one batch apart from its registers and mask slots.
pub(super) struct BatchState<'a> {
    pub body: &'a Body,
    pub resources: &'a Resources<'a>,
    pub shared: &'a Words,
    /// Next operation.
    pub pc: usize,
    /// Lanes that execute.
    pub mask: Mask,
    /// Lanes that may leave side effects: neither helpers nor discarded.
    pub live: Mask,
    /// How many [chunks](kernels::CHUNK) of the registers hold lanes that may ever execute, from the first on.
    pub chunks: usize,
    /// Steps since the last pause in turns of loops, without the first turn of each.
    pub spent: u64,
}

impl<'a> BatchState<'a> {
    pub fn new(body: &'a Body, resources: &'a Resources<'a>, shared: &'a Words, mask: Mask, live: Mask) -> BatchState<'a> {
        BatchState { body, resources, shared, pc: 0, mask, live, chunks: CHUNKS, spent: 0 }
    }

    /// The same, for a batch of which no other lanes than those of `mask` will ever execute.
    pub fn narrow(self) -> BatchState<'a> {
        BatchState { chunks: chunks_of(self.mask), ..self }
    }
}

/// How many chunks of a register have the lanes of a mask, from the first on.
pub(super) fn chunks_of(mask: Mask) -> usize {
    let lanes = Mask::BITS as usize - mask.leading_zeros() as usize;
    lanes.div_ceil(kernels::CHUNK)
}

/// The number of chunks that are computed if `chunks` of them have lanes. Draws of few vertices or few pixels leave most of a register empty.
pub(super) fn computed<const RECORD: bool>(chunks: usize) -> usize {
    match chunks {
        0..=1 if !RECORD => 1,
        2..=4 if !RECORD => 4,
        _ => CHUNKS,
    }
}

/// Runs with the widest vector instructions of the host. The results have the same bits with all of them.
#[inline]
pub(super) fn dispatch<const RECORD: bool>(
    machine: &mut BatchState<'_>,
    file: &mut [Lanes],
    masks: &mut [Mask],
    recorder: &mut Scratch,
) -> Stop {
    match computed::<RECORD>(machine.chunks) {
        1 => simd::dispatch!(simd => run::<false, 1, _>(simd, machine, file, masks, recorder)),
        4 => simd::dispatch!(simd => run::<false, 4, _>(simd, machine, file, masks, recorder)),
        _ => simd::dispatch!(simd => run::<RECORD, CHUNKS, _>(simd, machine, file, masks, recorder)),
    }
}

/// All lanes of the quads that have a lane in the mask.
#[inline(always)]
pub(super) fn quads_of(mask: Mask) -> Mask {
    const FIRST: Mask = 0x1111_1111_1111_1111;
    ((mask | mask >> 1 | mask >> 2 | mask >> 3) & FIRST) * 15
}

/// Removes lanes from a range of mask slots.
#[inline(always)]
fn leave(masks: &mut [Mask], op: &Op, lanes: Mask) {
    for m in &mut masks[usize::from(op.r[1])..usize::from(op.r[2])] {
        *m &= !lanes;
    }
}

/// Runs until the end, a barrier or an error. `K`: the number of chunks of the registers that are computed.
#[inline(always)]
fn run<const RECORD: bool, const K: usize, V: Simd>(
    simd: V,
    m: &mut BatchState<'_>,
    file: &mut [Lanes],
    masks: &mut [Mask],
    recorder: &mut Scratch,
) -> Stop {
    let file: File<'_> = kernels::file(file);
    let body = m.body;
    let mut pc = m.pc;
    let mut mask = m.mask;
    macro_rules! go {
        ($target:expr) => {{
            pc = $target;
            if RECORD {
                recorder.jump(pc);
            }
            continue;
        }};
    }
    if RECORD {
        recorder.jump(pc);
    }
    loop {
        let op = &body.ops[pc];
        if code::arithmetic(op.code, &Apply::<K> { file, op }) {
            pc += 1;
            continue;
        }
        if RECORD && op.code.breaks_block() {
            recorder.block(body, pc + 1, mask);
        }
        let r = &op.r;
        match op.code {
            Code::MulAdd => apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3]], |[a, b, c]| [a * b + c]),
            Code::MulSub => apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3]], |[a, b, c]| [a * b - c]),
            Code::NegMulAdd => apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3]], |[a, b, c]| [c - a * b]),
            Code::Dot2 => apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3], r[4]], |[a, b, x, y]| [a * x + b * y]),
            Code::Dot3 => apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3], r[4], r[5], r[6]], |[a, b, c, x, y, z]| {
                [a * x + b * y + c * z]
            }),
            Code::Dot4 => {
                apply::<K, _, _>(file, [r[0]], [r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8]], |[a, b, c, d, x, y, z, w]| {
                    [a * x + b * y + c * z + d * w]
                });
            }
            Code::Normalize2 => apply::<K, _, _>(file, [r[0], r[1]], [r[2], r[3]], |[a, b]| {
                let s = math::inverse_sqrt(a * a + b * b);
                [a * s, b * s]
            }),
            Code::Normalize3 => apply::<K, _, _>(file, [r[0], r[1], r[2]], [r[3], r[4], r[5]], |[a, b, c]| {
                let s = math::inverse_sqrt(a * a + b * b + c * c);
                [a * s, b * s, c * s]
            }),
            Code::Pow => kernels::heavy2::<K>(file, op, math::lanes::pow),
            Code::Atan2 => kernels::heavy2::<K>(file, op, math::lanes::atan2),
            Code::Mov => kernels::masked_copy::<K>(file, r[0], r[1], mask),
            Code::Copy => kernels::masked_copy::<K>(file, r[0], r[1], !0),
            Code::Undef => {}
            Code::Derivative => kernels::derivative(file, r[0], r[1], op.imm),
            Code::LoadIndexed => kernels::load_indexed(file, op),
            Code::StoreIndexed => kernels::store_indexed(file, op, mask),
            Code::LoadConst => kernels::load_const(file, op, &body.table),
            Code::Load => super::memory::load::<RECORD>(m, file, mask, op.imm, recorder),
            Code::Store => super::memory::store::<RECORD>(m, file, mask, op.imm, recorder),
            Code::Atomic => super::memory::atomic::<RECORD>(m, file, mask, op.imm, recorder),
            Code::ArrayLength => super::memory::array_length(m, file, op),
            Code::Texture | Code::TextureStore | Code::TextureAtomic | Code::TextureQuery => {
                super::texture::access::<RECORD, _>(simd, m, file, mask, op.imm, recorder);
            }
            Code::Subgroup => super::subgroup::run(m, file, mask, op),
            Code::If => {
                let t = truth(file, r[1]);
                let slot = usize::from(r[0]);
                masks[slot] = mask;
                masks[slot + 1] = mask & !t;
                mask &= t;
                if mask == 0 {
                    go!(op.imm as usize);
                }
            }
            Code::Else => {
                mask = masks[usize::from(r[0]) + 1];
                if mask == 0 {
                    go!(op.imm as usize);
                }
            }
            Code::EndIf | Code::RegionEnd => {
                mask = masks[usize::from(r[0])];
                if mask == 0 {
                    go!(op.imm as usize);
                }
            }
            Code::RegionBegin => masks[usize::from(r[0])] = mask,
            Code::LoopBegin => {
                let slot = usize::from(r[0]);
                masks[slot] = mask;
                masks[slot + 1] = 0;
                masks[usize::from(r[1])] = 0;
            }
            Code::Continuing => {
                let slot = usize::from(r[0]) + 1;
                mask |= masks[slot];
                masks[slot] = 0;
                if mask == 0 {
                    go!(op.imm as usize);
                }
            }
            Code::LoopEnd | Code::LoopEndIf => {
                if op.code == Code::LoopEndIf {
                    mask &= !truth(file, r[2]);
                }
                if mask != 0 {
                    let counter = &mut masks[usize::from(r[1])];
                    *counter += 1;
                    if *counter >= body.loop_turns {
                        return Stop::Loop(u32::from(r[1]) - body.first_counter as u32);
                    }
                    let first = op.imm as usize;
                    m.spent += body.steps[pc + 1] - body.steps[first];
                    if m.spent >= PAUSE {
                        (m.pc, m.mask) = (first, mask);
                        return Stop::Pause;
                    }
                    go!(first);
                }
                mask = masks[usize::from(r[0])];
                if mask == 0 {
                    // No lane is left after the loop: execution goes on at the end of the construct around it.
                    go!(usize::from(r[3]) | usize::from(r[4]) << 16);
                }
            }
            Code::Exit => {
                leave(masks, op, mask);
                mask = 0;
                go!(op.imm as usize);
            }
            Code::Continue => {
                masks[usize::from(r[0]) + 1] |= mask;
                leave(masks, op, mask);
                mask = 0;
                go!(op.imm as usize);
            }
            Code::BreakIf | Code::BreakIfNot => {
                let t = truth(file, r[0]);
                let leaving = mask & if op.code == Code::BreakIf { t } else { !t };
                leave(masks, op, leaving);
                mask &= !leaving;
                if mask == 0 {
                    go!(op.imm as usize);
                }
            }
            Code::Discard => {
                m.live &= !mask;
                // A quad without a live lane has nothing left to do, not even as helpers.
                let wanted = quads_of(m.live);
                if wanted & mask != mask {
                    for slot in &mut masks[..body.first_counter] {
                        *slot &= wanted;
                    }
                    mask &= wanted;
                    if mask == 0 {
                        go!(op.imm as usize);
                    }
                }
            }
            Code::Barrier => {
                if RECORD {
                    recorder.barrier(mask);
                }
                m.pc = pc + 1;
                m.mask = mask;
                return Stop::Barrier;
            }
            Code::End => {
                m.pc = pc;
                m.mask = mask;
                return Stop::End;
            }
            // The arithmetic codes have been executed above.
            _ => {}
        }
        pc += 1;
        debug_assert!(r[0] != NO_REG || !op.code.is_pure());
    }
}
