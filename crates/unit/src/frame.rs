//! The machine's own surfaces: what its ROPs have written, in the order in which quads reached them.
//!
//! A surface is stored in blocks of 8x8 pixels, row by row, each contiguous: that is what a ROP cache line holds and what a codec
//! sees. In a block lie 16 quads row by row; in a quad sample after sample, in a sample word after word, and last the four
//! pixels. The codes of a quad are one run in the order of coverage bits (`4 sample + pixel`). A texel takes whole words.

use super::card::Fault;
use super::stamps::Stamps;
use work::{BLOCK, LINE, Signature, Surface, SurfaceKey};

/// A surface and its codes.
#[derive(Clone, Debug)]
pub struct Store {
    /// Its name, shape and address.
    pub surface: Surface,
    /// Its codes, block after block.
    pub codes: Vec<u32>,
    /// The state of each block in memory.
    pub blocks: Vec<BlockState>,
    /// Blocks across.
    pub across: u32,
    /// Words per texel: 1, 2 or 4.
    pub words: u32,
    /// Words per block.
    pub block_words: u32,
    /// The signatures of its tiles, on a machine with rendering elimination.
    pub signatures: TileSignatures,
    /// For a pipeline's copy of a surface, the distance in memory from the surface to the copy; else 0.
    pub offset: u64,
    /// The number of times that all of it was set by something other than a ROP.
    pub renewals: u32,
}

/// How a block lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BlockState {
    /// Not at all: a flag says that it holds the clear value.
    Cleared,
    /// In this many bytes: its size where it is not compressed.
    Stored(u16),
    /// A block of a copy, before the copy has one of its own: in this many bytes at the place of the surface itself.
    Shared(u16),
}

/// The signatures of a surface's tiles, for [rendering elimination](super::rendering_elimination).
#[derive(Clone, Debug, Default)]
pub struct TileSignatures {
    /// For each tile the signature of what drew it; empty where that is not known.
    pub(super) tiles: Vec<Signature>,
    /// The signatures at the last clear of the surface, with the codes of its blocks and how these lie in memory.
    pub(super) before: Vec<Signature>,
    pub(super) codes: Vec<u32>,
    pub(super) blocks: Vec<BlockState>,
    /// Nothing has been drawn since that clear.
    pub(super) cleared: bool,
}

impl TileSignatures {
    /// Whether there are no signatures.
    fn is_empty(&self) -> bool {
        self.tiles.is_empty() && self.before.is_empty()
    }

    /// Something else has written the surface.
    pub fn forget(&mut self) {
        self.tiles.clear();
        self.before.clear();
    }
}

impl Store {
    /// A surface of zeros, raw in memory.
    pub fn new(surface: Surface) -> Store {
        let across = surface.width.div_ceil(BLOCK);
        let down = surface.height.div_ceil(BLOCK);
        let words = surface.format.block_bytes().div_ceil(4);
        let block_words = BLOCK * BLOCK * surface.samples * words;
        let blocks = (across * down) as usize;
        let mut store = Store {
            surface,
            codes: vec![0; blocks * block_words as usize],
            blocks: Vec::new(),
            across,
            words,
            block_words,
            signatures: TileSignatures::default(),
            offset: 0,
            renewals: 0,
        };
        store.blocks = vec![BlockState::Stored(store.block_bytes() as u16); blocks];
        store
    }

    /// Bytes that a block takes in memory when it is not compressed.
    #[inline(always)]
    pub fn block_bytes(&self) -> u32 {
        BLOCK * BLOCK * self.surface.samples * self.surface.format.block_bytes()
    }

    /// The memory of the surface: its first address, and the first address after it.
    fn range(&self) -> (u64, u64) {
        let first = self.surface.address;
        (first, first + self.blocks.len() as u64 * u64::from(self.block_bytes()))
    }

    /// Address of a block.
    #[inline(always)]
    pub fn address(&self, block: u32) -> u64 {
        self.surface.address + self.offset + u64::from(block) * u64::from(self.block_bytes())
    }

    /// Bytes of a block in memory and their address; none where a flag says what it holds.
    #[inline(always)]
    pub fn stored(&self, block: u32) -> Option<(u64, u32)> {
        match self.blocks[block as usize] {
            BlockState::Cleared => None,
            BlockState::Stored(bytes) => Some((self.address(block), u32::from(bytes))),
            BlockState::Shared(bytes) => Some((self.address(block) - self.offset, u32::from(bytes))),
        }
    }

    /// The codes of a block.
    #[inline(always)]
    pub fn block(&self, block: u32) -> &[u32] {
        &self.codes[block as usize * self.block_words as usize..][..self.block_words as usize]
    }

    /// The codes of a block, to change.
    #[inline(always)]
    pub fn block_mut(&mut self, block: u32) -> &mut [u32] {
        let words = self.block_words as usize;
        &mut self.codes[block as usize * words..][..words]
    }

