//! The lines that a linear filter reads of a flat texture of any format: those of the four texels about each lane's place.
//!
//! Places are found by the arithmetic of [`super::fast`], all lanes at once. A line is the sum of what a column and a row say, so that a few
//! comparisons tell which quads read one line alone. Of the 16 texels of any other quad (32 between two levels) the distinct lines are taken
//! out one after another: each is compared with all texels at once, which leaves those of other lines.

use super::fast::{QuadLevels, choose, fold, following, is_flat, pair, place};
use super::lod::quad_rho;
use super::record::Footprint;
use super::{Lod, Sample, Sampler, View};
#[cfg(target_arch = "x86_64")]
use crate::simd::has_avx2;
use crate::state::AddressMode;
use num::{LANES, Lanes, Mask, QUADS};

/// Records what a linear filter reads of a flat texture of any format; says whether it could. `found` are the levels of the quads, where
/// sampling has found them.
#[inline(always)]
pub(super) fn record(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    found: Option<&QuadLevels>,
    mask: Mask,
    out: &mut Footprint,
) -> bool {
    let applies = is_flat(view, sampler) && args.offset == [0; 3];
    if applies {
        record_wide(view, sampler, args, found, mask, out);
    }
    applies
}

/// Records with the widest vectors of the host.
#[inline(always)]
fn record_wide(view: &View, sampler: &Sampler, args: &Sample<'_>, found: Option<&QuadLevels>, mask: Mask, out: &mut Footprint) {
    #[cfg(target_arch = "x86_64")]
    {
        #[target_feature(enable = "avx2,bmi1,bmi2,lzcnt,popcnt")]
        fn vectors(
            view: &View,
            sampler: &Sampler,
            args: &Sample<'_>,
            found: Option<&QuadLevels>,
            mask: Mask,
            out: &mut Footprint,
        ) {
            record_body::<true>(view, sampler, args, found, mask, out);
        }
        if has_avx2() {
            // SAFETY: the host has every instruction set that the function is compiled for.
            return unsafe { vectors(view, sampler, args, found, mask, out) };
        }
    }
    record_body::<false>(view, sampler, args, found, mask, out);
}

/// `WIDE`: the caller is compiled for AVX2 and its companions.
#[inline(always)]
fn record_body<const WIDE: bool>(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    found: Option<&QuadLevels>,
    mask: Mask,
    out: &mut Footprint,
) {
    let both = out.takes_both(view, sampler);
    let (mut level, mut two) = ([0_u32; LANES], 0);
    let layers = alike(args.layer);
    let same = levels(view, sampler, args, found, &mut level, &mut two) && layers == LANES;
    let two = mask & if both { !0 } else { two };
    let mut room = out.room.take().unwrap_or_default();
    let Room { first, second, lines } = &mut *room;
    find(view, sampler, args, same, layers, &level, first);
    if two == 0 {
        // The compiler makes less of what it knows to be one level.
        out.squares::<WIDE>(mask, 0, first, first, lines);
    } else {
        level.iter_mut().for_each(|level| *level = following(view, *level));
        find(view, sampler, args, same, layers, &level, second);
        out.squares::<WIDE>(mask, two, first, second, lines);
    }
    out.room = Some(room);
}

/// Lines of a batch at most: four texels per lane in each of two levels.
const MOST: usize = 2 * 4 * LANES;

/// What is found of a batch. It is kept from one to the next and need not be cleared: what counts of it has been written.
#[derive(Clone, Debug)]
pub(super) struct Room {
    first: Corners,
    second: Corners,
    lines: [u32; MOST],
}

impl Default for Room {
    fn default() -> Room {
        Room { first: Corners::ZERO, second: Corners::ZERO, lines: [0; MOST] }
    }
}

/// What the lines of each lane's four texels are sums of.
#[derive(Clone, Debug)]
struct Corners {
    /// Of the left and of the right column.
    x: [[u32; LANES]; 2],
    /// Of the upper and of the lower row.
    y: [[u32; LANES]; 2],
}

impl Corners {
    const ZERO: Corners = Corners { x: [[0; LANES]; 2], y: [[0; LANES]; 2] };

    /// The line of a lane's first texel.
    #[inline(always)]
    fn line(&self, lane: usize) -> u32 {
        self.y[0][lane].wrapping_add(self.x[0][lane])
    }

    /// The quads that read one line alone, whichever of their lanes are live: bit `4 q` each. `WIDE`: the caller is compiled for AVX2.
    #[inline(always)]
    fn alike<const WIDE: bool>(&self) -> Mask {
        #[cfg(target_arch = "x86_64")]
        if WIDE {
            // SAFETY: `record_wide` has found the instruction set on this host.
            return unsafe { self.alike_avx2() };
        }
        let mut out = 0;
        for q in 0..QUADS {
            let mut different = 0;
            for i in 4 * q..4 * q + 4 {
                different |= self.x[0][i] ^ self.x[1][i] | self.y[0][i] ^ self.y[1][i] | self.line(i) ^ self.line(4 * q);
            }
            out |= Mask::from(different == 0) << (4 * q);
        }
        out
    }

