//! Section C: geometry, sorting, tiling. What machines of every sort class send, by the formulas of the literature.

mod bytes;
mod compositing;
mod forsyth;
mod overlap;
mod peak;
mod reuse;

use super::{Row, Target};
use synthetic::Scene;

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[
    overlap::OVERLAP_BBOX,
    overlap::OVERLAP_EXACT,
    bytes::SORT_BYTES,
    compositing::COMPOSITING,
    peak::CHEN_PEAK,
    reuse::VERTEX_REUSE,
    forsyth::FORSYTH,
];

/// A scene of these triangles, drawn without depth.
fn scene_of(width: u32, height: u32, shapes: Vec<[[f32; 2]; 3]>) -> Scene {
    Scene::plain(width, height, shapes, 256)
}

fn right_triangle(x: f32, y: f32, w: f32, h: f32) -> [[f32; 2]; 3] {
    [[x, y], [x + w, y], [x, y + h]]
}

/// Several counts, each of which must be exactly as expected: the last is shown, the error is the largest of any.
#[derive(Default)]
struct Counts {
    expected: f64,
    measured: f64,
    error: f64,
}

impl Counts {
    fn add(&mut self, expected: f64, measured: f64) {
        (self.expected, self.measured) = (expected, measured);
        self.error = self.error.max((measured - expected).abs());
    }

    fn row(&self, case: impl Into<String>) -> Row {
        Row { case: case.into(), expected: self.expected, measured: self.measured, error: self.error, allowed: 0.0 }
    }
}
