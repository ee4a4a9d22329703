//! Pixel rectangles in the client's memory: their layout, and their components as bytes or numbers.

use gl_shader::consts as e;
use gl_shader::key::Base;

use crate::gl::call::{Fault, GlResult, INVALID_ENUM, INVALID_OPERATION};
use crate::gl::names;
use crate::gl::texels::image::{byte, from_half};

/// Formats and types of pixels that came after OpenGL 1.5.
const RG: u32 = 0x8227;
const RG_INTEGER: u32 = 0x8228;
const INTEGERS_FIRST: u32 = 0x8d94;
const INTEGERS_LAST: u32 = 0x8d9d;
pub const UNSIGNED_INT_24_8: u32 = 0x84fa;
const PACKED_FLOATS: u32 = 0x8c3b;
const SHARED_EXPONENT: u32 = 0x8c3e;
/// A depth in single precision, and a word whose lowest byte is a stencil value.
pub const FLOAT_AND_STENCIL: u32 = 0x8dad;
/// Formats of extensions: alpha first; luminance and differences of colours.
const ABGR: u32 = 0x8000;
const YCBCR: u32 = 0x8757;
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

impl PixelStore {
    /// The same for rectangles: skipped images count in three dimensions only.
    pub fn plane(self) -> PixelStore {
        PixelStore { image_height: 0, skip: [self.skip[0], self.skip[1], 0], ..self }
    }
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

/// Whether pixels of a format may have a type. Mesa decides so for textures and for pixels that are drawn.
pub fn can_have(format: u32, kind: u32) -> GlResult {
    let plain = match kind {
        e::UNSIGNED_BYTE | e::BYTE | e::UNSIGNED_SHORT | e::SHORT | e::UNSIGNED_INT | e::INT => true,
        e::FLOAT | e::HALF_FLOAT | e::HALF_FLOAT_OES => true,
        e::BITMAP | PACKED_FLOATS | SHARED_EXPONENT | UNSIGNED_INT_24_8 | FLOAT_AND_STENCIL => false,
        _ if packed(kind).is_some() => false,
        _ if format != YCBCR => return Err(INVALID_ENUM),
        _ => false,
    };
    let fields = |shifts: &[u32]| packed(kind).is_some_and(|(_, [.., (_, last)])| shifts.contains(&last));
    let can = match format {
        YCBCR => return Err(Fault::Unsupported(format!("pixels of format {}", names::name(format)))),
        e::DEPTH_STENCIL => matches!(kind, UNSIGNED_INT_24_8 | FLOAT_AND_STENCIL),
        INTEGERS_FIRST..=INTEGERS_LAST | RG_INTEGER => false,
        e::COLOR_INDEX | e::STENCIL_INDEX => plain || kind == e::BITMAP,
        e::RGB => plain || fields(&[0]) || matches!(kind, PACKED_FLOATS | SHARED_EXPONENT),
        e::RGBA | e::BGRA => plain || fields(&[1, 2, 4, 8]),
        ABGR => plain || fields(&[4, 8]),
        e::DEPTH_COMPONENT => plain,
        _ => places(format).map(|_| plain)?,
    };
    if can { Ok(()) } else { Err(INVALID_OPERATION) }
}

/// Places of red, green, blue and alpha among the components of a format; 4: zero, 5: one.
fn places(format: u32) -> GlResult<(usize, [usize; 4])> {
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
        ABGR => (4, [3, 2, 1, 0]),
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
fn component_bytes(kind: u32) -> GlResult<usize> {
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

/// A type to which a component of a pixel is converted.
pub trait Component: Copy {
    /// Zero, and the greatest value of a normalised component.
    const ENDS: [Self; 2];
    /// Converts a value.
    fn of(value: f64) -> Self;
    /// Converts a texel of bytes; `table` has the value of each byte.
    fn of_bytes(texel: [u8; 4], table: &[Self; 256]) -> [Self; 4];
}

impl Component for u8 {
    const ENDS: [u8; 2] = [0, 255];

    fn of(value: f64) -> u8 {
        byte(value)
    }

    /// A byte is its own value.
    #[inline(always)]
    fn of_bytes(texel: [u8; 4], _: &[u8; 256]) -> [u8; 4] {
        texel
    }
}

impl Component for f32 {
    const ENDS: [f32; 2] = [0.0, 1.0];

    fn of(value: f64) -> f32 {
        value as f32
    }

    #[inline(always)]
    fn of_bytes(texel: [u8; 4], table: &[f32; 256]) -> [f32; 4] {
        texel.map(|code| table[usize::from(code)])
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

/// Where the rows of a rectangle lie in the client's memory.
struct Rows {
    /// Width, height and depth of the rectangle.
    size: [usize; 3],
    /// Bytes of a pixel.
    pixel: usize,
    /// Where the first row begins.
    start: usize,
    /// Bytes from a row to the next, and rows from an image to the next.
    step: [usize; 2],
}

impl Rows {
    /// The rows of an image. A pixel has `pixel` bytes and consists of components of `part` bytes.
    fn new(store: &PixelStore, size: [u32; 3], pixel: usize, part: usize) -> Rows {
        let size = size.map(|edge| edge as usize);
        let pixels = if store.row_length > 0 { store.row_length as usize } else { size[0] };
        // Rows of components that are larger than the alignment are not padded.
        let align = (store.alignment as usize).max(1);
        let row = if part >= align { pixels * pixel } else { (pixels * pixel).div_ceil(align) * align };
        let rows = if store.image_height > 0 { store.image_height as usize } else { size[1] };
        let start = store.skip[0] as usize * pixel + store.skip[1] as usize * row + store.skip[2] as usize * row * rows;
        Rows { size, pixel, start, step: [row, rows] }
    }

    /// Does something with the bytes of each row.
    fn each(&self, bytes: &[u8], mut what: impl FnMut(&[u8])) -> GlResult {
        let Rows { size: [width, height, depth], pixel, start, step: [row, rows] } = *self;
        for z in 0..depth {
            for y in 0..height {
                let at = start + (z * rows + y) * row;
                let end = at + width * pixel;
                let Some(line) = bytes.get(at..end) else {
                    return Err(Fault::Damaged(format!("the pixels have {} bytes, row {y} ends at {end}", bytes.len())));
                };
                what(line);
            }
        }
        Ok(())
    }

    /// Texels for which memory is taken: no more than there are bytes.
    fn room(&self, bytes: &[u8]) -> usize {
        self.size.iter().product::<usize>().min(bytes.len())
    }
}

/// Refuses a rectangle of more texels than one call may have.
fn verify(size: [u32; 3]) -> GlResult {
    let count = size.iter().map(|&edge| u64::from(edge)).product::<u64>();
    if count > TEXELS_MAX {
        return Err(Fault::Limit(format!("{count} texels in one call, at most {TEXELS_MAX}")));
    }
    Ok(())
}

/// Red, green, blue and alpha of each pixel of a rectangle, rows from the bottom.
pub fn unpack<T: Component>(store: &PixelStore, size: [u32; 3], format: u32, kind: u32, bytes: &[u8]) -> GlResult<Vec<[T; 4]>> {
    // Bytes are converted by a table, since most pixels are bytes.
    let of_byte: [T; 256] = std::array::from_fn(|code| T::of(code as f64 / 255.0));
    let [zero, one] = T::ENDS;
    verify(size)?;
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
    let rows = Rows::new(store, size, pixel, part);
    let mut out = Vec::with_capacity(rows.room(bytes));
    if kind == e::UNSIGNED_BYTE {
        rows.each(bytes, |line| texels_of_bytes(format, line, |texel| T::of_bytes(texel, &of_byte), &mut out))?;
        return Ok(out);
    }
    let texel_of = |texel: &[u8]| {
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
            None => {
                for (value, bytes) in values.iter_mut().zip(texel.chunks_exact(part)) {
                    *value = T::of(component(kind, bytes, store.swap));
                }
            }
        }
        places.map(|place| values[place])
    };
    rows.each(bytes, |line| out.extend(line.chunks_exact(pixel).map(texel_of)))?;
    Ok(out)
}

/// Appends the texels of a row of pixels whose components are bytes. Each format has a loop of its own, of which the compiler makes vectors.
fn texels_of_bytes<T>(format: u32, line: &[u8], texel: impl Fn([u8; 4]) -> T, out: &mut Vec<T>) {
    #[inline(always)]
    fn extend<const N: usize, T>(line: &[u8], out: &mut Vec<T>, texel: impl Fn([u8; N]) -> T) {
        out.extend(line.as_chunks().0.iter().map(|&pixel| texel(pixel)));
    }
    match format {
        e::RED => extend(line, out, |[r]| texel([r, 0, 0, 255])),
        RG => extend(line, out, |[r, g]| texel([r, g, 0, 255])),
        e::GREEN => extend(line, out, |[g]| texel([0, g, 0, 255])),
        e::BLUE => extend(line, out, |[b]| texel([0, 0, b, 255])),
        e::ALPHA => extend(line, out, |[a]| texel([0, 0, 0, a])),
        e::LUMINANCE => extend(line, out, |[l]| texel([l, l, l, 255])),
        e::LUMINANCE_ALPHA => extend(line, out, |[l, a]| texel([l, l, l, a])),
        e::RGB => extend(line, out, |[r, g, b]| texel([r, g, b, 255])),
        e::BGR => extend(line, out, |[b, g, r]| texel([r, g, b, 255])),
        e::BGRA => extend(line, out, |[b, g, r, a]| texel([r, g, b, a])),
        ABGR => extend(line, out, |[a, b, g, r]| texel([r, g, b, a])),
        // The only other format that `places` knows.
        _ => extend(line, out, texel),
    }
}

/// The bytes of a rectangle without what lies between its rows, where a base format stores the bytes of the program's pixels as they are.
pub fn stored(
    store: &PixelStore,
    size: [u32; 3],
    base: Base,
    format: u32,
    kind: u32,
    bytes: &[u8],
) -> Option<GlResult<Vec<u8>>> {
    let components = match (base, format) {
        (Base::Luminance | Base::Intensity | Base::Red, e::LUMINANCE | e::RED) | (Base::Alpha, e::ALPHA) => 1,
        (Base::LuminanceAlpha, e::LUMINANCE_ALPHA) | (Base::Rg, RG) => 2,
        (Base::Rgba | Base::SrgbAlpha, e::RGBA) => 4,
        _ => return None,
    };
    (kind == e::UNSIGNED_BYTE).then(|| {
        verify(size)?;
        let rows = Rows::new(store, size, components, 1);
        let mut out = Vec::with_capacity(rows.room(bytes) * components);
        rows.each(bytes, |line| out.extend_from_slice(line))?;
        Ok(out)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gl::texels::image::StoredFormat;

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
    fn formats_have_the_types_that_mesa_lets_them_have() {
        const TYPES: [u32; 25] = [
            e::BYTE,
            e::UNSIGNED_BYTE,
            e::SHORT,
            e::UNSIGNED_SHORT,
            e::INT,
            e::UNSIGNED_INT,
            e::FLOAT,
            e::HALF_FLOAT,
            e::BITMAP,
            e::UNSIGNED_BYTE_3_3_2,
            e::UNSIGNED_BYTE_2_3_3_REV,
            e::UNSIGNED_SHORT_5_6_5,
            e::UNSIGNED_SHORT_4_4_4_4,
            e::UNSIGNED_SHORT_4_4_4_4_REV,
            e::UNSIGNED_SHORT_5_5_5_1,
            e::UNSIGNED_SHORT_1_5_5_5_REV,
            e::UNSIGNED_INT_8_8_8_8,
            e::UNSIGNED_INT_8_8_8_8_REV,
            e::UNSIGNED_INT_10_10_10_2,
            e::UNSIGNED_INT_2_10_10_10_REV,
            UNSIGNED_INT_24_8,
            PACKED_FLOATS,
            SHARED_EXPONENT,
            FLOAT_AND_STENCIL,
            0x140a,
        ];
        // A dot for each type that Mesa 22.3 takes, for pixels that are drawn as for textures.
        let one = "........-----------------";
        let rows = [
            (e::COLOR_INDEX, ".........----------------"),
            (e::DEPTH_COMPONENT, one),
            (e::RED, one),
            (e::GREEN, one),
            (e::BLUE, one),
            (e::ALPHA, one),
            (e::LUMINANCE, one),
            (e::LUMINANCE_ALPHA, one),
            (e::BGR, one),
            (RG, one),
            (e::RGB, "........-...---------..--"),
            (e::RGBA, "........----........-----"),
            (e::BGRA, "........----........-----"),
            (ABGR, "........----..--..-------"),
            (e::DEPTH_STENCIL, "--------------------.--.-"),
            (INTEGERS_FIRST, "-------------------------"),
            (0x8049, "-------------------------"),
        ];
        for (format, row) in rows {
            let found: String = TYPES.iter().map(|&kind| if can_have(format, kind).is_ok() { '.' } else { '-' }).collect();
            assert_eq!(found, row, "{format:x}");
        }
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

    const FORMATS: [u32; 12] =
        [ABGR, e::RED, RG, e::GREEN, e::BLUE, e::ALPHA, e::LUMINANCE, e::LUMINANCE_ALPHA, e::RGB, e::BGR, e::RGBA, e::BGRA];

    #[test]
    fn bytes_have_the_places_of_their_format() {
        let bytes: Vec<u8> = (0..48).map(|k| k * 5 + 3).collect();
        for format in FORMATS {
            let (components, places) = places(format).expect("a format of colours");
            let size = [(48 / components) as u32, 1, 1];
            let texels = unpack::<u8>(&PixelStore::default(), size, format, e::UNSIGNED_BYTE, &bytes).expect("a row");
            let expected: Vec<[u8; 4]> = bytes
                .chunks_exact(components)
                .map(|pixel| {
                    places.map(|place| match place {
                        4 => 0,
                        5 => 255,
                        place => pixel[place],
                    })
                })
                .collect();
            assert_eq!(texels, expected, "{format:x}");
            let floats = unpack::<f32>(&PixelStore::default(), size, format, e::UNSIGNED_BYTE, &bytes).expect("a row");
            let expected: Vec<[f32; 4]> =
                expected.iter().map(|texel| texel.map(|code| (f64::from(code) / 255.0) as f32)).collect();
            assert_eq!(floats, expected, "{format:x}");
        }
    }

    #[test]
    fn bytes_that_are_stored_as_they_are_are_what_a_base_format_keeps() {
        let bytes: Vec<u8> = (0..200).map(|k| k ^ 0x5a).collect();
        let store = PixelStore { row_length: 7, skip: [1, 2, 0], ..PixelStore::default() };
        let (size, mut some) = ([5, 3, 1], 0);
        let bases = [
            Base::Alpha,
            Base::Luminance,
            Base::Intensity,
            Base::LuminanceAlpha,
            Base::Red,
            Base::Rg,
            Base::Rgb,
            Base::Rgba,
            Base::Srgb,
            Base::SrgbAlpha,
        ];
        for base in bases {
            for format in FORMATS {
                let texels = unpack::<u8>(&store, size, format, e::UNSIGNED_BYTE, &bytes).expect("rows");
                if let Some(stored) = stored(&store, size, base, format, e::UNSIGNED_BYTE, &bytes) {
                    assert_eq!(stored.expect("rows"), base.encode(&texels), "{base:?} {format:x}");
                    some += 1;
                }
                assert!(stored(&store, size, base, format, e::UNSIGNED_SHORT, &bytes).is_none());
            }
        }
        assert_eq!(some, 11);
    }
}
