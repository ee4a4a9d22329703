//! Bilinear and trilinear filtering of four 8-bit channels in 16-bit fixed point.
//!
//! A channel is an 8-bit code times 128 (an sRGB code's linear value, as exactly), so that 32640 is 1 and differences fit 16
//! bits; weights have 15 bits; a product is rounded to nearest, which x86 does for 16 of them in one instruction. A trilinear
//! result is within a fiftieth of an 8-bit step of the exact one, and exact where all texels are equal.
//!
//! There are two forms with the same bits: eight lanes at a time in AVX2 registers, and one lane at a time elsewhere. The first
//! is written with intrinsics because what the compiler made of plain loops (no rounding multiplication, every stage through
//! memory) took more than twice the time.

use super::fast::{Geometry, choose, fold, following, place};
use super::view::{FIXED_ONE, Texels};
use super::{Lod, Sample, Sampler, View};
use crate::gfx::simd::wide;
use crate::gfx::state::AddressMode;
use crate::num::{LANES, Lanes};

/// What is read, level by level.
struct Plan {
    first: Geometry,
    second: Geometry,
    /// Weight of the second level, lane by lane.
    weight: [f32; LANES],
    /// Whether any lane reads a second level.
    blend: bool,
}

/// Samples a flat view of four 8-bit channels with a linear filter.
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let address = [sampler.address[0], sampler.address[1]];
    let coords = [args.coords[0].f32(), args.coords[1].f32()];
    let plan = plan(view, sampler, args);
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        match &view.texels {
            // SAFETY: the host has AVX2, which is all that the function requires.
            Texels::Unorm8(pairs) => unsafe { avx2::sample::<false>(pairs, address, coords, &plan, out) },
            // SAFETY: as above.
            Texels::Srgb8 { linear, .. } => unsafe { avx2::sample::<true>(linear, address, coords, &plan, out) },
            _ => {}
        }
        return;
    }
    sample_lanes(view, address, coords, &plan, out);
}

