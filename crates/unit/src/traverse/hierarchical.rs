//! The hierarchical Z buffer, and the small cache before it that a card may have.

use gfx::hierarchical::{culls, depth_key};
use gfx::rop::DepthStencilState;
use num::Cycle;
use work::{BLOCK, Quad, Triangle};

use super::super::card::Work;
use super::super::depths::sample_depths;

/// Blocks along the edge of the square whose bounds are a line of the cache: 16 of them, which follow one another in ATTILA's
/// order of addresses (HZCacheLineSize = 16).
const SQUARE: u32 = 4;

/// Bounds on the stored depths of a block, as ordered keys.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Bounds {
    pub min: u32,
    pub max: u32,
}

impl Bounds {
    /// Bounds of depths of which nothing is known.
    pub const NONE: Bounds = Bounds { min: 0, max: u32::MAX };
}

/// The hierarchical Z buffer: a bound each way, kept while the writes of the pass cannot break it.
#[derive(Clone, Debug, Default)]
pub(super) struct HierarchicalZ {
    pub bounds: Vec<Bounds>,
    /// Whether no write of this pass can have raised a depth above `max`, or lowered it below `min`.
    pub max_valid: bool,
    pub min_valid: bool,
    /// Bounds on what a block holds once all that went through here is tested, where blocks are accepted; else none. Only the
    /// beginning of a pass narrows them.
    pub outer: Vec<Bounds>,
    /// The cache, where there is one.
    pub lines: Lines,
}

impl HierarchicalZ {
    /// The bounds that are certain of a block that was looked up as `bounds`.
    #[inline(always)]
    fn certain(&self, bounds: Bounds) -> Bounds {
        Bounds { min: if self.min_valid { bounds.min } else { 0 }, max: if self.max_valid { bounds.max } else { u32::MAX } }
    }

    /// Whether the bounds of a block prove that all of a triangle in it is hidden.
    #[inline(always)]
    pub fn hides(&self, bounds: Bounds, state: &DepthStencilState, work: &Work, triangle: &Triangle, at: (u32, u32)) -> bool {
        let (low, high) = triangle.depth.block_range((at.0 * BLOCK) as i32, (at.1 * BLOCK) as i32, BLOCK as i32);
        let key = |depth: f32| depth_key(work.depth_format, state.code(depth));
        let Bounds { min, max } = self.certain(bounds);
        culls(state.compare(), key(low), key(high), min, max)
    }

    /// The quads of a block that are hidden, a bit each, by the depths of their covered samples.
    pub fn hides_quads(
        &self,
        bounds: Bounds,
        state: &DepthStencilState,
        work: &Work,
        triangle: &Triangle,
        at: (u32, u32),
        samples: u32,
        quads: &[Quad],
    ) -> u64 {
        let Bounds { min, max } = self.certain(bounds);
        let mut hidden = 0;
        for (n, quad) in quads.iter().enumerate() {
            let mut codes = [[0_u32; 4]; 4];
            let (x, y) = (at.0 * BLOCK + u32::from(quad.position) % 4 * 2, at.1 * BLOCK + u32::from(quad.position) / 4 * 2);
            sample_depths(state, triangle, x as i32, y as i32, samples as usize, &mut codes);
            let (mut low, mut high) = (u32::MAX, 0);
            for (sample, codes) in codes[..samples as usize].iter().enumerate() {
                for (pixel, &code) in codes.iter().enumerate() {
                    if quad.coverage >> (4 * sample + pixel) & 1 != 0 {
                        let key = depth_key(work.depth_format, code);
                        (low, high) = (low.min(key), high.max(key));
                    }
                }
            }
            hidden |= u64::from(culls(state.compare(), low, high, min, max)) << n;
        }
        hidden
    }
}

stats::counters! {
    /// What the cache of the hierarchical Z buffer counts, where there is one.
    pub struct LineCounts {
        /// Lookups of blocks.
        lookups: "blocks",
        /// Lines read from the buffer.
        reads: "lines",
        /// Lookups in a line that has not been read anew since the buffer learnt of a block in it.
        stale: "blocks",
    }
}

/// A line: bounds as they were when it was read.
#[derive(Clone, Debug)]
struct Line {
    square: u32,
    bounds: [Bounds; (SQUARE * SQUARE) as usize],
    /// It is held until its bounds have come.
    held_until: Cycle,
}

/// A cache of lines of the buffer. A line that has been read stays as it is, whatever the buffer learns, until it is replaced: the
/// first line is for which no request waits.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    lines: Vec<Line>,
    capacity: usize,
    pub counts: LineCounts,
}

impl Lines {
    /// An empty cache of `capacity` lines. With a capacity of 0, lookups go to the buffer itself.
    pub fn new(capacity: u32) -> Lines {
        Lines { lines: Vec::with_capacity(capacity as usize), capacity: capacity as usize, counts: LineCounts::default() }
    }

