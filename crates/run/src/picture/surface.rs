//! A surface's bytes as an 8-bit picture.

use image::{RgbImage, RgbaImage};

use gfx::format::{Format, TexelKind};
use gfx::texel;
use work::Surface;

/// Turns the bytes of a surface (laid out as in `work::Contents`) into a picture.
///
/// Formats of 8 bits per channel keep their stored values: sRGB ones stay encoded, BGRA is put in order, missing channels are 0 and
/// missing alpha 255. Other formats are decoded and scaled to 255: unorm and float clamped to [0, 1], snorm from [-1, 1] by its
/// positive half, integers cut at 255, depth as grey. Alpha is 255 where the display ignores it.
///
/// # Errors
/// If the surface is multisampled or block-compressed, or the bytes are not its size.
pub fn picture(surface: &Surface, bytes: &[u8]) -> Result<RgbaImage, String> {
    let format = surface.format;
    if surface.samples != 1 {
        return Err(format!(
            "texture {} has {} samples per pixel; only a resolved one can be shown",
            surface.key.texture, surface.samples
        ));
    }
    if format.is_compressed() {
        return Err(format!("texture {} is {}; a compressed one cannot be shown", surface.key.texture, format.name()));
    }
    let size = format.block_bytes() as usize;
    let pixels = surface.width as usize * surface.height as usize;
    if bytes.len() != pixels * size {
        return Err(format!("{} bytes are not {} x {} pixels of {size}", bytes.len(), surface.width, surface.height));
    }
    let stored: Option<Stored> = match format {
        Format::Rgba8Unorm | Format::Rgba8UnormSrgb | Format::Rgba8Uint => Some(|t| [t[0], t[1], t[2], t[3]]),
        Format::Bgra8Unorm | Format::Bgra8UnormSrgb => Some(|t| [t[2], t[1], t[0], t[3]]),
        Format::Rg8Unorm | Format::Rg8Uint => Some(|t| [t[0], t[1], 0, 255]),
        Format::R8Unorm | Format::R8Uint => Some(|t| [t[0], 0, 0, 255]),
        _ => None,
    };
    let mut out = Vec::with_capacity(pixels * 4);
    for t in bytes.chunks_exact(size) {
        out.extend_from_slice(&match stored {
            Some(stored) => stored(t),
            None => decoded(format, t),
        });
    }
    if surface.opaque {
        out.as_chunks_mut::<4>().0.iter_mut().for_each(|pixel| pixel[3] = 255);
    }
    Ok(RgbaImage::from_raw(surface.width, surface.height, out).expect("four bytes a pixel"))
}

/// The same without alpha, for a page that has a background of its own.
///
/// # Errors
/// As [`picture`].
pub fn colors(surface: &Surface, bytes: &[u8]) -> Result<RgbImage, String> {
    let image = picture(surface, bytes)?;
    let out = image.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
    Ok(RgbImage::from_raw(surface.width, surface.height, out).expect("three bytes per pixel"))
}

/// Puts the stored bytes of a texel in order.
type Stored = fn(&[u8]) -> [u8; 4];

fn decoded(format: Format, texel: &[u8]) -> [u8; 4] {
    let value = texel::decode(format, texel);
    let float = |c: usize| (f32::from_bits(value[c]).clamp(0.0, 1.0) * 255.0).round_ties_even() as u8;
    let has = |c: usize| c < format.components() as usize;
    let pick = |c: usize, v: u8| if has(c) { v } else { u8::from(c == 3) * 255 };
    match format.kind() {
        TexelKind::Float => std::array::from_fn(|c| pick(c, float(c))),
        TexelKind::Uint => std::array::from_fn(|c| pick(c, value[c].min(255) as u8)),
        TexelKind::Sint => std::array::from_fn(|c| pick(c, (value[c] as i32).clamp(0, 255) as u8)),
        TexelKind::Depth => {
            let grey = if format.has_depth() { float(0) } else { value[0].min(255) as u8 };
            [grey, grey, grey, 255]
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use work::SurfaceKey;

    fn surface(format: Format) -> Surface {
        Surface {
            key: SurfaceKey { texture: 1, level: 0, layer: 0 },
            format,
            width: 2,
            height: 1,
            samples: 1,
            address: 0,
            opaque: false,
        }
    }

    #[test]
    fn eight_bit_values_stay_as_stored() {
        let bytes = [10, 20, 30, 40, 50, 60, 70, 80];
        assert_eq!(picture(&surface(Format::Rgba8UnormSrgb), &bytes).unwrap().into_raw(), bytes);
        assert_eq!(picture(&surface(Format::Bgra8Unorm), &bytes).unwrap().into_raw(), [30, 20, 10, 40, 70, 60, 50, 80]);
        let opaque = Surface { opaque: true, ..surface(Format::Bgra8Unorm) };
        assert_eq!(picture(&opaque, &bytes).unwrap().into_raw(), [30, 20, 10, 255, 70, 60, 50, 255]);
        assert!(picture(&opaque, &bytes[..7]).is_err());
        assert_eq!(colors(&surface(Format::Bgra8Unorm), &bytes).unwrap().into_raw(), [30, 20, 10, 70, 60, 50]);
    }

    #[test]
    fn wider_formats_are_scaled_and_others_refused() {
        let half = [0x00, 0x38, 0x00, 0x3c, 0x00, 0x40, 0x00, 0x3c, 0, 0, 0, 0, 0, 0, 0, 0x3c];
        assert_eq!(picture(&surface(Format::Rgba16Float), &half).unwrap().into_raw(), [128, 255, 255, 255, 0, 0, 0, 255]);
        let many = Surface { samples: 4, ..surface(Format::Rgba8Unorm) };
        assert!(picture(&many, &[0; 32]).unwrap_err().contains("4 samples"));
        assert!(picture(&surface(Format::Rgba8Unorm), &[0; 7]).is_err());
    }
}
