//! Segments and runs of primitives on their way into a unit that reads their indices: taken in ahead of their turn, so that the lines
//! of indices are there when it comes.

use std::collections::VecDeque;

use super::card::{Card, Work};
use super::misses::Misses;
use super::token::{Kind, Run};
use mem::MemoryPort;
use sim::{Tick, Wires};
use work::{LINE, Segment};

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
    pub fn segment(segment: &Segment, _: &Run) -> Walk {
        Walk { heads: [0; 3], head_count: 0, base: 0, length: segment.stream.len() as u32 }
    }

    /// Primitives of a segment that follow each other.
    pub fn run(segment: &Segment, run: &Run) -> Walk {
        let primitives = &segment.primitives[run.first as usize..][..run.count as usize];
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

    /// The place of the walk behind an entry of the segment's stream, which lies in the walk.
    #[inline(always)]
    pub fn position(&self, stream_end: u32) -> u32 {
        self.head_count + stream_end - self.base
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
    /// First line of its indices, and the number of lines. Marks and runs without indices have none.
    line: u64,
    lines: u32,
    /// Whether its first line is the last one of the run before it, which is requested once for both.
    shared: bool,
    /// Lines requested, and the number of the request for the first.
    asked: u32,
    number: u32,
}

/// Segments, runs of primitives and marks taken in ahead of their turn, and their lines of indices.
#[derive(Clone, Debug)]
pub struct IndexRuns {
    runs: VecDeque<Ahead>,
    /// The most runs and marks inside.
    places: usize,
    misses: Misses,
    /// Lines are requested in the order of their use, and numbered as their requests. Lines before this number have been used up.
    released: u32,
    /// The most lines held or on their way.
    lines: u32,
    /// The last line of the last run inside that has indices.
    last_line: Option<u64>,
    /// Lines were given up since [`IndexRuns::freed`] was called last.
    freed: bool,
}

impl IndexRuns {
    /// An empty queue of `places` runs and marks, with a buffer of `lines` lines of indices.
    pub fn new(lines: u32, places: u32) -> IndexRuns {
        IndexRuns {
            runs: VecDeque::with_capacity(places as usize),
            places: places as usize,
            misses: Misses::new(lines),
            released: 0,
            lines,
            last_line: None,
            freed: false,
        }
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

    /// Takes the run at the head. Its lines are given up, but for the last one if the next run has indices in it too.
    pub fn take(&mut self) {
        let Some(ahead) = self.runs.pop_front() else { return };
        if ahead.lines == 0 {
            return;
        }
        let next = self.runs.iter().find(|next| next.lines > 0).map(|next| next.shared);
        self.release(ahead.number.wrapping_add(ahead.asked - u32::from(next == Some(true))));
        if next.is_none() {
            self.last_line = None;
        }
    }

    /// Gives up the lines before a number.
    fn release(&mut self, number: u32) {
        if number.wrapping_sub(self.released) as i32 > 0 {
            self.released = number;
            self.freed = true;
        }
    }

    /// Takes in the runs that `next` gives, as far as there are places, and requests their indices, over a port if they are to be read.
    /// A run comes with its walk.
    pub fn take_in(
        &mut self,
        wires: &mut Wires,
        card: &Card,
        mut next: impl FnMut(&mut Wires) -> Option<Run>,
        walk: impl Fn(&Segment, &Run) -> Walk,
        port: Option<&MemoryPort>,
    ) -> Tick {
        let mut did = Tick::Starved;
        while let Some(tag) = port.and_then(|port| port.answer(wires)) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        while self.runs.len() < self.places
            && let Some(run) = next(wires)
        {
            let mut ahead = Ahead { run, line: 0, lines: 0, shared: false, asked: 0, number: 0 };
            if run.kind == Kind::DATA && port.is_some() {
                let segment = &card.work(run.slot).segment;
                let walk = walk(segment, &run);
                let bytes = u64::from(walk.length) * u64::from(segment.index_bytes);
                if let Some(start) = walk.address(segment).filter(|_| bytes > 0) {
                    let last = (start + bytes - 1) / LINE;
                    ahead.line = start / LINE;
                    ahead.lines = (last - ahead.line + 1) as u32;
                    ahead.shared = self.last_line == Some(ahead.line);
                    self.last_line = Some(last);
                }
            }
            self.runs.push_back(ahead);
            did = Tick::Moved;
        }
        let Some(port) = port else { return did };
        for ahead in &mut self.runs {
            if ahead.shared && ahead.asked == 0 {
                (ahead.number, ahead.asked) = (self.misses.issued().wrapping_sub(1), 1);
            }
            while ahead.asked < ahead.lines {
                if self.misses.issued().wrapping_sub(self.released) == self.lines || !port.can_send(wires) {
                    return did;
                }
                if ahead.asked == 0 {
                    ahead.number = self.misses.issued();
                }
                let tag = self.misses.issue();
                port.read(wires, (ahead.line + u64::from(ahead.asked)) * LINE, LINE as u32, tag);
                ahead.asked += 1;
                did = Tick::Moved;
            }
        }
        did
    }

    /// Whether lines were given up since this was asked last: then there is more to take in, and the unit ticks again.
    pub fn freed(&mut self) -> bool {
        std::mem::take(&mut self.freed)
    }

    /// Gives up the lines of the run at the head that its walk has left behind: it has come to `position`.
    #[inline(always)]
    pub fn use_up(&mut self, work: &Work, walk: &Walk, position: u32) {
        let (Some(start), Some(ahead)) = (walk.address(&work.segment), self.runs.front()) else { return };
        if ahead.asked == 0 {
            return;
        }
        let used = (start % LINE + u64::from(position) * u64::from(work.segment.index_bytes)) / LINE;
        // The last line may be that of the next run too.
        let used = (used as u32).min(ahead.asked).min(ahead.lines - 1);
        self.release(ahead.number.wrapping_add(used));
    }

    /// The first vertex of the run at the head whose index has not come; the run's walk has come to `position`. Lines that were read
    /// give their places up.
    #[inline(always)]
    pub fn here(&mut self, work: &Work, walk: &Walk, position: u32) -> u32 {
        self.use_up(work, walk, position);
        let (Some(start), Some(ahead)) = (walk.address(&work.segment), self.runs.front()) else { return walk.length };
        if ahead.lines == 0 {
            return walk.length;
        }
        let here = self.misses.frontier().wrapping_sub(ahead.number) as i32;
        let here = here.clamp(0, ahead.asked as i32) as u64;
        let bytes = (here * LINE).saturating_sub(start % LINE);
        (bytes / u64::from(work.segment.index_bytes)).min(u64::from(walk.length)) as u32
    }
}
