//! Stamps: for each sample of a pipeline's copy of a surface, which primitive wrote it last; and of what kind the draws of a pass are, by
//! which it is known whether copies can be composed to the picture of API order.

use std::cmp::Ordering;

use gfx::rop::{ColorState, DepthStencilState};
use gfx::state::Compare;
use work::Draw;

/// Which primitive wrote a sample: bit 0, it was blended over nothing and has still to be put over what is behind it; bit 1, its colours
/// were written; bit 2, the primitive is let through by an equal depth; from bit 3 its number in the pass, from 1, or 0 for none.
pub type Stamp = u32;

pub(super) const PARTIAL: Stamp = 1;
const COLORED: Stamp = 2;

/// Primitives that a pass can have.
pub const MAX_PRIMITIVES: u32 = 1 << 29;

/// The stamp of a primitive.
#[inline(always)]
fn stamp(number: u32, inclusive: bool) -> Stamp {
    (number + 1) << 3 | u32::from(inclusive) << 2
}

/// The marks that a draw's quads leave in the stamps of a copy.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Marks {
    /// Number in the pass of the segment's first primitive.
    pub first: u32,
    /// Whether a quad that passes its tests changes anything.
    pub writes: bool,
    /// Whether equal depths pass.
    pub inclusive: bool,
    /// Whether its colours are blended, to be put over what is behind when the copies are composed.
    pub over: bool,
}

/// Stamps of samples, in the order of coverage bits in each quad.
#[derive(Clone, Debug, Default)]
pub struct Stamps {
    words: Vec<Stamp>,
    samples: usize,
}

impl Stamps {
    pub(super) fn begin(&mut self, blocks: usize, samples: u32) {
        self.samples = samples as usize;
        self.words.clear();
        self.words.resize(blocks * 64 * self.samples, 0);
    }

    /// Samples per pixel.
    #[inline(always)]
    pub(super) fn samples(&self) -> usize {
        self.samples
    }

    /// The stamps of a quad.
    #[inline(always)]
    pub(super) fn quad(&self, block: u32, position: u8) -> &[Stamp] {
        &self.words[(block as usize * 16 + usize::from(position)) * 4 * self.samples..][..4 * self.samples]
    }

    #[inline(always)]
    pub(super) fn quad_mut(&mut self, block: u32, position: u8) -> &mut [Stamp] {
        &mut self.words[(block as usize * 16 + usize::from(position)) * 4 * self.samples..][..4 * self.samples]
    }

    /// The samples among `live` whose colours no primitive has written.
    pub fn untouched(&self, block: u32, position: u8, live: u16) -> u16 {
        let stamps = self.quad(block, position).iter().enumerate();
        stamps.fold(0, |mask, (bit, &word)| mask | u16::from(word & COLORED == 0) << bit) & live
    }

    /// A primitive has written some samples of a quad; with `colors` their colours too.
    pub fn mark(&mut self, block: u32, position: u8, live: u16, marks: Marks, primitive: u32, colors: bool) {
        if !marks.writes {
            return;
        }
        let new = stamp(marks.first + primitive, marks.inclusive);
        for (bit, word) in self.quad_mut(block, position).iter_mut().enumerate() {
            if live >> bit & 1 == 0 {
                continue;
            }
            let flags = match (colors, marks.over) {
                (false, _) => *word & (COLORED | PARTIAL),
                (true, false) => COLORED,
                // The first of them leaves what is behind to others; those that follow blend over the first.
                (true, true) if *word & COLORED == 0 => COLORED | PARTIAL,
                (true, true) => *word & (COLORED | PARTIAL),
            };
            // Depths are written ahead of colours: the number only grows.
            *word = (*word >> 2).max(new >> 2) << 2 | flags;
        }
    }
}

/// The kinds of the draws of a pass, as far as their order matters.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PassOrder {
    /// Whether anything was drawn that writes.
    pub drawn: bool,
    /// Whether the result may depend on the order of primitives in different pipelines.
    pub matters: bool,
    /// Whether depths or stencil values are written.
    pub writes_depth: bool,
    /// Which depths win: those that are less, or greater; none: the later primitive wins.
    pub nearer: Option<Ordering>,
    /// Whether primitives' numbers are not used. If so, the present value stays where depth does not decide.
    pub unnumbered: bool,
    /// Primitives of the segments so far.
    pub(super) primitives: u32,
    /// The kinds of draws so far.
    kinds: u8,
    /// The channels written by the first draw.
    channels: Option<u32>,
    /// Targets that are blended, a bit each.
    pub(super) blended: u8,
}

impl PassOrder {
    /// A draw; gives what its quads leave, the number of the first primitive and "over" apart.
    pub fn note(&mut self, draw: &Draw, depth: Option<&DepthStencilState>, colors: &[Option<ColorState>]) -> Marks {
        let (mut channels, mut blended, mut combined) = (0, 0, false);
        if draw.shades() {
            for (n, (target, state)) in draw.targets.iter().zip(colors).enumerate() {
                let (Some(target), Some(state)) = (target, state) else { continue };
                if target.payload.is_some() && !state.is_idle() {
                    channels |= u32::from(target.write_mask & 15) << (4 * (n & 7));
                    blended |= u8::from(state.blends()) << (n & 7);
                    combined |= state.combines();
                }
            }
        }
        let stencil = depth.is_some_and(DepthStencilState::uses_stencil);
        let writes_stencil = depth.is_some_and(DepthStencilState::writes_stencil);
        let compare = depth.map_or(Compare::Always, DepthStencilState::compare);
        let writes_depth = depth.is_some_and(DepthStencilState::writes_depth);
        let writes = channels != 0 || writes_depth || writes_stencil;
        if !writes || compare == Compare::Never && !writes_stencil {
            return Marks::default();
        }
        let (kind, nearer) = match compare {
            // Equal depths overwrite each other with what was there.
            _ if !writes_depth => (1, None),
            Compare::Equal | Compare::Never => (1, None),
            Compare::Always => (2, None),
            Compare::Less | Compare::LessEqual => (4, Some(Ordering::Less)),
            Compare::Greater | Compare::GreaterEqual => (8, Some(Ordering::Greater)),
            Compare::NotEqual => (16 | 32, None),
        };
        self.drawn = true;
        self.kinds |= kind;
        self.writes_depth |= writes_depth || writes_stencil;
        // Where directions are mixed the first one stays.
        self.nearer = self.nearer.or(nearer);
        self.blended |= blended;
        let first = *self.channels.get_or_insert(channels);
        self.matters |= stencil || combined || channels != first || self.kinds.count_ones() > 1;
        Marks { first: 0, writes, inclusive: matches!(compare, Compare::LessEqual | Compare::GreaterEqual), over: blended != 0 }
    }

    /// Whether the writer of one sample wins against that of another, which is there already.
    #[inline(always)]
    pub(super) fn wins(&self, a: Stamp, b: Stamp, depths: impl Fn() -> Ordering) -> bool {
        let later = a >> 3 > b >> 3;
        let Some(nearer) = self.nearer else { return later && !self.unnumbered };
        match depths() {
            Ordering::Equal if self.unnumbered => false,
            Ordering::Equal if later => a >> 2 & 1 == 1,
            Ordering::Equal => b >> 2 & 1 == 0,
            order => order == nearer,
        }
    }
}
