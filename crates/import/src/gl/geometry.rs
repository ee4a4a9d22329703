//! Primitives of display lists. Those that are drawn repeatedly stay on the card, so the cost of a frame does not grow with the vertices in
//! its lists.

use std::cell::{Cell, OnceCell, RefCell};
use std::rc::Rc;

use glam::Mat4;
use num::{BufferId, word_bytes};

use super::call::Outcome;
use super::card::Card;
use super::consts as e;
use super::machine::Gl;
use super::pack::{Drawn, Packing};
use super::primitive::{Batch, Class, Corners, class_of, is_upright, points_and_lines, triangles};
use super::resident::Kept;
use super::state::{UNITS, Vertex};
use super::summary::Summary;

/// Minimum number of vertices of a primitive that stays on the card. Smaller ones are joined with their neighbours to one draw.
const LEAST: usize = 192;
/// Maximum number of bytes that stay on the card: primitives of lists, and conversions of buffer objects.
pub const KEPT_MAX: u64 = 64 << 20;

/// A primitive of a list.
pub struct Geometry {
    /// The mode of the primitive.
    pub mode: u32,
    /// Vertices.
    pub vertices: Rc<[Vertex]>,
    /// Attributes that the list sets: bits of [`Vertex::over`]. The others are the current ones when it is drawn.
    pub own: u32,
    /// Whether it has been drawn.
    drawn: Cell<bool>,
    summary: OnceCell<(Summary, bool)>,
    on_card: RefCell<Vec<OnCard>>,
}

/// Its buffers for draws of one kind.
struct OnCard {
    packing: Packing,
    upright: bool,
    buffers: [BufferId; 2],
    bytes: u64,
    count: u32,
}

impl Geometry {
    /// Vertices that a list gives, with the attributes of `own`.
    pub fn new(mode: u32, vertices: Rc<[Vertex]>, own: u32) -> Geometry {
        Geometry { mode, vertices, own, drawn: Cell::new(false), summary: OnceCell::new(), on_card: RefCell::new(Vec::new()) }
    }

    /// The summary of its vertices, and whether some are upright rectangles.
    fn summary(&self) -> &(Summary, bool) {
        self.summary.get_or_init(|| {
            let rectangles = self.mode == e::QUADS
                && self.vertices.chunks_exact(4).any(|four| is_upright([0, 1, 2, 3].map(|k| four[k].position)));
            (Summary::of(&self.vertices), rectangles)
        })
    }

    /// The constant attributes and the summary, for these current attributes.
    pub fn over(&self, current: &Vertex) -> (Vertex, Summary) {
        let constant = self.vertices[0].over(current, self.own);
        let mut summary = self.summary().0.clone();
        for unit in (0..UNITS).filter(|unit| self.own & 1 << (8 + unit) == 0) {
            summary.texture[unit] = if constant.texture(unit)[3] == 1.0 { 2 } else { 4 };
        }
        (constant, summary)
    }

    /// Its triangles, lines or points.
    fn indices(&self, upright: bool) -> Vec<u32> {
        let n = self.vertices.len() as u32;
        if class_of(self.mode) != Class::Triangles {
            return points_and_lines(self.mode, n);
        }
        let rectangle = |corners: Corners| upright && is_upright(corners.map(|corner| self.vertices[corner as usize].position));
        triangles(self.mode, n, &rectangle).into_flattened()
    }
}

impl Gl {
    /// Draws a primitive of a list.
    pub fn geometry(&mut self, geometry: &Geometry) -> Outcome {
        if self.render_mode != e::RENDER {
            return Ok(());
        }
        let seen = geometry.drawn.replace(true);
        if seen && self.stays(geometry) {
            self.flush()?;
            let mut batch = Batch { class: class_of(geometry.mode), ..Batch::default() };
            let outcome = self.draw(&mut batch, Some(Kept::List(geometry)));
            return self.settled(outcome);
        }
        let few = self.vertices_read(geometry.vertices.len());
        let (current, mut filled) = (self.state.current.clone(), std::mem::take(&mut self.spare));
        filled.extend(geometry.vertices[..few].iter().map(|vertex| vertex.over(&current, geometry.own)));
        let outcome = self.primitive(geometry.mode, &filled);
        filled.clear();
        self.spare = filled;
        outcome
    }

    /// Whether a primitive can be drawn from the card's memory: none of its vertices depends on the state.
    fn stays(&self, geometry: &Geometry) -> bool {
        let state = &self.state;
        geometry.vertices.len() >= LEAST
            && !self.survey
            && !self.keep_draws
            && self.card.kept_bytes < KEPT_MAX
            && !state.is(e::COLOR_LOGIC_OP)
            && match class_of(geometry.mode) {
                Class::Points => true,
                Class::Lines => state.line_width < 1.5 && !state.is(e::LINE_SMOOTH) && !self.line_stippled(),
                Class::Triangles => self.fills() && !self.sides_differ(&Batch { class: Class::Triangles, ..Batch::default() }),
            }
    }

    /// Frees the card's buffers of a list's primitive.
    pub fn free_geometry(&mut self, geometry: &Geometry) {
        for kept in geometry.on_card.take() {
            self.card.kept_bytes -= kept.bytes;
            let [vertices, indices] = kept.buffers;
            self.card.condemn(vertices, kept.bytes);
            self.card.condemn(indices, 0);
        }
    }
}

impl Card {
    /// The buffers of a primitive for draws of one kind, and the number of its indices; made once. `upright`: whether upright rectangles
    /// are treated as such.
    pub fn kept(&mut self, geometry: &Geometry, packing: Packing, upright: bool) -> ([BufferId; 2], u32) {
        let upright = upright && geometry.summary().1;
        let mut on_card = geometry.on_card.borrow_mut();
        if let Some(known) = on_card.iter().find(|known| known.upright == upright && known.packing.is_like(&packing)) {
            return (known.buffers, known.count);
        }
        let (mut vertices, mut indices) = (Vec::new(), Vec::new());
        let drawn = Drawn { vertices: &geometry.vertices, indices: &geometry.indices(upright) };
        packing.write(drawn, &Mat4::IDENTITY, false, &mut vertices, &mut indices);
        let count = indices.len() as u32;
        let indices = word_bytes(&indices);
        let bytes = (vertices.len() + indices.len()) as u64;
        let buffers = [("list", &vertices), ("list-indices", &indices)]
            .map(|(label, bytes)| self.recorder.create_buffer_init(label, bytes));
        self.kept_bytes += bytes;
        on_card.push(OnCard { packing, upright, buffers, bytes, count });
        (buffers, count)
    }
}
