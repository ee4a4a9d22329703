//! Quads on their way to a batch of fragments.

use fearless_simd::{prelude::*, u8x16, u16x8, u32x4};
use gfx::interpolate::Site;
use gfx::setup::Triangle;
use gfx::simd::Simd;
use num::QUADS;

/// Room for the quads of a batch, and for as many behind them: sixteen are stored at once ([`Pending::push_block_wide`]).
const ROOM: usize = 2 * QUADS;

/// Numbers of the bits of a byte, side by side, a byte each.
static ORDER: [u64; 256] = {
    let mut order = [0; 256];
    let mut byte = 0;
    while byte < 256 {
        let (mut bit, mut n) = (0, 0);
        while bit < 8 {
            if byte >> bit & 1 == 1 {
                order[byte] |= bit << (8 * n);
                n += 1;
            }
            bit += 1;
        }
        byte += 1;
    }
    order
};

/// Quads that wait to be shaded, in API order.
#[derive(Default)]
pub struct Pending {
    /// Number of quads.
    pub(super) n: usize,
    pub(super) sites: [Site; ROOM],
    /// Place of each in the tile.
    pub(super) at: [u32; ROOM],
    /// Samples covered by geometry, scissor and sample mask.
    pub(super) coverage: [u16; ROOM],
    /// Samples that passed early tests.
    pub(super) alive: [u16; ROOM],
    /// Pixels with such a sample, a lane each.
    pub(super) active: u64,
    /// Sample of each, where the program runs once per sample.
    pub(super) sample: [u8; QUADS],
    /// Place of each among the recorded quads.
    pub(super) record: [u32; ROOM],
    /// Bit a quad: of a back face.
    pub(super) back: u16,
    /// Number of triangles that the quads belong to.
    pub(super) owners: usize,
    /// Batch and number there of each.
    pub(super) names: [(u32, u32); QUADS],
    /// One past the last quad of each.
    pub(super) ends: [u8; QUADS],
    /// Copies of them, where the draw needs more than names: batches span lists.
    pub(super) triangles: Vec<Triangle>,
}

/// A quad of one sample, where the program runs once per sample, or of all.
pub struct PendingQuad {
    /// Its first pixel.
    pub place: [u16; 2],
    /// Its place in the tile.
    pub at: u32,
    /// Samples covered by geometry, scissor and sample mask.
    pub coverage: u16,
    /// Samples that passed early tests.
    pub alive: u16,
    /// The sample, where the program runs once per sample.
    pub sample: u8,
    /// Its place among the recorded quads.
    pub record: u32,
}

impl Pending {
    /// Empties it.
    pub fn clear(&mut self) {
        self.n = 0;
        self.active = 0;
        self.back = 0;
        self.owners = 0;
        self.triangles.clear();
    }

    /// Adds a triangle and returns its place. A quad of it follows.
    #[inline(always)]
    pub fn add_triangle(&mut self, batch: u32, number: u32) -> u32 {
        let slot = self.owners;
        self.names[slot & (QUADS - 1)] = (batch, number);
        self.owners = slot + 1;
        slot as u32
    }

    /// Adds the data of the last triangle; of every one, or of none.
    #[inline(always)]
    pub fn add_data(&mut self, triangle: Triangle) {
        self.triangles.push(triangle);
    }

    /// Whether there is no room for another quad.
    #[inline(always)]
    pub fn is_full(&self) -> bool {
        self.n == QUADS
    }

    /// Adds quads of a block with one sample per pixel, as many as there is room for: those with a bit in `left`, which holds bit
    /// `4 q` for quad q. `at` is the place of the block's first quad in the tile. Returns those for which there was no room.
    ///
    /// With `RECORD`, `quads` are the quads of the block in the same form, the first of which is recorded at `record`.
    #[inline(always)]
    pub fn push_block<const RECORD: bool>(
        &mut self,
        slot: u32,
        ([x, y], at): ([u16; 2], u32),
        (quads, record): (u64, u32),
        [coverage, alive]: [u64; 2],
        mut left: u64,
        front: bool,
    ) -> u64 {
        let (mut n, mut active) = (self.n, self.active);
        while left != 0 && n < QUADS {
            let bit = left.trailing_zeros();
            left &= left - 1;
            let q = bit / 4;
            self.sites[n] = Site { triangle: slot, x: x + (2 * (q % 4)) as u16, y: y + (2 * (q / 4)) as u16 };
            self.at[n] = at + q;
            if RECORD {
                self.record[n] = record + (quads & ((1 << bit) - 1)).count_ones();
            }
            self.coverage[n] = (coverage >> bit & 15) as u16;
            let alive = alive >> bit & 15;
            self.alive[n] = alive as u16;
            active |= alive << (4 * n);
            n += 1;
        }
        self.active = active;
        if !front {
            self.back |= ((1_u32 << n) - (1_u32 << self.n)) as u16;
        }
        self.ends[slot as usize & (QUADS - 1)] = n as u8;
        self.n = n;
        left
    }

