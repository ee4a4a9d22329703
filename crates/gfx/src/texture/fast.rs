//! Flat textures whose texels are filtered within a level, without a border: the common case, batch by batch.
//!
//! Stages over all 64 lanes, each a straight loop: level of detail, levels and their geometry, places and weights, texels,
//! arithmetic. Four 8-bit channels go on to [`super::fixed`]; single numbers (depth, with or without comparison) are filtered
//! here in `f32`.

use super::fixed;
use super::general::reference;
use super::lod::{Selection, clamp, flat_lambda};
use super::record::Footprint;
use super::view::Texels;
use super::{Lod, Sample, Sampler, View};
use crate::simd::wide;
use crate::state::{AddressMode, ViewDimension};
use num::{LANES, Lanes, Mask, QUADS};

/// Samples where the view, sampler and operands allow; says whether they did.
#[inline]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) -> bool {
    if !is_flat(view, sampler) || args.offset != [0; 3] {
        return false;
    }
    match &view.texels {
        Texels::Unorm8(_) | Texels::Srgb8 { .. } if args.compare.is_none() => fixed::sample(view, sampler, args, out),
        Texels::F32(texels) if view.levels.len() == 1 => single(view, texels, sampler, args, out),
        _ => return false,
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
    fn single(view: &View, texels: &[f32], sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = single_body;
}

/// Samples or compares single numbers of one level.
#[inline(always)]
fn single_body(view: &View, texels: &[f32], sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let level = [0; LANES];
    let at = Geometry::new(view, args, &level, true);
    let mut corners = Corners::ZERO;
    find_corners(sampler, args, &at, &mut corners);
    let mut taps = [[0.0_f32; LANES]; 4];
    for i in 0..LANES {
        let base = at.base[i];
        let row = |y: u32| base.wrapping_add(y.wrapping_mul(at.stride[i]));
        let (top, bottom) = (row(corners.y[i][0]), row(corners.y[i][1]));
        let read = |place: u32| texels.get(place as usize).copied().unwrap_or(0.0);
        let [left, right] = corners.x[i];
        taps[0][i] = read(top.wrapping_add(left));
        taps[1][i] = read(top.wrapping_add(right));
        taps[2][i] = read(bottom.wrapping_add(left));
        taps[3][i] = read(bottom.wrapping_add(right));
    }
    if let Some(r) = args.compare {
        for i in 0..LANES {
            let r = reference(view, r.f32()[i]);
            for tap in &mut taps {
                tap[i] = f32::from(u8::from(sampler.compare.test(r, tap[i])));
            }
        }
    }
    let [r, g, b, a] = out;
    for i in 0..LANES {
        let (x, y) = (corners.weight[0][i], corners.weight[1][i]);
        let top = taps[0][i] * ((1.0 - x) * (1.0 - y)) + taps[1][i] * (x * (1.0 - y));
        r.f32_mut()[i] = top + taps[2][i] * ((1.0 - x) * y) + taps[3][i] * (x * y);
    }
    (*g, *b, *a) = (Lanes::ZERO, Lanes::ZERO, Lanes::splat_f32(1.0));
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
    let (mut level, mut weight) = ([0_u32; LANES], [0.0_f32; LANES]);
    let both = out.takes_both(view, sampler);
    let blend = choose(view, sampler, args, &mut level, &mut weight) || both;
    let quads = matches!(args.lod, Lod::Auto);
    let mut lines = [[[0_u32; 4]; LANES]; 2];
    let mut single = [find_lines(view, sampler, args, &level, quads, &mut lines[0]), 0];
    // Lanes that read two levels.
    let mut two = 0;
    if blend {
        level.iter_mut().for_each(|level| *level = following(view, *level));
        single[1] = find_lines(view, sampler, args, &level, quads, &mut lines[1]);
        for i in 0..LANES {
            two |= Mask::from(weight[i] > 0.0 || both) << i;
        }
    }
    out.squares(mask, two, single, &lines);
}

/// The lines of each lane's four texels, row by row. Returns the quads whose lanes all read one and the same line.
#[inline(always)]
fn find_lines(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    level: &[u32; LANES],
    quads: bool,
    out: &mut [[u32; 4]; LANES],
) -> u16 {
    let size = |level: u32| view.levels[level as usize].size;
    let [width, height] = [size(level[0])[0], size(level[0])[1]];
    let (first, lines) = view.rows(level[0] as usize, 0);
    let (mut width, mut height) = ([width as f32; LANES], [height as f32; LANES]);
    let (mut base, mut row) = ([first; LANES], [lines; LANES]);
    let mut different = 0;
    for i in 0..LANES {
        different |= level[i] ^ level[0];
    }
    // Most batches lie in one level.
    if different != 0 {
        let step = if quads { 4 } else { 1 };
        for i in (0..LANES).step_by(step) {
            let [w, h] = [size(level[i])[0], size(level[i])[1]];
            let (first, lines) = view.rows(level[i] as usize, 0);
            width[i..i + step].fill(w as f32);
            height[i..i + step].fill(h as f32);
            base[i..i + step].fill(first);
            row[i..i + step].fill(lines);
        }
    }
    if let Some(layer) = args.layer {
        let last = view.layers() as i32 - 1;
        for i in 0..LANES {
            (base[i], row[i]) = view.rows(level[i] as usize, layer.i32()[i].clamp(0, last) as u32);
        }
    }
    let mut x = [[0_u32; LANES]; 2];
    let mut y = [[0_u32; LANES]; 2];
    neighbours(sampler.address[0], args.coords[0].f32(), &width, &mut x);
    neighbours(sampler.address[1], args.coords[1].f32(), &height, &mut y);
    let ((across, down), tile) = view.tiled(0).micro_tile();
    for i in 0..LANES {
        (x[0][i], x[1][i]) = ((x[0][i] >> across).wrapping_mul(tile), (x[1][i] >> across).wrapping_mul(tile));
        y[0][i] = base[i].wrapping_add((y[0][i] >> down).wrapping_mul(row[i]));
        y[1][i] = base[i].wrapping_add((y[1][i] >> down).wrapping_mul(row[i]));
    }
    let [[left, right], [upper, lower]] = [x, y];
    for i in 0..LANES {
        let (above, below) = (upper[i], lower[i]);
        out[i] = [above, above, below, below];
        for (line, column) in out[i].iter_mut().zip([left[i], right[i], left[i], right[i]]) {
            *line = line.wrapping_add(column);
        }
    }
    let mut single = 0;
    for q in 0..QUADS {
        let first = 4 * q;
        let mut different = 0;
        for i in first..first + 4 {
            different |= left[i] ^ right[i] | upper[i] ^ lower[i] | left[i] ^ left[first] | upper[i] ^ upper[first];
        }
        single |= u16::from(different == 0) << q;
    }
    single
}

/// The two texels that each lane filters along an axis: as [`find_corners`] has them.
#[inline(always)]
fn neighbours(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut [[u32; LANES]; 2]) {
    // One loop a mode: the compiler makes vectors of what it knows.
    match mode {
        AddressMode::Repeat => neighbours_of(AddressMode::Repeat, u, size, out),
        AddressMode::MirrorRepeat => neighbours_of(AddressMode::MirrorRepeat, u, size, out),
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => neighbours_of(AddressMode::ClampToEdge, u, size, out),
    }
}

#[inline(always)]
fn neighbours_of(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut [[u32; LANES]; 2]) {
    for i in 0..LANES {
        let (texel, _) = place(mode, fold(mode, u[i]), size[i]);
        let [_, second] = pair(mode, texel, size[i]);
        (out[0][i], out[1][i]) = (texel as u32, second);
    }
}

/// A texel and its neighbour to the right (below), which is the first again where the address repeats, else the same.
#[inline(always)]
fn pair(mode: AddressMode, texel: i32, size: f32) -> [u32; 2] {
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
    if !matches!(args.lod, Lod::Auto) {
        return Selection::new(view, sampler, args).lambda;
    }
    let mut out = [0.0; LANES];
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

/// The columns and the rows of the texels about every lane's place, and the weights of the right and lower ones.
#[derive(Clone, Copy)]
struct Corners {
    x: [[u32; 2]; LANES],
    y: [[u32; 2]; LANES],
    weight: [[f32; LANES]; 2],
}

impl Corners {
    const ZERO: Corners = Corners { x: [[0; 2]; LANES], y: [[0; 2]; LANES], weight: [[0.0; LANES]; 2] };
}

#[inline(always)]
fn find_corners(sampler: &Sampler, args: &Sample<'_>, at: &Geometry, out: &mut Corners) {
    let mut index = [0_i32; LANES];
    for (c, size, pairs) in [(0, &at.width, &mut out.x), (1, &at.height, &mut out.y)] {
        axis(sampler.address[c], args.coords[c].f32(), size, &mut index, &mut out.weight[c]);
        for i in 0..LANES {
            pairs[i] = pair(sampler.address[c], index[i], size[i]);
        }
    }
}

/// The left (upper) texel of each lane and the weight of its neighbour.
#[inline(always)]
fn axis(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], index: &mut [i32; LANES], weight: &mut [f32; LANES]) {
    for i in 0..LANES {
        let (texel, w) = place(mode, fold(mode, u[i]), size[i]);
        (index[i], weight[i]) = (texel, w);
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
