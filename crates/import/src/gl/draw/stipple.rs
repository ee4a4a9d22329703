//! Line stipple (OpenGL 1.5, section 3.4.2). As in Mesa, each run of pixels that the pattern draws becomes a line of its own, whose colours, fog
//! and texture coordinates lie on a straight line in the window, without perspective.

use gl_shader::arb::program::ProgramStage;
use gl_shader::consts as e;
use glam::vec2;

use crate::gl::call::{Fault, GlResult};
use crate::gl::geometry::clip::{between, to_clip, visible};
use crate::gl::geometry::primitive::Class;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;

/// Maximum number of ends of runs in one call.
const VERTICES_MAX: usize = 1 << 22;

impl Gl {
    /// Appends what the pattern leaves of lines: of primitives, or of the outline of a polygon whose back is seen or not.
    pub fn dashed(&mut self, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> GlResult {
        let program = self.active_program(ProgramStage::Vertex)?.is_some();
        let (mut vertices, modelview) = (vertices.to_vec(), self.context.matrices.modelview.top);
        if !program && !self.state.fog.from_coordinate {
            for vertex in &mut vertices {
                let [_, _, z, w] = matrix::transform(&modelview, vertex.position);
                vertex.fog = (z / w).abs();
            }
        }
        if program || !self.state.is(e::LIGHTING) {
            let (vertices, indices) = self.runs(&vertices, indices, polygon.is_some(), VERTICES_MAX)?;
            return self.append(Class::Lines, polygon, &vertices, &indices);
        }
        // Lighting comes before the pattern.
        self.light(&mut vertices, polygon == Some(true));
        let (vertices, indices) = self.runs(&vertices, indices, polygon.is_some(), VERTICES_MAX)?;
        self.append_lit(Class::Lines, polygon, &vertices, &indices)
    }

    /// The runs of lines, two vertices each. The pattern continues if a line begins at the vertex at which the previous one ended, and along
    /// the whole outline of a polygon. Lines are clipped first, since pixels outside of the view volume are not counted.
    fn runs(&self, vertices: &[Vertex], indices: &[u32], outline: bool, most: usize) -> GlResult<(Vec<Vertex>, Vec<u32>)> {
        let clip = to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top);
        let [_, _, width, height] = self.state.transform.viewport.map(|value| value as f32);
        let (factor, pattern) = self.state.line.stipple;
        let (mut out, mut counter, mut last) = (Vec::new(), 0, None);
        for line in indices.chunks_exact(2) {
            let ends = [0, 1].map(|k| vertices[line[k] as usize].clone());
            if last != Some(line[0]) && !outline {
                counter = 0;
            }
            last = Some(line[1]);
            let [a, b] = ends.each_ref().map(|vertex| matrix::transform(&clip, vertex.position));
            let Some(part) = visible(a, b) else { continue };
            let [p, q]: [[f32; 4]; 2] = part.map(|t| std::array::from_fn(|k| a[k] + (b[k] - a[k]) * t));
            let window = |[x, y, _, w]: [f32; 4]| vec2(x, y) / w * 0.5 * vec2(width, height);
            let apart = (window(q) - window(p)).abs();
            let length = if self.state.is(e::LINE_SMOOTH) { apart.length() } else { apart.max_element() };
            let mut both = part.map(|t| between(&ends, t));
            if self.state.lighting.flat {
                (both[0].color, both[0].secondary) = (ends[1].color, ends[1].secondary);
                (both[1].color, both[1].secondary) = (ends[1].color, ends[1].secondary);
            }
            // The vertex at a fraction of the way in the window: its position lies elsewhere on the line, by perspective.
            let at = |t: f32| {
                let mut vertex = between(&both, t);
                let deep = t * p[3] / (t * p[3] + (1.0 - t) * q[3]);
                if t > 0.0 && t < 1.0 {
                    let [from, to] = [both[0].position, both[1].position];
                    vertex.position = std::array::from_fn(|k| from[k] + (to[k] - from[k]) * deep);
                }
                vertex
            };
            let drawn = |pixel: u32| pattern >> ((counter + pixel) / factor & 15) & 1 != 0;
            let pixels = length.ceil() as u32;
            let (mut pixel, mut start) = (0, None);
            while pixel < pixels {
                match start {
                    None if drawn(pixel) => start = Some(pixel),
                    Some(from) if !drawn(pixel) => {
                        out.extend([at(from as f32 / length), at(pixel as f32 / length)]);
                        start = None;
                    }
                    _ => {}
                }
                // To the next bit of the pattern.
                pixel += factor - (counter + pixel) % factor;
            }
            if let Some(from) = start {
                out.extend([at(from as f32 / length), at(1.0)]);
            }
            if out.len() > most {
                return Err(Fault::Limit(format!("the pattern of lines makes more than {} of them in one call", most / 2)));
            }
            // As in Mesa, a pixel that a line enters counts as one. Only the position in the pattern matters.
            counter = (counter + pixels) % (16 * factor);
        }
        let indices = (0..out.len() as u32).collect();
        Ok((out, indices))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pattern_goes_on_along_a_strip_and_starts_again_at_each_line() {
        let mut gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        gl.state.transform.viewport = [0, 0, 20, 10];
        // Four pixels are drawn, four are left out.
        gl.state.line.stipple = (4, 0x5555);
        let current = gl.state.current.clone();
        let vertex = |x: f32, y: f32| {
            let mut vertex = current.clone();
            vertex.position = [x / 10.0 - 1.0, y / 5.0 - 1.0, 0.0, 1.0];
            vertex
        };
        // 10 pixels to the right, then 5 up; the third line leaves the window after 10 of 20.
        let corners = [vertex(0.0, 0.0), vertex(10.0, 0.0), vertex(10.0, 5.0), vertex(30.0, 5.0)];
        let places = |indices: &[u32], outline: bool| -> Vec<[f32; 2]> {
            let (runs, _) = gl.runs(&corners, indices, outline, 100).expect("few lines");
            runs.iter()
                .map(|vertex| [(vertex.position[0] + 1.0) * 10.0, (vertex.position[1] + 1.0) * 5.0].map(f32::round))
                .collect()
        };
        let first = [[0.0, 0.0], [4.0, 0.0], [8.0, 0.0], [10.0, 0.0]];
        let strip = places(&[0, 1, 1, 2, 2, 3], false);
        assert_eq!(
            strip,
            [&first[..], &[[10.0, 0.0], [10.0, 2.0], [11.0, 5.0], [15.0, 5.0], [19.0, 5.0], [20.0, 5.0]]].concat()
        );
        let lines = places(&[0, 1, 2, 3], false);
        assert_eq!(lines, [&first[..], &[[10.0, 5.0], [14.0, 5.0], [18.0, 5.0], [20.0, 5.0]]].concat());
        // The outline of a polygon goes on where an edge is left out.
        let outline = places(&[0, 1, 2, 3], true);
        assert_eq!(outline, [&first[..], &[[10.0, 5.0], [12.0, 5.0], [16.0, 5.0], [20.0, 5.0]]].concat());
    }

    #[test]
    fn runs_have_colours_and_fog_of_their_places_in_the_window() {
        let mut gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        gl.state.transform.viewport = [0, 0, 16, 16];
        gl.state.line.stipple = (8, 1);
        gl.context.matrices.projection.top.w_axis.w = 0.0;
        gl.context.matrices.projection.top.z_axis.w = 1.0;
        let mut ends = [gl.state.current.clone(), gl.state.current.clone()];
        // From the left edge of the window to the right one: the second end is three times as far away.
        (ends[0].position, ends[0].fog) = ([-1.0, 0.0, 1.0, 1.0], 1.0);
        (ends[1].position, ends[1].fog) = ([3.0, 0.0, 3.0, 1.0], 3.0);
        let (runs, _) = gl.runs(&ends, &[0, 1], false, 100).expect("one line");
        // Half of the way in the window is a quarter of the way in space, but fog is the mean.
        let near = |a: f32, b: f32| (a - b).abs() < 1e-6;
        assert!(runs.len() == 2 && near(runs[1].position[0], 0.0) && near(runs[1].position[2], 1.5), "{runs:?}");
        assert!(near(runs[1].fog, 2.0), "{}", runs[1].fog);
    }

    #[test]
    fn a_pattern_makes_no_more_lines_than_a_draw_has_vertices() {
        let mut gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        gl.state.transform.viewport = [0, 0, 16_384, 16_384];
        gl.state.line.stipple = (1, 0x5555);
        let mut ends = [gl.state.current.clone(), gl.state.current.clone()];
        (ends[0].position, ends[1].position) = ([-1.0, 0.0, 0.0, 1.0], [1.0, 0.0, 0.0, 1.0]);
        // 8192 runs per line.
        assert_eq!(gl.runs(&ends, &[0, 1], false, 16_384).map(|(runs, _)| runs.len()), Ok(16_384));
        assert!(matches!(gl.runs(&ends, &[0, 1, 0, 1], false, 16_384), Err(Fault::Limit(_))));
    }
}
