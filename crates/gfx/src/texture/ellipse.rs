//! Anisotropic filtering in two dimensions: the elliptical weighted average of P. S. Heckbert, "Fundamentals of Texture Mapping
//! and Image Warping" (1989), section 3.5.
//!
//! A pixel's footprint is the image of a round filter, an ellipse in the texture, and the result is the mean of the texels in it
//! under a Gaussian that falls to e^-2 at its rim. Its conjugate radii are the derivatives, in texels of one level; a texel's own
//! filter adds 1 to both squares, so that the ellipse holds at least the unit circle and never misses all texels.
//!
//! Where the ratio of the derivatives is beyond the sampler's anisotropy, the shorter one is lengthened. The level is the one in
//! which the shorter has 1 to 2 texels. Where levels end or are clamped below that one, the ellipse shrinks instead to 2 texels:
//! no footprint has more than about 300 texels. Vulkan leaves the scheme open; this one is free of the steps that a few probes of
//! two levels show on grazing surfaces.

use super::lod::{BIAS, clamp_one};
use super::sampler::{fold, wrap};
use super::taps::TexturePoint;
use super::{Lod, Sample, Sampler, View};
use crate::math::{exp, log2};
use crate::state::ViewDimension;

/// The footprint of a pixel in a level: where `a u^2 + b u v + c v^2 < 1`, in texels from its centre.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ellipse {
    pub level: usize,
    /// Bilinear samples along its longer radius that take as long as filtering it does in cards: the ratio of the radii, of which the
    /// shorter counts as a texel at least (Direct3D 11.3 Functional Specification, section 7.18.11).
    pub probes: u16,
    pub a: f32,
    pub b: f32,
    pub c: f32,
    /// 4 / (4 a c - b^2).
    pub f: f32,
    /// Half the height of its bounding box.
    pub height: f32,
    /// By what the ratio of neighbouring weights of a row falls from texel to texel.
    pub fade: f32,
}

/// Whether a sample is filtered anisotropically by ellipses.
pub(super) fn applies(view: &View, sampler: &Sampler, args: &Sample<'_>) -> bool {
    sampler.anisotropy > 1.0
        && matches!(view.dimension, ViewDimension::D2 | ViewDimension::D2Array)
        && matches!(args.lod, Lod::Auto | Lod::Bias(_) | Lod::Gradient { .. })
}

/// The footprints of the lanes of a batch, asked for in their order.
pub(super) struct Ellipses<'a> {
    view: &'a View,
    sampler: &'a Sampler,
    args: &'a Sample<'a>,
    /// The last quad, and its footprint.
    last: Option<(usize, Ellipse)>,
}

impl<'a> Ellipses<'a> {
    pub(super) fn new(view: &'a View, sampler: &'a Sampler, args: &'a Sample<'a>) -> Ellipses<'a> {
        Ellipses { view, sampler, args, last: None }
    }

    /// The footprint of a lane.
    #[inline(always)]
    pub(super) fn of(&mut self, lane: usize) -> Ellipse {
        let args = self.args;
        let [u, v] = [args.coords[0].f32(), args.coords[1].f32()];
        let quad = lane / 4;
        // Without a bias or derivatives of its own a lane has the footprint of its quad.
        if let (Some((of, ellipse)), Lod::Auto) = (self.last, args.lod)
            && of == quad
        {
            return ellipse;
        }
        let first = 4 * quad;
        let (dx, dy) = match args.lod {
            Lod::Gradient { dx, dy } => ([dx[0].f32()[lane], dx[1].f32()[lane]], [dy[0].f32()[lane], dy[1].f32()[lane]]),
            _ => ([u[first + 1] - u[first], v[first + 1] - v[first]], [u[first + 2] - u[first], v[first + 2] - v[first]]),
        };
        let bias = match args.lod {
            Lod::Bias(bias) => bias.f32()[lane].clamp(BIAS.0, BIAS.1),
            _ => 0.0,
        };
        let ellipse = Ellipse::new(self.view, self.sampler, dx, dy, bias);
        self.last = Some((quad, ellipse));
        ellipse
    }
}

/// The squared lengths of the longer and the shorter of two vectors, the shorter as if lengthened to the longer divided by
/// `ratio`.
#[inline(always)]
fn squares(x: [f32; 2], y: [f32; 2], ratio: f32) -> (f32, f32) {
    let (x, y) = (x[0] * x[0] + x[1] * x[1], y[0] * y[0] + y[1] * y[1]);
    let (most, least) = if x > y { (x, y) } else { (y, x) };
    let bound = most / (ratio * ratio);
    (most, if least > bound { least } else { bound })
}

