//! Primitives become lists of points, lines or triangles. They are batched into one draw until the state changes.

use gfx::state::Topology;

use super::arb::Stage;
use super::call::Outcome;
use super::consts as e;
use super::machine::Gl;
use super::matrix;
use super::quads::{Run, halves};
use super::state::Vertex;
use super::stipple::VIEW_VOLUME;
use super::uniforms::to_clip;

/// A batch is drawn when it has this number of vertices.
const BATCH_MAX: usize = 1 << 17;

/// Steps of the depth buffer in a unit of polygon offset. The standard asks for a difference that can be resolved; Mesa takes two steps.
pub(super) const OFFSET_STEPS: f32 = 2.0;

/// The primitive type of a batch.
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

/// The vertices that the arrays of a kept draw send.
pub struct Elements {
    /// The vertices that its indices name, once each, in the order of their indices.
    pub vertices: Vec<Vertex>,
    /// For each vertex of the draw, its index in `vertices`.
    pub numbers: Vec<u32>,
    /// Attributes that are sent.
    pub sent: Sent,
    /// Whether the program sends indices.
    pub indexed: bool,
}

/// Attributes that a draw sends even if they do not differ between vertices, each in its own array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sent {
    /// Vertices between Begin and End: all attributes that the shader reads, with all components, as ATTILA's driver does.
    Read,
    /// The program's arrays, whether the shader reads them or not.
    Arrays {
        /// Components of positions.
        position: usize,
        /// The enabled arrays: bits of [`Vertex::over`].
        slots: u32,
    },
}

impl Sent {
    /// Whether the program has an array at a slot.
    pub fn has(self, slot: usize) -> bool {
        matches!(self, Sent::Arrays { slots, .. } if slots & 1 << slot != 0)
    }

    /// The least number of components of an attribute with up to four.
    pub fn least(self, slot: usize) -> usize {
        match self {
            Sent::Read => 4,
            Sent::Arrays { position, .. } if slot == 0 => position.max(2),
            Sent::Arrays { .. } => 2,
        }
    }
}

/// Primitives that wait to be drawn.
#[derive(Default)]
pub struct Batch {
    /// Their type.
    pub class: Class,
    /// Set if they are edges or corners of polygons: whether of back faces.
    pub polygon: Option<bool>,
    /// Vertices.
    pub vertices: Vec<Vertex>,
    /// Indices: of triangles, lines or points; the last vertex of each gives flat colours.
    pub indices: Vec<u32>,
    /// How the card assembles triangles; none: a list.
    pub topology: Option<Topology>,
    /// Whether the vertices are drawn in order, without indices.
    pub sequence: bool,
    /// Whether the triangles that the card assembles have the reverse winding.
    pub turned: bool,
    /// Attributes that are sent; none: those that differ between vertices.
    pub sent: Option<Sent>,
    /// The quadrilaterals at its end.
    pub quads: Option<Run>,
}

impl Gl {
    /// Draws a primitive of these vertices.
    pub fn primitive(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        self.joined(mode, vertices)?;
        // A call that changes a buffer does not end a batch.
        if self.keep_draws || self.glsl.reads_blocks() { self.flush() } else { Ok(()) }
    }

    /// Appends a primitive of these vertices to those that wait.
    fn joined(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        if self.render_mode != e::RENDER || vertices.is_empty() {
            return Ok(());
        }
        if mode > e::POLYGON {
            return Err(super::call::INVALID_ENUM);
        }
        let class = class_of(mode);
        if class == Class::Triangles {
            return self.polygons(mode, vertices);
        }
        self.add(class, None, vertices, &points_and_lines(mode, vertices.len() as u32))
    }

