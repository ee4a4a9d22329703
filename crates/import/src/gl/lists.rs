//! Display lists: calls that are kept and run again.

use std::rc::Rc;

use super::arb::GENERICS;
use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Shape};
use super::consts as e;
use super::image::PixelStore;
use super::machine::Gl;
use super::state::{UNITS, Vertex};
use super::table::Entry;

/// Calls of all lists, and lists in each other (the standard's least maximum).
const LIST_MAX: usize = 1 << 24;
const NESTING_MAX: u32 = 64;

/// What a list does.
enum Step {
    /// A call.
    Call(Entry, Call),
    /// A call that has read pixels: how they lie in memory was settled when the list was made.
    Pixels(Entry, Call, PixelStore),
    /// Vertices of client arrays as they were when the list was made, and which attributes are theirs.
    Vertices(u32, Rc<[Vertex]>, u32),
}

/// A list.
#[derive(Default)]
pub struct List {
    steps: Vec<Step>,
}

impl List {
    /// Appends a call.
    pub fn push(&mut self, entry: Entry, call: &Call, unpack: &PixelStore) -> Result<(), String> {
        let pixels = unpack.buffer != 0 || call.args.iter().any(|arg| matches!(arg, Arg::Blob(_)));
        self.add(if pixels { Step::Pixels(entry, call.clone(), *unpack) } else { Step::Call(entry, call.clone()) })
    }

    fn add(&mut self, step: Step) -> Result<(), String> {
        if self.steps.len() >= LIST_MAX {
            return Err(format!("more than {LIST_MAX} calls in a display list"));
        }
        self.steps.push(step);
        Ok(())
    }
}

impl Gl {
    /// Draws vertices of client arrays, or keeps them in the list that is compiled. `arrays` has a bit for each attribute of theirs.
    pub fn vertices(&mut self, mode: u32, vertices: Vec<Vertex>, arrays: u32) -> Outcome {
        if let Some((_, execute, list)) = &mut self.compiling {
            let execute = *execute;
            list.add(Step::Vertices(mode, vertices.clone().into(), arrays)).map_err(Fault::Limit)?;
            if !execute {
                return Ok(());
            }
        }
        self.primitive(mode, &vertices)
    }

    fn run_list(&mut self, name: u32) -> Outcome {
        // A list that is not there does nothing, and neither does one that is nested too deep.
        let Some(list) = self.lists.get(&name).cloned() else { return Ok(()) };
        if self.depth >= NESTING_MAX {
            return Ok(());
        }
        self.depth += 1;
        let outcome = self.run_steps(&list);
        self.depth -= 1;
        outcome
    }

    fn run_steps(&mut self, list: &List) -> Outcome {
        for step in &list.steps {
            match step {
                Step::Call(entry, call) => {
                    let outcome = self.execute(*entry, call);
                    self.settle(call, outcome).map_err(Fault::Damaged)?;
                }
                Step::Pixels(entry, call, unpack) => {
                    let now = std::mem::replace(&mut self.unpack, *unpack);
                    let outcome = self.execute(*entry, call);
                    self.unpack = now;
                    self.settle(call, outcome).map_err(Fault::Damaged)?;
                }
                Step::Vertices(mode, vertices, arrays) => {
                    let current = self.state.current.clone();
                    let few = self.vertices_read(vertices.len());
                    let filled: Vec<Vertex> = vertices[..few].iter().map(|vertex| vertex.over(&current, *arrays)).collect();
                    self.primitive(*mode, &filled)?;
                }
            }
        }
        Ok(())
    }
}

/// Bits of the attributes that vertices share.
const MORE: u32 = ((1 << UNITS) - 2) << 8 | ((1 << GENERICS) - 2) << 16;

