//! Loads, stores and atomics through places.

use naga::{AtomicFunction, Expression, Handle, TypeInner};

use super::place::Choice;
use super::{AccessPath, Lowerer, Result, Root, Val, Var};
use crate::code::Code;
use crate::ir::{Def, NONE, V};
use crate::program::{AtomicOp, MemoryOp, NO_REG, Space, Width};
use crate::types::{Cell, Shape};

/// A run of components that one operation moves.
struct Run {
    first: usize,
    count: usize,
    offset: u32,
    width: Width,
}

/// Groups cells into runs of up to four neighbours.
fn runs(cells: &[Cell]) -> Vec<Run> {
    let mut out: Vec<Run> = Vec::new();
    for (i, c) in cells.iter().enumerate() {
        let size = if c.width == Width::Half { 2 } else { 4 };
        if let Some(r) = out.last_mut()
            && r.count < 4
            && r.width == c.width
            && r.offset + size * r.count as u32 == c.offset
        {
            r.count += 1;
            continue;
        }
        out.push(Run { first: i, count: 1, offset: c.offset, width: c.width });
    }
    out
}

impl<'a> Lowerer<'a> {
    /// The place of a pointer expression.
    pub fn place(&mut self, h: Handle<Expression>) -> Result<std::rc::Rc<AccessPath>> {
        match self.eval(h)? {
            Val::Place(p) => Ok(p),
            _ => self.refuse("a value is used as a pointer"),
        }
    }

    /// Where the components of a place in memory lie, relative to its address.
    fn cells(&self, place: &AccessPath) -> Vec<Cell> {
        let mut cells = Vec::new();
        if place.is_shared() {
            let n = self.types.components(place.ty);
            cells.extend((0..n).map(|i| Cell { offset: place.offset + 4 * i, width: Width::Word }));
        } else {
            self.types.cells(place.ty, place.offset, &mut cells);
        }
        cells
    }

    /// An entry of the memory table, shared by equal accesses.
    fn memory_entry(&mut self, space: Space, run: &Run, uniform: bool, atomic: AtomicOp) -> u32 {
        let op = MemoryOp {
            space,
            element: NO_REG,
            data: [NO_REG; 4],
            count: run.count as u8,
            width: run.width,
            address: NO_REG,
            offset: run.offset,
            uniform,
            constant: matches!(space, Space::Buffer(binding) if self.uniform_bindings[usize::from(binding)]),
            atomic,
        };
        self.b.memory_entry(op)
    }

    pub fn load(&mut self, place: &AccessPath) -> Result<Val> {
        let n = self.size(place.ty)?;
        let (space, constant) = match place.root {
            Root::Var(var) => return Ok(Val::Data(self.load_variable(var, place, n).into())),
            Root::Memory { space, constant } => (space, constant),
        };
        if space == Space::Immediate {
            let last = self.cells(place).iter().map(|c| c.offset + 4).max().unwrap_or(0);
            // Where the place is chosen at run time, all of the variable may be read.
            let end = if place.address.is_some() { self.immediate_size } else { last };
            self.flags.immediate_bytes = self.flags.immediate_bytes.max(end);
        }
        let mut out = vec![NONE; n];
        let src = [place.address.unwrap_or(NONE), place.element.unwrap_or(NONE)];
        let uniform = src.iter().all(|&s| s == NONE || self.b.is_uniform(s));
        let cells = self.cells(place);
        // Uniform loads are done once per draw and one component each, so that equal ones are found.
        let pieces = if uniform && constant {
            let piece = |(i, c): (usize, &Cell)| Run { first: i, count: 1, offset: c.offset, width: c.width };
            cells.iter().enumerate().map(piece).collect()
        } else {
            runs(&cells)
        };
        for run in pieces {
            let entry = self.memory_entry(space, &run, uniform, AtomicOp::Add);
            let v = self.b.ops(Code::Load, &src, entry, run.count, constant);
            for k in 0..run.count {
                out[run.first + k] = v + k as V;
            }
        }
        Ok(Val::Data(out.into()))
    }

