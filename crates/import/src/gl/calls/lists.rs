//! Display lists: calls that are stored and executed later.

use std::rc::Rc;

use gl_shader::consts as e;

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Shape, components};
use crate::gl::calls::immediate;
use crate::gl::geometry::listed::Geometry;
use crate::gl::machine::{Gl, Handler, Immediate};
use crate::gl::state::compact::CompactCall;
use crate::gl::state::lists::{List, Step};

const NESTING_MAX: u32 = 64;

/// The bit of the attribute that a call sets, and no other one.
fn attribute_of(handler: &Handler, call: &Call) -> Option<u32> {
    match handler.immediate {
        Immediate::Attribute(bit) => Some(1 << bit),
        Immediate::Unit => call.unit(0).ok().map(|unit| 1 << (8 + unit)),
        _ => None,
    }
}

impl Gl {
    /// Appends a call to the list that is compiled. Calls from Begin to End become one primitive if the list fixes which attributes its
    /// vertices set and which they take from the current state when the list runs.
    pub fn compile(&mut self, mut list: List, handler: Handler, call: &Call) -> Result<List, String> {
        let pixels = self.context.unpack.buffer != 0 || call.args.iter().any(|arg| matches!(arg, Arg::Blob(_)));
        let step = match CompactCall::of(call, &mut list.numbers) {
            _ if pixels => Step::Pixels(Box::new((call.clone(), self.context.unpack))),
            Some(compact) => match handler.factor.and_then(|factor| factor(call).ok()) {
                Some(by) => Step::Multiply(compact, Box::new(by)),
                None => Step::Numbers(compact),
            },
            None => Step::Call(Box::new(call.clone())),
        };
        list.add(step)?;
        match handler.immediate {
            Immediate::Begin => list.begun = Some(list.steps.len() - 1),
            Immediate::End => {
                if let Some(first) = list.begun.take() {
                    self.gather(&mut list, first);
                }
            }
            Immediate::Attribute(_) | Immediate::Unit if list.begun.is_none() => match attribute_of(&handler, call) {
                Some(bit) if self.aside(&mut list, |gl| (handler.run)(gl, call, handler.shape)).is_ok() => list.set(bit),
                _ => list.known = 0,
            },
            Immediate::Attributes if list.begun.is_none() => list.known = 0,
            _ => {}
        }
        Ok(list)
    }

    /// Runs a function with the current attributes of the list in place of those of the machine.
    fn aside<T>(&mut self, list: &mut List, run: impl FnOnce(&mut Gl) -> T) -> T {
        let now = list.now.get_or_insert_with(|| Box::new(self.state.current.clone()));
        std::mem::swap(&mut self.state.current, now);
        let result = run(self);
        std::mem::swap(&mut self.state.current, now);
        result
    }

    /// Replaces the steps from Begin to End by one primitive, if the list sets the same attributes for all its vertices.
    fn gather(&mut self, list: &mut List, first: usize) {
        let inside = list.steps.split_off(first);
        let (known, numbers) = (list.known, std::mem::take(&mut list.numbers));
        let made = self.aside(list, |gl| gl.primitive_of(&inside, &numbers, known));
        list.numbers = numbers;
        match made {
            Some((geometry, set)) => {
                if let Some(Step::Numbers(begin)) = inside.first() {
                    list.numbers.truncate(begin.first());
                }
                list.steps.extend(geometry.map(|geometry| Step::Primitive(Rc::new(geometry))));
                if let (true, Some(now)) = (set != 0, &list.now) {
                    list.steps.push(Step::Attributes(now.clone(), set));
                }
                list.known |= set;
            }
            None => {
                list.known = 0;
                let plain = |step: Step| self.plain(&step, &list.numbers).unwrap_or(step);
                list.steps.extend(inside.into_iter().map(plain));
            }
        }
    }

