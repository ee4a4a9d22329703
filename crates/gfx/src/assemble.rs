//! Primitive assembly: from a stream of vertices to points, lines and triangles, as positions in that stream.
//!
//! Order of primitives and of the vertices in each is Vulkan's (which is WebGPU's and D3D's), so that the winding of every
//! triangle of a strip is that of its first. Incomplete primitives at the end of the stream vanish. A strip with restarts is several streams.
//! The provoking vertex, from which flat varyings are taken, is element [`provoking`] of what is emitted.

use super::state::Topology;

/// Vertices of one primitive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveKind {
    /// One vertex.
    Point,
    /// Two.
    Line,
    /// Three.
    Triangle,
}

impl PrimitiveKind {
    /// What a topology consists of.
    pub const fn of(topology: Topology) -> PrimitiveKind {
        match topology {
            Topology::PointList => PrimitiveKind::Point,
            Topology::LineList | Topology::LineStrip => PrimitiveKind::Line,
            _ => PrimitiveKind::Triangle,
        }
    }

    /// Number of vertices: 1, 2 or 3.
    pub const fn vertices(self) -> usize {
        match self {
            PrimitiveKind::Point => 1,
            PrimitiveKind::Line => 2,
            PrimitiveKind::Triangle => 3,
        }
    }
}

/// Which element of an emitted primitive is the provoking vertex.
pub const fn provoking(kind: PrimitiveKind, last: bool) -> usize {
    if last { kind.vertices() - 1 } else { 0 }
}

/// Primitives that a stream of `vertices` vertices makes.
pub const fn primitive_count(topology: Topology, vertices: u64) -> u64 {
    match topology {
        Topology::PointList => vertices,
        Topology::LineList => vertices / 2,
        Topology::LineStrip => vertices.saturating_sub(1),
        Topology::TriangleList => vertices / 3,
        Topology::TriangleStrip | Topology::TriangleFan => vertices.saturating_sub(2),
        Topology::QuadList => vertices / 4 * 2,
    }
}

/// Assembles a stream that arrives one vertex at a time, so that a draw of any length can be taken in pieces.
///
/// A primitive is emitted as three values; a line repeats its second, a point its only one.
#[derive(Clone, Copy, Debug)]
pub struct Assembler {
    topology: Topology,
    last: bool,
    /// The latest vertices; `held[0]` is the hub of a fan.
    held: [u32; 3],
    /// Vertices since the start, for lists modulo the size of a primitive.
    seen: u32,
}

impl Assembler {
    /// An assembler at the start of a stream; `provoking_last` says which convention flat varyings follow.
    pub fn new(topology: Topology, provoking_last: bool) -> Assembler {
        Assembler { topology, last: provoking_last, held: [0; 3], seen: 0 }
    }

    /// Takes the next vertex and emits what it completes (two triangles for the last corner of a quad).
    #[inline(always)]
    pub fn push(&mut self, vertex: u32, emit: &mut impl FnMut([u32; 3])) {
        let [h0, h1, h2] = self.held;
        match self.topology {
            Topology::PointList => emit([vertex; 3]),
            Topology::LineList => {
                if self.seen == 0 {
                    self.held[0] = vertex;
                    self.seen = 1;
                } else {
                    self.seen = 0;
                    emit([h0, vertex, vertex]);
                }
            }
            Topology::LineStrip => {
                if self.seen > 0 {
                    emit([h0, vertex, vertex]);
                }
                self.held[0] = vertex;
                self.seen = 1;
            }
            Topology::TriangleList => {
                if self.seen < 2 {
                    self.held[self.seen as usize] = vertex;
                    self.seen += 1;
                } else {
                    self.seen = 0;
                    emit([h0, h1, vertex]);
                }
            }
            Topology::TriangleStrip => {
                // `seen` counts 0, 1, then alternates 2 (an even triangle is next) and 3 (an odd one).
                match (self.seen, self.last) {
                    (0 | 1, _) => {}
                    (2, _) => emit([h0, h1, vertex]),
                    // The same cycle, turned so that the provoking vertex stands where the convention has it.
                    (_, false) => emit([h0, vertex, h1]),
                    (_, true) => emit([h1, h0, vertex]),
                }
                self.held = if self.seen == 0 { [vertex, 0, 0] } else { [if self.seen == 1 { h0 } else { h1 }, vertex, 0] };
                self.seen = if self.seen == 3 { 2 } else { self.seen + 1 };
            }
            Topology::TriangleFan => {
                match (self.seen, self.last) {
                    (0, _) => self.held[0] = vertex,
                    (1, _) => {}
                    (_, false) => emit([h1, vertex, h0]),
                    (_, true) => emit([h0, h1, vertex]),
                }
                self.held[1] = vertex;
                self.seen = (self.seen + 1).min(2);
            }
            Topology::QuadList => {
                if self.seen < 3 {
                    self.held[self.seen as usize] = vertex;
                    self.seen += 1;
                } else {
                    self.seen = 0;
                    // Both halves hold the corner whose flat varyings the whole quad shows: the first, or the last.
                    if self.last {
                        emit([h0, h1, vertex]);
                        emit([h1, h2, vertex]);
                    } else {
                        emit([h0, h1, h2]);
                        emit([h0, h2, vertex]);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triples(topology: Topology, last: bool, n: u32) -> Vec<[u32; 3]> {
        let (mut assembler, mut out) = (Assembler::new(topology, last), Vec::new());
        (0..n).for_each(|vertex| assembler.push(vertex, &mut |t| out.push(t)));
        out
    }

    #[test]
    fn counts_follow_the_specification() {
        // VK-GL-CTS: 16 vertices.
        let expected = [
            (Topology::PointList, 16),
            (Topology::LineList, 8),
            (Topology::LineStrip, 15),
            (Topology::TriangleList, 5),
            (Topology::TriangleStrip, 14),
            (Topology::TriangleFan, 14),
            (Topology::QuadList, 8),
        ];
        for (topology, n) in expected {
            for last in [false, true] {
                assert_eq!(triples(topology, last, 16).len(), n, "{topology:?}");
            }
            for vertices in 0..40 {
                let made = triples(topology, false, vertices).len() as u64;
                assert_eq!(made, primitive_count(topology, u64::from(vertices)), "{topology:?} {vertices}");
            }
        }
    }

    #[test]
    fn strips_keep_the_winding_and_the_provoking_vertex() {
        assert_eq!(triples(Topology::TriangleStrip, false, 6), [[0, 1, 2], [1, 3, 2], [2, 3, 4], [3, 5, 4]]);
        assert_eq!(triples(Topology::TriangleStrip, true, 6), [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]]);
        assert_eq!(triples(Topology::TriangleFan, false, 5), [[1, 2, 0], [2, 3, 0], [3, 4, 0]]);
        assert_eq!(triples(Topology::TriangleFan, true, 5), [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        assert_eq!(triples(Topology::QuadList, false, 4), [[0, 1, 2], [0, 2, 3]]);
        assert_eq!(triples(Topology::QuadList, true, 4), [[0, 1, 3], [1, 2, 3]]);
    }
}