    pub fn store(&mut self, place: &AccessPath, value: &[V]) -> Result<()> {
        self.spend(value.len() / 8)?;
        let space = match place.root {
            Root::Var(var) => {
                self.store_variable(var, place, value);
                return Ok(());
            }
            Root::Memory { space, .. } => space,
        };
        self.note_write(space);
        let src = [place.address.unwrap_or(NONE), place.element.unwrap_or(NONE)];
        for run in runs(&self.cells(place)) {
            let entry = self.memory_entry(space, &run, false, AtomicOp::Add);
            let mut all = src.to_vec();
            all.extend_from_slice(&value[run.first..run.first + run.count]);
            self.b.push(Code::Store, vec![], all, entry);
        }
        Ok(())
    }

    fn note_write(&mut self, space: Space) {
        if let Space::Buffer(binding) = space {
            self.flags.side_effects = true;
            self.written_bindings[usize::from(binding)] = true;
        }
    }

    pub fn lower_atomic(
        &mut self,
        pointer: Handle<Expression>,
        fun: AtomicFunction,
        value: Handle<Expression>,
        result: Option<Handle<Expression>>,
    ) -> Result<()> {
        let place = self.place(pointer)?;
        let Root::Memory { space, .. } = place.root else {
            return self.refuse("an atomic in the function or private address space");
        };
        let Shape::Scalar(scalar) = self.types.shape(place.ty) else {
            return self.refuse("an atomic that is not a scalar");
        };
        if scalar.width != 4 {
            return self.refuse("64-bit atomics are not supported");
        }
        let atomic = self.atomic_op(fun, scalar.kind)?;
        let compare = match fun {
            AtomicFunction::Exchange { compare: Some(c) } => self.scalar(c)?,
            _ => NONE,
        };
        let v = self.scalar(value)?;
        self.note_write(space);
        let run = Run { first: 0, count: 1, offset: place.offset, width: Width::Word };
        let entry = self.memory_entry(space, &run, false, atomic);
        let src = [place.address.unwrap_or(NONE), place.element.unwrap_or(NONE), v, compare];
        let old = self.b.ops(Code::Atomic, &src, entry, 2, false);
        if let Some(h) = result {
            let two = matches!(self.inner(h), TypeInner::Struct { .. });
            let value: Vec<V> = if two { vec![old, old + 1] } else { vec![old] };
            self.frame_mut().exprs[h.index()] = Some(Val::Data(value.into()));
        }
        Ok(())
    }

    fn load_variable(&mut self, var: Var, place: &AccessPath, n: usize) -> Vec<V> {
        match var {
            Var::State { base } => self.load_state(base + place.offset as usize, &place.choices, n),
            Var::Range { id } => {
                let flat = self.flat_index(&place.choices);
                (0..n as u32)
                    .map(|k| {
                        let element = self.element(id, place.offset + k);
                        match flat {
                            None => self.copy(element),
                            Some((index, count)) => self.b.ops(Code::LoadIndexed, &[element, index], count, 1, false),
                        }
                    })
                    .collect()
            }
        }
    }

    /// The value at a place of the state chosen at run time: a select for each candidate.
    fn load_state(&mut self, at: usize, choices: &[Choice], n: usize) -> Vec<V> {
        let Some((choice, rest)) = choices.split_first() else {
            return self.state[at..at + n].to_vec();
        };
        let mut out = self.load_state(at + ((choice.count - 1) * choice.stride) as usize, rest, n);
        for k in (0..choice.count - 1).rev() {
            let candidate = self.load_state(at + (k * choice.stride) as usize, rest, n);
            let here = self.is_index(choice.index, k);
            for (o, c) in out.iter_mut().zip(candidate) {
                *o = self.b.op(Code::Select, &[here, c, *o]);
            }
        }
        out
    }

    fn is_index(&mut self, index: V, k: u32) -> V {
        let k = self.b.constant(k);
        self.b.op(Code::IEq, &[index, k])
    }

