//! The vertex stream of a segment: which vertex each entry names, every vertex of an instance once.
//!
//! Two ways, chosen by what the indices look like. Where they are dense (almost always), the vertex of index `i` is number
//! `i - least index`, and a byte per vertex marks those that are used: no table, no order, all threads at once. Where they are
//! scattered, or where the order of first use is wanted (recording), a table finds each vertex's number.

use std::sync::atomic::{AtomicU8, Ordering::Relaxed};

use super::IndexBuffer;
use super::plan::Piece;
use crate::parallel;

/// Entries that one task reads.
const TASK: usize = 16 * 1024;

/// The source of a segment's stream.
#[derive(Clone, Copy)]
pub struct StreamSource<'a> {
    /// Indices, or none: vertices are numbered from `first`.
    pub index: Option<IndexBuffer<'a>>,
    /// First index, or first vertex.
    pub first: u32,
    /// Added to every index.
    pub base_vertex: i32,
}

/// Vertices of one instance.
#[derive(Clone, Copy, Debug)]
pub struct Group {
    /// The instance.
    pub instance: u32,
    /// Number of its first vertex.
    pub slot: u32,
    /// Dense: index of that vertex.
    pub index: u32,
}

/// The stream of a segment; memory is kept from one to the next.
#[derive(Default)]
pub struct Stream {
    /// Number of the vertex of each entry.
    pub entries: Vec<u32>,
    /// Vertices (dense: some of which may be unused).
    pub vertices: usize,
    /// Instances in order.
    pub groups: Vec<Group>,
    /// Dense: which vertices are used; all threads set them.
    marks: Vec<AtomicU8>,
    /// The same, a bit a vertex.
    used: Vec<u64>,
    /// Not dense: the index of each vertex.
    indices: Vec<u32>,
    table: Table,
    /// Least and greatest index of each group.
    ranges: Vec<(u32, u32)>,
}

impl Stream {
    /// Reads the stream of the pieces. `in_order`: vertices are numbered in order of first use.
    pub fn read(&mut self, source: &StreamSource<'_>, pieces: &[Piece], in_order: bool) {
        let total = pieces.last().map_or(0, |p| p.stream + p.entries()) as usize;
        self.entries.resize(total, 0);
        self.groups.clear();
        self.fill(source, pieces);
        if in_order {
            self.number_in_order(pieces);
            return;
        }
        self.find_ranges(pieces);
        let dense: u64 = self.ranges.iter().map(|&(lo, hi)| u64::from(hi - lo) + 1).sum();
        if dense > 2 * total as u64 + 1024 {
            self.number_in_order(pieces);
        } else {
            self.number_dense(pieces);
        }
    }

    /// Which vertices are used, from `first` on up to the next multiple of 64.
    pub fn used(&self, first: usize) -> u64 {
        if !self.indices.is_empty() {
            let n = self.vertices.saturating_sub(first).min(64);
            return if n == 64 { u64::MAX } else { (1 << n) - 1 };
        }
        self.used.get(first / 64).map_or(0, |used| used >> (first % 64))
    }

    /// Vertex and instance index of `out.len()` vertices from `first` on.
    pub fn identify(&self, first: usize, index: &mut [u32], instance: &mut [u32]) {
        let mut group = self.groups.partition_point(|g| g.slot as usize <= first) - 1;
        let last = self.vertices - 1;
        if self.indices.is_empty() && self.groups.get(group + 1).is_none_or(|g| g.slot as usize >= first + index.len()) {
            // All of one instance, as most are: numbers that rise by one.
            let g = self.groups[group];
            let (start, last) = (first as u32 - g.slot, last as u32 - g.slot);
            for (i, out) in (0..).zip(index) {
                *out = g.index.wrapping_add((start + i).min(last));
            }
            instance.fill(g.instance);
            return;
        }
        for i in 0..index.len() {
            let slot = (first + i).min(last);
            while self.groups.get(group + 1).is_some_and(|g| g.slot as usize <= slot) {
                group += 1;
            }
            let g = self.groups[group];
            index[i] = if self.indices.is_empty() { g.index.wrapping_add(slot as u32 - g.slot) } else { self.indices[slot] };
            instance[i] = g.instance;
        }
    }