    /// [`Corners::alike`], two quads at a time.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    #[inline]
    fn alike_avx2(&self) -> Mask {
        use std::arch::x86_64::*;
        let mut equal: Mask = 0;
        for chunk in 0..LANES / 8 {
            let of = |lanes: &[u32; LANES]| -> __m256i { bytemuck::cast(lanes.as_chunks::<8>().0[chunk]) };
            let ([left, right], [upper, lower]) = (self.x.each_ref().map(of), self.y.each_ref().map(of));
            let line = _mm256_add_epi32(upper, left);
            let of_first_lane = _mm256_shuffle_epi32::<0>(line);
            let between = _mm256_or_si256(_mm256_xor_si256(left, right), _mm256_xor_si256(upper, lower));
            let different = _mm256_or_si256(between, _mm256_xor_si256(line, of_first_lane));
            let lanes = _mm256_movemask_ps(_mm256_castsi256_ps(_mm256_cmpeq_epi32(different, _mm256_setzero_si256())));
            equal |= Mask::from(lanes as u8) << (8 * chunk);
        }
        let pairs = equal & equal >> 1;
        pairs & pairs >> 2 & 0x1111_1111_1111_1111
    }
}

/// How many lanes beside each other read the same layer: all, those of each quad, or one.
#[inline(always)]
fn alike(layer: Option<&Lanes>) -> usize {
    let Some(Lanes(layer)) = layer else { return LANES };
    let (mut all, mut quads) = (0, 0);
    for i in 0..LANES {
        all |= layer[i] ^ layer[0];
        quads |= layer[i] ^ layer[i / 4 * 4];
    }
    match (all, quads) {
        (0, _) => LANES,
        (_, 0) => 4,
        _ => 1,
    }
}

/// The first level of every lane, and the lanes that read the following one; says whether all read the same levels.
#[inline(always)]
fn levels(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    found: Option<&QuadLevels>,
    level: &mut [u32; LANES],
    two: &mut Mask,
) -> bool {
    if view.levels.len() == 1 {
        return true;
    }
    let mut different = 0;
    if matches!(args.lod, Lod::Auto) {
        let mut own = QuadLevels::default();
        let QuadLevels { first, weight } = found.unwrap_or_else(|| {
            let mut rho = [0.0; QUADS];
            quad_rho(view, args, &mut rho);
            own.find(view, sampler, &rho);
            &own
        });
        let beyond = first.iter().zip(weight).fold(0, |any, (first, weight)| any | first | weight.to_bits());
        if beyond == 0 {
            // All are in the first level, as `level` says.
            return true;
        }
        for q in 0..QUADS {
            different |= first[q] ^ first[0];
            *two |= if weight[q] > 0.0 { 15 << (4 * q) } else { 0 };
        }
        for i in 0..LANES {
            level[i] = first[i / 4];
        }
    } else {
        let mut weight = [0.0; LANES];
        choose(view, sampler, args, level, &mut weight);
        for i in 0..LANES {
            different |= level[i] ^ level[0];
            *two |= Mask::from(weight[i] > 0.0) << i;
        }
    }
    different == 0
}

/// Where the lines of `N` lanes' levels are; of all lanes, if there is one.
struct Rows<const N: usize> {
    width: [f32; N],
    height: [f32; N],
    /// The first line of the slice.
    first: [u32; N],
    /// Lines of a row of micro tiles.
    row: [u32; N],
}

impl<const N: usize> Rows<N> {
    /// Those of the lanes' levels and layers, for `step` lanes at a time, which have the same.
    #[inline(always)]
    fn new(view: &View, args: &Sample<'_>, level: &[u32; LANES], step: usize) -> Rows<N> {
        let mut out = Rows { width: [0.0; N], height: [0.0; N], first: [0; N], row: [0; N] };
        let last = view.layers() as i32 - 1;
        for i in (0..N).step_by(step) {
            let [width, height, _] = view.levels[level[i] as usize].size;
            let layer = args.layer.map_or(0, |layer| layer.i32()[i].clamp(0, last) as u32);
            let (first, row) = view.rows(level[i] as usize, layer);
            let lanes = i..(i + step).min(N);
            out.width[lanes.clone()].fill(width as f32);
            out.height[lanes.clone()].fill(height as f32);
            out.first[lanes.clone()].fill(first);
            out.row[lanes].fill(row);
        }
        out
    }
}

