//! The OpenGL machine: calls in, commands for the card out.

use std::path::Path;
use std::rc::Rc;

use gl_shader::consts as e;
use glam::Mat4;
use num::{Limits, NameMap};

use crate::gl::call::{Call, Function, GlResult, INVALID_OPERATION, Shape};
use crate::gl::card::device::Card;
use crate::gl::card::pass::Made;
use crate::gl::log::Log;
use crate::gl::state::arb::{MATRIX0, ProgramTexts};
use crate::gl::state::buffers::Renames;
use crate::gl::state::contexts::{Context, Contexts, Objects};
use crate::gl::state::drawing::Drawing;
use crate::gl::state::glsl::GlslTranslations;
use crate::gl::state::server::State;
use crate::gl::state::transform::Stack;

/// The matrix by which a call multiplies the current one.
pub type Factor = fn(&Call) -> GlResult<Mat4>;

/// How a recording is converted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Options {
    /// Whether what the standard leaves open is as in Mesa; else the recording is one of GLInterceptor, and its pictures are ATTILA's.
    pub as_mesa: bool,
    /// Whether the recorder gives arrays in the program's memory for whole draws only, not for `glArrayElement`.
    pub elements_omitted: bool,
    /// Whether each primitive call is a draw, with its attributes in full.
    pub keep_draws: bool,
    /// Whether vertices are left out of draws, because only facts about the recording are collected.
    pub survey: bool,
}

/// How many calls have run, those of display lists included.
#[derive(Clone, Copy, Debug, Default)]
pub struct Progress {
    /// Calls that ran.
    pub steps: u64,
    /// Nesting depth of the lists that run.
    pub depth: u32,
    /// The value of `steps` when the outermost running list began.
    pub list_began: u64,
}

/// A function that the recording has called, and how often.
#[derive(Clone)]
pub struct CalledFunction {
    /// How it is run.
    pub handler: Handler,
    /// Its number and name.
    pub function: Rc<Function>,
    /// How often the recording calls it.
    pub times: u64,
}

/// The machine.
pub struct Gl {
    /// The card.
    pub card: Card,
    /// Contexts, of which one is current.
    pub contexts: Contexts,
    /// The server state of the current context.
    pub state: State,
    /// The other state of the current context.
    pub context: Context,
    /// The objects of its share group.
    pub objects: Objects,
    /// Assembly programs by their texts.
    pub programs: ProgramTexts,
    /// Translations of GLSL.
    pub glsl: GlslTranslations,
    /// The draw that is gathered.
    pub drawing: Drawing,
    /// Whether the window has an accumulation buffer, if the program has chosen the kind of window in the recording.
    pub accumulates: Option<bool>,
    /// New names of buffer objects that were deleted.
    pub renames: Renames,
    /// The functions that the recording calls, by their numbers.
    pub functions: Vec<Option<CalledFunction>>,
    /// Facts about the recording.
    pub log: Log,
    /// How many calls have run.
    pub progress: Progress,
    /// How the recording is converted.
    pub options: Options,
    /// Limits for the recording.
    pub limits: Limits,
}

impl Gl {
    /// A machine in its initial state; messages about its commands use `name`.
    pub fn new(name: &Path, limits: &Limits) -> Gl {
        Gl {
            card: Card::new(name),
            contexts: Contexts::default(),
            state: State::default(),
            context: Context::default(),
            objects: Objects::default(),
            programs: ProgramTexts::default(),
            glsl: GlslTranslations::default(),
            drawing: Drawing::default(),
            accumulates: None,
            renames: Renames::default(),
            functions: Vec::new(),
            log: Log::default(),
            progress: Progress::default(),
            options: Options { as_mesa: true, ..Options::default() },
            limits: *limits,
        }
    }

    /// Where the program draws now.
    pub fn made(&self) -> Made {
        Made { call: self.log.number, groups: self.log.groups.clone() }
    }

    /// How many of a primitive's `count` vertices are read: a survey needs only the first few to find what a draw requires.
    pub fn vertices_read(&self, count: usize) -> usize {
        if self.options.survey { count.min(4) } else { count }
    }

    /// A function that has been called.
    pub fn function(&self, id: u32) -> Option<(Handler, Rc<Function>)> {
        self.functions
            .get(id as usize)?
            .as_ref()
            .map(|called_function| (called_function.handler, called_function.function.clone()))
    }

    /// How a function that has been called is run.
    pub fn handler(&self, id: u32) -> Option<Handler> {
        self.functions.get(id as usize)?.as_ref().map(|called_function| called_function.handler)
    }

    /// The number of objects of the most numerous kind.
    pub fn most_objects(&self) -> usize {
        let others = [self.context.buffers.uniform.len(), self.context.framebuffers.objects.len(), self.glsl.len()];
        others.into_iter().fold(self.objects.most(), usize::max)
    }

    /// How often the recording calls functions, by name.
    pub fn calls(&self) -> NameMap<u64> {
        let mut calls = NameMap::new();
        for called_function in self.functions.iter().flatten() {
            *calls.get_or_insert_with(&called_function.function.name, || 0) += called_function.times;
        }
        calls
    }

    /// The current matrix stack. Only the texture units of fixed functions have matrices.
    pub fn stack(&mut self) -> GlResult<&mut Stack> {
        Ok(match self.state.transform.matrix_mode {
            e::PROJECTION => &mut self.context.matrices.projection,
            e::TEXTURE => self.context.matrices.texture.get_mut(self.state.texturing.active).ok_or(INVALID_OPERATION)?,
            e::COLOR => &mut self.context.matrices.color,
            mode @ MATRIX0.. => &mut self.context.programs.matrices[(mode - MATRIX0) as usize],
            _ => &mut self.context.matrices.modelview,
        })
    }
}

/// When a function may be called, and its effect on the batch.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CallClass {
    /// Also allowed between Begin and End; the batch continues.
    Vertex,
    /// As [`CallClass::Vertex`], but a display list stores its result at compilation.
    Element,
    /// Changes or reads the server's state.
    Server,
    /// As [`CallClass::Server`], but changes matrices alone, or their mode.
    Matrix,
    /// Changes only client state; display lists do not store it.
    Client,
    /// As [`CallClass::Client`], but changes the arrays of vertices alone, or draws from them.
    Arrays,
    /// Has no effect on pictures.
    Ignored,
    /// Belongs to the window system: a context need not be current.
    System,
}

/// A function of the machine.
pub type Run = fn(&mut Gl, &Call, Shape) -> GlResult;

/// The properties of a function.
#[derive(Clone, Copy)]
pub struct Handler {
    /// The function that runs it.
    pub run: Run,
    /// When it may be called.
    pub class: CallClass,
    /// The shape of its arguments, by the suffix of its name.
    pub shape: Shape,
    /// What it does between Begin and End.
    pub immediate: Immediate,
    /// The matrix by which it multiplies the current one, if it does no more.
    pub factor: Option<Factor>,
}

/// What a function does between Begin and End.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Immediate {
    /// It begins a primitive.
    Begin,
    /// It ends one.
    End,
    /// It sends a vertex with the current attributes.
    Vertex,
    /// It sets the current attribute of this bit of [`crate::gl::geometry::vertex::Vertex::over`].
    Attribute(u32),
    /// It sets texture coordinates of a unit that is an argument.
    Unit,
    /// It may set any attribute.
    Attributes,
    /// It leaves attributes as they are.
    Other,
}