    /// What a step between Begin and End does, of those that programs send for each vertex: running it then takes less time.
    fn plain(&self, step: &Step, numbers: &[f32]) -> Option<Step> {
        let Step::Numbers(compact) = step else { return None };
        let (handler, mut call) = (self.handler(compact.function)?, self.room(compact)?);
        compact.fill(numbers, &mut call);
        let (call, shape) = (&call, handler.shape);
        Some(match handler.immediate {
            Immediate::Vertex => Step::Vertex(immediate::position(call, shape).ok()?),
            Immediate::Attribute(1) => Step::Normal(immediate::normal_of(call, shape).ok()?),
            Immediate::Attribute(2) => Step::Color(immediate::color_of(call, shape).ok()?),
            Immediate::Attribute(8) => Step::Texture(immediate::position(call, shape).ok()?),
            _ => return None,
        })
    }

    /// The primitive of the calls from Begin to End, and the bits of the attributes that they set.
    fn primitive_of(&mut self, inside: &[Step], numbers: &[f32], mut known: u32) -> Option<(Option<Geometry>, u32)> {
        let [Step::Numbers(begin), within @ .., _] = inside else { return None };
        let mut call = self.room(begin)?;
        begin.fill(numbers, &mut call);
        let mode = call.u32(0).ok().filter(|&mode| mode <= e::POLYGON)?;
        let (mut set, mut own, mut vertices) = (0, None, Vec::new());
        for step in within {
            let handler = match step {
                Step::Numbers(compact) => {
                    compact.fill(numbers, &mut call);
                    self.handler(compact.function)?
                }
                // A call with arguments in double precision.
                Step::Call(of) => {
                    call.args.clone_from(&of.args);
                    self.handler(of.function.id)?
                }
                _ => return None,
            };
            if handler.immediate == Immediate::Vertex {
                let (position, _) = components(&call, handler.shape, 0).ok()?;
                if *own.get_or_insert(known) != known {
                    return None;
                }
                let mut vertex = self.state.current.clone();
                vertex.position = position.map(|value| value as f32);
                vertices.push(vertex);
            } else {
                let bit = attribute_of(&handler, &call)?;
                (handler.run)(self, &call, handler.shape).ok()?;
                (known, set) = (known | bit, set | bit);
            }
        }
        let geometry = (!vertices.is_empty()).then(|| Geometry::new(mode, vertices.into(), own.unwrap_or(0)));
        Some((geometry, set))
    }

    /// An empty call of the same function, into which the compact one is expanded.
    fn room(&self, compact: &CompactCall) -> Option<Call> {
        let (_, function) = self.function(compact.function)?;
        Some(Call { number: self.log.number, place: 0, thread: 0, function, args: Vec::new(), result: Arg::Null })
    }

    fn run_list(&mut self, name: u32) -> GlResult {
        // Calling a list that does not exist, or that is nested too deep, has no effect.
        let Some(list) = self.objects.lists.get(name).cloned() else { return Ok(()) };
        if self.progress.depth >= NESTING_MAX {
            return Ok(());
        }
        if self.progress.depth == 0 {
            self.progress.list_began = self.progress.steps;
        }
        self.progress.depth += 1;
        let outcome = self.run_steps(&list);
        self.progress.depth -= 1;
        outcome
    }

