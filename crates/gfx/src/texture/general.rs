//! Sampling of any format, dimension and mode, a lane at a time.

use super::ellipse::{self, Ellipses};
use super::fast;
use super::lod::{Levels, Selection};
use super::sampler::BORDER;
use super::taps::{Taps, TexturePoint, gather_taps, taps};
use super::view::{FIXED_ONE, Level, ROWS, Texels, word_in_columns};
use super::{Sample, Sampler, View};
use crate::simd::wide;
use crate::state::AddressMode;
use crate::texel::srgb_table;
use num::{LANES, Lanes, Mask};

/// Texels that filter as four numbers.
pub(super) trait TexelSource: Copy {
    /// The place in the store of a texel of a level: column, row, and slice or layer.
    #[inline(always)]
    fn place(level: &Level, texel: [i32; 3]) -> usize {
        linear_place(level, texel)
    }

    /// The texel at a place of the store.
    fn texel(self, place: usize) -> [f32; 4];
}

/// Four 8-bit channels, in columns.
#[derive(Clone, Copy)]
struct Unorm<'a>(&'a [[u32; 4]]);

/// Four 8-bit channels, three of them sRGB.
#[derive(Clone, Copy)]
struct Srgb<'a>(&'a [u32], &'a [f32; 256]);

/// One number.
#[derive(Clone, Copy)]
struct Single<'a>(&'a [f32]);

/// Four numbers.
#[derive(Clone, Copy)]
struct Float<'a>(&'a [[f32; 4]]);

impl TexelSource for Unorm<'_> {
    #[inline(always)]
    fn place(level: &Level, [x, y, slice]: [i32; 3]) -> usize {
        let [first, per_slice] = level.columns.map(|v| v as usize);
        let (group, row) = (y as usize / ROWS as usize, y as usize % ROWS as usize);
        4 * (first + slice as usize * per_slice + group * level.stride as usize + x as usize) + row
    }

    #[inline(always)]
    fn texel(self, place: usize) -> [f32; 4] {
        self.0[place / 4][place % 4].to_le_bytes().map(|c| f32::from(c) / 255.0)
    }
}

impl TexelSource for Srgb<'_> {
    #[inline(always)]
    fn texel(self, place: usize) -> [f32; 4] {
        let [r, g, b, a] = self.0[place].to_le_bytes();
        [self.1[usize::from(r)], self.1[usize::from(g)], self.1[usize::from(b)], f32::from(a) / 255.0]
    }
}

impl TexelSource for Single<'_> {
    #[inline(always)]
    fn texel(self, place: usize) -> [f32; 4] {
        [self.0[place], 0.0, 0.0, 1.0]
    }
}

impl TexelSource for Float<'_> {
    #[inline(always)]
    fn texel(self, place: usize) -> [f32; 4] {
        self.0[place]
    }
}

/// Lanes of a mask.
#[inline(always)]
pub(super) fn lanes_of(mut mask: Mask) -> impl Iterator<Item = usize> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let lane = mask.trailing_zeros() as usize;
            mask &= mask - 1;
            lane
        })
    })
}

/// The place of a texel where they lie row by row.
#[inline(always)]
fn linear_place(level: &Level, [x, y, slice]: [i32; 3]) -> usize {
    level.offset as usize + slice as usize * level.slice as usize + y as usize * level.stride as usize + x as usize
}

/// Samples the lanes of a mask; integer texels, which do not filter, give zeros.
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) {
    if is_fixed(view, sampler, args) {
        return sample_fixed(view, sampler, args, mask, out);
    }
    match &view.texels {
        Texels::Unorm8(columns) => sample_from(view, Unorm(columns), sampler, args, mask, out),
        Texels::Srgb8 { codes, .. } => sample_from(view, Srgb(codes, srgb_table()), sampler, args, mask, out),
        Texels::F32(texels) => sample_from(view, Single(texels), sampler, args, mask, out),
        Texels::F32x4(texels) => sample_from(view, Float(texels), sampler, args, mask, out),
        Texels::U32x4(_) => *out = [Lanes::ZERO; 4],
    }
}

