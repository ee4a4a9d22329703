//! What caches of several sizes would miss, told without any machine: each forgets its oldest entry, and counts.

use super::super::{BLOCK, Pass, Segment};
use super::touch::FIRST;
use super::{BATCH, REUSE};

/// Sizes in blocks of first-in-first-out caches of colours and depths, those of all pipelines together, for which a profile knows
/// misses.
pub const BLOCK_CACHES: [usize; 6] = [8, 64, 256, 1024, 4096, 16384];

/// When something was put in that was never in: so long before anything else that every cache has forgotten it.
const NEVER_IN: i32 = i32::MIN / 2;

/// Caches that forget the oldest, of several sizes side by side: two registers of any host hold them, and no branch tells them apart.
const LANES: usize = 8;

/// Sizes in lanes; a lane without a cache misses nothing.
const fn lanes<const SIZES: usize>(sizes: [usize; SIZES]) -> [i32; LANES] {
    let (mut lanes, mut at) = ([i32::MAX; LANES], 0);
    while at < SIZES {
        lanes[at] = sizes[at] as i32;
        at += 1;
    }
    lanes
}

/// Something is asked of caches of these sizes that was put in when they had missed so often: each that has forgotten it misses once more.
/// Gives all ones for those.
#[inline(always)]
fn ask(misses: &mut [i32; LANES], put: &mut [i32; LANES], sizes: &[i32; LANES]) -> [i32; LANES] {
    let mut gone = [0; LANES];
    for lane in 0..LANES {
        let (before, since) = (misses[lane], put[lane]);
        // The sign of a difference: a comparison is not made in registers of four.
        gone[lane] = sizes[lane].wrapping_sub(1).wrapping_sub(before.wrapping_sub(since)) >> 31;
        put[lane] = since ^ (since ^ before) & gone[lane];
        misses[lane] = before.wrapping_sub(gone[lane]);
    }
    gone
}

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
    put: Vec<[i32; LANES]>,
    /// How often each was touched.
    pub touches: Vec<u32>,
    missed: [i32; LANES],
    pub distinct: u64,
}

impl BlockCaches {
    pub fn new(pass: &Pass) -> BlockCaches {
        let across = pass.width.div_ceil(BLOCK) as usize;
        let blocks = across * pass.height.div_ceil(BLOCK) as usize;
        BlockCaches { across, put: vec![[NEVER_IN; LANES]; blocks], touches: vec![0; blocks], missed: [0; LANES], distinct: 0 }
    }

    /// Misses of each.
    pub fn misses(&self) -> [u64; BLOCK_CACHES.len()] {
        std::array::from_fn(|at| self.missed[at] as u64)
    }

    /// How many caches have lost a block since, [`FIRST`] if it was never in one.
    pub fn touch(&mut self, x: u16, y: u16) -> u8 {
        let at = usize::from(y) * self.across + usize::from(x);
        let put = &mut self.put[at];
        let first = put[0] == NEVER_IN;
        self.touches[at] += 1;
        self.distinct += u64::from(first);
        let gone = ask(&mut self.missed, put, &const { lanes(BLOCK_CACHES) });
        let near = gone.iter().fold(0_i32, |near, gone| near - gone);
        if first { FIRST } else { near as u8 }
    }
}

/// Vertices that are shaded behind caches of [`REUSE`] vertices that forget the oldest; the stream begins anew with each segment.
pub(super) fn shaded_vertices(segment: &Segment) -> [u64; REUSE.len()] {
    let mut put = vec![[NEVER_IN; LANES]; segment.vertices.len()];
    let mut shaded = [0; LANES];
    for &vertex in segment.stream.iter().filter(|vertex| **vertex != u32::MAX) {
        ask(&mut shaded, &mut put[vertex as usize], &const { lanes(REUSE) });
    }
    std::array::from_fn(|at| shaded[at] as u64)
}

/// The number of vertices that are shaded if each batch of `batch` primitives begins anew, and shades no vertex twice.
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

/// Vertices that are shaded in batches of at most [`BATCH`] vertices and indices, of whole primitives, each of which begins anew.
pub(super) fn batched_vertices(segment: &Segment) -> u64 {
    let [most, most_indices] = BATCH;
    let mut last = vec![u32::MAX; segment.vertices.len()];
    let (mut batch, mut held, mut indices, mut shaded) = (0, 0, 0, 0);
    for primitive in &segment.primitives {
        let [a, b, c] = primitive.vertices;
        let different = 1 + usize::from(b != a) + usize::from(c != b && c != a);
        let vertices = &primitive.vertices[..different];
        let new = vertices.iter().filter(|&&vertex| last[vertex as usize] != batch).count();
        if held + new > most || indices + different > most_indices {
            batch += 1;
            (held, indices) = (0, 0);
        }
        for &vertex in vertices {
            let last = &mut last[vertex as usize];
            let new = usize::from(*last != batch);
            held += new;
            shaded += new as u64;
            *last = batch;
        }
        indices += different;
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
        assert_eq!(caches.misses(), [300, 300, 100, 100, 100, 100]);
        assert_eq!((near, caches.touch(0, 8)), (2, FIRST));
    }

    #[test]
    fn vertices_are_shaded_again_as_the_cache_forgets_them() {
        // Rows of a grid of 9 x 3 vertices as an index list of its quads' corners.
        let row = |y: u32| (0..8).flat_map(move |x| [9 * y + x, 9 * y + x + 1, 9 * y + 9 + x, 9 * y + 10 + x]);
        let vertices = vec![super::super::super::Vertex { index: 0, instance: 0, cost: 0, first_request: 0 }; 27];
        let segment = Segment { stream: row(0).chain([u32::MAX]).chain(row(1)).collect(), vertices, ..Segment::default() };
        let [none, eight, .., most] = shaded_vertices(&segment);
        assert_eq!([none, eight, most], [64, 36, 27], "without a cache, each row alone, each once");
    }

    #[test]
    fn vertices_are_shaded_again_in_each_batch() {
        let batched = |indices: &[u32]| {
            let primitive = |vertices: &[u32]| super::super::super::Primitive {
                vertices: [vertices[0], vertices[1], vertices[2]],
                stream_end: 0,
                first_triangle: 0,
                triangles: 0,
                clipped: false,
                cut_away: false,
                outcome: super::super::super::PrimitiveOutcome::Drawn,
            };
            let vertex = super::super::super::Vertex { index: 0, instance: 0, cost: 0, first_request: 0 };
            let vertices = vec![vertex; indices.iter().max().map_or(0, |&last| last as usize + 1)];
            let primitives = indices.chunks_exact(3).map(primitive).collect();
            batched_vertices(&Segment { vertices, primitives, ..Segment::default() })
        };
        // The same triangle 32 times, and once more; triangles that share nothing, of which ten fit.
        let same: Vec<u32> = (0..99).map(|n| n % 3).collect();
        assert_eq!([batched(&same[..96]), batched(&same)], [3, 6]);
        assert_eq!(batched(&(0..66).collect::<Vec<_>>()), 66);
        // A strip of 31 triangles: 30 in the first batch.
        let strip: Vec<u32> = (0..31).flat_map(|n| [n, n + 1, n + 2]).collect();
        assert_eq!([batched(&strip[..90]), batched(&strip)], [32, 35]);
    }
}
