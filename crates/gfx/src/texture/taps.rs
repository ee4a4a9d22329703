//! The texels that a filter reads at one place of one level, with their weights.

use super::cube::{across_edge, project};
use super::sampler::{Axis, BORDER, linear, nearest};
use super::{Sample, Sampler, View};
use crate::state::ViewDimension;

/// Up to eight texels of a level.
#[derive(Clone, Copy)]
pub(super) struct Taps {
    pub count: usize,
    /// Column, row and slice (or layer); a column of [`BORDER`] is the border colour.
    pub texel: [[i32; 3]; 8],
    pub weight: [f32; 8],
}

impl Taps {
    const NONE: Taps = Taps { count: 0, texel: [[0; 3]; 8], weight: [0.0; 8] };

    #[inline(always)]
    fn push(&mut self, texel: [i32; 3], weight: f32) {
        self.texel[self.count] = if texel.contains(&BORDER) { [BORDER; 3] } else { texel };
        self.weight[self.count] = weight;
        self.count += 1;
    }
}

/// Where a lane samples: coordinates of the texture (on the face of a cube) and the layer (or face).
#[derive(Clone, Copy)]
pub(super) struct TexturePoint {
    pub coords: [f32; 3],
    pub slice: u32,
}

impl TexturePoint {
    /// The place of a lane. Array layers are rounded as integers already; they are clamped to those there are.
    #[inline(always)]
    pub(super) fn new(view: &View, args: &Sample<'_>, lane: usize) -> TexturePoint {
        let coords = args.coords.map(|c| c.f32()[lane]);
        let layer = args.layer.map_or(0, |l| l.i32()[lane].clamp(0, view.layers() as i32 - 1)) as u32;
        if view.is_cube() {
            let on = project(coords);
            let [s, t] = on.coordinates();
            TexturePoint { coords: [s, t, 0.0], slice: 6 * layer + on.face }
        } else {
            TexturePoint { coords, slice: layer }
        }
    }
}

/// The texels and weights of a place in a level.
#[inline(always)]
pub(super) fn taps(view: &View, sampler: &Sampler, level: usize, filter: bool, place: TexturePoint, offset: [i32; 3]) -> Taps {
    let [w, h, d] = view.levels[level].size;
    let [u, v, r] = place.coords;
    let mut out = Taps::NONE;
    if view.is_cube() {
        cube_taps(&mut out, filter, place, w);
        return out;
    }
    let one = |axis: usize, x: f32, n: u32| {
        if filter {
            linear(sampler.address[axis], x, n, offset[axis])
        } else {
            let i = nearest(sampler.address[axis], x, n, offset[axis]);
            Axis { first: i, second: i, weight: 0.0 }
        }
    };
    let x = one(0, u, w);
    let y = if view.dimension == ViewDimension::D1 { Axis { first: 0, second: 0, weight: 0.0 } } else { one(1, v, h) };
    let z = if view.dimension == ViewDimension::D3 {
        one(2, r, d)
    } else {
        let slice = place.slice as i32;
        Axis { first: slice, second: slice, weight: 0.0 }
    };
    if !filter {
        out.push([x.first, y.first, z.first], 1.0);
        return out;
    }
    let slices = if z.first == z.second { 1 } else { 2 };
    for (slice, share) in
        [(z.first, if slices == 1 { 1.0 } else { 1.0 - z.weight }), (z.second, z.weight)].into_iter().take(slices)
    {
        out.push([x.first, y.first, slice], (1.0 - x.weight) * (1.0 - y.weight) * share);
        out.push([x.second, y.first, slice], x.weight * (1.0 - y.weight) * share);
        out.push([x.first, y.second, slice], (1.0 - x.weight) * y.weight * share);
        out.push([x.second, y.second, slice], x.weight * y.weight * share);
    }
    out
}

/// The texels of a cube: always edge to edge over the faces (WebGPU has seamless cubes only), address modes and offsets aside.
#[inline(always)]
fn cube_taps(out: &mut Taps, filter: bool, place: TexturePoint, n: u32) {
    let (cube, face) = (place.slice / 6, place.slice % 6);
    let size = n as f32;
    // NaN, from a zero direction, becomes the middle.
    let [u, v, _] = place.coords.map(|c| if c.is_nan() { 0.5 } else { c.clamp(0.0, 1.0) });
    let last = n as i32 - 1;
    if !filter {
        let index = |c: f32| ((c * size) as i32).min(last);
        out.push([index(u), index(v), place.slice as i32], 1.0);
        return;
    }
    let (s, t) = (u * size - 0.5, v * size - 0.5);
    let (x, y) = (s.floor(), t.floor());
    let (wx, wy) = (s - x, t - y);
    let (x, y) = (x as i32, y as i32);
    let outside = |i: i32| i < 0 || i > last;
    let mut lost = 0.0;
    for (dx, dy, weight) in [(0, 0, (1.0 - wx) * (1.0 - wy)), (1, 0, wx * (1.0 - wy)), (0, 1, (1.0 - wx) * wy), (1, 1, wx * wy)]
    {
        let (x, y) = (x + dx, y + dy);
        if outside(x) && outside(y) {
            // Three faces meet here: there is no fourth texel, and its weight goes to the three others.
            lost = weight;
        } else {
            let (face, x, y) = across_edge(face, x, y, n as i32);
            out.push([x, y, (6 * cube + face) as i32], weight);
        }
    }
    if lost > 0.0 && out.count < 4 {
        let share = lost / out.count as f32;
        for weight in &mut out.weight[..out.count] {
            *weight += share;
        }
    }
}

/// The four texels of a gather in WGSL's order: (left, bottom), (right, bottom), (right, top), (left, top), v running down.
#[inline(always)]
pub(super) fn gather_taps(view: &View, sampler: &Sampler, place: TexturePoint, offset: [i32; 3]) -> [[i32; 3]; 4] {
    let [w, h, _] = view.levels[0].size;
    let [u, v, _] = place.coords;
    if view.is_cube() {
        let n = w as i32;
        let (cube, face) = (place.slice / 6, place.slice % 6);
        let base = |c: f32| if c.is_nan() { 0 } else { (c.clamp(0.0, 1.0) * w as f32 - 0.5).floor() as i32 };
        let (x, y) = (base(u), base(v));
        return [(0, 1), (1, 1), (1, 0), (0, 0)].map(|(dx, dy)| {
            let (x, y) = (x + dx, y + dy);
            let outside = |i: i32| i < 0 || i >= n;
            // At a corner the missing texel is the nearest one of the same face.
            let x = if outside(x) && outside(y) { x.clamp(0, n - 1) } else { x };
            let (face, x, y) = across_edge(face, x, y, n);
            [x, y, (6 * cube + face) as i32]
        });
    }
    let (x, y) = (linear(sampler.address[0], u, w, offset[0]), linear(sampler.address[1], v, h, offset[1]));
    let slice = place.slice as i32;
    [(x.first, y.second), (x.second, y.second), (x.second, y.first), (x.first, y.first)]
        .map(|(x, y)| if x == BORDER || y == BORDER { [BORDER; 3] } else { [x, y, slice] })
}
