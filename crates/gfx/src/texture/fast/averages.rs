//! [Elliptical weighted averages](crate::texture::ellipse), a texel of each lane at a time: footprints of neighbouring lanes have about as many
//! rows, and rows about as many texels.
//!
//! Each number comes from the operations of the general filter in the same order, so both have the same bits; a test compares them.

use super::staged::{LANES_MIN, Store, Stores, Values, bordered};
use super::{Geometry, integer};
use crate::math::exp;
use crate::simd::wide;
use crate::state::AddressMode;
use crate::texture::ellipse::{self, Ellipse, Ellipses};
use crate::texture::sampler::fold;
use crate::texture::{Lod, Sample, Sampler, View};
use num::{LANES, Lanes, Mask};

/// Samples where the view, sampler and operands allow; says whether they did.
#[inline]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) -> bool {
    if !ellipse::applies(view, sampler, args)
        || mask.count_ones() < LANES_MIN
        || args.offset != [0; 3]
        || args.compare.is_some()
        || view.samples != 1
        || bordered(sampler)
    {
        return false;
    }
    match Stores::of(view) {
        Some(Stores::Unorm(store)) => average(view, store, sampler, args, mask, out),
        Some(Stores::Srgb(store)) => average(view, store, sampler, args, mask, out),
        Some(Stores::Single(store)) => average(view, store, sampler, args, mask, out),
        Some(Stores::Float(store)) => average(view, store, sampler, args, mask, out),
        None => return false,
    }
    true
}

wide! {
    fn average [S: Store] (view: &View, store: S, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) = body;
}

/// The footprints of all lanes: their terms as [`Ellipse`] has them.
struct Footprints {
    level: [u32; LANES],
    a: [f32; LANES],
    b: [f32; LANES],
    c: [f32; LANES],
    f: [f32; LANES],
    /// Negative where there is none.
    height: [f32; LANES],
    fade: [f32; LANES],
}

impl Footprints {
    #[inline(always)]
    fn new(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask) -> Footprints {
        let one = [1.0; LANES];
        let mut out = Footprints { level: [0; LANES], a: one, b: one, c: one, f: one, height: [-1.0; LANES], fade: one };
        let mut ellipses = Ellipses::new(view, sampler, args);
        let together = if matches!(args.lod, Lod::Auto) { 4 } else { 1 };
        for first in (0..LANES).step_by(together) {
            if mask >> first & ((1 << together) - 1) == 0 {
                continue;
            }
            let Ellipse { level, a, b, c, f, height, fade, .. } = ellipses.of(first);
            let lanes = first..first + together;
            out.level[lanes.clone()].fill(level as u32);
            let terms = [
                (&mut out.a, a),
                (&mut out.b, b),
                (&mut out.c, c),
                (&mut out.f, f),
                (&mut out.height, height),
                (&mut out.fade, fade),
            ];
            for (to, term) in terms {
                to[lanes.clone()].fill(term);
            }
        }
        out
    }
}

/// Texel indices of integer places along an axis of `size` texels, any number of periods away.
#[inline(always)]
fn wrap_along(mode: AddressMode, places: &[i32; LANES], size: &[f32; LANES], out: &mut [i32; LANES]) {
    // Places and sizes are far below 2^22, so that quotients which are rounded have the right whole part.
    match mode {
        AddressMode::Repeat => {
            for i in 0..LANES {
                let periods = integer((places[i] as f32 / size[i]).floor());
                out[i] = places[i].wrapping_sub(periods.wrapping_mul(integer(size[i])));
            }
        }
        AddressMode::MirrorRepeat => {
            for i in 0..LANES {
                let n = integer(size[i]);
                let periods = integer((places[i] as f32 / (2.0 * size[i])).floor());
                let m = places[i].wrapping_sub(periods.wrapping_mul(2 * n));
                out[i] = if m < n { m } else { 2 * n - 1 - m };
            }
        }
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => {
            for i in 0..LANES {
                let last = integer(size[i]) - 1;
                let low = if places[i] > 0 { places[i] } else { 0 };
                out[i] = if low < last { low } else { last };
            }
        }
    }
}

#[inline(always)]
fn most(counts: &[i32; LANES]) -> i32 {
    let mut most = 0;
    for &count in counts {
        most = if count > most { count } else { most };
    }
    most
}

#[inline(always)]
fn body<S: Store>(view: &View, store: S, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) {
    let Footprints { level, a, b, c, f, height, fade } = Footprints::new(view, sampler, args, mask);
    let at = Geometry::new(view, args, &level, matches!(args.lod, Lod::Auto));
    let [across, down] = [sampler.address[0], sampler.address[1]];
    let (mut u, mut v, mut per_a) = ([0.0; LANES], [0.0; LANES], [0.0; LANES]);
    let (mut low, mut rows) = ([0; LANES], [0; LANES]);
    for i in 0..LANES {
        u[i] = fold(across, args.coords[0].f32()[i]) * at.width[i] - 0.5;
        v[i] = fold(down, args.coords[1].f32()[i]) * at.height[i] - 0.5;
        per_a[i] = 1.0 / a[i];
        low[i] = integer((v[i] - height[i]).ceil());
        rows[i] = integer((v[i] + height[i]).floor()) - low[i] + 1;
    }
    let (mut sum, mut total): (Values, _) = ([[0.0; LANES]; 4], [0.0; LANES]);
    let (mut row, mut y, mut first, mut texels) = ([0; LANES], [0; LANES], [0; LANES], [0; LANES]);
    let (mut weight, mut ratio) = ([0.0; LANES], [0.0; LANES]);
    let (mut column, mut x, mut places): (_, _, [u32; LANES]) = ([0; LANES], [0; LANES], [0; LANES]);
    let mut values: Values = [[0.0; LANES]; 4];
    for k in 0..most(&rows) {
        for i in 0..LANES {
            row[i] = low[i] + k;
            let dv = row[i] as f32 - v[i];
            let (bv, cvv) = (b[i] * dv, c[i] * dv * dv);
            let square = (height[i] * height[i] - dv * dv) / f[i];
            let reach = (if square > 0.0 { square } else { 0.0 }).sqrt() * per_a[i];
            let middle = u[i] - 0.5 * bv * per_a[i];
            first[i] = integer((middle - reach).ceil());
            let count = integer((middle + reach).floor()) - first[i] + 1;
            texels[i] = if k < rows[i] { count } else { 0 };
            let du = first[i] as f32 - u[i];
            weight[i] = exp(-2.0 * ((a[i] * du + bv) * du + cvv));
            ratio[i] = exp(-2.0 * (a[i] * (2.0 * du + 1.0) + bv));
        }
        wrap_along(down, &row, &at.height, &mut y);
        for j in 0..most(&texels) {
            for i in 0..LANES {
                column[i] = first[i] + j;
            }
            wrap_along(across, &column, &at.width, &mut x);
            S::places(&at, &x, &y, &mut places);
            store.texels(&places, &mut values);
            for (sum, values) in sum.iter_mut().zip(&values) {
                for i in 0..LANES {
                    let more = sum[i] + values[i] * weight[i];
                    sum[i] = if j < texels[i] { more } else { sum[i] };
                }
            }
            for i in 0..LANES {
                let more = total[i] + weight[i];
                total[i] = if j < texels[i] { more } else { total[i] };
                weight[i] *= ratio[i];
                ratio[i] *= fade[i];
            }
        }
    }
    for (out, sum) in out.iter_mut().zip(&sum) {
        let out = out.f32_mut();
        for i in 0..LANES {
            out[i] = if total[i] > 0.0 { sum[i] / total[i] } else { 0.0 };
        }
    }
}
