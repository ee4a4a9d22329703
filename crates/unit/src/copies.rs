//! The copies of a pass's attachments in which pipelines draw apart from each other, and the rules by which copies become one.
//!
//! Every copy starts as the attachment does: cleared, or with what was loaded. For each sample a copy knows which primitive wrote it
//! last. Of two copies of a sample the nearer wins where the pass's draws compare and write depths; of equal depths the one that
//! API order keeps: the earlier, unless the later one's comparison lets equals pass. Elsewhere the later primitive wins. What nobody
//! has written keeps what the pass began with.
//!
//! That gives the picture of API order for every pass whose draws are all of one kind: all write depths and compare in one
//! direction, or all write them without comparing, or none writes them; without blending and stencil, and with the same channels
//! written. [`PassOrder`] knows which passes are not.

use std::cmp::Ordering;

use super::card::PassState;
use super::frame::{BlockState, Frame, Store};
use super::rendering_elimination::TileSignatures;
use gfx::rop::{ColorState, DepthStencilState, compare_depths, composes_over, over};
use gfx::state::Compare;
use work::Draw;

/// What pipelines have of a pass for themselves, and what else a sort class asks of all units: a class hands this to the card, so that no
/// unit knows its class. By default pipelines share the machine's surfaces.
#[derive(Default)]
pub struct Apart {
    /// Where pipelines draw apart from each other, each one's copies of the pass's attachments, by the same index; else none.
    pub copies: Vec<Frame>,
    /// Where pipelines test ahead of the owners of their pixels against what they have drawn themselves, each one's copy of the pass's
    /// depths, by the same index; else none.
    pub seen: Vec<Frame>,
    /// Whether each of these pipelines has one run of a pass's primitives, so that copies that are blended can be put over each other.
    pub chunks: bool,
    /// Whether copies are composed without the numbers of primitives.
    pub unnumbered: bool,
    /// Whether there is rendering elimination: tiles that are in memory already are not drawn.
    pub same_tiles: bool,
    /// Primitives of the pass so far, where there are copies.
    pub primitives: u32,
    /// Passes whose result may depend on an order that pipelines with copies do not keep: number and label.
    pub disordered: Vec<(u32, String)>,
}

/// Bytes from a surface to the first pipeline's copy of it, and from that to the next one's; traces' addresses are below.
const COPY: u64 = 1 << 38;

/// Which primitive wrote a sample: bit 0, it was blended over nothing and has still to be put over what is behind it; bit 1, its colours
/// were written; bit 2, the primitive is let through by an equal depth; from bit 3 its number in the pass, from 1, or 0 for none.
pub type Stamp = u32;

const PARTIAL: Stamp = 1;
const COLORED: Stamp = 2;

/// Primitives that a pass can have.
pub const MAX_PRIMITIVES: u32 = 1 << 29;

/// The stamp of a primitive.
#[inline(always)]
fn stamp(number: u32, inclusive: bool) -> Stamp {
    (number + 1) << 3 | u32::from(inclusive) << 2
}

/// What a draw's quads leave in the stamps of a copy.
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
    fn begin(&mut self, blocks: usize, samples: u32) {
        self.samples = samples as usize;
        self.words.clear();
        self.words.resize(blocks * 64 * self.samples, 0);
    }

    /// Those of a quad.
    #[inline(always)]
    fn quad(&self, block: u32, position: u8) -> &[Stamp] {
        &self.words[(block as usize * 16 + usize::from(position)) * 4 * self.samples..][..4 * self.samples]
    }

    #[inline(always)]
    fn quad_mut(&mut self, block: u32, position: u8) -> &mut [Stamp] {
        &mut self.words[(block as usize * 16 + usize::from(position)) * 4 * self.samples..][..4 * self.samples]
    }

    /// Of some samples of a quad those whose colours nobody has written.
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

/// Of what kind the draws of a pass are, as far as their order matters.
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
    /// Whether nobody looks at the numbers of primitives: where depth does not decide, what is there stays.
    pub unnumbered: bool,
    /// The kinds of draws so far.
    kinds: u8,
    /// The channels written by the first draw.
    channels: Option<u32>,
    /// Targets that are blended, a bit each.
    blended: u8,
}

