//! GLSL: shader and program objects. [`gl_shader::glsl`] translates them.

use std::collections::BTreeMap;
use std::rc::Rc;

use gl_shader::arb::program::ProgramStage;
use gl_shader::glsl::{Linked, Sources};
use num::{NameMap, NumberMap};

use crate::gl::call::{GlResult, INVALID_VALUE};
use crate::gl::state::arb::NumberedProgram;

/// A shader object.
#[derive(Clone)]
pub struct Shader {
    /// The stage; that of others is refused when a program with it draws.
    pub stage: Result<ProgramStage, u32>,
    /// Its source.
    pub source: Rc<str>,
    /// The source when it was compiled.
    pub compiled: Option<Rc<str>>,
}

/// A program object.
#[derive(Clone, Default)]
pub struct Object {
    /// Shaders.
    pub attached: Vec<u32>,
    /// Locations that the program has chosen.
    pub attributes: NameMap<u32>,
    /// Also which source of blending each is.
    pub outputs: NameMap<[u32; 2]>,
    /// What linking has made of it.
    pub executable: Executable,
    /// What it was before the last link, until the recording says how that went.
    pub before: Option<Executable>,
    /// Whether the last link has failed, as the recording says.
    pub failed: bool,
}

/// What linking makes of a program object.
#[derive(Clone, Default)]
pub struct Executable {
    /// The translation of its shaders, or why there is none.
    pub linked: Option<Result<Rc<Linked>, String>>,
    /// Names of uniforms by location.
    pub locations: NumberMap<u64, String>,
    /// Values of uniforms of both stages.
    pub values: [Vec<[f32; 4]>; 2],
    /// Units of samplers.
    pub units: NameMap<u32>,
    /// Names of uniform blocks by index, as the recorded driver has numbered them.
    pub block_names: NumberMap<u64, String>,
    /// Bindings of uniform blocks that the program has chosen.
    pub bindings: NameMap<u32>,
}

/// The key of a stage's translated program: the linked program, the stage, units of samplers, locations of attributes and outputs.
pub type CodeKey = (u32, ProgramStage, Vec<u32>, Vec<Option<[u32; 2]>>);

/// The shader and program objects of a share group.
#[derive(Default)]
pub struct GlslObjects {
    /// Shaders.
    pub shaders: NumberMap<u32, Shader>,
    /// Programs.
    pub programs: NumberMap<u32, Object>,
}

impl GlslObjects {
    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.shaders.is_empty() && self.programs.is_empty()
    }

    /// The number of objects of the most numerous kind.
    pub fn len(&self) -> usize {
        self.shaders.len().max(self.programs.len())
    }

    /// A program.
    pub fn program(&mut self, name: u32) -> GlResult<&mut Object> {
        self.programs.get_mut(name).ok_or(INVALID_VALUE)
    }

    /// What linking has made of a program.
    fn linked(&self, program: u32) -> Option<&Result<Rc<Linked>, String>> {
        self.programs.get(program)?.executable.linked.as_ref()
    }

    /// Whether a program has a stage. One that cannot be translated may have any.
    pub fn has(&self, program: u32, stage: ProgramStage) -> bool {
        match self.linked(program) {
            Some(Ok(linked)) => linked.stages[stage as usize - 1].is_some(),
            Some(Err(_)) => true,
            None => false,
        }
    }

    /// Whether a program reads the number of the vertex.
    pub fn numbers_vertices(&self, program: u32) -> bool {
        matches!(self.linked(program), Some(Ok(linked)) if linked.stages[0].as_ref().is_some_and(|stage| stage.numbered()))
    }

    /// Whether a program reads uniform blocks.
    pub fn reads_blocks(&self, program: u32) -> bool {
        match self.linked(program) {
            Some(Ok(linked)) => linked.stages.iter().flatten().any(|stage| !stage.blocks.is_empty()),
            _ => false,
        }
    }
}

/// What shaders and programs were translated to.
#[derive(Default)]
pub struct GlslTranslations {
    /// Linked programs by their sources.
    pub linked: BTreeMap<Sources, Result<Rc<Linked>, String>>,
    /// Stages for draws.
    pub codes: BTreeMap<CodeKey, Result<NumberedProgram, String>>,
}

impl GlslTranslations {
    /// The number of translations of the most numerous kind.
    pub fn len(&self) -> usize {
        self.linked.len().max(self.codes.len())
    }
}
