//! The memory that the blocks of attachments take when a pass has been drawn.

use super::parallel;
use super::surface::{TILE_BLOCKS, TileSurface};
use gfx::codec;
use work::{BLOCK, TILE};

/// Blocks along the edge of a tile.
const EDGE: usize = (TILE / BLOCK) as usize;

/// Memory lines that each block takes, row by row, with each codec ([`codec::lines`]).
pub fn stored_blocks(tiles: &TileSurface) -> Vec<[u8; codec::CODECS]> {
    let shape = tiles.shape();
    let (samples, words) = (shape.samples as usize, shape.tile_words() / TILE_BLOCKS);
    let clear = tiles.clear_value();
    let of_tile = |_, at| {
        let lines = |codes: &[u32]| codec::lines(shape.format, samples, codes);
        match tiles.tile(at) {
            Some(codes) => codes.chunks_exact(words).map(lines).collect::<Vec<_>>(),
            None => {
                let codes: Vec<u32> = (0..words).map(|word| clear[word / 4 % shape.words()]).collect();
                vec![lines(&codes); TILE_BLOCKS]
            }
        }
    };
    let [tiles_across, tiles_down] = shape.tiles().map(|n| n as usize);
    let of_tiles: Vec<_> = parallel::map(0..tiles_across * tiles_down, parallel::ANY, of_tile).collect();
    let [across, down] = [shape.width, shape.height].map(|edge| edge.div_ceil(BLOCK) as usize);
    let at = |x: usize, y: usize| of_tiles[y / EDGE * tiles_across + x / EDGE][y % EDGE * EDGE + x % EDGE];
    (0..down).flat_map(|y| (0..across).map(move |x| [x, y])).map(|[x, y]| at(x, y)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::surface::{Shape, quad_of};
    use gfx::format::Format;

    #[test]
    fn each_block_takes_what_its_codec_counts() {
        // Three tiles across and two down, the last of both in part.
        let shape = Shape { format: Format::Rgba8Unorm, width: 150, height: 90, samples: 1 };
        let mut tiles = TileSurface::new(shape);
        tiles.clear([0x1020_3040, 0, 0, 0]);
        // Noise in the block at (17, 9), which is in the third tile of the second row.
        let (x, y) = (17, 9);
        {
            let tile = tiles.tile_mut(5, [u32::MAX; 4]);
            *tile.clear = false;
            tile.codes.fill(0x1020_3040);
            let first = quad_of(x % 8 * 8, y % 8 * 8) as usize * 4;
            (first..first + 64).for_each(|at| tile.codes[at] = num::hash(at as u32));
        }
        let stored = stored_blocks(&tiles);
        assert_eq!(stored.len(), 19 * 12);
        for (at, lines) in stored.iter().enumerate() {
            let expected = if at == (y * 19 + x) as usize { [4; 3] } else { [1; 3] };
            assert_eq!(*lines, expected, "block {at}");
        }
    }
}
