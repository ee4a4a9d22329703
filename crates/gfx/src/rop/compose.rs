//! Composition: what of several copies of a sample remains where pipelines have drawn into frame buffers of their own.

use std::cmp::Ordering;

use super::channels::write_bits;
use super::code_words;
use crate::format::{Format, TexelKind};
use crate::texel::{decode_code, encode_code};

/// How the depths in two codes of a format compare; equal where one is no number, or where the format has no depth.
#[inline(always)]
pub fn compare_depths(format: Format, a: u32, b: u32) -> Ordering {
    match format {
        Format::Depth24Plus | Format::Depth24PlusStencil8 => (a & 0x00ff_ffff).cmp(&(b & 0x00ff_ffff)),
        Format::Depth32Float | Format::Depth32FloatStencil8 => {
            f32::from_bits(a).partial_cmp(&f32::from_bits(b)).unwrap_or(Ordering::Equal)
        }
        Format::Depth16Unorm => a.cmp(&b),
        _ => Ordering::Equal,
    }
}

/// Whether colours of a format can be composed "over" each other: it has alpha, and its values are numbers that can be added.
pub fn composes_over(format: Format) -> bool {
    !format.is_compressed()
        && !format.is_depth_stencil()
        && format.kind() == TexelKind::Float
        && write_bits(format, 8) != [0; 4]
}

/// The code of a colour over another (Porter and Duff 1984), both with their alphas multiplied in: `front + (1 - alpha) back`, for
/// alpha too; in linear light for sRGB formats.
///
/// # Panics
/// If a code is shorter than the format's.
pub fn over(format: Format, front: &[u32], back: &[u32]) -> [u32; 4] {
    let words = code_words(format);
    let front = decode_code(format, &front[..words]).map(f32::from_bits);
    let back = decode_code(format, &back[..words]).map(f32::from_bits);
    let through = 1.0 - front[3];
    encode_code(format, std::array::from_fn(|c| (front[c] + through * back[c]).to_bits()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn depths_compare_as_numbers_without_what_is_stored_beside_them() {
        let float = |a: f32, b: f32| compare_depths(Format::Depth32Float, a.to_bits(), b.to_bits());
        assert_eq!(float(0.25, 0.5), Ordering::Less);
        assert_eq!(float(-0.5, -0.25), Ordering::Less);
        assert_eq!(float(-0.0, 0.0), Ordering::Equal);
        assert_eq!(float(f32::NAN, 0.0), Ordering::Equal);
        assert_eq!(compare_depths(Format::Depth24PlusStencil8, 0xff00_0001, 2), Ordering::Less);
        assert_eq!(compare_depths(Format::Depth16Unorm, 3, 2), Ordering::Greater);
        assert_eq!(compare_depths(Format::Stencil8, 3, 2), Ordering::Equal);
    }

    #[test]
    fn over_hides_adds_and_lets_through() {
        let code = |texel: [f32; 4]| encode_code(Format::Rgba8Unorm, texel.map(f32::to_bits));
        let back = code([0.2, 0.4, 0.6, 1.0]);
        let of = |front: [f32; 4]| over(Format::Rgba8Unorm, &code(front), &back);
        assert_eq!(of([0.0; 4])[0], back[0]);
        assert_eq!(of([1.0, 0.0, 0.0, 1.0])[0], code([1.0, 0.0, 0.0, 1.0])[0]);
        assert_eq!(of([0.4, 0.0, 0.0, 0.4])[0], code([0.52, 0.24, 0.36, 1.0])[0]);
        assert!(composes_over(Format::Rgba8Unorm) && composes_over(Format::Rgba16Float));
        assert!(!composes_over(Format::Rg8Unorm) && !composes_over(Format::Rgba8Uint) && !composes_over(Format::Depth32Float));
    }
}
