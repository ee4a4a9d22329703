//! From clip space to the window: perspective division, viewport transform and snapping, once per vertex.

use crate::clip::ClipVertex;
use crate::state::Viewport;
use num::{Fx8, LANES, Lanes, SUBPIXEL};

/// A vertex in the window, as setup takes it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C)]
pub struct ScreenVertex {
    /// Window x in 1/256 pixel, to the right.
    pub x: Fx8,
    /// Window y in 1/256 pixel, down.
    pub y: Fx8,
    /// Window depth; inside the viewport's range unless depth clip is off.
    pub z: f32,
    /// 1/w, positive and normal.
    pub inv_w: f32,
}

/// The viewport transform.
///
/// With `h = width / 2` and `c = x + width / 2`: window x = `(clip.x / clip.w) * h + c`, every operation rounded to f32; y
/// likewise with the height, negated because window y points down; z = `(clip.z / clip.w) * (max - min) + min`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Screen {
    scale: [f32; 3],
    offset: [f32; 3],
}

/// The least 1/w: that of the greatest powers of two, so that sums of three stay normal numbers.
const INV_W_MIN: f32 = 1.0 / (1u128 << 124) as f32;

/// The greatest absolute depth of a vertex, reached only without depth clip.
const Z_MAX: f32 = (1u128 << 64) as f32;

/// As [`num::snap`], in a form that needs no rounding instruction and vectorises on every host.
#[inline(always)]
fn snap(pixels: f32) -> Fx8 {
    const LIMIT: f32 = (32768 * SUBPIXEL) as f32;
    let scaled = pixels * SUBPIXEL as f32;
    let low = if scaled > -LIMIT { scaled } else { -LIMIT };
    let clamped = if low < LIMIT - 1.0 { low } else { LIMIT - 1.0 };
    let kept = if scaled.is_nan() { 0.0 } else { clamped };
    // Adding 1.5 * 2^52 leaves no fraction bits: the addition itself rounds to nearest even, into the low word.
    (f64::from(kept) + 6_755_399_441_055_744.0).to_bits() as i32
}

impl Screen {
    /// The transform of a viewport.
    pub fn new(viewport: &Viewport) -> Screen {
        let (h, v) = (viewport.width * 0.5, viewport.height * 0.5);
        Screen {
            scale: [h, -v, viewport.max_depth - viewport.min_depth],
            offset: [viewport.x + h, viewport.y + v, viewport.min_depth],
        }
    }

    /// Transforms a position that passed clipping: `w` a positive normal number, inside the guard band. Anything else, NaN included, gives
    /// some vertex of the guard band too.
    #[inline(always)]
    pub fn vertex(&self, [x, y, z, w]: [f32; 4]) -> ScreenVertex {
        let window = |ndc: f32, axis: usize| ndc * self.scale[axis] + self.offset[axis];
        let z = window(z / w, 2);
        let z = if z > -Z_MAX { z } else { -Z_MAX };
        let inv_w = 1.0 / w;
        ScreenVertex {
            x: snap(window(x / w, 0)),
            y: snap(window(y / w, 1)),
            z: if z < Z_MAX { z } else { Z_MAX },
            inv_w: if inv_w > INV_W_MIN { inv_w } else { INV_W_MIN },
        }
    }

    /// Transforms a vertex of a clipped primitive.
    #[inline]
    pub fn clipped(&self, vertex: &ClipVertex) -> ScreenVertex {
        let scaled = self.vertex(vertex.position);
        // Cutting keeps the product in the range of normal numbers. By 1 it is exact, of the least 1/w too.
        ScreenVertex { inv_w: scaled.inv_w * vertex.unit, ..scaled }
    }

