//! Bilinear and trilinear filtering of four 8-bit channels in 16-bit fixed point, eight lanes at a time, with the bits of
//! [`crate::texture::general`].
//!
//! Plain loops, in which every stage goes through memory, took more than twice the time.

use fearless_simd::{f32x4, f32x8, i32x8, prelude::*, u16x16, u32x4, u32x8, u64x2};

use super::{Geometry, QuadLevels, choose, following};
use crate::simd::{Simd, dispatch, inlined, least, most};
use crate::state::AddressMode;
use crate::texture::lod::BIAS;
use crate::texture::view::{FIXED_ONE, Level, Texels};
use crate::texture::{Lod, Sample, Sampler, View};
use num::{LANES, Lanes, QUADS};

/// Vectors of a batch.
const CHUNKS: usize = LANES / 8;

/// Where the lanes read, in the first and in the second level.
enum Places<'a> {
    /// All in the same levels, of which there is one layer.
    Same([&'a Level; 2]),
    /// Each quad in levels of its own, of which there is one layer: the first of each.
    Quads([u32; QUADS]),
    /// Each lane for itself.
    Each(&'a [Geometry; 2]),
}

/// What is read, and how levels are weighted.
struct Plan<'a> {
    places: Places<'a>,
    /// Weight of the second level: of each quad, or lane by lane.
    weight: &'a [f32; LANES],
    by_quad: bool,
    /// Whether any lane reads a second level.
    blend: bool,
}

/// Samples a flat view of four 8-bit channels with a linear filter.
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, found: &mut Option<QuadLevels>, out: &mut [Lanes; 4]) {
    dispatch!(simd => sample_here(simd, view, sampler, args, found, out));
}

#[inline(always)]
fn sample_here<V: Simd>(
    simd: V,
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    found: &mut Option<QuadLevels>,
    out: &mut [Lanes; 4],
) {
    let (mut rho, mut each, mut weight);
    let plan = if let Some(plan) = sole_level(view, args) {
        plan
    } else {
        (rho, each, weight) = ([0.0; QUADS], None, [0.0; LANES]);
        let bias = quad_bias(view, args);
        if bias.is_some() {
            quad_rho(simd, view, args, &mut rho);
        }
        plan(view, sampler, args, &rho, bias.as_ref(), found, &mut each, &mut weight)
    };
    let address = [sampler.address[0], sampler.address[1]];
    let input = Input { view, coords: [args.coords[0].f32(), args.coords[1].f32()], plan: &plan };
    match (&view.texels, &plan.places) {
        (Texels::Unorm8(columns), places) => {
            let words = columns.as_flattened();
            match (places, address) {
                // Most textures repeat: no choice is left in the loop.
                (Places::Same(levels), [AddressMode::Repeat, _]) if levels.iter().all(|level| level.size[1] == 1) => {
                    filter::<_, false, ROW>(simd, &input, words, REPEATS, out);
                }
                (Places::Same(_), REPEATS) => filter::<_, false, SAME>(simd, &input, words, REPEATS, out),
                (Places::Quads(_), REPEATS) => filter::<_, false, QUAD>(simd, &input, words, REPEATS, out),
                (Places::Same(_), _) => filter::<_, false, SAME>(simd, &input, words, address, out),
                (Places::Quads(_), _) => filter::<_, false, QUAD>(simd, &input, words, address, out),
                (Places::Each(_), _) => filter::<_, false, LANE>(simd, &input, words, address, out),
            }
        }
        (Texels::Srgb8 { linear, .. }, places) => {
            let words = bytemuck::cast_slice(linear);
            match places {
                Places::Same(_) => filter::<_, true, SAME>(simd, &input, words, address, out),
                Places::Quads(_) => filter::<_, true, QUAD>(simd, &input, words, address, out),
                Places::Each(_) => filter::<_, true, LANE>(simd, &input, words, address, out),
            }
        }
        _ => {}
    }
}

/// What is added to the level of detail that the footprint of a quad has.
enum Bias {
    /// Nothing.
    None,
    /// A number for each quad.
    Quads([f32; QUADS]),
}

