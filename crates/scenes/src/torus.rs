//! A torus of 2,880 triangles whose index buffer is recorded in three orders. Triangles and vertices are the same, only the order in which
//! triangles are drawn differs: so does what a cache of shaded vertices can save.

use std::f64::consts::TAU;

use trace::record::Recorder;

use crate::knot::{Shot, shown, vertex};
use crate::maths::*;

/// Rings along the torus.
const RINGS: u16 = 48;
/// Vertices of a ring.
const SIDES: u16 = 30;
/// Radius of the tube; that of the circle in its middle is 1 - TUBE.
const TUBE: f64 = 0.3;
/// Sides of a band: two rows of its vertices fit a cache of 16.
const BAND: u16 = 6;

/// The two triangles of the square between two rings and two sides.
fn square(ring: u16, side: u16) -> [[u16; 3]; 2] {
    let at = |ring: u16, side: u16| (ring % RINGS) * SIDES + side % SIDES;
    let (a, b) = (at(ring, side), at(ring + 1, side));
    let (c, d) = (at(ring, side + 1), at(ring + 1, side + 1));
    [[a, c, b], [c, d, b]]
}

/// Ring after ring, as a program makes the mesh.
fn by_rows() -> Vec<[u16; 3]> {
    (0..RINGS).flat_map(|ring| (0..SIDES).flat_map(move |side| square(ring, side))).collect()
}

/// All rings of a band of some sides, then the next band: a row is short enough to be remembered until the next one uses it again.
fn by_bands() -> Vec<[u16; 3]> {
    let band = |first: u16| (0..RINGS).flat_map(move |ring| (first..first + BAND).flat_map(move |side| square(ring, side)));
    (0..SIDES).step_by(BAND.into()).flat_map(band).collect()
}

/// Drawn by lot.
fn by_lot() -> Vec<[u16; 3]> {
    let mut triangles = by_rows();
    for last in (1..triangles.len()).rev() {
        let pick = (uniform(31, last as u32, 0) * (last + 1) as f64) as usize;
        triangles.swap(last, pick);
    }
    triangles
}

fn recorded(name: &'static str, triangles: &[[u16; 3]]) -> Recorder {
    let mut vertices = Vec::new();
    for ring in 0..RINGS {
        let turn = TAU * f64::from(ring) / f64::from(RINGS);
        let outwards = dvec3(libm::cos(turn), libm::sin(turn), 0.0);
        for side in 0..SIDES {
            let angle = TAU * f64::from(side) / f64::from(SIDES);
            let normal = outwards * libm::cos(angle) + DVec3::Z * libm::sin(angle);
            let hue = 1.0 - (2.0 * f64::from(ring) / f64::from(RINGS) - 1.0).abs();
            vertices.extend(vertex(outwards * (1.0 - TUBE) + normal * TUBE, normal, hue));
        }
    }
    let shot = Shot { name, size: [128, 96], eye: dvec3(0.6, -1.9, 2.0), extent: 1.0 };
    shown(&shot, &vertices, triangles.as_flattened())
}

pub fn bands() -> Recorder {
    recorded("torus-bands", &by_bands())
}

pub fn rows() -> Recorder {
    recorded("torus-rows", &by_rows())
}

pub fn random() -> Recorder {
    recorded("torus-random", &by_lot())
}
