//! Images of textures: how texels are stored, and smaller levels. [`unpack`](super::unpack) reads pixels from the client's memory.

use gfx::format::Format;
use gfx::texel;
use gl_shader::consts as e;
use gl_shader::key::{Base, Channels, Width};
use gl_shader::narrow::Narrow;

use crate::gl::call::{Fault, GlResult};
use crate::gl::names;

const BGRA8: u32 = 0x93a1;
/// Internal formats of few bits.
const LUMINANCE6_ALPHA2: u32 = 0x8044;
const RGB5: u32 = 0x8050;
const RGB8: u32 = 0x8051;
const RGBA4: u32 = 0x8056;
const RGB5_A1: u32 = 0x8057;
const RGBA8: u32 = 0x8058;
const RGB10_A2: u32 = 0x8059;
const RGBA12: u32 = 0x805a;

// Internal formats that came after OpenGL 1.5.
const COMPRESSED_RED: u32 = 0x8225;
const COMPRESSED_RG: u32 = 0x8226;
const RG: u32 = 0x8227;
const R8: u32 = 0x8229;
const R16: u32 = 0x822a;
const RG8: u32 = 0x822b;
const RG16: u32 = 0x822c;
const R16F: u32 = 0x822d;
const R32F: u32 = 0x822e;
const RG16F: u32 = 0x822f;
const RG32F: u32 = 0x8230;
const RGB565: u32 = 0x8d62;
/// RGBA, RGB, alpha, intensity, luminance, luminance and alpha of 32 bits; the same of 16 bits.
const RGBA32F: u32 = 0x8814;
const RGBA16F: u32 = 0x881a;
const LUMINANCE_ALPHA16F: u32 = 0x881f;
const R11F_G11F_B10F: u32 = 0x8c3a;
const DEPTH_COMPONENT32F: u32 = 0x8cac;
const DEPTH32F_STENCIL8: u32 = 0x8cad;
/// The standard's error for an invalid internal format.
const INVALID_VALUE_FORMAT: Fault = Fault::Error("GL_INVALID_VALUE");
/// Format of depth and stencil.
pub const DEPTH: Format = Format::Depth24PlusStencil8;

/// A value in [0, 1] as eight bits.
pub fn byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A number in half precision.
pub fn from_half(bits: u32) -> f32 {
    let texel = texel::decode(Format::R16Float, &(bits as u16).to_le_bytes());
    f32::from_bits(texel[0])
}

/// The base format of an image whose texels a program gives so: Mesa keeps packed ones of few bits as they are.
pub fn base_of(internal: u32, format: u32, kind: u32) -> GlResult<Base> {
    match (internal, format, kind) {
        (e::RGB, e::RGB, e::UNSIGNED_SHORT_5_6_5) => Ok(Base::Narrow(Narrow::R5G6B5)),
        (e::RGBA, e::RGBA, e::UNSIGNED_SHORT_4_4_4_4) => Ok(Base::Narrow(Narrow::Rgba4)),
        (e::RGBA, e::RGBA, e::UNSIGNED_SHORT_5_5_5_1) => Ok(Base::Narrow(Narrow::Rgb5A1)),
        _ => Base::of(internal),
    }
}

/// How texels of a base format are stored.
pub trait StoredFormat: Sized {
    /// The base format of an internal format.
    fn of(internal: u32) -> GlResult<Self>;

    /// The format in which texels are stored.
    fn format(self) -> Format;

    /// Converts texels to the stored format.
    fn encode(self, texels: &[[u8; 4]]) -> Vec<u8>;

    /// Converts floating-point texels to the stored format.
    fn encode_floats(self, texels: &[[f32; 4]]) -> Vec<u8>;
}

