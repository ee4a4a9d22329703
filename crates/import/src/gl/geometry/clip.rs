//! The view volume, and cuts of lines.

use gl_shader::UNITS;
use gl_shader::arb::program::GENERICS;
use glam::Mat4;

use crate::gl::geometry::vertex::Vertex;

/// Distances to the planes of the view volume in clip space, where depths are from 0 to w; that of the near plane first.
pub const VIEW_VOLUME: [fn([f32; 4]) -> f32; 6] =
    [|p| p[2], |p| p[3] - p[2], |p| p[3] + p[0], |p| p[3] - p[0], |p| p[3] + p[1], |p| p[3] - p[1]];

/// The part of a line in clip space that lies inside the view volume.
pub fn visible(a: [f32; 4], b: [f32; 4]) -> Option<[f32; 2]> {
    let (mut from, mut to) = (0.0_f32, 1.0_f32);
    for distance in VIEW_VOLUME {
        let (da, db) = (distance(a), distance(b));
        match (da >= 0.0, db >= 0.0) {
            (true, true) => {}
            (false, false) => return None,
            (true, false) => to = to.min(da / (da - db)),
            (false, true) => from = from.max(da / (da - db)),
        }
    }
    (from < to && from.is_finite() && to.is_finite()).then_some([from, to])
}

/// The vertex at the fraction `t` of a line.
pub fn between([a, b]: &[Vertex; 2], t: f32) -> Vertex {
    if t == 0.0 {
        return a.clone();
    }
    if t == 1.0 {
        return b.clone();
    }
    let mix = |x: f32, y: f32| x + (y - x) * t;
    let mix4 = |x: [f32; 4], y: [f32; 4]| std::array::from_fn(|k| mix(x[k], y[k]));
    let mut cut = a.clone();
    cut.position = mix4(a.position, b.position);
    cut.color = mix4(a.color, b.color);
    cut.normal = std::array::from_fn(|k| mix(a.normal[k], b.normal[k]));
    cut.secondary = std::array::from_fn(|k| mix(a.secondary[k], b.secondary[k]));
    cut.fog = mix(a.fog, b.fog);
    for k in 1..GENERICS {
        cut.set_generic(k, mix4(a.generic(k), b.generic(k)));
    }
    for unit in 0..UNITS {
        cut.set_texture(unit, mix4(a.texture(unit), b.texture(unit)));
    }
    cut
}

/// The matrix from object space to the clip space of the card, where depths are from 0 to w.
pub fn to_clip(projection: &Mat4, modelview: &Mat4) -> Mat4 {
    let mut m = *projection * *modelview;
    for column in [&mut m.x_axis, &mut m.y_axis, &mut m.z_axis, &mut m.w_axis] {
        column.z = 0.5 * (column.z + column.w);
    }
    m
}