/// What [`plan`] adds to the levels of detail of footprints; none: it does not look at the footprints of quads, or the pixels of a quad differ.
#[inline(always)]
fn quad_bias(view: &View, args: &Sample<'_>) -> Option<Bias> {
    match args.lod {
        _ if view.levels.len() == 1 => None,
        Lod::Auto => Some(Bias::None),
        Lod::Bias(bias) => {
            let mut different = 0;
            for i in 0..LANES {
                different |= bias.0[i] ^ bias.0[i & !3];
            }
            let of_quad = |q: usize| bias.f32()[4 * q].clamp(BIAS.0, BIAS.1);
            (different == 0).then(|| Bias::Quads(std::array::from_fn(of_quad)))
        }
        _ => None,
    }
}

/// The plan where there is one level and one layer: nothing is looked for.
#[inline(always)]
fn sole_level<'a>(view: &'a View, args: &Sample<'_>) -> Option<Plan<'a>> {
    const ZEROS: &[f32; LANES] = &[0.0; LANES];
    let [level] = &view.levels[..] else { return None };
    args.layer.is_none().then_some(Plan { places: Places::Same([level; 2]), weight: ZEROS, by_quad: true, blend: false })
}

/// Finds levels and weights where there are several levels or layers; `rho` is [`quad_rho`] where there is a [`quad_bias`]. `found` receives
/// those of quads without one, `each` the geometry of lanes, `weight`, which is zeros, weights: they would be copied in what is returned.
#[inline(always)]
fn plan<'a>(
    view: &'a View,
    sampler: &Sampler,
    args: &Sample<'_>,
    rho: &[f32; QUADS],
    bias: Option<&Bias>,
    found: &mut Option<QuadLevels>,
    each: &'a mut Option<[Geometry; 2]>,
    weight: &'a mut [f32; LANES],
) -> Plan<'a> {
    let (mut places, mut by_quad, mut blend) = (Places::Same([&view.levels[0]; 2]), true, false);
    let mut first = [0_u32; LANES];
    if let Some(bias) = bias {
        // A quad has one level of detail.
        let mut biased = QuadLevels::default();
        let levels = match bias {
            Bias::None => {
                let found = found.insert(biased);
                if args.layer.is_none() && sampler.lod_min <= 0.0 && enlarged(rho) {
                    return Plan { places, weight, by_quad, blend };
                }
                found.find(view, sampler, rho);
                found
            }
            Bias::Quads(bias) => {
                biased.find_biased(view, sampler, rho, bias);
                &mut biased
            }
        };
        let QuadLevels { first: level, weight: of_quads } = &*levels;
        weight[..QUADS].copy_from_slice(of_quads);
        let (mut most, mut different) = (0.0_f32, 0);
        for q in 0..QUADS {
            different |= level[q] ^ level[0];
            most = if of_quads[q] > most { of_quads[q] } else { most };
        }
        blend = most > 0.0;
        if args.layer.is_none() {
            let second = following(view, level[0]);
            places = match different {
                0 => Places::Same([&view.levels[level[0] as usize], &view.levels[second as usize]]),
                _ => Places::Quads(*level),
            };
            return Plan { places, weight, by_quad, blend };
        }
        for i in 0..LANES {
            first[i] = level[i / 4];
        }
    } else if view.levels.len() > 1 {
        by_quad = false;
        blend = choose(view, sampler, args, &mut first, weight);
    }
    let mut second = first;
    for level in &mut second {
        *level = following(view, *level);
    }
    let geometry = |level: &[u32; LANES]| Geometry::new(view, args, level, by_quad);
    places = Places::Each(each.insert([geometry(&first), geometry(&second)]));
    Plan { places, weight, by_quad, blend }
}

/// Whether a texture is enlarged in all quads: their levels of detail are below 0 by more than a logarithm can be off, and all of them read the
/// first level alone, as [`QuadLevels::find`] would say. None is where one has no number.
#[inline(always)]
fn enlarged(rho: &[f32; QUADS]) -> bool {
    rho.iter().fold(true, |all, &rho| all & (rho < 0.98))
}