fn sample_from<S: TexelSource>(view: &View, source: S, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) {
    if ellipse::applies(view, sampler, args) {
        return average(view, source, sampler, args, mask, out);
    }
    let selection = Selection::new(view, sampler, args);
    for lane in lanes_of(mask) {
        let levels = Levels::new(selection.lambda[lane], view.levels.len(), sampler);
        let place = TexturePoint::new(view, args, lane);
        let reference = args.compare.map(|r| reference(view, r.f32()[lane]));
        let one = |level: usize, place: TexturePoint| {
            let taps = taps(view, sampler, level, levels.linear, place, args.offset);
            filter(view, source, sampler, level, &taps, reference)
        };
        let probe = |place: TexturePoint| {
            let a = one(levels.first, place);
            if levels.weight > 0.0 { mix(a, one(levels.second, place), levels.weight) } else { a }
        };
        let count = selection.probes[lane];
        let value = if count == 1 {
            probe(place)
        } else {
            let mut sum = [0.0_f32; 4];
            for step in 1..=count {
                let t = f32::from(step) / f32::from(count + 1) - 0.5;
                let mut at = place;
                at.coords[0] += selection.major[0][lane] * t;
                at.coords[1] += selection.major[1][lane] * t;
                let value = probe(at);
                for c in 0..4 {
                    sum[c] += value[c];
                }
            }
            sum.map(|s| s / f32::from(count))
        };
        for c in 0..4 {
            out[c].f32_mut()[lane] = value[c];
        }
    }
}

/// Whether a sample is filtered in 16-bit fixed point: four 8-bit channels of a flat texture, all texels filtered, no border.
///
/// A channel is an 8-bit code times 128 (an sRGB code's linear value, as exactly), so that 32640 is 1 and differences fit 16 bits; weights have
/// 15 bits; a product is rounded to nearest. A trilinear result is within a fiftieth of an 8-bit step of the exact one, and exact where all
/// texels are equal.
pub(super) fn is_fixed(view: &View, sampler: &Sampler, args: &Sample<'_>) -> bool {
    let codes = matches!(view.texels, Texels::Unorm8(_) | Texels::Srgb8 { .. });
    codes && fast::is_flat(view, sampler) && args.offset == [0; 3] && args.compare.is_none()
}

fn sample_fixed(view: &View, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) {
    let selection = Selection::new(view, sampler, args);
    let address = [sampler.address[0], sampler.address[1]];
    for lane in lanes_of(mask) {
        let levels = Levels::new(selection.lambda[lane], view.levels.len(), sampler);
        let TexturePoint { coords: [u, v, _], slice } = TexturePoint::new(view, args, lane);
        let at = [fast::fold(address[0], u), fast::fold(address[1], v)];
        let mut value = bilinear(view, address, at, levels.first, slice);
        if levels.weight > 0.0 {
            value = fixed_mix(value, bilinear(view, address, at, levels.second, slice), fixed_weight(levels.weight));
        }
        for (channel, value) in out.iter_mut().zip(value) {
            channel.f32_mut()[lane] = f32::from(value) * (1.0 / FIXED_ONE);
        }
    }
}

/// A weight in [0, 1) in 15 bits, to nearest.
#[inline(always)]
pub(super) fn fixed_weight(weight: f32) -> u32 {
    (weight * 32767.0 + 8_388_608.0).to_bits() & 0x7fff
}

/// `a + (b - a) * weight`, the product rounded to nearest.
#[inline(always)]
pub(super) fn fixed_mix(a: [i16; 4], b: [i16; 4], weight: u32) -> [i16; 4] {
    std::array::from_fn(|c| {
        let difference = i32::from(b[c].wrapping_sub(a[c]));
        let product = (((difference * weight as i32) >> 14) + 1) >> 1;
        a[c].wrapping_add(product as i16)
    })
}

/// The bilinear value of four 8-bit channels at a folded place of a level.
fn bilinear(view: &View, address: [AddressMode; 2], folded: [f32; 2], level: usize, slice: u32) -> [i16; 4] {
    let level = &view.levels[level];
    let (x, x_weight) = fast::place(address[0], folded[0], level.size[0] as f32);
    let (y, y_weight) = fast::place(address[1], folded[1], level.size[1] as f32);
    // Rows end with their first texel again; where the last one is clamped to, its right neighbour has no weight.
    let [base, per_slice] = view.texels.geometry(level);
    let at = |row: i32| (base + slice * per_slice + x as u32 + row as u32 * level.stride) as usize;
    let [a, b, c, d] = match &view.texels {
        Texels::Unorm8(columns) => {
            let (group, row) = (at(y / ROWS as i32), (y % ROWS as i32) as usize);
            let (left, right) = (columns[group], columns[group + 1]);
            let spread = |code: u32| code.to_le_bytes().map(|c| i16::from(c) << 7);
            [left[row], right[row], left[row + 1], right[row + 1]].map(spread)
        }
        Texels::Srgb8 { linear, .. } => {
            let below = if y + 1 < level.size[1] as i32 {
                y + 1
            } else if address[1] == AddressMode::Repeat {
                0
            } else {
                y
            };
            // Red, blue, green, alpha from the low end.
            let of = |t: u64| [t as i16, (t >> 32) as i16, (t >> 16) as i16, (t >> 48) as i16];
            let (upper, lower) = (at(y), at(below));
            [linear[upper], linear[upper + 1], linear[lower], linear[lower + 1]].map(of)
        }
        _ => [[0; 4]; 4],
    };
    let (x_weight, y_weight) = (fixed_weight(x_weight), fixed_weight(y_weight));
    fixed_mix(fixed_mix(a, b, x_weight), fixed_mix(c, d, x_weight), y_weight)
}

