//! What pipelines that draw apart from each other do not know of each other: how many quads each would hide by what it has drawn itself,
//! and how many copies of a block would be drawn into.
//!
//! Batches of primitives are dealt in turn to the pipelines, for each number of pipelines in [`APART`]. Each pipeline keeps depths of its own.
//! One block of 8x8 pixels in [`FOLLOWED`] is followed, chosen by a hash. A quad has the depth at its middle, and hides others if it is covered
//! whole.

use super::super::{BLOCK, Block, Pass, Quad, Triangle};
use gfx::state::{Compare, DepthStencil};

/// Numbers of pipelines for which it is known what they hide.
pub const APART: [usize; 3] = [1, 4, 16];

/// Primitives of a batch.
pub const DEALT: u32 = 32;

/// One block in this number of blocks is followed.
const FOLLOWED: u32 = 8;

/// Copies of all numbers of pipelines together.
const COPIES: usize = APART[0] + APART[1] + APART[2];

/// Quads of a block.
const QUADS: usize = 16;

/// What of a draw is hidden where pipelines draw apart, in the blocks that are followed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ApartProfile {
    /// Quads covered.
    pub quads: u64,
    /// The covered quads that are shaded, for each number of pipelines in [`APART`].
    pub shaded: [u64; APART.len()],
    /// Blocks covered.
    pub blocks: u64,
    /// The covered blocks with a quad that is shaded, for each number of pipelines in [`APART`].
    pub seen: [u64; APART.len()],
}

/// How a draw tests depths.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Test {
    /// Compares so; none: every quad passes.
    pub compare: Option<Compare>,
    pub writes: bool,
    /// What fails is not shaded.
    pub early: bool,
}

impl Test {
    pub fn new(state: Option<&DepthStencil>, early: bool) -> Test {
        let compare = state.map(|state| state.depth_compare);
        Test { compare, writes: state.is_some_and(|state| state.depth_write), early }
    }
}

/// What a copy has of a quad.
#[derive(Clone, Copy, Debug)]
struct Depth {
    /// The depth behind which all of it is covered.
    stored: f32,
    /// The depth of what covers a part of it since, and which part.
    partial: f32,
    mask: u16,
}

/// The copies of a pass.
#[derive(Debug)]
pub(super) struct Apart {
    across: u32,
    /// Where each block has its depths, counted from 1; 0: not yet anywhere.
    places: Vec<u32>,
    depths: Vec<[Depth; QUADS]>,
    /// The copies that each of these blocks is drawn in.
    drawn: Vec<u32>,
    /// What depths begin with; no number: unknown, and nothing fails.
    clear: f32,
    /// Batches and fences dealt so far.
    turn: u32,
    /// Distinct blocks followed, and copies of them, by [`APART`].
    pub copies: [u64; APART.len()],
}

impl Apart {
    pub fn new(pass: &Pass, clear: Option<f32>) -> Apart {
        let across = pass.width.div_ceil(BLOCK);
        let blocks = (across * pass.height.div_ceil(BLOCK)) as usize;
        let clear = clear.unwrap_or(f32::NAN);
        Apart {
            across,
            places: vec![0; blocks],
            depths: Vec::new(),
            drawn: Vec::new(),
            clear,
            turn: 0,
            copies: [0; APART.len()],
        }
    }

    /// All of a segment is dealt: `primitives` primitives, and a fence.
    pub fn end_segment(&mut self, primitives: u32) {
        self.turn = self.turn.wrapping_add(primitives.div_ceil(DEALT) + 1);
    }