    /// Forgets all lines.
    pub fn clear(&mut self) {
        self.lines.clear();
    }

    /// The bounds that are known of a block of a surface `across` blocks wide. A line that is missing is held for `latency` cycles. (The
    /// queue of quads before the test hides that time.)
    #[inline(always)]
    pub fn look_up(&mut self, buffer: &[Bounds], number: u32, across: u32, now: Cycle, latency: Cycle) -> Bounds {
        if self.capacity == 0 {
            return buffer[number as usize];
        }
        self.find(buffer, number, across, now, latency)
    }

    #[inline(never)]
    fn find(&mut self, buffer: &[Bounds], number: u32, across: u32, now: Cycle, latency: Cycle) -> Bounds {
        let (x, y) = (number % across, number / across);
        let square = y / SQUARE * across.div_ceil(SQUARE) + x / SQUARE;
        let inside = (y % SQUARE * SQUARE + x % SQUARE) as usize;
        self.counts.lookups += 1;
        if let Some(line) = self.lines.iter().find(|line| line.square == square) {
            self.counts.stale += u64::from(line.bounds[inside] != buffer[number as usize]);
            return line.bounds[inside];
        }
        self.counts.reads += 1;
        let (left, top) = (x / SQUARE * SQUARE, y / SQUARE * SQUARE);
        let bounds = std::array::from_fn(|k| {
            let (x, y) = (left + k as u32 % SQUARE, top + k as u32 / SQUARE);
            let inside = (x < across).then_some((y * across + x) as usize);
            inside.and_then(|at| buffer.get(at)).copied().unwrap_or(Bounds::NONE)
        });
        let line = Line { square, bounds, held_until: now + latency };
        if self.lines.len() < self.capacity {
            self.lines.push(line);
        } else {
            // Where all are waited for, the one whose bounds come first.
            let free = self.lines.iter().position(|line| line.held_until <= now);
            let soonest = || (0..self.capacity).min_by_key(|&k| self.lines[k].held_until);
            let place = free.or_else(soonest).expect("a cache has a line");
            self.lines[place] = line;
        }
        bounds[inside]
    }
}

#[cfg(test)]
mod tests {
    use super::{Bounds, Lines};

    fn bounds(max: u32) -> Bounds {
        Bounds { min: 0, max }
    }

    #[test]
    fn a_line_stays_as_it_was_read() {
        // Eight blocks across and eight down: four lines, of which the cache has two.
        let mut buffer: Vec<_> = (0..64).map(|n| bounds(1000 + n)).collect();
        let mut lines = Lines::new(2);
        // The first lookup reads a line, which is held for five cycles.
        assert_eq!(lines.look_up(&buffer, 0, 8, 10, 5), bounds(1000));
        assert_eq!(lines.look_up(&buffer, 9, 8, 12, 5), bounds(1009));
        // The buffer learns of a block; the line does not.
        buffer[9] = bounds(7);
        assert_eq!(lines.look_up(&buffer, 9, 8, 21, 5), bounds(1009));
        // Two more lines: the second place, then the first, for which no request waits.
        assert_eq!(lines.look_up(&buffer, 4, 8, 22, 5), bounds(1004));
        assert_eq!(lines.look_up(&buffer, 32, 8, 23, 5), bounds(1032));
        // The first line is read anew, into the first place that is free by then; what the buffer has learnt is in it.
        assert_eq!(lines.look_up(&buffer, 9, 8, 30, 5), bounds(7));
        // The line of the second place has stayed.
        buffer[5] = bounds(3);
        assert_eq!(lines.look_up(&buffer, 5, 8, 30, 5), bounds(1005));
        assert_eq!((lines.counts.lookups, lines.counts.reads, lines.counts.stale), (7, 4, 2));
        // The first place is waited for up to cycle 35; so the second is replaced, and then again, since its bounds come first.
        assert_eq!(lines.look_up(&buffer, 36, 8, 29, 5), bounds(1036));
        assert_eq!(lines.look_up(&buffer, 5, 8, 33, 5), bounds(3));
        assert_eq!(lines.look_up(&buffer, 9, 8, 34, 5), bounds(7));
        assert_eq!(lines.counts.reads, 6);
        // Without a cache the buffer is asked.
        assert_eq!(Lines::new(0).look_up(&buffer, 9, 8, 3, 5), bounds(7));
    }

    #[test]
    fn lines_at_the_edge_of_a_surface() {
        let buffer: Vec<_> = (0..35).map(bounds).collect();
        let mut lines = Lines::new(4);
        // Seven blocks across, five down.
        assert_eq!(lines.look_up(&buffer, 34, 7, 0, 1), bounds(34));
        assert_eq!(lines.look_up(&buffer, 28, 7, 1, 1), bounds(28));
        assert_eq!(lines.look_up(&buffer, 6, 7, 2, 1), bounds(6));
        assert_eq!(lines.counts.reads, 3);
    }
}