/// The address mode of most textures.
const REPEATS: [AddressMode; 2] = [AddressMode::Repeat; 2];

/// Whose levels a filter looks for: those of all lanes, of each quad, of each lane ([`Places`]).
const SAME: u8 = 0;
const QUAD: u8 = 1;
const LANE: u8 = 2;
/// As [`SAME`], and those levels are a row of texels, as one-dimensional textures are: what a filter finds below is the row again.
const ROW: u8 = 3;

/// [`crate::texture::lod::quad_rho`].
#[inline(always)]
fn quad_rho<V: Simd>(simd: V, view: &View, args: &Sample<'_>, out: &mut [f32; QUADS]) {
    let size = view.levels[0].size;
    let differences = inlined(
        #[inline(always)]
        |(c, group): (usize, usize)| -> [f32x4<V>; 2] {
            let [first, right, down, _] =
                f32x4::load_four_interleaved(simd, &args.coords[c].f32()[16 * group..16 * group + 16]);
            let size = size[c] as f32;
            [(right - first) * size, (down - first) * size]
        },
    );
    for (group, out) in out.as_chunks_mut::<4>().0.iter_mut().enumerate() {
        let ([ux, uy], [vx, vy]) = (differences((0, group)), differences((1, group)));
        *out = most(ux * ux + vx * vx, uy * uy + vy * vy).into();
    }
}

/// The operands of a filter.
struct Input<'a> {
    view: &'a View,
    coords: [&'a [f32; LANES]; 2],
    plan: &'a Plan<'a>,
}

/// A texel per lane: red and blue, green and alpha, 16 bits each.
#[derive(Clone, Copy)]
struct Values<V: Simd> {
    rb: u16x16<V>,
    ga: u16x16<V>,
}

/// The geometry of each lane's level.
#[derive(Clone, Copy)]
struct Flat<V: Simd> {
    width: f32x8<V>,
    height: f32x8<V>,
    stride: u32x8<V>,
    base: u32x8<V>,
}

impl<V: Simd> Flat<V> {
    /// That of two quads' levels.
    #[inline(always)]
    fn two(simd: V, first: &Level, second: &Level) -> Flat<V> {
        let of = inlined(
            #[inline(always)]
            |i: usize| -> u32x8<V> { u32x4::splat(simd, first.flat[i]).combine(u32x4::splat(simd, second.flat[i])) },
        );
        Flat { width: f32x8::from_bits(of(0)), height: f32x8::from_bits(of(1)), stride: of(2), base: of(3) }
    }

    /// That of each lane of a chunk.
    #[inline(always)]
    fn load(simd: V, level: &Geometry, chunk: usize) -> Flat<V> {
        Flat {
            width: floats(simd, &level.width, chunk),
            height: floats(simd, &level.height, chunk),
            stride: u32x8::simd_from(simd, level.stride.as_chunks().0[chunk]),
            base: u32x8::simd_from(simd, level.base.as_chunks().0[chunk]),
        }
    }
}

#[inline(always)]
fn floats<V: Simd>(simd: V, lanes: &[f32; LANES], chunk: usize) -> f32x8<V> {
    f32x8::simd_from(simd, lanes.as_chunks().0[chunk])
}

/// Not inlined: there is one for each kind of texels and levels.
#[inline(never)]
fn filter<V: Simd, const SRGB: bool, const OF: u8>(
    simd: V,
    input: &Input<'_>,
    words: &[u32],
    address: [AddressMode; 2],
    out: &mut [Lanes; 4],
) {
    simd.vectorize(
        #[inline(always)]
        || filter_here::<V, SRGB, OF>(simd, input, words, address, out),
    );
}

