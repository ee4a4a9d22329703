//! Subgroup operations. A subgroup is a batch: 64 invocations, of which those under the mask take part.

use crate::code::eval;
use crate::program::{Fold, NO_REG, Op, SubgroupOp};
use num::{LANES, Lanes, Mask};

use super::kernels::{File, get, set, truth};
use super::run::BatchState;

/// The neutral element.
fn neutral(fold: Fold) -> u32 {
    match fold {
        Fold::AddI | Fold::Or | Fold::Xor | Fold::MaxU => 0,
        Fold::AddF => 0f32.to_bits(),
        Fold::MulI => 1,
        Fold::MulF => 1f32.to_bits(),
        Fold::MinS => i32::MAX as u32,
        Fold::MinU | Fold::And => u32::MAX,
        Fold::MinF => f32::INFINITY.to_bits(),
        Fold::MaxS => i32::MIN as u32,
        Fold::MaxF => f32::NEG_INFINITY.to_bits(),
    }
}

fn combine(fold: Fold, a: u32, b: u32) -> u32 {
    let (x, y) = (f32::from_bits(a), f32::from_bits(b));
    match fold {
        Fold::AddI => a.wrapping_add(b),
        Fold::AddF => (x + y).to_bits(),
        Fold::MulI => a.wrapping_mul(b),
        Fold::MulF => (x * y).to_bits(),
        Fold::MinS => (a as i32).min(b as i32) as u32,
        Fold::MinU => a.min(b),
        Fold::MinF => eval::fmin(x, y).to_bits(),
        Fold::MaxS => (a as i32).max(b as i32) as u32,
        Fold::MaxU => a.max(b),
        Fold::MaxF => eval::fmax(x, y).to_bits(),
        Fold::And => a & b,
        Fold::Or => a | b,
        Fold::Xor => a ^ b,
    }
}

/// Results `r[0]` (a ballot: to `r[3]`), argument `r[4]`, index `r[5]`. An index of a lane that does not take part gives 0.
#[inline(never)]
pub(super) fn run(m: &BatchState<'_>, file: File<'_>, mask: Mask, op: &Op) {
    let kind = m.body.subgroup[op.imm as usize];
    let argument = if op.r[4] == NO_REG { Lanes::ZERO } else { get(file, op.r[4]) };
    let index = if op.r[5] == NO_REG { Lanes::ZERO } else { get(file, op.r[5]) };
    let first = mask.trailing_zeros() as usize % LANES;
    let from = |lane: u32| {
        let active = lane < LANES as u32 && mask >> lane & 1 != 0;
        if active { argument.0[lane as usize] } else { 0 }
    };
    let shuffle = |f: &dyn Fn(usize, u32) -> u32| Lanes(std::array::from_fn(|i| from(f(i, index.0[i]))));
    let out = match kind {
        SubgroupOp::Ballot => {
            let t = if op.r[4] == NO_REG { mask } else { truth(file, op.r[4]) & mask };
            for (c, bits) in [t as u32, (t >> 32) as u32, 0, 0].into_iter().enumerate() {
                if op.r[c] != NO_REG {
                    set(file, op.r[c], &Lanes::splat(bits));
                }
            }
            return;
        }
        SubgroupOp::All => Lanes::splat(u32::from(truth(file, op.r[4]) & mask == mask)),
        SubgroupOp::Any => Lanes::splat(u32::from(truth(file, op.r[4]) & mask != 0)),
        SubgroupOp::BroadcastFirst => Lanes::splat(argument.0[first]),
        SubgroupOp::Broadcast => Lanes::splat(from(index.0[first])),
        SubgroupOp::Shuffle => shuffle(&|_, k| k),
        SubgroupOp::ShuffleDown => shuffle(&|i, k| (i as u32).saturating_add(k)),
        SubgroupOp::ShuffleUp => shuffle(&|i, k| (i as u32).wrapping_sub(k)),
        SubgroupOp::ShuffleXor => shuffle(&|i, k| i as u32 ^ k),
        SubgroupOp::QuadBroadcast => shuffle(&|i, k| (i as u32 & !3) | (k & 3)),
        SubgroupOp::QuadSwap(direction) => shuffle(&|i, _| i as u32 ^ [1, 2, 3][usize::from(direction.min(2))]),
        SubgroupOp::Reduce(fold) => {
            let mut sum = neutral(fold);
            for i in 0..LANES {
                if mask >> i & 1 != 0 {
                    sum = combine(fold, sum, argument.0[i]);
                }
            }
            Lanes::splat(sum)
        }
        SubgroupOp::Inclusive(fold) | SubgroupOp::Exclusive(fold) => {
            let mut out = Lanes::ZERO;
            let mut sum = neutral(fold);
            for i in 0..LANES {
                if mask >> i & 1 != 0 {
                    let next = combine(fold, sum, argument.0[i]);
                    out.0[i] = if matches!(kind, SubgroupOp::Inclusive(_)) { next } else { sum };
                    sum = next;
                }
            }
            out
        }
    };
    if op.r[0] != NO_REG {
        set(file, op.r[0], &out);
    }
}
