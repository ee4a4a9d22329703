//! Which set of a ROP's cache is a block's.

knob::choices! {
    /// Which set of a cache of blocks is a block's.
    pub enum BlockSets {
        /// The set to which its number and surface are folded.
        Hashed "hashed",
        /// The set of its place among its neighbours: 2x2 of them are in four sets.
        Position "position",
    }
}

/// The numbers of blocks whose lowest bits are those of their places: squares of neighbours, one after another, row by row.
#[derive(Clone, Copy, Debug)]
pub struct Squares {
    /// Blocks along the edge of a square, as a power of two.
    edge: u32,
}

impl Squares {
    /// Squares of as many blocks as there are sets, or half as many where that is no square.
    pub fn of_sets(sets: u64) -> Squares {
        Squares { edge: sets.ilog2() / 2 }
    }

    /// The number of a block of a surface that is `across` blocks wide.
    #[inline(always)]
    pub fn number(self, block: u32, across: u32) -> u32 {
        let Squares { edge } = self;
        let (x, y, mask) = (block % across, block / across, (1 << edge) - 1);
        let square = (y >> edge) * across.div_ceil(1 << edge) + (x >> edge);
        (square << edge | y & mask) << edge | x & mask
    }

    /// The block of a number.
    #[inline(always)]
    pub fn block(self, number: u32, across: u32) -> u32 {
        let Squares { edge } = self;
        let mask = (1 << edge) - 1;
        let (x, y, square) = (number & mask, number >> edge & mask, number >> (2 * edge));
        let squares = across.div_ceil(1 << edge);
        (square / squares << edge | y) * across + (square % squares << edge | x)
    }
}

#[cfg(test)]
mod tests {
    use super::Squares;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn numbers_name_blocks(across in 1_u32..300, block in 0_u32..90_000, ways in 0_u32..12) {
            let squares = Squares::of_sets(1 << ways);
            let number = squares.number(block, across);
            prop_assert_eq!(squares.block(number, across), block);
            // Neighbours of a square lie in different sets.
            let (x, y, edge) = (block % across, block / across, 1 << (ways / 2));
            prop_assert_eq!(number % (edge * edge), y % edge * edge + x % edge);
        }
    }
}