#[inline(always)]
fn filter_here<V: Simd, const SRGB: bool, const OF: u8>(
    simd: V,
    &Input { view, coords, plan }: &Input<'_>,
    words: &[u32],
    address: [AddressMode; 2],
    out: &mut [Lanes; 4],
) {
    let same = match &plan.places {
        Places::Same([first, second]) if OF == SAME || OF == ROW => {
            [Flat::two(simd, first, first), Flat::two(simd, second, second)]
        }
        _ => [Flat::two(simd, &view.levels[0], &view.levels[0]); 2],
    };
    let spot = inlined(
        #[inline(always)]
        |(level, chunk): (usize, usize)| -> Spot<V> {
            let flat = match &plan.places {
                Places::Quads(first) if OF == QUAD => {
                    let [a, b] = [first[2 * chunk], first[2 * chunk + 1]];
                    let [a, b] = if level == 0 { [a, b] } else { [following(view, a), following(view, b)] };
                    Flat::two(simd, &view.levels[a as usize], &view.levels[b as usize])
                }
                Places::Each(levels) if OF == LANE => Flat::load(simd, &levels[level], chunk),
                _ => same[level],
            };
            let x = fold(address[0], floats(simd, coords[0], chunk));
            if OF == ROW {
                return locate_in_row(address[0], x, &flat);
            }
            locate::<V, SRGB>(address, [x, fold(address[1], floats(simd, coords[1], chunk))], &flat)
        },
    );
    let value_at = inlined(
        #[inline(always)]
        |spot: Spot<V>| if OF == ROW { linear(simd, words, &spot) } else { bilinear::<V, SRGB>(simd, words, &spot) },
    );
    // The places of the next vector are found before what is at those of this one is read: each is a long chain of operations.
    let mut next = spot((0, 0));
    for chunk in 0..CHUNKS {
        let here = next;
        next = spot((0, (chunk + 1).min(CHUNKS - 1)));
        let mut value = value_at(here);
        // Two quads that are enlarged, or in the last level, read no second one.
        let weights = [plan.weight[2 * chunk], plan.weight[2 * chunk + 1]];
        if plan.blend && (!plan.by_quad || weights != [0.0; 2]) {
            let second = value_at(spot((1, chunk)));
            let weight = if plan.by_quad {
                f32x4::splat(simd, weights[0]).combine(f32x4::splat(simd, weights[1]))
            } else {
                floats(simd, plan.weight, chunk)
            };
            value = mix(value, second, fixed(weight));
        }
        let [rb, ga]: [u32x8<V>; 2] = [value.rb.bitcast(), value.ga.bitcast()];
        for (channel, half) in out.iter_mut().zip([rb & 0xffff, ga & 0xffff, rb >> 16, ga >> 16]) {
            let number = half.bitcast::<i32x8<V>>().to_float::<f32x8<V>>() * (1.0 / FIXED_ONE);
            channel.f32_mut().as_chunks_mut::<8>().0[chunk] = number.into();
        }
    }
}

/// [`super::fold`].
#[inline(always)]
fn fold<V: Simd>(mode: AddressMode, u: f32x8<V>) -> f32x8<V> {
    let zero = f32x8::splat(u.simd, 0.0);
    match mode {
        AddressMode::Repeat => most(u - u.floor(), zero),
        AddressMode::MirrorRepeat => {
            let two = f32x8::splat(u.simd, 2.0);
            let f = most(u - two * (u * 0.5).floor(), zero);
            least(f, two - f)
        }
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => u,
    }
}

/// [`super::place`], with the weight in fixed point.
#[inline(always)]
fn place<V: Simd>(mode: AddressMode, folded: f32x8<V>, size: f32x8<V>) -> (u32x8<V>, u16x16<V>) {
    let last = size - 1.0;
    let place = folded * size - 0.5;
    let zero = f32x8::splat(size.simd, 0.0);
    let place = if mode == AddressMode::Repeat { place } else { least(most(place, zero), last) };
    let whole = place.floor();
    let weight = fixed(place - whole);
    // Only a repeating place can be left of the first texel.
    let texel = if mode == AddressMode::Repeat { whole.simd_lt(zero).select(last, whole) } else { whole };
    (texel.to_int::<i32x8<V>>().bitcast(), weight)
}

