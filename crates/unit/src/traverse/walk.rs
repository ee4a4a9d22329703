//! How a triangle is walked: what is tested for coverage, how much of it there is, and how it takes its time where single pixels are
//! tested. What is found to be covered, and so the picture, is the same for all walks.

use super::{Territory, Traverse};
use crate::card::{Card, Work};
use num::Cycle;
use sim::{Tick, Wires};
use work::{BLOCK, Block, End, Quad, Triangle};

knob::choices! {
    /// What of a triangle is tested for coverage.
    pub enum Walk {
        /// Blocks of its bounding box, in the 64x64 tiles that it touches.
        Blocks "blocks",
        /// Rows of its bounding box, and in each row the pixels between the two edges.
        Rows "rows",
        /// Every pixel of its bounding box, cut to what may be drawn.
        Box "box",
        /// Every pixel of its uncut bounding box: those that may not be drawn here are tested and rejected.
        Reject "reject",
    }
}

/// The tests of the current triangle, where single pixels are tested. They are made at a constant rate from the cycle in which it is
/// taken in hand, also while quads wait; a block goes on when its own tests are made.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Pace {
    /// Tests per cycle.
    rate: u64,
    /// Tests of the triangle, those made so far, and those that must be made before the current block goes on.
    total: u64,
    made: u64,
    needed: u64,
    /// Whether `needed` includes the tests of the current block.
    asked: bool,
    /// The cycle up to which `made` counts, and the tests of it that no triangle has taken.
    counted: Cycle,
    left: u64,
}

impl Pace {
    /// A pace of `rate` tests per cycle.
    pub(super) fn new(rate: u32) -> Pace {
        Pace { rate: rate.into(), ..Pace::default() }
    }

    /// A cycle begins; `active`: with a current triangle, whose tests were made in the cycles since the last, too.
    pub(super) fn cycle(&mut self, now: Cycle, active: bool) {
        self.left = self.rate;
        if active {
            let slept = now.saturating_sub(self.counted + 1);
            self.made = self.total.min(self.made.saturating_add(slept.saturating_mul(self.rate)));
            self.take();
        }
        self.counted = now;
    }

    /// A triangle of `total` tests begins.
    fn begin(&mut self, total: u64) {
        (self.total, self.made, self.needed, self.asked) = (total, 0, 0, false);
        self.take();
    }

    /// Tests of this cycle go to the current triangle.
    fn take(&mut self) {
        let taken = self.left.min(self.total - self.made);
        self.made += taken;
        self.left -= taken;
    }

    /// Whether the `tests` tests of the current block are made.
    pub(super) fn reached(&mut self, tests: u64) -> bool {
        if !self.asked {
            self.asked = true;
            self.needed += tests;
        }
        self.made >= self.needed
    }

    /// The current block goes on.
    pub(super) fn next_block(&mut self) {
        self.asked = false;
    }

    /// Whether all tests are made. From now on no test is asked for but the last.
    pub(super) fn ends(&mut self) -> bool {
        self.needed = self.total;
        self.made == self.total
    }

    /// Waits for the tests asked for.
    pub(super) fn wait(&self, wires: &mut Wires, moved: bool) -> Tick {
        wires.sleep_until(self.counted + (self.needed - self.made).div_ceil(self.rate.max(1)));
        Tick::moved_or(moved, Tick::Working)
    }
}

/// Pixels of a block inside of pixel bounds.
fn inside(x: u32, y: u32, [x0, y0, x1, y1]: [u32; 4]) -> u32 {
    let length = |at: u32, low: u32, high: u32| ((at + 1) * BLOCK).min(high).saturating_sub((at * BLOCK).max(low));
    length(x, x0, x1) * length(y, y0, y1)
}

/// Pixels with a covered sample: quads that are one sample each of the same pixels count once.
fn covered(quads: &[Quad]) -> u64 {
    let same = |run: &[Quad]| crate::token::fragments(run.iter().fold(0, |all, quad| all | quad.coverage));
    quads.chunk_by(|a, b| a.position == b.position).map(|run| u64::from(same(run))).sum()
}

