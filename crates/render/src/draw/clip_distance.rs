//! Clipping to the distances that a vertex stage writes.

use gfx::clip::{Clipped, Polygon};

use super::vertex::Vertices;

/// Clips a triangle, `clipped` being what the view volume left of it.
pub fn triangle(
    vertices: &Vertices,
    v: [u32; 3],
    position: &[[f32; 4]; 3],
    clipped: Clipped,
    polygon: &mut Polygon,
) -> Clipped {
    apply(vertices, &v, position, clipped, polygon)
}

/// Clips a line, `clipped` being what the view volume left of it.
pub fn line(vertices: &Vertices, v: [u32; 2], position: &[[f32; 4]; 2], clipped: Clipped, polygon: &mut Polygon) -> Clipped {
    apply(vertices, &v, position, clipped, polygon)
}

fn apply(vertices: &Vertices, v: &[u32], position: &[[f32; 4]], mut clipped: Clipped, polygon: &mut Polygon) -> Clipped {
    let n = vertices.distance_stride;
    for plane in 0..n {
        if clipped == Clipped::Rejected {
            break;
        }
        let mut distance = [0.0; 3];
        for (d, &v) in distance.iter_mut().zip(v) {
            *d = vertices.distances[v as usize * n + plane];
        }
        // NaN is outside.
        let inside = distance[..v.len()].iter().filter(|d| **d >= 0.0).count();
        if inside == v.len() {
            continue;
        }
        if inside == 0 {
            return Clipped::Rejected;
        }
        if clipped == Clipped::Whole {
            polygon.set(position);
        }
        clipped = if polygon.cut(distance, v.len() == 3) { Clipped::Cut } else { Clipped::Rejected };
    }
    clipped
}