/// [`crate::texture::general::fixed_weight`], in both halves of a word.
#[inline(always)]
fn fixed<V: Simd>(weight: f32x8<V>) -> u16x16<V> {
    let bits = (weight * 32767.0 + 8_388_608.0).to_bits();
    (bits & 0xffff | bits << 16).bitcast()
}

/// Where eight lanes read, and how what is there is weighted.
#[derive(Clone, Copy)]
struct Spot<V: Simd> {
    /// First words of what each lane reads; in sRGB in the upper row, then in the lower one.
    words: [[u32; 8]; 2],
    /// Weights of what is right and of what is below, in both halves of a word.
    weights: [u16x16<V>; 2],
}

/// [`locate`] in columns of a level that is a row of texels.
#[inline(always)]
fn locate_in_row<V: Simd>(address: AddressMode, at: f32x8<V>, level: &Flat<V>) -> Spot<V> {
    let (x, x_weight) = place(address, at, level.width);
    Spot { words: [((level.base + x) << 2).into(), [0; 8]], weights: [x_weight; 2] }
}

/// Finds where lanes read.
#[inline(always)]
fn locate<V: Simd, const SRGB: bool>(address: [AddressMode; 2], at: [f32x8<V>; 2], level: &Flat<V>) -> Spot<V> {
    let (x, x_weight) = place(address[0], at[0], level.width);
    let (y, y_weight) = place(address[1], at[1], level.height);
    let left = level.base + x;
    let weights = [x_weight, y_weight];
    if SRGB {
        let next = y + 1;
        let is_row = next.simd_lt(level.height.to_int::<i32x8<V>>().bitcast::<u32x8<V>>());
        let beyond = if address[1] == AddressMode::Repeat { u32x8::splat(y.simd, 0) } else { y };
        let below = is_row.select(next, beyond);
        // Texels of two words, two of them side by side.
        let (upper, lower) = ((left + y * level.stride) << 1, (left + below * level.stride) << 1);
        return Spot { words: [upper.into(), lower.into()], weights };
    }
    // y / 3 of a number of 16 bits: the product is exact.
    let group = (y * 43_691) >> 17;
    let row = y - (group + (group + group));
    let column = left + group * level.stride;
    Spot { words: [((column << 2) + row).into(), [0; 8]], weights }
}

/// The weighted mean of four texels.
#[inline(always)]
fn bilinear<V: Simd, const SRGB: bool>(simd: V, words: &[u32], spot: &Spot<V>) -> Values<V> {
    let [x_weight, y_weight] = spot.weights;
    let (upper, lower) = if SRGB {
        let [upper, lower] = [pairs(simd, words, &spot.words[0]), pairs(simd, words, &spot.words[1])];
        (mix(upper[0], upper[1], x_weight), mix(lower[0], lower[1], x_weight))
    } else {
        let [left, below_left, right, below_right] = corners(simd, words, &spot.words[0]);
        (mix(spread(left), spread(right), x_weight), mix(spread(below_left), spread(below_right), x_weight))
    };
    mix(upper, lower, y_weight)
}

/// [`bilinear`] in a row of texels, with the same bits: there both rows are this one.
#[inline(always)]
fn linear<V: Simd>(simd: V, words: &[u32], spot: &Spot<V>) -> Values<V> {
    let [left, _, right, _] = corners(simd, words, &spot.words[0]);
    mix(spread(left), spread(right), spot.weights[0])
}

/// Four 8-bit channels as 16-bit values.
#[inline(always)]
fn spread<V: Simd>(codes: u32x8<V>) -> Values<V> {
    Values { rb: (codes << 7 & 0x7f80_7f80).bitcast(), ga: (codes >> 1 & 0x7f80_7f80).bitcast() }
}

/// [`crate::texture::general::fixed_mix`].
#[inline(always)]
fn mix<V: Simd>(a: Values<V>, b: Values<V>, weight: u16x16<V>) -> Values<V> {
    Values { rb: mix_half(a.rb, b.rb, weight), ga: mix_half(a.ga, b.ga, weight) }
}

