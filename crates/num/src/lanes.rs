//! Lanes: one value for each invocation of a batch, the unit in which shaders run and textures are sampled.

use bytemuck::{Pod, Zeroable};

/// Invocations in a batch: 16 quads of 4. Lane `4 q + p` is pixel `p` of quad `q`; `p` = 0 (0,0), 1 (1,0), 2 (0,1), 3 (1,1).
pub const LANES: usize = 64;

/// Quads in a batch.
pub const QUADS: usize = LANES / 4;

/// One bit a lane; bit `i` is lane `i`.
pub type Mask = u64;

/// A 32-bit value a lane: the bits of a `u32`, an `i32`, an `f32`, or a Boolean as 0 or 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C, align(64))]
pub struct Lanes(pub [u32; LANES]);

impl Lanes {
    /// All lanes zero.
    pub const ZERO: Lanes = Lanes([0; LANES]);

    /// The same bits in all lanes.
    #[inline(always)]
    pub fn splat(bits: u32) -> Lanes {
        Lanes([bits; LANES])
    }

    /// The same number in all lanes.
    #[inline(always)]
    pub fn splat_f32(value: f32) -> Lanes {
        Lanes([value.to_bits(); LANES])
    }

    /// As floating-point numbers.
    #[inline(always)]
    pub fn f32(&self) -> &[f32; LANES] {
        bytemuck::cast_ref(&self.0)
    }

    /// As floating-point numbers, to write.
    #[inline(always)]
    pub fn f32_mut(&mut self) -> &mut [f32; LANES] {
        bytemuck::cast_mut(&mut self.0)
    }

    /// As signed integers.
    #[inline(always)]
    pub fn i32(&self) -> &[i32; LANES] {
        bytemuck::cast_ref(&self.0)
    }
}

impl Default for Lanes {
    fn default() -> Self {
        Lanes::ZERO
    }
}
