//! Display lists: calls that are stored and executed later.

use std::rc::Rc;

use glam::Mat4;

use crate::gl::call::Call;
use crate::gl::card::device::Card;
use crate::gl::geometry::listed::Geometry;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::compact::CompactCall;
use crate::gl::texels::unpack::PixelStore;

/// Limits: calls of all lists together, and the nesting depth of lists (the standard's minimum for `MAX_LIST_NESTING`).
const LIST_MAX: usize = 1 << 24;

/// One step of a list.
pub enum Step {
    /// A vertex at this position.
    Vertex([f32; 4]),
    /// Sets the current normal, colour, or texture coordinates of the first unit.
    Normal([f32; 3]),
    Color([f32; 4]),
    Texture([f32; 4]),
    /// A call with a few numbers.
    Numbers(CompactCall),
    /// A call that multiplies the current matrix, and by what.
    Multiply(CompactCall, Box<Mat4>),
    /// A call.
    Call(Box<Call>),
    /// A call that reads pixels, with the pixel storage modes of the moment when the list was compiled.
    Pixels(Box<(Call, PixelStore)>),
    /// Primitives: each between Begin and End, or from client arrays as they were when the list was compiled.
    Primitive(Rc<Geometry>),
    /// Sets the current attributes that these bits of [`Vertex::over`] select to those of the vertex.
    Attributes(Box<Vertex>, u32),
    /// An element of client arrays as they were when the list was compiled, and the bits of the attributes that the arrays give.
    Element(Box<Vertex>, u32),
}

/// A list.
#[derive(Default)]
pub struct List {
    /// Steps.
    pub steps: Vec<Step>,
    /// Arguments of calls.
    pub numbers: Vec<f32>,
    /// While the list is compiled: the current attributes in it, and (`known`) the bits of those that the list itself has set.
    pub now: Option<Box<Vertex>>,
    /// See [`List::now`].
    pub known: u32,
    /// The step of the Begin that has no End yet.
    pub begun: Option<usize>,
}

impl List {
    /// Appends a step.
    pub fn add(&mut self, step: Step) -> Result<(), String> {
        if self.steps.len() >= LIST_MAX {
            return Err(format!("more than {LIST_MAX} calls in a display list"));
        }
        self.steps.push(step);
        Ok(())
    }

    /// Replaces the last step, a call that sets the attribute of this bit, by its effect: primitives before and after it may then be joined.
    pub fn set(&mut self, bit: u32) {
        self.known |= bit;
        let Some(now) = self.now.clone() else { return };
        if let Some(Step::Numbers(call)) = self.steps.pop() {
            self.numbers.truncate(call.first());
        }
        if let Some(Step::Attributes(vertex, bits)) = self.steps.last_mut() {
            (*vertex, *bits) = (now, *bits | bit);
        } else {
            self.steps.push(Step::Attributes(now, bit));
        }
    }

    fn geometries(&self) -> impl Iterator<Item = &Geometry> {
        self.steps.iter().filter_map(|step| match step {
            Step::Primitive(geometry) => Some(&**geometry),
            _ => None,
        })
    }

    /// Frees what the card has of it.
    pub fn free(&self, card: &mut Card) {
        self.geometries().for_each(|geometry| card.free_geometry(geometry));
    }

    /// Joins consecutive primitives. What one of them leaves in the current attributes the next ones set themselves.
    pub fn join(&mut self) {
        let mut joined = Vec::with_capacity(self.steps.len());
        let mut run: Vec<Rc<Geometry>> = Vec::new();
        let mut left: Option<(Box<Vertex>, u32)> = None;
        for step in self.steps.drain(..) {
            match step {
                Step::Primitive(next) => {
                    let bits = left.as_ref().map_or(0, |(_, bits)| *bits);
                    if !run.last().is_none_or(|last| last.continues(&next)) || bits & !next.own != 0 {
                        joined.extend(Geometry::join(std::mem::take(&mut run)).map(Step::Primitive));
                        joined.extend(left.take().map(|(vertex, bits)| Step::Attributes(vertex, bits)));
                    }
                    run.push(next);
                }
                Step::Attributes(vertex, bits) if !run.is_empty() => {
                    // Those of the later one have the values of the earlier one, where they are not set again.
                    let before = left.take().map_or(0, |(_, bits)| bits);
                    left = Some((vertex, before | bits));
                }
                other => {
                    joined.extend(Geometry::join(std::mem::take(&mut run)).map(Step::Primitive));
                    joined.extend(left.take().map(|(vertex, bits)| Step::Attributes(vertex, bits)));
                    joined.push(other);
                }
            }
        }
        joined.extend(Geometry::join(run).map(Step::Primitive));
        joined.extend(left.map(|(vertex, bits)| Step::Attributes(vertex, bits)));
        self.steps = joined;
    }
}
