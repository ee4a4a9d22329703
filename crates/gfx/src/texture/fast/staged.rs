//! Texels that are not filtered, filters of which one is for magnification alone, borders, formats of numbers, comparison.
//!
//! Each number comes from the operations of the general filter in the same order, so both have the same bits; a test compares them.
//! Reading a texel is the one stage that is not vectors.

use super::{Geometry, following, integer, split};
use crate::simd::wide;
use crate::state::{AddressMode, ViewDimension};
use crate::texel::srgb_table;
use crate::texture::general::reference;
use crate::texture::sampler::{BORDER, fold};
use crate::texture::view::{Level, Texels, word_in_columns};
use crate::texture::{Lod, Sample, Sampler, View, ellipse, lod};
use num::{LANES, Lanes, Mask};

/// Four channels of all lanes.
pub(super) type Values = [[f32; LANES]; 4];

/// A place in a store that no texel has: the border.
const OUTSIDE: u32 = u32::MAX;

/// Lanes from which on stages over all of them take less time than the live ones one after another.
pub(super) const LANES_MIN: u32 = 6;

/// Samples where the view, sampler and operands allow; says whether they did.
#[inline]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) -> bool {
    let flat = matches!(view.dimension, ViewDimension::D2 | ViewDimension::D2Array);
    if !flat
        || mask.count_ones() < LANES_MIN
        || args.offset != [0; 3]
        || view.samples != 1
        || ellipse::applies(view, sampler, args)
    {
        return false;
    }
    let plain = matches!(view.levels[..], [_]) && !sampler.mag_linear && !sampler.min_linear && !bordered(sampler);
    match Stores::of(view) {
        // Textures of older programs: what only levels, layers, filters and comparisons need takes most of the time of the others.
        Some(Stores::Unorm(store)) if plain && args.layer.is_none() && args.compare.is_none() => {
            plain_wide(&view.levels[0], store, sampler, args, out);
        }
        Some(Stores::Unorm(store)) => sample_wide(view, store, sampler, args, out),
        Some(Stores::Srgb(store)) => sample_wide(view, store, sampler, args, out),
        Some(Stores::Single(store)) => sample_wide(view, store, sampler, args, out),
        Some(Stores::Float(store)) => sample_wide(view, store, sampler, args, out),
        None => return false,
    }
    true
}

/// A store of texels.
pub(super) trait Store: Copy {
    /// Whether texels are codes of 8 bits: none is -0 or NaN.
    const CODES: bool = false;

    /// The place of each lane's texel of a level.
    #[inline(always)]
    fn places(at: &Geometry, x: &[i32; LANES], y: &[i32; LANES], out: &mut [u32; LANES]) {
        for i in 0..LANES {
            out[i] = at.base[i].wrapping_add((y[i] as u32).wrapping_mul(at.stride[i])).wrapping_add(x[i] as u32);
        }
    }

    /// The texels at places of the store; anything where there is none.
    fn texels(self, places: &[u32; LANES], out: &mut Values);
}

/// The words of columns of four 8-bit channels.
#[derive(Clone, Copy)]
pub(super) struct Unorm<'a>(&'a [u32]);

/// Four 8-bit channels, three of them sRGB.
#[derive(Clone, Copy)]
pub(super) struct Srgb<'a>(&'a [u32], &'a [f32; 256]);

/// One number.
#[derive(Clone, Copy)]
pub(super) struct Single<'a>(&'a [f32]);

/// Four numbers.
#[derive(Clone, Copy)]
pub(super) struct Float<'a>(&'a [[f32; 4]]);

