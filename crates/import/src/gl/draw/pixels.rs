//! Pixels that calls give, after pixel storage and pixel transfer (OpenGL 1.5, sections 3.6.3 to 3.6.5).

use std::rc::Rc;

use gl_shader::consts as e;
use gl_shader::key::Base;

use crate::gl::call::{Arg, Fault, GlResult, INVALID_OPERATION};
use crate::gl::machine::Gl;
use crate::gl::texels::image::StoredFormat;
use crate::gl::texels::transfer::values;
use crate::gl::texels::unpack::UNSIGNED_INT_24_8;
use crate::gl::texels::{image, unpack};

impl Gl {
    /// Runs a function that reads an image of `dimensions` dimensions. It is an error to read beyond the end of a buffer object.
    pub fn unpacking(&mut self, dimensions: usize, run: impl FnOnce(&mut Gl) -> GlResult) -> GlResult {
        let all = self.context.unpack;
        if dimensions < 3 {
            self.context.unpack = all.plane();
        }
        let result = run(self);
        self.context.unpack = all;
        match result {
            Err(Fault::Damaged(_)) if all.buffer != 0 => Err(INVALID_OPERATION),
            result => result,
        }
    }

    /// The bytes of a pixel argument: the recorded ones, or those of the pixel buffer object from an offset on. None if there are none.
    pub fn pixel_bytes(&self, arg: &Arg) -> GlResult<Option<Rc<[u8]>>> {
        let at = match arg {
            Arg::Pointer(at) => *at,
            Arg::Num(at) => *at as u64,
            _ => 0,
        };
        if self.context.unpack.buffer != 0 {
            let bytes = self.objects.buffers.get(self.context.unpack.buffer).ok_or(INVALID_OPERATION)?.bytes()?;
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
    pub fn texels(&self, size: [u32; 3], format: u32, kind: u32, bytes: &[u8]) -> GlResult<Vec<[u8; 4]>> {
        let (transfer, maps) = (&self.state.pixels.transfer, &self.context.pixel_maps);
        if format == e::COLOR_INDEX {
            let color = |value: f64| {
                let index = transfer.index(value);
                std::array::from_fn(|channel| image::byte(f64::from(maps.by_index(2 + channel, index))))
            };
            return Ok(values(&self.context.unpack, size, kind, bytes, false)?.into_iter().map(color).collect());
        }
        let mut texels: Vec<[u8; 4]> = unpack::unpack(&self.context.unpack, size, format, kind, bytes)?;
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
    pub fn encoded(&self, base: Base, size: [u32; 3], [format, kind]: [u32; 2], bytes: &[u8]) -> GlResult<Vec<u8>> {
        let bounded = format == e::COLOR_INDEX;
        if !base.is_float() || bounded {
            if self.state.pixels.transfer.keeps_colors()
                && let Some(stored) = unpack::stored(&self.context.unpack, size, base, format, kind, bytes)
            {
                return stored;
            }
            let texels = self.texels(size, format, kind, bytes)?;
            // These are stored as they are.
            let whole = matches!(base, Base::Rgba | Base::SrgbAlpha);
            return Ok(if whole { texels.into_flattened() } else { base.encode(&texels) });
        }
        if !self.state.pixels.transfer.keeps_colors() {
            return Err(Fault::Unsupported("pixel transfer into floating-point textures".into()));
        }
        Ok(base.encode_floats(&unpack::unpack(&self.context.unpack, size, format, kind, bytes)?))
    }

    /// Depths of a rectangle after pixel transfer.
    pub fn depths(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> GlResult<Vec<f32>> {
        let [scale, bias] = self.state.pixels.transfer.depth;
        let values = values(&self.context.unpack, size, kind, bytes, true)?;
        Ok(values.into_iter().map(|value| (value as f32 * scale + bias).clamp(0.0, 1.0)).collect())
    }

    /// Depths and stencil values of a rectangle that has both, after pixel transfer.
    pub fn depths_and_stencil(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> GlResult<(Vec<f32>, Vec<u8>)> {
        let [scale, bias] = self.state.pixels.transfer.depth;
        let depth = |depth: f32| (depth * scale + bias).clamp(0.0, 1.0);
        let words = values(&self.context.unpack, size, kind, bytes, false)?;
        let of = |word: &f64| match kind {
            UNSIGNED_INT_24_8 => (*word as u64 >> 8) as f32 / 16_777_215.0,
            _ => f32::from_bits((*word as u64 >> 8) as u32),
        };
        Ok((words.iter().map(|word| depth(of(word))).collect(), words.iter().map(|word| self.stencil_value(*word)).collect()))
    }

    /// Stencil indices of a rectangle after pixel transfer.
    pub fn stencil_indices(&self, size: [u32; 3], kind: u32, bytes: &[u8]) -> GlResult<Vec<u8>> {
        Ok(values(&self.context.unpack, size, kind, bytes, false)?.into_iter().map(|value| self.stencil_value(value)).collect())
    }

    /// A stencil value after pixel transfer.
    fn stencil_value(&self, value: f64) -> u8 {
        let index = self.state.pixels.transfer.index(value);
        if self.state.pixels.transfer.map_stencil {
            self.context.pixel_maps.by_index(1, index) as i64 as u8
        } else {
            index as u8
        }
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::gl::texels::transfer::Transfer;
    use crate::gl::texels::unpack::PixelStore;

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
        gl.context.unpack.alignment = 1;
        (gl.state.pixels.transfer.scale[0], gl.state.pixels.transfer.bias[1]) = (0.5, 0.2);
        let texels = gl.texels([1, 1, 1], e::RGB, e::UNSIGNED_BYTE, &[200, 100, 30]).expect("a pixel");
        // 0.2 is 51 of 255.
        assert_eq!(texels, [[100, 151, 30, 255]]);
        gl.state.pixels.transfer = Transfer { map_color: true, ..Transfer::default() };
        // The green map inverts; the others have one element.
        (gl.context.pixel_maps.0[7], gl.context.pixel_maps.0[9]) = (vec![1.0, 0.0], vec![1.0]);
        let texels = gl.texels([1, 1, 1], e::RGB, e::UNSIGNED_BYTE, &[200, 10, 30]).expect("a pixel");
        assert_eq!(texels, [[0, 255, 0, 255]]);
        gl.state.pixels.transfer = Transfer { index: [1, 1], ..Transfer::default() };
        gl.context.pixel_maps.0[2] = vec![0.0, 0.2, 0.4, 0.6];
        // 2 * 1 + 1 = 3; 2 * 3 + 1 = 7, which is 3 again.
        let texels = gl.texels([2, 1, 1], e::COLOR_INDEX, e::UNSIGNED_BYTE, &[1, 3]).expect("indices");
        assert_eq!(texels, [[153, 0, 0, 0], [153, 0, 0, 0]]);
        assert_eq!(gl.stencil_indices([1, 1, 1], e::UNSIGNED_BYTE, &[4]), Ok(vec![9]));
        gl.state.pixels.transfer.depth = [0.5, 0.25];
        assert_eq!(gl.depths([1, 1, 1], e::UNSIGNED_SHORT, &[255, 255]), Ok(vec![0.75]));
    }
}
