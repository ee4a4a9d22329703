//! The compiler's intermediate form: values with one definition, mutable registers, and a builder that folds constants, shares
//! equal computations and moves what is the same for all invocations into the prologue.

use std::collections::{HashMap, HashSet};

use super::code::Code;
use super::module::ShaderLocation;
use super::options::Optimisations;
use super::program::{MemoryOp, SubgroupOp, TextureOp};

/// A value.
pub(super) type V = u32;

/// No value.
pub(super) const NONE: V = u32::MAX;

/// What a value is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Def {
    /// Known at compile time.
    Const(u32),
    /// Computed by the prologue.
    Uniform,
    /// Computed by the batch program, once; lanes differ.
    Temp,
    /// An input of the entry point.
    Input,
    /// The contents of a mutable register between two of its writes.
    Version(u32),
    /// A register of a range that is indexed at run time: range number and place in it.
    Element(u32, u32),
}

/// One instruction. Which `imm` means what is stated by each code.
#[derive(Clone, Debug)]
pub(super) struct Inst {
    pub code: Code,
    pub dst: Vec<V>,
    pub src: Vec<V>,
    pub imm: u32,
    /// Mask slots, in the order in which the executor wants them.
    pub slots: [u16; 3],
    /// Line of the source, from 1; 0 where that is not known.
    pub line: u32,
}

/// Number of operands of a texture instruction: the fixed places in `src`.
pub(super) mod texture_src {
    pub const ELEMENT: usize = 0;
    pub const SAMPLER_ELEMENT: usize = 1;
    pub const COORDINATE: usize = 2;
    pub const LAYER: usize = 5;
    pub const SAMPLE: usize = 6;
    pub const LEVEL: usize = 7;
    pub const GRADIENT_X: usize = 8;
    pub const GRADIENT_Y: usize = 11;
    pub const REFERENCE: usize = 14;
    pub const DATA: usize = 15;
    pub const COUNT: usize = 19;
}

/// A run of registers indexed at run time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Range {
    /// First register in the area of ranges; ranges of functions that are never active together overlap.
    pub start: u32,
}

#[derive(Clone, PartialEq, Eq, Hash)]
struct Key {
    code: Code,
    src: Vec<V>,
    imm: u32,
}

/// The program being built.
#[derive(Default)]
pub(super) struct Builder {
    pub optimisations: Optimisations,
    pub defs: Vec<Def>,
    pub insts: Vec<Inst>,
    pub prologue: Vec<Inst>,
    /// Memory accesses; their register fields are filled when registers are given out.
    pub memory: Vec<MemoryOp>,
    pub textures: Vec<TextureOp>,
    pub subgroup: Vec<SubgroupOp>,
    pub table: Vec<u32>,
    /// First entry and number of entries of each constant array in `table`.
    pub tables: Vec<(u32, u32)>,
    /// Runtime arrays whose length the program reads: binding, byte offset, stride.
    pub lengths: Vec<(u16, u32, u32)>,
    pub ranges: Vec<Range>,
    pub range_registers: u32,
    pub classes: u32,
    pub loops: Vec<Option<ShaderLocation>>,
    pub slots: u16,
    /// Line of the source from which instructions are made now, from 1; 0 where that is not known.
    pub line: u32,
    /// Steps taken so far, in instructions: what the budget of compiling counts.
    pub steps: u64,
    constants: HashMap<u32, V>,
    shared: HashMap<Key, V>,
    shared_uniform: HashMap<Key, V>,
    /// Keys added to `shared`, innermost scope last.
    log: Vec<Key>,
    /// Values that are known not to be below zero.
    nonnegative: HashSet<V>,
    memory_entries: HashMap<MemoryOp, u32>,
    table_entries: HashMap<Vec<u32>, u32>,
}

/// A state of the builder to return to.
pub(super) struct Mark {
    insts: usize,
    log: usize,
}

impl Builder {
    /// An empty program, to be built with these optimisations.
    pub fn new(optimisations: Optimisations) -> Builder {
        Builder { optimisations, ..Builder::default() }
    }

    pub fn constant(&mut self, bits: u32) -> V {
        if let Some(&v) = self.constants.get(&bits) {
            return v;
        }
        let v = self.define(Def::Const(bits));
        self.constants.insert(bits, v);
        v
    }

    pub fn float(&mut self, x: f32) -> V {
        self.constant(x.to_bits())
    }

