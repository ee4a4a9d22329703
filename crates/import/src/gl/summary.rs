//! Facts about the vertices of a draw that do not depend on its shader.

use super::arb::GENERICS;
use super::key::Varying;
use super::state::{UNITS, Vertex};

/// Which attributes differ between vertices, and how many components they need.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Attributes that differ.
    pub varying: Varying,
    /// Components of positions: 2 to 4.
    pub position: usize,
    /// Whether all colours have an alpha of 1.
    pub opaque: bool,
    /// Components of texture coordinates: 2 to 4.
    pub texture: [usize; UNITS],
    /// Components of generic attributes: 2 to 4.
    pub generic: [usize; GENERICS],
}

/// The number of components that an attribute needs if missing ones are 0, 0, 1.
fn components([_, _, z, w]: [f32; 4]) -> usize {
    if w != 1.0 {
        4
    } else if z != 0.0 {
        3
    } else {
        2
    }
}

/// Whether two attributes differ. All components are compared: that takes less time than to stop at the first.
fn differ<const N: usize>(a: [f32; N], b: [f32; N]) -> bool {
    (0..N).fold(false, |differ, k| differ | (a[k] != b[k]))
}

impl Summary {
    /// The summary of these vertices, at least one.
    pub fn of(vertices: &[Vertex]) -> Summary {
        let first = &vertices[0];
        let mut varying = Varying::default();
        let mut summary = Summary {
            varying,
            position: 2,
            opaque: true,
            texture: std::array::from_fn(|unit| components(first.texture(unit))),
            generic: std::array::from_fn(|k| components(first.generic(k))),
        };
        for vertex in vertices {
            summary.position = summary.position.max(components(vertex.position));
            summary.opaque &= vertex.color[3] == 1.0;
            // What has been found to differ is not compared again.
            varying.color = varying.color || differ(vertex.color, first.color);
            varying.normal = varying.normal || differ(vertex.normal, first.normal);
            varying.secondary = varying.secondary || differ(vertex.secondary, first.secondary);
            varying.fog = varying.fog || vertex.fog != first.fog;
            let shared = vertex.shares(first);
            for unit in 0..if shared { Vertex::UNSHARED } else { UNITS } {
                let coordinates = vertex.texture(unit);
                varying.texture[unit] = varying.texture[unit] || differ(coordinates, first.texture(unit));
                summary.texture[unit] = summary.texture[unit].max(components(coordinates));
            }
            if shared {
                continue;
            }
            for k in 1..GENERICS {
                let value = vertex.generic(k);
                varying.generic |= u16::from(value != first.generic(k)) << k;
                summary.generic[k] = summary.generic[k].max(components(value));
            }
        }
        Summary { varying, ..summary }
    }

    /// Whether a texture coordinate q other than 1 occurs.
    pub fn projective(&self, unit: usize) -> bool {
        self.texture[unit] == 4
    }
}

#[cfg(test)]
mod tests {
    use super::super::state::State;
    use super::*;

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
