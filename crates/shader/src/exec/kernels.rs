//! Lane loops: how a function of one lane is applied to whole registers.
//!
//! The register file is a slice of cells, so that an operation may read and write it through several references without
//! copying a register first. A kernel takes eight lanes at a time by value and stores the eight results. So the destination of an
//! operation may be one of its operands, and the compiler needs no overlap check to use vector instructions.

use std::cell::Cell;

pub(super) use crate::code::CHUNK;
use crate::code::Kernels;
use crate::program::{Op, Reg};
use num::{LANES, Lanes, Mask};

/// Chunks in a register.
pub(super) const CHUNKS: usize = LANES / CHUNK;

/// A register as chunks.
pub(super) type Chunks = [[u32; CHUNK]; CHUNKS];

/// The register file, shared.
pub(super) type File<'a> = &'a [Cell<Chunks>];

/// The register file of a slice of lanes.
#[inline(always)]
pub(super) fn file(lanes: &mut [Lanes]) -> File<'_> {
    Cell::from_mut(bytemuck::cast_slice_mut::<Lanes, Chunks>(lanes)).as_slice_of_cells()
}

#[inline(always)]
pub(super) fn chunks(file: File<'_>, r: Reg) -> &[Cell<[u32; CHUNK]>; CHUNKS] {
    file[usize::from(r)].as_array_of_cells()
}

/// A register's value.
#[inline(always)]
pub(super) fn get(file: File<'_>, r: Reg) -> Lanes {
    bytemuck::cast(file[usize::from(r)].get())
}

/// Replaces a register's value.
#[inline(always)]
pub(super) fn set(file: File<'_>, r: Reg, value: &Lanes) {
    file[usize::from(r)].set(bytemuck::cast(*value));
}

/// Gives one value to all lanes of the first chunks of a register.
#[inline(always)]
pub(super) fn fill(file: File<'_>, r: Reg, bits: u32, of: usize) {
    for chunk in chunks(file, r).iter().take(of) {
        chunk.set([bits; CHUNK]);
    }
}

/// One lane of a register.
#[inline(always)]
pub(super) fn lane(file: File<'_>, r: Reg, lane: usize) -> u32 {
    chunks(file, r)[lane / CHUNK].as_array_of_cells()[lane % CHUNK].get()
}

/// Replaces one lane of a register.
#[inline(always)]
pub(super) fn set_lane(file: File<'_>, r: Reg, lane: usize, value: u32) {
    chunks(file, r)[lane / CHUNK].as_array_of_cells()[lane % CHUNK].set(value);
}

/// The lanes whose Boolean is true.
#[inline(always)]
pub(super) fn truth(file: File<'_>, r: Reg) -> Mask {
    let c = chunks(file, r);
    let mut halves = [[0u32; CHUNK]; 2];
    for h in 0..2 {
        for k in 0..4 {
            let x = c[4 * h + k].get();
            for i in 0..CHUNK {
                halves[h][i] |= (x[i] & 1) << (8 * k + i);
            }
        }
    }
    let or = |x: [u32; CHUNK]| x.iter().fold(0, |a, b| a | b);
    u64::from(or(halves[0])) | u64::from(or(halves[1])) << 32
}

/// Copies the lanes in the mask, of the first `K` chunks.
#[inline(always)]
pub(super) fn masked_copy<const K: usize>(file: File<'_>, d: Reg, s: Reg, mask: Mask) {
    let (d, s) = (chunks(file, d), chunks(file, s));
    if mask == !0 {
        for c in 0..K {
            d[c].set(s[c].get());
        }
        return;
    }
    for c in 0..K {
        let m = &EXPANDED[(mask >> (CHUNK * c)) as usize & 0xff];
        let (x, mut y) = (s[c].get(), d[c].get());
        for i in 0..CHUNK {
            y[i] = x[i] & m[i] | y[i] & !m[i];
        }
        d[c].set(y);
    }
}

/// For each set bit of a byte a lane of ones. Were masks made from bits in the loop, the compiler would see a masked store, and use
/// an instruction that takes twenty cycles on some hosts.
static EXPANDED: [[u32; CHUNK]; 256] = {
    let mut table = [[0; CHUNK]; 256];
    let mut byte = 0;
    while byte < 256 {
        let mut i = 0;
        while i < CHUNK {
            table[byte][i] = if byte >> i & 1 != 0 { u32::MAX } else { 0 };
            i += 1;
        }
        byte += 1;
    }
    table
};

/// Applies `f` to eight lanes at a time, of the first `K` chunks: `f(operands) -> results`.
#[inline(always)]
pub(super) fn apply<const K: usize, const N: usize, const M: usize>(
    file: File<'_>,
    d: [Reg; M],
    s: [Reg; N],
    f: impl Fn([f32; N]) -> [f32; M],
) {
    let s = s.map(|r| chunks(file, r));
    let d = d.map(|r| chunks(file, r));
    for c in 0..K {
        let x: [[u32; CHUNK]; N] = std::array::from_fn(|n| s[n][c].get());
        let mut y = [[0u32; CHUNK]; M];
        for i in 0..CHUNK {
            let out = f(std::array::from_fn(|n| f32::from_bits(x[n][i])));
            for m in 0..M {
                y[m][i] = out[m].to_bits();
            }
        }
        for m in 0..M {
            d[m][c].set(y[m]);
        }
    }
}

