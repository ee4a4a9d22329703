//! Rendering elimination (Anglada et al. 2019): a tile is not drawn if memory holds its result already. A signature of all that goes into
//! a tile decides. A surface keeps the signatures of its tiles until something other than a ROP writes it.
//!
//! A pass takes part under three conditions. All its attachments begin with a clear by flag, so that memory still has what was there. Its
//! depths and stencil values are not used afterwards. All its draws have signatures; a draw that does more than write pixels has none.

use super::card::{PassState, Work};
use super::frame::{FrameBuffers, Store, TileSignatures};
use work::{Attachment, BLOCK, Load, Pass, Signature};

/// How a pass uses its attachments, as far as rendering elimination asks.
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

/// The signature of a pass without its draws, if it takes part in rendering elimination.
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
        store.signatures.forget();
        return;
    }
    let TileSignatures { tiles, before, codes, blocks, cleared } = &mut store.signatures;
    if !tiles.is_empty() {
        *before = std::mem::take(tiles);
        codes.clone_from(&store.codes);
        blocks.clone_from(&store.blocks);
    } else if !*cleared {
        before.clear();
    }
    *cleared = of == Use::Empty;
}

/// Whether a pass keeps what it draws into an attachment.
fn wanted(attachment: &Option<Attachment>) -> bool {
    attachment.is_some_and(|attachment| attachment.store || attachment.resolve.is_some())
}

/// Whether a tile of a signed pass can be eliminated, because memory holds its result already. If so the tile is again as it was before
/// the surface was cleared. `list` is the signature of its triangles, `grid` the pass's tiles across and down, of `side` blocks.
pub fn eliminate(frame: &mut FrameBuffers, pass: &PassState, list: Signature, tile: u32, grid: (u32, u32), side: u32) -> bool {
    let Some(seed) = pass.signature else { return false };
    let signature = mix(&[seed, list]);
    let surfaces =
        || pass.pass.color.iter().zip(&pass.color).filter(|(attachment, _)| wanted(attachment)).filter_map(|of| *of.1);
    let at = tile as usize;
    let known =
        surfaces().count() > 0 && surfaces().all(|surface| frame.stores[surface].signatures.before.get(at) == Some(&signature));
    for surface in surfaces() {
        let store = &mut frame.stores[surface];
        store.signatures.tiles.resize((grid.0 * grid.1) as usize, 0);
        store.signatures.tiles[at] = signature;
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
        store.blocks[blocks.clone()].copy_from_slice(&store.signatures.blocks[blocks]);
        store.codes[codes.clone()].copy_from_slice(&store.signatures.codes[codes]);
    }
}