    pub fn define(&mut self, def: Def) -> V {
        self.defs.push(def);
        (self.defs.len() - 1) as V
    }

    /// The bits of a constant.
    pub fn known(&self, v: V) -> Option<u32> {
        match self.defs[v as usize] {
            Def::Const(bits) => Some(bits),
            _ => None,
        }
    }

    /// Whether all invocations of a draw are known to have the same value.
    pub fn is_uniform(&self, v: V) -> bool {
        matches!(self.defs[v as usize], Def::Const(_) | Def::Uniform)
    }

    /// A new mutable register.
    pub fn class(&mut self) -> u32 {
        self.classes += 1;
        self.classes - 1
    }

    /// A name for the present contents of a mutable register.
    pub fn version(&mut self, class: u32) -> V {
        self.define(Def::Version(class))
    }

    pub fn push(&mut self, code: Code, dst: Vec<V>, src: Vec<V>, imm: u32) {
        self.steps += 1;
        self.insts.push(Inst { code, dst, src, imm, slots: [0; 3], line: self.line });
    }

    pub fn control(&mut self, code: Code, src: Vec<V>, imm: u32, slots: [u16; 3]) {
        self.steps += 1;
        self.insts.push(Inst { code, dst: Vec::new(), src, imm, slots, line: self.line });
    }

    /// An operation with one result.
    pub fn op(&mut self, code: Code, src: &[V]) -> V {
        self.op_imm(code, src, 0)
    }

    /// An operation with one result and an immediate.
    pub fn op_imm(&mut self, code: Code, src: &[V], imm: u32) -> V {
        if self.optimisations.fold
            && let Some(v) = self.simplify(code, src)
        {
            return v;
        }
        let v = self.ops(code, src, imm, 1, code.is_pure());
        let bound = |k: usize| src.get(k).and_then(|&s| self.known(s)).is_some_and(|b| f32::from_bits(b) >= 0.0);
        let nonnegative = match code {
            Code::FAbs | Code::FSaturate | Code::FSqrt | Code::Exp | Code::Exp2 | Code::UToF | Code::BoolToF => true,
            Code::FMax => bound(0) || bound(1),
            Code::FClamp => bound(1) && bound(2),
            _ => false,
        };
        if nonnegative {
            self.nonnegative.insert(v);
        }
        v
    }

    /// Whether a floating-point value is known not to be below zero.
    pub fn is_nonnegative(&self, v: V) -> bool {
        self.nonnegative.contains(&v)
    }

    /// An operation with several results, numbered in sequence from the returned one. `shareable`: equal operands give equal
    /// results, and it may run at any time (with uniform operands: in the prologue).
    pub fn ops(&mut self, code: Code, src: &[V], imm: u32, results: usize, shareable: bool) -> V {
        self.steps += 1;
        let uniform = shareable && self.optimisations.hoist && src.iter().all(|&s| s == NONE || self.is_uniform(s));
        let key = Key { code, src: src.to_vec(), imm };
        if shareable && self.optimisations.share {
            let found = if uniform { self.shared_uniform.get(&key) } else { self.shared.get(&key) };
            if let Some(&v) = found {
                return v;
            }
        }
        let first = self.defs.len() as V;
        for _ in 0..results {
            self.define(if uniform { Def::Uniform } else { Def::Temp });
        }
        let dst = (first..first + results as V).collect();
        let inst = Inst { code, dst, src: src.to_vec(), imm, slots: [0; 3], line: self.line };
        if uniform {
            self.prologue.push(inst);
            self.shared_uniform.insert(key, first);
        } else {
            self.insts.push(inst);
            if shareable {
                self.shared.insert(key.clone(), first);
                self.log.push(key);
            }
        }
        first
    }

