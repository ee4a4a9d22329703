//! The primitives of display lists, and their buffers on the card.

use std::cell::{Cell, OnceCell, RefCell};
use std::ops::Range;
use std::rc::Rc;

use gl_shader::UNITS;
use glam::Mat4;
use num::{BufferId, word_bytes};

use crate::gl::card::device::Card;
use crate::gl::geometry::pack::{DrawInput, Packing};
use crate::gl::geometry::primitive::{Class, class_of, points_and_lines, triangles};
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;

/// Bytes that two buffers take beside their contents, about.
const BUFFER_OVERHEAD: u64 = 512;

/// Consecutive primitives of a list that become points, that become lines, or that become triangles.
pub struct Geometry {
    /// The mode of each, and the number of its vertices.
    pub parts: Vec<(u32, u32)>,
    /// Vertices.
    pub vertices: Rc<[Vertex]>,
    /// Attributes that the list sets: bits of [`Vertex::over`]. The others are the current ones when it is drawn.
    pub own: u32,
    /// Whether it has been drawn.
    pub drawn: Cell<bool>,
    /// Whether it was the whole of a draw when it was last joined with its neighbours.
    pub alone: Cell<bool>,
    summary: OnceCell<Summary>,
    on_card: RefCell<Vec<ListBuffers>>,
}

/// Its buffers for draws of one kind.
struct ListBuffers {
    packing: Rc<Packing>,
    buffers: [BufferId; 2],
    bytes: u64,
    count: u32,
}

impl Geometry {
    /// Vertices that a list gives, with the attributes of `own`.
    pub fn new(mode: u32, vertices: Rc<[Vertex]>, own: u32) -> Geometry {
        Geometry::of(vec![(mode, vertices.len() as u32)], vertices, own)
    }

    fn of(parts: Vec<(u32, u32)>, vertices: Rc<[Vertex]>, own: u32) -> Geometry {
        let (drawn, alone) = (Cell::new(false), Cell::new(false));
        Geometry { parts, vertices, own, drawn, alone, summary: OnceCell::new(), on_card: RefCell::new(Vec::new()) }
    }

    /// What the primitives become.
    pub fn class(&self) -> Class {
        class_of(self.parts[0].0)
    }

    /// Whether a primitive that follows in a list, without a change of the state between them, may be joined.
    pub fn continues(&self, next: &Geometry) -> bool {
        self.class() == next.class() && self.own == next.own
    }

    /// Primitives that [continue](Geometry::continues) the first as one.
    pub fn join(all: Vec<Rc<Geometry>>) -> Option<Rc<Geometry>> {
        let [first, others @ ..] = &*all else { return None };
        if others.is_empty() {
            return all.into_iter().next();
        }
        // What the list does not set is the same for all.
        let vertices = all.iter().flat_map(|of| of.vertices.iter().map(|vertex| vertex.over(&first.vertices[0], first.own)));
        let parts = all.iter().flat_map(|of| of.parts.iter().copied()).collect();
        Some(Rc::new(Geometry::of(parts, vertices.collect(), first.own)))
    }

    /// The primitives: mode, and range of vertices.
    pub fn primitives(&self) -> impl Iterator<Item = (u32, Range<usize>)> {
        self.parts.iter().scan(0, |start, &(mode, count)| {
            let range = *start..*start + count as usize;
            *start = range.end;
            Some((mode, range))
        })
    }

    /// The summary of its vertices.
    fn summary(&self) -> &Summary {
        self.summary.get_or_init(|| Summary::of(&self.vertices))
    }

    /// The constant attributes and the summary, for these current attributes.
    pub fn over(&self, current: &Vertex) -> (Vertex, Summary) {
        let constant = self.vertices[0].over(current, self.own);
        let mut summary = *self.summary();
        for unit in (0..UNITS).filter(|unit| self.own & 1 << (8 + unit) == 0) {
            summary.texture[unit] = if constant.texture(unit)[3] == 1.0 { 2 } else { 4 };
        }
        (constant, summary)
    }

    /// Its triangles, lines or points.
    fn indices(&self) -> Vec<u32> {
        let mut all = Vec::new();
        for (mode, range) in self.primitives() {
            let (first, n) = (range.start as u32, range.len() as u32);
            let own = match class_of(mode) {
                Class::Triangles => triangles(mode, n, &[]).into_flattened(),
                Class::Points | Class::Lines => points_and_lines(mode, n),
            };
            all.extend(own.into_iter().map(|index| first + index));
        }
        all
    }
}

impl Card {
    /// Frees the card's buffers of a list's primitive.
    pub fn free_geometry(&mut self, geometry: &Geometry) {
        for kept in geometry.on_card.take() {
            self.on_card_bytes -= kept.bytes;
            let [vertices, indices] = kept.buffers;
            self.condemn(vertices, kept.bytes);
            self.condemn(indices, 0);
        }
    }

    /// The buffers of a primitive for draws of one kind, and the number of its indices; made once.
    pub fn list_buffers(&mut self, geometry: &Geometry, packing: &Rc<Packing>) -> ([BufferId; 2], u32) {
        let mut on_card = geometry.on_card.borrow_mut();
        if let Some(known) = on_card.iter().find(|known| known.packing.is_like(packing)) {
            return (known.buffers, known.count);
        }
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        let drawn = DrawInput { vertices: &geometry.vertices, indices: &geometry.indices() };
        packing.write(drawn, &Mat4::IDENTITY, false, &mut vertices, &mut indices);
        let count = indices.len() as u32;
        let indices = word_bytes(&indices);
        let bytes = BUFFER_OVERHEAD + (vertices.len() + indices.len()) as u64;
        let buffers = [("list", &vertices), ("list-indices", &indices)]
            .map(|(label, bytes)| self.recorder.create_buffer_init(label, bytes));
        self.on_card_bytes += bytes;
        on_card.push(ListBuffers { packing: packing.clone(), buffers, bytes, count });
        (buffers, count)
    }
}
