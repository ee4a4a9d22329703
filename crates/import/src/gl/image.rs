//! Pixel rectangles: from the client's memory to eight bits a channel.

use super::call::{Fault, INVALID_ENUM, INVALID_OPERATION, Outcome};
use super::consts as e;
use super::key::{Base, Channels, Width};
use super::names;
use gfx::format::Format;
use gfx::texel;
use gl_shader::narrow::Narrow;

/// Formats and types of pixels that came after OpenGL 1.5.
const RG: u32 = 0x8227;
const RG_INTEGER: u32 = 0x8228;
const INTEGERS_FIRST: u32 = 0x8d94;
const INTEGERS_LAST: u32 = 0x8d9d;
const UNSIGNED_INT_24_8: u32 = 0x84fa;
const PACKED_FLOATS: u32 = 0x8c3b;
const SHARED_EXPONENT: u32 = 0x8c3e;

/// Maximum number of texels or pixels of a rectangle.
const TEXELS_MAX: u64 = 1 << 28;

/// The layout of pixels in the client's memory (`glPixelStore`).
#[derive(Clone, Copy, Debug)]
pub struct PixelStore {
    /// Rows begin at multiples of this.
    pub alignment: u32,
    /// Pixels of a row; 0: as many as the rectangle has.
    pub row_length: u32,
    /// Rows of an image; 0: as many as the rectangle has.
    pub image_height: u32,
    /// Pixels, rows and images that are skipped.
    pub skip: [u32; 3],
    /// Whether the bytes of a component are swapped.
    pub swap: bool,
    /// Whether the lowest bit of a bitmap's byte is the leftmost.
    pub low_first: bool,
    /// The buffer object that pixels are read from; 0: none.
    pub buffer: u32,
}

impl Default for PixelStore {
    fn default() -> Self {
        PixelStore { alignment: 4, row_length: 0, image_height: 0, skip: [0; 3], swap: false, low_first: false, buffer: 0 }
    }
}

/// A packed pixel type: its bytes, and shift and width of each component.
fn packed(kind: u32) -> Option<(usize, [(u32, u32); 4])> {
    let fields = match kind {
        e::UNSIGNED_BYTE_3_3_2 => (1, [(5, 3), (2, 3), (0, 2), (0, 0)]),
        e::UNSIGNED_BYTE_2_3_3_REV => (1, [(0, 3), (3, 3), (6, 2), (0, 0)]),
        e::UNSIGNED_SHORT_5_6_5 => (2, [(11, 5), (5, 6), (0, 5), (0, 0)]),
        e::UNSIGNED_SHORT_5_6_5_REV => (2, [(0, 5), (5, 6), (11, 5), (0, 0)]),
        e::UNSIGNED_SHORT_4_4_4_4 => (2, [(12, 4), (8, 4), (4, 4), (0, 4)]),
        e::UNSIGNED_SHORT_4_4_4_4_REV => (2, [(0, 4), (4, 4), (8, 4), (12, 4)]),
        e::UNSIGNED_SHORT_5_5_5_1 => (2, [(11, 5), (6, 5), (1, 5), (0, 1)]),
        e::UNSIGNED_SHORT_1_5_5_5_REV => (2, [(0, 5), (5, 5), (10, 5), (15, 1)]),
        e::UNSIGNED_INT_8_8_8_8 => (4, [(24, 8), (16, 8), (8, 8), (0, 8)]),
        e::UNSIGNED_INT_8_8_8_8_REV => (4, [(0, 8), (8, 8), (16, 8), (24, 8)]),
        e::UNSIGNED_INT_10_10_10_2 => (4, [(22, 10), (12, 10), (2, 10), (0, 2)]),
        e::UNSIGNED_INT_2_10_10_10_REV => (4, [(0, 10), (10, 10), (20, 10), (30, 2)]),
        _ => return None,
    };
    Some(fields)
}

