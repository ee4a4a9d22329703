//! The walk over a program with ranges for lanes.

use std::cell::Cell;

use crate::code::{self, CHUNK, Code, Kernels};
use crate::exec::memory;
use crate::program::{Body, NO_REG, Op, Reg};
use crate::resources::Resources;
use gfx::math;

use super::STEPS;
use super::arithmetic;
use super::range::Range;

/// Entries of a table or a run of registers that an index may choose among before the result may be anything.
const CHOICES: usize = 1024;

/// Which invocations are in a mask.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Share {
    None,
    Some,
    All,
}

impl Share {
    /// Those where a condition holds.
    fn and(self, truth: Option<bool>) -> Share {
        match (self, truth) {
            (Share::None, _) | (_, Some(false)) => Share::None,
            (share, Some(true)) => share,
            (_, None) => Share::Some,
        }
    }

    /// The invocations of this mask that stay after `leaving` has left it.
    fn without(self, leaving: Share) -> Share {
        match (self, leaving) {
            (share, Share::None) => share,
            (_, Share::All) | (Share::None, _) => Share::None,
            (_, Share::Some) => Share::Some,
        }
    }

    fn or(self, other: Share) -> Share {
        match (self, other) {
            (Share::All, _) | (_, Share::All) => Share::All,
            (Share::None, Share::None) => Share::None,
            _ => Share::Some,
        }
    }
}

type File<'a> = &'a [Cell<Range>];

fn get(file: File<'_>, r: Reg) -> Range {
    file[usize::from(r)].get()
}

fn set(file: File<'_>, r: Reg, range: Range) {
    if r != NO_REG {
        file[usize::from(r)].set(range);
    }
}

/// Arithmetic by the executor's table: single values by its own functions, ranges by rules.
struct Apply<'a> {
    file: File<'a>,
    op: &'a Op,
}

impl Apply<'_> {
    fn operand(&self, k: usize) -> Range {
        get(self.file, self.op.r[k])
    }
}

impl Kernels for Apply<'_> {
    fn unary(&self, f: impl Fn(u32) -> u32) {
        let a = self.operand(1);
        let out = a.bits().map_or_else(|| arithmetic::unary(self.op.code, a), |a| Range::point(f(a)));
        set(self.file, self.op.r[0], out);
    }

    fn binary(&self, f: impl Fn(u32, u32) -> u32) {
        let (a, b) = (self.operand(1), self.operand(2));
        let out = match (a.bits(), b.bits()) {
            (Some(a), Some(b)) => Range::point(f(a, b)),
            _ => arithmetic::binary(self.op.code, a, b, self.op.r[1] == self.op.r[2]),
        };
        set(self.file, self.op.r[0], out);
    }

    fn ternary(&self, f: impl Fn(u32, u32, u32) -> u32) {
        let (a, b, c) = (self.operand(1), self.operand(2), self.operand(3));
        let out = match (a.bits(), b.bits(), c.bits()) {
            (Some(a), Some(b), Some(c)) => Range::point(f(a, b, c)),
            _ => arithmetic::ternary(self.op.code, a, b, c),
        };
        set(self.file, self.op.r[0], out);
    }

    fn heavy(&self, f: impl Fn(&[f32; CHUNK], &mut [f32; CHUNK])) {
        let value = |bits| {
            let mut out = [0.0; CHUNK];
            f(&[f32::from_bits(bits); CHUNK], &mut out);
            Range::point(out[0].to_bits())
        };
        set(self.file, self.op.r[0], self.operand(1).bits().map_or(Range::ANY, value));
    }
}

/// Removes invocations from a range of mask slots.
fn leave(masks: &mut [Share], op: &Op, leaving: Share) {
    for mask in &mut masks[usize::from(op.r[1])..usize::from(op.r[2])] {
        *mask = mask.without(leaving);
    }
}

