//! 16.8 fixed-point window coordinates.

use super::{SUBPIXEL, SUBPIXEL_BITS};

/// A window coordinate in 1/256 pixel, the only form in which rasterisation sees a position.
///
/// The value fits 16.8 bits plus sign (`-32768.0 ..= 32767.996`) after clipping to the guard band.
pub type Fx8 = i32;

/// Snaps a window coordinate in pixels to 16.8 fixed point: round to nearest, ties to even; NaN becomes 0, values outside
/// the guard band clamp to it.
#[inline(always)]
pub fn snap(pixels: f32) -> Fx8 {
    // The product is exact: 256 is a power of two, and an overflow to infinity clamps below.
    let scaled = pixels * SUBPIXEL as f32;
    if scaled.is_nan() {
        return 0;
    }
    const LIMIT: f32 = (32768_i32 << SUBPIXEL_BITS) as f32;
    scaled.clamp(-LIMIT, LIMIT - 1.0).round_ties_even() as i32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ties_go_to_even_and_specials_are_defined() {
        assert_eq!(snap(0.5 / 256.0), 0);
        assert_eq!(snap(1.5 / 256.0), 2);
        assert_eq!(snap(-0.5 / 256.0), 0);
        assert_eq!(snap(-1.5 / 256.0), -2);
        assert_eq!(snap(f32::NAN), 0);
        assert_eq!(snap(f32::INFINITY), (32768 << 8) - 1);
        assert_eq!(snap(f32::NEG_INFINITY), -(32768 << 8));
        assert_eq!(snap(12.25), 12 * 256 + 64);
    }
}
