//! Matrices in single precision, columns first, as OpenGL has them. What is transcendental comes from `libm`.

/// A 4x4 matrix: element `[4 * column + row]`.
pub type Matrix = [f32; 16];

/// The identity.
pub const IDENTITY: Matrix = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];

/// The product a * b.
pub fn product(a: &Matrix, b: &Matrix) -> Matrix {
    std::array::from_fn(|k| {
        let (column, row) = (k / 4, k % 4);
        a[row] * b[4 * column]
            + a[4 + row] * b[4 * column + 1]
            + a[8 + row] * b[4 * column + 2]
            + a[12 + row] * b[4 * column + 3]
    })
}

/// The product m * v.
pub fn transform(m: &Matrix, v: [f32; 4]) -> [f32; 4] {
    std::array::from_fn(|row| m[row] * v[0] + m[4 + row] * v[1] + m[8 + row] * v[2] + m[12 + row] * v[3])
}

/// The product of a row vector and a matrix: how planes are transformed by the inverse of the matrix of points.
pub fn transform_plane(plane: [f32; 4], m: &Matrix) -> [f32; 4] {
    std::array::from_fn(|column| (0..4).map(|row| plane[row] * m[4 * column + row]).sum())
}

/// The transpose.
pub fn transpose(m: &Matrix) -> Matrix {
    std::array::from_fn(|k| m[4 * (k % 4) + k / 4])
}

/// The inverse, or none of a singular matrix. Gauss-Jordan elimination in double precision with partial pivoting.
pub fn inverse(m: &Matrix) -> Option<Matrix> {
    let mut rows: [[f64; 8]; 4] = std::array::from_fn(|row| {
        std::array::from_fn(|k| if k < 4 { f64::from(m[4 * k + row]) } else { f64::from(u8::from(k - 4 == row)) })
    });
    for column in 0..4 {
        let pivot = (column..4).max_by(|&a, &b| rows[a][column].abs().total_cmp(&rows[b][column].abs()))?;
        rows.swap(column, pivot);
        let factor = rows[column][column];
        if factor == 0.0 || !factor.is_finite() {
            return None;
        }
        rows[column] = rows[column].map(|value| value / factor);
        for other in 0..4 {
            if other != column {
                let factor = rows[other][column];
                for k in 0..8 {
                    rows[other][k] -= factor * rows[column][k];
                }
            }
        }
    }
    Some(std::array::from_fn(|k| rows[k % 4][4 + k / 4] as f32))
}

/// A rotation by degrees about an axis; the identity for an axis of no length.
pub fn rotation(degrees: f64, axis: [f64; 3]) -> Matrix {
    let length = (axis[0] * axis[0] + axis[1] * axis[1] + axis[2] * axis[2]).sqrt();
    if !(length > 0.0) {
        return IDENTITY;
    }
    let [x, y, z] = axis.map(|component| component / length);
    // Quarter turns are exact.
    let (sine, cosine) = match degrees.rem_euclid(360.0) {
        90.0 => (1.0, 0.0),
        180.0 => (0.0, -1.0),
        270.0 => (-1.0, 0.0),
        _ => libm::sincos(degrees.to_radians()),
    };
    let rest = 1.0 - cosine;
    [
        x * x * rest + cosine,
        y * x * rest + z * sine,
        x * z * rest - y * sine,
        0.0,
        x * y * rest - z * sine,
        y * y * rest + cosine,
        y * z * rest + x * sine,
        0.0,
        x * z * rest + y * sine,
        y * z * rest - x * sine,
        z * z * rest + cosine,
        0.0,
        0.0,
        0.0,
        0.0,
        1.0,
    ]
    .map(|value| value as f32)
}

/// `glFrustum`.
pub fn frustum([left, right, bottom, top, near, far]: [f64; 6]) -> Matrix {
    let (w, h, d) = (right - left, top - bottom, far - near);
    let mut m = [0.0; 16];
    m[0] = 2.0 * near / w;
    m[5] = 2.0 * near / h;
    m[8] = (right + left) / w;
    m[9] = (top + bottom) / h;
    m[10] = -(far + near) / d;
    m[11] = -1.0;
    m[14] = -2.0 * far * near / d;
    m.map(|value| value as f32)
}

