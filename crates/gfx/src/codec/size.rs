//! What the smallest form of a block takes, counted without writing it: a ROP asks this of every dirty block that leaves its cache.

use super::plane::{Flat, GROUP, Layout, TAG, WIDTH, fold, median, width};
use super::{PIXELS, Plane, mask, planes};
use crate::format::Format;
use crate::simd::wide;

wide! {
    /// The bits that [`write`](super::write) would put.
    pub(super) fn bits(format: Format, samples: usize, codes: &[u32]) -> u64 = body;
}

#[inline(always)]
fn body(format: Format, samples: usize, codes: &[u32]) -> u64 {
    let (planes, words) = planes(format);
    assert_eq!(codes.len(), PIXELS * samples * words, "codes of a block of {}", format.name());
    let run = 4 * words;
    let agree = samples > 1
        && codes.chunks_exact(run * samples).all(|quad| quad.chunks_exact(run).all(|sample| sample == &quad[..run]));
    let layout = Layout::new(samples, agree);
    let count = layout.count();
    let mut total = u64::from(samples > 1);
    let mut rows = [0_u32; 4 * PIXELS];
    let rows = &mut rows[..count];
    let mut values = [0_u32; 4 * PIXELS];
    let values = &mut values[..count];
    let mut word = usize::MAX;
    for plane in planes {
        if plane.word != word {
            word = plane.word;
            for (i, row) in rows.iter_mut().enumerate() {
                *row = codes[layout.index(i, words) + 4 * word];
            }
        }
        for (value, code) in values.iter_mut().zip(rows.iter()) {
            *value = code >> plane.shift & mask(plane.bits);
        }
        total += plane_bits(&layout, plane, values);
    }
    total
}

#[inline(always)]
fn plane_bits(layout: &Layout, plane: &Plane, values: &[u32]) -> u64 {
    let first = values[0];
    if values.iter().fold(0, |all, value| all | (value ^ first)) == 0 {
        return u64::from(TAG + plane.bits);
    }
    let raw = u64::from(plane.bits) * values.len() as u64;
    u64::from(TAG) + raw.min(near_bits(plane.bits, values)).min(flat_bits(layout, plane, values))
}

/// Bits of the form that stores each number from its neighbours.
#[inline(always)]
fn near_bits(bits: u32, values: &[u32]) -> u64 {
    let mut total = 0;
    let mut group = |all: u32| total += u64::from(WIDTH + GROUP as u32 * width(all));
    // Beyond the block's edges stand zeros, of which the median makes what the edges need: left alone, above alone, or nothing.
    let mut above = [0_u32; 9];
    for row in values[..PIXELS].chunks_exact(8) {
        let mut left = [0_u32; 9];
        left[1..].copy_from_slice(row);
        let mut near = [0_u32; 8];
        for x in 0..8 {
            near[x] = fold(row[x].wrapping_sub(median(left[x], above[x + 1], above[x], bits)), bits);
        }
        for half in near.chunks_exact(GROUP) {
            group(half.iter().fold(0, |all, value| all | value));
        }
        above = left;
    }
    // A further sample is predicted by the one before it.
    for (before, after) in values.chunks_exact(GROUP).zip(values[PIXELS..].chunks_exact(GROUP)) {
        group(before.iter().zip(after).fold(0, |all, (b, a)| all | fold(a.wrapping_sub(*b), bits)));
    }
    total
}

/// Bits of the form that stores a flat plane and what is left over; as many as there can be where there is no such plane.
#[inline(always)]
fn flat_bits(layout: &Layout, plane: &Plane, values: &[u32]) -> u64 {
    let Some(through) = Flat::through(plane, values) else { return u64::MAX };
    let mut all = 0;
    for (i, value) in values.iter().enumerate() {
        all |= fold(value.wrapping_sub(through.predict(layout.position(i))), plane.bits);
    }
    u64::from(3 * plane.bits + WIDTH) + u64::from(width(all)) * values.len() as u64
}
