//! Sampling of flat textures, all 64 lanes at a time, with the bits of [`super::general`].
//!
//! Stages over all lanes, each a straight loop: level of detail, levels and their geometry, places and weights, texels, arithmetic. Four 8-bit
//! channels of which all are filtered go on to [`fixed`], anisotropic samples to [`averages`], everything else to [`staged`].

mod averages;
mod fixed;
mod staged;

use super::general::is_fixed;
use super::lod::{self, clamp, clamp_one, flat_lambda, quad_lambda};
use super::{Lod, Sample, Sampler, View};
use crate::state::{AddressMode, ViewDimension};
use num::{LANES, Lanes, Mask, QUADS};

/// The levels that quads read.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct QuadLevels {
    /// The first of each.
    pub first: [u32; QUADS],
    /// The weight of the following one.
    pub weight: [f32; QUADS],
}

impl QuadLevels {
    /// Finds those of a flat view by what [`super::lod::quad_rho`] says of each quad.
    #[inline(always)]
    pub(super) fn find(&mut self, view: &View, sampler: &Sampler, rho: &[f32; QUADS]) {
        for q in 0..QUADS {
            let lambda = clamp_one(quad_lambda(rho[q]), sampler);
            (self.first[q], self.weight[q]) = split(lambda, view.levels.len(), sampler);
        }
    }

    /// The same where a number is added to the level of detail of each quad.
    #[inline(always)]
    pub(super) fn find_biased(&mut self, view: &View, sampler: &Sampler, rho: &[f32; QUADS], bias: &[f32; QUADS]) {
        for q in 0..QUADS {
            let lambda = clamp_one(quad_lambda(rho[q]) + bias[q], sampler);
            (self.first[q], self.weight[q]) = split(lambda, view.levels.len(), sampler);
        }
    }
}

/// Samples where the view, sampler and operands allow; says whether they did. `found` receives the levels of the quads, where sampling
/// looks for them. Where it is false, `out` has zeros.
#[inline]
pub(super) fn sample(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    mask: Mask,
    found: &mut Option<QuadLevels>,
    out: &mut [Lanes; 4],
) -> bool {
    if is_fixed(view, sampler, args) {
        fixed::sample(view, sampler, args, found, out);
        return true;
    }
    *out = [Lanes::ZERO; 4];
    staged::sample(view, sampler, args, mask, out) || averages::sample(view, sampler, args, mask, out)
}

/// Whether places are two-dimensional and all texels of a level are filtered, without a border.
pub(super) fn is_flat(view: &View, sampler: &Sampler) -> bool {
    let bordered = sampler.address[..2].contains(&AddressMode::ClampToBorder);
    let filters = sampler.mag_linear && sampler.min_linear && sampler.anisotropy <= 1.0;
    matches!(view.dimension, ViewDimension::D2 | ViewDimension::D2Array) && !bordered && filters
}

/// A texel and its neighbour to the right (below), which is the first again where the address repeats, else the same.
#[inline(always)]
pub(super) fn pair(mode: AddressMode, texel: i32, size: f32) -> [u32; 2] {
    let repeats = if mode == AddressMode::Repeat { 0 } else { !0 };
    let next = texel + 1;
    let next = if next < integer(size) { next } else { texel & repeats };
    [texel as u32, next as u32]
}

/// The first level of every lane and the weight of the following one; says whether any weight is not 0.
#[inline(always)]
pub(super) fn choose(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    first: &mut [u32; LANES],
    weight: &mut [f32; LANES],
) -> bool {
    let count = view.levels.len();
    if count == 1 {
        return false;
    }
    let lambda = lambda(view, sampler, args);
    let mut most = 0.0_f32;
    for i in 0..LANES {
        (first[i], weight[i]) = split(lambda[i], count, sampler);
        most = if weight[i] > most { weight[i] } else { most };
    }
    most > 0.0
}

/// The first of two levels that a clamped level of detail reads, and the weight of the other.
#[inline(always)]
pub(super) fn split(lambda: f32, count: usize, sampler: &Sampler) -> (u32, f32) {
    let last = (count - 1) as f32;
    let (rounding, share) = if sampler.mip_linear { (0.0, 1.0) } else { (0.5, 0.0) };
    let d = if lambda > 0.0 { lambda } else { 0.0 };
    let d = if d < last { d + rounding } else { last };
    let whole = d.floor();
    (integer(whole) as u32, (d - whole) * share)
}