wide! {
    fn plan(view: &View, sampler: &Sampler, args: &Sample<'_>) -> Plan = plan_body;
}

#[inline(always)]
fn plan_body(view: &View, sampler: &Sampler, args: &Sample<'_>) -> Plan {
    let (mut first, mut weight) = ([0_u32; LANES], [0.0_f32; LANES]);
    let blend = choose(view, sampler, args, &mut first, &mut weight);
    let quads = matches!(args.lod, Lod::Auto);
    let near = Geometry::new(view, args, &first, quads);
    if blend {
        for level in &mut first {
            *level = following(view, *level);
        }
    }
    Plan { first: near, second: Geometry::new(view, args, &first, quads), weight, blend }
}

/// A weight in [0, 1) in 15 bits, to nearest.
#[inline(always)]
fn fixed(weight: f32) -> u32 {
    (weight * 32767.0 + 8_388_608.0).to_bits() & 0x7fff
}

/// Samples a lane at a time, whatever the host.
#[cfg(test)]
pub(super) fn sample_lanes_of(view: &View, sampler: &Sampler, args: &Sample<'_>, out: &mut [Lanes; 4]) {
    let coords = [args.coords[0].f32(), args.coords[1].f32()];
    sample_lanes(view, [sampler.address[0], sampler.address[1]], coords, &plan(view, sampler, args), out);
}

fn sample_lanes(view: &View, address: [AddressMode; 2], coords: [&[f32; LANES]; 2], plan: &Plan, out: &mut [Lanes; 4]) {
    for i in 0..LANES {
        let at = [fold(address[0], coords[0][i]), fold(address[1], coords[1][i])];
        let mut value = bilinear(&view.texels, address, at, &plan.first, i);
        if plan.blend {
            let second = bilinear(&view.texels, address, at, &plan.second, i);
            value = mix(value, second, fixed(plan.weight[i]));
        }
        // Red, blue, green, alpha.
        for (channel, c) in [0, 2, 1, 3].into_iter().enumerate() {
            out[c].f32_mut()[i] = f32::from(value[channel]) * (1.0 / FIXED_ONE);
        }
    }
}

/// The bilinear value of a lane in a level: red, blue, green, alpha.
#[inline(always)]
fn bilinear(texels: &Texels, address: [AddressMode; 2], at: [f32; 2], level: &Geometry, lane: usize) -> [i16; 4] {
    let (x, x_weight) = place(address[0], at[0], level.width[lane]);
    let (y, y_weight) = place(address[1], at[1], level.height[lane]);
    let left = level.base[lane].wrapping_add(x as u32);
    let top = left.wrapping_add((y as u32).wrapping_mul(level.stride[lane]));
    let two = |words: &[u64], place: u32| words.get(place as usize..place as usize + 2).map_or([0; 2], |w| [w[0], w[1]]);
    let [a, b, c, d] = match texels {
        Texels::Unorm8(pairs) => {
            let [left, right] = two(pairs, top);
            let spread = |code: u64| {
                let [r, g, b, a] = (code as u32).to_le_bytes();
                [r, b, g, a].map(|c| i16::from(c) << 7)
            };
            [spread(left), spread(right), spread(left >> 32), spread(right >> 32)]
        }
        Texels::Srgb8 { linear, .. } => {
            let next = if y + 1 < level.height[lane] as i32 {
                y + 1
            } else if address[1] == AddressMode::Repeat {
                0
            } else {
                y
            };
            let bottom = left.wrapping_add((next as u32).wrapping_mul(level.stride[lane]));
            let ([a, b], [c, d]) = (two(linear, top), two(linear, bottom));
            [a, b, c, d].map(|t| [t as i16, (t >> 16) as i16, (t >> 32) as i16, (t >> 48) as i16])
        }
        _ => [[0; 4]; 4],
    };
    let (x_weight, y_weight) = (fixed(x_weight), fixed(y_weight));
    mix(mix(a, b, x_weight), mix(c, d, x_weight), y_weight)
}

/// `a + (b - a) * weight`, the product rounded to nearest.
#[inline(always)]
fn mix(a: [i16; 4], b: [i16; 4], weight: u32) -> [i16; 4] {
    std::array::from_fn(|c| {
        let difference = i32::from(b[c].wrapping_sub(a[c]));
        let product = (((difference * weight as i32) >> 14) + 1) >> 1;
        a[c].wrapping_add(product as i16)
    })
}

/// Eight lanes at a time.
#[cfg(target_arch = "x86_64")]
mod avx2 {
    use super::{FIXED_ONE, Geometry, Plan};
    use crate::gfx::state::AddressMode;
    use crate::num::{LANES, Lanes};
    use std::arch::x86_64::*;

    /// A texel a lane: red and blue, green and alpha, 16 bits each.
    #[derive(Clone, Copy)]
    struct Values {
        rb: __m256i,
        ga: __m256i,
    }

    #[target_feature(enable = "avx2")]
    pub(super) fn sample<const SRGB: bool>(
        texels: &[u64],
        address: [AddressMode; 2],
        coords: [&[f32; LANES]; 2],
        plan: &Plan,
        out: &mut [Lanes; 4],
    ) {
        let scale = _mm256_set1_ps(1.0 / FIXED_ONE);
        let low = _mm256_set1_epi32(0xffff);
        for chunk in 0..LANES / 8 {
            let at = [fold(address[0], floats(coords[0], chunk)), fold(address[1], floats(coords[1], chunk))];
            let mut value = bilinear::<SRGB>(texels, address, at, &plan.first, chunk);
            if plan.blend {
                let second = bilinear::<SRGB>(texels, address, at, &plan.second, chunk);
                value = mix(value, second, fixed(floats(&plan.weight, chunk)));
            }
            let halves = [
                _mm256_and_si256(value.rb, low),
                _mm256_and_si256(value.ga, low),
                _mm256_srli_epi32::<16>(value.rb),
                _mm256_srli_epi32::<16>(value.ga),
            ];
            for (channel, half) in out.iter_mut().zip(halves) {
                let number: [u32; 8] = bytemuck::cast(_mm256_mul_ps(_mm256_cvtepi32_ps(half), scale));
                channel.0.as_chunks_mut::<8>().0[chunk] = number;
            }
        }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn floats(lanes: &[f32; LANES], chunk: usize) -> __m256 {
        bytemuck::cast(lanes.as_chunks::<8>().0[chunk])
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn words(lanes: &[u32; LANES], chunk: usize) -> __m256i {
        bytemuck::cast(lanes.as_chunks::<8>().0[chunk])
    }

    /// [`super::fold`].
    #[target_feature(enable = "avx2")]
    #[inline]
    fn fold(mode: AddressMode, u: __m256) -> __m256 {
        let zero = _mm256_setzero_ps();
        match mode {
            // The maximum gives its second operand for NaN, as the scalar selections do.
            AddressMode::Repeat => _mm256_max_ps(_mm256_sub_ps(u, _mm256_floor_ps(u)), zero),
            AddressMode::MirrorRepeat => {
                let two = _mm256_set1_ps(2.0);
                let period = _mm256_floor_ps(_mm256_mul_ps(u, _mm256_set1_ps(0.5)));
                let f = _mm256_max_ps(_mm256_sub_ps(u, _mm256_mul_ps(two, period)), zero);
                _mm256_min_ps(f, _mm256_sub_ps(two, f))
            }
            AddressMode::ClampToEdge | AddressMode::ClampToBorder => u,
        }
    }

    /// [`super::place`], with the weight in fixed point.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn place(mode: AddressMode, folded: __m256, size: __m256) -> (__m256i, __m256i) {
        let last = _mm256_sub_ps(size, _mm256_set1_ps(1.0));
        let place = _mm256_sub_ps(_mm256_mul_ps(folded, size), _mm256_set1_ps(0.5));
        let place =
            if mode == AddressMode::Repeat { place } else { _mm256_min_ps(_mm256_max_ps(place, _mm256_setzero_ps()), last) };
        let whole = _mm256_floor_ps(place);
        let weight = fixed(_mm256_sub_ps(place, whole));
        // The sign of the whole part chooses: only a repeating place can be left of the first texel.
        let texel = _mm256_blendv_ps(whole, last, whole);
        (_mm256_cvttps_epi32(texel), weight)
    }

    /// [`super::fixed`], in both halves of a word.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn fixed(weight: __m256) -> __m256i {
        let bits = _mm256_add_ps(_mm256_mul_ps(weight, _mm256_set1_ps(32767.0)), _mm256_set1_ps(8_388_608.0));
        let twice = _mm256_setr_epi8(
            0, 1, 0, 1, 4, 5, 4, 5, 8, 9, 8, 9, 12, 13, 12, 13, 0, 1, 0, 1, 4, 5, 4, 5, 8, 9, 8, 9, 12, 13, 12, 13,
        );
        _mm256_shuffle_epi8(_mm256_castps_si256(bits), twice)
    }

    /// [`super::bilinear`].
    #[target_feature(enable = "avx2")]
    #[inline]
    fn bilinear<const SRGB: bool>(
        texels: &[u64],
        address: [AddressMode; 2],
        at: [__m256; 2],
        level: &Geometry,
        chunk: usize,
    ) -> Values {
        let height = floats(&level.height, chunk);
        let stride = words(&level.stride, chunk);
        let (x, x_weight) = place(address[0], at[0], floats(&level.width, chunk));
        let (y, y_weight) = place(address[1], at[1], height);
        let left = _mm256_add_epi32(words(&level.base, chunk), x);
        let top = _mm256_add_epi32(left, _mm256_mullo_epi32(y, stride));
        let c = columns(texels, top);
        let (upper, lower) = if SRGB {
            let next = _mm256_add_epi32(y, _mm256_set1_epi32(1));
            let inside = _mm256_cmpgt_epi32(_mm256_cvttps_epi32(height), next);
            let beyond = if address[1] == AddressMode::Repeat { _mm256_setzero_si256() } else { y };
            let next = _mm256_blendv_epi8(beyond, next, inside);
            let bottom = _mm256_add_epi32(left, _mm256_mullo_epi32(next, stride));
            let d = columns(texels, bottom);
            (
                mix(Values { rb: c[0], ga: c[1] }, Values { rb: c[2], ga: c[3] }, x_weight),
                mix(Values { rb: d[0], ga: d[1] }, Values { rb: d[2], ga: d[3] }, x_weight),
            )
        } else {
            (mix(spread(c[0]), spread(c[2]), x_weight), mix(spread(c[1]), spread(c[3]), x_weight))
        };
        mix(upper, lower, y_weight)
    }

    /// Four 8-bit channels as 16-bit values.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn spread(codes: __m256i) -> Values {
        let mask = _mm256_set1_epi32(0x7f80_7f80);
        Values {
            rb: _mm256_and_si256(_mm256_slli_epi32::<7>(codes), mask),
            ga: _mm256_and_si256(_mm256_srli_epi32::<1>(codes), mask),
        }
    }

    /// [`super::mix`].
    #[target_feature(enable = "avx2")]
    #[inline]
    fn mix(a: Values, b: Values, weight: __m256i) -> Values {
        Values { rb: mix_half(a.rb, b.rb, weight), ga: mix_half(a.ga, b.ga, weight) }
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn mix_half(a: __m256i, b: __m256i, weight: __m256i) -> __m256i {
        _mm256_add_epi16(a, _mm256_mulhrs_epi16(_mm256_sub_epi16(b, a), weight))
    }

    /// The four words at each lane's place, transposed: word 0 of all lanes, word 1, and so on.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn columns(texels: &[u64], places: __m256i) -> [__m256i; 4] {
        let places: [u32; 8] = bytemuck::cast(places);
        let row = |lane: usize| _mm256_set_m128i(two(texels, places[lane + 4]), two(texels, places[lane]));
        let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
        let (a, b) = (_mm256_unpacklo_epi32(r0, r1), _mm256_unpackhi_epi32(r0, r1));
        let (c, d) = (_mm256_unpacklo_epi32(r2, r3), _mm256_unpackhi_epi32(r2, r3));
        [_mm256_unpacklo_epi64(a, c), _mm256_unpackhi_epi64(a, c), _mm256_unpacklo_epi64(b, d), _mm256_unpackhi_epi64(b, d)]
    }

    /// The two elements at a place; zeros outside, where no place of a level is.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn two(texels: &[u64], place: u32) -> __m128i {
        match texels.get(place as usize..).and_then(|rest| rest.first_chunk::<2>()) {
            Some(pair) => bytemuck::cast(*pair),
            None => _mm_setzero_si128(),
        }
    }
}