    /// [`Pending::push_block`], all quads at once. Without `pdep` and `pext`: on AMD's processors before Zen 3 these take hundreds of
    /// cycles where a block is covered whole.
    #[inline(always)]
    pub fn push_block_wide<const RECORD: bool, V: Simd>(
        &mut self,
        simd: V,
        slot: u32,
        ([x, y], at): ([u16; 2], u32),
        (quads, record): (u64, u32),
        [coverage, alive]: [u64; 2],
        left: u64,
        front: bool,
    ) -> u64 {
        let n = self.n & (QUADS - 1);
        let room = (QUADS - n) as u32;
        // A byte per quad: its four bits.
        let bytes = |of: u64| {
            let of = u8x16::simd_from(simd, bytemuck::cast::<[u64; 2], [u8; 16]>([of.to_le(), (of >> 4).to_le()]));
            let low = of & 15;
            low.zip_low(low.slide::<8>(low))
        };
        // Numbers of the quads, side by side: those of the block's first half, then those of the second.
        let mask = !bytes(left).simd_eq(0).to_bitmask() as u32;
        let (first, second) = (mask & 255, mask >> 8 & 255);
        let (first, second) = ((ORDER[first as usize], first.count_ones()), (ORDER[second as usize], second.count_ones()));
        let numbers = u128::from(first.0) | u128::from(second.0 | 0x0808_0808_0808_0808) << (8 * first.1);
        let taken = (first.1 + second.1).min(room);
        // The first for which there is no room.
        let left = if taken < first.1 + second.1 { left & (u64::MAX << (4 * (numbers >> (8 * taken) & 15))) } else { 0 };
        let numbers = u8x16::simd_from(simd, numbers.to_le_bytes());
        // What is written beyond the ends does not count.
        let (sites, places, coverages, lives, records) = (
            &mut self.sites[n..n + QUADS],
            &mut self.at[n..n + QUADS],
            &mut self.coverage[n..n + QUADS],
            &mut self.alive[n..n + QUADS],
            &mut self.record[n..n + QUADS],
        );
        // Four quads at a time: their sites, and words that count from a first one.
        let sites: &mut [[u32; 4]] = bytemuck::cast_slice_mut(sites);
        let slots = u32x4::splat(simd, slot);
        let (low, high) = numbers.widen();
        for (half, numbers) in [low, high].into_iter().enumerate() {
            let xs = (numbers << 1 & 6) + x;
            let ys = (numbers >> 1 & 6) + y;
            for (part, xy) in [xs.zip_low(ys), xs.zip_high(ys)].into_iter().enumerate() {
                let xy: u32x4<V> = xy.bitcast();
                let first = 4 * half + 2 * part;
                slots.zip_low(xy).store_slice(&mut sites[first]);
                slots.zip_high(xy).store_slice(&mut sites[first + 1]);
            }
        }
        let words = |first: u32, bytes: u8x16<V>, out: &mut [u32]| {
            let (low, high) = bytes.widen();
            let ([a, b], [c, d]) = (<[u32x4<V>; 2]>::from(low.widen()), <[u32x4<V>; 2]>::from(high.widen()));
            for (out, words) in out.as_chunks_mut::<4>().0.iter_mut().zip([a, b, c, d]) {
                (words + first).store_slice(out);
            }
        };
        words(at, numbers, places);
        if RECORD {
            // How many quads of the block are before each: nibbles, in which sums of all before them do not overflow.
            let before = quads.wrapping_mul(0x1111_1111_1111_1110);
            words(record, bytes(before).swizzle_dyn(numbers), records);
        }
        let (coverage, alive) = (bytes(coverage).swizzle_dyn(numbers), bytes(alive).swizzle_dyn(numbers));
        for (of, out) in [(coverage, coverages), (alive, lives)] {
            let (low, high) = of.widen();
            low.store_slice(&mut out[..8]);
            high.store_slice(&mut out[8..]);
        }
        let pairs: u16x8<V> = alive.bitcast();
        let lanes: [u8; 16] = (pairs | pairs >> 4).narrow(pairs).into();
        let [lanes, _]: [u64; 2] = bytemuck::cast(lanes);
        self.active |= (u64::from_le(lanes) & u64::MAX.unbounded_shr(64 - 4 * taken)) << (4 * n);
        let end = n + taken as usize;
        if !front {
            self.back |= ((1_u32 << end) - (1_u32 << n)) as u16;
        }
        self.ends[slot as usize & (QUADS - 1)] = end as u8;
        self.n = end;
        left
    }

    /// Places of the quads in the tile.
    #[inline(always)]
    pub fn places(&self) -> &[u32; QUADS] {
        self.at.first_chunk().expect("room for a batch")
    }

    /// Samples of the quads that passed early tests.
    #[inline(always)]
    pub fn passed(&self) -> &[u16; QUADS] {
        self.alive.first_chunk().expect("room for a batch")
    }

