//! The numbers that the blend equation is computed in.
//!
//! Targets whose channels are 8-bit unsigned normalised without sRGB blend in their own numbers, as the raster operations of a
//! card do: the sources and the constant are first rounded to the target's codes (clamped, ties to even); a factor's complement
//! is `255 - f`; a product of two codes is the nearest integer to `a b / 255` (exactly: 255 is odd, there are no ties); sums
//! and differences saturate at 0 and 255. All of it is whole and below 2^16, so that a vector holds twice as many channels as of
//! `f32`. Vulkan asks for the precision and range of the target's components, which this is. All other targets blend in `f32`.

/// What the blend equation needs of a number; 1 is the number whose complement is 0.
pub(super) trait Number: Copy + PartialOrd {
    const ZERO: Self;

    fn times(self, other: Self) -> Self;

    /// What is missing to 1.
    fn complement(self) -> Self;

    fn plus(self, other: Self) -> Self;

    fn minus(self, other: Self) -> Self;
}

impl Number for f32 {
    const ZERO: f32 = 0.0;

    #[inline(always)]
    fn times(self, other: f32) -> f32 {
        self * other
    }

    #[inline(always)]
    fn complement(self) -> f32 {
        1.0 - self
    }

    #[inline(always)]
    fn plus(self, other: f32) -> f32 {
        self + other
    }

    #[inline(always)]
    fn minus(self, other: f32) -> f32 {
        self - other
    }
}

/// An 8-bit code in 16 bits.
impl Number for u16 {
    const ZERO: u16 = 0;

    #[inline(always)]
    fn times(self, other: u16) -> u16 {
        // At most 255 * 255 + 128, and 254 more in the second line: no overflow.
        let product = self.wrapping_mul(other).wrapping_add(128);
        product.wrapping_add(product >> 8) >> 8
    }

    #[inline(always)]
    fn complement(self) -> u16 {
        255_u16.wrapping_sub(self)
    }

    #[inline(always)]
    fn plus(self, other: u16) -> u16 {
        let sum = self.wrapping_add(other);
        if sum < 255 { sum } else { 255 }
    }

    #[inline(always)]
    fn minus(self, other: u16) -> u16 {
        self.saturating_sub(other)
    }
}
