//! Assembly programs: program objects and their parameters. [`gl_shader::arb`] translates them.

use std::rc::Rc;

use gl_shader::arb::parse;
use gl_shader::arb::program::{MATRICES, Program, ProgramStage};
use num::{NameMap, NumberMap};

use crate::gl::state::transform::Stack;

pub const VERTEX_PROGRAM: u32 = 0x8620;
pub const FRAGMENT_PROGRAM: u32 = 0x8804;
const VERTEX_PROGRAM_POINT_SIZE: u32 = 0x8642;
const VERTEX_PROGRAM_TWO_SIDE: u32 = 0x8643;
/// The first program matrix, as an argument of `glMatrixMode`.
pub const MATRIX0: u32 = 0x88c0;

/// Switches of programs: a bit each.
pub mod switch {
    /// Vertex programs.
    pub const VERTEX: u8 = 1;
    /// Fragment programs.
    pub const FRAGMENT: u8 = 2;
    /// Vertex programs write the point size.
    pub const POINT_SIZE: u8 = 4;
    /// Vertex programs write colours of back faces.
    pub const TWO_SIDE: u8 = 8;
}

/// The switch of a capability.
pub fn switch_of(cap: u32) -> Option<u8> {
    match cap {
        VERTEX_PROGRAM => Some(switch::VERTEX),
        FRAGMENT_PROGRAM => Some(switch::FRAGMENT),
        VERTEX_PROGRAM_POINT_SIZE => Some(switch::POINT_SIZE),
        VERTEX_PROGRAM_TWO_SIDE => Some(switch::TWO_SIDE),
        _ => None,
    }
}

/// A parsed program, and the number of its text among all distinct texts.
#[derive(Clone)]
pub struct NumberedProgram {
    /// Its number.
    pub number: u32,
    /// The program.
    pub program: Rc<Program>,
}

/// A program object.
#[derive(Clone, Default)]
pub struct Object {
    /// Its parameters.
    pub local: Vec<[f32; 4]>,
    /// The program of its text, or the error in it.
    pub text: Option<Result<NumberedProgram, String>>,
}

/// The programs that a context has bound, and the parameters that all of them read.
pub struct ProgramBindings {
    bound: [u32; 2],
    environment: [Vec<[f32; 4]>; 2],
    /// Matrices.
    pub matrices: [Stack; MATRICES],
}

impl Default for ProgramBindings {
    fn default() -> Self {
        ProgramBindings { bound: [0; 2], environment: Default::default(), matrices: std::array::from_fn(|_| Stack::new(4)) }
    }
}

impl ProgramBindings {
    /// Binds a program.
    pub fn bind(&mut self, stage: ProgramStage, name: u32) {
        self.bound[stage as usize - 1] = name;
    }

    /// Unbinds a program that is deleted.
    pub fn unbind(&mut self, name: u32) {
        self.bound.iter_mut().filter(|bound| **bound == name).for_each(|bound| *bound = 0);
    }

    /// The parameters that all programs of a stage read.
    pub fn environment(&self, stage: ProgramStage) -> &[[f32; 4]] {
        &self.environment[stage as usize - 1]
    }

    /// The parameters that all programs of a stage read, to be set.
    pub fn environment_mut(&mut self, stage: ProgramStage) -> &mut Vec<[f32; 4]> {
        &mut self.environment[stage as usize - 1]
    }
}

/// The program objects of a share group.
#[derive(Default)]
pub struct ProgramObjects {
    objects: NumberMap<u32, Object>,
    defaults: [Object; 2],
}

impl ProgramObjects {
    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty()
    }

    /// The number of objects.
    pub fn len(&self) -> usize {
        self.objects.len()
    }

    /// The object that is bound to a stage.
    pub fn bound(&mut self, bindings: &ProgramBindings, stage: ProgramStage) -> &mut Object {
        match bindings.bound[stage as usize - 1] {
            0 => &mut self.defaults[stage as usize - 1],
            name => self.objects.get_or_insert_with(name, Default::default),
        }
    }

    /// Deletes an object.
    pub fn remove(&mut self, name: u32) {
        self.objects.remove(name);
    }
}

/// The programs of all texts.
#[derive(Default)]
pub struct ProgramTexts {
    texts: [NameMap<Result<NumberedProgram, String>>; 2],
    /// Numbers given to programs so far.
    numbers: u32,
}

impl ProgramTexts {
    /// A new program number.
    pub fn number(&mut self) -> u32 {
        self.numbers += 1;
        self.numbers
    }

    /// The program of a text, or the error in it.
    pub fn load(&mut self, stage: ProgramStage, text: &str) -> Result<NumberedProgram, String> {
        let number = self.number();
        let load = || match parse(text, stage) {
            Ok(program) => Ok(NumberedProgram { number, program: Rc::new(program) }),
            Err(wrong) => Err(wrong.to_string()),
        };
        self.texts[stage as usize - 1].get_or_insert_with(text, load).clone()
    }
}

/// A program that a draw uses, and the values of its parameters.
pub struct ActiveProgram {
    /// Its number.
    pub number: u32,
    /// The program.
    pub program: Rc<Program>,
    /// Values of its parameters.
    pub values: Vec<[f32; 4]>,
}