    /// Writes the index of every entry.
    fn fill(&mut self, source: &StreamSource<'_>, pieces: &[Piece]) {
        let base = source.base_vertex as u32;
        let read = |at: u32, out: &mut [u32]| match source.index {
            Some(index) => index.fill(source.first.wrapping_add(at), base, out),
            None => (0..).zip(out).for_each(|(i, out)| *out = source.first.wrapping_add(at).wrapping_add(i)),
        };
        let whole = |piece: &Piece, out: &mut [u32]| {
            let hub = usize::from(piece.hub.is_some());
            if let Some(at) = piece.hub {
                read(at, &mut out[..1]);
            }
            read(piece.start, &mut out[hub..]);
        };
        if let [piece] = pieces {
            if piece.entries() as usize <= TASK {
                return whole(piece, &mut self.entries);
            }
            let hub = piece.hub.is_some();
            parallel::each(self.entries.chunks_mut(TASK), parallel::ANY, |task, out| {
                let at = piece.start + (task * TASK) as u32;
                match (hub, task) {
                    (false, _) => read(at, out),
                    (true, 0) => whole(piece, out),
                    (true, _) => read(at - 1, out),
                }
            });
            return;
        }
        let mut rest = self.entries.as_mut_slice();
        let parts = pieces.iter().map(|piece| {
            let out = rest.split_off_mut(..piece.entries() as usize).expect("entries for every piece");
            (piece, out)
        });
        each(parts.collect(), pieces, |(piece, out)| whole(piece, out));
    }

    /// Least and greatest index of each instance; begins the groups.
    fn find_ranges(&mut self, pieces: &[Piece]) {
        self.ranges.clear();
        for piece in pieces {
            let entries = &self.entries[piece.stream as usize..][..piece.entries() as usize];
            let bounds = |chunk: &[u32]| chunk.iter().fold((u32::MAX, 0), |(lo, hi), &i| (i.min(lo), i.max(hi)));
            let (lo, hi) = if entries.len() <= TASK {
                bounds(entries)
            } else {
                let wider = |a: (u32, u32), b: (u32, u32)| (a.0.min(b.0), a.1.max(b.1));
                parallel::map(entries.chunks(TASK), parallel::ANY, |_, chunk| bounds(chunk)).fold((u32::MAX, 0), wider)
            };
            if self.groups.last().is_some_and(|g| g.instance == piece.instance) {
                let range = self.ranges.last_mut().expect("a range a group");
                *range = (range.0.min(lo), range.1.max(hi));
            } else {
                self.groups.push(Group { instance: piece.instance, slot: 0, index: 0 });
                self.ranges.push((lo, hi));
            }
        }
    }

