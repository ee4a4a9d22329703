//! Block-compressed texels.

use super::{Format, ONE, decode_srgb8, from_unorm};

/// Decodes a block of 4x4 texels, rows first; components as in [`super::decode`].
///
/// # Panics
/// If the format is not compressed or `block` is shorter than a block.
pub fn decode_block(format: Format, block: &[u8]) -> [[u32; 4]; 16] {
    use Format::*;
    let block = &block[..format.block_bytes() as usize];
    match format {
        Bc1RgbaUnorm | Bc1RgbaUnormSrgb | Bc2RgbaUnorm | Bc2RgbaUnormSrgb | Bc3RgbaUnorm | Bc3RgbaUnormSrgb | Bc7RgbaUnorm
        | Bc7RgbaUnormSrgb => decode_block_rgba8(format, block).map(|texel| {
            let [r, g, b, a] = texel.to_le_bytes();
            let color = |c: u8| if format.is_srgb() { decode_srgb8(c).to_bits() } else { from_unorm(u32::from(c), 255.0) };
            [color(r), color(g), color(b), from_unorm(u32::from(a), 255.0)]
        }),
        Bc4RUnorm | Bc4RSnorm => {
            let mut out = [0.0_f32; 16];
            bcdec_rs::bc4_float(block, &mut out, 4, format == Bc4RSnorm);
            out.map(|r| [r.to_bits(), 0, 0, ONE])
        }
        Bc5RgUnorm | Bc5RgSnorm => {
            let mut out = [0.0_f32; 32];
            bcdec_rs::bc5_float(block, &mut out, 8, format == Bc5RgSnorm);
            std::array::from_fn(|i| [out[2 * i].to_bits(), out[2 * i + 1].to_bits(), 0, ONE])
        }
        Bc6hRgbUfloat | Bc6hRgbFloat => {
            let mut out = [0.0_f32; 48];
            bcdec_rs::bc6h_float(block, &mut out, 12, format == Bc6hRgbFloat);
            std::array::from_fn(|i| [out[3 * i].to_bits(), out[3 * i + 1].to_bits(), out[3 * i + 2].to_bits(), ONE])
        }
        _ => panic!("{} is not a compressed format", format.name()),
    }
}

/// Decodes a block of one of the formats with four 8-bit channels (BC1, BC2, BC3, BC7) to codes: red in the low byte.
///
/// # Panics
/// If the format is another one or `block` is shorter than a block.
pub(crate) fn decode_block_rgba8(format: Format, block: &[u8]) -> [u32; 16] {
    use Format::*;
    let mut out = [0_u8; 64];
    match format {
        Bc1RgbaUnorm | Bc1RgbaUnormSrgb => bcdec_rs::bc1(block, &mut out, 16),
        Bc2RgbaUnorm | Bc2RgbaUnormSrgb => bcdec_rs::bc2(block, &mut out, 16),
        Bc3RgbaUnorm | Bc3RgbaUnormSrgb => bcdec_rs::bc3(block, &mut out, 16),
        Bc7RgbaUnorm | Bc7RgbaUnormSrgb => bcdec_rs::bc7(block, &mut out, 16),
        _ => panic!("{} does not decode to four bytes", format.name()),
    }
    std::array::from_fn(|i| u32::from_le_bytes([out[4 * i], out[4 * i + 1], out[4 * i + 2], out[4 * i + 3]]))
}