    /// Adds a quad if any of it is `alive`, without a branch. There is room. `same`: it is of the last triangle that was added;
    /// else the one named is added. Returns whether it was.
    #[inline(always)]
    pub fn push_if_alive(
        &mut self,
        same: bool,
        name: (u32, u32),
        [x, y]: [u16; 2],
        at: u32,
        coverage: u32,
        alive: u32,
        front: bool,
    ) -> bool {
        let n = self.n & (QUADS - 1);
        let slot = (self.owners - usize::from(same)) & (QUADS - 1);
        let some = alive != 0;
        // What is written beyond the ends does not count.
        self.names[slot] = name;
        self.ends[slot] = (n + usize::from(some)) as u8;
        self.sites[n] = Site { triangle: slot as u32, x, y };
        self.at[n] = at;
        self.coverage[n] = coverage as u16;
        self.alive[n] = alive as u16;
        self.active |= u64::from(alive) << (4 * n);
        self.back |= u16::from(some & !front) << n;
        self.owners = slot + usize::from(some | same);
        self.n = n + usize::from(some);
        some
    }

    /// Adds a quad of the triangle in a slot. There is room.
    #[inline(always)]
    pub fn push(&mut self, slot: u32, front: bool, quad: PendingQuad) {
        let PendingQuad { place: [x, y], at, coverage, alive, sample, record } = quad;
        let n = self.n & (QUADS - 1);
        self.sites[n] = Site { triangle: slot, x, y };
        self.at[n] = at;
        self.coverage[n] = coverage;
        self.alive[n] = alive;
        self.active |= pixels(alive) << (4 * n);
        self.sample[n] = sample;
        self.record[n] = record;
        self.back |= u16::from(!front) << n;
        self.ends[slot as usize & (QUADS - 1)] = n as u8 + 1;
        self.n = n + 1;
    }
}

/// The pixels of a quad's coverage.
#[inline(always)]
pub(super) fn pixels(coverage: u16) -> u64 {
    u64::from((coverage | coverage >> 4 | coverage >> 8 | coverage >> 12) & 15)
}

/// The pixels of quads' coverages as a lane mask.
#[inline(always)]
pub(super) fn lanes(coverage: &[u16]) -> u64 {
    coverage.iter().enumerate().fold(0, |all, (q, &c)| all | pixels(c) << (4 * q))
}

/// The coverages of quads with one sample per pixel, from a lane mask.
#[inline(always)]
pub(super) fn quads(lanes: u64) -> [u16; QUADS] {
    // Four at a time: what the compiler makes of sixteen shifts takes twice the instructions.
    let four = |first: u32| {
        let bits = lanes >> first & 0xffff;
        let two = (bits | bits << 24) & 0x0000_00ff_0000_00ff;
        ((two | two << 12) & 0x000f_000f_000f_000f).to_le()
    };
    bytemuck::cast::<[u64; 4], [u16; QUADS]>([0, 16, 32, 48].map(four)).map(u16::from_le)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gfx::simd::dispatch;
    use num::Random;

    #[test]
    fn coverages_of_quads_are_the_parts_of_a_lane_mask() {
        let mut random = Random::new(5);
        for _ in 0..1000 {
            let mask = u64::from(random.bits()) << 32 | u64::from(random.bits());
            let quads = quads(mask);
            assert_eq!(quads, std::array::from_fn(|q| (mask >> (4 * q) & 15) as u16));
            assert_eq!(lanes(&quads), mask);
        }
    }

    #[test]
    fn blocks_are_added_at_once_as_quad_by_quad() {
        dispatch!(simd => compare(simd));
        compare(gfx::simd::base());
    }

    fn compare<V: Simd>(simd: V) {
        let mut random = Random::new(7);
        for _ in 0..20_000 {
            let (mut one, mut all) = (Pending::default(), Pending::default());
            while !one.is_full() {
                let mut bits = || u64::from(random.bits()) << 32 | u64::from(random.bits());
                let coverage = match bits() % 4 {
                    0 => u64::MAX,
                    1 => bits() & bits() & bits(),
                    _ => bits(),
                };
                let alive = coverage & if bits() % 2 == 0 { u64::MAX } else { bits() };
                let spread = |mask: u64| (mask | mask >> 1 | mask >> 2 | mask >> 3) & 0x1111_1111_1111_1111;
                let quads = spread(alive);
                let (place, at) = ([8 * (bits() % 2048) as u16, 8 * (bits() % 2048) as u16], 16 * (bits() % 64) as u32);
                let front = bits() % 2 == 0;
                if quads == 0 {
                    continue;
                }
                let slot = one.add_triangle(0, 0);
                assert_eq!(all.add_triangle(0, 0), slot);
                let record = (spread(coverage), bits() as u32 / 2);
                let left = one.push_block::<true>(slot, (place, at), record, [coverage, alive], quads, front);
                let also = all.push_block_wide::<true, _>(simd, slot, (place, at), record, [coverage, alive], quads, front);
                assert_eq!((left, one.n, one.active, one.back, one.ends), (also, all.n, all.active, all.back, all.ends));
                assert_eq!(one.sites[..one.n], all.sites[..one.n]);
                assert_eq!(one.at[..one.n], all.at[..one.n]);
                assert_eq!(one.record[..one.n], all.record[..one.n]);
                assert_eq!(one.coverage[..one.n], all.coverage[..one.n]);
                assert_eq!(one.alive[..one.n], all.alive[..one.n]);
            }
        }
    }
}