#[inline(always)]
fn mix_half<V: Simd>(a: u16x16<V>, b: u16x16<V>, weight: u16x16<V>) -> u16x16<V> {
    // The difference and 2^15, so that it is not negative, times twice the weight: 2^16 times the product and the weight.
    let (difference, twice) = (b - (a ^ 0x8000), weight + weight);
    let upper = upper_product(difference, twice);
    let rounding = (difference * twice) >> 15;
    (a - weight) + (upper + rounding)
}

/// The upper halves of products. There is no such operation on vectors; of this loop the compiler makes the instruction.
#[inline(always)]
fn upper_product<V: Simd>(a: u16x16<V>, b: u16x16<V>) -> u16x16<V> {
    let (x, y): ([u16; 16], [u16; 16]) = (a.into(), b.into());
    let mut out = [0; 16];
    for i in 0..16 {
        out[i] = (u32::from(x[i]) * u32::from(y[i]) >> 16) as u16;
    }
    u16x16::simd_from(a.simd, out)
}

/// `N` words from a place on. All of them exist: each row has one texel more than its level, and the store one column more.
#[inline(always)]
fn from<const N: usize>(words: &[u32], place: u32) -> &[u32; N] {
    words[place as usize..][..N].first_chunk().expect("as many were taken")
}

/// The first word at each of four places, and the second.
#[inline(always)]
fn first_two<V: Simd>(rows: [u32x4<V>; 4]) -> [u32x4<V>; 2] {
    let [a, b, c, d] = rows;
    let (ab, cd): (u64x2<V>, u64x2<V>) = (a.zip_low(b).bitcast(), c.zip_low(d).bitcast());
    [ab.zip_low(cd).bitcast(), ab.zip_high(cd).bitcast()]
}

/// The four texels of a filter in columns, of all lanes: the upper left, lower left, upper right, lower right.
#[inline(always)]
fn corners<V: Simd>(simd: V, words: &[u32], places: &[u32; 8]) -> [u32x8<V>; 4] {
    let half = inlined(
        #[inline(always)]
        |first: usize| -> [u32x4<V>; 4] {
            let row = inlined(
                #[inline(always)]
                |i: usize| {
                    let [a, b, c, d, e, f, g, h] = *from(words, places[first + i]);
                    (u32x4::simd_from(simd, [a, b, c, d]), u32x4::simd_from(simd, [e, f, g, h]))
                },
            );
            let ((a, e), (b, f), (c, g), (d, h)) = (row(0), row(1), row(2), row(3));
            let ([upper, lower], [upper_behind, lower_behind]) = (first_two([a, b, c, d]), first_two([e, f, g, h]));
            [upper, lower, upper_behind, lower_behind]
        },
    );
    let ([a, b, c, d], [e, f, g, h]) = (half(0), half(4));
    [a.combine(e), b.combine(f), c.combine(g), d.combine(h)]
}

/// Two texels of two words at each lane's place: the left and the right one.
#[inline(always)]
fn pairs<V: Simd>(simd: V, words: &[u32], places: &[u32; 8]) -> [Values<V>; 2] {
    let half = inlined(
        #[inline(always)]
        |first: usize| -> [u32x4<V>; 4] {
            let row = inlined(
                #[inline(always)]
                |i: usize| u32x4::simd_from(simd, *from(words, places[first + i])),
            );
            let (a, b, c, d) = (row(0), row(1), row(2), row(3));
            let [e, f] = first_two([a, b, c, d]);
            let (ab, cd): (u64x2<V>, u64x2<V>) = (a.zip_high(b).bitcast(), c.zip_high(d).bitcast());
            [e, f, ab.zip_low(cd).bitcast(), ab.zip_high(cd).bitcast()]
        },
    );
    let ([a, b, c, d], [e, f, g, h]) = (half(0), half(4));
    let all = inlined(
        #[inline(always)]
        |(first, second): (u32x4<V>, u32x4<V>)| -> u16x16<V> {
            let words: u32x8<V> = first.combine(second);
            words.bitcast()
        },
    );
    [Values { rb: all((a, e)), ga: all((b, f)) }, Values { rb: all((c, g)), ga: all((d, h)) }]
}
