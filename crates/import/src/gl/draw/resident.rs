//! Draws from buffer objects whose contents stay on the card. It reads the program's arrays with their own strides, offsets and formats, as a
//! real card does, so a buffer object that does not change is uploaded once.

use gfx::state::*;
use gl_shader::consts as e;

use crate::gl::call::{GlResult, Scalar};
use crate::gl::draw::streams::OnCard;
use crate::gl::geometry::primitive::{Batch, Class, SentAttributes, class_of, points_and_lines, triangles};
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::state::arrays::{ArrayView, GENERIC};
use crate::gl::state::buffers::Conversion;
use crate::gl::state::materials::tracked_parameters;
use crate::gl::state::placement::{Attribute, Indices, Resident};
use crate::gl::state::selection::{Selection, Selector};

/// The summary of vertices of these arrays; attributes without an array are those of `constant`.
fn summary_of(ready: &[ArrayView], constant: &Vertex) -> Summary {
    let mut summary = Summary::of(std::slice::from_ref(constant));
    // Components of arrays; only four of them hold a q.
    for array in ready.iter().filter(|array| array.instance.is_none()) {
        let (varying, size) = (&mut summary.varying, array.element.size.max(2) as u8);
        match array.slot {
            0 | GENERIC => summary.position = size,
            1 => varying.normal = true,
            2 => (varying.color, summary.opaque) = (true, size < 4),
            3 => varying.secondary = true,
            4 => varying.fog = true,
            5..8 => {}
            slot @ 8..GENERIC => (varying.texture[slot - 8], summary.texture[slot - 8]) = (true, size),
            slot => {
                varying.generic |= 1 << (slot - GENERIC);
                summary.generic[slot - GENERIC] = size;
            }
        }
    }
    summary
}

impl Gl {
    /// Draws vertices of arrays from the card's memory. False if it cannot read them from there; then nothing is drawn.
    pub fn draw_resident(&mut self, mode: u32, ready: &[ArrayView], selection: &Selection) -> GlResult<bool> {
        let Some((resident, batch)) = self.resident(mode, ready, selection)? else { return Ok(false) };
        self.flush()?;
        let mut batch = batch;
        let outcome = self.draw(&mut batch, Some(OnCard::Buffers(&resident)));
        self.settled(outcome)?;
        Ok(true)
    }

