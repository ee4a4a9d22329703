//! Eight lanes at a time, in AVX2 registers: the operations of [`super`] in the same order.

use std::arch::x86_64::*;

use super::{FIXED_ONE, Geometry, Places, Plan, QuadLevels, following, plan, quad_bias, sole_level};
use crate::state::AddressMode;
use crate::texture::view::{Level, Texels};
use crate::texture::{Sample, Sampler, View};
use num::{LANES, Lanes, QUADS};

/// Registers of a batch.
const CHUNKS: usize = LANES / 8;

/// A texel per lane: red and blue, green and alpha, 16 bits each.
#[derive(Clone, Copy)]
struct Values {
    rb: __m256i,
    ga: __m256i,
}

/// The geometry of each lane's level.
#[derive(Clone, Copy)]
struct Flat {
    width: __m256,
    height: __m256,
    stride: __m256i,
    base: __m256i,
}

/// [`super::sample`].
#[target_feature(enable = "avx2")]
pub(super) fn sample(view: &View, sampler: &Sampler, args: &Sample<'_>, found: &mut Option<QuadLevels>, out: &mut [Lanes; 4]) {
    let (mut rho, mut each, mut weight);
    let plan = if let Some(plan) = sole_level(view, args) {
        plan
    } else {
        (rho, each, weight) = ([0.0; QUADS], None, [0.0; LANES]);
        let bias = quad_bias(view, args);
        if bias.is_some() {
            quad_rho(view, args, &mut rho);
        }
        plan(view, sampler, args, &rho, bias.as_ref(), found, &mut each, &mut weight)
    };
    let address = [sampler.address[0], sampler.address[1]];
    let coords = [args.coords[0].f32(), args.coords[1].f32()];
    match (&view.texels, &plan.places) {
        (Texels::Unorm8(columns), places) => {
            let words = columns.as_flattened();
            match (places, address) {
                // Most textures repeat: no choice is left in the loop.
                (Places::Same(levels), [AddressMode::Repeat, _]) if levels.iter().all(|level| level.size[1] == 1) => {
                    filter::<false, ROW>(view, words, REPEATS, coords, &plan, out);
                }
                (Places::Same(_), REPEATS) => filter::<false, SAME>(view, words, REPEATS, coords, &plan, out),
                (Places::Quads(_), REPEATS) => filter::<false, QUAD>(view, words, REPEATS, coords, &plan, out),
                (Places::Same(_), _) => filter::<false, SAME>(view, words, address, coords, &plan, out),
                (Places::Quads(_), _) => filter::<false, QUAD>(view, words, address, coords, &plan, out),
                (Places::Each(_), _) => filter::<false, LANE>(view, words, address, coords, &plan, out),
            }
        }
        (Texels::Srgb8 { linear, .. }, places) => {
            let words = bytemuck::cast_slice(linear);
            match places {
                Places::Same(_) => filter::<true, SAME>(view, words, address, coords, &plan, out),
                Places::Quads(_) => filter::<true, QUAD>(view, words, address, coords, &plan, out),
                Places::Each(_) => filter::<true, LANE>(view, words, address, coords, &plan, out),
            }
        }
        _ => {}
    }
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
#[target_feature(enable = "avx2")]
#[inline]
fn quad_rho(view: &View, args: &Sample<'_>, out: &mut [f32; QUADS]) {
    let size = view.levels[0].size;
    for half in 0..2 {
        // Differences to the right and down, a lane a quad.
        let differences = |c: usize| {
            let lanes = args.coords[c].f32();
            let chunk = |i: usize| floats(lanes, 4 * half + i);
            let (a, b, c2, d) = (chunk(0), chunk(1), chunk(2), chunk(3));
            let (ab, cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c2, d));
            let (ab_high, cd_high) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c2, d));
            let first = _mm256_shuffle_ps::<0b01_00_01_00>(ab, cd);
            let right = _mm256_shuffle_ps::<0b11_10_11_10>(ab, cd);
            let down = _mm256_shuffle_ps::<0b01_00_01_00>(ab_high, cd_high);
            let size = _mm256_set1_ps(size[c] as f32);
            let scaled = |v: __m256| _mm256_mul_ps(_mm256_sub_ps(v, first), size);
            (scaled(right), scaled(down))
        };
        let ((ux, uy), (vx, vy)) = (differences(0), differences(1));
        let squared = |a: __m256, b: __m256| _mm256_add_ps(_mm256_mul_ps(a, a), _mm256_mul_ps(b, b));
        // The maximum gives its second operand for NaN, as the scalar selection does.
        let rho = _mm256_max_ps(squared(ux, vx), squared(uy, vy));
        // Quads 0, 2, 4, 6 are in the lower half, 1, 3, 5, 7 in the upper.
        let order = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
        out.as_chunks_mut::<8>().0[half] = bytemuck::cast(_mm256_permutevar8x32_ps(rho, order));
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn filter<const SRGB: bool, const OF: u8>(
    view: &View,
    words: &[u32],
    address: [AddressMode; 2],
    coords: [&[f32; LANES]; 2],
    plan: &Plan<'_>,
    out: &mut [Lanes; 4],
) {
    let scale = _mm256_set1_ps(1.0 / FIXED_ONE);
    let low = _mm256_set1_epi32(0xffff);
    let same = match &plan.places {
        Places::Same([first, second]) if OF == SAME || OF == ROW => [two(first, first), two(second, second)],
        _ => [two(&view.levels[0], &view.levels[0]); 2],
    };
    let flat = |level: usize, chunk: usize| match &plan.places {
        Places::Quads(first) if OF == QUAD => {
            let of_quad = |q: usize| &view.levels[if level == 0 { first[q] } else { following(view, first[q]) } as usize];
            two(of_quad(2 * chunk), of_quad(2 * chunk + 1))
        }
        Places::Each(levels) if OF == LANE => load(&levels[level], chunk),
        _ => same[level],
    };
    let spot = |level: usize, chunk: usize| {
        let at = |axis: usize| fold(address[axis], floats(coords[axis], chunk));
        if OF == ROW {
            return locate_in_row(words, address[0], at(0), &flat(level, chunk));
        }
        locate::<SRGB>(words, address, [at(0), at(1)], &flat(level, chunk))
    };
    // The places of the next register are found before what is at those of this one is read: each is a long chain of operations.
    let mut next = spot(0, 0);
    for chunk in 0..CHUNKS {
        let here = next;
        next = spot(0, (chunk + 1).min(CHUNKS - 1));
        let value_at = |spot: &Spot| if OF == ROW { linear(words, spot) } else { bilinear::<SRGB>(words, spot) };
        let mut value = value_at(&here);
        // Two quads that are enlarged, or in the last level, read no second one.
        let weights = [plan.weight[2 * chunk], plan.weight[2 * chunk + 1]];
        if plan.blend && (!plan.by_quad || weights != [0.0; 2]) {
            let second = value_at(&spot(1, chunk));
            let weight = if plan.by_quad {
                _mm256_set_m128(_mm_set1_ps(weights[1]), _mm_set1_ps(weights[0]))
            } else {
                floats(plan.weight, chunk)
            };
            value = mix(value, second, fixed(weight));
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

/// The geometry of two quads' levels.
#[target_feature(enable = "avx2")]
#[inline]
fn two(first: &Level, second: &Level) -> Flat {
    let flat: __m256 = bytemuck::cast([first.flat, second.flat]);
    Flat {
        width: _mm256_permute_ps::<0b00_00_00_00>(flat),
        height: _mm256_permute_ps::<0b01_01_01_01>(flat),
        stride: _mm256_castps_si256(_mm256_permute_ps::<0b10_10_10_10>(flat)),
        base: _mm256_castps_si256(_mm256_permute_ps::<0b11_11_11_11>(flat)),
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn load(level: &Geometry, chunk: usize) -> Flat {
    Flat {
        width: floats(&level.width, chunk),
        height: floats(&level.height, chunk),
        stride: integers(&level.stride, chunk),
        base: integers(&level.base, chunk),
    }
}

#[target_feature(enable = "avx2")]
#[inline]
fn floats(lanes: &[f32; LANES], chunk: usize) -> __m256 {
    bytemuck::cast(lanes.as_chunks::<8>().0[chunk])
}

#[target_feature(enable = "avx2")]
#[inline]
fn integers(lanes: &[u32; LANES], chunk: usize) -> __m256i {
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

/// Where eight lanes read, and how what is there is weighted.
#[derive(Clone, Copy)]
struct Spot {
    /// First words of what each lane reads; in sRGB in the upper row, then in the lower one.
    words: [[u32; 8]; 2],
    /// Whether all of it lies in the view's words.
    inside: bool,
    /// Weights of what is right and of what is below, in both halves of a word.
    weights: [__m256i; 2],
}

/// [`locate`] in columns of a level that is a row of texels.
#[target_feature(enable = "avx2")]
#[inline]
fn locate_in_row(words: &[u32], address: AddressMode, at: __m256, level: &Flat) -> Spot {
    let (x, x_weight) = place(address, at, level.width);
    let places = _mm256_slli_epi32::<2>(_mm256_add_epi32(level.base, x));
    let weights = [x_weight, _mm256_setzero_si256()];
    Spot { words: [bytemuck::cast(places), [0; 8]], inside: inside(words, places, COLUMNS), weights }
}

/// Finds where lanes read.
#[target_feature(enable = "avx2")]
#[inline]
fn locate<const SRGB: bool>(words: &[u32], address: [AddressMode; 2], at: [__m256; 2], level: &Flat) -> Spot {
    let (x, x_weight) = place(address[0], at[0], level.width);
    let (y, y_weight) = place(address[1], at[1], level.height);
    let left = _mm256_add_epi32(level.base, x);
    let weights = [x_weight, y_weight];
    if SRGB {
        let next = _mm256_add_epi32(y, _mm256_set1_epi32(1));
        let is_row = _mm256_cmpgt_epi32(_mm256_cvttps_epi32(level.height), next);
        let beyond = if address[1] == AddressMode::Repeat { _mm256_setzero_si256() } else { y };
        let below = _mm256_blendv_epi8(beyond, next, is_row);
        // Texels of two words, two of them side by side.
        let word = |row: __m256i| _mm256_slli_epi32::<1>(_mm256_add_epi32(left, _mm256_mullo_epi32(row, level.stride)));
        let (upper, lower) = (word(y), word(below));
        let inside = inside(words, upper, PAIR) && inside(words, lower, PAIR);
        return Spot { words: [bytemuck::cast(upper), bytemuck::cast(lower)], inside, weights };
    }
    // y / 3: the product of a number of 16 bits with 43691, shifted by 17, is exact. Columns of four words.
    let group = _mm256_srli_epi32::<1>(_mm256_mulhi_epu16(y, _mm256_set1_epi32(43_691)));
    let row = _mm256_sub_epi32(y, _mm256_add_epi32(group, _mm256_add_epi32(group, group)));
    let column = _mm256_add_epi32(left, _mm256_mullo_epi32(group, level.stride));
    let places = _mm256_add_epi32(_mm256_slli_epi32::<2>(column), row);
    Spot { words: [bytemuck::cast(places), [0; 8]], inside: inside(words, places, COLUMNS), weights }
}

/// [`super::bilinear`]. Zeros where a place is outside.
#[target_feature(enable = "avx2")]
#[inline]
fn bilinear<const SRGB: bool>(words: &[u32], spot: &Spot) -> Values {
    if !spot.inside {
        return Values { rb: _mm256_setzero_si256(), ga: _mm256_setzero_si256() };
    }
    let [x_weight, y_weight] = spot.weights;
    // SAFETY: every lane's words lie in the slice.
    let (upper, lower) = unsafe {
        if SRGB {
            let [c, d] = [pairs(words, &spot.words[0]), pairs(words, &spot.words[1])];
            (
                mix(Values { rb: c[0], ga: c[1] }, Values { rb: c[2], ga: c[3] }, x_weight),
                mix(Values { rb: d[0], ga: d[1] }, Values { rb: d[2], ga: d[3] }, x_weight),
            )
        } else {
            let c = corners(words, &spot.words[0]);
            (mix(spread(c[0]), spread(c[2]), x_weight), mix(spread(c[1]), spread(c[3]), x_weight))
        }
    };
    mix(upper, lower, y_weight)
}

/// [`bilinear`] in a row of texels, with the same bits: there both rows are this one.
#[target_feature(enable = "avx2")]
#[inline]
fn linear(words: &[u32], spot: &Spot) -> Values {
    if !spot.inside {
        return Values { rb: _mm256_setzero_si256(), ga: _mm256_setzero_si256() };
    }
    // SAFETY: every lane's words lie in the slice.
    let [left, _, right, _] = unsafe { corners(words, &spot.words[0]) };
    mix(spread(left), spread(right), spot.weights[0])
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

/// Words that a filter in columns reads at a place, and words of two texels side by side.
const COLUMNS: i32 = 8;
const PAIR: i32 = 4;

/// Whether `count` words from the place of each lane on lie in the slice, as those of a level do.
#[target_feature(enable = "avx2")]
#[inline]
fn inside(words: &[u32], places: __m256i, count: i32) -> bool {
    // One comparison for all lanes: a check of each took a third of the filter's instructions. Places are compared as signed
    // numbers, so that one beyond 2^31 is outside as well.
    let end = i32::try_from(words.len()).unwrap_or(i32::MAX).saturating_sub(count - 1);
    let inside =
        _mm256_and_si256(_mm256_cmpgt_epi32(_mm256_set1_epi32(end), places), _mm256_cmpgt_epi32(places, _mm256_set1_epi32(-1)));
    // The compiler would keep the comparison's eight lanes until the answer is needed, which takes more instructions.
    std::hint::black_box(_mm256_movemask_epi8(inside)) == -1
}

/// Places to be loaded one by one. What takes lanes out of a vector is what transposes words, of which a core does one or two per cycle.
#[inline(always)]
fn in_memory(places: &[u32; 8]) -> &[u32; 8] {
    std::hint::black_box(places)
}

/// The four texels of a filter in columns, of all lanes: the upper left, lower left, upper right, lower right.
///
/// # Safety
/// [`COLUMNS`] words from every place on lie in the slice.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn corners(words: &[u32], places: &[u32; 8]) -> [__m256i; 4] {
    let places = in_memory(places);
    // SAFETY: the caller says that the words lie in the slice. The load needs no alignment.
    let lane = |lane: usize| unsafe { _mm256_loadu_si256(words.as_ptr().add(places[lane] as usize).cast()) };
    // A column in each half, of which the first two words are wanted.
    let two = |i: usize| _mm256_unpacklo_epi32(lane(i), lane(i + 1));
    let (a, b, c, d) = (two(0), two(2), two(4), two(6));
    let (upper, lower) = (_mm256_unpacklo_epi64(a, b), _mm256_unpackhi_epi64(a, b));
    let (upper_behind, lower_behind) = (_mm256_unpacklo_epi64(c, d), _mm256_unpackhi_epi64(c, d));
    [
        _mm256_permute2x128_si256::<0x20>(upper, upper_behind),
        _mm256_permute2x128_si256::<0x20>(lower, lower_behind),
        _mm256_permute2x128_si256::<0x31>(upper, upper_behind),
        _mm256_permute2x128_si256::<0x31>(lower, lower_behind),
    ]
}

/// Four words at each lane's place, transposed: the first word of all lanes, the second, and so on.
///
/// # Safety
/// [`PAIR`] words from every place on lie in the slice.
#[target_feature(enable = "avx2")]
#[inline]
unsafe fn pairs(words: &[u32], places: &[u32; 8]) -> [__m256i; 4] {
    let places = in_memory(places);
    // SAFETY: as in `corners`.
    let lane = |lane: usize| unsafe { _mm_loadu_si128(words.as_ptr().add(places[lane] as usize).cast()) };
    let row = |i: usize| _mm256_set_m128i(lane(i + 4), lane(i));
    let (r0, r1, r2, r3) = (row(0), row(1), row(2), row(3));
    let (a, b) = (_mm256_unpacklo_epi32(r0, r1), _mm256_unpackhi_epi32(r0, r1));
    let (c, d) = (_mm256_unpacklo_epi32(r2, r3), _mm256_unpackhi_epi32(r2, r3));
    [_mm256_unpacklo_epi64(a, c), _mm256_unpackhi_epi64(a, c), _mm256_unpacklo_epi64(b, d), _mm256_unpackhi_epi64(b, d)]
}
