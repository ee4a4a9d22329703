//! Comparison of two images, or of two statistics files.

use image::{Rgba, RgbaImage};
use serde_json::Value;

/// A channel may differ by this much of 255 before its pixel counts as off.
pub const TOLERANCE: u8 = 2;

/// How two images of one size differ.
#[derive(Clone, Debug, PartialEq)]
pub struct ImageDifference {
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

impl ImageDifference {
    /// Share of pixels off, from 0 to 1.
    pub fn off_share(&self) -> f64 {
        self.off as f64 / self.pixels.max(1) as f64
    }
}

/// Compares two images.
///
/// # Errors
/// If their sizes differ.
pub fn images(a: &RgbaImage, b: &RgbaImage) -> Result<ImageDifference, String> {
    if a.dimensions() != b.dimensions() {
        let ((aw, ah), (bw, bh)) = (a.dimensions(), b.dimensions());
        return Err(format!("the images are {aw} x {ah} and {bw} x {bh} pixels"));
    }
    let mut result = ImageDifference {
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
    if squares > 0 {
        let mean = squares as f64 / (4 * result.pixels) as f64;
        result.psnr = 10.0 * (255.0 * 255.0 / mean).log10();
    }
    Ok(result)
}

/// One statistic that differs between two files.
#[derive(Clone, Debug, PartialEq)]
pub struct StatisticDifference {
    /// Its path, such as `total.funnel.quads_shaded`.
    pub path: String,
    /// In the first file; none: it is not there.
    pub a: Option<Value>,
    /// In the second file; none: it is not there.
    pub b: Option<Value>,
}

impl StatisticDifference {
    /// Relative change from the first to the second, where both are numbers.
    pub fn relative(&self) -> Option<f64> {
        let (a, b) = (self.a.as_ref()?.as_f64()?, self.b.as_ref()?.as_f64()?);
        if a == 0.0 { None } else { Some((b - a) / a) }
    }
}

/// All leaves in which two statistics trees differ, in the order of the first.
pub fn statistics(a: &Value, b: &Value) -> Vec<StatisticDifference> {
    let mut found = Vec::new();
    walk("", Some(a), Some(b), &mut found);
    found
}

fn walk(path: &str, a: Option<&Value>, b: Option<&Value>, found: &mut Vec<StatisticDifference>) {
    let join = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (a, b) {
        (Some(Value::Object(x)), Some(Value::Object(y))) => {
            for (key, value) in x {
                walk(&join(key), Some(value), y.get(key), found);
            }
            for (key, value) in y.iter().filter(|(key, _)| !x.contains_key(*key)) {
                walk(&join(key), None, Some(value), found);
            }
        }
        (Some(Value::Array(x)), Some(Value::Array(y))) => {
            for i in 0..x.len().max(y.len()) {
                walk(&format!("{path}[{i}]"), x.get(i), y.get(i), found);
            }
        }
        (a, b) if a != b => {
            found.push(StatisticDifference { path: path.to_owned(), a: a.cloned(), b: b.cloned() });
        }
        _ => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn pixels_off_and_psnr() {
        let a = RgbaImage::from_pixel(10, 10, Rgba([100, 100, 100, 255]));
        let mut b = a.clone();
        assert_eq!(images(&a, &b).unwrap().psnr, f64::INFINITY);
        b.put_pixel(3, 4, Rgba([102, 100, 100, 255]));
        b.put_pixel(5, 6, Rgba([100, 110, 100, 255]));
        let d = images(&a, &b).unwrap();
        assert_eq!((d.different, d.off, d.largest), (2, 1, 10));
        let expected = 10.0 * (255.0_f64.powi(2) / (104.0 / 400.0)).log10();
        assert!((d.psnr - expected).abs() < 1e-9);
        assert_eq!(d.picture.get_pixel(5, 6).0, [0, 80, 0, 255]);
        assert!(images(&a, &RgbaImage::new(9, 10)).unwrap_err().contains("9 x 10"));
    }

    #[test]
    fn statistics_name_the_leaf() {
        let a = json!({"total": {"cycles": 10, "units": [{"busy": 1}, {"busy": 2}]}, "only_a": 1});
        let b = json!({"total": {"cycles": 15, "units": [{"busy": 1}]}});
        let d = statistics(&a, &b);
        let paths: Vec<_> = d.iter().map(|d| d.path.as_str()).collect();
        assert_eq!(paths, ["total.cycles", "total.units[1]", "only_a"]);
        assert_eq!(d[0].relative(), Some(0.5));
        assert_eq!(statistics(&a, &a), []);
    }
}
