//! Four 8-bit channels over whole batches: the path that most colour targets take.

use super::srgb::Encoder;
use super::{Format, unorm};
use num::{LANES, Lanes};

/// The order and encoding of a format of four 8-bit channels that blend as numbers in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Rgba8 {
    /// Blue is stored first.
    pub bgra: bool,
    /// Colours are stored with the sRGB transfer function.
    pub srgb: bool,
}

impl Rgba8 {
    /// The layout of a format, if it is one of these four.
    pub fn of(format: Format) -> Option<Rgba8> {
        match format {
            Format::Rgba8Unorm => Some(Rgba8 { bgra: false, srgb: false }),
            Format::Rgba8UnormSrgb => Some(Rgba8 { bgra: false, srgb: true }),
            Format::Bgra8Unorm => Some(Rgba8 { bgra: true, srgb: false }),
            Format::Bgra8UnormSrgb => Some(Rgba8 { bgra: true, srgb: true }),
            _ => None,
        }
    }
}

/// Encodes the colours of a batch; the same bits as [`super::encode`].
#[inline(always)]
pub fn pack_rgba8(layout: Rgba8, color: &[Lanes; 4], out: &mut [u32; LANES]) {
    let (first, third) = if layout.bgra { (2, 0) } else { (0, 2) };
    let (a, b, c, d) = (color[first].f32(), color[1].f32(), color[third].f32(), color[3].f32());
    if layout.srgb {
        let encoder = Encoder::new();
        for i in 0..LANES {
            out[i] = u32::from(encoder.encode(a[i]))
                | u32::from(encoder.encode(b[i])) << 8
                | u32::from(encoder.encode(c[i])) << 16
                | unorm(d[i], 255.0) << 24;
        }
    } else {
        for i in 0..LANES {
            out[i] = unorm(a[i], 255.0) | unorm(b[i], 255.0) << 8 | unorm(c[i], 255.0) << 16 | unorm(d[i], 255.0) << 24;
        }
    }
}