    fn run_steps(&mut self, list: &List) -> GlResult {
        let mut room = None;
        let (mut dropped, mut skipping) = (false, false);
        for step in &list.steps {
            if skipping {
                skipping = self.immediate_of(step) != Some(Immediate::End);
                self.progress.steps += 1;
                continue;
            }
            if self.context.open_primitive.is_some() && self.immediate_of(step) == Some(Immediate::Begin) {
                self.primitive_within();
                skipping = true;
                continue;
            }
            match step {
                Step::Vertex(position) => self.vertex_at(*position)?,
                Step::Normal(normal) => self.state.current.normal = *normal,
                Step::Color(color) => self.state.current.color = *color,
                Step::Texture(coordinates) => self.state.current.set_texture(0, *coordinates),
                Step::Multiply(_, by)
                    if self.context.open_primitive.is_none()
                        && self.drawing.batch.indices.is_empty()
                        && self.stack().is_ok() =>
                {
                    // No batch ends here, and that is all that could go wrong.
                    self.drawing.after_small_list = false;
                    self.stack()?.top *= **by;
                    self.progress.steps += 1;
                }
                Step::Numbers(compact) | Step::Multiply(compact, _) => {
                    let Some((handler, function)) = self.function(compact.function) else { continue };
                    let Some(call) = room.take().or_else(|| self.room(compact)) else { continue };
                    let mut call = Call { function, ..call };
                    compact.fill(&list.numbers, &mut call);
                    let outcome = self.execute(handler, &call);
                    self.settle(&call, outcome).map_err(Fault::Damaged)?;
                    room = Some(call);
                }
                Step::Call(call) => {
                    let Some(handler) = self.handler(call.function.id) else { continue };
                    let outcome = self.execute(handler, call);
                    self.settle(call, outcome).map_err(Fault::Damaged)?;
                }
                Step::Pixels(of) => {
                    let (call, unpack) = &**of;
                    let Some(handler) = self.handler(call.function.id) else { continue };
                    let now = std::mem::replace(&mut self.context.unpack, *unpack);
                    let outcome = self.execute(handler, call);
                    self.context.unpack = now;
                    self.settle(call, outcome).map_err(Fault::Damaged)?;
                }
                Step::Primitive(_) if self.context.open_primitive.is_some() => {
                    self.primitive_within();
                    dropped = true;
                    self.progress.steps += 1;
                    continue;
                }
                Step::Primitive(geometry) => {
                    let outcome = self.geometry(geometry);
                    self.settled(outcome)?;
                }
                // What a dropped primitive leaves is dropped too.
                Step::Attributes(..) if dropped => {}
                Step::Attributes(vertex, bits) => {
                    let current = vertex.over(&self.state.current, *bits);
                    let position = std::mem::replace(&mut self.state.current, current).position;
                    self.state.current.position = position;
                }
                Step::Element(vertex, bits) => self.send_element(vertex, *bits),
            }
            dropped = false;
            self.progress.steps += 1;
        }
        Ok(())
    }

    /// Counts the error of a primitive of a list that runs while another primitive is open. As in Mesa, nothing of it is drawn, and the open
    /// one goes on.
    fn primitive_within(&mut self) {
        self.log.note_error("glBegin: GL_INVALID_OPERATION");
    }

    /// What a step that is a call does between Begin and End.
    fn immediate_of(&self, step: &Step) -> Option<Immediate> {
        match step {
            Step::Numbers(compact) => Some(self.handler(compact.function)?.immediate),
            Step::Call(call) => Some(self.handler(call.function.id)?.immediate),
            _ => None,
        }
    }

    /// Deletes a list.
    fn free_list(&mut self, name: u32) {
        if let Some(list) = self.objects.lists.remove(name) {
            list.free(&mut self.card);
        }
    }
}

pub fn new_list(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (name, mode) = (call.u32(0)?, call.u32(1)?);
    if name == 0 {
        return Err(INVALID_VALUE);
    }
    if gl.context.compiling.is_some() {
        return Err(INVALID_OPERATION);
    }
    let execute = match mode {
        e::COMPILE => false,
        e::COMPILE_AND_EXECUTE => true,
        _ => return Err(INVALID_ENUM),
    };
    gl.context.compiling = Some((name, execute, List::default()));
    Ok(())
}

pub fn end_list(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    let (name, _, mut list) = gl.context.compiling.take().ok_or(INVALID_OPERATION)?;
    list.join();
    let (mut steps, mut numbers) = (list.steps, list.numbers);
    steps.shrink_to_fit();
    numbers.shrink_to_fit();
    let list = List { steps, numbers, ..List::default() };
    gl.free_list(name);
    gl.objects.lists.insert(name, Rc::new(list));
    Ok(())
}

pub fn call_list(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.apply_materials()?;
    gl.run_list(call.u32(0)?)
}

pub fn call_lists(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.apply_materials()?;
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
            // The most significant byte of these comes first.
            e::GL_2_BYTES | e::GL_3_BYTES | e::GL_4_BYTES => name.iter().fold(0, |all, &byte| all << 8 | u32::from(byte)),
            _ => u32::from_le_bytes(raw),
        };
        gl.run_list(gl.state.list_base.wrapping_add(offset))?;
    }
    Ok(())
}

pub fn list_base(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.list_base = call.u32(0)?;
    Ok(())
}

pub fn delete_lists(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (first, count) = (call.u32(0)?, call.size(1)?);
    for name in gl.objects.lists.keys_in(first..first.saturating_add(count)) {
        gl.free_list(name);
    }
    Ok(())
}