    /// A number with the sign of a triangle's area in the window, positive where the winding is clockwise there, from positions as the
    /// vertex stage leaves them: of triangles that have none once their corners are snapped, too. It is the determinant of their x, y
    /// and w (Olano and Greer 1997), whose sign is that of the visible part.
    pub fn area_sign(&self, [a, b, c]: &[[f32; 4]; 3]) -> f64 {
        let xyw = |v: &[f32; 4]| [v[0], v[1], v[3]].map(f64::from);
        let ([ax, ay, aw], [bx, by, bw], [cx, cy, cw]) = (xyw(a), xyw(b), xyw(c));
        let determinant = ax * (by * cw - bw * cy) + ay * (bw * cx - bx * cw) + aw * (bx * cy - by * cx);
        determinant * f64::from(self.scale[0].signum() * self.scale[1].signum())
    }

    /// Transforms the first positions (x, y, z, w) of a batch. Lanes whose vertex has to be clipped hold nothing of use.
    #[inline(always)]
    pub fn vertices<const N: usize>(&self, position: [&Lanes; 4], out: &mut [ScreenVertex; N]) {
        const { assert!(N <= LANES) };
        let [x, y, z, w] = position.map(Lanes::f32);
        for i in 0..N {
            out[i] = self.vertex([x[i], y[i], z[i], w[i]]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn areas_have_the_sign_of_their_winding_in_the_window() {
        let viewport = Viewport { x: 0.0, y: 0.0, width: 64.0, height: 64.0, min_depth: 0.0, max_depth: 1.0 };
        let corners = [[0.0, 0.0, 0.0, 1.0], [2.0, 0.0, 0.0, 2.0], [0.0, 0.5, 0.0, 0.5]];
        // Anticlockwise with y up, and as one sees it.
        assert!(Screen::new(&viewport).area_sign(&corners) < 0.0);
        let [a, b, c] = corners;
        assert!(Screen::new(&viewport).area_sign(&[a, c, b]) > 0.0);
        assert!(Screen::new(&Viewport { y: 64.0, height: -64.0, ..viewport }).area_sign(&corners) > 0.0);
        assert_eq!(Screen::new(&viewport).area_sign(&[a, b, b]), 0.0);
        // Too small for a step of 1/256 pixel.
        let small = [[0.5, 0.5, 0.0, 1.0], [0.500_001, 0.5, 0.0, 1.0], [0.5, 0.500_001, 0.0, 1.0]];
        let screen = Screen::new(&viewport);
        let snapped = small.map(|v| screen.vertex(v));
        assert!(snapped.iter().all(|v| (v.x, v.y) == (snapped[0].x, snapped[0].y)));
        assert!(screen.area_sign(&small) < 0.0);
    }

    #[test]
    fn snapping_is_that_of_num() {
        let mut values = vec![0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, f32::MIN_POSITIVE];
        for i in -200_000i32..200_000 {
            values.push(i as f32 / 1024.0);
        }
        for e in 0..23 {
            for f in [1.0f32, 1.5, 1.25, 1.9999999, 1.0000001] {
                values.extend([f * 2f32.powi(e - 8), -f * 2f32.powi(e - 8)]);
            }
        }
        values.extend([32767.998, 32768.0, -32768.0, -32768.01, 32767.996]);
        for v in values {
            assert_eq!(snap(v), num::snap(v), "{v}");
        }
    }

    #[test]
    fn corners_of_the_view_are_corners_of_the_viewport() {
        let viewport = Viewport { x: 10.0, y: 20.0, width: 300.0, height: 200.0, min_depth: 0.25, max_depth: 0.75 };
        let screen = Screen::new(&viewport);
        let v = screen.vertex([-3.0, 3.0, 0.0, 3.0]);
        assert_eq!((v.x, v.y, v.z), (10 * 256, 20 * 256, 0.25));
        let v = screen.vertex([3.0, -3.0, 3.0, 3.0]);
        assert_eq!((v.x, v.y, v.z), (310 * 256, 220 * 256, 0.75));
        assert_eq!(v.inv_w, 1.0 / 3.0);
    }
}
