//! Decodes one texel of an S3TC block (EXT_texture_compression_s3tc), for images that the card cannot store compressed.

use gfx::format::Format;

/// Red, green, blue and alpha of a texel, by its number in the block. A block has 8 bytes in BC1 and 16 in the others.
pub fn texel(format: Format, block: &[u8], number: usize) -> [u8; 4] {
    let colors = &block[block.len() - 8..];
    let [a, b] = [0, 2].map(|at| u16::from_le_bytes([colors[at], colors[at + 1]]));
    let wide = |c: u16| {
        let [r, g, b] = [u32::from(c >> 11), u32::from(c >> 5 & 63), u32::from(c & 31)];
        [r << 3 | r >> 2, g << 2 | g >> 4, b << 3 | b >> 2]
    };
    let (first, second) = (wide(a), wide(b));
    let mix = |p: u32, q: u32| std::array::from_fn::<u32, 3, _>(|k| (p * first[k] + q * second[k]) / (p + q));
    // Only BC1 has blocks of three colours.
    let four = a > b || format != Format::Bc1RgbaUnorm;
    let code = colors[4 + number / 4] >> (number % 4 * 2) & 3;
    let ([r, g, b], mut alpha) = match (code, four) {
        (0, _) => (first, 255),
        (1, _) => (second, 255),
        (2, true) => (mix(2, 1), 255),
        (2, false) => (mix(1, 1), 255),
        (_, true) => (mix(1, 2), 255),
        (_, false) => ([0; 3], 0),
    };
    if format == Format::Bc2RgbaUnorm {
        alpha = u32::from(block[number / 2] >> (number % 2 * 4) & 15) * 17;
    } else if format == Format::Bc3RgbaUnorm {
        let [p, q] = [u32::from(block[0]), u32::from(block[1])];
        let mut bits = [0; 8];
        bits[..6].copy_from_slice(&block[2..8]);
        let code = (u64::from_le_bytes(bits) >> (3 * number) & 7) as u32;
        alpha = match code {
            0 => p,
            1 => q,
            _ if p > q => ((8 - code) * p + (code - 1) * q) / 7,
            6 => 0,
            7 => 255,
            _ => ((6 - code) * p + (code - 1) * q) / 5,
        };
    }
    [r, g, b, alpha].map(|value| value as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_of_a_block_lie_between_its_two() {
        // Red and blue: red's code is the larger.
        let block = [0x00, 0xf8, 0x1f, 0x00, 0b1110_0100, 0, 0, 0];
        let row: Vec<[u8; 4]> = (0..4).map(|k| texel(Format::Bc1RgbaUnorm, &block, k)).collect();
        assert_eq!(row, [[255, 0, 0, 255], [0, 0, 255, 255], [170, 0, 85, 255], [85, 0, 170, 255]]);
        // The reverse order: three colours and transparent black.
        let block = [0x1f, 0x00, 0x00, 0xf8, 0b1110_0100, 0, 0, 0];
        let row: Vec<[u8; 4]> = (2..4).map(|k| texel(Format::Bc1RgbaUnorm, &block, k)).collect();
        assert_eq!(row, [[127, 0, 127, 255], [0, 0, 0, 0]]);
    }

    #[test]
    fn alphas_of_a_block_are_four_bits_or_steps() {
        let mut block = [0; 16];
        block[0] = 0xa5;
        let alphas = [0, 1, 2].map(|k| texel(Format::Bc2RgbaUnorm, &block, k)[3]);
        assert_eq!(alphas, [0x55, 0xaa, 0]);
        // 140 and 70 in eight steps: 10 a step; codes 0, 1, 2, 7.
        (block[0], block[1], block[2], block[3]) = (140, 70, 0b10_001_000, 0b1110);
        let alphas = [0, 1, 2, 3].map(|k| texel(Format::Bc3RgbaUnorm, &block, k)[3]);
        assert_eq!(alphas, [140, 70, 130, 80]);
    }
}
