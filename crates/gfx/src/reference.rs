//! What a primitive covers, and what its fragments hold, by their definitions: slow, and written apart from setup, traversal and
//! interpolation, which are compared with it. Coverage is computed in whole numbers of any size and hence exactly; weights are
//! quotients of such numbers, rounded once to `f64`, and depth and perspective are sums of positive `f64` numbers.
//!
//! Positions are in 1/256 pixel, y down.

use num_bigint::{BigInt, Sign};
use num_traits::ToPrimitive;

/// A position in 1/256 pixel.
pub type Position = [i64; 2];

/// Places of the samples of a pixel, in 1/256 pixel from its left upper corner: the centre, or the standard four of Vulkan and
/// Direct3D, which are given in sixteenths.
///
/// # Panics
/// If `count` is neither 1 nor 4.
pub fn samples(count: u32) -> Vec<Position> {
    let sixteenths: &[Position] = match count {
        1 => &[[8, 8]],
        4 => &[[6, 2], [14, 6], [2, 10], [10, 14]],
        _ => panic!("pixels have 1 or 4 samples"),
    };
    sixteenths.iter().map(|&p| p.map(|v| v * 16)).collect()
}

/// Twice the signed area of a triangle: positive where b, c follow a clockwise on the screen.
fn cross(a: Position, b: Position, c: Position) -> BigInt {
    let d = |v: i64, w: i64| BigInt::from(v) - BigInt::from(w);
    d(b[0], a[0]) * d(c[1], a[1]) - d(b[1], a[1]) * d(c[0], a[0])
}

/// Whether the edge from a to b of a triangle whose third vertex is c is a top edge, horizontal and above c, or a left edge, not
/// horizontal and left of c: the edges whose own samples belong to the triangle.
fn is_top_or_left(a: Position, b: Position, c: Position) -> bool {
    let d = |v: i64, w: i64| BigInt::from(v) - BigInt::from(w);
    if a[1] == b[1] {
        return a[1] < c[1];
    }
    // At c's height the edge's line is at a.x + (c.y - a.y) (b.x - a.x) / (b.y - a.y). That is less than c.x:
    let (run, rise) = (d(c[1], a[1]) * d(b[0], a[0]), d(b[1], a[1]));
    let there = d(c[0], a[0]) * &rise;
    if rise.sign() == Sign::Plus { run < there } else { run > there }
}

/// Whether a triangle, of either winding, covers a sample: the sample is inside, or on edges all of which are top or left ones.
pub fn triangle_covers(v: [Position; 3], sample: Position) -> bool {
    let area = cross(v[0], v[1], v[2]);
    let zero = BigInt::ZERO;
    let [a, b, c] = if area < zero { [v[0], v[2], v[1]] } else { v };
    area != zero
        && [(a, b, c), (b, c, a), (c, a, b)].into_iter().all(|(a, b, c)| {
            let side = cross(a, b, sample);
            side > zero || side == zero && is_top_or_left(a, b, c)
        })
}

/// Whether a polygon that does not cross itself covers a sample: a ray from it to the right crosses the outline an odd number of
/// times. The sample is moved to the right by as little as decides ties, and down by even less: that is the top-left rule.
pub fn polygon_covers(polygon: &[Position], sample: Position) -> bool {
    let mut inside = false;
    for (i, &a) in polygon.iter().enumerate() {
        let b = polygon[(i + 1) % polygon.len()];
        if (a[1] <= sample[1]) == (b[1] <= sample[1]) {
            continue;
        }
        // The edge crosses the sample's row; it does so right of the sample if the sample is left of the edge, seen upwards.
        let (lower, upper) = if a[1] > b[1] { (a, b) } else { (b, a) };
        inside ^= cross(lower, upper, sample) < BigInt::ZERO;
    }
    inside
}

/// Weights of a triangle's vertices at a position, linear in the window: areas opposite to them over the triangle's.
pub fn weights(v: [Position; 3], at: Position) -> [f64; 3] {
    // Rounded once; beyond the range of `f64` the number is infinite.
    let number = |part: BigInt| part.to_f64().unwrap_or(f64::NAN);
    let area = number(cross(v[0], v[1], v[2]));
    [cross(v[1], v[2], at), cross(v[2], v[0], at), cross(v[0], v[1], at)].map(|part| number(part) / area)
}