/// Places of red, green, blue and alpha among the components of a format; 4: zero, 5: one.
fn places(format: u32) -> Outcome<(usize, [usize; 4])> {
    Ok(match format {
        e::RED => (1, [0, 4, 4, 5]),
        RG => (2, [0, 1, 4, 5]),
        e::GREEN => (1, [4, 0, 4, 5]),
        e::BLUE => (1, [4, 4, 0, 5]),
        e::ALPHA => (1, [4, 4, 4, 0]),
        e::LUMINANCE => (1, [0, 0, 0, 5]),
        e::LUMINANCE_ALPHA => (2, [0, 0, 0, 1]),
        e::RGB => (3, [0, 1, 2, 5]),
        e::BGR => (3, [2, 1, 0, 5]),
        e::RGBA => (4, [0, 1, 2, 3]),
        e::BGRA => (4, [2, 1, 0, 3]),
        e::COLOR_INDEX
        | e::STENCIL_INDEX
        | e::DEPTH_COMPONENT
        | e::DEPTH_STENCIL
        | INTEGERS_FIRST..=INTEGERS_LAST
        | RG_INTEGER => {
            return Err(Fault::Unsupported(format!("pixels of format {}", names::name(format))));
        }
        _ => return Err(INVALID_ENUM),
    })
}

/// Bytes of a component.
fn component_bytes(kind: u32) -> Outcome<usize> {
    Ok(match kind {
        e::UNSIGNED_BYTE | e::BYTE => 1,
        e::UNSIGNED_SHORT | e::SHORT | e::HALF_FLOAT | e::HALF_FLOAT_OES => 2,
        e::UNSIGNED_INT | e::INT | e::FLOAT => 4,
        e::BITMAP | PACKED_FLOATS | SHARED_EXPONENT | UNSIGNED_INT_24_8 => {
            return Err(Fault::Unsupported(format!("pixels of type {}", names::name(kind))));
        }
        _ => return Err(INVALID_ENUM),
    })
}

