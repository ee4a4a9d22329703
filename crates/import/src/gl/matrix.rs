//! Matrices in single precision, as OpenGL has them. Rotations, projections and inverses are computed in double precision and rounded once.
//!
//! With f32 only products of `Mat4` and functions of `Vec3` are used: glam computes these in the same order on every host. The order of the sum
//! in a dot product of `Vec4` depends on the host's vector instructions, so that of a plane and a point is computed by `DVec4`.

use std::f64::consts::PI;

use glam::dcamera::rh::proj::opengl;
use glam::{DMat3, DMat4, DVec3, DVec4, Mat3, Mat4, Vec4};

/// The product m * v.
pub fn transform(m: &Mat4, v: [f32; 4]) -> [f32; 4] {
    (*m * Vec4::from(v)).to_array()
}

/// The product of a row vector and a matrix: how planes are transformed by the inverse of the matrix of points.
pub fn transform_plane(plane: [f32; 4], m: &Mat4) -> [f32; 4] {
    transform(&m.transpose(), plane)
}

/// The equation of a plane at a point.
pub fn at_plane(plane: [f32; 4], point: [f32; 4]) -> f32 {
    DVec4::from(plane.map(f64::from)).dot(DVec4::from(point.map(f64::from))) as f32
}

/// The inverse, or none of a singular matrix.
pub fn inverse(m: &Mat4) -> Option<Mat4> {
    m.as_dmat4().try_inverse().map(|inverse| inverse.as_mat4())
}

/// Degrees up to which quarter turns are exact.
const TURNS: f64 = 36_000.0;

/// A rotation by degrees about an axis; the identity for an axis of no length. The angle has the precision of Mesa's, a float in radians: with
/// a large one a program turns by what is left of it.
pub fn rotation(degrees: f64, axis: [f64; 3]) -> Mat4 {
    let axis = DVec3::from(axis);
    let length = axis.length();
    if !(length > 0.0) {
        return Mat4::IDENTITY;
    }
    let degrees = f64::from(degrees as f32);
    // Quarter turns are exact. glam's are not: it finds a cosine of 6e-17.
    let (sine, cosine) = match degrees.rem_euclid(360.0) {
        90.0 if degrees.abs() <= TURNS => (1.0, 0.0),
        180.0 if degrees.abs() <= TURNS => (0.0, -1.0),
        270.0 if degrees.abs() <= TURNS => (-1.0, 0.0),
        _ => libm::sincos(f64::from((degrees * PI / 180.0) as f32)),
    };
    // Rodrigues' formula, for each axis of the coordinates.
    let k = axis / length;
    let turned = |v: DVec3| k * k.dot(v) * (1.0 - cosine) + v * cosine + k.cross(v) * sine;
    DMat4::from_mat3(DMat3::from_cols(turned(DVec3::X), turned(DVec3::Y), turned(DVec3::Z))).as_mat4()
}

/// `glFrustum`.
pub fn frustum([left, right, bottom, top, near, far]: [f64; 6]) -> Mat4 {
    opengl::frustum(left, right, bottom, top, near, far).as_mat4()
}

/// `glOrtho`.
pub fn ortho([left, right, bottom, top, near, far]: [f64; 6]) -> Mat4 {
    opengl::orthographic(left, right, bottom, top, near, far).as_mat4()
}

/// The matrix that takes normals to eye space: the transposed inverse of the upper left 3x3 part.
pub fn normal_matrix(modelview: &Mat4) -> Mat3 {
    let linear = Mat3::from_mat4(*modelview).as_dmat3();
    linear.try_inverse().map_or(Mat3::IDENTITY, |inverse| inverse.transpose().as_mat3())
}

/// The factor of `GL_RESCALE_NORMAL`: 1 over the length of the third row of the inverse (OpenGL 1.5, section 2.11.3).
pub fn normal_scale(modelview: &Mat4) -> f32 {
    let length = normal_matrix(modelview).transpose().row(2).length();
    if length > 0.0 { 1.0 / length } else { 1.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec3, vec3};

    #[test]
    fn an_inverse_undoes_its_matrix() {
        let m = frustum([-1.0, 2.0, -1.0, 1.0, 1.0, 50.0]) * rotation(33.0, [1.0, 2.0, -0.5]);
        let m = m * Mat4::from_translation(vec3(3.0, -4.0, 5.0));
        let one = m * inverse(&m).expect("a regular matrix");
        assert!(one.abs_diff_eq(Mat4::IDENTITY, 1e-5), "{one:?}");
        assert_eq!(inverse(&Mat4::from_scale(vec3(1.0, 0.0, 1.0))), None);
    }

    #[test]
    fn rotations_turn_counter_clockwise() {
        let [x, y, z, w] = transform(&rotation(90.0, [0.0, 0.0, 2.0]), [1.0, 0.0, 0.0, 1.0]);
        assert_eq!([x, y, z, w], [0.0, 1.0, 0.0, 1.0]);
        let [x, y, ..] = transform(&rotation(-30.0, [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0, 1.0]);
        assert!((x - 0.866_025_4).abs() < 1e-6 && (y + 0.5).abs() < 1e-6);
    }

    #[test]
    fn large_angles_are_those_of_a_float_in_radians() {
        for degrees in [2.3e8_f64, 1.7e9, -9.0e8] {
            let radians = (degrees * PI / 180.0) as f32;
            let [x, y, ..] = transform(&rotation(degrees, [0.0, 0.0, 1.0]), [1.0, 0.0, 0.0, 1.0]);
            assert!((x - radians.cos()).abs() < 1e-6 && (y - radians.sin()).abs() < 1e-6, "{degrees}: {x} {y}");
            assert!((f64::from(y) - degrees.to_radians().sin()).abs() > 1e-3, "{degrees}: the angle in doubles is another");
        }
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
        let m = rotation(20.0, [0.3, 1.0, 0.2]) * Mat4::from_scale(vec3(1.0, 4.0, 0.5));
        let normal = normal_matrix(&m) * vec3(1.0, 1.0, 0.0);
        let tangent: Vec3 = m.transform_vector3(vec3(1.0, -1.0, 0.0));
        assert!(tangent.dot(normal).abs() < 1e-5);
    }
}
