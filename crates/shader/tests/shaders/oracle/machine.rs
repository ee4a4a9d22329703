//! What runs: the world that all invocations share, and an invocation with its calls.

use std::collections::BTreeMap;

use gfx::texture::View;
use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{Block, Expression, Function, Handle, SwitchCase, TypeInner};

use super::groups::Request;
use super::value::{Value, broken, zero};
use super::{Bindings, Fault, Resource};

/// What all invocations share.
pub struct World<'a> {
    pub module: &'a naga::Module,
    pub info: &'a ModuleInfo,
    /// The entry point's number in the module.
    pub entry: usize,
    pub bindings: &'a mut Bindings,
    /// The immediates as bytes.
    pub immediates: Vec<u8>,
    /// Workgroup variables by their number in the module.
    pub workgroup: Vec<Option<Value>>,
    /// Sampled textures made ready for filters, by binding and element.
    pub views: BTreeMap<((u32, u32), u32), View>,
    /// Statements and expressions that may still run.
    pub steps: u64,
}

impl<'a> World<'a> {
    pub fn new(
        module: &'a naga::Module,
        info: &'a ModuleInfo,
        entry: usize,
        bindings: &'a mut Bindings,
        steps: u64,
    ) -> World<'a> {
        let immediates = bindings.immediates.iter().flat_map(|w| w.to_le_bytes()).collect();
        World { module, info, entry, bindings, immediates, workgroup: Vec::new(), views: BTreeMap::new(), steps }
    }

    /// What is bound; an element out of bounds is the last one.
    pub fn resource(&self, binding: (u32, u32), element: u32) -> Option<&Resource> {
        let elements = self.bindings.resources.get(&binding)?;
        elements.get(element as usize).or(elements.last())
    }

    /// The same, to change it.
    pub fn resource_mut(&mut self, binding: (u32, u32), element: u32) -> Option<&mut Resource> {
        let elements = self.bindings.resources.get_mut(&binding)?;
        let last = elements.len().checked_sub(1)?;
        elements.get_mut((element as usize).min(last))
    }

    /// Counts one step.
    pub fn step(&mut self) -> Result<(), Fault> {
        self.steps = self.steps.checked_sub(1).ok_or(Fault::Steps)?;
        Ok(())
    }

    /// The first values of the entry point's variables in an address space, by their number in the module.
    fn variables(&self, space: naga::AddressSpace) -> Result<Vec<Option<Value>>, Fault> {
        let used = self.info.get_entry_point(self.entry);
        let first = |(handle, variable): (Handle<naga::GlobalVariable>, &naga::GlobalVariable)| {
            if variable.space != space || used[handle].is_empty() {
                return Ok(None);
            }
            match variable.init {
                Some(init) => self.constant(init).map(Some),
                None => zero(self.module, variable.ty).map(Some),
            }
        };
        self.module.global_variables.iter().map(first).collect()
    }

    /// Fills workgroup memory with zeros.
    pub fn clear_workgroup(&mut self) -> Result<(), Fault> {
        self.workgroup = self.variables(naga::AddressSpace::WorkGroup)?;
        Ok(())
    }

    /// The first values of private variables.
    pub fn private_variables(&self) -> Result<Vec<Option<Value>>, Fault> {
        self.variables(naga::AddressSpace::Private)
    }

    /// A constant expression of the module.
    pub fn constant(&self, h: Handle<Expression>) -> Result<Value, Fault> {
        match self.module.global_expressions[h] {
            Expression::Literal(l) => Ok(Value::Number(super::number::literal(l)?)),
            Expression::Constant(c) => self.constant(self.module.constants[c].init),
            Expression::ZeroValue(ty) => zero(self.module, ty),
            Expression::Compose { ty, ref components } => {
                let parts = components.iter().map(|&c| self.constant(c)).collect::<Result<Vec<_>, _>>()?;
                compose(&self.module.types[ty].inner, parts)
            }
            Expression::Splat { size, value } => Ok(Value::vector(&vec![self.constant(value)?.number()?; size as usize])),
            ref other => Err(Fault::Unsupported(format!("the constant expression {other:?}"))),
        }
    }
}

/// A value of a type from its parts; a vector from scalars and vectors.
pub fn compose(ty: &TypeInner, parts: Vec<Value>) -> Result<Value, Fault> {
    let TypeInner::Vector { .. } = ty else { return Ok(Value::Parts(parts)) };
    let mut numbers = Vec::with_capacity(4);
    for part in &parts {
        part.flatten(&mut numbers)?;
    }
    Ok(Value::vector(&numbers))
}

