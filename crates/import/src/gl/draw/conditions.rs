//! Questions about the state that decide how primitives are drawn.

use gfx::state::Topology;
use gl_shader::consts as e;

use crate::gl::geometry::primitive::{Batch, Class};
use crate::gl::machine::Gl;
use crate::gl::state::fragments::Stencil;

impl Gl {
    /// Whether lines have a pattern with gaps.
    pub fn line_stippled(&self) -> bool {
        self.state.is(e::LINE_STIPPLE) && self.state.line.stipple.1 != 0xffff
    }

    /// Whether the faces that are not culled are filled.
    pub fn fills(&self) -> bool {
        let modes = self.state.polygon.modes;
        modes == [e::FILL; 2]
            || self.state.is(e::CULL_FACE)
                && match self.state.polygon.cull {
                    e::FRONT => modes[1] == e::FILL,
                    e::BACK => modes[0] == e::FILL,
                    _ => true,
                }
    }

    /// How the card assembles the vertices of a draw that is not joined with others, and how many of them.
    pub fn assembled(&self, mode: u32, n: u32) -> Option<(Topology, u32)> {
        if n < 3 || self.state.polygon.modes != [e::FILL; 2] || self.state.is(e::COLOR_LOGIC_OP) {
            return None;
        }
        match mode {
            e::TRIANGLES => Some((Topology::TriangleList, n / 3 * 3)),
            e::TRIANGLE_STRIP => Some((Topology::TriangleStrip, n)),
            e::TRIANGLE_FAN => Some((Topology::TriangleFan, n)),
            e::QUADS if n > 3 => Some((Topology::QuadList, n / 4 * 4)),
            // With flat shading, the provoking vertex differs from that of a fan or a strip.
            e::POLYGON if !self.state.lighting.flat => Some((Topology::TriangleFan, n)),
            e::QUAD_STRIP if n > 3 && !self.state.lighting.flat => Some((Topology::TriangleStrip, n / 2 * 2)),
            _ => None,
        }
    }

    /// Whether the depths of lines or points of polygons are offset. The card itself offsets triangles.
    pub fn offsets(&self, class: Class) -> bool {
        let switch = match class {
            Class::Triangles => return false,
            Class::Lines => e::POLYGON_OFFSET_LINE,
            Class::Points => e::POLYGON_OFFSET_POINT,
        };
        self.state.is(switch) && self.state.is(e::DEPTH_TEST) && self.state.polygon.offset != [0.0; 2]
    }

    /// Whether the stencil test has separate state for back-facing triangles.
    pub fn stencil_sides(&self) -> bool {
        let state = &self.state;
        state.is(e::STENCIL_TEST_TWO_SIDE_EXT)
            || state.stencil.active_face.is_none() && state.stencil.sides[0] != state.stencil.sides[1]
    }

    /// Whether the stencil test has other references or masks for back-facing triangles.
    pub fn sides_differ(&self, batch: &Batch) -> bool {
        let of = |side: &Stencil| (side.reference, side.read & 255, side.write & 255);
        let [front, back] = &self.state.stencil.sides;
        batch.class == Class::Triangles && self.state.is(e::STENCIL_TEST) && self.stencil_sides() && of(front) != of(back)
    }

    /// Whether diagonals begin at first vertices if all vertices are inside.
    pub fn begins_diagonals(&self) -> bool {
        !self.drawing.indexed && !self.drawing.from_list && !self.state.is(e::POLYGON_STIPPLE)
    }
}