/// An operation about to be applied to the first `K` chunks.
pub(super) struct Apply<'a, const K: usize> {
    pub file: File<'a>,
    pub op: &'a Op,
}

impl<const K: usize> Kernels for Apply<'_, K> {
    #[inline(always)]
    fn unary(&self, f: impl Fn(u32) -> u32) {
        let (d, a) = (chunks(self.file, self.op.r[0]), chunks(self.file, self.op.r[1]));
        for c in 0..K {
            let mut x = a[c].get();
            for i in 0..CHUNK {
                x[i] = f(x[i]);
            }
            d[c].set(x);
        }
    }

    #[inline(always)]
    fn binary(&self, f: impl Fn(u32, u32) -> u32) {
        let r = &self.op.r;
        let (d, a, b) = (chunks(self.file, r[0]), chunks(self.file, r[1]), chunks(self.file, r[2]));
        for c in 0..K {
            let (mut x, y) = (a[c].get(), b[c].get());
            for i in 0..CHUNK {
                x[i] = f(x[i], y[i]);
            }
            d[c].set(x);
        }
    }

    #[inline(always)]
    fn ternary(&self, f: impl Fn(u32, u32, u32) -> u32) {
        let r = &self.op.r;
        let (d, a) = (chunks(self.file, r[0]), chunks(self.file, r[1]));
        let (b, e) = (chunks(self.file, r[2]), chunks(self.file, r[3]));
        for c in 0..K {
            let (mut x, y, z) = (a[c].get(), b[c].get(), e[c].get());
            for i in 0..CHUNK {
                x[i] = f(x[i], y[i], z[i]);
            }
            d[c].set(x);
        }
    }

    #[inline(always)]
    fn heavy(&self, f: impl Fn(&[f32; CHUNK], &mut [f32; CHUNK])) {
        let (d, a) = (chunks(self.file, self.op.r[0]), chunks(self.file, self.op.r[1]));
        for c in 0..K {
            let mut out = [0.0; CHUNK];
            f(&a[c].get().map(f32::from_bits), &mut out);
            d[c].set(out.map(f32::to_bits));
        }
    }
}

/// A long function of two operands, of the first `K` chunks.
#[inline(always)]
pub(super) fn heavy2<const K: usize>(file: File<'_>, op: &Op, f: impl Fn(&[f32; CHUNK], &[f32; CHUNK], &mut [f32; CHUNK])) {
    let (d, a, b) = (chunks(file, op.r[0]), chunks(file, op.r[1]), chunks(file, op.r[2]));
    for c in 0..K {
        let mut out = [0.0; CHUNK];
        f(&a[c].get().map(f32::from_bits), &b[c].get().map(f32::from_bits), &mut out);
        d[c].set(out.map(f32::to_bits));
    }
}

/// Differences inside quads; `kind`: 0 x coarse, 1 x fine, 2 y coarse, 3 y fine.
#[inline(always)]
pub(super) fn derivative(file: File<'_>, d: Reg, s: Reg, kind: u32) {
    let x = get(file, s);
    let x = x.f32();
    let mut out = Lanes::ZERO;
    let y = out.f32_mut();
    for q in (0..LANES).step_by(4) {
        let v = [x[q], x[q + 1], x[q + 2], x[q + 3]];
        let differences = match kind {
            0 => [v[1] - v[0]; 4],
            1 => [v[1] - v[0], v[1] - v[0], v[3] - v[2], v[3] - v[2]],
            2 => [v[2] - v[0]; 4],
            _ => [v[2] - v[0], v[3] - v[1], v[2] - v[0], v[3] - v[1]],
        };
        y[q..q + 4].copy_from_slice(&differences);
    }
    set(file, d, &out);
}

/// Element of a register range chosen by each lane; an index beyond the range takes the last.
#[inline(always)]
pub(super) fn load_indexed(file: File<'_>, op: &Op) {
    let index = get(file, op.r[2]);
    let last = op.imm.saturating_sub(1);
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        out.0[i] = lane(file, op.r[1] + index.0[i].min(last) as Reg, i);
    }
    set(file, op.r[0], &out);
}

/// Store to an element of a register range chosen by each lane of the mask.
#[inline(always)]
pub(super) fn store_indexed(file: File<'_>, op: &Op, mask: Mask) {
    let (value, index) = (get(file, op.r[1]), get(file, op.r[2]));
    let last = op.imm.saturating_sub(1);
    let mut left = mask;
    while left != 0 {
        let i = left.trailing_zeros() as usize;
        left &= left - 1;
        set_lane(file, op.r[0] + index.0[i].min(last) as Reg, i, value.0[i]);
    }
}

/// Element of the constant table chosen by each lane: `r[2]`, `r[3]` hold the number of elements.
#[inline(always)]
pub(super) fn load_const(file: File<'_>, op: &Op, table: &[u32]) {
    let index = get(file, op.r[1]);
    let n = usize::from(op.r[2]) | usize::from(op.r[3]) << 16;
    let table = &table[op.imm as usize..op.imm as usize + n];
    let mut out = Lanes::ZERO;
    for i in 0..LANES {
        out.0[i] = table[(index.0[i] as usize).min(n - 1)];
    }
    set(file, op.r[0], &out);
}