/// The lines of each lane's four texels. With `same`, all lanes read one slice of one level. Each `layers` adjacent lanes read one layer.
#[inline(always)]
fn find(view: &View, sampler: &Sampler, args: &Sample<'_>, same: bool, layers: usize, level: &[u32; LANES], out: &mut Corners) {
    if same {
        find_in(view, sampler, args, &Rows::<1>::new(view, args, level, 1), out);
    } else {
        let quads = matches!(args.lod, Lod::Auto) && layers >= 4;
        let rows = if quads { Rows::<LANES>::new(view, args, level, 4) } else { Rows::new(view, args, level, 1) };
        find_in(view, sampler, args, &rows, out);
    }
}

#[inline(always)]
fn find_in<const N: usize>(view: &View, sampler: &Sampler, args: &Sample<'_>, rows: &Rows<N>, out: &mut Corners) {
    let ((across, down), tile) = view.tiled(0).micro_tile();
    lines_along(sampler.address[0], args.coords[0].f32(), &rows.width, across, (&[0], &[tile]), &mut out.x);
    lines_along(sampler.address[1], args.coords[1].f32(), &rows.height, down, (&rows.first, &rows.row), &mut out.y);
}

/// What the two texels that each lane filters along an axis add to their lines: `first`, and `step` for each micro tile.
#[inline(always)]
fn lines_along<const N: usize, const M: usize>(
    mode: AddressMode,
    u: &[f32; LANES],
    size: &[f32; N],
    shift: u32,
    (first, step): (&[u32; M], &[u32; M]),
    out: &mut [[u32; LANES]; 2],
) {
    #[inline(always)]
    fn of<const N: usize, const M: usize>(
        mode: AddressMode,
        u: &[f32; LANES],
        size: &[f32; N],
        shift: u32,
        (first, step): (&[u32; M], &[u32; M]),
        out: &mut [[u32; LANES]; 2],
    ) {
        for i in 0..LANES {
            let (texel, _) = place(mode, fold(mode, u[i]), size[i % N]);
            let texels = pair(mode, texel, size[i % N]);
            for (out, texel) in out.iter_mut().zip(texels) {
                out[i] = (texel >> shift).wrapping_mul(step[i % M]).wrapping_add(first[i % M]);
            }
        }
    }
    // One loop a mode: the compiler makes vectors of what it knows.
    match mode {
        AddressMode::Repeat => of(AddressMode::Repeat, u, size, shift, (first, step), out),
        AddressMode::MirrorRepeat => of(AddressMode::MirrorRepeat, u, size, shift, (first, step), out),
        AddressMode::ClampToEdge | AddressMode::ClampToBorder => {
            of(AddressMode::ClampToEdge, u, size, shift, (first, step), out);
        }
    }
}

/// For each set of a quad's lanes: a bit for each, eight places apart.
const APART: [u32; 16] = {
    let mut out = [0; 16];
    let mut lanes = 0;
    while lanes < 16 {
        let mut lane = 0;
        while lane < 4 {
            out[lanes] |= (lanes as u32 >> lane & 1) << (8 * lane);
            lane += 1;
        }
        lanes += 1;
    }
    out
};

/// Where the texel of each bit of a quad is among words that have lanes of levels of texels.
#[cfg(target_arch = "x86_64")]
const WORD: [u8; 32] = {
    let mut out = [0; 32];
    let mut at = 0;
    while at < 32 {
        out[at] = (at % 4 * 8 + at / 4 % 2 * 4 + at / 8) as u8;
        at += 1;
    }
    out
};

impl Footprint {
    /// Records quads in order from the lines of each lane's texels in two levels. The lanes of `two`, which are live, read both: first the
    /// texels of the one, then those of the other. `WIDE`: the caller is compiled for AVX2.
    #[inline(always)]
    fn squares<const WIDE: bool>(&mut self, mask: Mask, two: Mask, first: &Corners, second: &Corners, lines: &mut [u32; MOST]) {
        let mut alike = first.alike::<WIDE>();
        if two != 0 {
            alike &= second.alike::<WIDE>();
        }
        // Lines are put where there is room for all, and then added to the others at once.
        let (start, mut n) = (self.lines.len(), 0);
        self.bounds[0] = start as u32;
        for q in 0..QUADS {
            let (live, twice) = ((mask >> (4 * q)) as usize & 15, (two >> (4 * q)) as usize & 15);
            self.operations[q] = (live.count_ones() + twice.count_ones()) as u16;
            if alike >> (4 * q) & 1 == 0 {
                // Bit `8 p + t` for texel t of lane p in the first level, `8 p + 4 + t` in the second.
                let wanted = APART[live] * 0xf | APART[twice] * 0xf0;
                n = distinct::<WIDE>(first, second, q, wanted, lines, n);
            } else if live != 0 {
                let (line, other) = (first.line(4 * q), second.line(4 * q));
                lines[n % MOST] = line;
                lines[(n + 1) % MOST] = other;
                n += 1 + usize::from(twice != 0 && other != line);
            }
            self.bounds[q + 1] = (start + n) as u32;
        }
        self.lines.extend_from_slice(&lines[..n.min(MOST)]);
    }
}

