//! Numbers as bytes, little-endian as in traces.

/// The bytes of words.
pub fn word_bytes(words: &[u32]) -> Vec<u8> {
    words.iter().map(|word| word.to_le_bytes()).collect::<Vec<_>>().into_flattened()
}

/// The bytes of 32-bit floats.
pub fn float_bytes(floats: &[f32]) -> Vec<u8> {
    floats.iter().map(|float| float.to_le_bytes()).collect::<Vec<_>>().into_flattened()
}
