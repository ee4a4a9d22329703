//! Primitives become lists of points, lines or triangles, which wait for one draw as long as the state stays.

use super::call::Outcome;
use super::consts as e;
use super::machine::Gl;
use super::matrix::{self, Matrix};
use super::state::Vertex;
use super::uniforms::to_clip;

/// Vertices of a batch after which it is drawn.
const BATCH_MAX: usize = 1 << 17;

/// What a batch consists of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Class {
    /// Points.
    Points,
    /// Lines.
    Lines,
    /// Triangles.
    #[default]
    Triangles,
}

/// What the arrays of a draw that is kept send.
#[derive(Default)]
pub struct Elements {
    /// The vertices that its indices name, once each, in the order of their indices.
    pub vertices: Vec<Vertex>,
    /// Of each vertex of the draw, which of these it is.
    pub numbers: Vec<u32>,
    /// Components of attributes.
    pub sent: Sent,
}

/// Attributes that a program sends whether or not they differ between vertices or are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sent {
    /// Components of positions.
    pub position: usize,
    /// Whether normals are sent.
    pub normal: bool,
    /// Whether colours are sent.
    pub color: bool,
}

impl Default for Sent {
    /// Of vertices between Begin and End: positions have four components.
    fn default() -> Sent {
        Sent { position: 4, normal: false, color: false }
    }
}

/// Primitives that wait.
#[derive(Default)]
pub struct Batch {
    /// What they are.
    pub class: Class,
    /// Whether they are edges or corners of polygons, and of back faces.
    pub polygon: Option<bool>,
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Indices: of triangles, lines or points; the last vertex of each gives flat colours.
    pub indices: Vec<u32>,
    /// Whether the indices are those of one strip of triangles.
    pub strip: bool,
    /// What is sent of each vertex; none: what differs between them.
    pub sent: Option<Sent>,
}

impl Gl {
    /// Draws a primitive of these vertices.
    pub fn primitive(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        self.joined(mode, vertices)?;
        if self.keep_draws { self.flush() } else { Ok(()) }
    }

    /// Appends a primitive of these vertices to those that wait.
    fn joined(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        if self.render_mode != e::RENDER || vertices.is_empty() {
            return Ok(());
        }
        let n = vertices.len() as u32;
        let mut indices: Vec<u32> = Vec::new();
        let class = match mode {
            e::POINTS => {
                indices.extend(0..n);
                Class::Points
            }
            e::LINES => {
                indices.extend(0..n / 2 * 2);
                Class::Lines
            }
            e::LINE_STRIP | e::LINE_LOOP => {
                if n < 2 {
                    return Ok(());
                }
                indices.extend((1..n).flat_map(|i| [i - 1, i]));
                if mode == e::LINE_LOOP {
                    indices.extend([n - 1, 0]);
                }
                Class::Lines
            }
            _ => return self.polygons(mode, vertices),
        };
        self.add(class, None, vertices, &indices)
    }

