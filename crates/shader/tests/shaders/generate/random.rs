//! Choices of a generator: from bytes as long as there are some, so that a fuzzer steers them, then from a hash of what was read.

/// A source of choices.
pub struct Random<'a> {
    bytes: &'a [u8],
    state: u64,
}

impl<'a> Random<'a> {
    /// Choices that follow from a number alone.
    pub fn seeded(seed: u64) -> Random<'static> {
        Random { bytes: &[], state: seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) }
    }

    /// Choices that follow from bytes.
    #[allow(dead_code, reason = "the fuzz target makes programs of bytes")]
    pub fn from_bytes(bytes: &'a [u8]) -> Random<'a> {
        Random { bytes, state: 0 }
    }

    /// Any 32 bits.
    pub fn word(&mut self) -> u32 {
        if let Some((&first, rest)) = self.bytes.split_first() {
            self.bytes = rest;
            self.state = (self.state ^ u64::from(first)).wrapping_mul(0x0100_0000_01b3);
            return u32::from(first);
        }
        self.state = self.state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut x = self.state;
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x = (x ^ x >> 27).wrapping_mul(0x94d0_49bb_1331_11eb);
        (x ^ x >> 31) as u32
    }

    /// A number below `n`, which is at least 1.
    pub fn below(&mut self, n: u32) -> u32 {
        self.word() % n
    }

    /// True with a probability of `share` per cent.
    pub fn percent(&mut self, share: u32) -> bool {
        self.below(100) < share
    }

    /// One of these.
    pub fn one<'b, T>(&mut self, of: &'b [T]) -> &'b T {
        &of[self.below(of.len() as u32) as usize]
    }

    /// A word for a buffer: small, any, or the bits of a number that is worth trying. Never NaN.
    pub fn datum(&mut self) -> u32 {
        let any = self.word().wrapping_mul(0x9e37_79b9) ^ self.word() << 16;
        match any % 8 {
            0..=2 => any >> 8 & 7,
            3 => 0,
            4 => *self.one(&SPECIAL),
            5 => ((any >> 8 & 0xffff) as f32 / 4096.0 - 8.0).to_bits(),
            6 => any & 0xff0f_ffff,
            _ => any >> 16,
        }
    }
}

/// Numbers at the ends of types, as integers and in floating point.
const SPECIAL: [u32; 20] = [
    0x7fff_ffff & 0xff7f_ffff, // The largest finite number.
    0x8000_0000,               // The least integer; minus zero.
    0xffff_ff00 & 0xff7f_ff00, // Far below zero.
    0x7f80_0000,               // Infinity.
    0xff80_0000,
    0x0000_0001, // The smallest subnormal number.
    0x807f_ffff,
    0x0080_0000, // The smallest normal number.
    0x3f80_0000, // 1
    0xbf80_0000,
    0x3f00_0000, // 0.5
    0x4020_0000, // 2.5, which rounds to even.
    0x477f_e000, // 65504, the largest 16-bit number.
    0x3880_0000, // The smallest normal 16-bit number.
    0x4f00_0000, // 2^31
    0x4f80_0000, // 2^32
    0xcf00_0000,
    0x0001_ffff,
    0x8000_00ff,
    0x3fc0_0000,
];
