//! Cuts a draw into segments of bounded size: whole primitives in API order.

use gfx::assemble::primitive_count;
use gfx::state::Topology;
use num::Words;

use super::IndexBuffer;

/// Consecutive entries of a draw's vertex stream in one instance: a list, or (part of) one strip.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Instance, first instance added.
    pub instance: u32,
    /// First entry of the draw's stream (which begins at the first vertex or index).
    pub start: u32,
    /// Number of entries.
    pub len: u32,
    /// The entry that a fan's triangles share, where it lies before `start`.
    pub hub: Option<u32>,
    /// First entry in the segment's stream (the hub's, if there is one).
    pub stream: u32,
    /// Primitives before this piece in the segment.
    pub first_primitive: u32,
    /// Primitives.
    pub primitives: u32,
    /// Primitives of its instance before it.
    pub first_index: u32,
    /// Entries that an earlier segment has read already (a strip or fan that was cut).
    pub repeated: u32,
    /// A strip restart precedes it.
    pub restart: bool,
}

impl Piece {
    /// Entries in the segment's stream.
    pub fn entries(&self) -> u32 {
        self.len + u32::from(self.hub.is_some())
    }
}

/// Entries of a run (a strip, or a whole list) that primitives `first..first + count` need, and whether the hub of a fan is
/// needed as well. `first` is even.
pub fn entries_of(topology: Topology, first: u32, count: u32) -> (u32, u32, bool) {
    match topology {
        Topology::PointList => (first, count, false),
        Topology::LineList => (2 * first, 2 * count, false),
        Topology::LineStrip => (first, count + 1, false),
        Topology::TriangleList => (3 * first, 3 * count, false),
        Topology::TriangleStrip => (first, count + 2, false),
        Topology::TriangleFan if first == 0 => (0, count + 2, false),
        Topology::TriangleFan => (first + 1, count + 1, true),
        Topology::QuadList => (first * 2, count * 2, false),
    }
}

/// Walks over a draw and hands out its segments; memory is kept from one draw to the next.
pub struct Planner {
    topology: Topology,
    /// Runs of stream entries between strip restarts: first entry, length, whether a restart stands before.
    runs: Vec<(u32, u32, bool)>,
    instance: u64,
    /// Runs of instances, none of them empty, and which of them the instance is of.
    instances: Vec<std::ops::Range<u64>>,
    turn: usize,
    run: usize,
    primitive: u32,
    /// Primitives of the instance handed out.
    done: u32,
}

impl Default for Planner {
    fn default() -> Planner {
        let (runs, instances) = (Vec::new(), Vec::new());
        Planner { topology: Topology::TriangleList, runs, instance: 0, instances, turn: 0, run: 0, primitive: 0, done: 0 }
    }
}

/// Where a walk stands.
#[derive(Clone, Copy, Debug)]
pub struct WalkPosition {
    instance: u64,
    turn: usize,
    run: usize,
    primitive: u32,
    done: u32,
}

impl Planner {
    /// A planner for `count` vertices (or indices) of `instances` instances; `restart` is the index that ends a strip.
    #[cfg(test)]
    pub fn new(
        topology: Topology,
        index: Option<&IndexBuffer<'_>>,
        first: u32,
        count: u32,
        restart: Option<u32>,
        instances: std::ops::Range<u64>,
    ) -> Planner {
        let mut planner = Planner::default();
        planner.begin(topology, index, [first, count], restart, instances);
        planner
    }

    /// Plans a draw of `count` vertices (or indices) of `instances` instances; `restart` is the index that ends a strip.
    pub fn begin(
        &mut self,
        topology: Topology,
        index: Option<&IndexBuffer<'_>>,
        [first, count]: [u32; 2],
        restart: Option<u32>,
        instances: std::ops::Range<u64>,
    ) {
        self.topology = topology;
        let runs = &mut self.runs;
        runs.clear();
        match (index, restart.filter(|_| topology.is_strip())) {
            (Some(index), Some(restart)) => {
                let (mut start, mut broken) = (0, false);
                for at in 0..count {
                    if index.at(first.wrapping_add(at)) == restart {
                        runs.push((start, at - start, broken));
                        (start, broken) = (at + 1, true);
                    }
                }
                runs.push((start, count - start, broken));
            }
            _ => runs.push((0, count, false)),
        }
        runs.retain(|&(_, len, _)| primitive_count(topology, u64::from(len)) > 0);
        self.instances.clear();
        self.instances.push(instances);
        self.go_to_start();
    }