/// The store of a view.
pub(super) enum Stores<'a> {
    Unorm(Unorm<'a>),
    Srgb(Srgb<'a>),
    Single(Single<'a>),
    Float(Float<'a>),
}

impl<'a> Stores<'a> {
    /// That of a view; none of integers, which are not filtered.
    #[inline(always)]
    pub(super) fn of(view: &'a View) -> Option<Stores<'a>> {
        Some(match &view.texels {
            Texels::Unorm8(columns) => Stores::Unorm(Unorm(columns.as_flattened())),
            Texels::Srgb8 { codes, .. } => Stores::Srgb(Srgb(codes, srgb_table())),
            Texels::F32(texels) => Stores::Single(Single(texels)),
            Texels::F32x4(texels) => Stores::Float(Float(texels)),
            Texels::U32x4(_) => return None,
        })
    }
}

impl Store for Unorm<'_> {
    const CODES: bool = true;

    #[inline(always)]
    fn places(at: &Geometry, x: &[i32; LANES], y: &[i32; LANES], out: &mut [u32; LANES]) {
        for i in 0..LANES {
            out[i] = word_in_columns(at.base[i], at.stride[i], x[i] as u32, y[i] as u32);
        }
    }

    #[inline(always)]
    fn texels(self, places: &[u32; LANES], out: &mut Values) {
        let mut codes = [0; LANES];
        read(self.0, places, &mut codes);
        for (c, channel) in out.iter_mut().enumerate() {
            for i in 0..LANES {
                channel[i] = (codes[i] >> (8 * c) & 0xff) as i32 as f32 / 255.0;
            }
        }
    }
}

impl Store for Srgb<'_> {
    const CODES: bool = true;

    #[inline(always)]
    fn texels(self, places: &[u32; LANES], out: &mut Values) {
        let mut codes = [0; LANES];
        read(self.0, places, &mut codes);
        for i in 0..LANES {
            let [r, g, b, _] = codes[i].to_le_bytes();
            for (channel, code) in out.iter_mut().zip([r, g, b]) {
                channel[i] = self.1[usize::from(code)];
            }
        }
        for i in 0..LANES {
            out[3][i] = (codes[i] >> 24) as i32 as f32 / 255.0;
        }
    }
}

impl Store for Single<'_> {
    #[inline(always)]
    fn texels(self, places: &[u32; LANES], out: &mut Values) {
        read(self.0, places, &mut out[0]);
        (out[1], out[2], out[3]) = ([0.0; LANES], [0.0; LANES], [1.0; LANES]);
    }
}

impl Store for Float<'_> {
    #[inline(always)]
    fn texels(self, places: &[u32; LANES], out: &mut Values) {
        for i in 0..LANES {
            let texel = self.0.get(places[i] as usize).copied().unwrap_or_default();
            for (channel, value) in out.iter_mut().zip(texel) {
                channel[i] = value;
            }
        }
    }
}

/// Reads a store at each lane's place.
#[inline(always)]
fn read<T: Copy + Default>(store: &[T], places: &[u32; LANES], out: &mut [T; LANES]) {
    for i in 0..LANES {
        out[i] = store.get(places[i] as usize).copied().unwrap_or_default();
    }
}

