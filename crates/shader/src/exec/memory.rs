//! Buffers, workgroup memory and immediates.
//!
//! Access is robust: what lies outside the bound range reads as zero, and is not written.

use std::sync::atomic::AtomicU32;
use std::sync::atomic::Ordering::Relaxed;

use crate::code::eval;
use crate::program::{AtomicOp, MemoryOp, NO_REG, Op, Placed, Space, Width};
use crate::resources::{Resource, Resources};
use num::{LANES, Lanes, Mask};
use work::{LINE, RequestKind};

use super::kernels::{File, fill, get, lane, set};
use super::record::Scratch;
use super::run::BatchState;

/// A window of memory in words.
#[derive(Clone, Copy)]
struct Window<'a> {
    words: &'a [AtomicU32],
    /// Bytes that may be touched.
    bytes: u64,
    /// Byte offset of the window in `words`.
    start: u64,
    /// Address of the window in the card's memory.
    address: u64,
}

impl Window<'_> {
    /// The index of the word at a byte offset, if it is inside.
    #[inline(always)]
    fn index(&self, at: u64) -> Option<usize> {
        (at + 4 <= self.bytes).then_some(((self.start + at) / 4) as usize)
    }

    #[inline(always)]
    fn load(&self, at: u64) -> u32 {
        self.index(at).and_then(|i| self.words.get(i)).map_or(0, |w| w.load(Relaxed))
    }

    #[inline(always)]
    fn word(&self, at: u64) -> Option<&AtomicU32> {
        self.index(at).and_then(|i| self.words.get(i))
    }

    /// The 16 bits at a byte offset.
    #[inline(always)]
    fn load_half(&self, at: u64) -> u32 {
        if at + 2 > self.bytes {
            return 0;
        }
        let byte = self.start + at;
        self.words.get((byte / 4) as usize).map_or(0, |w| w.load(Relaxed) >> (8 * (byte % 4)) & 0xffff)
    }

    #[inline(always)]
    fn store_half(&self, at: u64, value: u32) {
        if at + 2 > self.bytes {
            return;
        }
        let byte = self.start + at;
        if let Some(w) = self.words.get((byte / 4) as usize) {
            let shift = 8 * (byte % 4);
            w.store(w.load(Relaxed) & !(0xffff << shift) | value << shift, Relaxed);
        }
    }
}

/// The part of a buffer that a binding makes visible.
#[inline(always)]
fn buffer<'a>(resources: &Resources<'a>, binding: u16, element: u32) -> Window<'a> {
    match resources.get(binding, element) {
        Resource::Buffer(b) => {
            let bytes = b.size.min(b.words.len().saturating_sub(b.offset));
            Window { words: b.words.words(), bytes, start: b.offset, address: b.address }
        }
        _ => Window { words: &[], bytes: 0, start: 0, address: 0 },
    }
}

#[inline(always)]
fn window<'a>(m: &BatchState<'a>, space: Space, element: u32) -> Window<'a> {
    match space {
        Space::Buffer(binding) => buffer(m.resources, binding, element),
        Space::Shared => Window { words: m.shared.words(), bytes: m.shared.len(), start: 0, address: 0 },
        Space::Immediate => Window { words: &[], bytes: 0, start: 0, address: 0 },
    }
}

/// The word of the immediates that holds a component of a load; missing ones read as zero.
#[inline(always)]
fn immediate(resources: &Resources<'_>, op: &MemoryOp, at: u32, component: usize) -> u32 {
    let word = (at as usize).saturating_add(op.offset as usize + 4 * component) / 4;
    resources.immediates.get(word).copied().unwrap_or(0)
}

/// The result of a load at one place, found without a run; none for memory that exists only during a run.
pub(crate) fn peek(resources: &Resources<'_>, op: &MemoryOp, element: u32, at: u32) -> Option<[u32; 4]> {
    let binding = match op.space {
        Space::Immediate => return Some(std::array::from_fn(|c| immediate(resources, op, at, c))),
        Space::Buffer(binding) => binding,
        Space::Shared => return None,
    };
    let w = buffer(resources, binding, element);
    let at = u64::from(at) + u64::from(op.offset);
    let size = op.width.bytes();
    Some(std::array::from_fn(|c| component(&w, op.width, at + size * c as u64)))
}

