//! Quads on their way to a batch of fragments.

use gfx::interpolate::Site;
use gfx::setup::Triangle;
use num::QUADS;

/// Quads that wait to be shaded, in API order.
#[derive(Default)]
pub struct Pending {
    /// Number of quads.
    pub(super) n: usize,
    pub(super) sites: [Site; QUADS],
    /// Place of each in the tile.
    pub(super) at: [u32; QUADS],
    /// Samples covered by geometry, scissor and sample mask.
    pub(super) coverage: [u16; QUADS],
    /// Samples that passed early tests.
    pub(super) alive: [u16; QUADS],
    /// Pixels with such a sample, a lane each.
    pub(super) active: u64,
    /// Sample of each, where the program runs once a sample.
    pub(super) sample: [u8; QUADS],
    /// Place of each among the recorded quads.
    pub(super) record: [u32; QUADS],
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

/// A quad of one sample, where the program runs once a sample, or of all.
pub struct PendingQuad {
    /// Its first pixel.
    pub place: [u16; 2],
    /// Its place in the tile.
    pub at: u32,
    /// Samples covered by geometry, scissor and sample mask.
    pub coverage: u16,
    /// Samples that passed early tests.
    pub alive: u16,
    /// The sample, where the program runs once a sample.
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

    /// Adds quads of a block with one sample a pixel, as many as there is room for: those with a bit in `left`, which holds bit
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

    /// Adds a quad if any of it is `alive`, without a branch. There is room. `same`: it is of the last triangle that was added;
    /// else the one named is added. Returns whether it was.
    #[cfg(target_arch = "x86_64")]
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
