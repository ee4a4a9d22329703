//! The four forms of a plane of numbers.

use super::bits::{Reader, Sink};
use super::{PIXELS, Plane, PlaneKind, mask};
use crate::setup::{SAMPLES_1, SAMPLES_4};
use num::SUBPIXEL;

/// Bits of the tag that names the form.
pub(super) const TAG: u32 = 2;
const CONSTANT: u32 = 0;
const FLAT: u32 = 1;
const NEIGHBOURS: u32 = 2;
const RAW: u32 = 3;

/// Bits of a width (0 to 32) of left-overs.
pub(super) const WIDTH: u32 = 6;

/// The order of a plane's numbers: sample after sample, rows of eight.
pub(super) struct Layout {
    /// Samples of a pixel in the codes.
    samples: usize,
    /// Samples that are stored.
    stored: usize,
}

impl Layout {
    /// With `agree`, one number stands for all samples of a pixel.
    pub(super) fn new(samples: usize, agree: bool) -> Layout {
        Layout { samples, stored: if agree { 1 } else { samples } }
    }

    /// Numbers of a plane.
    pub(super) fn count(&self) -> usize {
        PIXELS * self.stored
    }

    /// Where word 0 of number `i` is among the codes.
    #[inline(always)]
    pub(super) fn index(&self, i: usize, words: usize) -> usize {
        let (sample, x, y) = (i / PIXELS, i % 8, i % PIXELS / 8);
        let (quad, pixel) = (y / 2 * 4 + x / 2, y % 2 * 2 + x % 2);
        (quad * self.samples + sample) * 4 * words + pixel
    }

    /// Where number `i` is on the screen, in pixels from the block's first number.
    #[inline(always)]
    pub(super) fn position(&self, i: usize) -> [f64; 2] {
        let offset = |s: usize| if self.samples == 4 { SAMPLES_4[s] } else { SAMPLES_1[0] };
        let (here, first) = (offset(i / PIXELS), offset(0));
        let axis = |pixel: usize, c: usize| pixel as f64 + f64::from(here[c] - first[c]) / f64::from(SUBPIXEL);
        [axis(i % 8, 0), axis(i % PIXELS / 8, 1)]
    }
}

/// A signed difference of numbers of a width as a small number: 0, -1, 1, -2, 2 become 0, 1, 2, 3, 4.
#[inline(always)]
pub(super) fn fold(difference: u32, bits: u32) -> u32 {
    let signed = ((difference << (32 - bits)) as i32) >> (32 - bits);
    ((signed << 1) ^ (signed >> 31)) as u32 & mask(bits)
}

/// The inverse of [`fold`].
#[inline(always)]
fn unfold(folded: u32, bits: u32) -> u32 {
    let magnitude = folded >> 1;
    (if folded & 1 == 0 { magnitude } else { !magnitude }) & mask(bits)
}

/// Bits that a number takes.
#[inline(always)]
pub(super) fn width(value: u32) -> u32 {
    32 - value.leading_zeros()
}

/// A flat plane through three corners of the block, in the values that are linear over a triangle.
pub(super) struct Flat {
    at: f64,
    dx: f64,
    dy: f64,
    kind: PlaneKind,
    most: f64,
}

impl Flat {
    /// The plane through the corners of the first sample's numbers; see [`Flat::new`].
    #[inline(always)]
    pub(super) fn through(plane: &Plane, values: &[u32]) -> Option<Flat> {
        Flat::new(plane, CORNERS.map(|i| values[i]))
    }

    /// None for planes without geometry, and for depths that are not numbers.
    #[inline(always)]
    fn new(plane: &Plane, corners: [u32; 3]) -> Option<Flat> {
        let value = |code: u32| match plane.kind {
            PlaneKind::FloatDepth => f64::from(f32::from_bits(code)),
            _ => f64::from(code),
        };
        let [a, b, c] = corners.map(value);
        let usable = plane.kind != PlaneKind::Byte && a.is_finite() && b.is_finite() && c.is_finite();
        let most = f64::from(mask(plane.bits));
        usable.then(|| Flat { at: a, dx: (b - a) / 7.0, dy: (c - a) / 7.0, kind: plane.kind, most })
    }

    /// The code that the plane predicts at a place.
    #[inline(always)]
    pub(super) fn predict(&self, [x, y]: [f64; 2]) -> u32 {
        let value = self.at + self.dx * x + self.dy * y;
        match self.kind {
            PlaneKind::FloatDepth => (value as f32).to_bits(),
            _ => (value + 0.5).clamp(0.0, self.most) as u32,
        }
    }
}