    /// The codes of the quad at a position (`x + 4 y` in quads) of a block.
    #[inline(always)]
    pub fn quad_mut(&mut self, block: u32, position: u8) -> &mut [u32] {
        let quad_words = (self.block_words / 16) as usize;
        &mut self.codes[block as usize * self.block_words as usize + usize::from(position) * quad_words..][..quad_words]
    }

    /// The codes of the quad at a position of a block, to look at.
    #[inline(always)]
    pub fn quad(&self, block: u32, position: u8) -> &[u32] {
        let quad_words = (self.block_words / 16) as usize;
        &self.codes[block as usize * self.block_words as usize + usize::from(position) * quad_words..][..quad_words]
    }

    /// Something other than a ROP has written the surface: all of it lies in memory as it is.
    pub fn in_memory(&mut self) {
        let full = BlockState::Stored(self.block_bytes() as u16);
        self.blocks.fill(full);
        self.signatures.forget();
        self.renewals = self.renewals.wrapping_add(1);
    }

    /// Sets all texels to one code.
    pub fn clear(&mut self, code: [u32; 4]) {
        self.renewals = self.renewals.wrapping_add(1);
        if self.words == 1 {
            self.codes.fill(code[0]);
        } else {
            for texels in self.codes.chunks_exact_mut(4 * self.words as usize) {
                for (run, word) in texels.chunks_exact_mut(4).zip(code) {
                    run.fill(word);
                }
            }
        }
    }

    /// Sets the bits of all texels' first two words that `mask` selects.
    pub fn clear_masked(&mut self, code: [u32; 2], mask: [u32; 2]) {
        self.renewals = self.renewals.wrapping_add(1);
        for texels in self.codes.chunks_exact_mut(4 * self.words as usize) {
            for (w, run) in texels.chunks_exact_mut(4).enumerate() {
                for word in run {
                    *word = *word & !mask[w] | code[w] & mask[w];
                }
            }
        }
    }

    /// The bits under `mask` of a word of the texels, if all texels have the same.
    pub fn uniform(&self, word: u32, mask: u32) -> Option<u32> {
        let words = || self.codes.chunks_exact(4).skip(word as usize).step_by(self.words as usize).flatten();
        let first = words().next()? & mask;
        words().all(|other| other & mask == first).then_some(first)
    }

    /// Index in `codes` of word 0 of a texel.
    fn index(&self, x: u32, y: u32, sample: u32) -> usize {
        let block = (y / BLOCK) * self.across + x / BLOCK;
        let quad = (y % BLOCK / 2) * 4 + x % BLOCK / 2;
        let texel = (quad * self.surface.samples + sample) * self.words * 4 + (y % 2 * 2 + x % 2);
        (block * self.block_words + texel) as usize
    }

    /// Whether texels are single words, one to a pixel: then a row of a block is four pairs of words.
    fn is_plain(&self) -> bool {
        self.surface.samples == 1 && self.surface.format.block_bytes() == 4
    }

    /// For a plain surface where in its block each of a row's eight words is.
    fn row(y: u32) -> [usize; 8] {
        let y = (y % BLOCK) as usize;
        std::array::from_fn(|x| (y / 2 * 4 + x / 2) * 4 + y % 2 * 2 + x % 2)
    }

    /// Takes the texels from bytes laid out as in [`Contents`](work::Contents); false if their number is wrong.
    #[must_use]
    pub fn load(&mut self, bytes: &[u8]) -> bool {
        let Surface { width, height, samples, .. } = self.surface;
        let size = self.surface.format.block_bytes() as usize;
        if bytes.len() != width as usize * height as usize * samples as usize * size {
            return false;
        }
        if self.is_plain() {
            for (y, row) in (0..).zip(bytes.chunks_exact(width as usize * 4)) {
                let places = Store::row(y);
                let blocks = self.codes.chunks_exact_mut(64).skip((y / BLOCK * self.across) as usize);
                for (run, block) in row.chunks(32).zip(blocks) {
                    for (texel, &place) in run.chunks_exact(4).zip(&places) {
                        block[place] = u32::from_le_bytes([texel[0], texel[1], texel[2], texel[3]]);
                    }
                }
            }
            return true;
        }
        let mut texels = bytes.chunks_exact(size);
        for y in 0..height {
            for x in 0..width {
                for sample in 0..samples {
                    let at = self.index(x, y, sample);
                    let texel = texels.next().expect("as many as counted");
                    for (w, part) in texel.chunks(4).enumerate() {
                        let mut word = [0; 4];
                        word[..part.len()].copy_from_slice(part);
                        self.codes[at + 4 * w] = u32::from_le_bytes(word);
                    }
                }
            }
        }
        true
    }

