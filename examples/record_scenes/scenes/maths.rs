//! Vectors, matrices and hashes, in f64 and with the same result on every host.

pub type V3 = [f64; 3];
/// Columns.
pub type M4 = [[f64; 4]; 4];

pub fn add(a: V3, b: V3) -> V3 {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

pub fn sub(a: V3, b: V3) -> V3 {
    [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
}

pub fn scale(a: V3, by: f64) -> V3 {
    a.map(|v| v * by)
}

pub fn dot(a: V3, b: V3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

pub fn cross(a: V3, b: V3) -> V3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

pub fn normalize(a: V3) -> V3 {
    scale(a, 1.0 / dot(a, a).sqrt())
}

pub fn mul(a: M4, b: M4) -> M4 {
    std::array::from_fn(|c| std::array::from_fn(|r| (0..4).map(|k| a[k][r] * b[c][k]).sum()))
}

pub fn translation(by: V3) -> M4 {
    [[1., 0., 0., 0.], [0., 1., 0., 0.], [0., 0., 1., 0.], [by[0], by[1], by[2], 1.]]
}

/// A rotation about a unit axis, in radians, counter-clockwise when the axis points at the viewer.
pub fn rotation(axis: V3, angle: f64) -> M4 {
    let (s, c) = (libm::sin(angle), libm::cos(angle));
    let [x, y, z] = axis;
    let t = 1.0 - c;
    [
        [t * x * x + c, t * x * y + s * z, t * x * z - s * y, 0.],
        [t * x * y - s * z, t * y * y + c, t * y * z + s * x, 0.],
        [t * x * z + s * y, t * y * z - s * x, t * z * z + c, 0.],
        [0., 0., 0., 1.],
    ]
}

pub fn scaling(by: V3) -> M4 {
    [[by[0], 0., 0., 0.], [0., by[1], 0., 0.], [0., 0., by[2], 0.], [0., 0., 0., 1.]]
}

/// A camera at `eye` that looks at `target`, y up.
pub fn look_at(eye: V3, target: V3) -> M4 {
    let forward = normalize(sub(target, eye));
    let right = normalize(cross(forward, [0., 1., 0.]));
    let up = cross(right, forward);
    [
        [right[0], up[0], -forward[0], 0.],
        [right[1], up[1], -forward[1], 0.],
        [right[2], up[2], -forward[2], 0.],
        [-dot(right, eye), -dot(up, eye), dot(forward, eye), 1.],
    ]
}

/// A perspective projection to depth 0 to 1; the vertical field of view is in degrees.
pub fn perspective(field: f64, aspect: f64, near: f64, far: f64) -> M4 {
    let f = 1.0 / libm::tan(field * std::f64::consts::PI / 360.0);
    [[f / aspect, 0., 0., 0.], [0., f, 0., 0.], [0., 0., far / (near - far), -1.], [0., 0., near * far / (near - far), 0.]]
}

/// A parallel projection of a box, x and y symmetric, to depth 0 to 1.
pub fn orthographic(width: f64, height: f64, near: f64, far: f64) -> M4 {
    [[2. / width, 0., 0., 0.], [0., 2. / height, 0., 0.], [0., 0., 1. / (near - far), 0.], [0., 0., near / (near - far), 1.]]
}

/// Numbers as little-endian f32.
pub fn floats(values: impl IntoIterator<Item = f64>) -> Vec<u8> {
    values.into_iter().flat_map(|value| (value as f32).to_le_bytes()).collect()
}

/// A matrix as little-endian f32, column after column.
pub fn matrix(m: M4) -> Vec<u8> {
    floats(m.into_iter().flatten())
}

/// An integer hash.
pub fn hash(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Uniform in [0, 1), by seed, index and channel.
pub fn uniform(seed: u32, index: u32, channel: u32) -> f64 {
    f64::from(hash(hash(hash(seed).wrapping_add(index)).wrapping_add(channel)) >> 8) / 16_777_216.0
}

/// A signed normalised 16-bit code, rounded to nearest.
pub fn snorm16(value: f64) -> i16 {
    (value.clamp(-1.0, 1.0) * 32_767.0).round() as i16
}

/// An unsigned normalised 16-bit code, rounded to nearest.
pub fn unorm16(value: f64) -> u16 {
    (value.clamp(0.0, 1.0) * 65_535.0).round() as u16
}

/// An unsigned normalised 8-bit code, rounded to nearest.
pub fn unorm8(value: f64) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round() as u8
}