/// Adds the distinct lines of the texels of a quad that have a bit in `left`, in the order of the bits. Returns how many lines there are then.
/// `WIDE`: the caller is compiled for AVX2.
#[inline(always)]
fn distinct<const WIDE: bool>(
    first: &Corners,
    second: &Corners,
    q: usize,
    mut left: u32,
    lines: &mut [u32; MOST],
    mut n: usize,
) -> usize {
    #[cfg(target_arch = "x86_64")]
    if WIDE {
        // SAFETY: `record_wide` has found the instruction sets on this host.
        return unsafe { distinct_avx2(first, second, q, left, lines, n) };
    }
    let texels: [u32; 32] = std::array::from_fn(|at| {
        let level = if at & 4 == 0 { first } else { second };
        let lane = 4 * q + at / 8;
        level.y[at / 2 % 2][lane].wrapping_add(level.x[at % 2][lane])
    });
    while left != 0 {
        let line = texels[left.trailing_zeros() as usize % 32];
        lines[n % MOST] = line;
        n += 1;
        left &= !texels.iter().enumerate().fold(0, |equal, (at, texel)| equal | u32::from(*texel == line) << at);
    }
    n
}

/// [`distinct`], all texels at once.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,bmi1")]
#[inline]
fn distinct_avx2(first: &Corners, second: &Corners, q: usize, mut left: u32, lines: &mut [u32; MOST], mut n: usize) -> usize {
    use std::arch::x86_64::*;
    // A texel of four lanes in the first level, and behind it in the second.
    let of = |one: &[u32; LANES], other: &[u32; LANES]| -> __m256i {
        let [one, other] = [one, other].map(|lanes| bytemuck::cast(lanes.as_chunks::<4>().0[q]));
        _mm256_set_m128i(other, one)
    };
    let (left_column, right_column) = (of(&first.x[0], &second.x[0]), of(&first.x[1], &second.x[1]));
    let (upper, lower) = (of(&first.y[0], &second.y[0]), of(&first.y[1], &second.y[1]));
    let texels = [
        _mm256_add_epi32(upper, left_column),
        _mm256_add_epi32(upper, right_column),
        _mm256_add_epi32(lower, left_column),
        _mm256_add_epi32(lower, right_column),
    ];
    let words: [u32; 32] = bytemuck::cast(texels);
    // From texels of lanes to lanes of texels, and from levels of lanes to lanes of levels.
    let by_lane = _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 4, 8, 12, 1, 5, 9, 13, 2, 6, 10, 14, 3, 7, 11, 15));
    let by_level = _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7);
    while left != 0 {
        let at = left.trailing_zeros() as usize;
        let line = words[usize::from(WORD[at % 32]) % 32];
        lines[n % MOST] = line;
        n += 1;
        let line = _mm256_set1_epi32(line as i32);
        let [a, b, c, d] = texels.map(|texel| _mm256_cmpeq_epi32(texel, line));
        let equal = _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d));
        let equal = _mm256_permutevar8x32_epi32(_mm256_shuffle_epi8(equal, by_lane), by_level);
        left &= !(_mm256_movemask_epi8(equal) as u32);
    }
    n
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;
    use num::Random;

    #[test]
    fn vectors_find_the_lines_that_a_loop_finds() {
        if !has_avx2() {
            return;
        }
        let mut random = Random::new(11);
        let mut most = 0;
        for round in 0..4000 {
            let mut room = [Room::default(), Room::default()];
            let range = 1 + round % 5;
            let mut corners = || {
                let mut lanes = || std::array::from_fn(|_| random.bits() % range);
                Corners { x: [lanes(), lanes()], y: [lanes(), lanes()] }
            };
            let (first, second) = (corners(), corners());
            let mut bits = || u64::from(random.bits()) << 32 | u64::from(random.bits());
            let mask = bits() | bits();
            let two = if round % 3 == 0 { 0 } else { mask & bits() };
            let [mut one, mut other] = [Footprint::new(), Footprint::new()];
            one.squares::<false>(mask, two, &first, &second, &mut room[0].lines);
            other.squares::<true>(mask, two, &first, &second, &mut room[1].lines);
            assert_eq!((&one.lines, one.bounds, one.operations), (&other.lines, other.bounds, other.operations));
            for q in 0..QUADS {
                let (lines, operations) = one.quad(q);
                assert!(lines.iter().enumerate().all(|(i, line)| !lines[..i].contains(line)), "{lines:?}");
                assert_eq!(lines.is_empty(), operations == 0);
                most = most.max(lines.len());
            }
        }
        assert!(most > 8, "no quad of both levels had many lines");
    }
}
