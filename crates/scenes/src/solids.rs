//! Meshes: vertices of position, normal and texture coordinates, and indices.

use std::f64::consts::TAU;

use gfx::state::{VertexBufferLayout, VertexFormat};
use num::BufferId;
use trace::record::{self, Recorder};

use crate::maths::*;

/// An indexed triangle list, counter-clockwise seen from outside.
#[derive(Default)]
pub struct Mesh {
    vertices: Vec<(DVec3, DVec3, [f64; 2])>,
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
    pub fn quad(&mut self, corner: DVec3, right: DVec3, up: DVec3, uv: [f64; 2]) {
        let base = self.vertices.len() as u16;
        let normal = right.cross(up).normalize();
        for (a, b) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let position = corner + (right * a + up * b);
            self.vertices.push((position, normal, [a * uv[0], (1.0 - b) * uv[1]]));
        }
        self.indices.extend([0, 1, 2, 0, 2, 3].map(|i| base + i));
    }

    /// Adds a triangle, counter-clockwise seen from outside.
    pub fn triangle(&mut self, corners: [DVec3; 3], uv: [[f64; 2]; 3]) {
        let base = self.vertices.len() as u16;
        let normal = (corners[1] - corners[0]).cross(corners[2] - corners[0]).normalize();
        self.vertices.extend((0..3).map(|i| (corners[i], normal, uv[i])));
        self.indices.extend([base, base + 1, base + 2]);
    }

    /// A profile of distances from the y axis and heights, from below, turned around it in slices; a ring of no radius is a tip.
    pub fn turned(profile: &[(f64, f64)], slices: u16) -> Mesh {
        let mut mesh = Mesh::default();
        for (ring, pair) in profile.windows(2).enumerate() {
            let [(r0, y0), (r1, y1)] = [pair[0], pair[1]];
            let (base, v) = (mesh.vertices.len() as u16, ring as f64 / 2.0);
            for slice in 0..=slices {
                let turn = TAU * f64::from(slice) / f64::from(slices);
                let (c, s) = (libm::cos(turn), libm::sin(turn));
                let normal = dvec3((y1 - y0) * c, r0 - r1, -(y1 - y0) * s).normalize();
                let u = 2.0 * f64::from(slice) / f64::from(slices);
                mesh.vertices.push((dvec3(r0 * c, y0, -r0 * s), normal, [u, v + 0.5]));
                mesh.vertices.push((dvec3(r1 * c, y1, -r1 * s), normal, [u, v]));
            }
            for slice in 0..slices {
                let a = base + 2 * slice;
                if r0 > 0.0 {
                    mesh.indices.extend([a, a + 2, a + 1]);
                }
                if r1 > 0.0 {
                    mesh.indices.extend([a + 1, a + 2, a + 3]);
                }
            }
        }
        mesh
    }

    /// The cube from -1 to 1; each face shows the whole texture.
    pub fn cube() -> Mesh {
        let mut mesh = Mesh::default();
        let (x, y, z) = (DVec3::X, DVec3::Y, DVec3::Z);
        for (right, up) in [(x, y), (y, x), (y, z), (z, y), (z, x), (x, z)] {
            let corner = right.cross(up) - (right + up);
            mesh.quad(corner, right * 2.0, up * 2.0, [1.0, 1.0]);
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
                let normal = dvec3(ring * libm::cos(turn), libm::cos(tilt), -ring * libm::sin(turn));
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
            bytes.extend(floats(position.to_array()));
            bytes.extend(normal.extend(0.0).to_array().iter().flat_map(|&value| snorm16(value).to_le_bytes()));
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