/// The level after another; the last one has none after it.
#[inline(always)]
pub(super) fn following(view: &View, level: u32) -> u32 {
    let next = level + 1;
    if next < view.levels.len() as u32 { next } else { level }
}

/// The clamped level of detail of every lane.
#[inline(always)]
fn lambda(view: &View, sampler: &Sampler, args: &Sample<'_>) -> [f32; LANES] {
    let mut out = [0.0; LANES];
    if !matches!(args.lod, Lod::Auto) {
        lod::lambda(view, sampler, args, &mut out);
        return out;
    }
    flat_lambda(view, args, &mut out);
    clamp(&mut out, sampler);
    out
}

/// A level's geometry, lane by lane: in texels, or in columns.
pub(super) struct Geometry {
    pub width: [f32; LANES],
    pub height: [f32; LANES],
    pub stride: [u32; LANES],
    pub base: [u32; LANES],
}

impl Geometry {
    /// Spreads the geometry of each lane's level; with `quads`, all lanes of a quad have the level of its first.
    #[inline(always)]
    pub(super) fn new(view: &View, args: &Sample<'_>, level: &[u32; LANES], quads: bool) -> Geometry {
        let mut different = 0;
        for i in 0..LANES {
            different |= level[i] ^ level[0];
        }
        let l = &view.levels[level[0] as usize];
        let [base, _] = view.texels.geometry(l);
        let mut out = Geometry {
            width: [l.size[0] as f32; LANES],
            height: [l.size[1] as f32; LANES],
            stride: [l.stride; LANES],
            base: [base; LANES],
        };
        // Most batches lie in one level.
        if different != 0 {
            let step = if quads { 4 } else { 1 };
            for i in (0..LANES).step_by(step) {
                let l = &view.levels[level[i] as usize];
                out.width[i..i + step].fill(l.size[0] as f32);
                out.height[i..i + step].fill(l.size[1] as f32);
                out.stride[i..i + step].fill(l.stride);
                out.base[i..i + step].fill(view.texels.geometry(l)[0]);
            }
        }
        if let Some(layer) = args.layer {
            let last = view.layers() as i32 - 1;
            for i in 0..LANES {
                let [_, slice] = view.texels.geometry(&view.levels[level[i] as usize]);
                out.base[i] = out.base[i].wrapping_add(slice.wrapping_mul(layer.i32()[i].clamp(0, last) as u32));
            }
        }
        out
    }
}

/// A coordinate brought into one period of its address mode; NaN, also of an infinity, becomes 0 (or stays, to be clamped).
#[inline(always)]
pub(super) fn fold(mode: AddressMode, u: f32) -> f32 {
    match mode {
        AddressMode::Repeat => {
            let f = u - u.floor();
            if f > 0.0 { f } else { 0.0 }
        }
        AddressMode::MirrorRepeat => {
            let f = u - 2.0 * (u * 0.5).floor();
            let f = if f > 0.0 { f } else { 0.0 };
            if f < 2.0 - f { f } else { 2.0 - f }
        }
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => u,
    }
}

/// The left (upper) texel of a folded coordinate and the weight of its neighbour, which is 0 where a clamped coordinate is at or
/// beyond the centre of the last texel.
#[inline(always)]
pub(super) fn place(mode: AddressMode, folded: f32, size: f32) -> (i32, f32) {
    let place = folded * size - 0.5;
    let place = if mode == AddressMode::Repeat {
        place
    } else {
        let place = if place > 0.0 { place } else { 0.0 };
        if place < size - 1.0 { place } else { size - 1.0 }
    };
    let whole = place.floor();
    let weight = place - whole;
    // Only a repeating place can be left of the first texel: the last one is there.
    (integer(if whole < 0.0 { size - 1.0 } else { whole }), weight)
}

/// A whole number of magnitude below 2^22 as an integer: cheaper than a conversion that must saturate.
#[inline(always)]
pub(super) fn integer(whole: f32) -> i32 {
    (whole + 12_582_912.0).to_bits().wrapping_sub(12_582_912.0_f32.to_bits()) as i32
}
