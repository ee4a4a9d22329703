//! The copies of a pass's attachments in which pipelines draw apart from each other, and the rules by which copies become one.
//!
//! Every copy starts as the attachment does: cleared, or with what was loaded. For each sample a copy knows which primitive wrote it
//! last. Of two copies of a sample the nearer wins where the pass's draws compare and write depths; of equal depths the one that
//! API order keeps: the earlier, unless the later one's comparison lets equals pass. Elsewhere the later primitive wins. What no primitive
//! has written keeps what the pass began with.
//!
//! That gives the picture of API order for every pass whose draws are all of one kind: all write depths and compare in one
//! direction, or all write them without comparing, or none writes them; without blending and stencil, and with the same channels
//! written. [`PassOrder`](super::stamps::PassOrder) knows which passes are not.

use std::cmp::Ordering;

use super::card::PassState;
use super::frame::{BlockState, FrameBuffers, Store, TileSignatures};
use super::stamps::PARTIAL;
use gfx::rop::{compare_depths, composes_over, over};

/// Bytes from a surface to the first pipeline's copy of it, and from that to the next one's; traces' addresses are below.
const COPY: u64 = 1 << 38;

/// The distance in memory from a surface to a pipeline's copy of it.
pub fn behind(pipeline: usize) -> u64 {
    (pipeline as u64 + 1) * COPY
}

/// The same where pipelines draw in their copies: a single one draws in the surface itself.
pub fn offset(pipeline: usize, pipelines: usize) -> u64 {
    if pipelines > 1 { behind(pipeline) } else { 0 }
}

/// The frame buffers in which a pipeline draws: its own copy if there are copies.
#[inline(always)]
pub fn own<'a>(frame: &'a mut FrameBuffers, copies: &'a mut [FrameBuffers], pipeline: u8) -> &'a mut FrameBuffers {
    match copies.get_mut(usize::from(pipeline)) {
        Some(copy) => copy,
        None => frame,
    }
}

/// Makes a pipeline's copy of a surface with which a pass begins; `written`: it was cleared in memory, copy by copy.
///
/// Loaded contents are not copied: until a pipeline writes back a block of its own, it reads the surface's.
fn begin_store(frame: &FrameBuffers, copy: &mut FrameBuffers, surface: usize, offset: u64, written: bool) {
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
pub fn begin_seen(frame: &FrameBuffers, seen: &mut [FrameBuffers], surface: usize, written: bool) {
    for (pipeline, copy) in seen.iter_mut().enumerate() {
        begin_store(frame, copy, surface, behind(pipeline), written);
    }
}

/// Makes the copies of the attachments with which a pass begins. Those in `written` were cleared in memory, copy by copy.
pub fn begin(frame: &FrameBuffers, copies: &mut [FrameBuffers], pass: &PassState, written: &[usize]) {
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
    fn planes(&self, frame: &FrameBuffers) -> impl Iterator<Item = (usize, bool)> {
        let blended = self.order.blended;
        let over = move |n: usize, surface: usize| blended >> n & 1 == 1 && composes_over(frame.stores[surface].surface.format);
        let colors =
            self.color.iter().enumerate().filter_map(move |(n, &surface)| Some((surface?, n < 8 && over(n, surface?))));
        colors.chain(self.depth.map(|surface| (surface, false)))
    }
}

/// Composes a block of one pipeline's copies into another's.
pub fn merge(copies: &mut [FrameBuffers], pass: &PassState, into: usize, from: usize, block: u32) {
    let (mine, theirs) = pair(copies, into, from);
    let planes: Vec<(usize, bool)> = pass.planes(theirs).collect();
    for quad in 0..16 {
        for bit in 0..4 * mine.stamps.samples() {
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
            // The sample in front lets the sample behind shine through, if there is one yet.
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
pub fn finish(frame: &mut FrameBuffers, copy: &FrameBuffers, pass: &PassState, block: u32) {
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
