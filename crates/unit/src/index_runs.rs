//! Runs of primitives on their way into a unit that reads their indices: taken in ahead of their turn, so that the lines of indices
//! are there when it comes.

use std::collections::VecDeque;

use super::card::{Card, Work};
use super::misses::Misses;
use super::token::{Kind, Run};
use mem::MemoryPort;
use sim::{In, Tick, Wires};
use work::{LINE, Segment};

/// Runs and marks taken in ahead.
const AHEAD: usize = 16;

/// The vertices of a segment or of a run of its primitives, in the order in which they are looked up.
#[derive(Clone, Copy, Debug, Default)]
pub struct Walk {
    /// The vertices of a run's first primitive, which may share some with the primitive before it.
    heads: [u32; 3],
    /// The number of these.
    pub head_count: u32,
    /// Then the segment's stream from here on.
    base: u32,
    /// Vertices in all.
    pub length: u32,
}

impl Walk {
    /// The walk through all of a segment.
    pub fn segment(segment: &Segment) -> Walk {
        Walk { heads: [0; 3], head_count: 0, base: 0, length: segment.stream.len() as u32 }
    }

    /// Primitives of a segment that follow each other.
    pub fn run(segment: &Segment, first: u32, count: u32) -> Walk {
        let primitives = &segment.primitives[first as usize..][..count as usize];
        let (Some(head), Some(last)) = (primitives.first(), primitives.last()) else { return Walk::default() };
        // A point repeats its vertex, a line its second.
        let [a, b, c] = head.vertices;
        let head_count = 1 + u32::from(b != a) + u32::from(c != b && c != a);
        let length = head_count + last.stream_end - head.stream_end;
        Walk { heads: head.vertices, head_count, base: head.stream_end, length }
    }

    /// The vertices from one on, as far as they lie together.
    #[inline(always)]
    pub fn ahead<'a>(&'a self, segment: &'a Segment, position: u32, end: u32) -> &'a [u32] {
        if position < self.head_count {
            return &self.heads[position as usize..self.head_count.min(end) as usize];
        }
        let start = (self.base + position - self.head_count) as usize;
        &segment.stream[start..start + (end - position) as usize]
    }

    /// The entry of the segment's stream that stands at a place of the walk.
    #[inline(always)]
    pub fn entry(&self, position: u32) -> u32 {
        (self.base + position).saturating_sub(self.head_count)
    }

    /// Address of the first index; none if the draw has no indices.
    #[inline(always)]
    pub fn address(&self, segment: &Segment) -> Option<u64> {
        Some(segment.index_address? + u64::from(self.entry(0)) * u64::from(segment.index_bytes))
    }
}

/// A run taken in ahead, or a mark.
#[derive(Clone, Copy, Debug)]
struct Ahead {
    run: Run,
    /// First line of its indices, and how many lines.
    line: u64,
    lines: u32,
    /// Lines requested, of these used up, and the number of the first request.
    asked: u32,
    used: u32,
    number: u32,
}

/// Runs taken in ahead of their turn, and their lines of indices.
#[derive(Clone, Debug)]
pub struct IndexRuns {
    runs: VecDeque<Ahead>,
    misses: Misses,
    /// Lines held or on their way, of at most so many.
    held: u32,
    lines: u32,
    /// Places were given up since it was asked last.
    freed: bool,
}

impl IndexRuns {
    /// None yet, with places for so many lines of indices.
    pub fn new(lines: u32) -> IndexRuns {
        IndexRuns { runs: VecDeque::with_capacity(AHEAD), misses: Misses::new(lines), held: 0, lines, freed: false }
    }

    /// Runs and marks inside, and lines on their way.
    pub fn resident(&self) -> u64 {
        self.runs.len() as u64 + u64::from(self.misses.in_flight())
    }

    /// The run at the head.
    #[inline(always)]
    pub fn front(&self) -> Option<Run> {
        self.runs.front().map(|ahead| ahead.run)
    }

    /// Takes the run at the head.
    pub fn take(&mut self) {
        if let Some(ahead) = self.runs.pop_front() {
            self.freed |= ahead.asked != ahead.used;
            self.held -= ahead.asked - ahead.used;
        }
    }

    /// Takes runs in and requests their indices, over a port if they are to be read.
    pub fn take_in(&mut self, wires: &mut Wires, card: &Card, input: &In<Run>, port: Option<&MemoryPort>) -> Tick {
        let mut did = Tick::Starved;
        while let Some(tag) = port.and_then(|port| port.answer(wires)) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        while self.runs.len() < AHEAD
            && let Some(run) = wires.pop(input)
        {
            let mut ahead = Ahead { run, line: 0, lines: 0, asked: 0, used: 0, number: 0 };
            if run.kind == Kind::DATA && port.is_some() {
                let segment = &card.work(run.slot).segment;
                let walk = Walk::run(segment, run.first, run.count);
                let bytes = u64::from(walk.length) * u64::from(segment.index_bytes);
                if let Some(start) = walk.address(segment).filter(|_| bytes > 0) {
                    ahead.line = start / LINE;
                    ahead.lines = ((start + bytes - 1) / LINE - ahead.line + 1) as u32;
                }
            }
            self.runs.push_back(ahead);
            did = Tick::Moved;
        }
        let Some(port) = port else { return did };
        for ahead in &mut self.runs {
            while ahead.asked < ahead.lines {
                if self.held == self.lines || !port.can_send(wires) {
                    return did;
                }
                if ahead.asked == 0 {
                    ahead.number = self.misses.issued();
                }
                let tag = self.misses.issue();
                port.read(wires, (ahead.line + u64::from(ahead.asked)) * LINE, LINE as u32, tag);
                ahead.asked += 1;
                self.held += 1;
                did = Tick::Moved;
            }
        }
        did
    }

    /// Whether places were given up since this was asked last: then there is more to take in, and the unit ticks again.
    pub fn freed(&mut self) -> bool {
        std::mem::take(&mut self.freed)
    }

    /// The first vertex of the run at the head whose index has not come; the run's walk has come to `position`. Lines that were read
    /// give their places up.
    #[inline(always)]
    pub fn here(&mut self, work: &Work, walk: &Walk, position: u32) -> u32 {
        let (Some(start), Some(ahead)) = (walk.address(&work.segment), self.runs.front_mut()) else { return walk.length };
        if ahead.lines == 0 {
            return walk.length;
        }
        let index_bytes = u64::from(work.segment.index_bytes);
        let used = ((start % LINE + u64::from(position) * index_bytes) / LINE) as u32;
        let used = used.min(ahead.asked);
        self.freed |= used != ahead.used;
        self.held -= used - ahead.used;
        ahead.used = used;
        let mut here = used;
        while here < ahead.asked && self.misses.reached(ahead.number.wrapping_add(here + 1)) {
            here += 1;
        }
        let bytes = (u64::from(here) * LINE).saturating_sub(start % LINE);
        (bytes / index_bytes).min(u64::from(walk.length)) as u32
    }
}