wide! {
    /// Samples by elliptical weighted averages.
    fn average [S: TexelSource] (view: &View, source: S, sampler: &Sampler, args: &Sample<'_>, mask: Mask, out: &mut [Lanes; 4]) = average_body;
}

#[inline(always)]
fn average_body<S: TexelSource>(
    view: &View,
    source: S,
    sampler: &Sampler,
    args: &Sample<'_>,
    mask: Mask,
    out: &mut [Lanes; 4],
) {
    let mut ellipses = Ellipses::new(view, sampler, args);
    for lane in lanes_of(mask) {
        let footprint = ellipses.of(lane);
        let level = &view.levels[footprint.level];
        let reference = args.compare.map(|r| reference(view, r.f32()[lane]));
        let (mut sum, mut total) = ([0.0_f32; 4], 0.0);
        footprint.texels(view, sampler, TexturePoint::new(view, args, lane), args.offset, |texel, weight| {
            let value = if texel.contains(&BORDER) { sampler.border } else { source.texel(S::place(level, texel)) };
            total += weight;
            match reference {
                None => {
                    for c in 0..4 {
                        sum[c] += value[c] * weight;
                    }
                }
                Some(r) => sum[0] += if sampler.compare.test(r, value[0]) { weight } else { 0.0 },
            }
        });
        let value = sum.map(|s| s / total);
        let value = if reference.is_some() { [value[0], 0.0, 0.0, 1.0] } else { value };
        for c in 0..4 {
            out[c].f32_mut()[lane] = value[c];
        }
    }
}

/// A comparison's reference value, clamped where the stored depths are fixed-point.
#[inline(always)]
pub(super) fn reference(view: &View, reference: f32) -> f32 {
    if view.fixed_depth { reference.clamp(0.0, 1.0) } else { reference }
}

#[inline(always)]
fn mix(a: [f32; 4], b: [f32; 4], weight: f32) -> [f32; 4] {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * weight)
}

/// The weighted mean of texels, or of the results of comparing them.
#[inline(always)]
fn filter<S: TexelSource>(
    view: &View,
    source: S,
    sampler: &Sampler,
    level: usize,
    taps: &Taps,
    reference: Option<f32>,
) -> [f32; 4] {
    let mut sum = [0.0_f32; 4];
    for i in 0..taps.count {
        let texel = taps.texel[i];
        let value = if texel[0] == BORDER { sampler.border } else { source.texel(S::place(&view.levels[level], texel)) };
        match reference {
            None => {
                for c in 0..4 {
                    sum[c] += value[c] * taps.weight[i];
                }
            }
            Some(r) => sum[0] += if sampler.compare.test(r, value[0]) { taps.weight[i] } else { 0.0 },
        }
    }
    if reference.is_some() { [sum[0], 0.0, 0.0, 1.0] } else { sum }
}

/// The bits of a texel of a level as a shader sees it.
#[inline(always)]
pub(super) fn bits(view: &View, level: usize, texel: [i32; 3]) -> [u32; 4] {
    fn of<S: TexelSource>(source: S, level: &Level, texel: [i32; 3]) -> [u32; 4] {
        source.texel(S::place(level, texel)).map(f32::to_bits)
    }
    let level = &view.levels[level];
    match &view.texels {
        Texels::Unorm8(columns) => of(Unorm(columns), level, texel),
        Texels::Srgb8 { codes, .. } => of(Srgb(codes, srgb_table()), level, texel),
        Texels::F32(texels) => of(Single(texels), level, texel),
        Texels::F32x4(texels) => texels[linear_place(level, texel)].map(f32::to_bits),
        Texels::U32x4(texels) => texels[linear_place(level, texel)],
    }
}