    /// Appends primitives to the batch.
    pub(super) fn add(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> Outcome {
        if indices.is_empty() {
            return Ok(());
        }
        if class == Class::Lines && self.line_stippled() {
            return self.dashed(polygon, vertices, indices);
        }
        if class == Class::Lines
            && self.state.is(e::LIGHTING)
            && self.widens_lines()
            && self.active_program(Stage::Vertex)?.is_none()
        {
            let clip = to_clip(&self.projection.top, &self.modelview.top);
            let outside = |vertex: &Vertex| {
                let position = matrix::transform(&clip, vertex.position);
                VIEW_VOLUME.iter().any(|plane| !(plane(position) >= 0.0))
            };
            if vertices.iter().any(outside) {
                // They are clipped before the card lights them, and what lies between ends has a colour between theirs.
                let mut vertices = vertices.to_vec();
                self.light(&mut vertices, polygon == Some(true));
                return self.append_lit(class, polygon, &vertices, indices);
            }
        }
        self.append(class, polygon, vertices, indices)
    }

    /// Appends primitives whose vertices have been lit, as draws of their own.
    pub(super) fn append_lit(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> Outcome {
        let enabled = self.without_lighting();
        self.with_enabled(enabled, |gl| gl.append(class, polygon, vertices, indices))
    }

    /// Draws with other enabled capabilities than the program's.
    pub(super) fn with_enabled(&mut self, enabled: u64, draw: impl FnOnce(&mut Gl) -> Outcome) -> Outcome {
        self.flush()?;
        self.prepared = None;
        let own = std::mem::replace(&mut self.state.enabled, enabled);
        let outcome = draw(self).and_then(|()| self.flush());
        self.state.enabled = own;
        self.prepared = None;
        outcome
    }

    pub(super) fn append(&mut self, class: Class, polygon: Option<bool>, vertices: &[Vertex], indices: &[u32]) -> Outcome {
        if indices.is_empty() {
            return Ok(());
        }
        let batch = &self.batch;
        let other = batch.class != class || batch.polygon != polygon;
        // A logic operation reads the result of the previous primitive.
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
            self.keep(vertices, indices.iter().copied(), None);
            return Ok(());
        }
        let batch = &mut self.batch;
        (batch.class, batch.polygon) = (class, polygon);
        let base = batch.vertices.len() as u32;
        batch.vertices.extend_from_slice(vertices);
        batch.indices.extend(indices.iter().map(|index| base + index));
        Ok(())
    }

    /// Makes triangles a draw of their own. They need no indices if the card assembles them from all vertices in order and the program
    /// sends no indices.
    fn keep(&mut self, vertices: &[Vertex], indices: impl Iterator<Item = u32>, topology: Option<Topology>) {
        let elements = self.elements.take();
        let sequence = topology.is_some() && elements.as_ref().is_none_or(|of| !of.indexed);
        let (vertices, indices, sent) = match elements {
            // The draw's own vertices, before its indices expanded them.
            Some(of) if of.numbers.len() == vertices.len() => {
                (of.vertices, indices.map(|index| of.numbers[index as usize]).collect(), of.sent)
            }
            _ => (vertices.to_vec(), indices.collect::<Vec<u32>>(), Sent::Read),
        };
        let vertices =
            if sequence { indices.iter().map(|&index| vertices[index as usize].clone()).collect() } else { vertices };
        let indices = if sequence { (0..vertices.len() as u32).collect() } else { indices };
        let batch = Batch { class: Class::Triangles, polygon: None, sent: Some(sent), ..Batch::default() };
        self.batch = Batch { vertices, indices, topology, sequence, ..batch };
    }

    /// How the card assembles the vertices of a draw that is not joined with others, and how many of them.
    pub(super) fn assembled(&self, mode: u32, n: u32) -> Option<(Topology, u32)> {
        if n < 3 || self.state.polygon_modes != [e::FILL; 2] || self.state.is(e::COLOR_LOGIC_OP) {
            return None;
        }
        match mode {
            e::TRIANGLES => Some((Topology::TriangleList, n / 3 * 3)),
            e::TRIANGLE_STRIP => Some((Topology::TriangleStrip, n)),
            e::TRIANGLE_FAN => Some((Topology::TriangleFan, n)),
            e::QUADS if n > 3 => Some((Topology::QuadList, n / 4 * 4)),
            // With flat shading, the provoking vertex differs from that of a fan or a strip.
            e::POLYGON if !self.state.flat => Some((Topology::TriangleFan, n)),
            e::QUAD_STRIP if n > 3 && !self.state.flat => Some((Topology::TriangleStrip, n / 2 * 2)),
            _ => None,
        }
    }

    /// Triangles, quadrilaterals and polygons.
    fn polygons(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        let n = vertices.len() as u32;
        if let Some((topology, count)) = self.assembled(mode, n).filter(|_| self.keep_draws) {
            self.flush()?;
            // A triangle strip has the other diagonal, unless each pair of vertices is exchanged.
            let turned = mode == e::QUAD_STRIP;
            self.keep(vertices, (0..count).map(|i| if turned { i ^ 1 } else { i }), Some(topology));
            self.batch.turned = turned;
            return Ok(());
        }
        if mode == e::QUADS && self.fills() {
            return self.quads(vertices);
        }
        let triangles = triangles(mode, n, &[]);
        if self.fills() {
            return self.add(Class::Triangles, None, vertices, triangles.as_flattened());
        }
        self.outlines(mode, vertices, &triangles)
    }

    /// Whether the faces that are not culled are filled.
    pub fn fills(&self) -> bool {
        let modes = self.state.polygon_modes;
        modes == [e::FILL; 2]
            || self.state.is(e::CULL_FACE)
                && match self.state.cull {
                    e::FRONT => modes[1] == e::FILL,
                    e::BACK => modes[0] == e::FILL,
                    _ => true,
                }
    }
}

/// The primitive type that a mode becomes.
pub fn class_of(mode: u32) -> Class {
    match mode {
        e::POINTS => Class::Points,
        e::LINES | e::LINE_STRIP | e::LINE_LOOP => Class::Lines,
        _ => Class::Triangles,
    }
}

/// Points or lines of `n` vertices.
pub fn points_and_lines(mode: u32, n: u32) -> Vec<u32> {
    match mode {
        e::POINTS => (0..n).collect(),
        e::LINES => (0..n / 2 * 2).collect(),
        _ if n < 2 => Vec::new(),
        _ => {
            let mut lines: Vec<[u32; 2]> = (1..n).map(|i| [i - 1, i]).collect();
            if mode == e::LINE_LOOP {
                lines.push([n - 1, 0]);
            }
            lines.into_flattened()
        }
    }
}

/// Triangles of `n` vertices; the last corner of each gives its flat colour. `diagonals` says for each of separate quadrilaterals whether its
/// diagonal begins at the first vertex.
pub fn triangles(mode: u32, n: u32, diagonals: &[bool]) -> Vec<[u32; 3]> {
    match mode {
        e::TRIANGLES => (0..n / 3).map(|k| [3 * k, 3 * k + 1, 3 * k + 2]).collect(),
        e::TRIANGLE_STRIP => (2..n).map(|i| if i % 2 == 0 { [i - 2, i - 1, i] } else { [i - 1, i - 2, i] }).collect(),
        e::TRIANGLE_FAN => (2..n).map(|i| [0, i - 1, i]).collect(),
        // The first vertex of a polygon gives its flat colour.
        e::POLYGON => (2..n).map(|i| [i - 1, i, 0]).collect(),
        e::QUADS => {
            let first = |k: u32| diagonals.get(k as usize).is_some_and(|&first| first);
            let pairs: Vec<_> = (0..n / 4).map(|k| halves([4 * k, 4 * k + 1, 4 * k + 2, 4 * k + 3], first(k))).collect();
            pairs.into_flattened()
        }
        e::QUAD_STRIP => {
            let strip = (0..n.saturating_sub(2) / 2).map(|k| 2 * k);
            let pairs: Vec<_> = strip.map(|i| [[i + 2, i, i + 3], [i, i + 1, i + 3]]).collect();
            pairs.into_flattened()
        }
        _ => Vec::new(),
    }
}
