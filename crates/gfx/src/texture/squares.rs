//! The lines that a linear filter reads of a flat texture of any format: those of the four texels about each lane's place.
//!
//! Places are found by the arithmetic of [`super::fast`], all lanes at once. A line is the sum of what a column and a row say, so that a few
//! comparisons tell which quads read one line alone. Of the 16 texels of any other quad (32 between two levels) the distinct lines are taken
//! out one after another: each is compared with all texels at once, which leaves those of other lines.

use fearless_simd::{prelude::*, u32x4, u32x8, u64x2};

use super::fast::{QuadLevels, choose, fold, following, is_flat, pair, place};
use super::lod::quad_rho;
use super::record::Footprint;
use super::{Lod, Sample, Sampler, View};
use crate::simd::{Simd, dispatch, inlined};
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
        dispatch!(simd => record_body(simd, view, sampler, args, found, mask, out));
    }
    applies
}

#[inline(always)]
fn record_body<V: Simd>(
    simd: V,
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
        out.squares(simd, mask, 0, first, first, lines);
    } else {
        level.iter_mut().for_each(|level| *level = following(view, *level));
        find(view, sampler, args, same, layers, &level, second);
        out.squares(simd, mask, two, first, second, lines);
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

    /// The quads that read one line alone, whichever of their lanes are live: bit `4 q` each.
    #[inline(always)]
    fn alike<V: Simd>(&self, simd: V) -> Mask {
        let mut equal: Mask = 0;
        for chunk in 0..LANES / 8 {
            let of = inlined(
                #[inline(always)]
                |lanes: &[u32; LANES]| u32x8::simd_from(simd, lanes.as_chunks().0[chunk]),
            );
            let (left, right) = (of(&self.x[0]), of(&self.x[1]));
            let (upper, lower) = (of(&self.y[0]), of(&self.y[1]));
            // All lanes of a quad have one line if each has that of the next.
            let line = upper + left;
            let different = (left ^ right) | (upper ^ lower) | (line ^ line.slide_within_blocks::<1>(line));
            equal |= different.simd_eq(0).to_bitmask() << (8 * chunk);
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

impl Footprint {
    /// Records quads in order from the lines of each lane's texels in two levels. The lanes of `two`, which are live, read both: first the
    /// texels of the one, then those of the other.
    #[inline(always)]
    fn squares<V: Simd>(&mut self, simd: V, mask: Mask, two: Mask, first: &Corners, second: &Corners, lines: &mut [u32; MOST]) {
        let mut alike = first.alike(simd);
        if two != 0 {
            alike &= second.alike(simd);
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
                n = distinct(simd, [first, second], q, wanted, lines, n);
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
#[inline(always)]
fn distinct<V: Simd>(simd: V, levels: [&Corners; 2], q: usize, mut left: u32, lines: &mut [u32; MOST], mut n: usize) -> usize {
    // The lines of the four texels of each lane in a level.
    let texels = inlined(
        #[inline(always)]
        |corners: &Corners| -> [u32x4<V>; 4] {
            let of = inlined(
                #[inline(always)]
                |lanes: &[u32; LANES]| u32x4::simd_from(simd, lanes.as_chunks().0[q]),
            );
            let (left, right) = (of(&corners.x[0]), of(&corners.x[1]));
            let (upper, lower) = (of(&corners.y[0]), of(&corners.y[1]));
            let (a, b) = (upper + left).interleave(upper + right);
            let (c, d) = (lower + left).interleave(lower + right);
            let [a, b, c, d]: [u64x2<V>; 4] = [a.bitcast(), b.bitcast(), c.bitcast(), d.bitcast()];
            [a.zip_low(c).bitcast(), a.zip_high(c).bitcast(), b.zip_low(d).bitcast(), b.zip_high(d).bitcast()]
        },
    );
    let ([a, b, c, d], [e, f, g, h]) = (texels(levels[0]), texels(levels[1]));
    let lanes: [u32x8<V>; 4] = [a.combine(e), b.combine(f), c.combine(g), d.combine(h)];
    let [a, b, c, d] = lanes;
    let words: [[u32; 8]; 4] = [a.into(), b.into(), c.into(), d.into()];
    while left != 0 {
        let at = left.trailing_zeros() as usize;
        let line = words[at / 8 % 4][at % 8];
        lines[n % MOST] = line;
        n += 1;
        let equal = inlined(
            #[inline(always)]
            |lane: u32x8<V>| lane.simd_eq(line).to_bitmask() as u32,
        );
        left &= !(equal(a) | equal(b) << 8 | equal(c) << 16 | equal(d) << 24);
    }
    n
}

#[cfg(test)]
mod tests {
    use super::*;
    use num::Random;

    #[test]
    fn quads_have_the_distinct_lines_of_their_texels() {
        let base = crate::simd::base();
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
            one.squares(base, mask, two, &first, &second, &mut room[0].lines);
            dispatch!(simd => other.squares(simd, mask, two, &first, &second, &mut room[1].lines));
            assert_eq!((&one.lines, one.bounds, one.operations), (&other.lines, other.bounds, other.operations));
            for q in 0..QUADS {
                let (lines, operations) = one.quad(q);
                let mut wanted = Vec::new();
                for lane in 4 * q..4 * q + 4 {
                    for (corners, _) in [(&first, mask), (&second, two)].into_iter().filter(|(_, live)| live >> lane & 1 == 1) {
                        for texel in 0..4 {
                            let line = corners.y[texel / 2][lane].wrapping_add(corners.x[texel % 2][lane]);
                            if !wanted.contains(&line) {
                                wanted.push(line);
                            }
                        }
                    }
                }
                assert_eq!(lines, wanted);
                assert_eq!(lines.is_empty(), operations == 0);
                most = most.max(lines.len());
            }
        }
        assert!(most > 8, "no quad of both levels had many lines");
    }
}
