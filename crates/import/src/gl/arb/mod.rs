//! Assembly programs: program objects, their parameters, and the programs that a draw uses. [`gl_shader::arb`] translates them.

mod key;
mod values;

use std::rc::Rc;

use num::{NameMap, NumberMap};

use gl_shader::arb::parse;
pub use gl_shader::arb::program::{GENERICS, Program, Stage, input};
use gl_shader::arb::program::{MATRICES, PARAMETERS};

use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Shape};
use super::machine::{Gl, components};
use super::state::Stack;
pub use values::state as state_value;

const VERTEX_PROGRAM: u32 = 0x8620;
const FRAGMENT_PROGRAM: u32 = 0x8804;
const VERTEX_PROGRAM_POINT_SIZE: u32 = 0x8642;
const VERTEX_PROGRAM_TWO_SIDE: u32 = 0x8643;
/// The first program matrix, as an argument of `glMatrixMode`.
pub const MATRIX0: u32 = 0x88c0;
const PROGRAM_FORMAT_ASCII: u32 = 0x8875;

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
pub struct Loaded {
    /// Its number.
    pub number: u32,
    /// The program.
    pub program: Rc<Program>,
}

/// A program object.
#[derive(Clone, Default)]
struct Object {
    local: Vec<[f32; 4]>,
    /// The program of its text, or the error in it.
    text: Option<Result<Loaded, String>>,
}

/// Program objects and the state that they share.
pub struct Programs {
    bound: [u32; 2],
    objects: NumberMap<u32, Object>,
    defaults: [Object; 2],
    environment: [Vec<[f32; 4]>; 2],
    /// Programs of each stage by their text.
    texts: [NameMap<Result<Loaded, String>>; 2],
    /// Numbers given to programs so far.
    numbers: u32,
    /// Matrices.
    pub matrices: [Stack; MATRICES],
}

/// The part of [`Programs`] that belongs to a context.
pub struct OfContext {
    bound: [u32; 2],
    environment: [Vec<[f32; 4]>; 2],
    matrices: [Stack; MATRICES],
}

impl Default for OfContext {
    fn default() -> Self {
        OfContext { bound: [0; 2], environment: Default::default(), matrices: std::array::from_fn(|_| Stack::new(4)) }
    }
}

/// The part of [`Programs`] that belongs to a share group.
#[derive(Default)]
pub struct OfGroup {
    objects: NumberMap<u32, Object>,
    defaults: [Object; 2],
}

impl OfGroup {
    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty()
    }
}

impl Default for Programs {
    fn default() -> Programs {
        let OfContext { bound, environment, matrices } = OfContext::default();
        let OfGroup { objects, defaults } = OfGroup::default();
        Programs { bound, objects, defaults, environment, texts: Default::default(), numbers: 0, matrices }
    }
}

/// A program that a draw uses, and the values of its parameters.
pub struct Active {
    /// Its number.
    pub number: u32,
    /// The program.
    pub program: Rc<Program>,
    /// Values of its parameters.
    pub values: Vec<[f32; 4]>,
}

impl Programs {
    fn object(&mut self, stage: Stage) -> &mut Object {
        match self.bound[stage as usize - 1] {
            0 => &mut self.defaults[stage as usize - 1],
            name => self.objects.get_or_insert_with(name, Default::default),
        }
    }

    /// A new program number.
    pub fn number(&mut self) -> u32 {
        self.numbers += 1;
        self.numbers
    }

    /// Exchanges what belongs to a context and its share group.
    pub fn exchange(&mut self, context: &mut OfContext, group: &mut OfGroup) {
        std::mem::swap(&mut self.bound, &mut context.bound);
        std::mem::swap(&mut self.environment, &mut context.environment);
        std::mem::swap(&mut self.matrices, &mut context.matrices);
        std::mem::swap(&mut self.objects, &mut group.objects);
        std::mem::swap(&mut self.defaults, &mut group.defaults);
    }

    /// The number of objects.
    pub fn len(&self) -> usize {
        self.objects.len()
    }
}

impl Gl {
    /// The enabled program of a stage.
    pub fn active_program(&mut self, stage: Stage) -> Outcome<Option<Active>> {
        if self.glsl.used() {
            return self.glsl_program(stage);
        }
        if self.state.programs & stage as u8 == 0 {
            return Ok(None);
        }
        let object = self.programs.object(stage).clone();
        match object.text {
            // Drawing without a program is an error.
            None => Err(INVALID_OPERATION),
            Some(Err(reason)) => Err(Fault::Unsupported(format!("drawing with a program whose {reason}"))),
            Some(Ok(Loaded { number, program })) => {
                let environment = &self.programs.environment[stage as usize - 1];
                let values = values::values(self, &program, environment, &object.local);
                Ok(Some(Active { number, program, values }))
            }
        }
    }
}