    /// A block of a primitive, whose number in its segment it is given.
    pub fn block(
        &mut self,
        primitive: u32,
        triangle: &Triangle,
        block: &Block,
        quads: &[Quad],
        test: Test,
        out: &mut ApartProfile,
    ) {
        let number = u32::from(block.y) * self.across + u32::from(block.x);
        if number.wrapping_mul(0x9e37_79b9) > u32::MAX / FOLLOWED {
            return;
        }
        let place = &mut self.places[number as usize];
        if *place == 0 {
            self.drawn.push(0);
            self.depths.extend([[Depth { stored: self.clear, partial: 0.0, mask: 0 }; QUADS]; COPIES]);
            *place = self.drawn.len() as u32;
        }
        let place = *place as usize - 1;
        let turn = self.turn.wrapping_add(primitive / DEALT) as usize;
        let depth = |quad: &Quad| {
            let (x, y) = (quad.position % 4, quad.position / 4);
            let corner = [u32::from(block.x) * BLOCK + 2 * u32::from(x), u32::from(block.y) * BLOCK + 2 * u32::from(y)];
            triangle.depth.at(corner[0] as f32 + 1.0, corner[1] as f32 + 1.0)
        };
        out.quads += quads.len() as u64;
        out.blocks += 1;
        let mut first = 0;
        for (at, pipelines) in APART.into_iter().enumerate() {
            let own = first + turn % pipelines;
            first += pipelines;
            if self.drawn[place] >> own & 1 == 0 {
                self.drawn[place] |= 1 << own;
                self.copies[at] += 1;
            }
            let stored = &mut self.depths[place * COPIES + own];
            let mut shaded = 0;
            for quad in quads {
                let stored = &mut stored[usize::from(quad.position) % QUADS];
                let new = depth(quad);
                let passes = passes(test.compare, new, stored.stored);
                shaded += u64::from(passes || !test.early);
                if passes && test.writes {
                    stored.cover(new, quad.coverage & 15, test.compare);
                }
            }
            out.shaded[at] += shaded;
            out.seen[at] += u64::from(shaded > 0);
        }
    }
}

impl Depth {
    /// A part is covered at a depth; parts that are the whole together hide what is behind the farthest of them.
    fn cover(&mut self, new: f32, mask: u16, compare: Option<Compare>) {
        let nearer = matches!(compare, Some(Compare::Greater | Compare::GreaterEqual));
        if mask == 15 {
            *self = Depth { stored: new, partial: 0.0, mask: 0 };
            return;
        }
        let farther = if nearer { self.partial.min(new) } else { self.partial.max(new) };
        self.partial = if self.mask == 0 { new } else { farther };
        self.mask |= mask;
        if self.mask == 15 {
            *self = Depth { stored: self.partial, partial: 0.0, mask: 0 };
        }
    }
}

/// Whether a depth passes against a stored one; where that is unknown, it does.
fn passes(compare: Option<Compare>, new: f32, stored: f32) -> bool {
    if stored.is_nan() {
        return compare != Some(Compare::Never);
    }
    match compare {
        None | Some(Compare::Always) => true,
        Some(Compare::Never) => false,
        Some(Compare::Less) => new < stored,
        Some(Compare::LessEqual) => new <= stored,
        Some(Compare::Greater) => new > stored,
        Some(Compare::GreaterEqual) => new >= stored,
        Some(Compare::Equal) => new == stored,
        Some(Compare::NotEqual) => new != stored,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pipeline_hides_only_what_it_has_drawn_over_itself() {
        let pass = Pass { number: 0, label: String::new(), width: 64, height: 64, samples: 1, color: Vec::new(), depth: None };
        let mut apart = Apart::new(&pass, Some(1.0));
        let quad = Quad { coverage: 15, kept: 15, position: 5, flags: 0, cost: 0, payload: 0, first_request: 0 };
        // Block 0 is followed; each batch is farther away than the one before.
        let block = Block { first_quad: 0, x: 0, y: 0, quads: 1, full: false };
        let test = Test { compare: Some(Compare::Less), writes: true, early: true };
        let mut out = ApartProfile::default();
        for batch in 0..8_u32 {
            let depth = gfx::setup::DepthPlane::constant(0.1 + 0.1 * batch as f32);
            let triangle = Triangle {
                primitive: 0,
                depth,
                back: false,
                bounds: [0, 0, 1, 1],
                pixels: [0, 0, 8, 8],
                unclipped: 64,
                first_visit: 0,
                visits: 1,
                end: crate::End::Nowhere,
            };
            apart.block(batch * DEALT, &triangle, &block, &[quad], test, &mut out);
        }
        assert_eq!((out.quads, out.shaded), (8, [1, 4, 8]));
        assert_eq!((out.blocks, out.seen, apart.copies), (8, [1, 4, 8], [1, 4, 8]));
    }
}
