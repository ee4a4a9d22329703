//! Streams of bits, lowest first.

/// Takes numbers of stated widths.
pub(super) trait Sink {
    /// Appends the low `bits` (0 to 32) of a number; the others are zero.
    fn put(&mut self, value: u32, bits: u32);
}

/// Writes bytes.
#[derive(Default)]
pub(super) struct Writer {
    bytes: Vec<u8>,
    pending: u64,
    held: u32,
}

impl Writer {
    /// Bits put so far.
    #[cfg(test)]
    pub(super) fn bits(&self) -> u64 {
        8 * self.bytes.len() as u64 + u64::from(self.held)
    }

    /// The bytes, the last one filled up with zeros.
    pub(super) fn finish(mut self) -> Vec<u8> {
        if self.held > 0 {
            self.bytes.push(self.pending as u8);
        }
        self.bytes
    }
}

impl Sink for Writer {
    fn put(&mut self, value: u32, bits: u32) {
        self.pending |= u64::from(value) << self.held;
        self.held += bits;
        while self.held >= 8 {
            self.bytes.push(self.pending as u8);
            self.pending >>= 8;
            self.held -= 8;
        }
    }
}

/// Reads what a [`Writer`] wrote.
pub(super) struct Reader<'a> {
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(bytes: &'a [u8]) -> Reader<'a> {
        Reader { bytes, at: 0 }
    }

    /// The next number of `bits` (0 to 32); none past the end.
    pub(super) fn get(&mut self, bits: u32) -> Option<u32> {
        let mut value = 0_u32;
        for bit in 0..bits {
            let byte = self.bytes.get(self.at / 8)?;
            value |= u32::from(byte >> (self.at % 8) & 1) << bit;
            self.at += 1;
        }
        Some(value)
    }
}