/// `glOrtho`.
pub fn ortho([left, right, bottom, top, near, far]: [f64; 6]) -> Matrix {
    let (w, h, d) = (right - left, top - bottom, far - near);
    let mut m = [0.0; 16];
    m[0] = 2.0 / w;
    m[5] = 2.0 / h;
    m[10] = -2.0 / d;
    m[12] = -(right + left) / w;
    m[13] = -(top + bottom) / h;
    m[14] = -(far + near) / d;
    m[15] = 1.0;
    m.map(|value| value as f32)
}

/// A translation.
pub fn translation(by: [f32; 3]) -> Matrix {
    let mut m = IDENTITY;
    m[12..15].copy_from_slice(&by);
    m
}

/// A scaling.
pub fn scaling(by: [f32; 3]) -> Matrix {
    let mut m = IDENTITY;
    (m[0], m[5], m[10]) = (by[0], by[1], by[2]);
    m
}

/// The matrix that takes normals to eye space: the transposed inverse of the upper left 3x3 part, as three columns.
pub fn normal_matrix(modelview: &Matrix) -> [[f32; 4]; 3] {
    let linear: Matrix = std::array::from_fn(|k| if k % 4 == 3 || k / 4 == 3 { IDENTITY[k] } else { modelview[k] });
    let m = transpose(&inverse(&linear).unwrap_or(IDENTITY));
    std::array::from_fn(|column| [m[4 * column], m[4 * column + 1], m[4 * column + 2], 0.0])
}

/// A vector of length 1 in this direction; zero stays zero.
pub fn normalized(v: [f32; 3]) -> [f32; 3] {
    let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
    if length > 0.0 { v.map(|component| component / length) } else { v }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_inverse_undoes_its_matrix() {
        let m = product(&frustum([-1.0, 2.0, -1.0, 1.0, 1.0, 50.0]), &rotation(33.0, [1.0, 2.0, -0.5]));
        let m = product(&m, &translation([3.0, -4.0, 5.0]));
        let one = product(&m, &inverse(&m).expect("a regular matrix"));
        for (value, wanted) in one.iter().zip(IDENTITY) {
            assert!((value - wanted).abs() < 1e-5, "{one:?}");
        }
        assert_eq!(inverse(&scaling([1.0, 0.0, 1.0])), None);
    }

    #[test]
    fn rotations_turn_counter_clockwise() {
        let [x, y, z, w] = transform(&rotation(90.0, [0.0, 0.0, 2.0]), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!([x, y, z, w], [0.0, 1.0, 0.0, 1.0]);
        let [x, y, ..] = transform(&rotation(-30.0, [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0, 1.0]);
        assert!((x - 0.866_025_4).abs() < 1e-6 && (y + 0.5).abs() < 1e-6);
    }

    #[test]
    fn the_near_and_far_planes_become_minus_one_and_one() {
        let m = frustum([-1.0, 1.0, -1.0, 1.0, 2.0, 10.0]);
        for (z, wanted) in [(-2.0, -1.0), (-10.0, 1.0)] {
            let [_, _, z, w] = transform(&m, [0.0, 0.0, z, 1.0]);
            assert!((z / w - wanted).abs() < 1e-6);
        }
    }

    #[test]
    fn normals_stay_perpendicular() {
        let m = product(&rotation(20.0, [0.3, 1.0, 0.2]), &scaling([1.0, 4.0, 0.5]));
        let columns = normal_matrix(&m);
        let normal: [f32; 3] = std::array::from_fn(|row| columns[0][row] + columns[1][row]);
        let [x, y, z, _] = transform(&m, [1.0, -1.0, 0.0, 0.0]);
        assert!((x * normal[0] + y * normal[1] + z * normal[2]).abs() < 1e-5);
    }
}