impl Ellipse {
    /// The footprint for derivatives of the coordinates and a bias of the level of detail. Derivatives that are not finite count
    /// as infinite for the level, and as zero within it.
    #[inline(always)]
    pub(super) fn new(view: &View, sampler: &Sampler, dx: [f32; 2], dy: [f32; 2], bias: f32) -> Ellipse {
        let scaled = |level: usize, d: [f32; 2]| {
            let [w, h, _] = view.levels[level].size;
            [d[0] * w as f32, d[1] * h as f32]
        };
        let finite = dx.into_iter().chain(dy).all(f32::is_finite);
        let (most, least) = squares(scaled(0, dx), scaled(0, dy), sampler.anisotropy);
        let finite = finite && most.is_finite();
        let least = if finite { least } else { f32::INFINITY };
        let ratio = if finite { (most / least.max(1.0)).sqrt() } else { 1.0 };
        // What rounding adds to a whole ratio is no further sample.
        let probes = (ratio - 1.0 / 64.0).ceil().clamp(1.0, sampler.anisotropy.max(1.0)) as u16;
        let lambda = clamp_one(0.5 * log2(least) + bias, sampler);
        let last = view.levels.len() - 1;
        let rounding = if sampler.mip_linear { 0.0 } else { 0.5 };
        // A conversion saturates, and takes NaN to 0.
        let level = ((lambda + rounding) as usize).min(last);

        let (mut x, mut y) = (scaled(level, dx), scaled(level, dy));
        if !finite {
            (x, y) = ([0.0; 2], [0.0; 2]);
        }
        let (_, least) = squares(x, y, sampler.anisotropy);
        let (xx, yy) = (x[0] * x[0] + x[1] * x[1], y[0] * y[0] + y[1] * y[1]);
        let width = least.sqrt();
        let shrink = if width > 2.0 { 2.0 / width } else { 1.0 };
        // What has no direction cannot be lengthened.
        let grow = |own: f32| if own > 1e-30 && own < least { width * shrink / own.sqrt() } else { shrink };
        let (by_x, by_y) = (grow(xx), grow(yy));
        let ([ux, vx], [uy, vy]) = ([x[0] * by_x, x[1] * by_x], [y[0] * by_y, y[1] * by_y]);

        let (uu, vv, uv) = (ux * ux + uy * uy, vx * vx + vy * vy, ux * vx + uy * vy);
        let cross = ux * vy - uy * vx;
        // (uu + 1) (vv + 1) - uv^2 without its cancellation.
        let f = cross * cross + uu + vv + 1.0;
        let a = (vv + 1.0) / f;
        Ellipse { level, probes, a, b: -2.0 * uv / f, c: (uu + 1.0) / f, f, height: (vv + 1.0).sqrt(), fade: exp(-4.0 * a) }
    }

