//! What scenes compute with: vectors and matrices of f64, hashes and codes, with the same result on every host.

pub use glam::dcamera::rh::{
    proj::directx::{orthographic, perspective},
    view::look_at_mat4,
};
pub use glam::{DMat4, DVec3, dvec3};
pub use num::hash;

/// A model's matrix: its scale, then a rotation about the y axis in radians, then its place.
pub fn placed(at: DVec3, turn: f64, size: DVec3) -> DMat4 {
    DMat4::from_translation(at) * (DMat4::from_rotation_y(turn) * DMat4::from_scale(size))
}

/// Between two colours.
pub fn mix(a: DVec3, b: DVec3, t: f64) -> DVec3 {
    a * (1.0 - t) + b * t
}

/// Numbers as little-endian f32.
pub fn floats(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect()
}

/// A matrix as little-endian f32, column after column.
pub fn matrix(m: DMat4) -> Vec<u8> {
    floats(m.to_cols_array())
}

/// Uniform in [0, 1), by seed, index and channel.
pub fn uniform(seed: u32, index: u32, channel: u32) -> f64 {
    f64::from(hash(hash(hash(seed).wrapping_add(index)).wrapping_add(channel)) >> 8) / 16_777_216.0
}

/// A signed normalised 16-bit code, rounded to nearest.
pub fn snorm16(value: f64) -> i16 {
    (value.clamp(-1.0, 1.0) * 32_767.0).round() as i16
}

/// An unsigned normalised 16-bit code, rounded to nearest.
pub fn unorm16(value: f64) -> u16 {
    (value.clamp(0.0, 1.0) * 65_535.0).round() as u16
}

/// An unsigned normalised 8-bit code, rounded to nearest.
pub fn unorm8(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}
