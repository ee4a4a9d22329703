//! The nearest texels of a flat texture of one level with four 8-bit channels, as older programs have them: what [`super::staged`] computes in
//! stages, with what is the same in all lanes as single numbers. Same operations, same bits.

use super::fast::integer;
use super::sampler::fold;
use super::staged::{bordered, wrap};
use super::view::{Level, Texels, word_in_columns};
use super::{Sample, Sampler, View};
use crate::simd::wide;
use crate::state::AddressMode;
use num::{LANES, Lanes};

/// Samples where view, sampler and operands allow; says whether they did. The view is flat, without samples, offsets and anisotropy.
#[inline(always)]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) -> bool {
    let (Texels::Unorm8(columns), [level]) = (&view.texels, &*view.levels) else { return false };
    let nearest = !sampler.mag_linear && !sampler.min_linear && !bordered(sampler);
    if !nearest || args.layer.is_some() || args.compare.is_some() {
        return false;
    }
    texels(columns.as_flattened(), level, sampler, args, out);
    true
}

wide! {
    fn texels(words: &[u32], level: &Level, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = texels_body;
}

#[inline(always)]
fn texels_body(words: &[u32], level: &Level, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let mut along = [[0; LANES]; 2];
    for (axis, to) in along.iter_mut().enumerate() {
        places_along(sampler.address[axis], args.coords[axis].f32(), level.size[axis] as f32, to);
    }
    let ([x, y], [base, _]) = (&along, level.columns);
    let mut codes = [0; LANES];
    for i in 0..LANES {
        codes[i] = word_in_columns(base, level.stride, x[i] as u32, y[i] as u32);
    }
    // Each is inside: the places of both axes are.
    for code in &mut codes {
        *code = words.get(*code as usize).copied().unwrap_or_default();
    }
    for (c, channel) in out.iter_mut().enumerate() {
        let channel = channel.f32_mut();
        for i in 0..LANES {
            channel[i] = (codes[i] >> (8 * c) & 0xff) as i32 as f32 / 255.0;
        }
    }
}

/// The place of each lane along an axis.
#[inline(always)]
fn places_along(mode: AddressMode, u: &[f32; LANES], size: f32, out: &mut [i32; LANES]) {
    #[inline(always)]
    fn of(mode: AddressMode, u: &[f32; LANES], size: f32, out: &mut [i32; LANES]) {
        for i in 0..LANES {
            out[i] = wrap(mode, integer((fold(mode, u[i]) * size).floor()), size as i32);
        }
    }
    // One loop a mode: the compiler makes vectors of what it knows.
    match mode {
        AddressMode::Repeat => of(AddressMode::Repeat, u, size, out),
        AddressMode::MirrorRepeat => of(AddressMode::MirrorRepeat, u, size, out),
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => of(AddressMode::ClampToEdge, u, size, out),
    }
}
