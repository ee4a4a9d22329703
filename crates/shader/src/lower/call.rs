//! Calls, inlined: frames, local variables, results.

use naga::valid::FunctionInfo;
use naga::{Expression, Function, Handle};

use super::writes::returns_early;
use super::{AccessPath, Flow, InlinedCall, Lowerer, Region, RegionKind, Result, Results, Root, Val, Var};
use crate::code::Code;
use crate::ir::{Def, Range, V};
use crate::types::Ty;

impl<'a> Lowerer<'a> {
    /// Room for a variable of `n` components with the given initial values.
    pub fn variable(&mut self, indexed: bool, initial: &[V]) -> Result<Var> {
        self.spend(initial.len() / 8)?;
        if !indexed {
            let base = self.state.len();
            self.within(self.origin.limits.shader_components, (base + initial.len()) as u64)?;
            self.state.extend_from_slice(initial);
            return Ok(Var::State { base });
        }
        let id = self.b.ranges.len() as u32;
        let length = initial.len() as u32;
        self.b.ranges.push(Range { start: self.range_top });
        self.range_top += length;
        self.within(self.origin.limits.shader_array_registers, u64::from(self.range_top))?;
        self.b.range_registers = self.b.range_registers.max(self.range_top);
        for (k, &v) in initial.iter().enumerate() {
            let d = self.b.define(Def::Element(id, k as u32));
            self.b.push(Code::Copy, vec![d], vec![v], 0);
        }
        Ok(Var::Range { id })
    }

    /// Lowers a function's body with these arguments.
    pub fn inline(
        &mut self,
        handle: Option<Handle<Function>>,
        function: &'a Function,
        info: &'a FunctionInfo,
        args: Vec<Val>,
    ) -> Result<Option<Val>> {
        self.spend(function.expressions.len() / 8)?;
        let outer_state = self.state.len();
        let (range_top, slot, depth, region) = (self.range_top, self.slot, self.depth, self.regions.len());
        let early = *self.early.entry(handle).or_insert_with(|| returns_early(function));
        let results = match (early, &function.result) {
            (false, _) => Results::Tail,
            (true, result) => {
                let n = result.as_ref().map_or(Ok(0), |r| self.size(Ty::Named(r.ty)))?;
                let classes: Vec<u32> = (0..n).map(|_| self.b.class()).collect();
                for &class in &classes {
                    let d = self.b.version(class);
                    self.b.push(Code::Undef, vec![d], vec![], 0);
                }
                Results::Region { classes }
            }
        };
        self.frames.push(InlinedCall {
            function,
            info,
            args,
            exprs: vec![None; function.expressions.len()],
            kept: None,
            locals: Vec::new(),
            results,
            returned: None,
        });
        for (h, local) in function.local_variables.iter() {
            let initial = match local.init {
                Some(init) => self.data(init)?.to_vec(),
                None => self.zeros(Ty::Named(local.ty))?,
            };
            let indexed = self.indexed.locals.contains(&(handle, h));
            let var = self.variable(indexed, &initial)?;
            self.frame_mut().locals.push(var);
        }
        let flow;
        if early {
            let outer: Vec<usize> = self.assigned(&[&function.body]).into_iter().filter(|&i| i < outer_state).collect();
            let mut merge = Vec::new();
            for i in outer {
                let class = self.b.class();
                let d = self.b.version(class);
                self.b.push(Code::Undef, vec![d], vec![], 0);
                merge.push((i, class));
            }
            self.slots(1)?;
            self.b.control(Code::RegionBegin, vec![], 0, [slot, 0, 0]);
            let scope = self.b.scope();
            self.depth += 1;
            self.regions.push(Region { kind: RegionKind::Function, slot, depth: self.depth, merge });
            flow = self.block(&function.body)?;
            if flow == Flow::Next {
                self.flush(region);
            }
            self.b.control(Code::RegionEnd, vec![], 0, [slot, 0, 0]);
            self.b.leave(scope);
            self.take_merged(region);
        } else {
            self.regions.push(Region { kind: RegionKind::Function, slot, depth, merge: Vec::new() });
            self.block(&function.body)?;
        }
        self.regions.truncate(region);
        self.depth = depth;
        self.slot = slot;
        self.range_top = range_top;
        self.state.truncate(outer_state);
        let Some(frame) = self.frames.pop() else { return Ok(None) };
        Ok(match frame.results {
            Results::Tail => frame.returned,
            Results::Region { classes } if !classes.is_empty() => {
                Some(Val::Data(classes.iter().map(|&c| self.b.version(c)).collect()))
            }
            Results::Region { .. } => None,
        })
    }

    pub fn lower_call(
        &mut self,
        callee: Handle<Function>,
        arguments: &'a [Handle<Expression>],
        result: Option<Handle<Expression>>,
    ) -> Result<Flow> {
        let args = arguments.iter().map(|&a| self.eval(a)).collect::<Result<Vec<_>>>()?;
        let function: &'a Function = &self.module.functions[callee];
        let info: &'a FunctionInfo = &self.info[callee];
        let span = self.span;
        let value = self.inline(Some(callee), function, info, args)?;
        self.go_to(span);
        if let Some(h) = result {
            // A function that ends without `return` (all its paths discard, or it never returns) gives zeros.
            let value = match (value, &function.result) {
                (Some(v), _) => v,
                (None, Some(r)) => Val::Data(self.zeros(Ty::Named(r.ty))?.into()),
                (None, None) => Val::Data([].into()),
            };
            // The result of a callee may be just the contents of a mutable register (`fn f(x: u32) -> u32 { return x; }`
            // called with a loop's variable), which a `continue` after the call overwrites: the continuing block needs a copy of
            // it, as it does of what an `Emit` computes.
            self.keep(h, &value);
            self.frame_mut().exprs[h.index()] = Some(value);
        }
        Ok(Flow::Next)
    }

    pub fn lower_return(&mut self, value: Option<Handle<Expression>>) -> Result<Flow> {
        let value = value.map(|h| self.eval(h)).transpose()?;
        let Results::Region { classes } = &self.frame().results else {
            self.frame_mut().returned = value;
            return Ok(Flow::Returned);
        };
        let classes = classes.clone();
        if let Some(Val::Data(d)) = &value {
            for (&class, &v) in classes.iter().zip(d.iter()) {
                let target = self.b.version(class);
                self.b.push(Code::Mov, vec![target], vec![v], 0);
            }
        }
        let Some(region) = self.regions.iter().rposition(|r| r.kind == RegionKind::Function) else {
            return self.refuse("`return` outside of a function");
        };
        Ok(self.exit(region))
    }

    /// The place of a variable.
    pub fn variable_place(&self, var: Var, ty: Ty) -> AccessPath {
        AccessPath::new(Root::Var(var), ty, 0)
    }
}
