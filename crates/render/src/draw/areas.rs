//! The counts of a survey: the pixels that primitives are expected to cover, without traversal, and the tiles that it looks at.
//!
//! A primitive covers that share of the pixel centres in its box which its area has of the box. A convex shape of n centres in w columns and h rows,
//! anywhere on a grid of square cells of side s, meets (n + (s - 1) (w + h) + (s - 1)²) / s² cells on average (Santaló, Integral Geometry and
//! Geometric Probability, 1976, chapter 8: the area of its Minkowski sum with a cell, whose outer centres are s - 1 apart).

use gfx::setup::{Bounds, ScreenVertex};
use num::SUBPIXEL;
use work::Areas;

/// Vertices of a triangle cut by the sides of a rectangle, at most: 7 of a convex polygon. Where rounding makes one that is not, a cut
/// adds half as many as there are: 4, 6, 9, 13.
const MOST: usize = 13;

/// Whether a survey looks at a tile, by its column and row: one in four of each row and column of tiles.
pub fn surveys([x, y]: [u32; 2]) -> bool {
    x % 4 == [0, 2, 1, 3][y as usize % 4]
}

/// A shape of `fragments` fragments, in columns and rows of pixels.
fn of(fragments: f64, bounds: Bounds) -> Areas {
    let around = f64::from(bounds.x1 - bounds.x0) + f64::from(bounds.y1 - bounds.y0);
    let cells = |side: f64| {
        let apart = side - 1.0;
        (fragments + apart * around + apart * apart) / (side * side)
    };
    // Every quad has a fragment.
    let quads = cells(2.0).min(fragments);
    let fixed = |v: f64| (v * 256.0).round() as u64;
    Areas { fragments: fixed(fragments), quads: fixed(quads), blocks: fixed(cells(8.0).min(quads)), visible: 0 }
}

/// A filled triangle, as far as it lies within its bounds.
#[inline(never)]
pub fn of_triangle(screen: &[ScreenVertex; 3], bounds: Bounds) -> Areas {
    let pixels = |v: i32| f64::from(v) / f64::from(SUBPIXEL);
    let corners = screen.map(|v| [pixels(v.x), pixels(v.y)]);
    let [low, high] = [[bounds.x0, bounds.y0], [bounds.x1, bounds.y1]].map(|corner| corner.map(f64::from));
    let extent = |axis: usize| {
        let along = corners.map(|corner| corner[axis]);
        [along.iter().copied().fold(f64::MAX, f64::min), along.iter().copied().fold(f64::MIN, f64::max)]
    };
    let ([left, right], [top, bottom]) = (extent(0), extent(1));
    // Bounds hold whole pixels: they cut off less than one where nothing else does.
    let inside = left > low[0] - 1.0 && top > low[1] - 1.0 && right < high[0] + 1.0 && bottom < high[1] + 1.0;
    if !inside {
        return of(area_within(&corners, low, high), bounds);
    }
    let (whole, centres) = ((right - left) * (bottom - top), (high[0] - low[0]) * (high[1] - low[1]));
    // Where vertices are snapped to one column or row the triangle has no area.
    of(area(&corners) * centres / whole.max(f64::MIN_POSITIVE), bounds)
}

/// A line or point: as many pixels as its bounds are long.
pub fn of_thin(bounds: Bounds) -> Areas {
    of((bounds.x1 - bounds.x0).max(bounds.y1 - bounds.y0).into(), bounds)
}

/// The area of a polygon.
fn area(polygon: &[[f64; 2]]) -> f64 {
    let [x0, y0] = polygon[0];
    let twice: f64 = polygon.windows(2).map(|p| (p[0][0] - x0) * (p[1][1] - y0) - (p[1][0] - x0) * (p[0][1] - y0)).sum();
    twice.abs() / 2.0
}

/// The area of a triangle within a rectangle, whose sides cut it one after the other (Sutherland and Hodgman, Reentrant Polygon Clipping, 1974).
fn area_within(corners: &[[f64; 2]; 3], low: [f64; 2], high: [f64; 2]) -> f64 {
    let mut polygon = [[0.0; 2]; MOST];
    polygon[..3].copy_from_slice(corners);
    let mut n = 3;
    for (axis, side, sign) in [(0, low[0], 1.0), (1, low[1], 1.0), (0, high[0], -1.0), (1, high[1], -1.0)] {
        let (mut cut, mut m) = ([[0.0; 2]; MOST], 0);
        let inside = |p: [f64; 2]| sign * (p[axis] - side);
        for at in 0..n {
            let (from, to) = (polygon[at], polygon[(at + 1) % n]);
            let (a, b) = (inside(from), inside(to));
            if a >= 0.0 {
                cut[m] = from;
                m += 1;
            }
            if (a >= 0.0) != (b >= 0.0) {
                let t = a / (a - b);
                cut[m] = [from[0] + t * (to[0] - from[0]), from[1] + t * (to[1] - from[1])];
                m += 1;
            }
        }
        (polygon, n) = (cut, m);
        if n == 0 {
            return 0.0;
        }
    }
    area(&polygon[..n])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rectangle_cuts_triangles() {
        let within = |corners| area_within(&corners, [0.0, 0.0], [10.0, 4.0]);
        assert_eq!(within([[1.0, 1.0], [3.0, 1.0], [1.0, 3.0]]), 2.0);
        assert_eq!(within([[-50.0, -50.0], [100.0, -50.0], [-50.0, 100.0]]), 40.0);
        assert_eq!(within([[-4.0, 0.0], [4.0, 0.0], [-4.0, 8.0]]), 8.0);
        assert_eq!(within([[20.0, 0.0], [30.0, 0.0], [20.0, 9.0]]), 0.0);
    }
}