wide! {
    fn plain_wide(level: &Level, store: Unorm<'_>, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = plain_body;
}

/// The nearest texels of the only level, without a border.
#[inline(always)]
fn plain_body(level: &Level, store: Unorm<'_>, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let mut along = [[0; LANES]; 2];
    for (axis, to) in along.iter_mut().enumerate() {
        nearest_along(sampler.address[axis], args.coords[axis].f32(), &[level.size[axis] as f32; LANES], to);
    }
    let ([x, y], mut places) = (&along, [0; LANES]);
    for i in 0..LANES {
        places[i] = word_in_columns(level.columns[0], level.stride, x[i] as u32, y[i] as u32);
    }
    store.texels(&places, bytemuck::cast_mut(out));
}

wide! {
    fn sample_wide [S: Store] (view: &View, store: S, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) = sample_body;
}

/// How the lanes of a batch filter the texels of a level.
#[derive(Clone, Copy)]
enum Filters<'a> {
    Nearest,
    Linear,
    /// Lanes by their levels of detail: the marked ones are filtered.
    Both(&'a [u32; LANES]),
}

#[inline(always)]
fn sample_body<S: Store>(view: &View, store: S, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let mut lambda = [0.0; LANES];
    // One level whose texels are filtered alike at all sizes needs no level of detail.
    if view.levels.len() > 1 || sampler.mag_linear != sampler.min_linear {
        lod::lambda(view, sampler, args, &mut lambda);
    }
    let (mut first, mut weight, mut marked) = ([0_u32; LANES], [0.0_f32; LANES], [0_u32; LANES]);
    let mut most = 0.0_f32;
    if view.levels.len() > 1 {
        for i in 0..LANES {
            (first[i], weight[i]) = split(lambda[i], view.levels.len(), sampler);
            most = if weight[i] > most { weight[i] } else { most };
        }
    }
    let filters = if sampler.mag_linear == sampler.min_linear {
        if sampler.mag_linear { Filters::Linear } else { Filters::Nearest }
    } else {
        let mut count = 0;
        for i in 0..LANES {
            marked[i] = u32::from((lambda[i] > 0.0) == sampler.min_linear);
            count += marked[i];
        }
        match count {
            0 => Filters::Nearest,
            64 => Filters::Linear,
            _ => Filters::Both(&marked),
        }
    };
    let reference: Option<[f32; LANES]> = args.compare.map(|r| r.f32().map(|r| reference(view, r)));
    let quads = matches!(args.lod, Lod::Auto);
    let value: &mut Values = bytemuck::cast_mut(out);
    let mut second = None;
    // A loop, so that the filter is compiled once for both levels.
    for level in 0..1 + usize::from(most > 0.0) {
        let to = if level == 0 {
            &mut *value
        } else {
            first.iter_mut().for_each(|level| *level = following(view, *level));
            second.insert([[0.0; LANES]; 4])
        };
        filter(store, sampler, args, &Geometry::new(view, args, &first, quads), filters, reference.as_ref(), to);
    }
    if let Some(second) = second {
        for (a, b) in value.iter_mut().zip(&second) {
            for i in 0..LANES {
                let mixed = a[i] + (b[i] - a[i]) * weight[i];
                a[i] = if weight[i] > 0.0 { mixed } else { a[i] };
            }
        }
    }
}

/// What each lane's filter makes of its level. No closure: one that is not inlined has not the instruction sets of its function.
#[inline(always)]
fn filter<S: Store>(
    store: S,
    sampler: &Sampler,
    args: &Sample<'_>,
    at: &Geometry,
    filters: Filters<'_>,
    reference: Option<&[f32; LANES]>,
    out: &mut Values,
) {
    if !matches!(filters, Filters::Linear) {
        nearest(store, sampler, args, at, reference, out);
    }
    let mut apart = None;
    let to = match filters {
        Filters::Nearest => return,
        Filters::Linear => &mut *out,
        Filters::Both(_) => apart.insert([[0.0; LANES]; 4]),
    };
    linear(store, sampler, args, at, reference, to);
    if let (Filters::Both(marked), Some(filtered)) = (filters, &apart) {
        for (out, filtered) in out.iter_mut().zip(filtered) {
            for i in 0..LANES {
                out[i] = if marked[i] != 0 { filtered[i] } else { out[i] };
            }
        }
    }
}

/// The nearest texel of each lane.
#[inline(always)]
fn nearest<S: Store>(
    store: S,
    sampler: &Sampler,
    args: &Sample<'_>,
    at: &Geometry,
    reference: Option<&[f32; LANES]>,
    out: &mut Values,
) {
    let (mut along, mut places) = ([[0; LANES]; 2], [0; LANES]);
    for ((to, size), axis) in along.iter_mut().zip([&at.width, &at.height]).zip(0..) {
        nearest_along(sampler.address[axis], args.coords[axis].f32(), size, to);
    }
    let [x, y] = &along;
    S::places(at, x, y, &mut places);
    mark_outside(sampler, x, y, &mut places);
    texels(store, sampler, &places, out);
    match reference {
        None if S::CODES && !bordered(sampler) => {}
        // A sum of one texel whose weight is 1: what it makes of -0 and NaN counts too.
        None => out.as_flattened_mut().iter_mut().for_each(|value| *value += 0.0),
        Some(reference) => {
            for i in 0..LANES {
                out[0][i] = f32::from(u8::from(sampler.compare.test(reference[i], out[0][i])));
            }
            (out[1], out[2], out[3]) = ([0.0; LANES], [0.0; LANES], [1.0; LANES]);
        }
    }
}

/// The four texels about each lane's place.
#[inline(always)]
fn linear<S: Store>(
    store: S,
    sampler: &Sampler,
    args: &Sample<'_>,
    at: &Geometry,
    reference: Option<&[f32; LANES]>,
    out: &mut Values,
) {
    let mut along = [Axis::ZERO, Axis::ZERO];
    for ((to, size), axis) in along.iter_mut().zip([&at.width, &at.height]).zip(0..) {
        linear_along(sampler.address[axis], args.coords[axis].f32(), size, to);
    }
    let [x, y] = &along;
    let mut sum = Sum::new(out, reference);
    let (mut places, mut weight) = ([0; LANES], [0.0; LANES]);
    for (right, below) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        S::places(at, &x.texel[right], &y.texel[below], &mut places);
        mark_outside(sampler, &x.texel[right], &y.texel[below], &mut places);
        for i in 0..LANES {
            let share = |axis: &Axis, second: usize| if second == 0 { 1.0 - axis.weight[i] } else { axis.weight[i] };
            weight[i] = share(x, right) * share(y, below);
        }
        sum.add(store, sampler, &places, &weight);
    }
    sum.finish();
}

/// The texels at places of a store; the border's colour outside.
#[inline(always)]
fn texels<S: Store>(store: S, sampler: &Sampler, places: &[u32; LANES], out: &mut Values) {
    store.texels(places, out);
    if bordered(sampler) {
        for (channel, border) in out.iter_mut().zip(sampler.border) {
            for i in 0..LANES {
                channel[i] = if places[i] == OUTSIDE { border } else { channel[i] };
            }
        }
    }
}

