//! Painter's algorithm: three triangles that overlap in a cycle, drawn whole or cut along the planes of each other.

use anyhow::Result;

use super::kit::{COLORED, Draw, Kit, Pass};
use super::shapes::{Corner, area, center, clip, covers};
use super::{Scene, SceneRun};
use crate::Row;
use crate::harness::funnel;
use gfx::format::Format;
use gfx::state::Compare;
use trace::Trace;

pub(super) const PAINTER: Scene = Scene {
    name: "painter",
    group: "Order",
    what: "Three triangles that overlap in a cycle, drawn whole without depths, in all six orders. Every picture is the last triangle that covers a pixel, and \
           the pixels that are wrong are those in which rational arithmetic finds another one nearest.",
    fault: "the pictures are drawn with a depth test",
    play: painter,
};

pub(super) const BSP: Scene = Scene {
    name: "bsp",
    group: "Order",
    what: "The same triangles cut by a BSP tree, their pieces snapped to 1/256 pixel and drawn from back to front without depths: no pixel is wrong.",
    fault: "one node of the tree is walked from front to back",
    play: bsp,
};

const SIZE: [u32; 2] = [128, 128];
const COLORS: [[u8; 3]; 3] = [[255, 0, 0], [0, 255, 0], [0, 0, 255]];
const BACKGROUND: [u8; 3] = [0, 0, 0];

/// A corner with its depth in units of 2^-16: x, y, z.
type Point = [i64; 3];

/// Three bars, each over the next at one end and below the one before at the other.
const BARS: [[Point; 3]; 3] = [
    [[2_307, 6_203, 8_192], [30_011, 13_317, 57_344], [30_208, 6_000, 57_344]],
    [[29_001, 3_001, 8_192], [14_502, 30_103, 57_344], [22_003, 31_005, 57_344]],
    [[20_007, 31_003, 8_192], [6_009, 2_011, 57_344], [2_013, 9_017, 57_344]],
];

fn corner(point: Point) -> Corner {
    [point[0], point[1]]
}

/// The depth of a triangle at a point as a fraction, with a positive denominator.
fn depth(triangle: &[Point; 3], p: Corner) -> (i128, i128) {
    let [a, b, c] = triangle.map(corner);
    let weights = [area(b, c, p), area(c, a, p), area(a, b, p)];
    let sum: i128 = (0..3).map(|k| i128::from(weights[k]) * i128::from(triangle[k][2])).sum();
    let all = i128::from(area(a, b, c));
    if all < 0 { (-sum, -all) } else { (sum, all) }
}

/// The nearest triangle that covers a point.
fn nearest(p: Corner) -> Option<usize> {
    let behind = |&a: &usize, &b: &usize| {
        let ((n, d), (m, e)) = (depth(&BARS[a], p), depth(&BARS[b], p));
        (n * e).cmp(&(m * d))
    };
    (0..3).filter(|&which| covers(BARS[which].map(corner), p)).min_by(behind)
}

fn vertices(triangle: &[Point; 3], which: usize) -> Vec<f32> {
    let color = COLORS[which].map(|code| f32::from(code) / 255.0);
    let vertex = |p: &Point| [clip(corner(*p), SIZE, p[2] as f32 / 65_536.0), [color[0], color[1], color[2], 1.0]].concat();
    triangle.iter().flat_map(vertex).collect()
}

const ORDERS: [[usize; 3]; 6] = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];

fn drawn(orders: &[Vec<([Point; 3], usize)>], compare: Option<Compare>) -> Trace {
    let mut kit = Kit::new("painter");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    for order in orders {
        let pass = Pass {
            color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))],
            depth: compare.map(|_| (depth, Some((1.0, 0)))),
            ..Pass::default()
        };
        let all: Vec<f32> = order.iter().flat_map(|(triangle, which)| vertices(triangle, *which)).collect();
        let draw = Draw::list(COLORED, 2, all);
        kit.pass(&pass, &[if let Some(compare) = compare { draw.depth(Format::Depth32Float, compare) } else { draw }]);
        kit.present(target);
    }
    kit.finish()
}

fn colour(which: Option<usize>) -> [u8; 3] {
    which.map_or(BACKGROUND, |which| COLORS[which])
}

fn whole(order: &[usize]) -> Vec<([Point; 3], usize)> {
    order.iter().map(|&which| (BARS[which], which)).collect()
}

fn painter(stage: &mut SceneRun) -> Result<()> {
    let orders: Vec<_> = ORDERS.iter().map(|order| whole(order)).collect();
    let frames = stage.show(&drawn(&orders, stage.fault().then_some(Compare::Less)))?;
    let (mut unlike, mut wrong, mut least) = (0, [0; 2], u64::MAX);
    for (frame, order) in frames.iter().zip(ORDERS) {
        let last = |x, y| order.into_iter().rev().find(|&which| covers(BARS[which].map(corner), center(x, y)));
        unlike += frame.wrong(|x, y| colour(last(x, y)));
        let found = frame.wrong(|x, y| colour(nearest(center(x, y))));
        let expected = frame.places().filter(|&(x, y)| last(x, y) != nearest(center(x, y))).count() as u64;
        wrong[0] += expected;
        wrong[1] += found;
        least = least.min(expected);
    }
    stage.row(Row::none("pixels that are not the last triangle's", unlike));
    stage.row(Row::exact("pixels that hide the nearest triangle, of all six orders", wrong[0] as f64, wrong[1] as f64));
    stage.row(Row::at_least("of the best order", 1.0, least as f64));
    if !stage.fault() {
        question(stage)?;
    }
    Ok(())
}

