//! The triangles of quadrilaterals. The standard does not fix the diagonal; where a quadrilateral is not flat or its values are not affine, the
//! picture shows it. The last vertex gives the flat colour.
//!
//! Mesa's llvmpipe has two ways: from the first vertex to the third, or from the second to the fourth. The first one is that of draws that
//! need no clipping: all of their vertices lie in the view volume. It takes the second one for draws with indices and those of compiled display
//! lists, for flat shading, and where polygons have patterns.

use gl_shader::{PLANES, consts as e};
use glam::{Mat4, Vec4};

use crate::gl::call::{Call, GlResult, Shape};
use crate::gl::geometry::clip::{VIEW_VOLUME, to_clip};
use crate::gl::geometry::primitive::{Class, QuadRun, halves};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;

/// Whether four corners in order form an axis-aligned rectangle that faces the screen.
fn is_upright(corners: [[f32; 4]; 4]) -> bool {
    let same = |axis: usize, p: usize, q: usize| corners[p][axis] == corners[q][axis];
    let along = |first: usize| {
        let second = 1 - first;
        same(first, 0, 1) && same(second, 1, 2) && same(first, 2, 3) && same(second, 3, 0)
    };
    (1..4).all(|q| same(3, 0, q)) && (along(0) || along(1))
}

/// A call after which Mesa begins a draw, though the batch goes on.
pub fn separate(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    gl.drawing.batch.quads = None;
    Ok(())
}

impl Gl {
    /// Whether it is known if Mesa clips.
    fn clipping_decides(&self) -> bool {
        self.options.as_mesa
            && self.state.programs & gl_shader::arb::program::ProgramStage::Vertex as u8 == 0
            && self.context.glsl_program == 0
    }

    /// For each quadrilateral of a draw, with these positions of its corners, whether its diagonal begins at its first vertex. `varied`: whether
    /// vertices differ in colours.
    ///
    /// Where a program computes positions, it is not known which vertices are outside of the view volume: then rectangles that face the screen
    /// count as inside, and others as outside. So it is for recordings with ATTILA's pictures.
    pub fn diagonals(&self, positions: &[[f32; 4]], varied: bool) -> Vec<bool> {
        let (quads, state) = (positions.as_chunks::<4>().0, &self.state);
        if !self.begins_diagonals() || state.lighting.flat && (varied || state.is(e::LIGHTING)) {
            return vec![false; quads.len()];
        }
        let clip = to_clip(&self.context.matrices.projection.top, &self.context.matrices.modelview.top);
        if !self.clipping_decides() {
            let moves = Mat4::from_cols(Vec4::X * clip.x_axis, Vec4::Y * clip.y_axis, clip.z_axis, clip.w_axis);
            return quads.iter().map(|&corners| clip == moves && is_upright(corners)).collect();
        }
        let planes: Vec<[f32; 4]> =
            (0..PLANES).filter(|&k| state.is(e::CLIP_PLANE0 + k as u32)).map(|k| state.transform.planes[k]).collect();
        let modelview = &self.context.matrices.modelview.top;
        let inside = |&position: &[f32; 4]| {
            let at = matrix::transform(&clip, position);
            VIEW_VOLUME.iter().all(|side| side(at) >= 0.0)
                && planes.iter().all(|&plane| matrix::at_plane(plane, matrix::transform(modelview, position)) >= 0.0)
        };
        vec![quads.as_flattened().iter().all(inside); quads.len()]
    }