impl StoredFormat for Base {
    fn of(internal: u32) -> GlResult<Base> {
        Ok(match internal {
            e::R3_G3_B2 => Base::Narrow(Narrow::R3G3B2),
            e::RGB4 => Base::Narrow(Narrow::Rgb4),
            RGB5 => Base::Narrow(Narrow::Rgb5),
            RGB565 => Base::Narrow(Narrow::R5G6B5),
            e::RGBA2 | RGBA4 => Base::Narrow(Narrow::Rgba4),
            RGB5_A1 => Base::Narrow(Narrow::Rgb5A1),
            RGB10_A2 => Base::Narrow(Narrow::Rgb10A2),
            e::LUMINANCE4_ALPHA4 => Base::Narrow(Narrow::Luminance4Alpha4),
            1 | e::LUMINANCE | e::LUMINANCE4..=e::LUMINANCE16 | e::COMPRESSED_LUMINANCE => Base::Luminance,
            2 | e::LUMINANCE_ALPHA | LUMINANCE6_ALPHA2..=e::LUMINANCE16_ALPHA16 | e::COMPRESSED_LUMINANCE_ALPHA => {
                Base::LuminanceAlpha
            }
            3 | e::RGB | RGB8..=e::RGB16 | e::COMPRESSED_RGB | e::COMPRESSED_RGB_S3TC_DXT1_EXT => Base::Rgb,
            4
            | e::RGBA
            | RGBA8
            // EXT_texture_format_BGRA8888
            | e::BGRA
            | BGRA8
            | RGBA12..=e::RGBA16
            | e::COMPRESSED_RGBA
            | e::COMPRESSED_RGBA_S3TC_DXT1_EXT..=e::COMPRESSED_RGBA_S3TC_DXT5_EXT => Base::Rgba,
            e::SRGB | e::SRGB8 | e::COMPRESSED_SRGB => Base::Srgb,
            e::SRGB_ALPHA | e::SRGB8_ALPHA8 | e::COMPRESSED_SRGB_ALPHA => Base::SrgbAlpha,
            e::ALPHA | e::ALPHA4..=e::ALPHA16 | e::COMPRESSED_ALPHA => Base::Alpha,
            e::INTENSITY..=e::INTENSITY16 | e::COMPRESSED_INTENSITY => Base::Intensity,
            e::DEPTH_COMPONENT | e::DEPTH_COMPONENT16..=e::DEPTH_COMPONENT32 | e::DEPTH_STENCIL | e::DEPTH24_STENCIL8 => {
                Base::Depth
            }
            DEPTH_COMPONENT32F | DEPTH32F_STENCIL8 => Base::Depth,
            e::RED | R8 | R16 | COMPRESSED_RED => Base::Red,
            RG | RG8 | RG16 | COMPRESSED_RG => Base::Rg,
            RGBA32F..=LUMINANCE_ALPHA16F => {
                use Channels::{Alpha, Intensity, Luminance, LuminanceAlpha, Rgb, Rgba};
                let width = if internal < RGBA16F { Width::Single } else { Width::Half };
                let of = [Rgba, Rgb, Alpha, Intensity, Luminance, LuminanceAlpha];
                Base::Float(of[(internal - RGBA32F) as usize % 6], width)
            }
            R16F => Base::Float(Channels::Red, Width::Half),
            R32F => Base::Float(Channels::Red, Width::Single),
            RG16F => Base::Float(Channels::Rg, Width::Half),
            RG32F => Base::Float(Channels::Rg, Width::Single),
            // Half precision represents every value of these 10 or 11 bits.
            R11F_G11F_B10F => Base::Float(Channels::Rgb, Width::Half),
            0..=0xff => return Err(INVALID_VALUE_FORMAT),
            _ => return Err(Fault::Unsupported(format!("textures of internal format {}", names::name(internal)))),
        })
    }

    fn format(self) -> Format {
        match self {
            Base::Alpha | Base::Luminance | Base::Intensity | Base::Red => Format::R8Unorm,
            Base::LuminanceAlpha | Base::Rg => Format::Rg8Unorm,
            Base::Float(_, width) => match (self.plain().format().components(), width) {
                (1, Width::Half) => Format::R16Float,
                (2, Width::Half) => Format::Rg16Float,
                (_, Width::Half) => Format::Rgba16Float,
                (1, Width::Single) => Format::R32Float,
                (2, Width::Single) => Format::Rg32Float,
                (_, Width::Single) => Format::Rgba32Float,
            },
            Base::Rgb | Base::Rgba => Format::Rgba8Unorm,
            Base::Srgb | Base::SrgbAlpha => Format::Rgba8UnormSrgb,
            Base::Depth => DEPTH,
            Base::Narrow(narrow) => narrow.plain().format(),
        }
    }

