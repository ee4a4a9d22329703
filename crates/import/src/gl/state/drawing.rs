//! The draw that is gathered.

use std::collections::BTreeMap;
use std::rc::Rc;

use gl_shader::key::ShaderKey;
use num::NumberMap;

use crate::gl::geometry::listed::Geometry;
use crate::gl::geometry::primitive::{Batch, Elements};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::prepared::{Packings, PixelRectangle};

/// The draw that is gathered, and what the next ones can use of the last one.
#[derive(Default)]
pub struct Drawing {
    /// Primitives that wait for a draw.
    pub batch: Batch,
    /// The vertex memory of the previous primitive, for reuse.
    pub spare: Vec<Vertex>,
    /// The primitives of a list that the batch began with.
    pub first_listed: Option<Rc<Geometry>>,
    /// Whether the last draw was one of few vertices of a list from the card's memory, and nothing has changed the state since.
    pub after_small_list: bool,
    /// The pixel rectangle that is drawn.
    pub pixels: Option<PixelRectangle>,
    /// Whether indices select the vertices of the draw that runs.
    pub indexed: bool,
    /// Whether the vertices that are drawn come from a display list.
    pub from_list: bool,
    /// The instance that is drawn.
    pub instance: u32,
    /// With [`crate::gl::machine::Options::keep_draws`]: what the arrays of the current call send.
    pub elements: Option<Elements>,
    /// Layouts of vertices, by shader.
    pub packings: NumberMap<num::ShaderId, Packings>,
    /// Shaders by key.
    pub shaders: BTreeMap<ShaderKey, num::ShaderId>,
    /// Their labels and WGSL, in the order in which they were made.
    pub texts: Vec<(String, String)>,
}