fn stage(target: u32) -> Outcome<Stage> {
    match target {
        VERTEX_PROGRAM => Ok(Stage::Vertex),
        FRAGMENT_PROGRAM => Ok(Stage::Fragment),
        _ => Err(INVALID_ENUM),
    }
}

pub(super) fn bind(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (stage, name) = (stage(call.u32(0)?)?, call.u32(1)?);
    gl.programs.bound[stage as usize - 1] = name;
    gl.programs.object(stage);
    Ok(())
}

pub(super) fn delete(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        gl.programs.objects.remove(name);
        for bound in gl.programs.bound.iter_mut().filter(|bound| **bound == name) {
            *bound = 0;
        }
    }
    Ok(())
}

/// `glProgramStringARB(target, format, length, text)`
pub(super) fn string(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.flush()?;
    let (stage, format, length) = (stage(call.u32(0)?)?, call.u32(1)?, call.size(2)? as usize);
    if format != PROGRAM_FORMAT_ASCII {
        return Err(INVALID_ENUM);
    }
    let text: Rc<str> = match call.arg(3) {
        Arg::Str(text) => text.clone(),
        Arg::Blob(bytes) => String::from_utf8_lossy(bytes.get(..length).unwrap_or(bytes)).into(),
        _ => return Err(Fault::Damaged("the program's text was not recorded".into())),
    };
    let programs = &mut gl.programs;
    let number = programs.number();
    let loaded = programs.texts[stage as usize - 1].get_or_insert_with(&text, || match parse(&text, stage) {
        Ok(program) => Ok(Loaded { number, program: Rc::new(program) }),
        Err(wrong) => Err(wrong.to_string()),
    });
    let loaded = loaded.clone();
    if let Err(reason) = &loaded {
        // A driver refuses such a text too; the previous program remains.
        gl.note_error(&format!("{}: GL_INVALID_OPERATION: {reason}", call.function.name));
        let object = gl.programs.object(stage);
        if !matches!(object.text, Some(Ok(_))) {
            object.text = Some(Err(format!("text is wrong: {reason} (call {})", call.number)));
        }
        return Ok(());
    }
    gl.programs.object(stage).text = Some(loaded);
    Ok(())
}

/// Sets parameters from this one on.
fn set(gl: &mut Gl, stage: Stage, local: bool, first: u32, values: &[f64]) -> Outcome {
    let list = if local { &mut gl.programs.object(stage).local } else { &mut gl.programs.environment[stage as usize - 1] };
    for (k, value) in values.chunks_exact(4).enumerate() {
        let at = first.checked_add(k as u32).filter(|&at| at < PARAMETERS).ok_or(INVALID_VALUE)? as usize;
        if list.len() <= at {
            list.resize(at + 1, [0.0; 4]);
        }
        list[at] = std::array::from_fn(|c| value[c] as f32);
    }
    Ok(())
}

pub(super) fn environment(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let (stage, index) = (stage(call.u32(0)?)?, call.u32(1)?);
    set(gl, stage, false, index, &components(call, shape, 2)?.0)
}

pub(super) fn local(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let (stage, index) = (stage(call.u32(0)?)?, call.u32(1)?);
    set(gl, stage, true, index, &components(call, shape, 2)?.0)
}

/// `glProgramEnvParameters4fvEXT(target, index, count, values)`
pub(super) fn environments(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (stage, index, values) = (stage(call.u32(0)?)?, call.u32(1)?, call.numbers(3)?);
    set(gl, stage, false, index, &values)
}

/// `glProgramLocalParameters4fvEXT(target, index, count, values)`
pub(super) fn locals(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (stage, index, values) = (stage(call.u32(0)?)?, call.u32(1)?, call.numbers(3)?);
    set(gl, stage, true, index, &values)
}

/// Sets the current value of a generic attribute; 0 sends a vertex.
pub(super) fn attribute_at(gl: &mut Gl, index: u32, value: [f32; 4]) -> Outcome {
    match index as usize {
        0 if gl.begun.is_some() => gl.vertex_at(value),
        // It stays for draws without an array of positions.
        0 => {
            gl.state.current.position = value;
            Ok(())
        }
        k if k < GENERICS => {
            gl.state.current.set_generic(k, value);
            Ok(())
        }
        _ => Err(INVALID_VALUE),
    }
}

/// `glVertexAttrib3f(index, ...)`
pub(super) fn attribute(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let value = components(call, shape, 1)?.0.map(|value| value as f32);
    attribute_at(gl, call.u32(0)?, value)
}

/// `glVertexAttrib4Nub(index, ...)`
pub(super) fn attribute_normalized(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let value = components(call, Shape { count: 4, ..shape }, 1)?.0.map(|value| shape.scalar.normalized(value));
    attribute_at(gl, call.u32(0)?, value)
}
