//! The common case: four 8-bit channels, two dimensions, linear within a level.
//!
//! Stages over all 64 lanes, each a straight loop: level of detail, levels, places and weights, texels, arithmetic. Texels are
//! read in horizontal pairs, which the store's repeated first column makes possible in every address mode. Filtering is in
//! 16-bit fixed point: an 8-bit code times 128 and weights of 16 bits, so that a trilinear result is within a fortieth of an
//! 8-bit step of the exact one.

use super::lod::{Selection, clamp};
use super::record::Footprint;
use super::view::{FIXED_ONE, Texels};
use super::{Lod, Sample, Sampler, View};
use crate::gfx::math::log2;
use crate::gfx::simd::wide;
use crate::gfx::state::{AddressMode, ViewDimension};
use crate::num::{LANES, Lanes, Mask, QUADS};

/// Samples where the view, sampler and operands allow; says whether they did.
#[inline]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) -> bool {
    let Texels::Rgba8 { codes, linear } = &view.texels else { return false };
    if !is_flat(view, sampler) || args.compare.is_some() || args.offset != [0; 3] {
        return false;
    }
    match linear {
        None => sample_unorm(view, codes, sampler, args, out),
        Some(texels) => sample_srgb(view, texels, sampler, args, out),
    }
    true
}

/// Whether places are two-dimensional and all texels of a level are filtered, without a border.
fn is_flat(view: &View, sampler: &Sampler) -> bool {
    let bordered = sampler.address[..2].contains(&AddressMode::ClampToBorder);
    let filters = sampler.mag_linear && sampler.min_linear && sampler.anisotropy <= 1.0;
    matches!(view.dimension, ViewDimension::D2 | ViewDimension::D2Array) && !bordered && filters
}