/// Gathers one component of the four texels that a bilinear filter would read at the first level.
pub(super) fn gather(view: &View, sampler: &Sampler, args: &Sample<'_>, component: u32, mask: Mask, out: &mut [Lanes; 4]) {
    for lane in lanes_of(mask) {
        let place = TexturePoint::new(view, args, lane);
        let texels = gather_taps(view, sampler, place, args.offset);
        for (i, texel) in texels.into_iter().enumerate() {
            let value = if texel[0] == BORDER { sampler.border.map(f32::to_bits) } else { bits(view, 0, texel) };
            out[i].0[lane] = match args.compare {
                None => value[component as usize & 3],
                Some(r) => {
                    let pass = sampler.compare.test(reference(view, r.f32()[lane]), f32::from_bits(value[0]));
                    f32::from(u8::from(pass)).to_bits()
                }
            };
        }
    }
}

/// Loads texels by integer coordinates; zeros where there is none.
pub(super) fn load(view: &View, coords: [&Lanes; 3], layer: Option<&Lanes>, level: &Lanes, mask: Mask, out: &mut [Lanes; 4]) {
    if let Texels::Unorm8(columns) = &view.texels
        && layer.is_none()
        && load_flat(view, columns.as_flattened(), coords, level, mask, out)
    {
        return;
    }
    for lane in lanes_of(mask) {
        let value = match locate(view, coords, layer, level, lane) {
            Some((level, texel, sample)) => {
                let [x, y, slice] = texel;
                bits(view, level, [x * view.samples as i32 + sample, y, slice])
            }
            None => [0; 4],
        };
        for c in 0..4 {
            out[c].0[lane] = value[c];
        }
    }
}

wide! {
    /// [`load`] of four 8-bit channels from one level of a flat view, as programs that read the frame buffer do. False, and nothing is loaded,
    /// where that is not what is asked for or a texel does not exist.
    fn load_flat(view: &View, words: &[u32], coords: [&Lanes; 3], level: &Lanes, mask: Mask, out: &mut [Lanes; 4]) -> bool = load_flat_body;
}

#[inline(always)]
fn load_flat_body(view: &View, words: &[u32], [x, y, _]: [&Lanes; 3], level: &Lanes, mask: Mask, out: &mut [Lanes; 4]) -> bool {
    let first = level.0[mask.trailing_zeros() as usize % LANES];
    let Some(geometry) = view.levels.get(first as usize) else { return false };
    // Rows are divided by three in 16 bits.
    if view.samples != 1 || view.dimension != crate::state::ViewDimension::D2 || geometry.size[1] > 1 << 16 {
        return false;
    }
    let [width, height, _] = geometry.size;
    let mut present = [0; LANES];
    let mut missing = 0;
    for i in 0..LANES {
        present[i] = ((mask >> i) as u32 & 1).wrapping_neg();
        let exists = (x.0[i] < width) & (y.0[i] < height) & (level.0[i] == first);
        missing |= u32::from(!exists).wrapping_neg() & present[i];
    }
    if missing != 0 {
        return false;
    }
    let mut codes = [0; LANES];
    for i in 0..LANES {
        let (x, y) = (x.0[i] & present[i], y.0[i] & present[i]);
        codes[i] = word_in_columns(geometry.columns[0], geometry.stride, x, y);
    }
    for code in &mut codes {
        *code = words.get(*code as usize).copied().unwrap_or_default();
    }
    for (c, out) in out.iter_mut().enumerate() {
        for i in 0..LANES {
            out.0[i] = ((codes[i] >> (8 * c) & 255) as i32 as f32 / 255.0).to_bits() & present[i];
        }
    }
    true
}

/// The level, texel and sample that a load names, if they exist.
#[inline(always)]
pub(super) fn locate(
    view: &View,
    coords: [&Lanes; 3],
    layer: Option<&Lanes>,
    level: &Lanes,
    lane: usize,
) -> Option<(usize, [i32; 3], i32)> {
    use crate::state::ViewDimension::{D1, D3};
    let (l, sample) = if view.samples == 1 { (level.0[lane] as usize, 0) } else { (0, level.0[lane]) };
    if sample >= view.samples {
        return None;
    }
    let [w, h, d] = view.levels.get(l)?.size;
    let x = coords[0].0[lane];
    let y = if view.dimension == D1 { 0 } else { coords[1].0[lane] };
    let z = match (view.dimension, layer) {
        (D3, _) => coords[2].0[lane],
        (_, Some(layer)) => layer.0[lane],
        (_, None) => 0,
    };
    (x < w && y < h && z < d).then_some((l, [x as i32, y as i32, z as i32], sample as i32))
}