/// Runs to the end. False: the program has no bounds.
pub(super) fn run(body: &Body, resources: &Resources<'_>, file: File<'_>, masks: &mut [Share]) -> bool {
    let (mut pc, mut mask) = (0, Share::All);
    for _ in 0..STEPS {
        let op = &body.ops[pc];
        if code::arithmetic(op.code, &Apply { file, op }) {
            pc += 1;
            continue;
        }
        let r = &op.r;
        // Where no invocation is left the executor jumps.
        let mut empty = None;
        match op.code {
            Code::Mov if mask == Share::All => set(file, r[0], get(file, r[1])),
            Code::Mov => set(file, r[0], get(file, r[0]).join(get(file, r[1]))),
            Code::Copy => set(file, r[0], get(file, r[1])),
            Code::LoadIndexed => load_indexed(file, op),
            Code::StoreIndexed => store_indexed(file, op, mask),
            Code::LoadConst => load_const(file, op, &body.table),
            Code::Load => load(body, resources, file, op.imm),
            Code::ArrayLength => set(file, r[0], Range::ANY),
            Code::Texture | Code::TextureQuery => {
                body.textures[op.imm as usize].data.iter().for_each(|&data| set(file, data, Range::ANY));
            }
            Code::Derivative => set(file, r[0], Range::ANY),
            Code::If => {
                let truth = get(file, r[1]).truth();
                let slot = usize::from(r[0]);
                masks[slot] = mask;
                masks[slot + 1] = mask.and(truth.map(|truth| !truth));
                mask = mask.and(truth);
                empty = Some(op.imm as usize);
            }
            Code::Else => {
                mask = masks[usize::from(r[0]) + 1];
                empty = Some(op.imm as usize);
            }
            Code::EndIf | Code::RegionEnd => {
                mask = masks[usize::from(r[0])];
                empty = Some(op.imm as usize);
            }
            Code::RegionBegin => masks[usize::from(r[0])] = mask,
            Code::LoopBegin => {
                let slot = usize::from(r[0]);
                masks[slot] = mask;
                masks[slot + 1] = Share::None;
            }
            Code::Continuing => {
                let slot = usize::from(r[0]) + 1;
                mask = mask.or(masks[slot]);
                masks[slot] = Share::None;
                empty = Some(op.imm as usize);
            }
            Code::LoopEnd | Code::LoopEndIf => {
                if op.code == Code::LoopEndIf {
                    mask = mask.and(get(file, r[2]).truth().map(|truth| !truth));
                }
                if mask != Share::None {
                    pc = op.imm as usize;
                    continue;
                }
                mask = masks[usize::from(r[0])];
                empty = Some(usize::from(r[3]) | usize::from(r[4]) << 16);
            }
            Code::Exit | Code::Continue => {
                if op.code == Code::Continue {
                    let slot = usize::from(r[0]) + 1;
                    masks[slot] = masks[slot].or(mask);
                }
                leave(masks, op, mask);
                mask = Share::None;
                empty = Some(op.imm as usize);
            }
            Code::BreakIf | Code::BreakIfNot => {
                let truth = get(file, r[0]).truth();
                let leaves = if op.code == Code::BreakIf { truth } else { truth.map(|truth| !truth) };
                leave(masks, op, mask.and(leaves));
                mask = mask.and(leaves.map(|leaves| !leaves));
                empty = Some(op.imm as usize);
            }
            Code::End => return true,
            _ => {
                if !several(file, op) {
                    return false;
                }
            }
        }
        pc = match empty {
            Some(target) if mask == Share::None => target,
            _ => pc + 1,
        };
    }
    false
}

