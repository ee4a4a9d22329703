//! From naga's IR to ours.
//!
//! The entry point's body is walked once, in order, with every call inlined. Variables that are only accessed at places known
//! at compile time never become memory: the walk keeps the current value of each of their components (`state`). An `if` merges two
//! states with selects. Only loops and functions that return early need mutable registers, which are written under the mask.
//! Pointers are places known to the compiler. A loop whose exits are decided at compile time is unrolled.

mod call;
mod control;
mod expression;
mod math;
mod memory;
mod place;
mod reflect;
mod statement;
mod texture;
mod writes;

use std::collections::HashMap;
use std::rc::Rc;

use naga::valid::{FunctionInfo, ModuleInfo};
use naga::{Expression, Function, GlobalVariable, Handle, Span};

use super::interface::Interface;
use super::ir::{Builder, V};
use super::module::{self, Module, ShaderError};
use super::types::{Ty, Types};
use num::Limit;
pub(super) use place::{AccessPath, Root};
pub(super) use reflect::lower;
pub(super) use writes::each_statement;

/// Why lowering stopped.
pub(super) enum Stop {
    /// The program cannot be run.
    Error(Box<ShaderError>),
    /// A loop cannot be unrolled; the attempt is undone.
    Unroll,
}

pub(super) type Result<T> = std::result::Result<T, Stop>;

/// The value of an expression.
#[derive(Clone, Debug)]
pub(super) enum Val {
    /// Components.
    Data(Rc<[V]>),
    /// A pointer.
    Place(Rc<AccessPath>),
    /// A texture or sampler, and the element of its binding array.
    Opaque(Handle<GlobalVariable>, Option<V>),
}

/// A variable of the function or private address space.
#[derive(Clone, Copy, Debug)]
pub(super) enum Var {
    /// Components are `state[base ..]`.
    State { base: usize },
    /// Components are a run of registers.
    Range { id: u32 },
}

/// How a function returns its result.
pub(super) enum Results {
    /// The only `return` is at its end.
    Tail,
    /// Early returns: lanes leave under the mask.
    Region {
        /// Mutable registers of the result.
        classes: Vec<u32>,
    },
}

/// Values of a loop's body for its continuing block. A value may be just the current contents of a mutable register. It is lost when a
/// `continue` writes that register, so it is copied where it is computed. Copies that the continuing block does not use are dead code.
pub(super) struct ContinuingValues {
    /// Depth of masks of the body: only what is computed there can be seen from the continuing block.
    pub depth: u32,
    /// Expression and the value that stays.
    pub values: Vec<(usize, Val)>,
}

/// A function being inlined.
pub(super) struct InlinedCall<'a> {
    pub function: &'a Function,
    pub info: &'a FunctionInfo,
    pub args: Vec<Val>,
    pub exprs: Vec<Option<Val>>,
    pub kept: Option<ContinuingValues>,
    pub locals: Vec<Var>,
    pub results: Results,
    pub returned: Option<Val>,
}

/// What `break`, `continue` and `return` leave.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum RegionKind {
    /// A loop at run time.
    Loop,
    /// An iteration of an unrolled loop.
    Unrolled,
    /// A switch.
    Switch,
    /// A function with early returns.
    Function,
}

/// An open region.
pub(super) struct Region {
    pub kind: RegionKind,
    /// Its first mask slot.
    pub slot: u16,
    /// Depth of masks where it began (loops: inside).
    pub depth: u32,
    /// Components that are merged at its end: index in the state, mutable register.
    pub merge: Vec<(usize, u32)>,
}

/// How a block ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Flow {
    /// At its end.
    Next,
    /// All lanes left an enclosing region under the mask; nothing after it runs.
    Left,
    /// All lanes break, decided at compile time.
    Broke,
    /// All lanes continue, decided at compile time.
    Continued,
    /// All lanes return, at the function's end.
    Returned,
}

/// The walk.
pub(super) struct Lowerer<'a> {
    pub module: &'a naga::Module,
    pub info: &'a ModuleInfo,
    pub types: Types<'a>,
    pub origin: &'a Module,
    pub entry: &'a str,
    pub b: Builder,
    pub state: Vec<V>,
    pub frames: Vec<InlinedCall<'a>>,
    pub regions: Vec<Region>,
    /// Open mask constructs.
    pub depth: u32,
    /// Next free mask slot.
    pub slot: u16,
    pub globals: HashMap<Handle<GlobalVariable>, Val>,
    /// Index in the interface's bindings.
    pub bindings: HashMap<Handle<GlobalVariable>, u16>,
    pub written_bindings: Vec<bool>,
    /// Which bindings are uniform buffers.
    pub uniform_bindings: Vec<bool>,
    pub global_exprs: HashMap<Handle<Expression>, Val>,
    pub writes: HashMap<Handle<Function>, Rc<writes::Writes>>,
    pub indexed: writes::Indexed,
    pub span: Span,
    /// First bytes of the lines of the source, if it is text.
    pub lines: Vec<u32>,
    pub range_top: u32,
    /// Instructions that unrolling may still add.
    pub unroll_budget: usize,
    /// Steps that unrolling may still take, attempts that failed included.
    pub unroll_steps: u64,
    /// Blocks and expressions that are being walked inside each other.
    pub level: u64,
    /// Whether each function returns early, for the functions that were asked about.
    pub early: HashMap<Option<Handle<Function>>, bool>,
    pub flags: Flags,
    pub shared_bytes: u32,
    /// Bytes of the immediates' type.
    pub immediate_size: u32,
}