/// Perspective-correct weights at a position, and 1/w there, from those of the vertices.
pub fn perspective(v: [Position; 3], inv_w: [f32; 3], at: Position) -> ([f64; 3], f64) {
    let linear = weights(v, at);
    let parts: [f64; 3] = std::array::from_fn(|i| linear[i] * f64::from(inv_w[i]));
    let sum = parts[0] + parts[1] + parts[2];
    (parts.map(|part| part / sum), sum)
}

/// Depth at a position: linear in the window.
pub fn depth(v: [Position; 3], z: [f32; 3], at: Position) -> f64 {
    let linear = weights(v, at);
    linear[0] * f64::from(z[0]) + linear[1] * f64::from(z[1]) + linear[2] * f64::from(z[2])
}

/// Whether a line draws a pixel under the diamond-exit rule: it meets the diamond of half-diagonal 1/2 about the pixel's centre, and
/// does not end in it. Both ends are moved to the left by as little as decides ties, and up by even less.
pub fn line_draws(from: Position, to: Position, pixel: Position) -> bool {
    // Numbers that decide are whole multiples of 1/2^96 or more (coordinates are far below 2^40, and all are products of at most two
    // differences over one); the first move is below that, and the second is to the first what the first is to 1.
    const E: usize = 96;
    let scale = |x: i64| BigInt::from(x) << (2 * E);
    let moved = |p: Position| [scale(p[0]) - (BigInt::from(1) << E), scale(p[1]) - BigInt::from(1)];
    let (p, q) = (moved(from), moved(to));
    let center = pixel.map(|v| scale(v * 256 + 128));
    let zero = BigInt::ZERO;
    // The part of the segment inside of all four sides of the diamond, from `low` to `high` as fractions of its length.
    let mut low: Option<(BigInt, BigInt)> = None;
    let mut high: Option<(BigInt, BigInt)> = None;
    let mut ends_inside = true;
    for (sx, sy) in [(1_i32, 1_i32), (1, -1), (-1, 1), (-1, -1)] {
        // f > 0 inside this side of the diamond; linear along the segment from f0 to f1.
        let f = |r: &[BigInt; 2]| -> BigInt { scale(128) - (&r[0] - &center[0]) * sx - (&r[1] - &center[1]) * sy };
        let (f0, f1) = (f(&p), f(&q));
        ends_inside &= f1 > zero;
        // The zero lies at t = f0 / (f0 - f1).
        if f0 == f1 {
            if f0 <= zero {
                return false;
            }
        } else if f0 > f1 {
            let (num, den) = (f0.clone(), f0 - f1);
            if high.as_ref().is_none_or(|(n, d)| &num * d < n * &den) {
                high = Some((num, den));
            }
        } else {
            let (num, den) = (-&f0, f1 - f0);
            if low.as_ref().is_none_or(|(n, d)| &num * d > n * &den) {
                low = Some((num, den));
            }
        }
    }
    // Some t with low < t < high and 0 <= t <= 1.
    let below_one = low.as_ref().is_none_or(|(n, d)| n < d);
    let above_zero = high.as_ref().is_none_or(|(n, _)| *n > zero);
    let open = match (&low, &high) {
        (Some((ln, ld)), Some((hn, hd))) => ln * hd < hn * ld,
        _ => true,
    };
    below_one && above_zero && open && !ends_inside
}

/// Whether the rectangle of width 1 about a line covers a sample: from the start on and before the end, and within half a
/// pixel on either side, the side of negative cross product included.
pub fn wide_line_covers(from: Position, to: Position, sample: Position) -> bool {
    let d = [0, 1].map(|i| BigInt::from(to[i] - from[i]));
    let s = [0, 1].map(|i| BigInt::from(sample[i] - from[i]));
    let along = &d[0] * &s[0] + &d[1] * &s[1];
    let across = &d[0] * &s[1] - &d[1] * &s[0];
    let length2 = &d[0] * &d[0] + &d[1] * &d[1];
    let (left, right) = (&across * &across, &length2 * (128 * 128));
    along >= BigInt::ZERO && along < length2 && (left < right || left == right && across < BigInt::ZERO)
}

/// Whether the square of side 1 about a point covers a sample.
pub fn wide_point_covers(point: Position, sample: Position) -> bool {
    (0..2).all(|i| sample[i] >= point[i] - 128 && sample[i] < point[i] + 128)
}
