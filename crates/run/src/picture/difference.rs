//! How two pictures differ.

use image::{RgbImage, Rgba, RgbaImage};

/// A channel may differ by this much of 255 before its pixel counts as off.
pub const TOLERANCE: u8 = 2;

/// How two images of one size differ.
#[derive(Clone, Debug, PartialEq)]
pub struct Difference {
    /// Pixels.
    pub pixels: u64,
    /// Pixels of which a channel differs at all.
    pub different: u64,
    /// Pixels of which a channel differs by more than [`TOLERANCE`].
    pub off: u64,
    /// The largest difference of a channel.
    pub largest: u8,
    /// Peak signal-to-noise ratio over all four channels in dB; infinite for equal images.
    pub psnr: f64,
    /// Absolute differences, eight times as bright; alpha is 255, and its difference is added to all three.
    pub picture: RgbaImage,
}

impl Difference {
    /// Share of pixels off, from 0 to 1.
    pub fn off_share(&self) -> f64 {
        self.off as f64 / self.pixels.max(1) as f64
    }
}

/// Compares two images.
///
/// # Errors
/// If their sizes differ.
pub fn compare(a: &RgbaImage, b: &RgbaImage) -> Result<Difference, String> {
    if a.dimensions() != b.dimensions() {
        let ((aw, ah), (bw, bh)) = (a.dimensions(), b.dimensions());
        return Err(format!("the images are {aw} x {ah} and {bw} x {bh} pixels"));
    }
    let mut result = Difference {
        pixels: u64::from(a.width()) * u64::from(a.height()),
        different: 0,
        off: 0,
        largest: 0,
        psnr: f64::INFINITY,
        picture: RgbaImage::new(a.width(), a.height()),
    };
    let mut squares = 0_u64;
    for ((p, q), out) in a.pixels().zip(b.pixels()).zip(result.picture.pixels_mut()) {
        let d: [u8; 4] = std::array::from_fn(|c| p.0[c].abs_diff(q.0[c]));
        let most = d.into_iter().max().unwrap_or(0);
        result.different += u64::from(most > 0);
        result.off += u64::from(most > TOLERANCE);
        result.largest = result.largest.max(most);
        squares += d.iter().map(|&d| u64::from(d) * u64::from(d)).sum::<u64>();
        let bright = |c: usize| (u32::from(d[c]) * 8 + u32::from(d[3]) * 8).min(255) as u8;
        *out = Rgba([bright(0), bright(1), bright(2), 255]);
    }
    result.psnr = psnr(squares, 4 * result.pixels);
    Ok(result)
}

/// The peak signal-to-noise ratio in dB of `channels` values, from the sum of their squared differences. It is infinite for equal pictures.
fn psnr(squares: u64, channels: u64) -> f64 {
    if squares == 0 { f64::INFINITY } else { 10.0 * (255.0 * 255.0 * channels as f64 / squares as f64).log10() }
}

/// Pixels of which red, green or blue differ by more than `tolerance`, and the peak signal-to-noise ratio over the three in dB, infinite for equal
/// ones. Both have one size.
pub fn rgb_difference(a: &RgbaImage, b: &RgbImage, tolerance: u8) -> (u64, f64) {
    let (mut off, mut squares) = (0_u64, 0_u64);
    for (p, q) in a.pixels().zip(b.pixels()) {
        let d: [u8; 3] = std::array::from_fn(|c| p.0[c].abs_diff(q.0[c]));
        off += u64::from(d.iter().any(|&d| d > tolerance));
        squares += d.iter().map(|&d| u64::from(d) * u64::from(d)).sum::<u64>();
    }
    (off, psnr(squares, 3 * u64::from(b.width()) * u64::from(b.height())))
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn pixels_off_and_psnr() {
        let a = RgbaImage::from_pixel(10, 10, Rgba([100, 100, 100, 255]));
        let mut b = a.clone();
        assert_eq!(compare(&a, &b).unwrap().psnr, f64::INFINITY);
        b.put_pixel(3, 4, Rgba([102, 100, 100, 255]));
        b.put_pixel(5, 6, Rgba([100, 110, 100, 255]));
        let d = compare(&a, &b).unwrap();
        assert_eq!((d.different, d.off, d.largest), (2, 1, 10));
        let expected = 10.0 * (255.0_f64.powi(2) / (104.0 / 400.0)).log10();
        assert!((d.psnr - expected).abs() < 1e-9);
        assert_eq!(d.picture.get_pixel(5, 6).0, [0, 80, 0, 255]);
        assert!(compare(&a, &RgbaImage::new(9, 10)).unwrap_err().contains("9 x 10"));
    }

    #[test]
    fn alpha_is_no_difference_of_colours() {
        let mut a = RgbaImage::from_pixel(4, 2, Rgba([10, 20, 30, 0]));
        let b = RgbImage::from_pixel(4, 2, Rgb([10, 20, 30]));
        assert_eq!(rgb_difference(&a, &b, 0), (0, f64::INFINITY));
        a.put_pixel(1, 1, Rgba([10, 24, 30, 255]));
        a.put_pixel(2, 0, Rgba([13, 20, 30, 255]));
        let psnr = 10.0 * (255.0_f64.powi(2) / ((16.0 + 9.0) / 24.0)).log10();
        for (tolerance, off) in [(2, 2), (3, 1), (4, 0)] {
            let found = rgb_difference(&a, &b, tolerance);
            assert!(found.0 == off && (found.1 - psnr).abs() < 1e-9, "{found:?}");
        }
    }
}