/// Operations with several roundings or results. Returns false for an operation that has no rule.
fn several(file: File<'_>, op: &Op) -> bool {
    let r = &op.r;
    let x = |k: usize| get(file, r[k]);
    let product = |a: usize, b: usize| arithmetic::multiply(x(a), x(b), r[a] == r[b]);
    let normalized = |sum: Range, results: usize| {
        let by = arithmetic::inverse_root(sum);
        let out: [Range; 3] =
            std::array::from_fn(|k| if k < results { arithmetic::multiply(x(results + k), by, false) } else { Range::ANY });
        out.iter().take(results).zip(r).for_each(|(&range, &to)| set(file, to, range));
    };
    // Single values are computed by the instruction set itself.
    let operands = match op.code {
        Code::MulAdd | Code::MulSub | Code::NegMulAdd => 3,
        Code::Pow | Code::Atan2 => 2,
        Code::Dot2 => 4,
        Code::Dot3 => 6,
        Code::Dot4 => 8,
        _ => 0,
    };
    let mut bits = [0; 8];
    let known = bits[..operands].iter_mut().zip(1..).all(|(bits, k)| x(k).bits().map(|known| *bits = known).is_some());
    if operands > 0
        && known
        && let Some(out) = op.code.fold(&bits[..operands])
    {
        set(file, r[0], Range::point(out));
        return true;
    }
    match op.code {
        Code::MulAdd => set(file, r[0], arithmetic::add(product(1, 2), x(3))),
        Code::MulSub => set(file, r[0], arithmetic::subtract(product(1, 2), x(3))),
        Code::NegMulAdd => set(file, r[0], arithmetic::subtract(x(3), product(1, 2))),
        Code::Dot2 => set(file, r[0], arithmetic::add(product(1, 3), product(2, 4))),
        Code::Dot3 => set(file, r[0], arithmetic::add(arithmetic::add(product(1, 4), product(2, 5)), product(3, 6))),
        Code::Dot4 => {
            let three = arithmetic::add(arithmetic::add(product(1, 5), product(2, 6)), product(3, 7));
            set(file, r[0], arithmetic::add(three, product(4, 8)));
        }
        Code::Normalize2 => match (x(2).bits(), x(3).bits()) {
            (Some(a), Some(b)) => {
                let [a, b] = [a, b].map(f32::from_bits);
                let s = math::inverse_sqrt(a * a + b * b);
                [a * s, b * s].iter().zip(r).for_each(|(x, &to)| set(file, to, Range::point(x.to_bits())));
            }
            _ => normalized(arithmetic::add(product(2, 2), product(3, 3)), 2),
        },
        Code::Normalize3 => match (x(3).bits(), x(4).bits(), x(5).bits()) {
            (Some(a), Some(b), Some(c)) => {
                let [a, b, c] = [a, b, c].map(f32::from_bits);
                let s = math::inverse_sqrt(a * a + b * b + c * c);
                [a * s, b * s, c * s].iter().zip(r).for_each(|(x, &to)| set(file, to, Range::point(x.to_bits())));
            }
            _ => normalized(arithmetic::add(arithmetic::add(product(3, 3), product(4, 4)), product(5, 5)), 3),
        },
        Code::Pow | Code::Atan2 => set(file, r[0], Range::ANY),
        _ => return false,
    }
    true
}

/// The places that an index may choose among `count`, which is at least 1. An index beyond the end chooses the last. None: there are too many.
fn places(index: Range, count: usize) -> Option<std::ops::RangeInclusive<usize>> {
    let last = count.saturating_sub(1);
    let (least, greatest) = index.unsigned.map_or((0, last), |(a, b)| ((a as usize).min(last), (b as usize).min(last)));
    (greatest - least < CHOICES).then_some(least..=greatest)
}

fn load_indexed(file: File<'_>, op: &Op) {
    let joined = |places: std::ops::RangeInclusive<usize>| {
        places.map(|place| get(file, op.r[1] + place as Reg)).reduce(Range::join).unwrap_or(Range::ANY)
    };
    set(file, op.r[0], places(get(file, op.r[2]), op.imm as usize).map_or(Range::ANY, joined));
}

fn store_indexed(file: File<'_>, op: &Op, mask: Share) {
    let value = get(file, op.r[1]);
    let count = op.imm as usize;
    match places(get(file, op.r[2]), count) {
        Some(places) if mask == Share::All && places.start() == places.end() => {
            set(file, op.r[0] + *places.start() as Reg, value)
        }
        Some(places) => places.map(|place| op.r[0] + place as Reg).for_each(|r| set(file, r, get(file, r).join(value))),
        None => (0..count).for_each(|place| set(file, op.r[0] + place as Reg, Range::ANY)),
    }
}

fn load_const(file: File<'_>, op: &Op, table: &[u32]) {
    let n = usize::from(op.r[2]) | usize::from(op.r[3]) << 16;
    let table = &table[op.imm as usize..op.imm as usize + n];
    let joined = |places: std::ops::RangeInclusive<usize>| Range::all(&table[places]);
    set(file, op.r[0], places(get(file, op.r[1]), n).map_or(Range::ANY, joined));
}

/// A load. Where all invocations read one place the result is what memory holds there, else it may be anything.
fn load(body: &Body, resources: &Resources<'_>, file: File<'_>, entry: u32) {
    let op = &body.memory[entry as usize];
    let known = |r: Reg| if r == NO_REG { Some(0) } else { get(file, r).bits() };
    let words = known(op.element).zip(known(op.address)).and_then(|(element, at)| memory::peek(resources, op, element, at));
    for (c, &data) in op.data.iter().enumerate().take(usize::from(op.count)) {
        set(file, data, words.map_or(Range::ANY, |words| Range::point(words[c])));
    }
}
