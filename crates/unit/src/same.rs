//! Tiles that a pass would draw as memory has them already: told by signatures of all that goes into a tile (rendering elimination, Anglada
//! et al. 2019). A surface remembers how its tiles came to be until something else writes it.
//!
//! A pass takes part whose attachments all begin cleared, by flag, so that memory still has what was there; whose depths and stencil values
//! nobody wants afterwards; and whose draws are all signed, which those are not that do more than write pixels.

use super::card::{Card, PassState, Work};
use super::frame::{BlockState, Frame, Store};
use work::{Attachment, BLOCK, LINE, Load, Pass, Signature};

/// How the tiles of a surface came to be.
#[derive(Clone, Debug, Default)]
pub struct Drawn {
    /// For each tile the signature of the pass that drew it as it is; empty where nobody knows.
    tiles: Vec<Signature>,
    /// The same of the tiles as they were when the surface was cleared last, with what they held and how it lies in memory.
    before: Vec<Signature>,
    codes: Vec<u32>,
    blocks: Vec<BlockState>,
    /// Nothing has been drawn since that clear.
    waits: bool,
}

impl Drawn {
    /// Something else has written the surface.
    pub fn forget(&mut self) {
        self.tiles.clear();
        self.before.clear();
    }
}

/// How a pass uses its attachments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// It draws, and is signed.
    Signed,
    /// It draws.
    Drawn,
    /// It has no draws.
    Empty,
}

/// Mixes a signature with others.
fn mix(parts: &[Signature]) -> Signature {
    let mut hasher = blake3::Hasher::new();
    for part in parts {
        hasher.update(&part.to_le_bytes());
    }
    Signature::from_le_bytes(hasher.finalize().as_bytes()[..16].try_into().expect("a hash has 32 bytes"))
}

/// The signature of a pass without its draws, if it takes part.
pub fn sign(pass: &Pass) -> Option<Signature> {
    let clears = |load: Load| load != Load::Load;
    let color = pass.color.iter().flatten().all(|attachment| clears(attachment.load));
    let depth = pass.depth.is_none_or(|attachment| {
        let Attachment { surface, load, store, stencil_load, stencil_store, .. } = attachment;
        let fresh = |has: bool, load, store: bool| !has || clears(load) && !store;
        fresh(surface.format.has_depth(), load, store) && fresh(surface.format.has_stencil(), stencil_load, stencil_store)
    });
    let text = || format!("{:?}", (pass.width, pass.height, pass.samples, &pass.color, &pass.depth));
    (color && depth).then(|| {
        let hash = blake3::hash(text().as_bytes());
        Signature::from_le_bytes(hash.as_bytes()[..16].try_into().expect("a hash has 32 bytes"))
    })
}

/// The signature of a tile's list with another triangle; none where the triangle's draw has none.
pub fn add(list: Signature, work: &Work, triangle: u32) -> Option<Signature> {
    let draw = work.draw.signature?;
    let number = work.segment.triangles[triangle as usize].primitive;
    let signature = *work.segment.signatures.get(number as usize)?;
    // Clipping may make several triangles of a primitive.
    let part = triangle - work.segment.primitives[number as usize].first_triangle;
    Some(mix(&[list, draw, signature, Signature::from(part)]))
}

/// A colour attachment at the beginning of a pass, before it is cleared. `flags`: clears leave memory as it is.
pub fn begin(store: &mut Store, attachment: &Attachment, of: Use, flags: bool) {
    let kept = match of {
        Use::Empty => attachment.store && attachment.load == Load::Load,
        Use::Signed | Use::Drawn => false,
    };
    if kept {
        return;
    }
    if of == Use::Drawn || attachment.load == Load::Load || !flags {
        store.drawn.forget();
        return;
    }
    let Drawn { tiles, before, codes, blocks, waits } = &mut store.drawn;
    if !tiles.is_empty() {
        *before = std::mem::take(tiles);
        codes.clone_from(&store.codes);
        blocks.clone_from(&store.blocks);
    } else if !*waits {
        before.clear();
    }
    *waits = of == Use::Empty;
}

/// Whether a pass wants what it draws into an attachment.
fn wanted(attachment: &Option<Attachment>) -> bool {
    attachment.is_some_and(|attachment| attachment.store || attachment.resolve.is_some())
}

/// A tile of a signed pass is to be drawn: whether memory has it already. If so it is there again, as it was before the surface was
/// cleared. `list` is the signature of its triangles, `grid` the pass's tiles across and down, of `side` blocks.
pub fn known(frame: &mut Frame, pass: &PassState, list: Signature, tile: u32, grid: (u32, u32), side: u32) -> bool {
    let Some(seed) = pass.signature else { return false };
    let signature = mix(&[seed, list]);
    let surfaces =
        || pass.pass.color.iter().zip(&pass.color).filter(|(attachment, _)| wanted(attachment)).filter_map(|of| *of.1);
    let at = tile as usize;
    let known =
        surfaces().count() > 0 && surfaces().all(|surface| frame.stores[surface].drawn.before.get(at) == Some(&signature));
    for surface in surfaces() {
        let store = &mut frame.stores[surface];
        store.drawn.tiles.resize((grid.0 * grid.1) as usize, 0);
        store.drawn.tiles[at] = signature;
        if known {
            let (x, y) = (tile % grid.0 * side, tile / grid.0 * side);
            put_back(store, x, y, side);
        }
    }
    known
}

/// Puts the blocks of a tile back as they were.
fn put_back(store: &mut Store, x: u32, y: u32, side: u32) {
    let down = store.surface.height.div_ceil(BLOCK);
    let words = store.block_words as usize;
    for y in y..(y + side).min(down) {
        let row = (y * store.across) as usize;
        let blocks = row + x as usize..row + (x + side).min(store.across) as usize;
        let codes = blocks.start * words..blocks.end * words;
        store.blocks[blocks.clone()].copy_from_slice(&store.drawn.blocks[blocks]);
        store.codes[codes.clone()].copy_from_slice(&store.drawn.codes[codes]);
    }
}

/// Memory of so many bytes is written, by something other than a ROP.
pub fn written(card: &mut Card, address: u64, bytes: u64) {
    for store in &mut card.frame.stores {
        let (first, end) = range(store);
        if address < end && first < address + bytes {
            store.drawn.forget();
        }
    }
}

/// These lines of memory are used by shaders that may write them.
pub fn touched<'a>(card: &mut Card, lines: impl Iterator<Item = &'a u32> + Clone) {
    for store in card.frame.stores.iter_mut().filter(|store| !(store.drawn.tiles.is_empty() && store.drawn.before.is_empty())) {
        let (first, end) = range(store);
        if lines.clone().any(|&line| (first / LINE..end.div_ceil(LINE)).contains(&u64::from(line))) {
            store.drawn.forget();
        }
    }
}

/// Where a surface lies in memory.
fn range(store: &Store) -> (u64, u64) {
    let first = store.surface.address;
    (first, first + store.blocks.len() as u64 * u64::from(store.block_bytes()))
}