    fn encode(self, texels: &[[u8; 4]]) -> Vec<u8> {
        match self {
            Base::Alpha => texels.iter().map(|t| t[3]).collect(),
            Base::Rg => texels.iter().map(|t| [t[0], t[1]]).collect::<Vec<_>>().into_flattened(),
            Base::Float(..) => self.encode_floats(&wide(texels)),
            Base::Narrow(narrow) => narrow.plain().encode(&texels.iter().map(|&texel| narrow.given(texel)).collect::<Vec<_>>()),
            Base::Luminance | Base::Intensity | Base::Red => texels.iter().map(|t| t[0]).collect(),
            Base::LuminanceAlpha => texels.iter().map(|t| [t[0], t[3]]).collect::<Vec<_>>().into_flattened(),
            Base::Rgb | Base::Srgb => texels.iter().map(|t| [t[0], t[1], t[2], 255]).collect::<Vec<_>>().into_flattened(),
            Base::Rgba | Base::SrgbAlpha | Base::Depth => texels.as_flattened().to_vec(),
        }
    }

    fn encode_floats(self, texels: &[[f32; 4]]) -> Vec<u8> {
        let format = self.format();
        let bytes = format.block_bytes() as usize;
        let mut out = Vec::with_capacity(texels.len() * bytes);
        for &[r, g, b, a] in texels {
            let kept = match self.plain() {
                Base::Alpha => [a, 0.0, 0.0, 0.0],
                Base::LuminanceAlpha => [r, a, 0.0, 0.0],
                Base::Rgb => [r, g, b, 1.0],
                _ => [r, g, b, a],
            };
            out.extend_from_slice(&texel::encode(format, kept.map(f32::to_bits))[..bytes]);
        }
        out
    }
}

/// Texels of eight bits as numbers.
fn wide(texels: &[[u8; 4]]) -> Vec<[f32; 4]> {
    texels.iter().map(|texel| texel.map(|code| f32::from(code) / 255.0)).collect()
}

/// The next smaller level of an image in the stored format: each texel is the mean of eight (or four, or two) of the larger level.
pub fn half(size: [u32; 3], base: Base, texels: &[u8]) -> ([u32; 3], Vec<u8>) {
    let (format, channels) = (base.format(), base.format().block_bytes() as usize);
    let smaller = size.map(|edge| (edge / 2).max(1));
    let at = |x: u32, y: u32, z: u32| {
        let [x, y, z] = [x.min(size[0] - 1), y.min(size[1] - 1), z.min(size[2] - 1)];
        let texel = ((z * size[1] + y) * size[0] + x) as usize * channels;
        &texels[texel..texel + channels]
    };
    let mut out = Vec::with_capacity(smaller.iter().product::<u32>() as usize * channels);
    for z in 0..smaller[2] {
        for (x, y) in (0..smaller[1]).flat_map(|y| (0..smaller[0]).map(move |x| (x, y))) {
            let eight: [&[u8]; 8] =
                std::array::from_fn(|k| at(2 * x + (k as u32 & 1), 2 * y + (k as u32 >> 1 & 1), 2 * z + (k as u32 >> 2)));
            if matches!(base, Base::Srgb | Base::SrgbAlpha | Base::Float(..)) {
                // A channel is the mean of the decoded values, not of their codes.
                let eight = eight.map(|texel| texel::decode(format, texel).map(f32::from_bits));
                let mean: [f32; 4] = std::array::from_fn(|c| eight.iter().map(|texel| texel[c]).sum::<f32>() / 8.0);
                out.extend(&texel::encode(format, mean.map(f32::to_bits))[..channels]);
            } else {
                let mean = |c: usize| ((eight.iter().map(|texel| u32::from(texel[c])).sum::<u32>() + 4) / 8) as u8;
                match base {
                    Base::Narrow(narrow) if channels == 4 => out.extend(narrow.computed(std::array::from_fn(mean))),
                    Base::Narrow(narrow) => {
                        let [luminance, _, _, alpha] = narrow.computed([mean(0), 0, 0, mean(1)]);
                        out.extend([luminance, alpha]);
                    }
                    _ => out.extend((0..channels).map(mean)),
                }
            }
        }
    }
    (smaller, out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_are_halved_by_means() {
        assert_eq!(half([2, 2, 1], Base::Alpha, &[0, 4, 8, 12]), ([1, 1, 1], vec![6]));
        assert_eq!(half([4, 1, 1], Base::Alpha, &[0, 2, 10, 20]), ([2, 1, 1], vec![1, 15]));
        assert_eq!(half([2, 2, 2], Base::Luminance, &[0, 0, 0, 0, 0, 0, 8, 80]), ([1; 3], vec![11]));
        // Half of white is 188 in the encoding of sRGB; alpha is linear.
        let texels = [255, 0, 255, 0, 0, 0, 255, 200];
        assert_eq!(half([2, 1, 1], Base::SrgbAlpha, &texels), ([1, 1, 1], vec![188, 0, 255, 100]));
    }
}
