//! Line stipple (OpenGL 1.5, section 3.4.2): each end of a line gets its distance in pixels along the line. The fragment stage selects the
//! bit of the pattern.

use glam::vec2;

use super::arb::GENERICS;
use super::consts as e;
use super::machine::Gl;
use super::matrix;
use super::state::{UNITS, Vertex};
use super::uniforms::to_clip;

impl Gl {
    /// Whether lines have a pattern with gaps.
    pub fn line_stippled(&self) -> bool {
        self.state.is(e::LINE_STIPPLE) && self.state.line_stipple.1 != 0xffff
    }

    /// Lines, two vertices each, with the distances along them. The pattern continues if a line begins at the vertex at which the previous
    /// one ended. Lines are clipped to the view volume first, since pixels outside are not counted.
    pub fn stippled(&self, vertices: &[Vertex], indices: &[u32]) -> (Vec<Vertex>, Vec<u32>) {
        let clip = to_clip(&self.projection.top, &self.modelview.top);
        let [_, _, width, height] = self.state.viewport.map(|value| value as f32);
        let (mut out, mut along, mut last) = (Vec::new(), 0.0, None);
        for line in indices.chunks_exact(2) {
            let ends = [0, 1].map(|k| vertices[line[k] as usize].clone());
            if last != Some(line[0]) {
                along = 0.0;
            }
            last = Some(line[1]);
            let [a, b] = ends.each_ref().map(|vertex| matrix::transform(&clip, vertex.position));
            let Some([from, to]) = visible(a, b, &VIEW_VOLUME) else { continue };
            let at = |t: f32| {
                let [x, y, _, w]: [f32; 4] = std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t);
                vec2(x, y) / w * 0.5 * vec2(width, height)
            };
            let apart = (at(to) - at(from)).abs();
            let length = if self.state.is(e::LINE_SMOOTH) { apart.length() } else { apart.max_element() };
            let [mut first, mut second] = [from, to].map(|t| between(&ends, t));
            (first.along, second.along) = (along, along + length);
            if self.state.flat {
                (first.color, first.secondary) = (ends[1].color, ends[1].secondary);
                (second.color, second.secondary) = (ends[1].color, ends[1].secondary);
            }
            // Only the position in the pattern matters.
            let period = 16.0 * self.state.line_stipple.0 as f32;
            along = (along + length) % period;
            out.extend([first, second]);
        }
        let indices = (0..out.len() as u32).collect();
        (out, indices)
    }
}

/// Distances to the planes of the view volume in clip space, where depths are from 0 to w; that of the near plane first.
pub const VIEW_VOLUME: [fn([f32; 4]) -> f32; 6] =
    [|p| p[2], |p| p[3] - p[2], |p| p[3] + p[0], |p| p[3] - p[0], |p| p[3] + p[1], |p| p[3] - p[1]];

/// The part of a line in clip space that lies inside these planes.
pub fn visible(a: [f32; 4], b: [f32; 4], planes: &[fn([f32; 4]) -> f32]) -> Option<[f32; 2]> {
    let (mut from, mut to) = (0.0_f32, 1.0_f32);
    for distance in planes {
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
    (cut.fog, cut.along) = (mix(a.fog, b.fog), mix(a.along, b.along));
    for k in 1..GENERICS {
        cut.set_generic(k, mix4(a.generic(k), b.generic(k)));
    }
    for unit in 0..UNITS {
        cut.set_texture(unit, mix4(a.texture(unit), b.texture(unit)));
    }
    cut
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_goes_on_along_a_strip_and_starts_again_at_each_line() {
        let mut gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        gl.state.viewport = [0, 0, 20, 10];
        let current = gl.state.current.clone();
        let vertex = |x: f32, y: f32| {
            let mut vertex = current.clone();
            vertex.position = [x, y, 0.0, 1.0];
            vertex
        };
        // 10 pixels to the right, then 5 up; the third line leaves the window after 10 of 20.
        let corners = [vertex(-1.0, -1.0), vertex(0.0, -1.0), vertex(0.0, 0.0), vertex(2.0, 0.0)];
        let (strip, _) = gl.stippled(&corners, &[0, 1, 1, 2, 2, 3]);
        let along: Vec<f32> = strip.iter().map(|vertex| vertex.along).collect();
        assert_eq!(along, [0.0, 10.0, 10.0, 15.0, 15.0, 25.0]);
        assert_eq!(strip[5].position[0], 1.0);
        let (lines, _) = gl.stippled(&corners, &[0, 1, 2, 3]);
        assert_eq!(lines.iter().map(|vertex| vertex.along).collect::<Vec<_>>(), [0.0, 10.0, 0.0, 10.0]);
    }
}
