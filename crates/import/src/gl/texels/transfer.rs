//! Pixels before they are drawn or stored: bitmaps, indices and depths, and pixel transfer (OpenGL 1.5, sections 3.6.3 to 3.6.5).

use gl_shader::consts as e;

use crate::gl::call::{Fault, GlResult, INVALID_ENUM};
use crate::gl::texels::image;
use crate::gl::texels::unpack::{FLOAT_AND_STENCIL, PixelStore, UNSIGNED_INT_24_8};

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
    pub fn index(&self, value: f64) -> i64 {
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
    pub fn by_index(&self, map: usize, index: i64) -> f32 {
        let map = &self.0[map];
        map[(index & (map.len() as i64 - 1)) as usize]
    }

    /// The map's element for a component in [0, 1].
    pub fn by_component(&self, map: usize, value: f32) -> f32 {
        let map = &self.0[map];
        let last = (map.len() - 1) as f32;
        map[(value.clamp(0.0, 1.0) * last + 0.5) as usize]
    }
}

/// The values of one-component pixels, rows from the bottom. If `normalized`, integers are divided by their greatest value. Of pixels with a
/// depth and a stencil value, the lowest eight bits are the stencil value, and the others are those of the depth.
pub fn values(store: &PixelStore, size: [u32; 3], kind: u32, bytes: &[u8], normalized: bool) -> GlResult<Vec<f64>> {
    let count = size.iter().map(|&edge| u64::from(edge)).product::<u64>();
    if count > VALUES_MAX {
        return Err(Fault::Limit(format!("{count} pixels in one call, at most {VALUES_MAX}")));
    }
    let component = match kind {
        e::UNSIGNED_BYTE | e::BYTE => 1,
        e::UNSIGNED_SHORT | e::SHORT | e::HALF_FLOAT | e::HALF_FLOAT_OES => 2,
        e::UNSIGNED_INT | e::INT | e::FLOAT | UNSIGNED_INT_24_8 => 4,
        FLOAT_AND_STENCIL => 8,
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
                    UNSIGNED_INT_24_8 => (f64::from(bits), 1.0),
                    FLOAT_AND_STENCIL => ((u64::from(bits) << 8 | u64::from(high[0])) as f64, 1.0),
                    _ => (f64::from(f32::from_bits(bits)), 1.0),
                };
                out.push(if normalized { value / most } else { value });
            }
        }
    }
    Ok(out)
}