    /// Appends primitives to the batch.
    fn add(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> Outcome {
        if indices.is_empty() {
            return Ok(());
        }
        if class == Class::Lines && self.line_stippled() {
            let (vertices, indices) = self.stippled(vertices, indices);
            return self.append(class, polygon, &vertices, &indices);
        }
        self.append(class, polygon, vertices, indices)
    }

    fn append(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> Outcome {
        if indices.is_empty() {
            return Ok(());
        }
        let batch = &self.batch;
        let other = batch.class != class || batch.polygon != polygon;
        // A logic operation reads what the primitive before it has written.
        let alone = self.state.is(e::COLOR_LOGIC_OP) && !matches!(self.state.logic, e::COPY | e::NOOP);
        let each = match class {
            Class::Points => 1,
            Class::Lines => 2,
            Class::Triangles => 3,
        };
        if alone && indices.len() > each {
            return indices.chunks(each).try_for_each(|one| {
                let used: Vec<Vertex> = one.iter().map(|&index| vertices[index as usize].clone()).collect();
                self.append(class, polygon, &used, &[0, 1, 2][..one.len()])
            });
        }
        let batch = &self.batch;
        if !batch.indices.is_empty() && (other || alone || batch.vertices.len() + vertices.len() > BATCH_MAX) {
            self.flush()?;
        }
        if self.keep_draws && class == Class::Triangles && polygon.is_none() {
            self.flush()?;
            self.keep(vertices, indices.iter().copied(), false);
            return Ok(());
        }
        let batch = &mut self.batch;
        (batch.class, batch.polygon) = (class, polygon);
        let base = batch.vertices.len() as u32;
        batch.vertices.extend_from_slice(vertices);
        batch.indices.extend(indices.iter().map(|index| base + index));
        Ok(())
    }

    /// Triangles that are a draw by themselves.
    fn keep(&mut self, vertices: &[Vertex], indices: impl Iterator<Item = u32>, strip: bool) {
        let (vertices, indices, sent) = match self.elements.take() {
            // The draw's own vertices, and not what became of them.
            Some(of) if of.numbers.len() == vertices.len() => {
                (of.vertices, indices.map(|index| of.numbers[index as usize]).collect(), of.sent)
            }
            _ => (vertices.to_vec(), indices.collect(), Sent::default()),
        };
        self.batch = Batch { class: Class::Triangles, polygon: None, vertices, indices, strip, sent: Some(sent) };
    }

    /// Triangles, quadrilaterals and polygons.
    fn polygons(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        let n = vertices.len() as u32;
        // Corners of each polygon; the last one of a triangle gives its flat colour.
        let mut triangles: Vec<[u32; 3]> = Vec::new();
        // Which diagonal parts a quadrilateral is left open. As llvmpipe does it: its last vertex gives its flat colour and stands in both
        // triangles, but an upright rectangle that faces the screen is drawn from its first three.
        let upright = self.keeps_upright();
        let quads = |first: u32, step: u32, corners: [u32; 4], out: &mut Vec<[u32; 3]>| {
            let count = if n < 4 { 0 } else { (n - 4) / step + 1 };
            for k in 0..count {
                let [a, b, c, d] = corners.map(|corner| first + k * step + corner);
                let rectangle = upright && is_upright([a, b, c, d].map(|corner| vertices[corner as usize].position));
                out.extend(if rectangle { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] });
            }
        };
        match mode {
            e::TRIANGLES => triangles.extend((0..n / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2])),
            e::TRIANGLE_STRIP => {
                triangles.extend((2..n).map(|i| if i % 2 == 0 { [i - 2, i - 1, i] } else { [i - 1, i - 2, i] }))
            }
            e::TRIANGLE_FAN => triangles.extend((2..n).map(|i| [0, i - 1, i])),
            // The first vertex of a polygon gives its flat colour.
            e::POLYGON => triangles.extend((2..n).map(|i| [i - 1, i, 0])),
            e::QUADS => quads(0, 4, [0, 1, 2, 3], &mut triangles),
            e::QUAD_STRIP => {
                for k in 0..n.saturating_sub(2) / 2 {
                    let i = 2 * k;
                    triangles.extend([[i + 2, i, i + 3], [i, i + 1, i + 3]]);
                }
            }
            _ => return Err(super::call::INVALID_ENUM),
        }
        let modes = self.state.polygon_modes;
        let whole_strip = self.keep_draws && mode == e::TRIANGLE_STRIP && n > 2 && !self.state.is(e::COLOR_LOGIC_OP);
        if whole_strip && modes == [e::FILL; 2] {
            self.flush()?;
            self.keep(vertices, 0..n, true);
            return Ok(());
        }
        if modes == [e::FILL; 2] || (self.state.is(e::CULL_FACE) && self.filled_only()) {
            return self.add(Class::Triangles, None, vertices, triangles.as_flattened());
        }
        self.outlines(mode, vertices, &triangles)
    }

    /// Whether shading is smooth, and the matrices only move and scale, without perspective.
    fn keeps_upright(&self) -> bool {
        let m = to_clip(&self.projection.top, &self.modelview.top);
        !self.state.flat && [1, 2, 3, 4, 6, 7, 8, 9, 11].iter().all(|&k| m[k] == 0.0)
    }

    /// Whether the faces that are not culled are filled.
    fn filled_only(&self) -> bool {
        match self.state.cull {
            e::FRONT => self.state.polygon_modes[1] == e::FILL,
            e::BACK => self.state.polygon_modes[0] == e::FILL,
            _ => true,
        }
    }

