//! Questions about the state that decide how primitives are drawn.

use gfx::state::Topology;
use gl_shader::consts as e;

use crate::gl::geometry::primitive::Class;
use crate::gl::machine::Gl;
use crate::gl::state::fragments::{Stencil, StencilTest};

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
        if n < 3 || self.state.polygon.modes != [e::FILL; 2] {
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

    /// The stencil tests of front and back faces. Points and lines have no back face.
    pub fn stencil_tests(&self, class: Class) -> [Stencil; 2] {
        let StencilTest { sides, active_face, .. } = &self.state.stencil;
        let two_side = class == Class::Triangles && (self.state.is(e::STENCIL_TEST_TWO_SIDE_EXT) || active_face.is_none());
        [sides[0], sides[usize::from(two_side)]]
    }

    /// Whether diagonals begin at first vertices if all vertices are inside.
    pub fn begins_diagonals(&self) -> bool {
        !self.drawing.indexed && !self.drawing.from_list && !self.state.is(e::POLYGON_STIPPLE)
    }
}
