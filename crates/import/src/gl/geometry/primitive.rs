//! Modes of primitives, and batches of them.

use std::ops::Range;

use gfx::state::Topology;
use gl_shader::consts as e;

use crate::gl::card::pass::Made;
use crate::gl::geometry::vertex::Vertex;

/// Quadrilaterals at the end of a batch that Mesa draws together: those of consecutive calls of Begin and End.
#[derive(Clone, Debug)]
pub struct QuadRun {
    /// Their indices in the batch, six each.
    pub indices: Range<usize>,
    /// Whether the diagonals begin at first vertices.
    pub first: bool,
}

/// The two triangles of a quadrilateral, with the diagonal from its first vertex or from its second one.
pub fn halves([a, b, c, d]: [u32; 4], first: bool) -> [[u32; 3]; 2] {
    if first { [[a, b, c], [a, c, d]] } else { [[a, b, d], [b, c, d]] }
}

/// Steps of the depth buffer in a unit of polygon offset. The standard asks for a difference that can be resolved; Mesa takes two steps.
pub const OFFSET_STEPS: f32 = 2.0;

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
    pub sent: SentAttributes,
    /// Whether the program sends indices.
    pub indexed: bool,
}

/// Attributes that a draw sends even if they do not differ between vertices, each in its own array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SentAttributes {
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

impl SentAttributes {
    /// Whether the program has an array at a slot.
    pub fn has(self, slot: usize) -> bool {
        matches!(self, SentAttributes::Arrays { slots, .. } if slots & 1 << slot != 0)
    }

    /// The least number of components of an attribute with up to four.
    pub fn least(self, slot: usize) -> usize {
        match self {
            SentAttributes::Read => 4,
            SentAttributes::Arrays { position, .. } if slot == 0 => position.max(2),
            SentAttributes::Arrays { .. } => 2,
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
    pub sent: Option<SentAttributes>,
    /// The quadrilaterals at its end.
    pub quads: Option<QuadRun>,
    /// Where the program began to draw it; none: by the call that runs.
    pub made: Option<Made>,
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