/// A value in [0, 1] as eight bits.
pub fn byte(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// A type to which a component of a pixel is converted.
pub trait Component: Copy {
    /// Zero, and the greatest value of a normalised component.
    const ENDS: [Self; 2];
    /// Converts a value.
    fn of(value: f64) -> Self;

    /// Appends texels of four bytes; `table` has the value of each byte.
    fn extend(out: &mut Vec<[Self; 4]>, texels: &[[u8; 4]], table: &[Self; 256]) {
        out.extend(texels.iter().map(|texel| texel.map(|code| table[usize::from(code)])));
    }
}

impl Component for u8 {
    const ENDS: [u8; 2] = [0, 255];

    fn of(value: f64) -> u8 {
        byte(value)
    }

    /// A byte is its own value.
    fn extend(out: &mut Vec<[u8; 4]>, texels: &[[u8; 4]], _: &[u8; 256]) {
        out.extend_from_slice(texels);
    }
}

impl Component for f32 {
    const ENDS: [f32; 2] = [0.0, 1.0];

    fn of(value: f64) -> f32 {
        value as f32
    }
}

fn component(kind: u32, bytes: &[u8], swap: bool) -> f64 {
    let mut raw = [0; 4];
    raw[..bytes.len()].copy_from_slice(bytes);
    if swap {
        raw[..bytes.len()].reverse();
    }
    let bits = u32::from_le_bytes(raw);
    match kind {
        e::UNSIGNED_BYTE => f64::from(bits) / 255.0,
        e::BYTE => (2.0 * f64::from(bits as i8) + 1.0) / 255.0,
        e::UNSIGNED_SHORT => f64::from(bits) / 65_535.0,
        e::SHORT => (2.0 * f64::from(bits as i16) + 1.0) / 65_535.0,
        e::UNSIGNED_INT => f64::from(bits) / 4_294_967_295.0,
        e::INT => (2.0 * f64::from(bits as i32) + 1.0) / 4_294_967_295.0,
        e::HALF_FLOAT | e::HALF_FLOAT_OES => f64::from(from_half(bits)),
        _ => f64::from(f32::from_bits(bits)),
    }
}

/// A number in half precision.
pub(super) fn from_half(bits: u32) -> f32 {
    let texel = texel::decode(Format::R16Float, &(bits as u16).to_le_bytes());
    f32::from_bits(texel[0])
}

/// Red, green, blue and alpha of each pixel of a rectangle, rows from the bottom.
pub fn unpack<T: Component>(store: &PixelStore, size: [u32; 3], format: u32, kind: u32, bytes: &[u8]) -> Outcome<Vec<[T; 4]>> {
    // Bytes are converted by a table, since most pixels are bytes.
    let of_byte: [T; 256] = std::array::from_fn(|code| T::of(code as f64 / 255.0));
    let [zero, one] = T::ENDS;
    let count = size.iter().map(|&edge| u64::from(edge)).product::<u64>();
    if count > TEXELS_MAX {
        return Err(Fault::Limit(format!("{count} texels in one call, at most {TEXELS_MAX}")));
    }
    let (components, places) = places(format)?;
    let fields = packed(kind);
    let pixel = match fields {
        Some((bytes, fields)) => {
            if (fields[3].1 > 0) != (components == 4) || components < 3 {
                return Err(INVALID_OPERATION);
            }
            bytes
        }
        None => components * component_bytes(kind)?,
    };
    let part = if fields.is_some() { pixel } else { pixel / components };
    let [width, height, depth] = size.map(|edge| edge as usize);
    let row_pixels = if store.row_length > 0 { store.row_length as usize } else { width };
    // Rows of components that are larger than the alignment are not padded.
    let align = (store.alignment as usize).max(1);
    let row = if part >= align { row_pixels * pixel } else { (row_pixels * pixel).div_ceil(align) * align };
    let rows = if store.image_height > 0 { store.image_height as usize } else { height };
    let start = store.skip[0] as usize * pixel + store.skip[1] as usize * row + store.skip[2] as usize * row * rows;
    // Memory is taken for no more texels than there are bytes.
    let mut out = Vec::with_capacity((count as usize).min(bytes.len()));
    for z in 0..depth {
        for y in 0..height {
            let at = start + (z * rows + y) * row;
            let Some(line) = bytes.get(at..at + width * pixel) else {
                return Err(Fault::Damaged(format!(
                    "the pixels have {} bytes, row {y} ends at {}",
                    bytes.len(),
                    at + width * pixel
                )));
            };
            if format == e::RGBA && kind == e::UNSIGNED_BYTE {
                T::extend(&mut out, line.as_chunks().0, &of_byte);
                continue;
            }
            for texel in line.chunks_exact(pixel) {
                let mut values = [zero, zero, zero, zero, zero, one];
                match fields {
                    Some((_, fields)) => {
                        let mut raw = [0; 4];
                        raw[..pixel].copy_from_slice(texel);
                        if store.swap {
                            raw[..pixel].reverse();
                        }
                        let bits = u32::from_le_bytes(raw);
                        for (value, (shift, width)) in values.iter_mut().zip(fields) {
                            let most = (1_u32 << width) - 1;
                            if most > 0 {
                                *value = T::of(f64::from(bits >> shift & most) / f64::from(most));
                            }
                        }
                    }
                    None if kind == e::UNSIGNED_BYTE => {
                        for (value, &code) in values.iter_mut().zip(texel) {
                            *value = of_byte[usize::from(code)];
                        }
                    }
                    None => {
                        for (value, bytes) in values.iter_mut().zip(texel.chunks_exact(part)) {
                            *value = T::of(component(kind, bytes, store.swap));
                        }
                    }
                }
                out.push(places.map(|place| values[place]));
            }
        }
    }
    Ok(out)
}

/// The base format of an image whose texels a program gives so: Mesa keeps packed ones of few bits as they are.
pub fn base_of(internal: u32, format: u32, kind: u32) -> Outcome<Base> {
    match (internal, format, kind) {
        (e::RGB, e::RGB, e::UNSIGNED_SHORT_5_6_5) => Ok(Base::Narrow(Narrow::R5G6B5)),
        (e::RGBA, e::RGBA, e::UNSIGNED_SHORT_4_4_4_4) => Ok(Base::Narrow(Narrow::Rgba4)),
        (e::RGBA, e::RGBA, e::UNSIGNED_SHORT_5_5_5_1) => Ok(Base::Narrow(Narrow::Rgb5A1)),
        _ => Base::of(internal),
    }
}

/// How texels of a base format are stored.
pub trait Kept: Sized {
    /// The base format of an internal format.
    fn of(internal: u32) -> Outcome<Self>;

    /// The format in which texels are stored.
    fn format(self) -> Format;

    /// Converts texels to the stored format.
    fn keep(self, texels: &[[u8; 4]]) -> Vec<u8>;

    /// Converts floating-point texels to the stored format.
    fn keep_floats(self, texels: &[[f32; 4]]) -> Vec<u8>;
}

impl Kept for Base {
    fn of(internal: u32) -> Outcome<Base> {
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
            e::RED | R8 | R16 => Base::Red,
            RG | RG8 | RG16 => Base::Rg,
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
            Base::Depth => super::card::DEPTH,
            Base::Narrow(narrow) => narrow.plain().format(),
        }
    }

    fn keep(self, texels: &[[u8; 4]]) -> Vec<u8> {
        match self {
            Base::Alpha => texels.iter().map(|t| t[3]).collect(),
            Base::Rg => texels.iter().map(|t| [t[0], t[1]]).collect::<Vec<_>>().into_flattened(),
            Base::Float(..) => self.keep_floats(&wide(texels)),
            Base::Narrow(narrow) => narrow.plain().keep(&texels.iter().map(|&texel| narrow.given(texel)).collect::<Vec<_>>()),
            Base::Luminance | Base::Intensity | Base::Red => texels.iter().map(|t| t[0]).collect(),
            Base::LuminanceAlpha => texels.iter().map(|t| [t[0], t[3]]).collect::<Vec<_>>().into_flattened(),
            Base::Rgb | Base::Srgb => texels.iter().map(|t| [t[0], t[1], t[2], 255]).collect::<Vec<_>>().into_flattened(),
            Base::Rgba | Base::SrgbAlpha | Base::Depth => texels.as_flattened().to_vec(),
        }
    }

    fn keep_floats(self, texels: &[[f32; 4]]) -> Vec<u8> {
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
    fn rows_are_padded_to_the_alignment() {
        let bytes = [1, 2, 3, 0, 4, 5, 6, 0];
        let store = PixelStore::default();
        let texels = unpack::<u8>(&store, [1, 2, 1], e::RGB, e::UNSIGNED_BYTE, &bytes).expect("pixels");
        assert_eq!(texels, [[1, 2, 3, 255], [4, 5, 6, 255]]);
        let store = PixelStore { alignment: 1, ..store };
        let texels = unpack::<u8>(&store, [1, 2, 1], e::BGR, e::UNSIGNED_BYTE, &bytes).expect("pixels");
        assert_eq!(texels, [[3, 2, 1, 255], [5, 4, 0, 255]]);
        assert!(matches!(unpack::<u8>(&store, [2, 2, 1], e::RGB, e::UNSIGNED_BYTE, &bytes), Err(Fault::Damaged(_))));
    }

    #[test]
    fn packed_pixels_are_read_by_their_fields() {
        let store = PixelStore::default();
        let texels = unpack::<u8>(&store, [1, 1, 1], e::RGB, e::UNSIGNED_SHORT_5_6_5, &[0x1f, 0xf8]).expect("pixels");
        assert_eq!(texels, [[255, 0, 255, 255]]);
        let texels = unpack::<u8>(&store, [1, 1, 1], e::BGRA, e::UNSIGNED_INT_8_8_8_8_REV, &[1, 2, 3, 4]).expect("pixels");
        assert_eq!(texels, [[3, 2, 1, 4]]);
        assert_eq!(unpack::<u8>(&store, [1, 1, 1], e::RGB, e::UNSIGNED_SHORT_4_4_4_4, &[0, 0]), Err(INVALID_OPERATION));
    }

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
