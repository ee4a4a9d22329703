//! What caches of several sizes would miss, told without any machine: each forgets its oldest entry, and counts.

use super::super::{BLOCK, Pass, Segment};
use super::touch::FIRST;

/// Sizes in blocks of first-in-first-out caches of colours and depths, those of all pipelines together, for which a profile knows
/// misses.
pub const BLOCK_CACHES: [usize; 6] = [8, 64, 256, 1024, 4096, 16384];

/// What caches of a pass hold.
#[derive(Debug)]
pub(super) struct Caches {
    /// Of covered blocks, and of those with shaded quads.
    pub blocks: [BlockCaches; 2],
}

impl Caches {
    /// Empty ones.
    pub fn new(pass: &Pass) -> Caches {
        Caches { blocks: [0; 2].map(|_| BlockCaches::new(pass)) }
    }
}

/// Caches of blocks that forget the oldest.
#[derive(Debug)]
pub(super) struct BlockCaches {
    across: usize,
    /// When each block was put in, counted in misses of that cache.
    put: Vec<[u32; BLOCK_CACHES.len()]>,
    pub misses: [u32; BLOCK_CACHES.len()],
    pub distinct: u64,
}

impl BlockCaches {
    pub fn new(pass: &Pass) -> BlockCaches {
        let across = pass.width.div_ceil(BLOCK) as usize;
        let blocks = across * pass.height.div_ceil(BLOCK) as usize;
        let put = vec![[u32::MAX; BLOCK_CACHES.len()]; blocks];
        BlockCaches { across, put, misses: [0; BLOCK_CACHES.len()], distinct: 0 }
    }

    /// Whether each block was touched.
    pub fn touched(&self) -> impl Iterator<Item = bool> {
        self.put.iter().map(|put| put[0] != u32::MAX)
    }

    /// How many caches have lost a block since, [`FIRST`] if it was never in one.
    pub fn touch(&mut self, x: u16, y: u16) -> u8 {
        let put = &mut self.put[usize::from(y) * self.across + usize::from(x)];
        let first = put[0] == u32::MAX;
        self.distinct += u64::from(first);
        let mut near = 0;
        for ((put, misses), size) in put.iter_mut().zip(&mut self.misses).zip(BLOCK_CACHES) {
            if *put == u32::MAX || *misses - *put >= size as u32 {
                *put = *misses;
                *misses += 1;
                near += 1;
            }
        }
        if first { FIRST } else { near }
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

/// Vertices that are shaded if each batch of so many primitives begins anew, and has none twice.
pub(super) fn dealt_vertices(segment: &Segment, batch: u32) -> u64 {
    let mut last = vec![u32::MAX; segment.vertices.len()];
    let mut shaded = 0;
    for (number, primitive) in (0..).zip(&segment.primitives) {
        for vertex in primitive.vertices {
            let own: u32 = number / batch;
            let last = &mut last[vertex as usize];
            shaded += u64::from(*last != own);
            *last = own;
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
        let mut near = 0;
        for _ in 0..3 {
            (0..100).for_each(|x| near = caches.touch(x, 7));
        }
        assert_eq!(caches.distinct, 100);
        assert_eq!(caches.misses, [300, 300, 100, 100, 100, 100]);
        assert_eq!((near, caches.touch(0, 8)), (2, FIRST));
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
