//! Vertices: the current attributes of the state, and those of primitives.

use std::rc::Rc;

use gl_shader::UNITS;
use gl_shader::arb::program::GENERICS;

/// Texture units whose coordinates are stored in the vertex itself. Few programs use more.
const OWN: usize = 2;

/// Attributes that most programs never change. Vertices share them.
#[derive(Clone, Debug, PartialEq)]
struct SharedAttributes {
    /// Texture coordinates of the other units.
    texture: [[f32; 4]; UNITS - OWN],
    /// Generic attributes.
    generic: [[f32; 4]; GENERICS],
}

/// A vertex with all its attributes.
#[derive(Clone, Debug, PartialEq)]
pub struct Vertex {
    /// Position in object space.
    pub position: [f32; 4],
    /// Normal.
    pub normal: [f32; 3],
    /// Primary colour.
    pub color: [f32; 4],
    /// Secondary colour.
    pub secondary: [f32; 3],
    /// Fog coordinate.
    pub fog: f32,
    /// Texture coordinates of the first units.
    own: [[f32; 4]; OWN],
    more: Rc<SharedAttributes>,
    /// Whether an edge of a polygon begins here.
    pub edge: bool,
    /// Depth offset of the polygon whose edge or corner it is.
    pub offset: f32,
}

impl Default for Vertex {
    /// The attributes that a program begins with.
    fn default() -> Vertex {
        let black = [0.0, 0.0, 0.0, 1.0];
        Vertex {
            position: black,
            normal: [0.0, 0.0, 1.0],
            color: [1.0; 4],
            secondary: [0.0; 3],
            fog: 0.0,
            own: [black; OWN],
            more: Rc::new(SharedAttributes { texture: [black; UNITS - OWN], generic: [black; GENERICS] }),
            edge: true,
            offset: 0.0,
        }
    }
}

impl Vertex {
    /// Texture coordinates of a unit.
    pub fn texture(&self, unit: usize) -> [f32; 4] {
        if unit < OWN { self.own[unit] } else { self.more.texture[unit - OWN] }
    }

    /// Sets texture coordinates of a unit.
    pub fn set_texture(&mut self, unit: usize, value: [f32; 4]) {
        if unit < OWN {
            self.own[unit] = value;
        } else if self.more.texture[unit - OWN] != value {
            Rc::make_mut(&mut self.more).texture[unit - OWN] = value;
        }
    }

    /// A generic attribute. Attribute 0 is the position and is not stored here.
    pub fn generic(&self, k: usize) -> [f32; 4] {
        self.more.generic[k]
    }

    /// Sets a generic attribute.
    pub fn set_generic(&mut self, k: usize, value: [f32; 4]) {
        if self.more.generic[k] != value {
            Rc::make_mut(&mut self.more).generic[k] = value;
        }
    }

    /// This vertex, with the attributes whose bit is not in `arrays` taken from `current`: bit 1 normal, 2 colour, 3 secondary colour,
    /// 4 fog coordinate, 5 edge flag, from 8 on texture coordinates, from 16 on generic attributes.
    #[inline]
    pub fn over(&self, current: &Vertex, arrays: u32) -> Vertex {
        let from = |bit: usize| if arrays & 1 << bit != 0 { self } else { current };
        let vertex = Vertex {
            position: self.position,
            normal: from(1).normal,
            color: from(2).color,
            secondary: from(3).secondary,
            fog: from(4).fog,
            edge: from(5).edge,
            own: std::array::from_fn(|unit| from(8 + unit).own[unit]),
            more: if arrays & MORE == 0 { current.more.clone() } else { self.more.clone() },
            offset: self.offset,
        };
        if arrays & MORE == 0 { vertex } else { vertex.with_more(current, arrays) }
    }

    /// The part of [`Vertex::over`] that few vertices need.
    fn with_more(mut self, current: &Vertex, arrays: u32) -> Vertex {
        let has = |bit: usize| arrays & 1 << bit != 0;
        for unit in (OWN..UNITS).filter(|&unit| !has(8 + unit)) {
            self.set_texture(unit, current.texture(unit));
        }
        for k in (1..GENERICS).filter(|&k| !has(16 + k)) {
            self.set_generic(k, current.generic(k));
        }
        self
    }

    /// Whether both vertices point to the same shared attributes; values are not compared. The shared attributes are the generic ones, and
    /// the texture coordinates of units from [`Vertex::UNSHARED`] on.
    pub fn shares(&self, other: &Vertex) -> bool {
        Rc::ptr_eq(&self.more, &other.more)
    }
}

/// Bits of the attributes that vertices share.
const MORE: u32 = ((1 << UNITS) - (1 << OWN)) << 8 | ((1 << GENERICS) - 2) << 16;

impl Vertex {
    /// Number of texture units whose coordinates are not shared between vertices.
    pub const UNSHARED: usize = OWN;
}