    /// A draw from the card's memory, if none of its vertices depends on the state and the card can read all.
    fn resident(&mut self, mode: u32, ready: &[ArrayView], selection: &Selection) -> GlResult<Option<(Resident, Batch)>> {
        let Some((class, topology, count)) = self.native(mode, selection.numbers.len() as u32) else { return Ok(None) };
        let state = &self.state;
        let other = self.options.survey || self.context.compiling.is_some() || !self.context.render_mode.draws();
        if other || ready.iter().any(|array| array.buffer.is_none()) {
            return Ok(None);
        }
        // As a triangle strip, a quadrilateral strip has each pair of vertices exchanged.
        let turned = mode == e::QUAD_STRIP && topology.is_some();
        let numbers = &selection.numbers[..count as usize];
        let Some((attributes, positions)) = Resident::attributes(ready) else { return Ok(None) };
        let can_read = |name: u32| self.objects.buffers.get(name).is_some_and(|object| self.card.can_read(object));
        let (Some(&first), Some(&last)) = (numbers.iter().min(), numbers.iter().max()) else { return Ok(None) };
        // Indices may select elements behind the end of a buffer object. The card reads zeros there, as Mesa does.
        let inside = |of: &Attribute| {
            let end = of.stride.checked_mul(u64::from(last)).and_then(|at| at.checked_add(of.bytes().end));
            end.is_some_and(|end| end <= of.size) || selection.by != Selector::Sequence && of.offset < of.size
        };
        let keeps = |name: u32, conversion: Conversion, costs: [u64; 3]| {
            self.objects.buffers.get(name).is_some_and(|object| self.card.keeps_conversion(object, conversion, costs))
        };
        let on_card = |of: &Attribute| match of.converted {
            Some(conversion) => keeps(of.buffer, conversion, [u64::from(count), of.size / of.stride, of.size]),
            None => can_read(of.buffer),
        };
        if !attributes.iter().all(|of| inside(of) && on_card(of)) {
            return Ok(None);
        }
        let constant = self.fetch(ready, numbers[0])?;
        let summary = summary_of(ready, &constant);
        // Whether colours keep a material depends on whether they differ.
        let colored = state.is(e::LIGHTING) && summary.varying.color && tracked_parameters(state) != [0; 2];
        if colored && self.context.material_tracking.unchanged(constant.color) != [0; 2] {
            return Ok(None);
        }
        let native = match selection.by {
            _ if topology.is_none() || turned => None,
            Selector::Sequence => Some(Indices::None(first)),
            Selector::Buffer { name, at, kind, base } if can_read(name) => {
                let format = match kind {
                    Scalar::Ushort => Some(IndexFormat::Uint16),
                    Scalar::Uint => Some(IndexFormat::Uint32),
                    _ => None,
                };
                let format = format.filter(|format| at.is_multiple_of(format.bytes() as usize));
                format.map(|format| Indices::Buffer { name, at: at as u64, format, base })
            }
            _ => None,
        };
        let (indices, count) = match native {
            Some(native) => (native, count),
            None => {
                let diagonals = if mode == e::QUADS && topology.is_none() && self.begins_diagonals() {
                    let position = |&number: &u32| Ok(self.fetch(ready, number)?.position);
                    self.diagonals(&numbers.iter().map(position).collect::<GlResult<Vec<_>>>()?, summary.varying.color)
                } else {
                    Vec::new()
                };
                let begins = diagonals.first() == Some(&true);
                let alike = diagonals.iter().all(|&other| other == begins);
                let made: Vec<u32> = match (class, topology) {
                    (_, Some(_)) if turned => (0..count).map(|i| numbers[i as usize ^ 1]).collect(),
                    (_, Some(_)) => numbers.to_vec(),
                    (Class::Triangles, None) => {
                        let corners = triangles(mode, count, &diagonals);
                        corners.as_flattened().iter().map(|&corner| numbers[corner as usize]).collect()
                    }
                    (_, None) => points_and_lines(mode, count).into_iter().map(|k| numbers[k as usize]).collect(),
                };
                let (name, kind, at, base) = match selection.by {
                    Selector::Buffer { name, at, kind, base } => (name, Some(kind), at, base),
                    _ => (positions.buffer, None, first as usize, 0),
                };
                let list = topology.is_none();
                let conversion = Conversion::Indices { mode, list, begins, kind, at, base, count: numbers.len() };
                let n = made.len() as u64;
                let own = alike && (selection.by == Selector::Sequence || kind.is_some());
                let kept = own && keeps(name, conversion, [n, 2 * n, 4 * n]);
                (Indices::Made(made, kept.then_some((name, conversion))), n as u32)
            }
        };
        let slots = ready.iter().filter(|array| array.instance.is_none()).fold(0, |all, array| all | 1 << array.slot);
        let sent = self.options.keep_draws.then_some(SentAttributes::Arrays { position: usize::from(summary.position), slots });
        let batch = Batch { class, topology, sent, turned, ..Batch::default() };
        let vertices = u64::from(first)..u64::from(last) + 1;
        Ok(Some((Resident { constant, summary, count, attributes, indices, vertices }, batch)))
    }

    /// How the card draws `n` vertices of a mode without a change to them: the type, the topology (none: a list of triangles with other
    /// indices), and the number of vertices.
    fn native(&mut self, mode: u32, n: u32) -> Option<(Class, Option<Topology>, u32)> {
        let class = class_of(mode);
        let plain = match class {
            Class::Points => {
                let apart = self.reaches_out();
                let state = &self.state;
                let one = state.point.size <= 1.0 && state.point.attenuation == [1.0, 0.0, 0.0] && !apart;
                one && !state.is(e::POINT_SMOOTH)
                    && !state.is(e::POINT_SPRITE)
                    && state.programs == 0
                    && self.context.glsl_program == 0
            }
            Class::Lines => !self.widens_lines() && !self.line_stippled(),
            Class::Triangles => n >= 3 && self.fills(),
        };
        if !plain {
            return None;
        }
        let (topology, count) = match mode {
            e::POINTS => (Some(Topology::PointList), n),
            e::LINES => (Some(Topology::LineList), n / 2 * 2),
            e::LINE_STRIP if n > 1 => (Some(Topology::LineStrip), n),
            e::LINE_LOOP if n > 1 => (None, n),
            _ if class == Class::Lines => return None,
            // Joined draws have these as triangles that begin with other vertices, which rounds otherwise.
            e::QUADS | e::QUAD_STRIP | e::POLYGON if !self.options.keep_draws => (None, n),
            _ => self.assembled(mode, n).map_or((None, n), |(topology, count)| (Some(topology), count)),
        };
        (count > 0).then_some((class, topology, count))
    }
}