    fn store_variable(&mut self, var: Var, place: &AccessPath, value: &[V]) {
        match var {
            Var::State { base } => self.store_state(base + place.offset as usize, &place.choices, value, None),
            Var::Range { id } => {
                let flat = self.flat_index(&place.choices);
                for (k, &v) in value.iter().enumerate() {
                    let element = self.element(id, place.offset + k as u32);
                    match flat {
                        None => self.b.push(Code::Mov, vec![element], vec![v], 0),
                        Some((index, count)) => {
                            self.b.push(Code::StoreIndexed, vec![], vec![element, v, index], count);
                        }
                    }
                }
            }
        }
    }

    fn store_state(&mut self, at: usize, choices: &[Choice], value: &[V], condition: Option<V>) {
        let Some((choice, rest)) = choices.split_first() else {
            for (k, &v) in value.iter().enumerate() {
                let old = self.state[at + k];
                self.state[at + k] = match condition {
                    Some(c) => self.b.op(Code::Select, &[c, v, old]),
                    None => v,
                };
            }
            return;
        };
        for k in 0..choice.count {
            let mut here = self.is_index(choice.index, k);
            if let Some(c) = condition {
                here = self.b.op(Code::And, &[c, here]);
            }
            self.store_state(at + (k * choice.stride) as usize, rest, value, Some(here));
        }
    }

    /// A register of a range.
    fn element(&mut self, id: u32, k: u32) -> V {
        self.b.define(Def::Element(id, k))
    }

    /// One index for several choices, in components, and the number of registers it ranges over.
    fn flat_index(&mut self, choices: &[Choice]) -> Option<(V, u32)> {
        let mut out: Option<(V, u32)> = None;
        for c in choices {
            let stride = self.b.constant(c.stride);
            let step = self.b.op(Code::IMul, &[c.index, stride]);
            let reach = (c.count - 1) * c.stride;
            out = Some(match out {
                None => (step, reach + 1),
                Some((sum, n)) => (self.b.op(Code::IAdd, &[sum, step]), n + reach),
            });
        }
        out
    }

    /// Part of a value chosen at run time.
    pub fn choose(&mut self, d: &[V], index: V, count: u32) -> Result<Vec<V>> {
        let size = d.len() / count.max(1) as usize;
        let last = self.b.constant(count.saturating_sub(1));
        let index = self.b.op(Code::UMin, &[index, last]);
        if let Some(k) = self.b.known(index) {
            return Ok(d[k as usize * size..(k as usize + 1) * size].to_vec());
        }
        let known: Option<Vec<u32>> = d.iter().map(|&v| self.b.known(v)).collect();
        if let (Some(bits), true) = (known, count > 4) {
            // A constant array becomes a table.
            return Ok((0..size)
                .map(|c| {
                    let column: Vec<u32> = bits.iter().skip(c).step_by(size).copied().collect();
                    let entry = self.b.table_entry(&column);
                    self.b.ops(Code::LoadConst, &[index], entry, 1, true)
                })
                .collect());
        }
        if count <= 4 {
            let mut out = d[(count as usize - 1) * size..].to_vec();
            for k in (0..count - 1).rev() {
                let here = self.is_index(index, k);
                for c in 0..size {
                    out[c] = self.b.op(Code::Select, &[here, d[k as usize * size + c], out[c]]);
                }
            }
            return Ok(out);
        }
        // This is the last read of the registers, so that later values may have them.
        let range_top = self.range_top;
        let var = self.variable(true, d)?;
        let ty = crate::types::Ty::Scalar(naga::Scalar::U32);
        let mut place = self.variable_place(var, ty);
        place.choices.push(Choice { index, count, stride: size as u32 });
        let chosen = (0..size as u32)
            .flat_map(|c| {
                place.offset = c;
                self.load_variable(var, &place, 1)
            })
            .collect();
        self.range_top = range_top;
        Ok(chosen)
    }
}