    /// Polygons of which some are drawn as lines or points. Facing is found here, since the card knows it of triangles only.
    fn outlines(&mut self, mode: u32, vertices: &[Vertex], triangles: &[[u32; 3]]) -> Outcome {
        let n = vertices.len() as u32;
        let polygons: Vec<Vec<u32>> = match mode {
            e::QUADS => (0..n / 4).map(|k| (4 * k..4 * k + 4).collect()).collect(),
            e::QUAD_STRIP => (0..n.saturating_sub(2) / 2).map(|k| vec![2 * k, 2 * k + 1, 2 * k + 3, 2 * k + 2]).collect(),
            e::POLYGON if n > 2 => vec![(0..n).collect()],
            e::POLYGON => Vec::new(),
            _ => triangles.iter().map(|t| t.to_vec()).collect(),
        };
        let clip = to_clip(&self.projection.top, &self.modelview.top);
        for corners in polygons {
            let back = self.is_back(&clip, corners.iter().map(|&i| &vertices[i as usize]));
            let culled = self.state.is(e::CULL_FACE)
                && match self.state.cull {
                    e::FRONT => !back,
                    e::BACK => back,
                    _ => true,
                };
            if culled {
                continue;
            }
            let edged = !matches!(mode, e::TRIANGLES | e::QUADS | e::POLYGON);
            let is_edge = |i: u32| edged || vertices[i as usize].edge;
            let count = corners.len();
            let mut indices = Vec::new();
            let class = match self.state.polygon_modes[usize::from(back)] {
                e::POINT => {
                    indices.extend(corners.iter().copied().filter(|&i| is_edge(i)));
                    Class::Points
                }
                e::LINE => {
                    for k in (0..count).filter(|&k| is_edge(corners[k])) {
                        indices.extend([corners[k], corners[(k + 1) % count]]);
                    }
                    Class::Lines
                }
                _ => {
                    indices.extend((2..count).flat_map(|k| [corners[0], corners[k - 1], corners[k]]));
                    Class::Triangles
                }
            };
            if self.state.flat {
                // All that is left of a polygon has the colour of its provoking vertex.
                return Err(super::call::Fault::Unsupported("flat shading of polygons drawn as lines or points".into()));
            }
            let polygon = (class != Class::Triangles).then_some(back);
            if class == Class::Lines && self.line_stippled() {
                // The pattern goes on from edge to edge, which is seen by the indices.
                self.add(class, polygon, vertices, &indices)?;
                continue;
            }
            let used: Vec<Vertex> = indices.iter().map(|&i| vertices[i as usize].clone()).collect();
            let all: Vec<u32> = (0..used.len() as u32).collect();
            self.add(class, polygon, &used, &all)?;
        }
        Ok(())
    }

    /// Whether a polygon shows its back: by the sign of its area in the window.
    fn is_back<'a>(&self, clip: &Matrix, corners: impl Iterator<Item = &'a Vertex>) -> bool {
        let window: Vec<[f64; 2]> = corners
            .map(|vertex| {
                let [x, y, _, w] = matrix::transform(clip, vertex.position).map(f64::from);
                [x / w, y / w]
            })
            .collect();
        let area: f64 = (0..window.len())
            .map(|k| {
                let ([ax, ay], [bx, by]) = (window[k], window[(k + 1) % window.len()]);
                ax * by - bx * ay
            })
            .sum();
        (area < 0.0) == (self.state.front == e::CCW)
    }
}

/// Whether four corners in order are those of a rectangle along the axes of x and y.
fn is_upright(corners: [[f32; 4]; 4]) -> bool {
    let same = |axis: usize, p: usize, q: usize| corners[p][axis] == corners[q][axis];
    let along = |first: usize| {
        let second = 1 - first;
        same(first, 0, 1) && same(second, 1, 2) && same(first, 2, 3) && same(second, 3, 0)
    };
    (1..4).all(|q| same(3, 0, q)) && (along(0) || along(1))
}

#[cfg(test)]
mod tests {
    use super::is_upright;

    #[test]
    fn rectangles_along_the_axes_are_told_from_other_quadrilaterals() {
        let of = |corners: [[f32; 2]; 4]| is_upright(corners.map(|[x, y]| [x, y, 0.0, 1.0]));
        assert!(of([[0.0, 0.0], [0.0, 2.0], [3.0, 2.0], [3.0, 0.0]]));
        assert!(of([[3.0, 0.0], [0.0, 0.0], [0.0, 2.0], [3.0, 2.0]]));
        assert!(!of([[0.0, 0.0], [0.0, 2.0], [3.0, 2.5], [3.0, 0.0]]));
        assert!(!of([[1.0, 0.0], [0.0, 1.0], [1.0, 2.0], [2.0, 1.0]]));
        // Perspective by the corners' own w.
        assert!(!is_upright([[0.0, 0.0, 0.0, 1.0], [0.0, 2.0, 0.0, 1.0], [3.0, 2.0, 0.0, 2.0], [3.0, 0.0, 0.0, 2.0]]));
        // Corners that cross.
        assert!(!of([[0.0, 0.0], [3.0, 2.0], [0.0, 2.0], [3.0, 0.0]]));
    }
}