    /// Folds constants and drops operations that change nothing (for floats only where that is exact).
    fn simplify(&mut self, code: Code, s: &[V]) -> Option<V> {
        if s.iter().all(|&v| self.known(v).is_some()) {
            let bits: Vec<u32> = s.iter().map(|&v| self.known(v).unwrap_or(0)).collect();
            if let Some(out) = code.fold(&bits) {
                return Some(self.constant(out));
            }
        }
        const ONE: u32 = 0x3f80_0000;
        let k = |i: usize| s.get(i).and_then(|&v| self.known(v));
        match code {
            Code::FMul if k(1) == Some(ONE) => Some(s[0]),
            Code::FMul if k(0) == Some(ONE) => Some(s[1]),
            Code::FDiv if k(1) == Some(ONE) => Some(s[0]),
            Code::IAdd | Code::Or | Code::Xor if k(1) == Some(0) => Some(s[0]),
            Code::IAdd | Code::Or | Code::Xor if k(0) == Some(0) => Some(s[1]),
            Code::ISub | Code::Shl | Code::ShrS | Code::ShrU if k(1) == Some(0) => Some(s[0]),
            Code::FSub if k(1) == Some(0) => Some(s[0]),
            Code::IMul if k(1) == Some(1) => Some(s[0]),
            Code::IMul if k(0) == Some(1) => Some(s[1]),
            Code::IMul if k(0) == Some(0) || k(1) == Some(0) => Some(self.constant(0)),
            Code::And if k(0) == Some(0) || k(1) == Some(0) => Some(self.constant(0)),
            Code::And if k(0) == Some(u32::MAX) => Some(s[1]),
            Code::And if k(1) == Some(u32::MAX) => Some(s[0]),
            // Division by a constant power of two.
            Code::UDiv if k(1).is_some_and(u32::is_power_of_two) => {
                let shift = self.constant(k(1).unwrap_or(1).trailing_zeros());
                Some(self.op(Code::ShrU, &[s[0], shift]))
            }
            Code::URem if k(1).is_some_and(u32::is_power_of_two) => {
                let mask = self.constant(k(1).unwrap_or(1) - 1);
                Some(self.op(Code::And, &[s[0], mask]))
            }
            Code::IMul if k(1).is_some_and(u32::is_power_of_two) => {
                let shift = self.constant(k(1).unwrap_or(1).trailing_zeros());
                Some(self.op(Code::Shl, &[s[0], shift]))
            }
            Code::UMin if k(1) == Some(u32::MAX) => Some(s[0]),
            Code::Select if k(0) == Some(0) => Some(s[2]),
            Code::Select if k(0).is_some() => Some(s[1]),
            Code::Select if s[1] == s[2] => Some(s[1]),
            // Division by a constant whose reciprocal is exact.
            Code::FDiv if k(1).is_some_and(|b| b & 0x007f_ffff == 0 && (1..254).contains(&(b >> 23 & 255))) => {
                let r = self.float(1.0 / f32::from_bits(k(1).unwrap_or(ONE)));
                Some(self.op(Code::FMul, &[s[0], r]))
            }
            _ => None,
        }
    }

    /// The entry of a memory access in its table; equal ones share one.
    pub fn memory_entry(&mut self, op: MemoryOp) -> u32 {
        if let Some(&entry) = self.memory_entries.get(&op) {
            return entry;
        }
        self.memory.push(op);
        let entry = (self.memory.len() - 1) as u32;
        self.memory_entries.insert(op, entry);
        entry
    }

    /// The number of a constant array in `tables`.
    pub fn table_entry(&mut self, values: &[u32]) -> u32 {
        if let Some(&entry) = self.table_entries.get(values) {
            return entry;
        }
        self.tables.push((self.table.len() as u32, values.len() as u32));
        self.table.extend_from_slice(values);
        let entry = (self.tables.len() - 1) as u32;
        self.table_entries.insert(values.to_vec(), entry);
        entry
    }

    /// The number of a runtime array in `lengths`.
    pub fn length_entry(&mut self, binding: u16, offset: u32, stride: u32) -> u32 {
        let wanted = (binding, offset, stride);
        let found = self.lengths.iter().position(|&l| l == wanted);
        found.unwrap_or_else(|| {
            self.lengths.push(wanted);
            self.lengths.len() - 1
        }) as u32
    }

    /// Enters a region whose computations may be skipped, so that later code cannot share them.
    pub fn scope(&self) -> usize {
        self.log.len()
    }

    /// Leaves it.
    pub fn leave(&mut self, scope: usize) {
        for key in self.log.drain(scope..) {
            self.shared.remove(&key);
        }
    }

    pub fn mark(&self) -> Mark {
        Mark { insts: self.insts.len(), log: self.log.len() }
    }

    /// Removes all instructions of the batch program since the mark. (Those of the prologue stay: they are valid everywhere, and dead
    /// code is removed later.)
    pub fn rewind(&mut self, mark: &Mark) {
        self.insts.truncate(mark.insts);
        self.leave(mark.log);
    }
}
