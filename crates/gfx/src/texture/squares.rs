//! The lines that a linear filter reads of a flat texture of any format: those of the four texels about each lane's place.
//!
//! Places are found by the arithmetic of [`super::fast`], all lanes at once. Of the 16 texels of a quad (32 between two levels) the
//! distinct lines are then taken out one after another: each is compared with all texels at once, which leaves those of other lines.

use super::fast::{QuadLevels, choose, fold, following, is_flat, pair, place};
use super::lod::quad_rho;
use super::record::Footprint;
use super::{Lod, Sample, Sampler, View};
use crate::simd::wide;
use crate::state::AddressMode;
use num::{LANES, Lanes, Mask, QUADS};

/// The lines of four texels, row by row.
type Square = [u32; 4];

/// Records what a linear filter reads of a flat texture of any format; says whether it could. `found` are the levels of the quads, where
/// sampling has found them.
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

wide! {
    fn record_wide(
        view: &View,
        sampler: &Sampler,
        args: &Sample<'_>,
        found: Option<&QuadLevels>,
        mask: Mask,
        out: &mut Footprint,
    ) = record_body;
}

#[inline(always)]
fn record_body(view: &View, sampler: &Sampler, args: &Sample<'_>, found: Option<&QuadLevels>, mask: Mask, out: &mut Footprint) {
    let both = out.takes_both(view, sampler);
    let (mut level, mut two) = ([0_u32; LANES], 0);
    let layers = alike(args.layer);
    let same = levels(view, sampler, args, found, &mut level, &mut two) && layers == LANES;
    let two = mask & if both { !0 } else { two };
    let mut first = [[0; 4]; LANES];
    find(view, sampler, args, same, layers, &level, &mut first);
    if two == 0 {
        return out.squares(mask, 0, &first, &first);
    }
    level.iter_mut().for_each(|level| *level = following(view, *level));
    let mut second = [[0; 4]; LANES];
    find(view, sampler, args, same, layers, &level, &mut second);
    out.squares(mask, two, &first, &second);
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

/// The lines of each lane's four texels. `same`: all lanes read one slice of one level; `layers`: so many beside each other read one layer.
#[inline(always)]
fn find(
    view: &View,
    sampler: &Sampler,
    args: &Sample<'_>,
    same: bool,
    layers: usize,
    level: &[u32; LANES],
    out: &mut [Square; LANES],
) {
    if same {
        find_in(view, sampler, args, &Rows::<1>::new(view, args, level, 1), out);
    } else {
        let quads = matches!(args.lod, Lod::Auto) && layers >= 4;
        let rows = if quads { Rows::<LANES>::new(view, args, level, 4) } else { Rows::new(view, args, level, 1) };
        find_in(view, sampler, args, &rows, out);
    }
}

#[inline(always)]
fn find_in<const N: usize>(view: &View, sampler: &Sampler, args: &Sample<'_>, rows: &Rows<N>, out: &mut [Square; LANES]) {
    let (mut x, mut y) = ([[0_u32; LANES]; 2], [[0_u32; LANES]; 2]);
    let ((across, down), tile) = view.tiled(0).micro_tile();
    lines_along(sampler.address[0], args.coords[0].f32(), &rows.width, across, (&[0], &[tile]), &mut x);
    lines_along(sampler.address[1], args.coords[1].f32(), &rows.height, down, (&rows.first, &rows.row), &mut y);
    let [[left, right], [upper, lower]] = [&x, &y];
    for i in 0..LANES {
        let sum = |row: u32, column: u32| row.wrapping_add(column);
        out[i] = [sum(upper[i], left[i]), sum(upper[i], right[i]), sum(lower[i], left[i]), sum(lower[i], right[i])];
    }
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

/// For each set of a quad's lanes: a bit for each, so many places apart.
const fn apart(places: u32) -> [u32; 16] {
    let mut out = [0; 16];
    let mut lanes = 0;
    while lanes < 16 {
        let mut lane = 0;
        while lane < 4 {
            out[lanes] |= (lanes as u32 >> lane & 1) << (places * lane);
            lane += 1;
        }
        lanes += 1;
    }
    out
}

/// Bit `4 p` for lane `p`: the texels of one level.
const ONE: [u32; 16] = apart(4);

/// Bit `8 p` for lane `p`: the texels of two levels.
const TWO: [u32; 16] = apart(8);

impl Footprint {
    /// Records quads in order from the lines of each lane's texels in two levels. The lanes of `two`, which are live, read both: first the
    /// texels of the one, then those of the other.
    #[inline(always)]
    fn squares(&mut self, mask: Mask, two: Mask, first: &[Square; LANES], second: &[Square; LANES]) {
        let (first, second) =
            (bytemuck::cast_ref::<_, [[Square; 4]; QUADS]>(first), bytemuck::cast_ref::<_, [[Square; 4]; QUADS]>(second));
        self.bounds[0] = self.lines.len() as u32;
        for q in 0..QUADS {
            let (live, twice) = ((mask >> (4 * q)) as usize & 15, (two >> (4 * q)) as usize & 15);
            self.operations[q] = (live.count_ones() + twice.count_ones()) as u16;
            let (one, other) = (&first[q], &second[q]);
            if twice == 0 {
                let mut left = ONE[live] * 0xf;
                while left != 0 {
                    let at = left.trailing_zeros() as usize;
                    let line = one.as_flattened()[at % 16];
                    self.lines.push(line);
                    left &= !equal([&one[0], &one[1], &one[2], &one[3]], line);
                }
            } else {
                let mut left = TWO[live] * 0xf | TWO[twice] * 0xf0;
                while left != 0 {
                    let at = left.trailing_zeros() as usize;
                    let level = if at & 4 == 0 { one } else { other };
                    let line = level.as_flattened()[at / 2 % 16 / 4 * 4 + at % 4];
                    self.lines.push(line);
                    let upper = equal([&one[0], &other[0], &one[1], &other[1]], line);
                    let lower = equal([&one[2], &other[2], &one[3], &other[3]], line);
                    left &= !(upper | lower << 16);
                }
            }
            self.bounds[q + 1] = self.lines.len() as u32;
        }
    }
}

/// Which of 16 texels lie in a line: a bit each. What the compiler makes of the plain loop below takes 3 to 6 % of the renderer's instructions
/// more.
#[inline(always)]
#[cfg(all(target_arch = "x86_64", not(portable)))]
fn equal(squares: [&Square; 4], line: u32) -> u32 {
    use std::arch::x86_64::*;
    #[target_feature(enable = "sse2")]
    #[inline]
    fn vectors(squares: [&Square; 4], line: u32) -> u32 {
        let line = _mm_set1_epi32(line as i32);
        let [a, b, c, d] = squares.map(|square| bytemuck::cast::<Square, __m128i>(*square));
        let upper = _mm_packs_epi32(_mm_cmpeq_epi32(a, line), _mm_cmpeq_epi32(b, line));
        let lower = _mm_packs_epi32(_mm_cmpeq_epi32(c, line), _mm_cmpeq_epi32(d, line));
        _mm_movemask_epi8(_mm_packs_epi16(upper, lower)) as u32
    }
    // SAFETY: every x86-64 host has SSE2, which is all that the function requires.
    unsafe { vectors(squares, line) }
}

/// Which of 16 texels lie in a line: a bit each.
#[inline(always)]
#[cfg(not(all(target_arch = "x86_64", not(portable))))]
fn equal(squares: [&Square; 4], line: u32) -> u32 {
    let mut out = 0;
    for (i, square) in squares.into_iter().enumerate() {
        for (t, texel) in square.iter().enumerate() {
            out |= u32::from(*texel == line) << (4 * i + t);
        }
    }
    out
}