impl PassOrder {
    /// A draw; gives what its quads leave, the number of the first primitive and "over" apart.
    pub fn note(&mut self, draw: &Draw, depth: Option<&DepthStencilState>, colors: &[Option<ColorState>]) -> Marks {
        let mut channels = 0;
        let mut blended = 0;
        if draw.fragment.is_some() {
            for (n, (target, state)) in draw.targets.iter().zip(colors).enumerate() {
                let (Some(target), Some(state)) = (target, state) else { continue };
                if target.payload.is_some() && !state.is_idle() {
                    channels |= u32::from(target.write_mask & 15) << (4 * (n & 7));
                    blended |= u8::from(state.blends()) << (n & 7);
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
        self.matters |= stencil || blended != 0 || channels != first || self.kinds.count_ones() > 1;
        Marks { first: 0, writes, inclusive: matches!(compare, Compare::LessEqual | Compare::GreaterEqual), over: blended != 0 }
    }

    /// Whether the writer of one sample wins against that of another, which is there already.
    #[inline(always)]
    fn wins(&self, a: Stamp, b: Stamp, depths: impl Fn() -> Ordering) -> bool {
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

/// How far behind a surface a pipeline's copy of it lies in memory.
pub fn behind(pipeline: usize) -> u64 {
    (pipeline as u64 + 1) * COPY
}

/// The same where pipelines draw in their copies: a single one draws in the surface itself.
pub fn offset(pipeline: usize, pipelines: usize) -> u64 {
    if pipelines > 1 { behind(pipeline) } else { 0 }
}

/// Where a pipeline draws: in its own copy where there are copies.
#[inline(always)]
pub fn own<'a>(frame: &'a mut Frame, copies: &'a mut [Frame], pipeline: u8) -> &'a mut Frame {
    match copies.get_mut(usize::from(pipeline)) {
        Some(copy) => copy,
        None => frame,
    }
}

/// Makes a pipeline's copy of a surface with which a pass begins; `written`: it was cleared in memory, copy by copy.
///
/// Loaded contents are not copied: until a pipeline writes back a block of its own, it reads the surface's.
fn begin_store(frame: &Frame, copy: &mut Frame, surface: usize, offset: u64, written: bool) {
    while copy.stores.len() <= surface {
        copy.stores.push(Store {
            codes: Vec::new(),
            blocks: Vec::new(),
            signatures: TileSignatures::default(),
            ..frame.stores[copy.stores.len()]
        });
    }
    let (source, target) = (&frame.stores[surface], &mut copy.stores[surface]);
    let mut codes = std::mem::take(&mut target.codes);
    codes.clone_from(&source.codes);
    let state = |&state: &BlockState| match state {
        BlockState::Stored(bytes) if !written => BlockState::Shared(bytes),
        state => state,
    };
    let blocks = source.blocks.iter().map(state).collect();
    *target = Store { codes, blocks, signatures: TileSignatures::default(), offset, ..*source };
}

/// Makes the copies of the depths against which pipelines test ahead of the owners; `written` as for [`begin`]. They are all behind the
/// surface, that of a single pipeline too: the surface is the owner's.
pub fn begin_seen(frame: &Frame, seen: &mut [Frame], surface: usize, written: bool) {
    for (pipeline, copy) in seen.iter_mut().enumerate() {
        begin_store(frame, copy, surface, behind(pipeline), written);
    }
}

/// Makes the copies of the attachments with which a pass begins. Those in `written` were cleared in memory, copy by copy.
pub fn begin(frame: &Frame, copies: &mut [Frame], pass: &PassState, written: &[usize]) {
    let pipelines = copies.len();
    for (pipeline, copy) in copies.iter_mut().enumerate() {
        copy.stamps.begin(pass.blocks, pass.pass.samples);
        for surface in pass.color.iter().flatten().chain(&pass.depth).copied() {
            begin_store(frame, copy, surface, offset(pipeline, pipelines), written.contains(&surface));
        }
    }
}

/// Two of several.
fn pair<T>(items: &mut [T], a: usize, b: usize) -> (&mut T, &T) {
    let (low, high) = items.split_at_mut(a.max(b));
    if a < b { (&mut low[a], &high[0]) } else { (&mut high[0], &low[b]) }
}

/// Word 0 of a sample's code in a store.
#[inline(always)]
fn place(store: &Store, block: u32, quad: usize, bit: usize) -> usize {
    let quad_words = (store.block_words / 16) as usize;
    let words = store.words as usize;
    block as usize * store.block_words as usize + quad * quad_words + bit / 4 * 4 * words + bit % 4
}

/// The code of a sample whose word 0 is there.
#[inline(always)]
fn code(store: &Store, at: usize) -> [u32; 4] {
    std::array::from_fn(|w| if w < store.words as usize { store.codes[at + 4 * w] } else { 0 })
}

#[inline(always)]
fn put(store: &mut Store, at: usize, code: [u32; 4]) {
    for (w, word) in code.into_iter().enumerate().take(store.words as usize) {
        store.codes[at + 4 * w] = word;
    }
}

impl PassState {
    /// The pass's attachments: index in the frame, and whether their colours are put over each other where a sample is partial.
    fn planes(&self, frame: &Frame) -> impl Iterator<Item = (usize, bool)> {
        let blended = self.order.blended;
        let over = move |n: usize, surface: usize| blended >> n & 1 == 1 && composes_over(frame.stores[surface].surface.format);
        let colors =
            self.color.iter().enumerate().filter_map(move |(n, &surface)| Some((surface?, n < 8 && over(n, surface?))));
        colors.chain(self.depth.map(|surface| (surface, false)))
    }
}

/// Composes a block of one pipeline's copies into another's.
pub fn merge(copies: &mut [Frame], pass: &PassState, into: usize, from: usize, block: u32) {
    let (mine, theirs) = pair(copies, into, from);
    let planes: Vec<(usize, bool)> = pass.planes(theirs).collect();
    for quad in 0..16 {
        for bit in 0..4 * mine.stamps.samples {
            let (a, b) = (mine.stamps.quad(block, quad)[bit], theirs.stamps.quad(block, quad)[bit]);
            if b >> 3 == 0 {
                continue;
            }
            let depths = || {
                let Some(surface) = pass.depth else { return Ordering::Equal };
                let at = place(&theirs.stores[surface], block, usize::from(quad), bit);
                let (mine, theirs) = (&mine.stores[surface], &theirs.stores[surface]);
                compare_depths(theirs.surface.format, theirs.codes[at], mine.codes[at])
            };
            let take = a >> 3 == 0 || pass.order.wins(b, a, depths);
            // What is in front lets what is behind shine through, if anything is there yet.
            let through = a >> 3 != 0 && if take { b } else { a } & PARTIAL != 0;
            if !take && !through {
                continue;
            }
            for &(surface, over_each_other) in &planes {
                let (mine, theirs) = (&mut mine.stores[surface], &theirs.stores[surface]);
                let at = place(theirs, block, usize::from(quad), bit);
                let (front, back) = if take { (code(theirs, at), code(mine, at)) } else { (code(mine, at), code(theirs, at)) };
                let both = through && over_each_other;
                put(mine, at, if both { over(theirs.surface.format, &front, &back) } else { front });
            }
            let (front, back) = if take { (b, a) } else { (a, b) };
            let partial = if through { back & PARTIAL } else { front & PARTIAL };
            mine.stamps.quad_mut(block, quad)[bit] = front & !PARTIAL | partial;
        }
    }
}

/// Makes a block of one pipeline's copies the result.
pub fn finish(frame: &mut Frame, copy: &Frame, pass: &PassState, block: u32) {
    let planes: Vec<(usize, bool)> = pass.planes(copy).collect();
    for (surface, over_each_other) in planes {
        let (result, copy_store) = (&mut frame.stores[surface], &copy.stores[surface]);
        let words = copy_store.block_words as usize;
        let first = block as usize * words;
        if over_each_other {
            for quad in 0..16 {
                for (bit, &word) in copy.stamps.quad(block, quad).iter().enumerate() {
                    let at = place(copy_store, block, usize::from(quad), bit);
                    let front = code(copy_store, at);
                    let behind = code(result, at);
                    let partial = word & PARTIAL != 0;
                    put(result, at, if partial { over(copy_store.surface.format, &front, &behind) } else { front });
                }
            }
        } else {
            result.codes[first..first + words].copy_from_slice(&copy_store.codes[first..first + words]);
        }
    }
}
