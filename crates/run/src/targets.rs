//! Small pictures of the attachments of a frame, as its passes leave them.

use std::sync::{Arc, Mutex, PoisonError};

use gfx::format::TexelKind;
use gfx::texel;
use image::{GrayImage, RgbImage, imageops};
use render::{PassTarget, TargetReader};
use work::Surface;

use super::picture::colors;

/// Width and height of a small picture at most, in pixels.
pub const EDGE: u32 = 160;

/// Pictures of a frame at most.
const MOST: usize = 64;

/// An attachment at the end of a pass.
#[derive(Clone, Debug, PartialEq)]
pub struct TargetPicture {
    /// Number of the pass in the trace.
    pub pass: u32,
    /// Location of a colour attachment. None for depth and stencil.
    pub location: Option<u32>,
    /// Whether any of its contents are kept after the pass.
    pub kept: bool,
    /// The surface.
    pub surface: Surface,
    /// The picture, with at most [`EDGE`] pixels in either direction.
    pub image: RgbImage,
    /// Of depths, the values that are black and white: the smallest and the largest.
    pub depths: Option<[f32; 2]>,
}

/// The attachments of a frame.
#[derive(Clone, Debug, Default)]
pub struct TargetPictures {
    /// In the order in which passes end.
    pub pictures: Vec<TargetPicture>,
    /// Attachments that have no picture: behind the first 64, or of a format that cannot be shown.
    pub left_out: usize,
}

impl TargetPictures {
    /// A reader of attachments, and the pictures that it has taken.
    pub(super) fn reader() -> (TargetReader, Arc<Mutex<TargetPictures>>) {
        let taken = Arc::new(Mutex::new(TargetPictures::default()));
        let own = taken.clone();
        let reader = TargetReader::new(move |target| own.lock().unwrap_or_else(PoisonError::into_inner).add(&target));
        (reader, taken)
    }

    fn add(&mut self, target: &PassTarget) {
        match small(&target.surface, &target.bytes) {
            Some((image, depths)) if self.pictures.len() < MOST => {
                let PassTarget { pass, location, kept, surface, .. } = *target;
                self.pictures.push(TargetPicture { pass, location, kept, surface, image, depths });
            }
            _ => self.left_out += 1,
        }
    }
}

/// A small picture of a surface; of several samples per pixel, it shows the first. None for a format that cannot be shown.
fn small(surface: &Surface, bytes: &[u8]) -> Option<(RgbImage, Option<[f32; 2]>)> {
    let size = surface.format.block_bytes() as usize;
    let first: Vec<u8>;
    let bytes = if surface.samples > 1 {
        let pixels = bytes.chunks_exact(size * surface.samples as usize);
        first = pixels.flat_map(|samples| samples[..size].iter().copied()).collect();
        &first
    } else {
        bytes
    };
    let surface = Surface { samples: 1, opaque: true, ..*surface };
    let (width, height) = (surface.width, surface.height);
    let (image, depths) = if surface.format.kind() == TexelKind::Depth && surface.format.has_depth() {
        let depths: Vec<f32> =
            bytes.chunks_exact(size).map(|texel| f32::from_bits(texel::decode(surface.format, texel)[0])).collect();
        let [least, most] = depths.iter().fold([1.0_f32, 0.0], |[least, most], &z| [least.min(z), most.max(z)]);
        let range = if most > least { most - least } else { 1.0 };
        let grey = depths.iter().map(|z| ((z - least) / range * 255.0).round_ties_even() as u8).collect();
        let image = GrayImage::from_raw(width, height, grey)?;
        let rgb = image.pixels().flat_map(|grey| [grey.0[0]; 3]).collect();
        (RgbImage::from_raw(width, height, rgb)?, Some([least, most]))
    } else {
        (colors(&surface, bytes).ok()?, None)
    };
    let part = f64::from(EDGE) / f64::from(width.max(height)).max(1.0);
    let scaled = |size: u32| ((f64::from(size) * part).round() as u32).max(1);
    let image = if part < 1.0 { imageops::thumbnail(&image, scaled(width), scaled(height)) } else { image };
    Some((image, depths))
}

#[cfg(test)]
mod tests {
    use gfx::format::Format;
    use work::SurfaceKey;

    use super::*;

    fn surface(format: Format, width: u32, height: u32, samples: u32) -> Surface {
        let key = SurfaceKey { texture: 1, level: 0, layer: 0 };
        Surface { key, format, width, height, samples, address: 0, opaque: false }
    }

    #[test]
    fn depths_use_the_whole_scale() {
        let bytes: Vec<u8> = [0.5_f32, 0.75, 1.0, 0.5].iter().flat_map(|z| z.to_le_bytes()).collect();
        let (image, depths) = small(&surface(Format::Depth32Float, 2, 2, 1), &bytes).expect("it can be shown");
        assert_eq!(depths, Some([0.5, 1.0]));
        assert_eq!(image.pixels().map(|pixel| pixel.0[0]).collect::<Vec<_>>(), [0, 128, 255, 0]);
    }

    #[test]
    fn large_surfaces_become_small_and_samples_the_first() {
        let (image, _) = small(&surface(Format::Rgba8Unorm, 1000, 500, 1), &[9; 2_000_000]).expect("it can be shown");
        assert_eq!((image.dimensions(), image.get_pixel(80, 40).0), ((160, 80), [9, 9, 9]));
        let samples = [[1, 2, 3, 255], [9, 9, 9, 255]].concat();
        let (image, _) = small(&surface(Format::Rgba8Unorm, 1, 1, 2), &samples).expect("it can be shown");
        assert_eq!(image.get_pixel(0, 0).0, [1, 2, 3]);
    }
}
