//! Quads on their way to a batch of fragments.

use gfx::interpolate::Site;
use gfx::setup::Triangle;
use num::QUADS;

/// Room for the quads of a batch, and for as many behind them: sixteen are stored at once ([`Pending::push_block_wide`]).
const ROOM: usize = 2 * QUADS;

/// Numbers of the bits of a byte, side by side, a byte each.
#[cfg(target_arch = "x86_64")]
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
        [x, y]: [u16; 2],
        at: u32,
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
    ///
    /// # Safety
    /// The host has the instruction sets.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
    #[inline]
    pub fn push_block_wide<const RECORD: bool>(
        &mut self,
        slot: u32,
        [x, y]: [u16; 2],
        at: u32,
        (quads, record): (u64, u32),
        [coverage, alive]: [u64; 2],
        left: u64,
        front: bool,
    ) -> u64 {
        use std::arch::x86_64::*;
        let n = self.n & (QUADS - 1);
        let room = (QUADS - n) as u32;
        // A byte per quad: its four bits.
        let bytes = |of: u64| {
            let (of, low) = (_mm_cvtsi64_si128(of as i64), _mm_set1_epi8(15));
            _mm_unpacklo_epi8(_mm_and_si128(of, low), _mm_and_si128(_mm_srli_epi16::<4>(of), low))
        };
        // Numbers of the quads, side by side: those of the block's first half, then those of the second.
        let mask = _mm_movemask_epi8(_mm_cmpgt_epi8(bytes(left), _mm_setzero_si128())) as u32;
        let (first, second) = (mask & 255, mask >> 8 & 255);
        let (first, second) = ((ORDER[first as usize], first.count_ones()), (ORDER[second as usize], second.count_ones()));
        let numbers = u128::from(first.0) | u128::from(second.0 | 0x0808_0808_0808_0808) << (8 * first.1);
        let taken = (first.1 + second.1).min(room);
        // The first for which there is no room.
        let left = if taken < first.1 + second.1 { left & (u64::MAX << (4 * (numbers >> (8 * taken) & 15))) } else { 0 };
        let numbers = _mm_set_epi64x((numbers >> 64) as i64, numbers as i64);
        let wide = _mm256_cvtepu8_epi16(numbers);
        let six = _mm256_set1_epi16(6);
        let xs = _mm256_add_epi16(_mm256_set1_epi16(x as i16), _mm256_and_si256(_mm256_slli_epi16::<1>(wide), six));
        let ys = _mm256_add_epi16(_mm256_set1_epi16(y as i16), _mm256_and_si256(_mm256_srli_epi16::<1>(wide), six));
        // Places of quads 0 to 3 and 8 to 11, then of 4 to 7 and 12 to 15, each behind its triangle.
        let slots = _mm256_set1_epi32(slot as i32);
        let (first, second) = (_mm256_unpacklo_epi16(xs, ys), _mm256_unpackhi_epi16(xs, ys));
        let (a, b) = (_mm256_unpacklo_epi32(slots, first), _mm256_unpackhi_epi32(slots, first));
        let (c, d) = (_mm256_unpacklo_epi32(slots, second), _mm256_unpackhi_epi32(slots, second));
        let sites: [Site; QUADS] = bytemuck::cast([
            _mm256_permute2x128_si256::<0x20>(a, b),
            _mm256_permute2x128_si256::<0x20>(c, d),
            _mm256_permute2x128_si256::<0x31>(a, b),
            _mm256_permute2x128_si256::<0x31>(c, d),
        ]);
        let from = |first: u32, bytes: __m128i| -> [u32; QUADS] {
            let first = _mm256_set1_epi32(first as i32);
            bytemuck::cast([
                _mm256_add_epi32(first, _mm256_cvtepu8_epi32(bytes)),
                _mm256_add_epi32(first, _mm256_cvtepu8_epi32(_mm_srli_si128::<8>(bytes))),
            ])
        };
        if RECORD {
            // How many quads of the block are before each.
            let quads = bytes(quads);
            let mut before = _mm_slli_si128::<1>(quads);
            before = _mm_add_epi8(before, _mm_slli_si128::<1>(before));
            before = _mm_add_epi8(before, _mm_slli_si128::<2>(before));
            before = _mm_add_epi8(before, _mm_slli_si128::<4>(before));
            before = _mm_add_epi8(before, _mm_slli_si128::<8>(before));
            self.record[n..n + QUADS].copy_from_slice(&from(record, _mm_shuffle_epi8(before, numbers)));
        }
        let (coverage, alive) = (_mm_shuffle_epi8(bytes(coverage), numbers), _mm_shuffle_epi8(bytes(alive), numbers));
        let samples = |of: __m128i| -> [u16; QUADS] { bytemuck::cast(_mm256_cvtepu8_epi16(of)) };
        // What is written beyond the ends does not count.
        self.sites[n..n + QUADS].copy_from_slice(&sites);
        self.at[n..n + QUADS].copy_from_slice(&from(at, numbers));
        self.coverage[n..n + QUADS].copy_from_slice(&samples(coverage));
        self.alive[n..n + QUADS].copy_from_slice(&samples(alive));
        let pairs = _mm_maddubs_epi16(alive, _mm_set1_epi16(0x1001));
        let lanes = _mm_cvtsi128_si64(_mm_packus_epi16(pairs, pairs)) as u64;
        self.active |= (lanes & u64::MAX.unbounded_shr(64 - 4 * taken)) << (4 * n);
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

    #[cfg(target_arch = "x86_64")]
    #[test]
    fn blocks_are_added_at_once_as_quad_by_quad() {
        if !gfx::simd::has_avx2() {
            return;
        }
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
                let left = one.push_block::<true>(slot, place, at, record, [coverage, alive], quads, front);
                // SAFETY: the host has the instruction sets.
                let also = unsafe { all.push_block_wide::<true>(slot, place, at, record, [coverage, alive], quads, front) };
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
