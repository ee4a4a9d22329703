//! What the smallest form of a block takes, counted without writing it: a ROP asks this of every dirty block that leaves its cache.

use super::plane::{Flat, GROUP, Layout, TAG, WIDTH, fold, median, width};
use super::{PIXELS, Plane, PlaneKind, mask, planes};
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
    if samples == 1 && words == 1 {
        // Most blocks are of this form, and all places in it are constants.
        return sum(planes, 1, 1, false, &codes[..PIXELS]);
    }
    let run = 4 * words;
    let agree = samples > 1
        && codes.chunks_exact(run * samples).all(|quad| quad.chunks_exact(run).all(|sample| sample == &quad[..run]));
    u64::from(samples > 1) + sum(planes, samples, words, agree, codes)
}

/// Bits of all planes.
#[inline(always)]
fn sum(planes: &[Plane], samples: usize, words: usize, agree: bool, codes: &[u32]) -> u64 {
    let layout = Layout::new(samples, agree);
    let (run, count) = (4 * words, layout.count());
    let mut total = 0;
    let mut rows = [0_u32; 4 * PIXELS];
    let rows = &mut rows[..count];
    for planes in planes.chunk_by(|a, b| a.word == b.word) {
        for (sample, rows) in rows.chunks_exact_mut(PIXELS).enumerate() {
            in_rows(&codes[sample * run + 4 * planes[0].word..], run * samples, rows);
        }
        for plane in planes {
            total += match plane.kind {
                PlaneKind::Byte => {
                    let mut values = [0_u8; 4 * PIXELS];
                    let values = &mut values[..count];
                    values.iter_mut().zip(rows.iter()).for_each(|(value, code)| *value = (code >> plane.shift) as u8);
                    byte_bits(values)
                }
                PlaneKind::Depth | PlaneKind::FloatDepth => {
                    let mut values = [0_u32; 4 * PIXELS];
                    let values = &mut values[..count];
                    let mask = mask(plane.bits);
                    values.iter_mut().zip(rows.iter()).for_each(|(value, code)| *value = code >> plane.shift & mask);
                    depth_bits(&layout, plane, values)
                }
            };
        }
    }
    total
}

/// The words of one sample in rows of eight; `quad` words lie from one quad to the next.
#[inline(always)]
fn in_rows(codes: &[u32], quad: usize, rows: &mut [u32]) {
    for (y, rows) in rows.chunks_exact_mut(16).enumerate() {
        for x in 0..4 {
            let pixels = &codes[(4 * y + x) * quad..][..4];
            rows[2 * x..2 * x + 2].copy_from_slice(&pixels[..2]);
            rows[8 + 2 * x..8 + 2 * x + 2].copy_from_slice(&pixels[2..]);
        }
    }
}

/// The smallest form of a plane whose values take `bits` each and differ, with its tag.
#[inline(always)]
fn smallest(bits: u32, count: usize, near: u64, flat: u64) -> u64 {
    u64::from(TAG) + (u64::from(bits) * count as u64).min(near).min(flat)
}

/// Bits of a plane of bytes. All is done on bytes, 32 of them in a vector.
#[inline(always)]
fn byte_bits(values: &[u8]) -> u64 {
    let first = values[0];
    if values.iter().fold(0, |all, value| all | (value ^ first)) == 0 {
        return u64::from(TAG + 8);
    }
    let mut near = 0;
    let mut group = |left_over: &[u8; PIXELS]| near += group_bits(left_over);
    let (pixels, further) = values.split_first_chunk::<PIXELS>().expect("a block has `PIXELS` pixels");
    // What is left, above, and both of number `i` is 1, 8 and 9 places before it. Beyond the block's edges stand zeros, of which the median
    // makes what the edges need: left alone, above alone, or nothing.
    let mut padded = [0_u8; 9 + PIXELS];
    padded[9..].copy_from_slice(pixels);
    let mut left_over = [0; PIXELS];
    for i in 0..PIXELS {
        let inner = if i % 8 == 0 { 0 } else { 0xFF };
        let (left, above, diagonal) = (padded[i + 8] & inner, padded[i + 1], padded[i] & inner);
        left_over[i] = fold_byte(pixels[i].wrapping_sub(median_byte(left, above, diagonal)));
    }
    group(&left_over);
    // A further sample is predicted by the one before it.
    for (before, after) in values.chunks_exact(PIXELS).zip(further.chunks_exact(PIXELS)) {
        for i in 0..PIXELS {
            left_over[i] = fold_byte(after[i].wrapping_sub(before[i]));
        }
        group(&left_over);
    }
    smallest(8, values.len(), near, u64::MAX)
}

/// [`median`] of bytes.
#[inline(always)]
fn median_byte(left: u8, above: u8, diagonal: u8) -> u8 {
    let (low, high) = (left.min(above), left.max(above));
    let between = left.wrapping_add(above).wrapping_sub(diagonal);
    let inside = if diagonal <= low { high } else { between };
    if diagonal >= high { low } else { inside }
}

/// [`fold`] of a byte.
#[inline(always)]
fn fold_byte(difference: u8) -> u8 {
    let sign = if (difference as i8) < 0 { 0xFF } else { 0 };
    difference.wrapping_add(difference) ^ sign
}

/// Bits of the groups of a block, each with the width of its greatest number.
#[inline(always)]
fn group_bits(left_over: &[u8; PIXELS]) -> u64 {
    const GROUPS: usize = PIXELS / GROUP;
    let mut groups = [0_u32; GROUPS];
    for (group, four) in groups.iter_mut().zip(left_over.as_chunks::<GROUP>().0) {
        let four = u32::from_le_bytes(*four);
        let two = four | four >> 16;
        let all = (two | two >> 8) & 0xFF;
        // As many ones as the number has bits.
        let ones = all | all >> 1;
        let ones = ones | ones >> 2;
        *group = ones | ones >> 4;
    }
    let widths: u32 = (0..GROUPS / 4)
        .map(|i| (groups[i] | groups[4 + i] << 8 | groups[8 + i] << 16 | groups[12 + i] << 24).count_ones())
        .sum();
    (WIDTH as usize * GROUPS + GROUP * widths as usize) as u64
}

/// Bits of a plane of depths.
#[inline(always)]
fn depth_bits(layout: &Layout, plane: &Plane, values: &[u32]) -> u64 {
    let first = values[0];
    if values.iter().fold(0, |all, value| all | (value ^ first)) == 0 {
        return u64::from(TAG + plane.bits);
    }
    smallest(plane.bits, values.len(), near_bits(plane.bits, values), flat_bits(layout, plane, values))
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
