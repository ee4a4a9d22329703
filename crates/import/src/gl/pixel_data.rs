//! Pixels before they are drawn or stored: bitmaps, indices and depths, and pixel transfer (OpenGL 1.5, sections 3.6.3 to 3.6.5).

use std::rc::Rc;

use super::call::{Arg, Fault, INVALID_ENUM, INVALID_OPERATION, Outcome};
use super::consts as e;
use super::image::{self, Kept, PixelStore};
use super::key::Base;
use super::machine::Gl;
use super::unpack;

/// Maximum number of values of one rectangle.
const VALUES_MAX: u64 = 1 << 26;

/// Pixel transfer modes.
#[derive(Clone, Debug, PartialEq)]
pub struct Transfer {
    /// Factors of red, green, blue and alpha.
    pub scale: [f32; 4],
    /// Biases of red, green, blue and alpha.
    pub bias: [f32; 4],
    /// Scale and bias of depths.
    pub depth: [f32; 2],
    /// Whether colours pass through the maps of their channels.
    pub map_color: bool,
    /// Whether stencil indices pass through their map.
    pub map_stencil: bool,
    /// Left shift and offset of indices.
    pub index: [i32; 2],
}

impl Default for Transfer {
    fn default() -> Self {
        Transfer { scale: [1.0; 4], bias: [0.0; 4], depth: [1.0, 0.0], map_color: false, map_stencil: false, index: [0; 2] }
    }
}

impl Transfer {
    /// Whether colours are unchanged.
    pub fn keeps_colors(&self) -> bool {
        self.scale == [1.0; 4] && self.bias == [0.0; 4] && !self.map_color
    }

    /// An index after shift and offset.
    fn index(&self, value: f64) -> i64 {
        let [shift, offset] = self.index;
        let value = value as i64;
        let shifted = if shift >= 0 { value.wrapping_shl(shift as u32) } else { value.wrapping_shr(shift.unsigned_abs()) };
        shifted.wrapping_add(i64::from(offset))
    }
}

/// Pixel maps: I to I, S to S, I to R, G, B, A, then R to R, G to G, B to B and A to A, as their enumerants are ordered.
#[derive(Clone, Debug)]
pub struct PixelMaps(pub [Vec<f32>; 10]);

impl Default for PixelMaps {
    fn default() -> Self {
        PixelMaps(std::array::from_fn(|_| vec![0.0]))
    }
}

impl PixelMaps {
    /// The map's element for an index: the sizes of these maps are powers of two.
    fn by_index(&self, map: usize, index: i64) -> f32 {
        let map = &self.0[map];
        map[(index & (map.len() as i64 - 1)) as usize]
    }

    /// The map's element for a component in [0, 1].
    fn by_component(&self, map: usize, value: f32) -> f32 {
        let map = &self.0[map];
        let last = (map.len() - 1) as f32;
        map[(value.clamp(0.0, 1.0) * last + 0.5) as usize]
    }
}

/// The values of one-component pixels, rows from the bottom. If `normalized`, integers are divided by their greatest value. Of pixels with a
/// depth and a stencil value, the lowest eight bits are the stencil value, and the others are those of the depth.
pub fn values(store: &PixelStore, size: [u32; 3], kind: u32, bytes: &[u8], normalized: bool) -> Outcome<Vec<f64>> {
    let count = size.iter().map(|&edge| u64::from(edge)).product::<u64>();
    if count > VALUES_MAX {
        return Err(Fault::Limit(format!("{count} pixels in one call, at most {VALUES_MAX}")));
    }
    let component = match kind {
        e::UNSIGNED_BYTE | e::BYTE => 1,
        e::UNSIGNED_SHORT | e::SHORT | e::HALF_FLOAT | e::HALF_FLOAT_OES => 2,
        e::UNSIGNED_INT | e::INT | e::FLOAT | unpack::UNSIGNED_INT_24_8 => 4,
        unpack::FLOAT_AND_STENCIL => 8,
        e::BITMAP => 0,
        _ => return Err(INVALID_ENUM),
    };
    let [width, height, depth] = size.map(|edge| edge as usize);
    let pixels = if store.row_length > 0 { store.row_length as usize } else { width };
    let align = (store.alignment as usize).max(1);
    let row = match component {
        0 => pixels.div_ceil(8).div_ceil(align) * align,
        _ if component >= align => pixels * component,
        _ => (pixels * component).div_ceil(align) * align,
    };
    let rows = if store.image_height > 0 { store.image_height as usize } else { height };
    let mut out = Vec::new();
    for z in 0..depth {
        for y in 0..height {
            let start = (store.skip[1] as usize + y + (store.skip[2] as usize + z) * rows) * row;
            let (first, last) = (store.skip[0] as usize, store.skip[0] as usize + width);
            let end = start + if component == 0 { last.div_ceil(8) } else { last * component };
            let Some(line) = bytes.get(start..end) else {
                return Err(Fault::Damaged(format!("the pixels have {} bytes, row {y} ends at {end}", bytes.len())));
            };
            for x in first..last {
                if component == 0 {
                    let bit = if store.low_first { x % 8 } else { 7 - x % 8 };
                    out.push(f64::from(line[x / 8] >> bit & 1));
                    continue;
                }
                let mut raw = [0; 8];
                raw[..component].copy_from_slice(&line[x * component..(x + 1) * component]);
                if store.swap {
                    raw[..component].chunks_mut(4).for_each(<[u8]>::reverse);
                }
                let [low, high] = [[raw[0], raw[1], raw[2], raw[3]], [raw[4], raw[5], raw[6], raw[7]]];
                let bits = u32::from_le_bytes(low);
                let (value, most) = match kind {
                    e::UNSIGNED_BYTE => (f64::from(bits), 255.0),
                    e::BYTE => (f64::from(bits as i8), 127.0),
                    e::UNSIGNED_SHORT => (f64::from(bits), 65_535.0),
                    e::SHORT => (f64::from(bits as i16), 32_767.0),
                    e::UNSIGNED_INT => (f64::from(bits), 4_294_967_295.0),
                    e::INT => (f64::from(bits as i32), 2_147_483_647.0),
                    e::HALF_FLOAT | e::HALF_FLOAT_OES => (f64::from(image::from_half(bits)), 1.0),
                    unpack::UNSIGNED_INT_24_8 => (f64::from(bits), 1.0),
                    unpack::FLOAT_AND_STENCIL => ((u64::from(bits) << 8 | u64::from(high[0])) as f64, 1.0),
                    _ => (f64::from(f32::from_bits(bits)), 1.0),
                };
                out.push(if normalized { value / most } else { value });
            }
        }
    }
    Ok(out)
}

