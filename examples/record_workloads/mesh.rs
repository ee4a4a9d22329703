//! The geometry and textures of the four speed workloads, byte for byte as their definition states them: only + - * / and
//! square roots in f64, and integer arithmetic; W4 also uses sines and cosines.

use std::f64::consts::TAU;

use fillrate::num::hash;
use glam::{DVec3, dvec3};

/// Width of the frame in pixels.
pub const WIDTH: u32 = 1920;
/// Height of the frame in pixels.
pub const HEIGHT: u32 = 1080;

/// Bytes of a vertex: f32 position x 4, f32 texture coordinates x 2, u8 colour x 4, f32 normal x 3.
pub const STRIDE: u64 = 40;

/// A vertex.
#[derive(Clone, Copy, Default)]
pub struct Vertex {
    pub position: [f32; 4],
    pub uv: [f32; 2],
    pub color: [u8; 4],
    pub normal: [f32; 3],
}

/// An indexed triangle list.
pub struct Mesh {
    pub vertices: Vec<Vertex>,
    pub indices: Vec<u32>,
}

impl Mesh {
    pub fn vertex_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::with_capacity(self.vertices.len() * STRIDE as usize);
        for vertex in &self.vertices {
            vertex.position.iter().chain(&vertex.uv).for_each(|v| bytes.extend(v.to_le_bytes()));
            bytes.extend(vertex.color);
            vertex.normal.iter().for_each(|v| bytes.extend(v.to_le_bytes()));
        }
        bytes
    }

    pub fn index_bytes(&self) -> Vec<u8> {
        self.indices.iter().flat_map(|index| index.to_le_bytes()).collect()
    }
}

/// Uniform in [0, 1) with 24 bits, by seed, index and channel.
fn u01(seed: u32, index: u32, channel: u32) -> f64 {
    let inner = hash(seed.wrapping_mul(0x9E37_79B9).wrapping_add(index));
    f64::from(hash(inner.wrapping_add(channel.wrapping_mul(0x85EB_CA6B))) >> 8) / 16_777_216.0
}

fn ndc_x(x: f64) -> f64 {
    x / 960.0 - 1.0
}

fn ndc_y(y: f64) -> f64 {
    1.0 - y / 540.0
}

/// W1: 1,002,528 small flat triangles that cover every pixel once.
pub fn w1() -> Mesh {
    const N: u32 = 708;
    let (cell_width, cell_height) = (1920.0 / f64::from(N), 1080.0 / f64::from(N));
    let mut vertices = Vec::new();
    for j in 0..=N {
        for i in 0..=N {
            let k = j * (N + 1) + i;
            let inside = |at: u32| at > 0 && at < N;
            let jitter_x = if inside(i) { (u01(1, k, 0) - 0.5) * 0.5 } else { 0.0 };
            let jitter_y = if inside(j) { (u01(1, k, 1) - 0.5) * 0.5 } else { 0.0 };
            let [r, g, b, _] = hash(0xC0104 + k).to_le_bytes();
            vertices.push(Vertex {
                position: [
                    ndc_x((f64::from(i) + jitter_x) * cell_width) as f32,
                    ndc_y((f64::from(j) + jitter_y) * cell_height) as f32,
                    ((0.2 + 0.6 * u01(1, k, 2)) * 2.0 - 1.0) as f32,
                    1.0,
                ],
                color: [r, g, b, 255],
                ..Vertex::default()
            });
        }
    }
    let mut indices = Vec::new();
    for j in 0..N {
        for i in 0..N {
            let a = j * (N + 1) + i;
            let (b, c, d) = (a + 1, a + N + 1, a + N + 2);
            indices.extend([a, c, b, b, c, d]);
        }
    }
    Mesh { vertices, indices }
}

/// W2: whole-screen perspective triangles, 100 of them in the definition.
pub fn w2(triangles: u32) -> Mesh {
    let mut vertices = Vec::new();
    for t in 0..triangles {
        let w = [1.0, 2.0 + 4.0 * u01(2, t, 0), 2.0 + 4.0 * u01(2, t, 1)];
        let (offset_u, offset_v) = (u01(2, t, 2), u01(2, t, 3));
        let (x, y) = ([-1.0, 3.0, -1.0], [-1.0, -1.0, 3.0]);
        let u = [0.0, 1.2 * 2.0 * 1920.0 / 1024.0 * w[1], 0.0];
        let v = [0.0, 0.0, 1.2 * 2.0 * 1080.0 / 1024.0 * w[2]];
        for k in 0..3 {
            vertices.push(Vertex {
                position: [(x[k] * w[k]) as f32, (y[k] * w[k]) as f32, 0.0, w[k] as f32],
                uv: [(u[k] + offset_u) as f32, (v[k] + offset_v) as f32],
                color: [255; 4],
                ..Vertex::default()
            });
        }
    }
    Mesh { indices: (0..vertices.len() as u32).collect(), vertices }
}