    /// Appends quadrilaterals.
    pub fn quads(&mut self, vertices: &[Vertex]) -> GlResult {
        let positions: Vec<[f32; 4]> = vertices.iter().map(|vertex| vertex.position).collect();
        let color = |vertex: &Vertex| (vertex.color, vertex.secondary);
        let varied = self.state.lighting.flat && vertices.iter().any(|vertex| color(vertex) != color(&vertices[0]));
        let mut diagonals = self.diagonals(&positions, varied);
        let run = self.drawing.batch.quads.take().filter(|run| run.indices.end == self.drawing.batch.indices.len());
        let joins = self.clipping_decides();
        if let (Some(run), Some(&first)) = (&run, diagonals.first())
            && joins
            && run.first != first
        {
            // One vertex outside is enough for all.
            diagonals.fill(false);
            if run.first {
                for quad in self.drawing.batch.indices[run.indices.clone()].as_chunks_mut::<6>().0 {
                    let [a, b, c, _, _, d] = *quad;
                    quad.copy_from_slice(halves([a, b, c, d], false).as_flattened());
                }
            }
        }
        let corners = |k: usize| [0, 1, 2, 3].map(|corner| 4 * k as u32 + corner);
        let triangles: Vec<_> = diagonals.iter().enumerate().map(|(k, &first)| halves(corners(k), first)).collect();
        let triangles = triangles.as_flattened().as_flattened();
        let before = self.drawing.batch.indices.len();
        self.add(Class::Triangles, None, vertices, triangles)?;
        let end = self.drawing.batch.indices.len();
        // Some are drawn at once, and what was there before may have been.
        let Some(start) = end.checked_sub(triangles.len()).filter(|_| joins) else { return Ok(()) };
        let start = run.filter(|_| start == before).map_or(start, |run| run.indices.start);
        self.drawing.batch.quads = diagonals.first().map(|&first| QuadRun { indices: start..end, first });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use num::Limits;

    use super::{Gl, e, is_upright};
    use crate::gl::geometry::vertex::Vertex;
    use crate::gl::state::server::capability;

    const FIRST: [u32; 6] = [0, 1, 2, 0, 2, 3];
    const SECOND: [u32; 6] = [0, 1, 3, 1, 2, 3];

    /// The batch of draws of quadrilaterals, each of as many as there are lists of corners, after a change of the machine.
    fn drawn(change: impl FnOnce(&mut Gl), draws: &[&[[f32; 2]]]) -> Vec<[u32; 6]> {
        let mut gl = Gl::new(Path::new("x.trace"), &Limits::default());
        change(&mut gl);
        for corners in draws {
            let vertices: Vec<Vertex> = corners
                .iter()
                .map(|&[x, y]| {
                    let mut vertex = gl.state.current.clone();
                    vertex.position = [x, y, 0.0, 1.0];
                    vertex
                })
                .collect();
            gl.primitive(e::QUADS, &vertices).expect("a primitive");
        }
        let quads = gl.drawing.batch.indices.as_chunks::<6>().0.iter().enumerate();
        quads.map(|(k, quad)| quad.map(|index| index - 4 * k as u32)).collect()
    }

    #[test]
    fn diagonals_begin_at_first_vertices_where_nothing_is_clipped() {
        let skew = [[-1.0, -1.0], [1.0, -0.8], [0.9, 1.0], [-0.5, 0.5]];
        let beyond = [[-1.0, -1.0], [1.001, -0.8], [0.9, 1.0], [-0.5, 0.5]];
        let both = [skew, beyond].concat();
        assert_eq!(drawn(|_| (), &[&skew]), [FIRST]);
        assert_eq!(drawn(|_| (), &[&beyond]), [SECOND]);
        // One vertex outside is enough for all that is drawn together.
        assert_eq!(drawn(|_| (), &[&both]), [SECOND; 2]);
        assert_eq!(drawn(|_| (), &[&skew, &skew, &beyond, &skew]), [SECOND; 4]);
        let enabled = |cap: u32| move |gl: &mut Gl| gl.state.enabled |= capability(cap).expect("a capability");
        let cut = |gl: &mut Gl| {
            gl.state.transform.planes[0] = [1.0, 0.0, 0.0, 0.5];
            enabled(e::CLIP_PLANE0)(gl);
        };
        assert_eq!(drawn(cut, &[&skew]), [SECOND]);
        assert_eq!(drawn(enabled(e::CLIP_PLANE0), &[&skew]), [FIRST], "a plane through nothing cuts nothing");
        // What Mesa draws with indices, or with a pattern.
        assert_eq!(drawn(|gl| gl.drawing.from_list = true, &[&skew]), [SECOND]);
        assert_eq!(drawn(|gl| gl.drawing.indexed = true, &[&skew]), [SECOND]);
        assert_eq!(drawn(enabled(e::POLYGON_STIPPLE), &[&skew]), [SECOND]);
        // A flat colour of one vertex needs that vertex in both triangles.
        assert_eq!(drawn(|gl| gl.state.lighting.flat = true, &[&skew]), [FIRST]);
        let lit = |gl: &mut Gl| {
            gl.state.lighting.flat = true;
            enabled(e::LIGHTING)(gl);
        };
        assert_eq!(drawn(lit, &[&skew]), [SECOND]);
        // ATTILA's pictures.
        let square = [[-1.0, -1.0], [2.0, -1.0], [2.0, 1.0], [-1.0, 1.0]];
        assert_eq!(drawn(|gl| gl.options.as_mesa = false, &[&skew, &square]), [SECOND, FIRST]);
    }

    #[test]
    fn rectangles_along_the_axes_are_told_from_other_quadrilaterals() {
        let of = |corners: [[f32; 2]; 4]| is_upright(corners.map(|[x, y]| [x, y, 0.0, 1.0]));
        assert!(of([[0.0, 0.0], [0.0, 2.0], [3.0, 2.0], [3.0, 0.0]]));
        assert!(of([[3.0, 0.0], [0.0, 0.0], [0.0, 2.0], [3.0, 2.0]]));
        assert!(!of([[0.0, 0.0], [0.0, 2.0], [3.0, 2.5], [3.0, 0.0]]));
        assert!(!of([[1.0, 0.0], [0.0, 1.0], [1.0, 2.0], [2.0, 1.0]]));
        // Perspective from the w of the corners.
        assert!(!is_upright([[0.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 1.0], [3.0, 2.0, 0.0, 2.0], [3.0, 0.0, 0.0, 2.0]]));
        // Edges that cross.
        assert!(!of([[0.0, 0.0], [3.0, 2.0], [0.0, 2.0], [3.0, 0.0]]));
    }
}