    /// From the beginning, with no other instances than those of some runs.
    pub fn draw_only(&mut self, instances: Vec<std::ops::Range<u64>>) {
        self.instances = instances;
        self.go_to_start();
    }

    fn go_to_start(&mut self) {
        self.instances.retain(|run| !run.is_empty());
        (self.turn, self.run, self.primitive, self.done) = (0, 0, 0, 0);
        self.instance = self.instances.first().map_or(0, |run| run.start);
    }

    /// The next segment of at most `limit` primitives (at least 2), or nothing at the draw's end. A segment holds parts of one
    /// instance, or several whole ones.
    pub fn next(&mut self, limit: u32, pieces: &mut Vec<Piece>) -> bool {
        pieces.clear();
        let limit = limit.max(2) & !1;
        let (mut stream, mut primitives) = (0, 0);
        while self.turn < self.instances.len() && !self.runs.is_empty() {
            let (run_start, run_len, broken) = self.runs[self.run];
            let all = primitive_count(self.topology, u64::from(run_len)) as u32;
            let room = (limit - primitives) & !1;
            if room == 0 {
                break;
            }
            let count = (all - self.primitive).min(room);
            let (start, len, hub) = entries_of(self.topology, self.primitive, count);
            // The entries that the primitive before this one has read: all except those that the first primitive here adds.
            let repeated = if self.primitive == 0 { 0 } else { repeated_entries(self.topology) };
            let piece = Piece {
                instance: self.instance as u32,
                start: run_start + start,
                len,
                hub: hub.then_some(run_start),
                stream,
                first_primitive: primitives,
                primitives: count,
                first_index: self.done,
                repeated,
                restart: broken && self.primitive == 0,
            };
            stream += piece.entries();
            primitives += count;
            pieces.push(piece);
            self.primitive += count;
            self.done += count;
            if self.primitive == all {
                self.primitive = 0;
                self.run += 1;
                if self.run == self.runs.len() {
                    self.run = 0;
                    self.next_instance();
                    self.done = 0;
                    let whole = pieces[0].start == self.runs[0].0 && pieces[0].repeated == 0;
                    if !whole || u64::from(primitives) + self.instance_primitives() > u64::from(limit) {
                        break;
                    }
                }
            }
        }
        !pieces.is_empty()
    }

    /// Where the walk stands, to come back to.
    pub fn place(&self) -> WalkPosition {
        WalkPosition { instance: self.instance, turn: self.turn, run: self.run, primitive: self.primitive, done: self.done }
    }

    /// Goes back to a place.
    pub fn go_back(&mut self, place: WalkPosition) {
        (self.instance, self.turn) = (place.instance, place.turn);
        (self.run, self.primitive, self.done) = (place.run, place.primitive, place.done);
    }

    fn next_instance(&mut self) {
        self.instance += 1;
        if self.instance == self.instances[self.turn].end {
            self.turn += 1;
            self.instance = self.instances.get(self.turn).map_or(0, |run| run.start);
        }
    }

    /// Entries that an instance's primitives read, each strip restarted anew.
    pub fn instance_entries(&self) -> u64 {
        let all = |len: u32| primitive_count(self.topology, u64::from(len)) as u32;
        self.runs.iter().map(|&(_, len, _)| u64::from(entries_of(self.topology, 0, all(len)).1)).sum()
    }

    /// Primitives of an instance.
    pub fn instance_primitives(&self) -> u64 {
        self.runs.iter().map(|&(_, len, _)| primitive_count(self.topology, u64::from(len))).sum()
    }
}

/// Entries at the start of a cut-off strip or fan that its first part has read.
fn repeated_entries(topology: Topology) -> u32 {
    match topology {
        Topology::LineStrip => 1,
        Topology::TriangleStrip | Topology::TriangleFan => 2,
        _ => 0,
    }
}