impl Gl {
    /// Runs a function that reads an image of `dimensions` dimensions. It is an error to read beyond the end of a buffer object.
    pub fn unpacking(&mut self, dimensions: usize, run: impl FnOnce(&mut Gl) -> Outcome) -> Outcome {
        let all = self.unpack;
        if dimensions < 3 {
            self.unpack = all.plane();
        }
        let result = run(self);
        self.unpack = all;
        match result {
            Err(Fault::Damaged(_)) if all.buffer != 0 => Err(INVALID_OPERATION),
            result => result,
        }
    }

    /// The bytes of a pixel argument: the recorded ones, or those of the pixel buffer object from an offset on. None if there are none.
    pub fn pixel_bytes(&self, arg: &Arg) -> Outcome<Option<Rc<[u8]>>> {
        let at = match arg {
            Arg::Pointer(at) => *at,
            Arg::Num(at) => *at as u64,
            _ => 0,
        };
        if self.unpack.buffer != 0 {
            let bytes = self.buffers.get(self.unpack.buffer).ok_or(INVALID_OPERATION)?.bytes()?;
            let from = usize::try_from(at).ok().filter(|&at| at <= bytes.len()).ok_or(INVALID_OPERATION)?;
            return Ok(Some(if from == 0 { bytes.clone() } else { Rc::from(&bytes[from..]) }));
        }
        match arg {
            Arg::Blob(bytes) => Ok(Some(bytes.clone())),
            Arg::Nums(numbers) => Ok(Some(numbers.iter().map(|&number| number as i64 as u8).collect())),
            Arg::Str(text) => Ok(Some(text.as_bytes().into())),
            _ if at == 0 => Ok(None),
            _ => Err(Fault::Damaged("the pixels were not recorded".into())),
        }
    }

    /// Colours of a rectangle after pixel transfer, rows from the bottom.
    pub fn texels(&self, size: [u32; 3], format: u32, kind: u32, bytes: &[u8]) -> Outcome<Vec<[u8; 4]>> {
        let (transfer, maps) = (&self.state.transfer, &self.pixel_maps);
        if format == e::COLOR_INDEX {
            let color = |value: f64| {
                let index = transfer.index(value);
                std::array::from_fn(|channel| image::byte(f64::from(maps.by_index(2 + channel, index))))
            };
            return Ok(values(&self.unpack, size, kind, bytes, false)?.into_iter().map(color).collect());
        }
        let mut texels: Vec<[u8; 4]> = unpack::unpack(&self.unpack, size, format, kind, bytes)?;
        if !transfer.keeps_colors() {
            for channel in 0..4 {
                // A channel has 256 values only.
                let table: [u8; 256] = std::array::from_fn(|code| {
                    let value = code as f32 / 255.0 * transfer.scale[channel] + transfer.bias[channel];
                    let value = if transfer.map_color { maps.by_component(6 + channel, value) } else { value };
                    image::byte(f64::from(value))
                });
                texels.iter_mut().for_each(|texel| texel[channel] = table[usize::from(texel[channel])]);
            }
        }
        Ok(texels)
    }

