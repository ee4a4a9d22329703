//! Colours of fewer than eight bits per channel. They are stored in eight bits, as codes that these bits can have: the bits are repeated.
//!
//! As in Mesa's llvmpipe, texels that a program gives are rounded to the nearest code. What is drawn or copied loses its lowest bits where
//! five or six are left.

use crate::key::Base;

/// A format of fewer than eight bits per channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Narrow {
    /// Three bits of red and green, two of blue.
    R3G3B2,
    /// Four bits of each colour.
    Rgb4,
    /// Five bits of each colour.
    Rgb5,
    /// Five bits of red and blue, six of green.
    R5G6B5,
    /// Four bits of each colour and of alpha.
    Rgba4,
    /// Five bits of each colour, one of alpha.
    Rgb5A1,
    /// Two bits of alpha. Colours have more than eight bits, of which eight are kept.
    Rgb10A2,
    /// Four bits of luminance and of alpha.
    Luminance4Alpha4,
}

/// WGSL of a channel `$c` in this number of bits. The last factor and shift repeat the bits.
macro_rules! channel {
    ($c:literal, 1) => {
        concat!("f32(u32(saturate(", $c, ") + 0.5))")
    };
    ($c:literal, 2) => {
        concat!("f32((u32(saturate(", $c, ") * 255.0 + 0.5) * 3u + 128u >> 8u) * 85u) / 255.0")
    };
    ($c:literal, 3) => {
        concat!("f32(((u32(saturate(", $c, ") * 255.0 + 0.5) >> 3u) * 7u + 16u >> 5u) * 73u >> 1u) / 255.0")
    };
    ($c:literal, 4) => {
        concat!("f32((u32(saturate(", $c, ") * 255.0 + 0.5) * 15u + 127u) / 255u * 17u) / 255.0")
    };
    ($c:literal, 5) => {
        concat!("f32((u32(saturate(", $c, ") * 255.0 + 0.5) >> 3u) * 33u >> 2u) / 255.0")
    };
    ($c:literal, 8) => {
        $c
    };
    ($c:literal, 6) => {
        concat!("f32((u32(saturate(", $c, ") * 255.0 + 0.5) >> 2u) * 65u >> 4u) / 255.0")
    };
}

/// WGSL of a colour `c` with these bits per channel.
macro_rules! color {
    ($r:tt, $g:tt, $b:tt) => {
        concat!("vec4f(", channel!("c.r", $r), ", ", channel!("c.g", $g), ", ", channel!("c.b", $b), ", 1.0)")
    };
    ($r:tt, $g:tt, $b:tt, $a:tt) => {
        concat!(
            "vec4f(",
            channel!("c.r", $r),
            ", ",
            channel!("c.g", $g),
            ", ",
            channel!("c.b", $b),
            ", ",
            channel!("c.a", $a),
            ")"
        )
    };
}

impl Narrow {
    /// The base format of the same channels with eight bits each.
    pub fn plain(self) -> Base {
        match self {
            Narrow::R3G3B2 | Narrow::Rgb4 | Narrow::Rgb5 | Narrow::R5G6B5 => Base::Rgb,
            Narrow::Rgba4 | Narrow::Rgb5A1 | Narrow::Rgb10A2 => Base::Rgba,
            Narrow::Luminance4Alpha4 => Base::LuminanceAlpha,
        }
    }

    /// Bits of red, green, blue and alpha; 8: a channel that is not narrow or not stored.
    fn bits(self) -> [u32; 4] {
        match self {
            Narrow::R3G3B2 => [3, 3, 2, 8],
            Narrow::Rgb4 => [4, 4, 4, 8],
            Narrow::Rgb5 => [5, 5, 5, 8],
            Narrow::R5G6B5 => [5, 6, 5, 8],
            Narrow::Rgba4 => [4; 4],
            Narrow::Rgb5A1 => [5, 5, 5, 1],
            Narrow::Rgb10A2 => [8, 8, 8, 2],
            Narrow::Luminance4Alpha4 => [4; 4],
        }
    }