impl IndexBuffer<'_> {
    /// Index number `at`; 0 where the buffer has none (robust access).
    #[inline(always)]
    pub fn at(&self, at: u32) -> u32 {
        let bytes = self.format.bytes();
        let byte = u64::from(at) * u64::from(bytes);
        if byte + u64::from(bytes) > self.size {
            return 0;
        }
        let byte = (self.offset + byte) as usize;
        if bytes == 2 { u32::from(self.words.u16_at(byte)) } else { self.words.u32_at(byte) }
    }

    /// Copies indices from number `first` on, plus a base vertex; what is beyond the buffer reads as index 0.
    pub fn fill(&self, first: u32, base: u32, out: &mut [u32]) {
        use std::sync::atomic::Ordering::Relaxed;
        let bytes = u64::from(self.format.bytes());
        let byte = self.offset + u64::from(first) * bytes;
        let inside = (first as u64 + out.len() as u64) * bytes <= self.size;
        let words: &Words = self.words;
        if inside && bytes == 4 && byte.is_multiple_of(4) {
            let at = (byte / 4) as usize;
            for (out, word) in out.iter_mut().zip(&words.words()[at..]) {
                *out = word.load(Relaxed).wrapping_add(base);
            }
        } else if inside && byte.is_multiple_of(4) {
            let at = (byte / 4) as usize;
            let n = out.len();
            let source = &words.words()[at..at + n.div_ceil(2)];
            for (out, word) in out.chunks_mut(2).zip(source) {
                let word = word.load(Relaxed);
                out[0] = (word & 0xffff).wrapping_add(base);
                if let Some(second) = out.get_mut(1) {
                    *second = (word >> 16).wrapping_add(base);
                }
            }
        } else {
            for (i, out) in out.iter_mut().enumerate() {
                *out = self.at(first.wrapping_add(i as u32)).wrapping_add(base);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gfx::state::IndexFormat;

    fn all(topology: Topology, count: u32, instances: u64, limit: u32) -> Vec<Vec<Piece>> {
        let mut planner = Planner::new(topology, None, 0, count, None, 0..instances);
        let (mut out, mut pieces) = (Vec::new(), Vec::new());
        while planner.next(limit, &mut pieces) {
            out.push(pieces.clone());
        }
        out
    }

    #[test]
    fn every_primitive_is_in_one_segment_and_segments_are_bounded() {
        for &topology in Topology::ALL {
            for count in 0..30 {
                for limit in [2, 4, 6, 100] {
                    let segments = all(topology, count, 3, limit);
                    let made: u64 = segments.iter().flatten().map(|p| u64::from(p.primitives)).sum();
                    assert_eq!(made, 3 * primitive_count(topology, u64::from(count)), "{topology:?} {count} {limit}");
                    for segment in &segments {
                        assert!(segment.iter().map(|p| p.primitives).sum::<u32>() <= limit);
                        let mut entries = 0;
                        for piece in segment {
                            assert_eq!(piece.stream, entries);
                            entries += piece.entries();
                            assert_eq!(
                                primitive_count(topology, u64::from(piece.entries())),
                                u64::from(piece.primitives),
                                "{topology:?} {piece:?}"
                            );
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn whole_small_instances_share_a_segment() {
        let segments = all(Topology::TriangleList, 6, 10, 9);
        assert_eq!(segments.len(), 3, "four instances of two triangles each");
        assert_eq!(segments[0].len(), 4);
    }

    #[test]
    fn restarts_split_runs_and_indices_are_robust() {
        let words = Words::new(20);
        for (i, v) in [1u16, 2, 3, 4, 0xffff, 5, 6, 0xffff, 7].into_iter().enumerate() {
            words.write(2 * i as u64, &v.to_le_bytes());
        }
        let index = IndexBuffer { words: &words, offset: 0, size: 18, format: IndexFormat::Uint16 };
        let mut planner = Planner::new(Topology::LineStrip, Some(&index), 0, 9, Some(0xffff), 0..1);
        let mut pieces = Vec::new();
        assert!(planner.next(100, &mut pieces));
        let runs: Vec<_> = pieces.iter().map(|p| (p.start, p.len, p.restart)).collect();
        assert_eq!(runs, [(0, 4, false), (5, 2, true)]);
        let mut out = [0; 4];
        index.fill(7, 10, &mut out);
        assert_eq!(out, [0xffff + 10, 17, 10, 10]);
        index.fill(1, 0, &mut out);
        assert_eq!(out, [2, 3, 4, 0xffff]);
        index.fill(0, 0, &mut out[..3]);
        assert_eq!(out[..3], [1, 2, 3]);
    }
}
