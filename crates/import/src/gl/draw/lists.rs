//! Primitives of display lists. Those that are drawn repeatedly stay on the card, so the cost of a frame does not grow with the vertices in
//! its lists.

use std::rc::Rc;

use crate::gl::call::GlResult;
use crate::gl::card::device::ON_CARD_MAX;
use crate::gl::draw::streams::OnCard;
use crate::gl::geometry::listed::Geometry;
use crate::gl::geometry::primitive::{Batch, Class};
use crate::gl::machine::Gl;

/// Minimum number of vertices that stay on the card. Fewer are joined with their neighbours to one draw, if there are any that can be joined.
const VERTICES_MIN: usize = 192;

impl Gl {
    /// Draws primitives of a list.
    pub fn geometry(&mut self, geometry: &Rc<Geometry>) -> GlResult {
        if !self.context.render_mode.draws() {
            return Ok(());
        }
        let seen = geometry.drawn.replace(true);
        let small = geometry.vertices.len() < VERTICES_MIN;
        // Small ones stay if they were not joined with others the last time, and would not be joined with the one before now.
        let worth = !small || geometry.alone.get() && !self.drawing.after_small_list;
        if seen && worth && self.stays(geometry) {
            self.flush()?;
            self.drawing.after_small_list = small;
            let mut batch = Batch { class: geometry.class(), ..Batch::default() };
            let outcome = self.draw(&mut batch, Some(OnCard::List(geometry)));
            return self.settled(outcome);
        }
        geometry.alone.set(false);
        let first = self.drawing.batch.indices.is_empty() && !self.drawing.after_small_list;
        let mut filled = std::mem::take(&mut self.drawing.spare);
        let mut outcome = Ok(());
        for (mode, range) in geometry.primitives() {
            let few = range.start..range.start + self.vertices_read(range.len());
            let current = &self.state.current;
            filled.clear();
            filled.extend(geometry.vertices[few].iter().map(|vertex| vertex.over(current, geometry.own)));
            self.drawing.from_list = true;
            outcome = self.primitive(mode, &filled);
            self.drawing.from_list = false;
            if outcome.is_err() {
                break;
            }
        }
        filled.clear();
        self.drawing.spare = filled;
        self.drawing.first_listed = (first && small).then(|| geometry.clone());
        outcome
    }

    /// Whether a primitive can be drawn from the card's memory: none of its vertices depends on the state.
    fn stays(&mut self, geometry: &Geometry) -> bool {
        !self.options.survey
            && !self.options.keep_draws
            && self.card.on_card_bytes < ON_CARD_MAX
            && match geometry.class() {
                Class::Points => true,
                Class::Lines => !self.widens_lines() && !self.line_stippled(),
                Class::Triangles => self.fills(),
            }
    }
}
