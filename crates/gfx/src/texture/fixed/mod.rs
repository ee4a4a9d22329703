//! Bilinear and trilinear filtering of four 8-bit channels in 16-bit fixed point.
//!
//! A channel is an 8-bit code times 128 (an sRGB code's linear value, as exactly), so that 32640 is 1 and differences fit 16
//! bits; weights have 15 bits; a product is rounded to nearest, which x86 does for 16 of them in one instruction. A trilinear
//! result is within a fiftieth of an 8-bit step of the exact one, and exact where all texels are equal.
//!
//! There are two forms with the same bits: eight lanes at a time in AVX2 registers (`avx2`), and one lane at a time elsewhere.
//! The first is written with intrinsics because what the compiler made of plain loops (no rounding multiplication, every stage
//! through memory) took more than twice the time.

#[cfg(target_arch = "x86_64")]
mod avx2;

use super::fast::{Geometry, QuadLevels, choose, fold, following, place};
use super::lod::{BIAS, quad_rho};
use super::view::{FIXED_ONE, Level, ROWS, Texels};
use super::{Lod, Sample, Sampler, View};
use crate::state::AddressMode;
use num::{LANES, Lanes, QUADS};

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
    #[cfg(target_arch = "x86_64")]
    if crate::simd::has_avx2() {
        // SAFETY: the host has AVX2, which is all that the function requires.
        unsafe { avx2::sample(view, sampler, args, found, out) };
        return;
    }
    sample_lanes(view, sampler, args, found, out);
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

/// A weight in [0, 1) in 15 bits, to nearest.
#[inline(always)]
fn fixed(weight: f32) -> u32 {
    (weight * 32767.0 + 8_388_608.0).to_bits() & 0x7fff
}

/// Samples a lane at a time, whatever the host.
pub(super) fn sample_lanes(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    found: &mut Option<QuadLevels>,
    out: &mut [Lanes; 4],
) {
    let mut rho = [0.0; QUADS];
    let bias = quad_bias(view, args);
    if bias.is_some() {
        quad_rho(view, args, &mut rho);
    }
    let (mut each, mut weight) = (None, [0.0; LANES]);
    let plan =
        sole_level(view, args).unwrap_or_else(|| plan(view, sampler, args, &rho, bias.as_ref(), found, &mut each, &mut weight));
    let address = [sampler.address[0], sampler.address[1]];
    for i in 0..LANES {
        let at = [fold(address[0], args.coords[0].f32()[i]), fold(address[1], args.coords[1].f32()[i])];
        let level = |n: usize| match &plan.places {
            Places::Same(levels) => Flat::of(levels[n]),
            Places::Quads(first) => {
                let first = first[i / 4];
                Flat::of(&view.levels[if n == 0 { first } else { following(view, first) } as usize])
            }
            Places::Each(levels) => Flat::lane(&levels[n], i),
        };
        let mut value = bilinear(&view.texels, address, at, level(0));
        if plan.blend {
            let weight = plan.weight[if plan.by_quad { i / 4 } else { i }];
            value = mix(value, bilinear(&view.texels, address, at, level(1)), fixed(weight));
        }
        // Red, blue, green, alpha.
        for (channel, c) in [0, 2, 1, 3].into_iter().enumerate() {
            out[c].f32_mut()[i] = f32::from(value[channel]) * (1.0 / FIXED_ONE);
        }
    }
}

/// The geometry of one lane's level.
#[derive(Clone, Copy)]
struct Flat {
    width: f32,
    height: f32,
    stride: u32,
    base: u32,
}

impl Flat {
    fn of(level: &Level) -> Flat {
        let [width, height, stride, base] = level.flat;
        Flat { width: f32::from_bits(width), height: f32::from_bits(height), stride, base }
    }

    fn lane(level: &Geometry, i: usize) -> Flat {
        Flat { width: level.width[i], height: level.height[i], stride: level.stride[i], base: level.base[i] }
    }
}

/// The bilinear value at a folded place of a level: red, blue, green, alpha.
fn bilinear(texels: &Texels, address: [AddressMode; 2], folded: [f32; 2], level: Flat) -> [i16; 4] {
    let (x, x_weight) = place(address[0], folded[0], level.width);
    let (y, y_weight) = place(address[1], folded[1], level.height);
    // Rows end with their first texel again; where the last one is clamped to, its right neighbour has no weight.
    let at = |row: i32| level.base.wrapping_add(x as u32).wrapping_add((row as u32).wrapping_mul(level.stride)) as usize;
    let [a, b, c, d] = match texels {
        Texels::Unorm8(columns) => {
            let (group, row) = (y / ROWS as i32, (y % ROWS as i32) as usize);
            let [left, right] = columns.get(at(group)..at(group) + 2).map_or([[0; 4]; 2], |c| [c[0], c[1]]);
            let spread = |code: u32| {
                let [r, g, b, a] = code.to_le_bytes();
                [r, b, g, a].map(|c| i16::from(c) << 7)
            };
            [spread(left[row]), spread(right[row]), spread(left[row + 1]), spread(right[row + 1])]
        }
        Texels::Srgb8 { linear, .. } => {
            let below = if y + 1 < level.height as i32 {
                y + 1
            } else if address[1] == AddressMode::Repeat {
                0
            } else {
                y
            };
            let two = |row: i32| linear.get(at(row)..at(row) + 2).map_or([0; 2], |w| [w[0], w[1]]);
            let ([a, b], [c, d]) = (two(y), two(below));
            [a, b, c, d].map(|t| [t as i16, (t >> 16) as i16, (t >> 32) as i16, (t >> 48) as i16])
        }
        _ => [[0; 4]; 4],
    };
    let (x_weight, y_weight) = (fixed(x_weight), fixed(y_weight));
    mix(mix(a, b, x_weight), mix(c, d, x_weight), y_weight)
}

/// `a + (b - a) * weight`, the product rounded to nearest.
fn mix(a: [i16; 4], b: [i16; 4], weight: u32) -> [i16; 4] {
    std::array::from_fn(|c| {
        let difference = i32::from(b[c].wrapping_sub(a[c]));
        let product = (((difference * weight as i32) >> 14) + 1) >> 1;
        a[c].wrapping_add(product as i16)
    })
}