/// Puts lanes whose texel is in the border outside of the store.
#[inline(always)]
fn mark_outside(sampler: &Sampler, x: &[i32; LANES], y: &[i32; LANES], places: &mut [u32; LANES]) {
    if bordered(sampler) {
        for i in 0..LANES {
            places[i] = if x[i] == BORDER || y[i] == BORDER { OUTSIDE } else { places[i] };
        }
    }
}

#[inline(always)]
pub(super) fn bordered(sampler: &Sampler) -> bool {
    sampler.address[..2].contains(&AddressMode::ClampToBorder)
}

/// A weighted sum of texels, or of the results of comparing them.
struct Sum<'a> {
    values: &'a mut Values,
    reference: Option<&'a [f32; LANES]>,
}

impl<'a> Sum<'a> {
    #[inline(always)]
    fn new(values: &'a mut Values, reference: Option<&'a [f32; LANES]>) -> Sum<'a> {
        *values = [[0.0; LANES]; 4];
        Sum { values, reference }
    }

    #[inline(always)]
    fn add<S: Store>(&mut self, store: S, sampler: &Sampler, places: &[u32; LANES], weight: &[f32; LANES]) {
        let mut texels = [[0.0; LANES]; 4];
        self::texels(store, sampler, places, &mut texels);
        match self.reference {
            None => {
                for (sum, texel) in self.values.iter_mut().zip(&texels) {
                    for i in 0..LANES {
                        sum[i] += texel[i] * weight[i];
                    }
                }
            }
            Some(reference) => {
                for i in 0..LANES {
                    let passes = sampler.compare.test(reference[i], texels[0][i]);
                    self.values[0][i] += if passes { weight[i] } else { 0.0 };
                }
            }
        }
    }

    #[inline(always)]
    fn finish(self) {
        if self.reference.is_some() {
            self.values[3] = [1.0; LANES];
        }
    }
}

/// The two texels of each lane along an axis, and the weight of the second.
struct Axis {
    texel: [[i32; LANES]; 2],
    weight: [f32; LANES],
}

impl Axis {
    const ZERO: Axis = Axis { texel: [[0; LANES]; 2], weight: [0.0; LANES] };
}

/// [`crate::texture::sampler::nearest`] of all lanes.
#[inline(always)]
fn nearest_along(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut [i32; LANES]) {
    #[inline(always)]
    fn of(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut [i32; LANES]) {
        for i in 0..LANES {
            out[i] = wrap(mode, integer((fold(mode, u[i]) * size[i]).floor()), integer(size[i]));
        }
    }
    // One loop a mode: the compiler makes vectors of what it knows.
    match mode {
        AddressMode::ClampToEdge => of(AddressMode::ClampToEdge, u, size, out),
        AddressMode::Repeat => of(AddressMode::Repeat, u, size, out),
        AddressMode::MirrorRepeat => of(AddressMode::MirrorRepeat, u, size, out),
        AddressMode::ClampToBorder => of(AddressMode::ClampToBorder, u, size, out),
    }
}

/// [`crate::texture::sampler::linear`] of all lanes.
#[inline(always)]
fn linear_along(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut Axis) {
    #[inline(always)]
    fn of(mode: AddressMode, u: &[f32; LANES], size: &[f32; LANES], out: &mut Axis) {
        for i in 0..LANES {
            let place = fold(mode, u[i]) * size[i] - 0.5;
            let whole = place.floor();
            let (texel, n) = (integer(whole), integer(size[i]));
            (out.texel[0][i], out.texel[1][i]) = (wrap(mode, texel, n), wrap(mode, texel + 1, n));
            out.weight[i] = place - whole;
        }
    }
    match mode {
        AddressMode::ClampToEdge => of(AddressMode::ClampToEdge, u, size, out),
        AddressMode::Repeat => of(AddressMode::Repeat, u, size, out),
        AddressMode::MirrorRepeat => of(AddressMode::MirrorRepeat, u, size, out),
        AddressMode::ClampToBorder => of(AddressMode::ClampToBorder, u, size, out),
    }
}

/// [`crate::texture::sampler::wrap`] without a division, for places of a folded coordinate: from -1 to `n` (mirrored: to `2 n`) where they
/// repeat, any others.
#[inline(always)]
fn wrap(mode: AddressMode, i: i32, n: i32) -> i32 {
    match mode {
        // No `clamp`: its check of the bounds would keep the loop from becoming vectors.
        AddressMode::ClampToEdge => i.max(0).min(n - 1),
        AddressMode::Repeat => {
            let i = if i < 0 { i + n } else { i };
            if i < n { i } else { i - n }
        }
        AddressMode::MirrorRepeat => {
            let i = if i < n { i } else { 2 * n - 1 - i };
            i.max(0)
        }
        AddressMode::ClampToBorder => {
            if i >= 0 && i < n {
                i
            } else {
                BORDER
            }
        }
    }
}
