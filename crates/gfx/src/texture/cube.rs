//! Cube maps: from directions to faces, and across the edges of faces.

/// A direction's face and its place on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct OnFace {
    /// +x -x +y -y +z -z.
    pub face: u32,
    /// Along the face's s axis, unscaled: in [-ma, ma].
    pub sc: f32,
    /// Along the face's t axis, unscaled.
    pub tc: f32,
    /// Magnitude of the major coordinate.
    pub ma: f32,
}

/// The face that a direction meets: the axis of the largest coordinate; z before y before x where equal (Vulkan, "Cube Map Face
/// Selection").
#[inline(always)]
pub(super) fn face_of(d: [f32; 3]) -> u32 {
    let [x, y, z] = d;
    let (ax, ay, az) = (x.abs(), y.abs(), z.abs());
    if az >= ax && az >= ay {
        4 + u32::from(z < 0.0)
    } else if ay >= ax {
        2 + u32::from(y < 0.0)
    } else {
        u32::from(x < 0.0)
    }
}

/// A vector in the axes (s, t, major) of a face; the major coordinate is positive for directions that meet the face.
#[inline(always)]
pub(super) fn to_face<T: Copy + std::ops::Neg<Output = T>>(face: u32, d: [T; 3]) -> [T; 3] {
    let [x, y, z] = d;
    match face {
        0 => [-z, -y, x],
        1 => [z, -y, -x],
        2 => [x, z, y],
        3 => [x, -z, -y],
        4 => [x, -y, z],
        _ => [-x, -y, -z],
    }
}

/// The inverse of [`to_face`].
#[inline(always)]
pub(super) fn from_face<T: Copy + std::ops::Neg<Output = T>>(face: u32, f: [T; 3]) -> [T; 3] {
    let [s, t, m] = f;
    match face {
        0 => [m, -t, -s],
        1 => [-m, -t, s],
        2 => [s, m, t],
        3 => [s, -m, -t],
        4 => [s, -t, m],
        _ => [-s, -t, -m],
    }
}

/// Projects a direction onto its face. A zero or NaN direction gives the middle of a face.
#[inline(always)]
pub(super) fn project(d: [f32; 3]) -> OnFace {
    let face = face_of(d);
    let [sc, tc, ma] = to_face(face, d);
    OnFace { face, sc, tc, ma }
}

impl OnFace {
    /// The place on the face in [0, 1].
    #[inline(always)]
    pub(super) fn coordinates(self) -> [f32; 2] {
        let scale = 0.5 / self.ma;
        [self.sc * scale + 0.5, self.tc * scale + 0.5]
    }

    /// The derivative of the coordinates for a derivative of the direction (the quotient rule; Vulkan, "Cube Map Derivative
    /// Transformation").
    #[inline(always)]
    pub(super) fn derivative(self, d: [f32; 3]) -> [f32; 2] {
        let [ds, dt, dm] = to_face(self.face, d);
        let scale = 0.5 / (self.ma * self.ma);
        [(self.ma * ds - self.sc * dm) * scale, (self.ma * dt - self.tc * dm) * scale]
    }
}

/// The texel that lies beyond an edge of a face of `n` texels: `x` or `y`, but not both, may be -1 or `n`. Integer arithmetic in
/// half texels about the cube's centre: the coordinate beyond the edge becomes the major one, and the old major one lies in the
/// last texel of the neighbouring face.
#[inline(always)]
pub(super) fn across_edge(face: u32, x: i32, y: i32, n: i32) -> (u32, i32, i32) {
    let inside = |i: i32| i >= 0 && i < n;
    if inside(x) && inside(y) {
        return (face, x, y);
    }
    let half = |i: i32| 2 * i + 1 - n;
    let (s, t) = (half(x), half(y));
    // Beyond the edge is major with magnitude n; the face's own axis steps back to the centre of the neighbour's edge texel.
    let d = from_face(face, [s.clamp(-n, n), t.clamp(-n, n), n - 1]);
    let on_edge = |c: i32| c == n || c == -n;
    let neighbour = if on_edge(d[0]) {
        u32::from(d[0] < 0)
    } else if on_edge(d[1]) {
        2 + u32::from(d[1] < 0)
    } else {
        4 + u32::from(d[2] < 0)
    };
    let [s, t, _] = to_face(neighbour, d);
    let whole = |h: i32| ((h + n - 1) / 2).clamp(0, n - 1);
    (neighbour, whole(s), whole(t))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faces_and_directions_are_inverse() {
        for face in 0..6 {
            for f in [[3.0, -2.0, 5.0], [-1.0, 4.0, 7.0]] {
                let d = from_face(face, f);
                assert_eq!(face_of(d), face);
                assert_eq!(to_face(face, d), f);
            }
        }
        // Vulkan's table: +x has s = -z, t = -y.
        let on = project([2.0, 1.0, -1.0]);
        assert_eq!((on.face, on.coordinates()), (0, [0.75, 0.25]));
        assert_eq!(face_of([1.0, 1.0, 1.0]), 4);
        assert_eq!(face_of([1.0, -1.0, 0.5]), 3);
    }

    #[test]
    fn texels_beyond_an_edge_are_neighbours_in_space() {
        for n in [1, 2, 4, 7] {
            for face in 0..6 {
                for j in 0..n {
                    for (x, y) in [(-1, j), (n, j), (j, -1), (j, n)] {
                        let (other, u, v) = across_edge(face, x, y, n);
                        assert_ne!(other, face);
                        assert!((0..n).contains(&u) && (0..n).contains(&v));
                        // Both texels touch the same piece of the shared edge: their centres are half a texel from it.
                        let h = |i: i32| 2 * i + 1 - n;
                        let a = from_face(face, [h(x.clamp(0, n - 1)), h(y.clamp(0, n - 1)), n]);
                        let b = from_face(other, [h(u), h(v), n]);
                        let apart: Vec<i32> = (0..3).map(|i| (a[i] - b[i]).abs()).filter(|d| *d != 0).collect();
                        assert_eq!(apart, [1, 1], "{n} {face} {x} {y}");
                        // And back again.
                        assert_eq!(across_edge(face, x.clamp(0, n - 1), y.clamp(0, n - 1), n).0, face);
                    }
                }
            }
        }
    }

    #[test]
    fn derivatives_match_differences() {
        let d = [0.3_f32, -0.8, 0.5];
        let step = [1e-3_f32, 2e-3, -1e-3];
        let on = project(d);
        let moved = project([d[0] + step[0], d[1] + step[1], d[2] + step[2]]);
        let (a, b) = (on.coordinates(), moved.coordinates());
        let exact = on.derivative(step);
        for i in 0..2 {
            assert!((b[i] - a[i] - exact[i]).abs() < 1e-5);
        }
    }
}