    fn number_dense(&mut self, pieces: &[Piece]) {
        self.indices.clear();
        let mut slot = 0;
        for (group, &(lo, hi)) in self.groups.iter_mut().zip(&self.ranges) {
            (group.slot, group.index) = (slot, lo);
            slot += hi - lo + 1;
        }
        self.vertices = slot as usize;
        self.marks.clear();
        self.marks.resize_with(self.vertices, AtomicU8::default);
        let marks = &self.marks;
        let number = |group: &Group, entries: &mut [u32]| {
            let delta = group.slot.wrapping_sub(group.index);
            for entry in entries {
                *entry = entry.wrapping_add(delta);
                marks[*entry as usize].store(1, Relaxed);
            }
        };
        if let ([group], true) = (&*self.groups, self.entries.len() <= TASK) {
            // There is a single instance: all pieces are numbered from one index.
            number(group, &mut self.entries);
            self.used.clear();
            self.used.extend(self.marks.chunks_mut(64).map(bits));
            return;
        }
        let mut rest = self.entries.as_mut_slice();
        let (mut group, groups) = (0, &self.groups);
        let parts = pieces.iter().map(|piece| {
            while groups[group].instance != piece.instance {
                group += 1;
            }
            let entries = rest.split_off_mut(..piece.entries() as usize).expect("entries for every piece");
            (&groups[group], entries)
        });
        let parts: Vec<_> = parts.collect();
        let total = pieces.last().map_or(0, |p| p.stream + p.entries()) as usize;
        if pieces.len() == 1 && total > TASK {
            for (group, entries) in parts {
                parallel::each(entries.chunks_mut(TASK), parallel::ANY, |_, chunk| number(group, chunk));
            }
        } else {
            each(parts, pieces, |(group, entries)| number(group, entries));
        }
        self.used.clear();
        self.used.extend(self.marks.chunks_mut(64).map(bits));
    }

    fn number_in_order(&mut self, pieces: &[Piece]) {
        self.indices.clear();
        self.groups.clear();
        for piece in pieces {
            if self.groups.last().is_none_or(|g| g.instance != piece.instance) {
                self.groups.push(Group { instance: piece.instance, slot: self.indices.len() as u32, index: 0 });
                self.table.begin();
            }
            for entry in &mut self.entries[piece.stream as usize..][..piece.entries() as usize] {
                *entry = self.table.number(*entry, &mut self.indices);
            }
        }
        self.vertices = self.indices.len();
    }
}

/// Up to 64 marks, each 0 or 1, as bits.
fn bits(marks: &mut [AtomicU8]) -> u64 {
    let byte = |marks: &mut [AtomicU8]| {
        let mut eight = [0; 8];
        eight.iter_mut().zip(marks).for_each(|(out, mark)| *out = *mark.get_mut());
        // Each mark meets the one power of two that lifts it to its place in the uppermost byte; nothing carries.
        u64::from_le_bytes(eight).wrapping_mul(0x0102_0408_1020_4080) >> 56
    };
    (0..).zip(marks.chunks_mut(8)).fold(0, |all, (k, marks)| all | byte(marks) << (8 * k))
}

/// Does something for every part of a stream: on all threads if it is long enough, several short parts at a time.
fn each<T: Send>(parts: Vec<T>, pieces: &[Piece], work: impl Fn(T) + Sync + Send) {
    let total = pieces.last().map_or(0, |p| p.stream + p.entries()) as usize;
    if total <= TASK {
        parts.into_iter().for_each(work);
    } else {
        let together = (parts.len() * TASK / total).max(1);
        parallel::each(parts.into_iter(), together..=usize::MAX, |_, part| work(part));
    }
}

/// Numbers of indices: open addressing, emptied by raising a floor. It is as large as the distinct indices need, which are a
/// fraction of the entries.
#[derive(Default)]
struct Table {
    /// (index, number + 1), valid where the number is not below the floor.
    places: Vec<(u32, u32)>,
    floor: u32,
    next: u32,
}

impl Table {
    /// Forgets all.
    fn begin(&mut self) {
        if self.places.is_empty() || self.next > u32::MAX / 2 {
            self.places.clear();
            self.places.resize(1024, (0, 0));
            self.next = 0;
        }
        self.floor = self.next + 1;
    }

    /// Where an index is, or would be.
    #[inline(always)]
    fn find(&self, index: u32) -> usize {
        let mask = self.places.len() - 1;
        // Neighbours stay neighbours (they come together), and large strides do not pile up.
        let mut at = (index ^ (index >> 16).wrapping_mul(0x9e37_79b1)) as usize & mask;
        while self.places[at].1 >= self.floor && self.places[at].0 != index {
            at = (at + 1) & mask;
        }
        at
    }

