//! The bytes of a buffer or texture, shared between threads without locks.
//!
//! Words are relaxed atomics: on every host we know a relaxed load or store is a plain one, and shared mutable memory, which
//! shaders with storage buffers need, stays free of `unsafe`.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use bytemuck::allocation::try_zeroed_slice_box;

/// The system refuses memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the system does not give {bytes} bytes of memory to this process; `ulimit -v` tells what it may have")]
pub struct NoMemory {
    /// What was asked for.
    pub bytes: u64,
}

/// A block of zero-initialised memory of a stated number of bytes, addressed in bytes or little-endian 32-bit words.
#[derive(Default)]
pub struct Words {
    words: Box<[AtomicU32]>,
    bytes: u64,
}

impl Words {
    /// `bytes` zero bytes.
    ///
    /// # Panics
    /// If the system does not give them: [`Words::try_new`] is for amounts that a trace asks for.
    pub fn new(bytes: u64) -> Words {
        Words::try_new(bytes).unwrap_or_else(|error| panic!("{error}"))
    }

    /// `bytes` zero bytes. The system zeroes a page when it is first touched: what is never used takes neither memory nor time.
    ///
    /// # Errors
    /// If the system does not give them.
    pub fn try_new(bytes: u64) -> Result<Words, NoMemory> {
        let n = usize::try_from(bytes.div_ceil(4)).map_err(|_| NoMemory { bytes })?;
        let words = try_zeroed_slice_box(n).map_err(|()| NoMemory { bytes })?;
        Ok(Words { words, bytes })
    }

    /// Length in bytes.
    pub fn len(&self) -> u64 {
        self.bytes
    }

    /// Whether it has no bytes.
    pub fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// The words; the last one may hold up to three bytes beyond the length.
    #[inline(always)]
    pub fn words(&self) -> &[AtomicU32] {
        &self.words
    }

    /// Word `index` (byte `4 index`).
    ///
    /// # Panics
    /// If the index is out of range.
    #[inline(always)]
    pub fn load(&self, index: usize) -> u32 {
        self.words[index].load(Relaxed)
    }

    /// Replaces word `index`.
    ///
    /// # Panics
    /// If the index is out of range.
    #[inline(always)]
    pub fn store(&self, index: usize, value: u32) {
        self.words[index].store(value, Relaxed);
    }

    /// The byte at `offset`.
    ///
    /// # Panics
    /// If the offset is out of range.
    #[inline(always)]
    pub fn byte(&self, offset: usize) -> u8 {
        (self.load(offset / 4) >> (8 * (offset % 4))) as u8
    }

    /// The 16-bit little-endian value at `offset`, at any alignment.
    ///
    /// # Panics
    /// If the range is out of bounds.
    #[inline(always)]
    pub fn u16_at(&self, offset: usize) -> u16 {
        if offset % 4 < 3 {
            (self.load(offset / 4) >> (8 * (offset % 4))) as u16
        } else {
            u16::from(self.byte(offset)) | u16::from(self.byte(offset + 1)) << 8
        }
    }

    /// The 32-bit little-endian value at `offset`, at any alignment.
    ///
    /// # Panics
    /// If the range is out of bounds.
    #[inline(always)]
    pub fn u32_at(&self, offset: usize) -> u32 {
        let (word, shift) = (offset / 4, 8 * (offset % 4) as u32);
        if shift == 0 { self.load(word) } else { self.load(word) >> shift | self.load(word + 1) << (32 - shift) }
    }

    /// Copies bytes out.
    ///
    /// # Panics
    /// If the range is out of bounds.
    pub fn read(&self, offset: u64, out: &mut [u8]) {
        assert!(offset + out.len() as u64 <= self.bytes, "read of {} bytes at {offset} of {}", out.len(), self.bytes);
        let start = offset as usize;
        let mut at = 0;
        if start.is_multiple_of(4) {
            // Whole pictures are read so.
            let (whole, _) = out.as_chunks_mut::<4>();
            at = 4 * whole.len();
            whole.iter_mut().zip(&self.words[start / 4..]).for_each(|(out, word)| *out = word.load(Relaxed).to_le_bytes());
        }
        while at < out.len() {
            let byte = start + at;
            if byte.is_multiple_of(4) && out.len() - at >= 4 {
                out[at..at + 4].copy_from_slice(&self.load(byte / 4).to_le_bytes());
                at += 4;
            } else {
                out[at] = self.byte(byte);
                at += 1;
            }
        }
    }

    /// Copies bytes in.
    ///
    /// # Panics
    /// If the range is out of bounds.
    pub fn write(&self, offset: u64, data: &[u8]) {
        assert!(offset + data.len() as u64 <= self.bytes, "write of {} bytes at {offset} of {}", data.len(), self.bytes);
        let start = offset as usize;
        let mut at = 0;
        if start.is_multiple_of(4) {
            // Textures and rows of them are written so.
            let (whole, _) = data.as_chunks::<4>();
            at = 4 * whole.len();
            whole
                .iter()
                .zip(&self.words[start / 4..])
                .for_each(|(bytes, word)| word.store(u32::from_le_bytes(*bytes), Relaxed));
        }
        while at < data.len() {
            let byte = start + at;
            if byte.is_multiple_of(4) && data.len() - at >= 4 {
                self.store(byte / 4, u32::from_le_bytes(data[at..at + 4].try_into().expect("four bytes")));
                at += 4;
            } else {
                let shift = 8 * (byte % 4);
                let old = self.load(byte / 4);
                self.store(byte / 4, old & !(0xff << shift) | u32::from(data[at]) << shift);
                at += 1;
            }
        }
    }

    /// A copy of all bytes.
    pub fn to_vec(&self) -> Vec<u8> {
        let mut out = vec![0; self.bytes as usize];
        self.read(0, &mut out);
        out
    }
}

impl std::fmt::Debug for Words {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Words({} bytes)", self.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bytes_go_in_and_out_at_any_alignment() {
        for offset in 0..5 {
            for len in 0..9 {
                let words = Words::new(16);
                let data: Vec<u8> = (1..=len).collect();
                words.write(offset, &data);
                let mut back = vec![0; data.len()];
                words.read(offset, &mut back);
                assert_eq!(back, data);
                assert_eq!(
                    words.to_vec().iter().map(|&b| u32::from(b)).sum::<u32>(),
                    data.iter().map(|&b| u32::from(b)).sum::<u32>()
                );
            }
        }
        let words = Words::new(8);
        words.write(0, &[1, 2, 3, 4, 5, 6, 7, 8]);
        assert_eq!(words.u32_at(1), 0x0504_0302);
        assert_eq!(words.u16_at(3), 0x0504);
    }
}
