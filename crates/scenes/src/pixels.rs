//! Textures made by code, and their mip chains.

use gfx::format::Format;
use num::{TextureId, ViewId};
use trace::record::{self, Recorder};

use crate::maths::*;

/// An RGBA image with values 0 to 1: linear light, alpha not premultiplied unless its user does.
pub struct Image {
    pub size: u32,
    pub texels: Vec<[f64; 4]>,
}

impl Image {
    /// A square image, `paint` called with the texture coordinates of each texel's centre.
    pub fn paint(size: u32, paint: impl Fn(f64, f64) -> [f64; 4]) -> Image {
        let at = |i: u32| (f64::from(i) + 0.5) / f64::from(size);
        let texels = (0..size * size).map(|i| paint(at(i % size), at(i / size))).collect();
        Image { size, texels }
    }

    /// The next smaller level: means of 2x2 texels.
    fn half(&self) -> Image {
        let (size, n) = (self.size / 2, self.size as usize);
        let mean = |i: usize| {
            let (x, y) = (2 * (i % (n / 2)), 2 * (i / (n / 2)));
            let four = [y * n + x, y * n + x + 1, (y + 1) * n + x, (y + 1) * n + x + 1];
            std::array::from_fn(|c| four.iter().map(|&at| self.texels[at][c]).sum::<f64>() / 4.0)
        };
        Image { size, texels: (0..(size * size) as usize).map(mean).collect() }
    }

    fn encode(&self, srgb: bool) -> Vec<u8> {
        let code = |value: f64| unorm8(if srgb { to_srgb(value) } else { value });
        self.texels.iter().flat_map(|&[r, g, b, a]| [code(r), code(g), code(b), unorm8(a)]).collect()
    }
}

fn to_srgb(value: f64) -> f64 {
    if value <= 0.003_130_8 { 12.92 * value } else { 1.055 * libm::pow(value, 1.0 / 2.4) - 0.055 }
}

/// A texture of equally large images as layers, with full mip chains, rgba8unorm or rgba8unorm-srgb.
pub fn mipped_texture(card: &mut Recorder, label: &str, layers: &[Image], srgb: bool) -> (TextureId, ViewId) {
    let size = layers[0].size;
    let format = if srgb { Format::Rgba8UnormSrgb } else { Format::Rgba8Unorm };
    let mut desc = record::texture_mipped(size, size, size.ilog2() + 1, format);
    desc.size[2] = layers.len() as u32;
    let levels = desc.levels;
    let texture = card.create_texture(label, desc);
    let mut chain: Vec<Image> = layers.iter().map(|image| Image { size, texels: image.texels.clone() }).collect();
    for level in 0..levels {
        let bytes: Vec<u8> = chain.iter().flat_map(|image| image.encode(srgb)).collect();
        card.write_level(texture, level, &format!("{label}-{level}"), &bytes);
        chain = chain.iter().map(Image::half).collect();
    }
    (texture, card.create_view(texture))
}

/// Smooth noise in [0, 1) that repeats after `period` cells in both directions.
pub fn noise(seed: u32, x: f64, y: f64, period: u32) -> f64 {
    let (cx, cy) = (x.floor(), y.floor());
    let smooth = |t: f64| t * t * (3.0 - 2.0 * t);
    let (fx, fy) = (smooth(x - cx), smooth(y - cy));
    let wrap = |c: f64, d: u32| (c as i64 + i64::from(d)).rem_euclid(i64::from(period)) as u32;
    let corner = |dx: u32, dy: u32| uniform(seed, wrap(cy, dy) * period + wrap(cx, dx), 0);
    let top = corner(0, 0) * (1.0 - fx) + corner(1, 0) * fx;
    let bottom = corner(0, 1) * (1.0 - fx) + corner(1, 1) * fx;
    top * (1.0 - fy) + bottom * fy
}

/// Four octaves of [`noise`] over one repetition of a texture.
pub fn turbulence(seed: u32, u: f64, v: f64, cells: u32) -> f64 {
    (0..4)
        .map(|octave| {
            let period = cells << octave;
            let at = f64::from(period);
            noise(seed + octave, u * at, v * at, period) * 0.5 / f64::from(1u32 << octave)
        })
        .sum::<f64>()
        / 0.9375
}

/// 0 below `low`, 1 above `high`, smooth between.
pub fn ramp(low: f64, high: f64, value: f64) -> f64 {
    let t = ((value - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// An opaque colour.
pub fn opaque(color: DVec3) -> [f64; 4] {
    color.extend(1.0).to_array()
}
