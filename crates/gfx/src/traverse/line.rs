//! Coverage of lines and points.
//!
//! The rule for lines of one sample per pixel is OpenGL's and Vulkan's diamond exit: the diamond of a pixel with centre c is the
//! open set |x - cx| + |y - cy| < 1/2, and a line from p to q draws exactly the pixels whose diamond it leaves: those that the
//! segment meets and in which q does not lie. To settle every tie, p and q are both moved by (-e, -e^2) for an infinitesimal e
//! (in window coordinates, y down), or by (-e, e^2) where samples on horizontal edges belong to what is above them. On a line that is no steeper than 45 degrees this is Bresenham's one pixel per column: the
//! line meets a diamond exactly if it meets the diamond's vertical diagonal, because it is at most as steep as the sides. It is
//! computed with integers, without drift, so any part of a line can be walked on its own.

use crate::setup::{Bounds, Edge, Triangle};
use num::SUBPIXEL;

use super::{Block, Blocks, emit};

const HALF: i64 = (SUBPIXEL / 2) as i64;

/// Visits the pixels that a line draws.
#[inline(never)]
pub(super) fn diamond_exit<const S: usize>(line: &Triangle, bounds: Bounds, found: &mut Blocks<S>) {
    let start = line.start.map(i64::from);
    let d = [i64::from(line.edges[1].a), i64::from(line.edges[1].b)];
    // Along the major axis there is one pixel per step.
    let (major, minor) = if d[0].abs() >= d[1].abs() { (0, 1) } else { (1, 0) };
    let (dm, dn) = (d[major], d[minor]);
    let low = [bounds.x0, bounds.y0].map(i64::from);
    let high = [bounds.x1, bounds.y1].map(i64::from);
    let end = [start[0] + d[0], start[1] + d[1]];
    // Pixels further away than one from both ends cannot be touched; bounds are larger still.
    let from = low[major].max((start[major].min(end[major]) >> 8) - 1);
    let to = high[major].min((start[major].max(end[major]) >> 8) + 2);
    let mut rows = [0u64; 64];
    let (bx, by) = (i64::from(bounds.x0 & !7), i64::from(bounds.y0 & !7));
    for m in from..to {
        let center = m * 256 + HALF;
        // The minor coordinate at the centre's major one is num / |dm|; which pixel holds it?
        let (num, den) = if dm > 0 {
            (start[minor] * dm + dn * (center - start[major]), dm)
        } else {
            (start[minor] * -dm - dn * (center - start[major]), -dm)
        };
        // On a border between two pixels the perturbed line passes above or left of it, but for the x-major line that
        // descends: there the first-order term, the slope times e, outweighs the second-order -e^2.
        let on_border_next = major == 0 && if dn == 0 { line.lower_edges } else { (dn > 0) == (dm > 0) };
        let n = if on_border_next { num.div_euclid(den * 256) } else { (num - 1).div_euclid(den * 256) };
        if n < low[minor] || n >= high[minor] {
            continue;
        }
        let pixel = if major == 0 { [m, n] } else { [n, m] };
        let before = |p: [i64; 2]| before_exit(p, pixel, major, dm > 0, line.lower_edges);
        if before(start) && !before(end) {
            let (x, y) = (pixel[0] - bx, pixel[1] - by);
            let bit = 4 * ((x & 7) / 2 + 4 * ((y & 7) / 2)) + (x & 1) + 2 * (y & 1);
            rows[((y >> 3) * 8 + (x >> 3)) as usize] |= 1 << bit;
        }
    }
    for (i, &mask) in rows.iter().enumerate() {
        if mask != 0 {
            let (x, y) = (bx as u16 + 8 * (i as u16 & 7), by as u16 + 8 * (i as u16 >> 3));
            emit(Block { x, y, full: false, samples: [mask; S] }, found);
        }
    }
}

/// Whether the perturbed end point `p` of a line that crosses the pixel's diagonal lies before the place where the line
/// leaves the pixel's diamond.
#[inline(always)]
fn before_exit(p: [i64; 2], pixel: [i64; 2], major: usize, forward: bool, lower: bool) -> bool {
    let off = [p[0] - (pixel[0] * 256 + HALF), p[1] - (pixel[1] * 256 + HALF)];
    // On the near side of the diagonal, or beyond it and still in the diamond. Moving by (-e, -e^2) is towards the near side
    // when the line runs forward, and away from it when it runs back.
    // A point on the diagonal of a steep line is moved by e^2 alone.
    let back = if lower && major == 1 { off[1] < 0 } else { off[major] <= 0 };
    let near = back == forward;
    if near {
        return true;
    }
    let sum = off[0].abs() + off[1].abs();
    // On the diamond's border: e moves the point in, if it stands to the right of the centre; -e^2 never decides, since e does.
    let tie = if major == 0 { forward } else { off[0] > 0 };
    sum < HALF || (sum == HALF && tie)
}

/// The rectangle about a line, for multisampling and for lines of any width: its ends are square and at the vertices (Vulkan's
/// rectangular lines). The start and the side to the left hand of the direction belong to it, the end and the other side do not.
#[inline]
pub(super) fn rectangle(line: &Triangle) -> [Edge; 4] {
    let along = line.edges[1];
    let d = [along.a, along.b];
    // The distance from the line times its length: at most half the width times the length. With the root rounded down the test is still
    // exact, because the left side is a whole number.
    let base = line.base().map(|v| v * SUBPIXEL + SUBPIXEL / 2);
    let (x, y) = (i64::from(base[0] - line.start[0]), i64::from(base[1] - line.start[1]));
    let across = i64::from(d[0]) * y - i64::from(d[1]) * x;
    let half = u128::from(line.half_width);
    let square = line.area() as u128 * half * half;
    let root = square.isqrt() as i64;
    // Where the root is whole the border itself may hold samples; one of the two borders is then inside.
    [
        along,
        Edge { a: -d[0], b: -d[1], c: line.area() - along.c - 1 },
        Edge { a: -d[1], b: d[0], c: across + root },
        Edge { a: d[1], b: -d[0], c: root - across - i64::from(root as u128 * root as u128 == square) },
    ]
}

/// The square of side 1 about a point, for multisampling: `p - 1/2 <= s < p + 1/2`, by the top-left rule.
#[inline]
pub(super) fn square(point: &Triangle) -> [Edge; 4] {
    let base = point.base().map(|v| v * SUBPIXEL + SUBPIXEL / 2);
    let [x, y] = [i64::from(base[0] - point.start[0]), i64::from(base[1] - point.start[1])];
    [
        Edge { a: 1, b: 0, c: x + HALF },
        Edge { a: -1, b: 0, c: HALF - x - 1 },
        Edge { a: 0, b: 1, c: y + HALF },
        Edge { a: 0, b: -1, c: HALF - y - 1 },
    ]
}