/// W3: 100,000 separate textured triangles of 50 pixels each.
pub fn w3() -> Mesh {
    const T: u32 = 100_000;
    const S3: f64 = 0.866_025_403_784_438_6;
    let radius = (50.0 * 4.0 / (3.0 * 3.0f64.sqrt())).sqrt();
    let mut vertices = Vec::new();
    for t in 0..T {
        let (center_x, center_y) = (8.0 + 1904.0 * u01(3, t, 0), 8.0 + 1064.0 * u01(3, t, 1));
        let (mut dx, mut dy) = (u01(3, t, 2) * 2.0 - 1.0, u01(3, t, 3) * 2.0 - 1.0);
        let mut length = (dx * dx + dy * dy).sqrt();
        if length < 1e-3 {
            (dx, dy, length) = (1.0, 0.0, 1.0);
        }
        dx = dx / length * radius;
        dy = dy / length * radius;
        let ox = [dx, -0.5 * dx - S3 * dy, -0.5 * dx + S3 * dy];
        let oy = [dy, S3 * dx - 0.5 * dy, -S3 * dx - 0.5 * dy];
        let (z, u, v) = (u01(3, t, 4), u01(3, t, 5), u01(3, t, 6));
        for k in 0..3 {
            let q = 3 * t + k as u32;
            let w = 1.0 + 0.5 * u01(33, q, 0);
            let depth = z * 0.9 + 0.1 * u01(33, q, 1);
            let [r, g, b, _] = hash(0xC0304 + q).to_le_bytes();
            vertices.push(Vertex {
                position: [
                    (ndc_x(center_x + ox[k]) * w) as f32,
                    (ndc_y(center_y + oy[k]) * w) as f32,
                    ((depth * 2.0 - 1.0) * w) as f32,
                    w as f32,
                ],
                uv: [(u + ox[k] / 512.0) as f32, (v + oy[k] / 512.0) as f32],
                color: [r, g, b, 255],
                ..Vertex::default()
            });
        }
    }
    Mesh { indices: (0..vertices.len() as u32).collect(), vertices }
}

/// W4: a torus knot (2, 3) of 70,000 triangles that share vertices. Sines and cosines are the C library's, as in the
/// definition: on another host the last bits of a few coordinates may differ.
pub fn w4() -> Mesh {
    const NU: u32 = 1400;
    const NV: u32 = 25;

    let mut vertices = Vec::new();
    for i in 0..NU {
        let curve = |nudge: f64| {
            let u = TAU * (f64::from(i) + nudge) / f64::from(NU);
            let r = 2.0 + (3.0 * u).cos();
            dvec3(r * (2.0 * u).cos() * 1.35, r * (2.0 * u).sin(), -(3.0 * u).sin() * 0.8)
        };
        let (here, next) = (curve(0.0), curve(0.01));
        let tangent = next - here;
        let binormal = tangent.cross(next + here);
        let normal = unit(binormal.cross(tangent));
        let binormal = unit(binormal);
        for j in 0..NV {
            let angle = TAU * f64::from(j) / f64::from(NV);
            let (c, s) = (angle.cos(), angle.sin());
            let out = c * normal + s * binormal;
            let [x, y, z] = (here + 0.62 * out).to_array().map(|v| v as f32);
            vertices.push(Vertex {
                position: [x, y, z, 1.0],
                color: [255; 4],
                normal: out.to_array().map(|v| v as f32),
                ..Vertex::default()
            });
        }
    }
    let mut indices = Vec::new();
    for i in 0..NU {
        for j in 0..NV {
            let (i1, j1) = ((i + 1) % NU, (j + 1) % NV);
            let (a, b, c, d) = (i * NV + j, i1 * NV + j, i * NV + j1, i1 * NV + j1);
            indices.extend([a, c, b, c, d, b]);
        }
    }
    Mesh { vertices, indices }
}

/// Of length 1. The definition divides; `DVec3::normalize` multiplies by the reciprocal, and last bits differ.
fn unit(v: DVec3) -> DVec3 {
    v / v.length()
}

/// The camera of W4 in columns, with GL's clip volume: z from -w to w.
pub fn w4_camera() -> [f32; 16] {
    let f = 1.0 / libm::tan(45.0 * 0.5 * std::f64::consts::PI / 180.0);
    let (aspect, near, far, eye) = (1920.0 / 1080.0, 1.0, 20.0, 6.2);
    let slope = (far + near) / (near - far);
    let mut m = [0.0f32; 16];
    m[0] = (f / aspect) as f32;
    m[5] = f as f32;
    m[10] = slope as f32;
    m[11] = -1.0;
    m[14] = (2.0 * far * near / (near - far) - eye * slope) as f32;
    m[15] = eye as f32;
    m
}

/// A square RGBA8 texture: blocks and texels of noise, and a checkerboard in blue.
pub fn texture(size: u32, seed: u32) -> Vec<u8> {
    let mut texels = Vec::with_capacity((size * size * 4) as usize);
    for y in 0..size {
        for x in 0..size {
            let block = hash(seed.wrapping_add((y >> 3) * 4096 + (x >> 3)));
            let texel = hash(seed.wrapping_mul(77).wrapping_add(y * size + x));
            let checker = ((x >> 5) ^ (y >> 5)) & 1 == 1;
            let red = ((block & 255) + (texel & 255)) >> 1;
            let green = ((block >> 8 & 255) * 3 + (texel >> 8 & 255)) >> 2;
            let blue = if checker { 255 - (texel >> 16 & 63) } else { block >> 16 & 127 };
            texels.extend([red as u8, green as u8, blue as u8, 255]);
        }
    }
    texels
}

/// The next smaller level: means of 2x2 texels, halves rounded up.
pub fn next_level(texels: &[u8], size: u32) -> Vec<u8> {
    let (size, half) = (size as usize, size as usize / 2);
    let mut out = Vec::with_capacity(half * half * 4);
    for y in 0..half {
        for x in 0..half {
            for c in 0..4 {
                let at = |dx: usize, dy: usize| u32::from(texels[((2 * y + dy) * size + 2 * x + dx) * 4 + c]);
                out.push(((at(0, 0) + at(1, 0) + at(0, 1) + at(1, 1) + 2) >> 2) as u8);
            }
        }
    }
    out
}
