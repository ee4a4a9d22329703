//! What caches of several sizes would miss, told without any machine: each forgets its oldest entry, and counts.

use std::collections::HashMap;

use super::super::{BLOCK, Pass, Segment};

/// Sizes in blocks of first-in-first-out caches of colours and depths, those of all pipelines together, for which a profile knows
/// misses.
pub const BLOCK_CACHES: [usize; 5] = [64, 256, 1024, 4096, 16384];

/// Sizes in lines of first-in-first-out caches of textures and buffers, those of all pipelines together, for which a profile knows
/// misses.
pub const LINE_CACHES: [usize; 5] = [64, 256, 1024, 4096, 16384];

/// One of so many lines is followed, and stands for the others: spatial sampling as in SHARDS (Waldspurger et al. 2015).
pub(super) const FOLLOWED: u64 = 8;

/// What caches of a pass hold.
#[derive(Debug)]
pub(super) struct Caches {
    /// Of covered blocks, and of those with shaded quads.
    pub blocks: [BlockCaches; 2],
    /// Of lines.
    pub lines: LineCaches,
}

impl Caches {
    /// Empty ones.
    pub fn new(pass: &Pass) -> Caches {
        Caches { blocks: [0; 2].map(|_| BlockCaches::new(pass)), lines: LineCaches::default() }
    }
}

/// Caches of lines that forget the oldest, for some of the lines.
#[derive(Debug, Default)]
pub(super) struct LineCaches {
    /// When each line was put in, counted in misses of that cache.
    pub put: HashMap<u32, [u64; LINE_CACHES.len()]>,
    pub misses: [u64; LINE_CACHES.len()],
}

impl LineCaches {
    pub fn touch(&mut self, line: u32) {
        // Fibonacci hashing: neighbours are followed independently.
        if line.wrapping_mul(0x9e37_79b9) >> 16 & (FOLLOWED as u32 - 1) != 0 {
            return;
        }
        let put = self.put.entry(line).or_insert([u64::MAX; LINE_CACHES.len()]);
        for ((put, misses), size) in put.iter_mut().zip(&mut self.misses).zip(LINE_CACHES) {
            if *put == u64::MAX || *misses - *put >= size as u64 / FOLLOWED {
                *put = *misses;
                *misses += 1;
            }
        }
    }
}

/// Caches of blocks that forget the oldest.
#[derive(Debug)]
pub(super) struct BlockCaches {
    across: usize,
    /// When each block was put in, counted in misses of that cache.
    put: Vec<[u64; BLOCK_CACHES.len()]>,
    pub misses: [u64; BLOCK_CACHES.len()],
    pub distinct: u64,
}

impl BlockCaches {
    pub fn new(pass: &Pass) -> BlockCaches {
        let across = pass.width.div_ceil(BLOCK) as usize;
        let blocks = across * pass.height.div_ceil(BLOCK) as usize;
        let put = vec![[u64::MAX; BLOCK_CACHES.len()]; blocks];
        BlockCaches { across, put, misses: [0; BLOCK_CACHES.len()], distinct: 0 }
    }

    pub fn touch(&mut self, x: u16, y: u16) {
        let put = &mut self.put[usize::from(y) * self.across + usize::from(x)];
        self.distinct += u64::from(put[0] == u64::MAX);
        for ((put, misses), size) in put.iter_mut().zip(&mut self.misses).zip(BLOCK_CACHES) {
            if *put == u64::MAX || *misses - *put >= size as u64 {
                *put = *misses;
                *misses += 1;
            }
        }
    }
}

/// Vertices that are shaded behind a cache that forgets the oldest of `size`; the stream begins anew with each segment.
pub(super) fn shaded_vertices(segment: &Segment, size: usize) -> u64 {
    // When each vertex was put in, counted in vertices put in.
    let mut put = vec![u64::MAX; segment.vertices.len()];
    let mut shaded = 0;
    for &vertex in segment.stream.iter().filter(|vertex| **vertex != u32::MAX) {
        let at = &mut put[vertex as usize];
        if *at == u64::MAX || shaded - *at >= size as u64 {
            *at = shaded;
            shaded += 1;
        }
    }
    shaded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_block_is_missed_again_when_as_many_others_as_the_cache_holds_have_come() {
        let pass =
            Pass { number: 0, label: String::new(), width: 800, height: 800, samples: 1, color: Vec::new(), depth: None };
        let mut caches = BlockCaches::new(&pass);
        // 100 blocks three times: too many for 64, few enough for 256.
        for _ in 0..3 {
            (0..100).for_each(|x| caches.touch(x, 7));
        }
        assert_eq!(caches.distinct, 100);
        assert_eq!(caches.misses, [300, 100, 100, 100, 100]);
    }

    #[test]
    fn followed_lines_stand_for_all() {
        let mut caches = LineCaches::default();
        for _ in 0..3 {
            (0..2000).for_each(|line| caches.touch(line));
        }
        let misses = caches.misses.map(|misses| misses * FOLLOWED);
        for (misses, expected) in misses.into_iter().zip([6000, 6000, 6000, 2000, 2000]) {
            assert!(misses.abs_diff(expected) < expected / 10, "{misses} of {expected}");
        }
    }

    #[test]
    fn vertices_are_shaded_again_as_the_cache_forgets_them() {
        // Rows of a grid of 9 x 3 vertices as an index list of its quads' corners.
        let row = |y: u32| (0..8).flat_map(move |x| [9 * y + x, 9 * y + x + 1, 9 * y + 9 + x, 9 * y + 10 + x]);
        let vertices = vec![super::super::super::Vertex { index: 0, instance: 0, cost: 0, first_request: 0 }; 27];
        let segment = Segment { stream: row(0).chain([u32::MAX]).chain(row(1)).collect(), vertices, ..Segment::default() };
        assert_eq!(shaded_vertices(&segment, 0), 64);
        assert_eq!(shaded_vertices(&segment, 4), 36, "each row alone");
        assert_eq!(shaded_vertices(&segment, 32), 27);
    }
}