/// What the order of draws saves: eight full layers, front to back and back to front.
fn question(stage: &mut SceneRun) -> Result<()> {
    let layer = |z: i64| [[0, 0, z], [65_536, 0, z], [0, 65_536, z]];
    let layers = |front: bool| -> Vec<([Point; 3], usize)> {
        (0..8).map(|k| (layer(4_096 * if front { 1 + k } else { 8 - k }), (k % 3) as usize)).collect()
    };
    let [front, back] = [true, false].map(|front| drawn(&[layers(front)], Some(Compare::Less)));
    let pixels = f64::from(SIZE[0] * SIZE[1]);
    let [(fast, near), (slow, far)] = [stage.time(&front, &[])?, stage.time(&back, &[])?];
    let [near, far] = [funnel(&near)?.fragments_shaded as f64, funnel(&far)?.fragments_shaded as f64];
    stage.row(Row::exact("fragments shaded of eight layers, front to back", pixels, near));
    stage.row(Row::exact("fragments shaded of eight layers, back to front", 8.0 * pixels, far));
    stage.row(Row::at_least("cycles that front to back saves", 1.0, slow - fast));
    let answer =
        format!("Eight layers from front to back shade {near} fragments in {fast} cycles, from back to front {far} in {slow}.");
    stage.answer("What does the order of draws save?", answer);
    Ok(())
}

/// A convex polygon in f64, with the triangle that it is part of.
type Piece = (Vec<[f64; 2]>, usize);

/// By how much triangle `a` is behind triangle `b` at a point.
fn behind(a: usize, b: usize, [x, y]: [f64; 2]) -> f64 {
    let plane = |which: usize| {
        let [p, q, r] = BARS[which].map(|point| point.map(|c| c as f64));
        let area = |a: [f64; 2], b: [f64; 2], c: [f64; 2]| (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        let [a, b, c] = [p, q, r].map(|p| [p[0], p[1]]);
        let at = [x, y];
        (area(b, c, at) * p[2] + area(c, a, at) * q[2] + area(a, b, at) * r[2]) / area(a, b, c)
    };
    plane(a) - plane(b)
}

/// The part of a polygon in which a function is positive.
fn clipped(polygon: &[[f64; 2]], side: impl Fn([f64; 2]) -> f64) -> Vec<[f64; 2]> {
    let mut out = Vec::new();
    for (at, &from) in polygon.iter().enumerate() {
        let to = polygon[(at + 1) % polygon.len()];
        let (a, b) = (side(from), side(to));
        if a >= 0.0 {
            out.push(from);
        }
        if (a > 0.0 && b < 0.0) || (a < 0.0 && b > 0.0) {
            let t = a / (a - b);
            out.push([0, 1].map(|k| from[k] + t * (to[k] - from[k])));
        }
    }
    if out.len() < 3 { Vec::new() } else { out }
}

/// Pieces from back to front: the first is the node.
fn walked(pieces: &[Piece], turned: bool) -> Vec<Piece> {
    let Some((node, rest)) = pieces.split_first() else { return Vec::new() };
    let part = |sign: f64| -> Vec<Piece> {
        let of = |(polygon, which): &Piece| (clipped(polygon, |p| sign * behind(*which, node.1, p)), *which);
        rest.iter().map(of).filter(|(polygon, _)| !polygon.is_empty()).collect()
    };
    let [far, near] = [part(1.0), part(-1.0)].map(|side| walked(&side, false));
    let [first, last] = if turned { [near, far] } else { [far, near] };
    [first, vec![node.clone()], last].concat()
}

fn bsp(stage: &mut SceneRun) -> Result<()> {
    let pieces: Vec<Piece> = (0..3).map(|which| (BARS[which].map(|p| [p[0] as f64, p[1] as f64]).to_vec(), which)).collect();
    let mut triangles = Vec::new();
    for (polygon, which) in walked(&pieces, stage.fault()) {
        let snapped: Vec<Point> = polygon.iter().map(|p| [p[0].round() as i64, p[1].round() as i64, 32_768]).collect();
        triangles.extend((2..snapped.len()).map(|k| ([snapped[0], snapped[k - 1], snapped[k]], which)));
    }
    let frames = stage.show(&drawn(&[triangles.clone()], None))?;
    stage.row(Row::at_least("triangles after cutting", 4.0, triangles.len() as f64));
    stage.row(Row::none("pixels that hide the nearest triangle", frames[0].wrong(|x, y| colour(nearest(center(x, y))))));
    if !stage.fault() {
        let (cut, pieces) = stage.time(&drawn(&[triangles.clone()], None), &[])?;
        let (depth, bars) = stage.time(&drawn(&[whole(&[0, 1, 2])], Some(Compare::Less)), &[])?;
        // Where little is hidden, cycles are those of writing the depths.
        let [pieces, bars] = [funnel(&pieces)?, funnel(&bars)?].map(|counts| counts.fragments_shaded as f64);
        stage.row(Row::at_least("fragments that the depth buffer saves", 1.0, pieces - bars));
        let answer = format!(
            "{} pieces without depths take {cut} cycles, three triangles with a depth buffer {depth}.",
            triangles.len()
        );
        stage.answer("Is a BSP tree cheaper than a depth buffer?", answer);
    }
    Ok(())
}