    /// Calls `one` with each texel of the footprint around a place, and its weight; the weights do not add up to 1.
    #[inline(always)]
    pub(super) fn texels(
        &self,
        view: &View,
        sampler: &Sampler,
        place: TexturePoint,
        offset: [i32; 3],
        mut one: impl FnMut([i32; 3], f32),
    ) {
        let [w, h, _] = view.levels[self.level].size;
        let [across, down] = [sampler.address[0], sampler.address[1]];
        let u = fold(across, place.coords[0]) * w as f32 - 0.5;
        let v = fold(down, place.coords[1]) * h as f32 - 0.5;
        let Ellipse { a, b, c, f, height, .. } = *self;
        let per_a = 1.0 / a;
        for row in (v - height).ceil() as i32..=(v + height).floor() as i32 {
            let dv = row as f32 - v;
            let (bv, cvv) = (b * dv, c * dv * dv);
            // The roots of a u^2 + b v u + c v^2 = 1 bound the row; their difference without cancellation, and 0 at the rim.
            let square = (height * height - dv * dv) / f;
            let reach = (if square > 0.0 { square } else { 0.0 }).sqrt() * per_a;
            let middle = u - 0.5 * bv * per_a;
            let (first, last) = ((middle - reach).ceil() as i32, (middle + reach).floor() as i32);
            let y = wrap(down, row + offset[1], h as i32);
            let du = first as f32 - u;
            // The exponents along a row are a quadratic function, hence the ratios of neighbours a geometric sequence.
            let mut weight = exp(-2.0 * ((a * du + bv) * du + cvv));
            let mut ratio = exp(-2.0 * (a * (2.0 * du + 1.0) + bv));
            for column in first..=last {
                one([wrap(across, column + offset[0], w as i32), y, place.slice as i32], weight);
                weight *= ratio;
                ratio *= self.fade;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::format::Format;
    use crate::state::{AddressMode, FilterMode, SamplerDesc};
    use crate::texture::tests::{image, view_of};
    use num::Lanes;
    use proptest::prelude::*;

    fn sampler(anisotropy: u16) -> Sampler {
        Sampler::new(&SamplerDesc {
            address: [AddressMode::Repeat; 3],
            mag: FilterMode::Linear,
            min: FilterMode::Linear,
            mipmap: FilterMode::Linear,
            anisotropy,
            ..SamplerDesc::default()
        })
    }

    fn texels(view: &View, sampler: &Sampler, ellipse: &Ellipse, coords: [f32; 2]) -> Vec<([i32; 3], f32)> {
        let mut found = Vec::new();
        let place = TexturePoint { coords: [coords[0], coords[1], 0.0], slice: 0 };
        ellipse.texels(view, sampler, place, [0; 3], |texel, weight| found.push((texel, weight)));
        found
    }

    proptest! {
        #[test]
        fn texels_and_weights_are_those_of_the_definition(
            x in [-40.0_f64..40.0, -40.0_f64..40.0],
            y in [-40.0_f64..40.0, -40.0_f64..40.0],
            at in [0.0_f32..1.0, 0.0_f32..1.0],
        ) {
            let view = view_of(&image([64, 64, 1], 7, Format::Rgba8Unorm), ViewDimension::D2);
            let sampler = sampler(16);
            let derivative = |d: [f64; 2]| d.map(|t| (t / 64.0) as f32);
            let ellipse = Ellipse::new(&view, &sampler, derivative(x), derivative(y), 0.0);
            let (p, q) = (x[0].hypot(x[1]), y[0].hypot(y[1]));
            let (longer, shorter) = (p.max(q), p.min(q));
            let minor = shorter.max(longer / 16.0);
            let exact = minor.log2().clamp(0.0, 6.0);
            // Next to the border between two levels either will do.
            prop_assume!((exact - exact.round()).abs() > 1e-5 || exact == 0.0);
            prop_assert_eq!(ellipse.level, exact as usize);
            let n = f64::from(64 >> ellipse.level);
            let shrink = (2.0 / (minor * n / 64.0)).min(1.0);
            let radius = |d: [f64; 2]| {
                let length = d[0].hypot(d[1]);
                let grow = if length < minor { minor / length } else { 1.0 };
                d.map(|t| t * grow * shrink * n / 64.0)
            };
            let ([ux, vx], [uy, vy]) = (radius(x), radius(y));
            let (a, b, c) = (vx * vx + vy * vy + 1.0, -2.0 * (ux * vx + uy * vy), ux * ux + uy * uy + 1.0);
            let f = a * c - b * b / 4.0;
            let centre = at.map(|t| f64::from(t) * n - 0.5);
            let mut want = std::collections::BTreeMap::<(i32, i32), f64>::new();
            let mut rim = 0.0;
            for v in -80_i32..160 {
                for u in -80_i32..160 {
                    let (du, dv) = (f64::from(u) - centre[0], f64::from(v) - centre[1]);
                    let r = (a * du * du + b * du * dv + c * dv * dv) / f;
                    if r < 1.0 {
                        *want.entry((u.rem_euclid(n as i32), v.rem_euclid(n as i32))).or_default() += (-2.0 * r).exp();
                    }
                    // A texel this near to the rim may be in or out.
                    rim += if (r - 1.0).abs() < 1e-3 { 0.14 } else { 0.0 };
                }
            }
            let mut got = std::collections::BTreeMap::<(i32, i32), f64>::new();
            let found = texels(&view, &sampler, &ellipse, at);
            prop_assert!(found.len() <= 320, "{} texels", found.len());
            for ([u, v, _], weight) in found {
                *got.entry((u, v)).or_default() += f64::from(weight);
            }
            let total: f64 = want.values().sum();
            let mut difference = 0.0;
            for place in want.keys().chain(got.keys()).collect::<std::collections::BTreeSet<_>>() {
                difference += (want.get(place).unwrap_or(&0.0) - got.get(place).unwrap_or(&0.0)).abs();
            }
            prop_assert!(difference <= rim + 1e-3 * total, "{difference} of {total}, rim {rim}");
        }

        #[test]
        fn any_derivatives_read_a_bounded_number_of_texels(
            bits in any::<[u32; 4]>(),
            bias in -16.0_f32..16.0,
            at in any::<[u32; 2]>(),
            levels in 1_u32..4,
            size in [1_u32..300, 1_u32..300],
        ) {
            let levels = levels.min(32 - size[0].max(size[1]).leading_zeros());
            let view = view_of(&image([size[0], size[1], 1], levels, Format::Rgba8Unorm), ViewDimension::D2);
            let d = bits.map(f32::from_bits);
            for anisotropy in [2, 16] {
                let sampler = sampler(anisotropy);
                let ellipse = Ellipse::new(&view, &sampler, [d[0], d[1]], [d[2], d[3]], bias);
                let found = texels(&view, &sampler, &ellipse, at.map(f32::from_bits));
                prop_assert!((1..=320).contains(&found.len()), "{} texels", found.len());
                prop_assert!(found.iter().map(|(_, w)| w).sum::<f32>() > 0.1);
            }
        }
    }

    #[test]
    fn a_long_footprint_blurs_along_itself_only() {
        // Columns of 0 and 1 in turn: along u they average, along v they do not.
        let desc = image([64, 64, 1], 1, Format::R32Float);
        let words = num::Words::new(desc.bytes());
        for i in 0..64 * 64 {
            words.store(i, ((i % 2) as f32).to_bits());
        }
        let range = super::super::tests::whole(&desc, ViewDimension::D2);
        let view = View::new(&words, &desc, &range, 0).expect("a valid view");
        let run = |x: [f32; 2], y: [f32; 2]| {
            let zero = Lanes::ZERO;
            let d = [x[0], x[1], y[0], y[1]].map(|t| Lanes::splat_f32(t / 64.0));
            let at = Lanes::splat_f32(31.5 / 64.0);
            let lod = Lod::Gradient { dx: [&d[0], &d[1], &zero], dy: [&d[2], &d[3], &zero] };
            let args = Sample { coords: [&at, &at, &zero], layer: None, offset: [0; 3], lod, compare: None };
            let mut out = [Lanes::ZERO; 4];
            view.sample(&sampler(16), &args, 1, &mut out);
            let mut footprint = super::super::Footprint::new();
            view.record_sample(&sampler(16), &args, 1, &mut footprint);
            (out[0].f32()[0], footprint.quad(0).1)
        };
        let (along, operations) = run([8.0, 0.0], [0.0, 0.5]);
        assert!((along - 0.5).abs() < 0.01, "{along}");
        assert!((5..=9).contains(&operations), "{operations}");
        let (across, _) = run([0.5, 0.0], [0.0, 8.0]);
        assert!(!(0.25..=0.75).contains(&across), "{across}");
    }

    #[test]
    fn a_footprint_takes_as_many_samples_as_it_is_longer_than_wide() {
        let view = view_of(&image([64, 64, 1], 7, Format::Rgba8Unorm), ViewDimension::D2);
        // In texels: both radii, the sampler's limit, the samples. A footprint that is less than a texel wide takes one per texel of its length.
        for (x, y, most, expected) in [
            ([16.0, 0.0], [0.0, 1.0], 16, 16),
            ([0.0, 2.0], [32.0, 0.0], 16, 16),
            ([0.0, 2.0], [64.0, 0.0], 16, 16),
            ([8.0, 0.0], [0.0, 2.0], 16, 4),
            ([8.0, 0.0], [0.0, 2.0], 2, 2),
            ([5.0, 0.0], [0.0, 2.0], 16, 3),
            ([4.0, 0.0], [0.0, 4.0], 16, 1),
            ([0.3, 0.0], [0.0, 0.1], 16, 1),
            ([8.0, 0.0], [0.0, 0.5], 16, 8),
            ([f32::INFINITY, 0.0], [0.0, 1.0], 16, 1),
        ] {
            let texels = |d: [f32; 2]| d.map(|t| t / 64.0);
            let ellipse = Ellipse::new(&view, &sampler(most), texels(x), texels(y), 0.0);
            assert_eq!(ellipse.probes, expected, "{x:?} {y:?} {most}");
        }
    }
}
