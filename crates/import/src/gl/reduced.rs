//! Internal formats with fewer than eight bits a channel. Texels are stored in eight; their values are those that fewer bits have.

use super::consts as e;

const RGB5: u32 = 0x8050;
const RGBA4: u32 = 0x8056;
const RGB5_A1: u32 = 0x8057;
/// Came after OpenGL 1.5.
const RGB565: u32 = 0x8d62;

/// Bits of each channel, in the order in which they are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bits([u8; 4]);

impl Bits {
    /// Eight a channel.
    pub const FULL: Bits = Bits([8; 4]);

    /// Of an internal format, as Mesa's llvmpipe has it: luminance, alpha and intensity of their own have eight.
    pub fn of(internal: u32) -> Bits {
        Bits(match internal {
            e::R3_G3_B2 => [3, 3, 2, 8],
            e::RGB4 => [4, 4, 4, 8],
            RGB5 => [5, 5, 5, 8],
            RGB565 => [5, 6, 5, 8],
            e::RGBA2 | RGBA4 => [4; 4],
            RGB5_A1 => [5, 5, 5, 1],
            e::LUMINANCE4_ALPHA4 => [4; 4],
            _ => return Bits::FULL,
        })
    }

    /// Rounds stored texels of so many channels to the nearest value that the bits have.
    pub fn round(self, channels: usize, texels: &mut [u8]) {
        if self == Bits::FULL {
            return;
        }
        let table = self.0.map(|bits| {
            let most = (1_u32 << bits) - 1;
            let nearest = |code: usize| ((code as u32 * most + 127) / 255 * 255 + most / 2) / most;
            std::array::from_fn::<u8, 256, _>(|code| nearest(code) as u8)
        });
        for texel in texels.chunks_exact_mut(channels) {
            for (channel, code) in texel.iter_mut().enumerate() {
                *code = table[channel % 4][usize::from(*code)];
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_the_nearest_that_the_bits_have() {
        let mut texels: Vec<u8> = (0..=255).flat_map(|code| [code; 4]).collect();
        Bits::of(RGB5_A1).round(4, &mut texels);
        for (code, texel) in (0_u8..=255).zip(texels.chunks_exact(4)) {
            let five = (f64::from(code) / 255.0 * 31.0).round() / 31.0;
            assert_eq!(texel[..3], [(five * 255.0).round() as u8; 3], "{code}");
            assert_eq!(texel[3], if code < 128 { 0 } else { 255 });
        }
        let mut same = [1, 2, 3, 4];
        Bits::of(e::RGBA).round(4, &mut same);
        assert_eq!(same, [1, 2, 3, 4]);
        let mut two = [200, 7];
        Bits::of(e::LUMINANCE4_ALPHA4).round(2, &mut two);
        assert_eq!(two, [204, 0]);
    }
}