/// The line of the card's memory that a byte of a buffer lies in, and the half of it.
pub(super) fn line_of(resources: &Resources<'_>, binding: u16, offset: u64) -> (u32, u16) {
    let address = buffer(resources, binding, 0).address + offset;
    ((address / LINE) as u32, 1 << (address % LINE / (LINE / 2)))
}

/// Loads from buffers at places that are known: `copy` receives the words of a run and the first register of theirs, `set` what one register
/// gets.
#[inline(always)]
pub(super) fn load_placed<'r, T>(
    resources: &Resources<'r>,
    loads: &[Placed],
    to: &mut T,
    copy: impl Fn(&mut T, usize, &'r [AtomicU32]),
    set: impl Fn(&mut T, usize, u32),
) {
    // Most of a program's are whole words of one binding.
    let (mut last, mut w) = (None, Window { words: &[], bytes: 0, start: 0, address: 0 });
    let mut words = w.words;
    for load in loads {
        if last != Some(load.binding) {
            (last, w) = (Some(load.binding), buffer(resources, load.binding, 0));
            let (first, n) = ((w.start / 4) as usize, (w.bytes / 4) as usize);
            words = w.words.get(first..).and_then(|words| words.get(..n)).unwrap_or_default();
        }
        match &load.words {
            Some(run) if run.end as usize <= words.len() => {
                copy(to, usize::from(load.register), &words[run.start as usize..run.end as usize])
            }
            _ => {
                for c in 0..load.count {
                    let bits = component(&w, load.width, load.offset + load.width.bytes() * u64::from(c));
                    set(to, usize::from(load.register + c), bits);
                }
            }
        }
    }
}

/// A component of a load, by its byte offset.
#[inline(always)]
fn component(w: &Window<'_>, width: Width, at: u64) -> u32 {
    match width {
        Width::Word => w.load(at),
        Width::Half => eval::from_half(w.load_half(at)).to_bits(),
    }
}

/// Calls `f` for each lane of the mask in order.
#[inline(always)]
fn each(mask: Mask, mut f: impl FnMut(usize)) {
    let mut left = mask;
    while left != 0 {
        f(left.trailing_zeros() as usize);
        left &= left - 1;
    }
}

/// Byte offsets of all lanes, and whether they are one.
#[inline(always)]
fn offsets(file: File<'_>, op: &MemoryOp) -> Lanes {
    if op.address == NO_REG { Lanes::ZERO } else { get(file, op.address) }
}

/// What a load of a buffer asks.
#[inline(always)]
fn kind_of(op: &MemoryOp) -> RequestKind {
    if op.constant { RequestKind::Constant } else { RequestKind::Load }
}