impl Traverse {
    /// Takes the tests of a triangle in hand, where single pixels are tested.
    pub(super) fn begin_walk(&mut self, card: &Card, work: &Work, triangle: &Triangle) {
        let tests = match self.config.walk {
            Walk::Blocks => return,
            Walk::Rows => {
                let pixels = if triangle.end == End::Nowhere { self.covered_pixels(card, work, triangle) } else { 0 };
                self.own_box(card, triangle)[1] + pixels
            }
            Walk::Box => self.own_box(card, triangle)[0],
            Walk::Reject => triangle.unclipped,
        };
        self.pace.begin(tests.max(1));
        self.counts.tested += tests.max(1);
    }

    /// Tests of a covered block.
    pub(super) fn tests_of(&self, triangle: &Triangle, block: &Block, quads: &[Quad]) -> u64 {
        match self.config.walk {
            Walk::Blocks => 0,
            Walk::Rows => covered(quads),
            Walk::Box | Walk::Reject => inside(block.x.into(), block.y.into(), triangle.pixels.map(u32::from)).into(),
        }
    }

    /// Pixels of a triangle's bounding box that are its rasteriser's own, and rows in which it has some.
    fn own_box(&self, card: &Card, triangle: &Triangle) -> [u64; 2] {
        let [mut x0, mut y0, mut x1, mut y1] = triangle.pixels.map(u32::from);
        match self.territory {
            Territory::Bins(side) => {
                let across = card.passes.current().map_or(1, |pass| pass.blocks_across).div_ceil(side);
                let side = side * BLOCK;
                let (x, y) = (self.place.sequence % across * side, self.place.sequence / across * side);
                (x0, y0, x1, y1) = (x0.max(x), y0.max(y), x1.min(x + side), y1.min(y + side));
            }
            _ if card.groups.len() > 1 && (self.territory == Territory::Tiles || self.place.shared) => {
                let own = |x: u32, y: u32| self.enters(card.interleave.owner(x, y));
                let bounds = [x0, y0, x1, y1];
                let mut sum = [0; 2];
                for y in y0 / BLOCK..y1.div_ceil(BLOCK) {
                    let blocks = (x0 / BLOCK..x1.div_ceil(BLOCK)).filter(|&x| own(x, y));
                    let pixels = blocks.map(|x| u64::from(inside(x, y, bounds))).sum::<u64>();
                    let rows = ((y + 1) * BLOCK).min(y1).saturating_sub((y * BLOCK).max(y0));
                    sum[0] += pixels;
                    sum[1] += if pixels > 0 { u64::from(rows) } else { 0 };
                }
                return sum;
            }
            Territory::Tiles | Territory::Screen | Territory::Copy => {}
        }
        let (w, h) = (u64::from(x1.saturating_sub(x0)), u64::from(y1.saturating_sub(y0)));
        [w * h, if w > 0 { h } else { 0 }]
    }

    /// Pixels that a triangle covers and that are its rasteriser's own.
    fn covered_pixels(&self, card: &Card, work: &Work, triangle: &Triangle) -> u64 {
        let bins = matches!(self.territory, Territory::Bins(_));
        let visits = if bins { self.bin_visits(card, work, triangle) } else { work.visits(triangle) };
        let mut pixels = 0;
        for visit in visits {
            let tile = &work.segment.tiles[visit.tile as usize];
            let blocks = &tile.blocks[visit.first_block as usize..][..visit.blocks as usize];
            let whole = work.owners.get(visit.tile as usize).filter(|_| !bins);
            let mine = |block: &&Block| match whole {
                Some(&owner) => self.enters(owner),
                None => {
                    let (x, y) = (block.x.into(), block.y.into());
                    self.in_bin(card, x, y) && (bins || self.enters(card.interleave.owner(x, y)))
                }
            };
            let quads = |block: &Block| &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
            pixels += blocks.iter().filter(mine).map(|block| covered(quads(block))).sum::<u64>();
        }
        pixels
    }
}