impl Vertex {
    /// This vertex, with attributes that are not in `arrays` from another one.
    pub fn over(&self, current: &Vertex, arrays: u32) -> Vertex {
        let mut vertex = self.clone();
        let has = |bit: u32| arrays & 1 << bit != 0;
        if !has(1) {
            vertex.normal = current.normal;
        }
        if !has(2) {
            vertex.color = current.color;
        }
        if !has(3) {
            vertex.secondary = current.secondary;
        }
        if !has(4) {
            vertex.fog = current.fog;
        }
        if !has(5) {
            vertex.edge = current.edge;
        }
        if !has(8) {
            vertex.set_texture(0, current.texture(0));
        }
        if arrays & MORE == 0 {
            vertex.share(current);
        } else {
            for unit in (1..UNITS).filter(|&unit| !has(8 + unit as u32)) {
                vertex.set_texture(unit, current.texture(unit));
            }
            for k in (1..GENERICS).filter(|&k| !has(16 + k as u32)) {
                vertex.set_generic(k, current.generic(k));
            }
        }
        vertex
    }
}

pub(super) fn new_list(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (name, mode) = (call.u32(0)?, call.u32(1)?);
    if name == 0 {
        return Err(INVALID_VALUE);
    }
    if gl.compiling.is_some() {
        return Err(INVALID_OPERATION);
    }
    let execute = match mode {
        e::COMPILE => false,
        e::COMPILE_AND_EXECUTE => true,
        _ => return Err(INVALID_ENUM),
    };
    gl.compiling = Some((name, execute, List::default()));
    Ok(())
}

pub(super) fn end_list(gl: &mut Gl, _: &Call, _: Shape) -> Outcome {
    let (name, _, list) = gl.compiling.take().ok_or(INVALID_OPERATION)?;
    gl.lists.insert(name, Rc::new(list));
    Ok(())
}

pub(super) fn call_list(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.run_list(call.u32(0)?)
}

pub(super) fn call_lists(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (count, kind) = (call.size(0)? as usize, call.u32(1)?);
    let bytes: Rc<[u8]> = match call.arg(2) {
        Arg::Blob(bytes) => bytes.clone(),
        Arg::Str(text) => text.as_bytes().into(),
        Arg::Nums(numbers) => {
            for &number in numbers.iter().take(count) {
                gl.run_list(gl.state.list_base.wrapping_add(number as i64 as u32))?;
            }
            return Ok(());
        }
        _ if count == 0 => return Ok(()),
        _ => return Err(Fault::Damaged("argument 2 has no list names".into())),
    };
    let size = match kind {
        e::BYTE | e::UNSIGNED_BYTE => 1,
        e::SHORT | e::UNSIGNED_SHORT | e::GL_2_BYTES => 2,
        e::GL_3_BYTES => 3,
        e::INT | e::UNSIGNED_INT | e::FLOAT | e::GL_4_BYTES => 4,
        _ => return Err(INVALID_ENUM),
    };
    for name in bytes.chunks_exact(size).take(count) {
        let mut raw = [0; 4];
        raw[..size].copy_from_slice(name);
        let offset = match kind {
            e::BYTE => raw[0] as i8 as u32,
            e::SHORT => i16::from_le_bytes([raw[0], raw[1]]) as u32,
            e::FLOAT => f32::from_le_bytes(raw) as i64 as u32,
            // The bytes of these come highest first.
            e::GL_2_BYTES | e::GL_3_BYTES | e::GL_4_BYTES => name.iter().fold(0, |all, &byte| all << 8 | u32::from(byte)),
            _ => u32::from_le_bytes(raw),
        };
        gl.run_list(gl.state.list_base.wrapping_add(offset))?;
    }
    Ok(())
}

pub(super) fn list_base(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.state.list_base = call.u32(0)?;
    Ok(())
}

pub(super) fn delete_lists(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (first, count) = (call.u32(0)?, call.size(1)?);
    let gone: Vec<u32> = gl.lists.range(first..first.saturating_add(count)).map(|(&name, _)| name).collect();
    for name in gone {
        gl.lists.remove(&name);
    }
    Ok(())
}