/// Numbers of the corners that a flat plane goes through.
const CORNERS: [usize; 3] = [0, 7, 56];

/// What the neighbours of number `i` say it is: the median of left, above, and left + above - diagonal.
#[inline(always)]
fn predict(values: &[u32], i: usize, bits: u32) -> u32 {
    let (x, row) = (i % 8, i % PIXELS / 8);
    if i >= PIXELS {
        // A further sample is predicted by the one before it.
        return values[i - PIXELS];
    }
    match (x, row) {
        (0, 0) => 0,
        (_, 0) => values[i - 1],
        (0, _) => values[i - 8],
        _ => median(values[i - 1], values[i - 8], values[i - 9], bits),
    }
}

/// The median of left, above, and left + above - diagonal.
#[inline(always)]
pub(super) fn median(left: u32, above: u32, diagonal: u32, bits: u32) -> u32 {
    let (low, high) = (left.min(above), left.max(above));
    if diagonal >= high {
        low
    } else if diagonal <= low {
        high
    } else {
        left.wrapping_add(above).wrapping_sub(diagonal) & mask(bits)
    }
}

/// The four left-overs of half a row share a width.
pub(super) const GROUP: usize = 4;

/// Writes a plane in its smallest form.
pub(super) fn write_plane(layout: &Layout, plane: &Plane, values: &[u32], sink: &mut impl Sink) {
    let bits = plane.bits;
    let raw = bits as usize * values.len();
    if values.iter().all(|v| *v == values[0]) {
        sink.put(CONSTANT, TAG);
        sink.put(values[0], bits);
        return;
    }
    let mut near = [0_u32; 4 * PIXELS];
    let mut near_bits = 0;
    for first in (0..values.len()).step_by(GROUP) {
        let mut all = 0;
        for i in first..first + GROUP {
            near[i] = fold(values[i].wrapping_sub(predict(values, i, bits)), bits);
            all |= near[i];
        }
        near_bits += (WIDTH + GROUP as u32 * width(all)) as usize;
    }
    let mut flat = [0_u32; 4 * PIXELS];
    let mut flat_width = 0;
    let mut flat_bits = usize::MAX;
    if let Some(through) = Flat::through(plane, values) {
        let mut all = 0;
        for (i, value) in values.iter().enumerate() {
            flat[i] = fold(value.wrapping_sub(through.predict(layout.position(i))), bits);
            all |= flat[i];
        }
        flat_width = width(all);
        flat_bits = (3 * bits + WIDTH) as usize + flat_width as usize * values.len();
    }
    if flat_bits <= near_bits && flat_bits < raw {
        sink.put(FLAT, TAG);
        CORNERS.iter().for_each(|i| sink.put(values[*i], bits));
        sink.put(flat_width, WIDTH);
        flat[..values.len()].iter().for_each(|v| sink.put(*v, flat_width));
    } else if near_bits < raw {
        sink.put(NEIGHBOURS, TAG);
        for group in near[..values.len()].chunks_exact(GROUP) {
            let group_width = width(group.iter().fold(0, |all, v| all | v));
            sink.put(group_width, WIDTH);
            group.iter().for_each(|v| sink.put(*v, group_width));
        }
    } else {
        sink.put(RAW, TAG);
        values.iter().for_each(|v| sink.put(*v, bits));
    }
}

/// Reads a plane; none if the bits are not one.
pub(super) fn read_plane(layout: &Layout, plane: &Plane, reader: &mut Reader<'_>, values: &mut [u32]) -> Option<()> {
    let bits = plane.bits;
    match reader.get(TAG)? {
        CONSTANT => values.fill(reader.get(bits)?),
        FLAT => {
            let corners = [reader.get(bits)?, reader.get(bits)?, reader.get(bits)?];
            let through = Flat::new(plane, corners)?;
            let width = reader.get(WIDTH)?.min(32);
            for (i, value) in values.iter_mut().enumerate() {
                let left_over = unfold(reader.get(width)?, bits);
                *value = through.predict(layout.position(i)).wrapping_add(left_over) & mask(bits);
            }
        }
        NEIGHBOURS => {
            for first in (0..values.len()).step_by(GROUP) {
                let width = reader.get(WIDTH)?.min(32);
                for i in first..first + GROUP {
                    let left_over = unfold(reader.get(width)?, bits);
                    values[i] = predict(values, i, bits).wrapping_add(left_over) & mask(bits);
                }
            }
        }
        _ => {
            for value in values.iter_mut() {
                *value = reader.get(bits)?;
            }
        }
    }
    Some(())
}