/// Properties of the program that the walk finds.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Flags {
    pub derivatives: bool,
    pub discards: bool,
    pub side_effects: bool,
    pub barriers: bool,
    pub subgroups: bool,
    pub immediate_bytes: u32,
}

/// The result of lowering.
pub(super) struct Lowered {
    pub builder: Builder,
    pub interface: Interface,
    /// Value of each input's components.
    pub inputs: Vec<Vec<V>>,
    /// Value of each output's components.
    pub outputs: Vec<Vec<V>>,
    pub shared_bytes: u32,
}

impl<'a> Lowerer<'a> {
    /// An error at the current place.
    pub fn refuse<T>(&self, message: impl Into<String>) -> Result<T> {
        Err(Stop::Error(Box::new(self.error(message.into()))))
    }

    pub fn error(&self, message: String) -> ShaderError {
        let place = self.here();
        ShaderError { module: self.origin.name.to_string(), entry: Some(self.entry.to_owned()), place, message }
    }

    /// Goes on with a place of the source.
    pub fn go_to(&mut self, span: Span) {
        if self.span != span {
            self.span = span;
            self.b.line = self.here().and_then(module::ShaderLocation::line).unwrap_or(0);
        }
    }

    /// The current place, if the module has places.
    pub fn here(&self) -> Option<module::ShaderLocation> {
        let module::Places::Text(_, rewritten) = &self.origin.places else { return self.origin.places.of(self.span) };
        let at = rewritten.origin(self.span.to_range()?.start);
        let line = self.lines.partition_point(|&begin| begin as usize <= at);
        let begin = self.lines[line - 1] as usize;
        Some(module::ShaderLocation::Text { line: line as u32, column: (at - begin) as u32 + 1 })
    }

    pub fn frame(&self) -> &InlinedCall<'a> {
        self.frames.last().expect("a function is being lowered")
    }

    pub fn frame_mut(&mut self) -> &mut InlinedCall<'a> {
        self.frames.last_mut().expect("a function is being lowered")
    }

    /// The type of an expression of the current function.
    pub fn inner(&self, h: Handle<Expression>) -> &'a naga::TypeInner {
        let info: &'a FunctionInfo = self.frame().info;
        info[h].ty.inner_with(&self.module.types)
    }

    /// Refuses the program if it asks for more than a limit allows.
    pub fn within(&self, limit: Limit, asked: u64) -> Result<()> {
        limit.check(asked).or_else(|error| self.refuse(error.to_string()))
    }

    /// Counts steps of compiling that leave no instruction. An instruction takes about as long as moving eight components.
    pub fn spend(&mut self, steps: usize) -> Result<()> {
        self.b.steps += steps as u64;
        self.within(self.origin.limits.shader_instructions, self.b.steps)
    }

    /// Does work that may call itself for nested parts.
    pub fn deeper<T>(&mut self, work: impl FnOnce(&mut Self) -> Result<T>) -> Result<T> {
        self.level += 1;
        self.within(self.origin.limits.shader_nesting, self.level)?;
        self.spend(1)?;
        let result = work(self);
        self.level -= 1;
        result
    }

    /// Number of components of a type that a value or variable has.
    pub fn size(&self, ty: Ty) -> Result<usize> {
        let n = self.types.components(ty);
        self.within(self.origin.limits.shader_components, u64::from(n))?;
        Ok(n as usize)
    }

    pub fn zeros(&mut self, ty: Ty) -> Result<Vec<V>> {
        let zero = self.b.constant(0);
        Ok(vec![zero; self.size(ty)?])
    }

    /// The components of a value expression.
    pub fn data(&mut self, h: Handle<Expression>) -> Result<Rc<[V]>> {
        match self.eval(h)? {
            Val::Data(d) => Ok(d),
            _ => self.refuse("a pointer or resource is used as a value"),
        }
    }

    /// The only component of a scalar expression.
    pub fn scalar(&mut self, h: Handle<Expression>) -> Result<V> {
        Ok(self.data(h)?[0])
    }
}
