//! Meshes: vertices of position, normal and texture coordinates, and indices.

use std::f64::consts::TAU;

use fillrate::gfx::state::{VertexBufferLayout, VertexFormat};
use fillrate::num::BufferId;
use fillrate::trace::record::{self, Recorder};

use super::maths::*;

/// An indexed triangle list, counter-clockwise seen from outside.
#[derive(Default)]
pub struct Mesh {
    vertices: Vec<(V3, V3, [f64; 2])>,
    indices: Vec<u16>,
}

/// Buffers of a mesh on the card.
pub struct Solid {
    pub vertices: BufferId,
    pub indices: BufferId,
    pub count: u32,
}

impl Mesh {
    /// Adds the quadrilateral of a corner and two edges; the normal is the first edge cross the second.
    pub fn quad(&mut self, corner: V3, right: V3, up: V3, uv: [f64; 2]) {
        let base = self.vertices.len() as u16;
        let normal = normalize(cross(right, up));
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let position = add(corner, add(scale(right, a), scale(up, b)));
            self.vertices.push((position, normal, [a * uv[0], (1.0 - b) * uv[1]]));
        }
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| base + i));
    }

    /// The cube from -1 to 1; each face shows the whole texture.
    pub fn cube() -> Mesh {
        let mut mesh = Mesh::default();
        let axes = [[1., 0., 0.], [0., 1., 0.], [0., 0., 1.]];
        for (right, up) in [(0, 1), (1, 0), (1, 2), (2, 1), (2, 0), (0, 2)] {
            let normal = cross(axes[right], axes[up]);
            let (right, up) = (axes[right], axes[up]);
            let corner = sub(normal, add(right, up));
            mesh.quad(corner, scale(right, 2.0), scale(up, 2.0), [1.0, 1.0]);
        }
        mesh
    }

    /// The unit sphere, in slices around the y axis and stacks along it.
    pub fn sphere(slices: u16, stacks: u16) -> Mesh {
        let mut mesh = Mesh::default();
        for stack in 0..=stacks {
            for slice in 0..=slices {
                let (u, v) = (f64::from(slice) / f64::from(slices), f64::from(stack) / f64::from(stacks));
                let (turn, tilt) = (u * TAU, v * std::f64::consts::PI);
                let ring = libm::sin(tilt);
                let normal = [ring * libm::cos(turn), libm::cos(tilt), -ring * libm::sin(turn)];
                mesh.vertices.push((normal, normal, [u, v]));
            }
        }
        for stack in 0..stacks {
            for slice in 0..slices {
                let a = stack * (slices + 1) + slice;
                let b = a + slices + 1;
                mesh.indices.extend([a, b, b + 1, a, b + 1, a + 1]);
            }
        }
        mesh
    }

    /// Puts it on the card.
    pub fn upload(&self, card: &mut Recorder, label: &str) -> Solid {
        let mut bytes = Vec::new();
        for (position, normal, uv) in &self.vertices {
            bytes.extend(floats(position.iter().copied()));
            bytes.extend(normal.iter().chain(&[0.0]).flat_map(|&value| snorm16(value).to_le_bytes()));
            bytes.extend(floats(uv.iter().copied()));
        }
        let indices: Vec<u8> = self.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        Solid {
            vertices: card.create_buffer_init(&format!("{label}-vertices"), &bytes),
            indices: card.create_buffer_init(&format!("{label}-indices"), &indices),
            count: self.indices.len() as u32,
        }
    }

    /// The vertex buffer layout: position at location 0, normal at 1, texture coordinates at 2.
    pub fn layout() -> Option<VertexBufferLayout> {
        record::vertex_buffer(&[(0, VertexFormat::Float32x3), (1, VertexFormat::Snorm16x4), (2, VertexFormat::Float32x2)])
    }
}
