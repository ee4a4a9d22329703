//! Polygons that are drawn as lines or points and that user clip planes cut: as in Mesa, an edge along each plane is drawn, too, and its
//! ends are corners.

use super::arb::{GENERICS, Stage};
use super::call::{Fault, Outcome};
use super::consts as e;
use super::machine::Gl;
use super::matrix;
use super::primitive::Class;
use super::state::{PLANES, UNITS, Vertex};

/// A corner of a polygon that is being cut.
#[derive(Clone)]
struct Corner {
    /// With the colours of the lit vertex.
    vertex: Vertex,
    /// Its place in eye space.
    eye: [f32; 4],
    /// Whether a plane has made it.
    made: bool,
    /// Whether the edge that begins here lies along a plane.
    along: bool,
}

fn between(a: &Corner, b: &Corner, t: f32) -> Corner {
    fn mix<const N: usize>(a: [f32; N], b: [f32; N], t: f32) -> [f32; N] {
        std::array::from_fn(|k| a[k] + t * (b[k] - a[k]))
    }
    let (from, to) = (&a.vertex, &b.vertex);
    let mut vertex = from.clone();
    vertex.position = mix(from.position, to.position, t);
    vertex.normal = mix(from.normal, to.normal, t);
    vertex.color = mix(from.color, to.color, t);
    vertex.secondary = mix(from.secondary, to.secondary, t);
    [vertex.fog] = mix([from.fog], [to.fog], t);
    for unit in 0..UNITS {
        vertex.set_texture(unit, mix(from.texture(unit), to.texture(unit), t));
    }
    for k in 1..GENERICS {
        vertex.set_generic(k, mix(from.generic(k), to.generic(k), t));
    }
    Corner { vertex, eye: mix(a.eye, b.eye, t), made: true, along: false }
}

/// The part of a polygon on the inner side of a plane in eye space (Sutherland and Hodgman 1974).
fn inner(corners: &[Corner], plane: [f32; 4]) -> Vec<Corner> {
    let mut out = Vec::with_capacity(corners.len() + 1);
    for (k, corner) in corners.iter().enumerate() {
        let next = &corners[(k + 1) % corners.len()];
        let [here, there] = [corner, next].map(|corner| matrix::at_plane(plane, corner.eye));
        if here >= 0.0 {
            out.push(corner.clone());
        }
        if (here >= 0.0) != (there >= 0.0) {
            let leaves = here >= 0.0;
            // Where the polygon leaves, the plane's edge begins; where it comes back, the rest of its own edge.
            out.push(Corner { along: leaves || corner.along, ..between(corner, next, here / (here - there)) });
        }
    }
    out
}

/// The triangles of a polygon with so many corners.
fn halves(mode: u32, corners: usize) -> Vec<[usize; 3]> {
    match mode {
        e::QUADS => vec![[0, 1, 3], [1, 2, 3]],
        e::QUAD_STRIP => vec![[3, 0, 2], [0, 1, 2]],
        _ => (2..corners).map(|k| [0, k - 1, k]).collect(),
    }
}

impl Gl {
    /// Draws what user clip planes add to a polygon that is drawn as lines or points.
    pub(super) fn cut_edges(&mut self, class: Class, mode: u32, back: bool, own: &[Vertex], flat: Option<usize>) -> Outcome {
        let planes: Vec<[f32; 4]> =
            (0..PLANES).filter(|&k| self.state.is(e::CLIP_PLANE0 + k as u32)).map(|k| self.state.planes[k]).collect();
        if planes.is_empty() || class == Class::Triangles {
            return Ok(());
        }
        let lit = |vertex: &Vertex| super::lit::colors_of_side(&self.state, &self.modelview.top, vertex, back);
        let one = flat.map(|provoking| lit(&own[provoking]));
        let corner = |vertex: &Vertex| {
            let mut lit_vertex = vertex.clone();
            (lit_vertex.color, lit_vertex.secondary) = one.unwrap_or_else(|| lit(vertex));
            let eye = matrix::transform(&self.modelview.top, vertex.position);
            Corner { vertex: lit_vertex, eye, made: false, along: false }
        };
        let corners: Vec<Corner> = own.iter().map(corner).collect();
        let inside = |corners: Vec<Corner>| planes.iter().fold(corners, |corners, &plane| inner(&corners, plane));
        let vertices: Vec<Vertex> = if class == Class::Points {
            // Mesa cuts the triangles of a polygon, and so draws a corner where a plane meets a diagonal.
            let made = |three: [usize; 3]| inside(three.map(|k| corners[k].clone()).to_vec()).into_iter().filter(|it| it.made);
            halves(mode, corners.len()).into_iter().flat_map(made).map(|it| it.vertex).collect()
        } else {
            let corners = inside(corners);
            let begins = (0..corners.len()).filter(|&k| corners[k].along);
            begins.flat_map(|k| [k, (k + 1) % corners.len()]).map(|k| corners[k].vertex.clone()).collect()
        };
        if vertices.is_empty() {
            return Ok(());
        }
        if self.active_program(Stage::Vertex)?.is_some() {
            return Err(Fault::Unsupported(
                "edges along user clip planes of polygons drawn as lines or points with a vertex program".into(),
            ));
        }
        let indices: Vec<u32> = (0..vertices.len() as u32).collect();
        // They lie in a plane: its test would keep some of their pixels.
        self.add_lit(class, &vertices, &indices, &[0, 1, 2, 3, 4, 5].map(|k| e::CLIP_PLANE0 + k))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_add_edges_that_other_planes_cut() {
        let gl = Gl::new(std::path::Path::new("x"), &num::Limits::default());
        let corner = |x: f32, y: f32| {
            let mut vertex = gl.state.current.clone();
            (vertex.position, vertex.color) = ([x, y, 0.0, 1.0], [x, y, 0.0, 1.0]);
            Corner { eye: vertex.position, vertex, made: false, along: false }
        };
        let square = [corner(0.0, 0.0), corner(1.0, 0.0), corner(1.0, 1.0), corner(0.0, 1.0)];
        // x is at most a half.
        let once = inner(&square, [-1.0, 0.0, 0.0, 0.5]);
        let ends = |corners: &[Corner]| -> Vec<([f32; 2], bool)> {
            corners.iter().map(|c| ([c.vertex.color[0], c.vertex.color[1]], c.along)).collect()
        };
        assert_eq!(ends(&once), [([0.0, 0.0], false), ([0.5, 0.0], true), ([0.5, 1.0], false), ([0.0, 1.0], false)]);
        // y is at least a quarter: the edge along the first plane becomes shorter, and there is another one.
        let twice = inner(&once, [0.0, 1.0, 0.0, -0.25]);
        assert_eq!(ends(&twice), [([0.5, 0.25], true), ([0.5, 1.0], false), ([0.0, 1.0], false), ([0.0, 0.25], true)]);
        assert!(inner(&square, [-1.0, 0.0, 0.0, -0.5]).is_empty());
        assert_eq!(inner(&square, [1.0, 0.0, 0.0, 0.5]).iter().filter(|corner| corner.made).count(), 0);
    }
}