/// A load of up to four components.
#[inline(always)]
pub(super) fn load<const RECORD: bool>(m: &BatchState<'_>, file: File<'_>, mask: Mask, entry: u32, recorder: &mut Scratch) {
    let op = &m.body.memory[entry as usize];
    let size = op.width.bytes();
    if op.space == Space::Immediate {
        let at = offsets(file, op);
        for c in 0..usize::from(op.count) {
            if op.data[c] != NO_REG {
                set(file, op.data[c], &Lanes(std::array::from_fn(|i| immediate(m.resources, op, at.0[i], c))));
            }
        }
        return;
    }
    let first = mask.trailing_zeros() as usize % LANES;
    let many = op.element != NO_REG && !op.uniform;
    let element = if op.element == NO_REG { 0 } else { lane(file, op.element, first) };
    let w = window(m, op.space, element);
    if op.uniform || (op.address == NO_REG && !many) {
        let at = if op.address == NO_REG { 0 } else { lane(file, op.address, first) };
        let at = u64::from(at) + u64::from(op.offset);
        for c in 0..usize::from(op.count) {
            if op.data[c] != NO_REG {
                let at = at + size * c as u64;
                let bits = if size == 4 { w.load(at) } else { eval::from_half(w.load_half(at)).to_bits() };
                fill(file, op.data[c], bits, m.chunks);
            }
        }
        if RECORD && op.space == Space::Shared {
            recorder.shared(mask, op.count, false, |_| at);
        } else if RECORD {
            recorder.request(kind_of(op), mask, op.count, |_| Some(w.address + at), size * u64::from(op.count));
        }
        return;
    }
    let at = offsets(file, op);
    let mut out = [Lanes::ZERO; 4];
    if many {
        let elements = get(file, op.element);
        each(mask, |i| {
            let w = window(m, op.space, elements.0[i]);
            read_lane(&w, op, u64::from(at.0[i]) + u64::from(op.offset), size, i, &mut out);
        });
    } else if mask.count_ones() > 32 {
        // All lanes: reads cannot fail, and the loop without a mask is the faster one.
        for i in 0..LANES {
            read_lane(&w, op, u64::from(at.0[i]) + u64::from(op.offset), size, i, &mut out);
        }
    } else {
        each(mask, |i| read_lane(&w, op, u64::from(at.0[i]) + u64::from(op.offset), size, i, &mut out));
    }
    // This is read before the results are written, because a result may have the element's register.
    if RECORD && op.space == Space::Shared {
        recorder.shared(mask, op.count, false, |i| u64::from(at.0[i]) + u64::from(op.offset));
    } else if RECORD {
        let offset = u64::from(op.offset);
        let address = |i: usize| {
            let w = if many { window(m, op.space, lane(file, op.element, i)) } else { w };
            Some(w.address + u64::from(at.0[i]) + offset)
        };
        recorder.request(kind_of(op), mask, op.count, address, size * u64::from(op.count));
    }
    for c in 0..usize::from(op.count) {
        if op.data[c] != NO_REG {
            set(file, op.data[c], &out[c]);
        }
    }
}

#[inline(always)]
fn read_lane(w: &Window<'_>, op: &MemoryOp, at: u64, size: u64, i: usize, out: &mut [Lanes; 4]) {
    if size == 4 {
        // One check and one slice for the usual case, where all components are inside.
        let first = ((w.start + at) / 4) as usize;
        let n = usize::from(op.count);
        if at + 4 * n as u64 <= w.bytes
            && let Some(words) = w.words.get(first..first + n)
        {
            for (c, word) in words.iter().enumerate().take(4) {
                out[c].0[i] = word.load(Relaxed);
            }
            return;
        }
    }
    for c in 0..usize::from(op.count) {
        let at = at + size * c as u64;
        out[c].0[i] = if size == 4 { w.load(at) } else { eval::from_half(w.load_half(at)).to_bits() };
    }
}

/// A store of up to four components by the live lanes, in lane order.
#[inline(always)]
pub(super) fn store<const RECORD: bool>(m: &BatchState<'_>, file: File<'_>, mask: Mask, entry: u32, recorder: &mut Scratch) {
    let op = &m.body.memory[entry as usize];
    let mask = mask & m.live;
    let at = offsets(file, op);
    let n = usize::from(op.count);
    let size = op.width.bytes();
    let first = mask.trailing_zeros() as usize % LANES;
    let single = window(m, op.space, if op.element == NO_REG { 0 } else { lane(file, op.element, first) });
    let window_of = |i: usize| if op.element == NO_REG { single } else { window(m, op.space, lane(file, op.element, i)) };
    each(mask, |i| {
        let w = window_of(i);
        let at = u64::from(at.0[i]) + u64::from(op.offset);
        for c in 0..n {
            let value = lane(file, op.data[c], i);
            let at = at + size * c as u64;
            if op.width == Width::Half {
                w.store_half(at, eval::to_half(f32::from_bits(value)));
            } else if let Some(word) = w.word(at) {
                word.store(value, Relaxed);
            }
        }
    });
    if RECORD && op.space == Space::Shared {
        recorder.shared(mask, op.count, false, |i| u64::from(at.0[i]) + u64::from(op.offset));
    } else if RECORD {
        let offset = u64::from(op.offset);
        let address = |i: usize| Some(window_of(i).address + u64::from(at.0[i]) + offset);
        recorder.request(RequestKind::Store, mask, op.count, address, size * n as u64);
    }
}