/// A construct that is open in a function being called.
pub enum Control<'a> {
    /// A list of statements; `branch` tells which list of its construct it is.
    Block { branch: u32, statements: &'a Block, next: usize },
    /// Expressions that are being computed.
    Emit(naga::Range<Expression>),
    /// A loop in its turn `turn`.
    Loop { body: &'a Block, continuing: &'a Block, break_if: Option<Handle<Expression>>, turn: u32, in_continuing: bool },
    /// A switch in one of its cases.
    Switch { cases: &'a [SwitchCase], case: usize },
}

/// A function being called.
pub struct CallFrame<'a> {
    pub function: &'a Function,
    pub info: &'a FunctionInfo,
    pub arguments: Vec<Value>,
    /// Values of expressions that were emitted, and of results.
    pub expressions: Vec<Option<Value>>,
    pub locals: Vec<Value>,
    pub control: Vec<Control<'a>>,
    /// Where the caller wants the result.
    pub result: Option<Handle<Expression>>,
}

/// Waiting for other invocations.
pub struct Wait {
    /// The place in the program, turns of loops included: comparing two says which comes first.
    pub place: Vec<u32>,
    pub request: Request,
    /// Where the answer goes, in the innermost function.
    pub result: Option<Handle<Expression>>,
}

/// What an invocation does at present.
pub enum State {
    Runs,
    Waits(Box<Wait>),
    Ended,
}

/// One invocation.
pub struct Invocation<'a> {
    /// Its place in its batch or workgroup.
    pub index: usize,
    /// It only takes part in derivatives.
    pub helper: bool,
    pub discarded: bool,
    pub frames: Vec<CallFrame<'a>>,
    pub private: Vec<Option<Value>>,
    pub state: State,
    /// What the entry point returned.
    pub result: Option<Value>,
}

impl<'a> Invocation<'a> {
    /// Whether what it does to memory counts.
    pub fn has_effects(&self) -> bool {
        !self.helper && !self.discarded
    }

    /// The innermost function.
    pub fn frame(&mut self) -> Result<&mut CallFrame<'a>, Fault> {
        self.frames.last_mut().ok_or_else(|| Fault::Unsupported("no function is being called".into()))
    }

    /// Begins a call.
    pub fn call(
        &mut self,
        world: &mut World<'a>,
        function: &'a Function,
        info: &'a FunctionInfo,
        arguments: Vec<Value>,
        result: Option<Handle<Expression>>,
    ) -> Result<(), Fault> {
        self.frames.push(CallFrame {
            function,
            info,
            arguments,
            expressions: vec![None; function.expressions.len()],
            locals: Vec::with_capacity(function.local_variables.len()),
            control: vec![Control::Block { branch: 0, statements: &function.body, next: 0 }],
            result,
        });
        for (_, local) in function.local_variables.iter() {
            let value = match local.init {
                Some(init) => self.evaluate(world, init)?,
                None => zero(world.module, local.ty)?,
            };
            self.frame()?.locals.push(value);
        }
        Ok(())
    }

    /// Ends a call. A function with a result that ends without `return` gives zero.
    pub fn leave(&mut self, world: &World<'a>, value: Option<Value>) -> Result<(), Fault> {
        let Some(frame) = self.frames.pop() else { return broken("a return out of no function") };
        let value = match (value, &frame.function.result) {
            (None, Some(result)) => Some(zero(world.module, result.ty)?),
            (value, _) => value,
        };
        match (self.frames.last_mut(), frame.result) {
            (Some(caller), Some(h)) => caller.expressions[h.index()] = value,
            (Some(_), None) => {}
            (None, _) => {
                self.result = value;
                self.state = State::Ended;
            }
        }
        Ok(())
    }

    /// The place that the invocation has come to; `last` tells places inside of a statement apart.
    pub fn place(&self, last: usize) -> Vec<u32> {
        let mut out = Vec::new();
        for frame in &self.frames {
            for control in &frame.control {
                match *control {
                    Control::Block { branch, next, .. } => out.extend([branch, next as u32]),
                    Control::Loop { turn, .. } => out.push(turn),
                    Control::Emit(_) | Control::Switch { .. } => {}
                }
            }
        }
        out.push(last as u32);
        out
    }

    /// Waits for others.
    pub fn wait(&mut self, last: usize, request: Request, result: Option<Handle<Expression>>) {
        self.state = State::Waits(Box::new(Wait { place: self.place(last), request, result }));
    }
}