    /// Twice as many places.
    #[cold]
    fn grow(&mut self) {
        let size = 2 * self.places.len();
        let before = std::mem::replace(&mut self.places, vec![(0, 0); size]);
        for place in before.into_iter().filter(|p| p.1 >= self.floor) {
            let at = self.find(place.0);
            self.places[at] = place;
        }
    }

    /// The number of an index among `indices`, which it joins when it is new.
    #[inline(always)]
    fn number(&mut self, index: u32, indices: &mut Vec<u32>) -> u32 {
        let at = self.find(index);
        let stamp = self.places[at].1;
        // Stamps rise with the vertices; `next - len` turns one into a number.
        if stamp >= self.floor {
            return indices.len() as u32 - 1 - (self.next - stamp);
        }
        self.next += 1;
        self.places[at] = (index, self.next);
        indices.push(index);
        // Half of the places stay free.
        if 2 * (self.next - self.floor + 1) as usize >= self.places.len() {
            self.grow();
        }
        indices.len() as u32 - 1
    }
}

#[cfg(test)]
mod tests {
    use super::super::plan::Planner;
    use super::*;
    use gfx::state::{IndexFormat, Topology};
    use num::Words;

    fn check(indices: &[u32], base: i32, instances: u64) {
        let words = Words::new(4 * indices.len() as u64);
        for (i, &v) in indices.iter().enumerate() {
            words.store(i, v);
        }
        let index = IndexBuffer { words: &words, offset: 0, size: words.len(), format: IndexFormat::Uint32 };
        let count = indices.len() as u32;
        let mut planner = Planner::new(Topology::TriangleList, Some(&index), 0, count, None, 3..3 + instances);
        let source = StreamSource { index: Some(index), first: 0, base_vertex: base };
        let mut pieces = Vec::new();
        assert!(planner.next(1 << 20, &mut pieces));
        for in_order in [false, true] {
            let mut stream = Stream::default();
            // Twice: what is kept from one segment must not show in the next.
            for _ in 0..2 {
                stream.read(&source, &pieces, in_order);
            }
            let mut pairs = Vec::new();
            let mut used = Vec::new();
            for first in (0..stream.vertices).step_by(64) {
                let (mut index, mut instance) = ([0; 64], [0; 64]);
                stream.identify(first, &mut index, &mut instance);
                let mask = stream.used(first);
                for i in 0..64.min(stream.vertices - first) {
                    pairs.push((index[i], instance[i]));
                    used.push(mask >> i & 1 == 1);
                }
            }
            let mut seen = vec![false; pairs.len()];
            for (at, &entry) in stream.entries.iter().enumerate() {
                let expected = indices[at % indices.len()].wrapping_add(base as u32);
                assert_eq!(pairs[entry as usize], (expected, 3 + (at / indices.len()) as u32));
                seen[entry as usize] = true;
            }
            assert_eq!(used, seen, "exactly the vertices of the stream are shaded");
            let mut unique = pairs.clone();
            unique.sort_unstable();
            unique.dedup();
            assert_eq!(unique.len(), pairs.len());
            if in_order {
                let mut next = 0;
                for &entry in &stream.entries {
                    assert!(entry <= next);
                    next = next.max(entry + 1);
                }
            }
        }
    }

    #[test]
    fn every_vertex_of_an_instance_has_one_number() {
        check(&[0, 1, 2, 2, 1, 3], 0, 1);
        check(&[7, 9, 7, 9, 8, 12], -3, 5);
        check(&[0, 1 << 30, u32::MAX, 0, 5, 1 << 30], 0, 2);
        let many: Vec<u32> = (0..60_000u32).map(|i| (i / 3 + i % 3).wrapping_mul(2_654_435_761) % 9_000).collect();
        check(&many, 17, 1);
        let far: Vec<u32> = (0..3_000u32).map(|i| i.wrapping_mul(2_654_435_761)).collect();
        check(&far, 0, 2);
    }
}