/// The new value of an atomic operation.
#[inline(always)]
pub(super) fn atomic_value(op: AtomicOp, old: u32, value: u32, comparand: u32) -> u32 {
    match op {
        AtomicOp::Add => old.wrapping_add(value),
        AtomicOp::Sub => old.wrapping_sub(value),
        AtomicOp::And => old & value,
        AtomicOp::Or => old | value,
        AtomicOp::Xor => old ^ value,
        AtomicOp::MinS => (old as i32).min(value as i32) as u32,
        AtomicOp::MinU => old.min(value),
        AtomicOp::MaxS => (old as i32).max(value as i32) as u32,
        AtomicOp::MaxU => old.max(value),
        AtomicOp::Exchange => value,
        AtomicOp::CompareExchange => {
            if old == comparand {
                value
            } else {
                old
            }
        }
        AtomicOp::AddF => (f32::from_bits(old) + f32::from_bits(value)).to_bits(),
        AtomicOp::SubF => (f32::from_bits(old) - f32::from_bits(value)).to_bits(),
    }
}

/// An atomic by the live lanes, in lane order: results `data[0]` (old value) and `data[3]` (whether it was exchanged), operands
/// `data[1]` and, for a comparison, `data[2]`.
#[inline(always)]
pub(super) fn atomic<const RECORD: bool>(m: &BatchState<'_>, file: File<'_>, mask: Mask, entry: u32, recorder: &mut Scratch) {
    let op = &m.body.memory[entry as usize];
    let mask = mask & m.live;
    let at = offsets(file, op);
    let value = get(file, op.data[1]);
    let comparand = if op.data[2] == NO_REG { Lanes::ZERO } else { get(file, op.data[2]) };
    let (mut old, mut exchanged) = (Lanes::ZERO, Lanes::ZERO);
    let single = window(m, op.space, 0);
    let window_of = |i: usize| if op.element == NO_REG { single } else { window(m, op.space, lane(file, op.element, i)) };
    each(mask, |i| {
        let w = window_of(i);
        if let Some(word) = w.word(u64::from(at.0[i]) + u64::from(op.offset)) {
            let result = word
                .fetch_update(Relaxed, Relaxed, |x| Some(atomic_value(op.atomic, x, value.0[i], comparand.0[i])))
                .unwrap_or_else(|x| x);
            old.0[i] = result;
            exchanged.0[i] = u32::from(result == comparand.0[i]);
        }
    });
    // As in a load, this is read before the results are written.
    if RECORD && op.space == Space::Shared {
        recorder.shared(mask, 1, true, |i| u64::from(at.0[i]) + u64::from(op.offset));
    } else if RECORD {
        let offset = u64::from(op.offset);
        let address = |i: usize| Some(window_of(i).address + u64::from(at.0[i]) + offset);
        recorder.request(RequestKind::Atomic, mask, 1, address, 4);
    }
    if op.data[0] != NO_REG {
        set(file, op.data[0], &old);
    }
    if op.data[3] != NO_REG {
        set(file, op.data[3], &exchanged);
    }
}

/// Elements of a runtime array: `r[0]` result, `r[1]` binding element or none, `r[2]` binding, `r[3]` stride (low and high
/// halves with `r[4]`), `imm` byte offset of the array.
#[inline(always)]
pub(super) fn array_length(m: &BatchState<'_>, file: File<'_>, op: &Op) {
    let stride = (u64::from(op.r[3]) | u64::from(op.r[4]) << 16).max(1);
    let length = |element: u32| {
        let bytes = window(m, Space::Buffer(op.r[2]), element).bytes;
        (bytes.saturating_sub(u64::from(op.imm)) / stride) as u32
    };
    let out = if op.r[1] == NO_REG {
        Lanes::splat(length(0))
    } else {
        let elements = get(file, op.r[1]);
        Lanes(std::array::from_fn(|i| length(elements.0[i])))
    };
    set(file, op.r[0], &out);
}