wide! {
    fn sample_unorm(view: &View, texels: &[u32], sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = body::<u32>;
    fn sample_srgb(view: &View, texels: &[u64], sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = body::<u64>;
}

/// A texel of the store and how it filters.
trait Texel: Copy {
    /// Reads the texels at places and their right neighbours.
    fn fetch(texels: &[Self], places: &[u32; LANES], left: &mut Values, right: &mut Values);
}

/// A texel a lane as 16-bit values, two a word: red in the low and blue in the high half; green and alpha.
#[derive(Clone, Copy)]
struct Values {
    rb: [u32; LANES],
    ga: [u32; LANES],
}

impl Values {
    const ZERO: Values = Values { rb: [0; LANES], ga: [0; LANES] };

    /// Moves towards other values by a weight.
    #[inline(always)]
    fn mix(&mut self, other: &Values, weight: &[u32; LANES]) {
        mix(&mut self.rb, &other.rb, weight);
        mix(&mut self.ga, &other.ga, weight);
    }
}

impl Texel for u32 {
    #[inline(always)]
    fn fetch(texels: &[u32], places: &[u32; LANES], left: &mut Values, right: &mut Values) {
        let mut pairs = [0_u64; LANES];
        for i in 0..LANES {
            let place = places[i] as usize;
            if let Some(&[a, b]) = texels.get(place..place + 2) {
                pairs[i] = u64::from(a) | u64::from(b) << 32;
            }
        }
        for i in 0..LANES {
            let (a, b) = (pairs[i] as u32, (pairs[i] >> 32) as u32);
            left.rb[i] = (a & 0x00ff_00ff) << 7;
            left.ga[i] = a >> 1 & 0x7f80_7f80;
            right.rb[i] = (b & 0x00ff_00ff) << 7;
            right.ga[i] = b >> 1 & 0x7f80_7f80;
        }
    }
}

impl Texel for u64 {
    #[inline(always)]
    fn fetch(texels: &[u64], places: &[u32; LANES], left: &mut Values, right: &mut Values) {
        let (mut a, mut b) = ([0_u64; LANES], [0_u64; LANES]);
        for i in 0..LANES {
            let place = places[i] as usize;
            if let Some(&[first, second]) = texels.get(place..place + 2) {
                (a[i], b[i]) = (first, second);
            }
        }
        for i in 0..LANES {
            (left.rb[i], left.ga[i]) = (a[i] as u32, (a[i] >> 32) as u32);
            (right.rb[i], right.ga[i]) = (b[i] as u32, (b[i] >> 32) as u32);
        }
    }
}

/// Records what a linear filter reads of a flat texture of any format; says whether it could. The texels are those of
/// [`sample`], found by the same arithmetic.
pub(super) fn record(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut Footprint) -> bool {
    let applies = is_flat(view, sampler) && args.offset == [0; 3];
    if applies {
        record_wide(view, sampler, args, mask, out);
    }
    applies
}

wide! {
    fn record_wide(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut Footprint) = record_body;
}

#[inline(always)]
fn record_body(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut Footprint) {
    let (mut first, mut weight) = ([0_u32; LANES], [0_u32; LANES]);
    let blend = choose(view, sampler, args, &mut first, &mut weight);
    let mut at = [Corners::ZERO; 2];
    corners(view, sampler, args, &first, &mut at[0]);
    let mut second = first;
    if blend {
        for i in 0..LANES {
            second[i] = following(view, first[i]);
        }
        corners(view, sampler, args, &second, &mut at[1]);
    }
    let last = view.layers() as i32 - 1;
    out.fill(mask, |lane, quad| {
        let slice = args.layer.map_or(0, |l| l.i32()[lane].clamp(0, last)) as u32;
        quad.square(view, first[lane] as usize, at[0].x[lane], at[0].y[lane], slice);
        if weight[lane] != 0 {
            quad.square(view, second[lane] as usize, at[1].x[lane], at[1].y[lane], slice);
        }
    });
}

/// The columns and the rows of the texels about every lane's place.
#[derive(Clone, Copy)]
struct Corners {
    x: [[u32; 2]; LANES],
    y: [[u32; 2]; LANES],
}

impl Corners {
    const ZERO: Corners = Corners { x: [[0; 2]; LANES], y: [[0; 2]; LANES] };
}

#[inline(always)]
fn corners(view: &View, sampler: &Sampler, args: &Sample<'_>, level: &[u32; LANES], out: &mut Corners) {
    let at = geometry(view, args, level, matches!(args.lod, Lod::Auto));
    let (mut index, mut weight) = ([0_i32; LANES], [0_u32; LANES]);
    for (c, size, pairs) in [(0, &at.width, &mut out.x), (1, &at.height, &mut out.y)] {
        axis(sampler.address[c], args.coords[c].f32(), size, &mut index, &mut weight);
        let repeats = if sampler.address[c] == AddressMode::Repeat { 0 } else { !0 };
        for i in 0..LANES {
            let next = index[i] + 1;
            let next = if next < integer(size[i]) { next } else { index[i] & repeats };
            pairs[i] = [index[i] as u32, next as u32];
        }
    }
}

/// A level's geometry, lane by lane.
struct Geometry {
    width: [f32; LANES],
    height: [f32; LANES],
    stride: [u32; LANES],
    base: [u32; LANES],
}

#[inline(always)]
fn body<T: Texel>(view: &View, texels: &[T], sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let (mut first, mut weight) = ([0_u32; LANES], [0_u32; LANES]);
    let blend = choose(view, sampler, args, &mut first, &mut weight);
    let quads = matches!(args.lod, Lod::Auto);
    let mut value = Values::ZERO;
    level(texels, sampler, args, &geometry(view, args, &first, quads), &mut value);
    if blend {
        for i in 0..LANES {
            first[i] = following(view, first[i]);
            weight[i] |= weight[i] << 16;
        }
        let mut second = Values::ZERO;
        level(texels, sampler, args, &geometry(view, args, &first, quads), &mut second);
        value.mix(&second, &weight);
    }
    const SCALE: f32 = 1.0 / FIXED_ONE;
    let [r, g, b, a] = out;
    for i in 0..LANES {
        r.f32_mut()[i] = (value.rb[i] & 0xffff) as i32 as f32 * SCALE;
        b.f32_mut()[i] = (value.rb[i] >> 16) as i32 as f32 * SCALE;
        g.f32_mut()[i] = (value.ga[i] & 0xffff) as i32 as f32 * SCALE;
        a.f32_mut()[i] = (value.ga[i] >> 16) as i32 as f32 * SCALE;
    }
}

/// The first level of every lane and the weight of the following one; says whether any weight is not 0.
#[inline(always)]
fn choose(view: &View, sampler: &Sampler, args: &Sample<'_>, first: &mut [u32; LANES], weight: &mut [u32; LANES]) -> bool {
    let count = view.levels.len();
    if count == 1 {
        return false;
    }
    let lambda = lambda(view, sampler, args);
    let last = (count - 1) as f32;
    let rounding = if sampler.mip_linear { 0.0 } else { 0.5 };
    let mut any = 0;
    for i in 0..LANES {
        let d = if lambda[i] > 0.0 { lambda[i] } else { 0.0 };
        let d = if d < last { d + rounding } else { last };
        let whole = d.floor();
        first[i] = integer(whole) as u32;
        weight[i] = if sampler.mip_linear { fixed(d - whole) } else { 0 };
        any |= weight[i];
    }
    any != 0
}

/// The level after another; the last one has none after it.
#[inline(always)]
fn following(view: &View, level: u32) -> u32 {
    let next = level + 1;
    if next < view.levels.len() as u32 { next } else { level }
}

/// The clamped level of detail of every lane.
#[inline(always)]
fn lambda(view: &View, sampler: &Sampler, args: &Sample<'_>) -> [f32; LANES] {
    if !matches!(args.lod, Lod::Auto) {
        return Selection::new(view, sampler, args).lambda;
    }
    let (u, v) = (args.coords[0].f32(), args.coords[1].f32());
    let (w, h) = (view.levels[0].size[0] as f32, view.levels[0].size[1] as f32);
    let mut rho = [0.0_f32; QUADS];
    for q in 0..QUADS {
        let (x, y) = (&u[4 * q..4 * q + 4], &v[4 * q..4 * q + 4]);
        let (ux, uy) = ((x[1] - x[0]) * w, (x[2] - x[0]) * w);
        let (vx, vy) = ((y[1] - y[0]) * h, (y[2] - y[0]) * h);
        let (dx, dy) = (ux * ux + vx * vx, uy * uy + vy * vy);
        rho[q] = if dx > dy { dx } else { dy };
    }
    for r in &mut rho {
        *r = 0.5 * log2(*r);
    }
    let mut out = [0.0; LANES];
    for i in 0..LANES {
        out[i] = rho[i / 4];
    }
    clamp(&mut out, sampler);
    out
}

/// Spreads the geometry of each lane's level; with `quads`, all lanes of a quad have the level of its first.
#[inline(always)]
fn geometry(view: &View, args: &Sample<'_>, level: &[u32; LANES], quads: bool) -> Geometry {
    let mut out = Geometry { width: [0.0; LANES], height: [0.0; LANES], stride: [0; LANES], base: [0; LANES] };
    let step = if quads { 4 } else { 1 };
    for i in (0..LANES).step_by(step) {
        let l = &view.levels[level[i] as usize];
        out.width[i..i + step].fill(l.size[0] as f32);
        out.height[i..i + step].fill(l.size[1] as f32);
        out.stride[i..i + step].fill(l.stride);
        out.base[i..i + step].fill(l.offset);
    }
    if let Some(layer) = args.layer {
        let last = view.layers() as i32 - 1;
        for i in 0..LANES {
            let slice = view.levels[level[i] as usize].slice;
            out.base[i] = out.base[i].wrapping_add(slice.wrapping_mul(layer.i32()[i].clamp(0, last) as u32));
        }
    }
    out
}

/// The bilinear value of every lane in its level.
#[inline(always)]
fn level<T: Texel>(texels: &[T], sampler: &Sampler, args: &Sample<'_>, at: &Geometry, out: &mut Values) {
    let (mut x, mut x_weight) = ([0_i32; LANES], [0_u32; LANES]);
    let (mut y, mut y_weight) = ([0_i32; LANES], [0_u32; LANES]);
    axis(sampler.address[0], args.coords[0].f32(), &at.width, &mut x, &mut x_weight);
    axis(sampler.address[1], args.coords[1].f32(), &at.height, &mut y, &mut y_weight);
    // Beyond the last row comes the first, or itself (with no weight then).
    let repeats = if sampler.address[1] == AddressMode::Repeat { 0 } else { !0 };
    let (mut top, mut bottom) = ([0_u32; LANES], [0_u32; LANES]);
    for i in 0..LANES {
        let next = y[i] + 1;
        let next = if next < integer(at.height[i]) { next } else { y[i] & repeats };
        let left = at.base[i].wrapping_add(x[i] as u32);
        top[i] = left.wrapping_add((y[i] as u32).wrapping_mul(at.stride[i]));
        bottom[i] = left.wrapping_add((next as u32).wrapping_mul(at.stride[i]));
    }
    let (mut right, mut lower, mut lower_right) = (Values::ZERO, Values::ZERO, Values::ZERO);
    T::fetch(texels, &top, out, &mut right);
    T::fetch(texels, &bottom, &mut lower, &mut lower_right);
    out.mix(&right, &x_weight);
    lower.mix(&lower_right, &x_weight);
    out.mix(&lower, &y_weight);
}

/// The left (upper) texel of each lane and the weight of its neighbour, in both halves of a word.
#[inline(always)]
fn axis(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], index: &mut [i32; LANES], weight: &mut [u32; LANES]) {
    let mut place = [0.0_f32; LANES];
    match mode {
        AddressMode::Repeat => {
            for i in 0..LANES {
                let f = u[i] - u[i].floor();
                // NaN, also of an infinity, becomes 0.
                let f = if f > 0.0 { f } else { 0.0 };
                place[i] = f * size[i] - 0.5;
            }
        }
        AddressMode::MirrorRepeat => {
            for i in 0..LANES {
                let f = u[i] - 2.0 * (u[i] * 0.5).floor();
                let f = if f > 0.0 { f } else { 0.0 };
                place[i] = inside(if f < 1.0 { f } else { 2.0 - f }, size[i]);
            }
        }
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => {
            for i in 0..LANES {
                place[i] = inside(u[i], size[i]);
            }
        }
    }
    for i in 0..LANES {
        let whole = place[i].floor();
        let w = fixed(place[i] - whole);
        weight[i] = w | w << 16;
        // Only a repeating place can be left of the first texel: the last one is there.
        let whole = if whole < 0.0 { size[i] - 1.0 } else { whole };
        index[i] = integer(whole);
    }
}

/// A place between the centres of the first and the last texel; NaN becomes the first.
#[inline(always)]
fn inside(u: f32, size: f32) -> f32 {
    let place = u * size - 0.5;
    let place = if place > 0.0 { place } else { 0.0 };
    if place < size - 1.0 { place } else { size - 1.0 }
}

/// A whole number of magnitude below 2^22 as an integer: cheaper than a conversion that must saturate.
#[inline(always)]
fn integer(whole: f32) -> i32 {
    (whole + 12_582_912.0).to_bits().wrapping_sub(12_582_912.0_f32.to_bits()) as i32
}

/// A weight in [0, 1) in 16 bits, to nearest.
#[inline(always)]
fn fixed(weight: f32) -> u32 {
    (weight * 65535.0 + 8_388_608.0).to_bits() & 0xffff
}

/// Adds `(b - a) * weight` to 16-bit values in [0, 32640], with weights of 16 bits, rounded down. Exact where the weight is 0 or
/// the values are equal; else at most one unit (1/128 of an 8-bit step) too small.
#[inline(always)]
fn mix(a: &mut [u32; LANES], b: &[u32; LANES], weight: &[u32; LANES]) {
    let (a, b, w): (&mut [i16; 2 * LANES], &[i16; 2 * LANES], &[i16; 2 * LANES]) =
        (bytemuck::cast_mut(a), bytemuck::cast_ref(b), bytemuck::cast_ref(weight));
    for i in 0..2 * LANES {
        let difference = b[i].wrapping_sub(a[i]);
        // The high half of a signed product is one instruction for 16 values on x86. A weight from a half on is negative as a
        // signed number, 1 too small: the difference is added back for it.
        let high = ((i32::from(difference) * i32::from(w[i])) >> 16) as i16;
        a[i] = a[i].wrapping_add(difference & w[i] >> 15).wrapping_add(high);
    }
}