    /// A texel that a program gives.
    pub fn given(self, texel: [u8; 4]) -> [u8; 4] {
        self.each(texel, |code, bits| (code * ((1 << bits) - 1) + 127) / 255)
    }

    /// A texel that is computed from others, or a colour with which a buffer is cleared.
    pub fn computed(self, texel: [u8; 4]) -> [u8; 4] {
        self.each(texel, |code, bits| if bits < 5 { (code * ((1 << bits) - 1) + 127) / 255 } else { code >> (8 - bits) })
    }

    fn each(self, texel: [u8; 4], code: impl Fn(u32, u32) -> u32) -> [u8; 4] {
        let bits = self.bits();
        std::array::from_fn(|k| match bits[k] {
            8 => texel[k],
            bits => repeated(code(u32::from(texel[k]), bits), bits),
        })
    }

    /// WGSL of the stored texel, from a colour `c` that is drawn or copied.
    pub fn unswizzle(self) -> &'static str {
        match self {
            Narrow::R3G3B2 => color!(3, 3, 2),
            Narrow::Rgb4 => color!(4, 4, 4),
            Narrow::Rgb5 => color!(5, 5, 5),
            Narrow::R5G6B5 => color!(5, 6, 5),
            Narrow::Rgba4 => color!(4, 4, 4, 4),
            Narrow::Rgb5A1 => color!(5, 5, 5, 1),
            Narrow::Rgb10A2 => color!(8, 8, 8, 2),
            Narrow::Luminance4Alpha4 => concat!("vec4f(", channel!("c.r", 4), ", ", channel!("c.a", 4), ", 0.0, 0.0)"),
        }
    }
}

/// WGSL of the stored texel, from another stored texel `c`.
pub fn restored(format: Option<Narrow>) -> &'static str {
    match format {
        None => "c",
        Some(Narrow::Luminance4Alpha4) => concat!("vec4f(", channel!("c.r", 4), ", ", channel!("c.g", 4), ", 0.0, 0.0)"),
        Some(narrow) => narrow.unswizzle(),
    }
}

/// The code of eight bits that repeats these bits.
fn repeated(code: u32, bits: u32) -> u8 {
    let (mut all, mut width) = (code, bits);
    while width < 8 {
        (all, width) = (all << bits | code, width + bits);
    }
    (all >> (width - 8)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_are_rounded_or_cut_and_their_bits_repeated() {
        assert_eq!(Narrow::R5G6B5.given([10, 10, 255, 7]), [8, 8, 255, 7]);
        assert_eq!(Narrow::R5G6B5.given([13, 6, 3, 7]), [16, 4, 0, 7]);
        assert_eq!(Narrow::R5G6B5.computed([15, 7, 254, 7]), [8, 4, 255, 7]);
        assert_eq!(Narrow::Rgb5A1.given([0, 4, 5, 127]), [0, 0, 8, 0]);
        assert_eq!(Narrow::Rgb5A1.given([0, 255, 132, 128]), [0, 255, 132, 255]);
        assert_eq!(Narrow::Rgba4.computed([77, 8, 9, 255]), [85, 0, 17, 255]);
        assert_eq!(Narrow::Rgb10A2.given([77, 8, 9, 100]), [77, 8, 9, 85]);
        assert_eq!(Narrow::Rgba4.given([9, 8, 0x77, 0xf0]), [17, 0, 0x77, 0xee]);
        assert_eq!(Narrow::R3G3B2.given([36, 200, 128, 1]), [36, 182, 170, 1]);
        // Each code of each width stays as it is.
        for format in [Narrow::R3G3B2, Narrow::Rgb5, Narrow::R5G6B5, Narrow::Rgba4, Narrow::Rgb5A1] {
            for code in 0..=255 {
                let stored = format.given([code; 4]);
                assert_eq!(format.given(stored), stored, "{format:?}");
            }
        }
    }
}