    /// The texels as bytes laid out as in [`Contents`](work::Contents).
    pub fn to_bytes(&self) -> Vec<u8> {
        let Surface { width, height, samples, .. } = self.surface;
        let size = self.surface.format.block_bytes() as usize;
        if self.is_plain() {
            let mut bytes = vec![0; width as usize * height as usize * 4];
            for (y, row) in (0..).zip(bytes.chunks_exact_mut(width as usize * 4)) {
                let places = Store::row(y);
                let blocks = self.codes.chunks_exact(64).skip((y / BLOCK * self.across) as usize);
                for (run, block) in row.chunks_mut(32).zip(blocks) {
                    for (texel, &place) in run.chunks_exact_mut(4).zip(&places) {
                        texel.copy_from_slice(&block[place].to_le_bytes());
                    }
                }
            }
            return bytes;
        }
        let mut bytes = Vec::with_capacity(width as usize * height as usize * samples as usize * size);
        for y in 0..height {
            self.add_row(y, &mut bytes);
        }
        bytes
    }

    /// Appends the bytes of a row.
    fn add_row(&self, y: u32, bytes: &mut Vec<u8>) {
        let size = self.surface.format.block_bytes() as usize;
        for x in 0..self.surface.width {
            for sample in 0..self.surface.samples {
                let at = self.index(x, y, sample);
                for (w, start) in (0..size).step_by(4).enumerate() {
                    bytes.extend_from_slice(&self.codes[at + 4 * w].to_le_bytes()[..4.min(size - start)]);
                }
            }
        }
    }

    /// The bytes of a row of pixels, as [`Store::to_bytes`] has them.
    pub fn row_bytes(&self, y: u32) -> Vec<u8> {
        let mut bytes = Vec::new();
        self.add_row(y, &mut bytes);
        bytes
    }

    /// Number of the texels that differ between two pictures of this surface, as [`Store::to_bytes`] gives them.
    pub fn differing(&self, own: &[u8], reference: &[u8]) -> u64 {
        let size = (self.surface.format.block_bytes() * self.surface.samples) as usize;
        if own.len() != reference.len() {
            return u64::from(self.surface.width) * u64::from(self.surface.height);
        }
        if own == reference {
            return 0;
        }
        own.chunks_exact(size).zip(reference.chunks_exact(size)).filter(|(a, b)| a != b).count() as u64
    }
}

/// All surfaces that the machine has seen.
#[derive(Clone, Debug, Default)]
pub struct FrameBuffers {
    /// The surfaces.
    pub stores: Vec<Store>,
    /// In a pipeline's copies of a pass's attachments, which primitive wrote each sample; else empty.
    pub stamps: Stamps,
}

impl FrameBuffers {
    /// The index of a surface of that name, if there is one.
    pub fn find(&self, key: SurfaceKey) -> Option<usize> {
        self.stores.iter().position(|store| store.surface.key == key)
    }

    /// The index of a surface; made of zeros where it is new or has changed its shape. The store takes the surface's format: views of one image
    /// share its texels.
    pub fn surface(&mut self, surface: &Surface) -> usize {
        match self.find(surface.key) {
            Some(index) => {
                let store = &mut self.stores[index];
                if store.surface.store_shape() != surface.store_shape() {
                    let renewals = store.renewals.wrapping_add(1);
                    *store = Store { renewals, ..Store::new(*surface) };
                }
                if store.surface.address != surface.address {
                    store.signatures.forget();
                }
                store.surface = *surface;
                index
            }
            None => {
                self.stores.push(Store::new(*surface));
                self.stores.len() - 1
            }
        }
    }

    /// Something other than a ROP writes `bytes` bytes of memory from `address` on. The signatures of surfaces there are no longer valid.
    pub fn forget_range(&mut self, address: u64, bytes: u64) {
        for store in &mut self.stores {
            let (first, end) = store.range();
            if address < end && first < address + bytes {
                store.signatures.forget();
            }
        }
    }

    /// Shaders that may write these lines of memory use them: the signatures of surfaces there hold no longer.
    pub fn forget_lines<'a>(&mut self, lines: impl Iterator<Item = &'a u32> + Clone) {
        for store in self.stores.iter_mut().filter(|store| !store.signatures.is_empty()) {
            let (first, end) = store.range();
            if lines.clone().any(|&line| (first / LINE..end.div_ceil(LINE)).contains(&u64::from(line))) {
                store.signatures.forget();
            }
        }
    }

    /// Makes one surface the copy of another.
    ///
    /// # Errors
    /// If there is no store of the other, or its texels lie otherwise.
    pub fn copy(&mut self, from: &Surface, to: &Surface) -> Result<(), Fault> {
        let source = self.find(from.key).filter(|&index| self.stores[index].surface.store_shape() == to.store_shape());
        let Some(source) = source else { return Err(Fault::Copy { from: from.key, to: to.key }) };
        let target = self.surface(to);
        if source != target {
            let codes = self.stores[source].codes.clone();
            let target = &mut self.stores[target];
            target.codes = codes;
            target.in_memory();
        }
        Ok(())
    }
}