    /// Texels of a rectangle in the stored format of this base format.
    pub fn kept(&self, base: Base, size: [u32; 3], [format, kind]: [u32; 2], bytes: &[u8]) -> Outcome<Vec<u8>> {
        let bounded = format == e::COLOR_INDEX;
        if !base.is_float() || bounded {
            if self.state.transfer.keeps_colors()
                && let Some(stored) = unpack::stored(&self.unpack, size, base, format, kind, bytes)
            {
                return stored;
            }
            let texels = self.texels(size, format, kind, bytes)?;
            // These are stored as they are.
            let whole = matches!(base, Base::Rgba | Base::SrgbAlpha);
            return Ok(if whole { texels.into_flattened() } else { base.keep(&texels) });
        }
        if !self.state.transfer.keeps_colors() {
            return Err(Fault::Unsupported("pixel transfer into floating-point textures".into()));
        }
        Ok(base.keep_floats(&unpack::unpack(&self.unpack, size, format, kind, bytes)?))
    }

    /// Depths of a rectangle after pixel transfer.
    pub fn depths(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> Outcome<Vec<f32>> {
        let [scale, bias] = self.state.transfer.depth;
        let values = values(&self.unpack, size, kind, bytes, true)?;
        Ok(values.into_iter().map(|value| (value as f32 * scale + bias).clamp(0.0, 1.0)).collect())
    }

    /// Depths and stencil values of a rectangle that has both, after pixel transfer.
    pub fn depths_and_stencil(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> Outcome<(Vec<f32>, Vec<u8>)> {
        let [scale, bias] = self.state.transfer.depth;
        let depth = |depth: f32| (depth * scale + bias).clamp(0.0, 1.0);
        let words = values(&self.unpack, size, kind, bytes, false)?;
        let of = |word: &f64| match kind {
            unpack::UNSIGNED_INT_24_8 => (*word as u64 >> 8) as f32 / 16_777_215.0,
            _ => f32::from_bits((*word as u64 >> 8) as u32),
        };
        Ok((words.iter().map(|word| depth(of(word))).collect(), words.iter().map(|word| self.stencil_value(*word)).collect()))
    }

    /// Stencil indices of a rectangle after pixel transfer.
    pub fn stencil_indices(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> Outcome<Vec<u8>> {
        Ok(values(&self.unpack, size, kind, bytes, false)?.into_iter().map(|value| self.stencil_value(value)).collect())
    }

    /// A stencil value after pixel transfer.
    fn stencil_value(&self, value: f64) -> u8 {
        let index = self.state.transfer.index(value);
        if self.state.transfer.map_stencil { self.pixel_maps.by_index(1, index) as i64 as u8 } else { index as u8 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_a_bitmap_are_read_in_both_orders() {
        let store = PixelStore { alignment: 1, ..PixelStore::default() };
        // Ten bits per row: two bytes.
        let bytes = [0b1010_0000, 0b0100_0000, 0b0000_0001, 0b1000_0000];
        let bits = values(&store, [10, 2, 1], e::BITMAP, &bytes, false).expect("two rows");
        let set: Vec<usize> = (0..20).filter(|&k| bits[k] == 1.0).collect();
        assert_eq!(set, [0, 2, 9, 17, 18]);
        let low = PixelStore { low_first: true, skip: [1, 0, 0], ..store };
        let bits = values(&low, [7, 1, 1], e::BITMAP, &[0b0000_0110], false).expect("a row");
        assert_eq!(bits, [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert!(matches!(values(&store, [10, 3, 1], e::BITMAP, &bytes, false), Err(Fault::Damaged(_))));
    }

    #[test]
    fn transfer_scales_shifts_and_maps() {
        let mut gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        gl.unpack.alignment = 1;
        (gl.state.transfer.scale[0], gl.state.transfer.bias[1]) = (0.5, 0.2);
        let texels = gl.texels([1, 1, 1], e::RGB, e::UNSIGNED_BYTE, &[200, 100, 30]).expect("a pixel");
        // 0.2 is 51 of 255.
        assert_eq!(texels, [[100, 151, 30, 255]]);
        gl.state.transfer = Transfer { map_color: true, ..Transfer::default() };
        // The green map inverts; the others have one element.
        (gl.pixel_maps.0[7], gl.pixel_maps.0[9]) = (vec![1.0, 0.0], vec![1.0]);
        let texels = gl.texels([1, 1, 1], e::RGB, e::UNSIGNED_BYTE, &[200, 10, 30]).expect("a pixel");
        assert_eq!(texels, [[0, 255, 0, 255]]);
        gl.state.transfer = Transfer { index: [1, 1], ..Transfer::default() };
        gl.pixel_maps.0[2] = vec![0.0, 0.2, 0.4, 0.6];
        // 2 * 1 + 1 = 3; 2 * 3 + 1 = 7, which is 3 again.
        let texels = gl.texels([2, 1, 1], e::COLOR_INDEX, e::UNSIGNED_BYTE, &[1, 3]).expect("indices");
        assert_eq!(texels, [[153, 0, 0, 0], [153, 0, 0, 0]]);
        assert_eq!(gl.stencil_indices([1, 1, 1], e::UNSIGNED_BYTE, &[4]), Ok(vec![9]));
        gl.state.transfer.depth = [0.5, 0.25];
        assert_eq!(gl.depths([1, 1, 1], e::UNSIGNED_SHORT, &[255, 255]), Ok(vec![0.75]));
    }
}
