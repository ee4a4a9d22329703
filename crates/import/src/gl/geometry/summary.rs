//! Facts about the vertices of a draw that do not depend on its shader.

use gl_shader::UNITS;
use gl_shader::arb::program::GENERICS;
use gl_shader::key::Varying;

use crate::gl::geometry::vertex::Vertex;

/// Which attributes differ between vertices, and how many components they need.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Summary {
    /// Attributes that differ.
    pub varying: Varying,
    /// Components of positions: 2 to 4.
    pub position: u8,
    /// Whether all colours have an alpha of 1.
    pub opaque: bool,
    /// Components of texture coordinates: 2 to 4.
    pub texture: [u8; UNITS],
    /// Components of generic attributes: 2 to 4.
    pub generic: [u8; GENERICS],
}

/// The number of components that an attribute needs if missing ones are 0, 0, 1.
fn components([_, _, z, w]: [f32; 4]) -> u8 {
    if w != 1.0 {
        4
    } else if z != 0.0 {
        3
    } else {
        2
    }
}

/// Components that differ from those of a given value in at least one vertex. Nothing is skipped where that is known already: all
/// components are compared at once, which takes less time than to ask.
#[derive(Clone, Copy)]
struct Differing<const N: usize>([u32; N]);

impl<const N: usize> Differing<N> {
    const NONE: Self = Differing([0; N]);

    #[inline(always)]
    fn compare(&mut self, a: &[f32; N], b: &[f32; N]) {
        for k in 0..N {
            self.0[k] |= u32::from(a[k] != b[k]);
        }
    }

    fn any(self) -> bool {
        self.0.iter().any(|&differs| differs != 0)
    }
}

impl Differing<4> {
    /// The number of components that vectors need, if this has been compared with [`MISSING`].
    fn components(self) -> u8 {
        match self.0 {
            [.., 1] => 4,
            [.., 1, _] => 3,
            _ => 2,
        }
    }
}

/// What stands for missing components.
const MISSING: [f32; 4] = [0.0, 0.0, 0.0, 1.0];

impl Summary {
    /// The summary of these vertices, at least one.
    pub fn of(vertices: &[Vertex]) -> Summary {
        let first = &vertices[0];
        let mut summary = Summary {
            varying: Varying::default(),
            position: 2,
            opaque: true,
            texture: std::array::from_fn(|unit| components(first.texture(unit))),
            generic: std::array::from_fn(|k| components(first.generic(k))),
        };
        let own = |vertex: &Vertex| -> [[f32; 4]; Vertex::UNSHARED] { std::array::from_fn(|unit| vertex.texture(unit)) };
        let first_own = own(first);
        let (mut position, mut color, mut alpha) = (Differing::NONE, Differing::NONE, false);
        let (mut normal, mut secondary, mut fog) = (Differing::NONE, Differing::NONE, false);
        let (mut differ, mut needs) = ([Differing::NONE; Vertex::UNSHARED], [Differing::NONE; Vertex::UNSHARED]);
        for vertex in vertices {
            position.compare(&vertex.position, &MISSING);
            color.compare(&vertex.color, &first.color);
            alpha |= vertex.color[3] != 1.0;
            normal.compare(&vertex.normal, &first.normal);
            secondary.compare(&vertex.secondary, &first.secondary);
            fog |= vertex.fog != first.fog;
            for (unit, coordinates) in own(vertex).iter().enumerate() {
                differ[unit].compare(coordinates, &first_own[unit]);
                needs[unit].compare(coordinates, &MISSING);
            }
            if !vertex.shares(first) {
                summary.add_shared(vertex, first);
            }
        }
        (summary.position, summary.opaque) = (position.components(), !alpha);
        let varying = &mut summary.varying;
        (varying.color, varying.normal, varying.secondary, varying.fog) = (color.any(), normal.any(), secondary.any(), fog);
        for unit in 0..Vertex::UNSHARED {
            varying.texture[unit] = differ[unit].any();
            summary.texture[unit] = needs[unit].components();
        }
        summary
    }

    /// Adds the attributes that most vertices share, of one that does not.
    #[inline(never)]
    fn add_shared(&mut self, vertex: &Vertex, first: &Vertex) {
        for unit in Vertex::UNSHARED..UNITS {
            let coordinates = vertex.texture(unit);
            self.varying.texture[unit] |= coordinates != first.texture(unit);
            self.texture[unit] = self.texture[unit].max(components(coordinates));
        }
        for k in 1..GENERICS {
            let value = vertex.generic(k);
            self.varying.generic |= u16::from(value != first.generic(k)) << k;
            self.generic[k] = self.generic[k].max(components(value));
        }
    }

    /// Whether a texture coordinate q other than 1 occurs.
    pub fn projective(&self, unit: usize) -> bool {
        self.texture[unit] == 4
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gl::state::server::State;

    #[test]
    fn what_differs_and_what_it_needs_is_found_in_shared_and_own_attributes() {
        let first = State::default().current;
        let mut second = first.clone();
        second.position = [1.0, 2.0, 3.0, 1.0];
        second.color = [1.0, 1.0, 1.0, 0.5];
        second.set_texture(0, [0.0, 0.0, 0.0, 2.0]);
        second.set_texture(UNITS - 1, [0.0, 0.0, 1.0, 1.0]);
        second.set_generic(3, [0.0, 1.0, 0.0, 1.0]);
        let summary = Summary::of(&[first.clone(), second]);
        let mut varying = Varying { color: true, generic: 1 << 3, ..Varying::default() };
        (varying.texture[0], varying.texture[UNITS - 1]) = (true, true);
        assert_eq!(summary.varying, varying);
        assert!(!summary.opaque && summary.projective(0) && !summary.projective(UNITS - 1));
        assert_eq!((summary.position, summary.texture[1], summary.texture[UNITS - 1], summary.generic[3]), (3, 2, 3, 2));
        assert_eq!(Summary::of(&[first]).varying, Varying::default());
    }
}
