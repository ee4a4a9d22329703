//! Control flow: ifs that merge states, loops, switches, and leaving them under the mask.

use naga::{Block, Expression, Handle, Statement, SwitchCase, SwitchValue};

use super::writes::{breaks_early, continues};
use super::{AccessPath, ContinuingValues, Flow, Lowerer, Region, RegionKind, Result, Stop, Val};
use crate::code::Code;
use crate::ir::{Def, NONE, V};

/// Branches of at most this many cheap instructions are computed by all lanes, without a mask.
const FLAT: usize = 12;

/// Iterations that an unrolled loop may have.
const UNROLL_ITERATIONS: usize = 64;

impl<'a> Lowerer<'a> {
    /// Mask slots for a construct.
    pub fn slots(&mut self, n: u16) -> Result<u16> {
        let slot = self.slot;
        let Some(next) = slot.checked_add(n) else {
            return self
                .refuse(format!("control flow needs more than {} masks, which operations number with 16 bits", u16::MAX));
        };
        self.slot = next;
        self.b.slots = self.b.slots.max(self.slot);
        Ok(slot)
    }

    pub fn lower_if(&mut self, condition: Handle<Expression>, accept: &'a Block, reject: &'a Block) -> Result<Flow> {
        let c = self.scalar(condition)?;
        if let Some(known) = self.b.known(c) {
            return self.block(if known != 0 { accept } else { reject });
        }
        // `if (c) { break; }` is one operation where there is nothing to save first.
        let only_break = |b: &Block| b.len() == 1 && matches!(b.first(), Some(Statement::Break));
        for (block, other, code) in [(accept, reject, Code::BreakIf), (reject, accept, Code::BreakIfNot)] {
            if only_break(block)
                && other.is_empty()
                && let Some(region) = self.regions.iter().rposition(|r| r.kind != RegionKind::Function)
                && self.regions[region].kind == RegionKind::Loop
                && region + 1 == self.regions.len()
                && self.dirty(region).is_empty()
            {
                let slot = self.regions[region].slot;
                self.b.control(code, vec![c], 0, [0, slot + 1, self.slot]);
                return Ok(Flow::Next);
            }
        }
        self.branch(c, |s| s.block(accept), |s| s.block(reject), !reject.is_empty())
    }

    /// Two blocks under a condition and its opposite, and the merge of their states.
    fn branch(
        &mut self,
        c: V,
        accept: impl FnOnce(&mut Self) -> Result<Flow>,
        reject: impl FnOnce(&mut Self) -> Result<Flow>,
        has_reject: bool,
    ) -> Result<Flow> {
        let slot = self.slots(2)?;
        self.spend(self.state.len() / 8)?;
        let start = self.b.insts.len();
        let scope = self.b.scope();
        let before = self.state.clone();
        self.b.control(Code::If, vec![c], 0, [slot, 0, 0]);
        self.depth += 1;
        let first = accept(self)?;
        let mut accepted = std::mem::replace(&mut self.state, before);
        self.b.leave(scope);
        let middle = self.b.insts.len();
        let mut second = Flow::Next;
        if has_reject {
            self.b.control(Code::Else, vec![], 0, [slot, 0, 0]);
            second = reject(self)?;
            self.b.leave(scope);
        }
        self.b.control(Code::EndIf, vec![], 0, [slot, 0, 0]);
        self.depth -= 1;
        self.slot -= 2;
        self.flatten(start, middle, has_reject);
        match (first, second) {
            (Flow::Next, Flow::Next) => {
                accepted.truncate(self.state.len());
                for i in 0..accepted.len() {
                    if accepted[i] != self.state[i] {
                        self.state[i] = self.b.op(Code::Select, &[c, accepted[i], self.state[i]]);
                    }
                }
                Ok(Flow::Next)
            }
            (Flow::Next, _) => {
                accepted.truncate(self.state.len());
                self.state = accepted;
                Ok(Flow::Next)
            }
            (_, Flow::Next) => Ok(Flow::Next),
            _ => Ok(Flow::Left),
        }
    }

    /// Drops the mask operations of an `if` whose branches are a few operations without effects: computing both is cheaper.
    fn flatten(&mut self, start: usize, middle: usize, has_reject: bool) {
        if !self.b.optimisations.flatten {
            return;
        }
        let body = &self.b.insts[start + 1..];
        let cheap = body.len() <= FLAT + 2
            && body.iter().all(|i| matches!(i.code, Code::Else | Code::EndIf) || (i.code.is_pure() && i.code.weight().1 <= 9))
            && body.iter().filter(|i| matches!(i.code, Code::EndIf)).count() == 1;
        if cheap {
            self.b.insts.pop();
            if has_reject {
                self.b.insts.remove(middle);
            }
            self.b.insts.remove(start);
        }
    }

    /// The components that a region merges and whose values differ from its registers.
    fn dirty(&self, region: usize) -> Vec<(usize, u32)> {
        let clean = |v: V, class: u32| self.b.defs[v as usize] == Def::Version(class);
        self.regions[region].merge.iter().copied().filter(|&(i, class)| !clean(self.state[i], class)).collect()
    }

    /// Writes the merged components of a region into its registers, for the lanes of the mask.
    pub fn flush(&mut self, region: usize) {
        self.b.steps += self.regions[region].merge.len() as u64 / 8;
        let dirty = self.dirty(region);
        self.write_merged(&dirty);
    }

    /// A parallel assignment: sources that are themselves targets are read first.
    fn write_merged(&mut self, dirty: &[(usize, u32)]) {
        let mut sources: Vec<V> = dirty.iter().map(|&(i, _)| self.state[i]).collect();
        for s in &mut sources {
            if let Def::Version(class) = self.b.defs[*s as usize]
                && dirty.iter().any(|&(_, c)| c == class)
            {
                *s = self.copy(*s);
            }
        }
        for (&(_, class), s) in dirty.iter().zip(sources) {
            let d = self.b.version(class);
            self.b.push(Code::Mov, vec![d], vec![s], 0);
        }
    }

    pub fn copy(&mut self, v: V) -> V {
        self.b.ops(Code::Copy, &[v], 0, 1, false)
    }

    /// Lets the active lanes leave a region.
    pub fn exit(&mut self, region: usize) -> Flow {
        self.flush(region);
        let slot = self.regions[region].slot;
        self.b.control(Code::Exit, vec![], 0, [0, slot + 1, self.slot]);
        Flow::Left
    }

    pub fn lower_break(&mut self) -> Result<Flow> {
        let Some(region) = self.regions.iter().rposition(|r| r.kind != RegionKind::Function) else {
            return self.refuse("`break` outside of a loop or switch");
        };
        let r = &self.regions[region];
        match r.kind {
            RegionKind::Unrolled if r.depth == self.depth => Ok(Flow::Broke),
            RegionKind::Unrolled => Err(Stop::Unroll),
            RegionKind::Switch if r.depth == self.depth => Ok(Flow::Broke),
            _ => Ok(self.exit(region)),
        }
    }

    pub fn lower_continue(&mut self) -> Result<Flow> {
        let is_loop = |r: &Region| matches!(r.kind, RegionKind::Loop | RegionKind::Unrolled);
        let Some(region) = self.regions.iter().rposition(is_loop) else {
            return self.refuse("`continue` outside of a loop");
        };
        let r = &self.regions[region];
        if r.kind == RegionKind::Unrolled {
            return if r.depth == self.depth { Ok(Flow::Continued) } else { Err(Stop::Unroll) };
        }
        let slot = r.slot;
        self.flush(region);
        self.b.control(Code::Continue, vec![], 0, [slot, slot + 2, self.slot]);
        Ok(Flow::Left)
    }

    pub fn lower_loop(&mut self, body: &'a Block, continuing: &'a Block, break_if: Option<Handle<Expression>>) -> Result<Flow> {
        if let Some(flow) = self.unroll(body, continuing, break_if)? {
            return Ok(flow);
        }
        let mut merge = Vec::new();
        for i in self.assigned(&[body, continuing]) {
            let class = self.b.class();
            let (d, s) = (self.b.version(class), self.state[i]);
            self.b.push(Code::Copy, vec![d], vec![s], 0);
            merge.push((i, class));
        }
        let Ok(number) = u16::try_from(self.b.loops.len()) else {
            return self.refuse(format!("more than {} loops, which operations number with 16 bits", u16::MAX));
        };
        self.b.loops.push(self.here());
        let slot = self.slots(2)?;
        self.b.control(Code::LoopBegin, vec![], 0, [slot, number, 0]);
        let scope = self.b.scope();
        self.depth += 1;
        let region = self.regions.len();
        self.regions.push(Region { kind: RegionKind::Loop, slot, depth: self.depth, merge });
        self.take_merged(region);
        let continued = continues(body);
        let kept = continued.then(|| ContinuingValues { depth: self.depth, values: Vec::new() });
        let outer = std::mem::replace(&mut self.frame_mut().kept, kept);
        let mut flow = self.block(body)?;
        let kept = std::mem::replace(&mut self.frame_mut().kept, outer);
        if continued {
            if flow == Flow::Next {
                self.flush(region);
            }
            self.b.leave(scope);
            self.b.control(Code::Continuing, vec![], 0, [slot, 0, 0]);
            self.take_merged(region);
            for (expression, value) in kept.into_iter().flat_map(|k| k.values) {
                self.frame_mut().exprs[expression] = Some(value);
            }
            flow = Flow::Next;
        }
        let mut condition = None;
        if flow == Flow::Next {
            self.block(continuing)?;
            if let Some(h) = break_if {
                let c = self.scalar(h)?;
                // The condition is read after the variables are written.
                condition = Some(if matches!(self.b.defs[c as usize], Def::Version(_)) { self.copy(c) } else { c });
            }
            self.flush(region);
        }
        match condition {
            Some(c) => self.b.control(Code::LoopEndIf, vec![c], 0, [slot, number, 0]),
            None => self.b.control(Code::LoopEnd, vec![], 0, [slot, number, 0]),
        }
        self.b.leave(scope);
        self.depth -= 1;
        self.take_merged(region);
        self.regions.pop();
        self.slot -= 2;
        Ok(Flow::Next)
    }

    /// From here on the state's merged components are the region's registers.
    pub fn take_merged(&mut self, region: usize) {
        for k in 0..self.regions[region].merge.len() {
            let (i, class) = self.regions[region].merge[k];
            self.state[i] = self.b.version(class);
        }
    }

    /// Copies the components of a value that a `continue` may overwrite, if the continuing block can see the value.
    pub fn keep(&mut self, h: Handle<Expression>, value: &Val) {
        if self.frame().kept.as_ref().is_none_or(|k| k.depth != self.depth) {
            return;
        }
        let stale = |s: &Self, v: V| v != NONE && matches!(s.b.defs[v as usize], Def::Version(_));
        let lasting = |s: &mut Self, v: V| if stale(s, v) { s.copy(v) } else { v };
        let copy = match value {
            Val::Data(d) if d.iter().any(|&v| stale(self, v)) => Val::Data(d.iter().map(|&v| lasting(self, v)).collect()),
            Val::Place(p) => {
                let mut place = AccessPath::clone(p);
                place.address = place.address.map(|v| lasting(self, v));
                place.element = place.element.map(|v| lasting(self, v));
                for choice in &mut place.choices {
                    choice.index = lasting(self, choice.index);
                }
                Val::Place(place.into())
            }
            Val::Opaque(g, Some(element)) if stale(self, *element) => Val::Opaque(*g, Some(self.copy(*element))),
            Val::Data(_) | Val::Opaque(..) => return,
        };
        if let Some(kept) = &mut self.frame_mut().kept {
            kept.values.push((h.index(), copy));
        }
    }

    /// Tries to run the loop at compile time. None: that is not possible, and nothing has changed.
    fn unroll(&mut self, body: &'a Block, continuing: &'a Block, break_if: Option<Handle<Expression>>) -> Result<Option<Flow>> {
        if self.unroll_steps == 0 || !self.b.optimisations.unroll {
            return Ok(None);
        }
        // The memory of the copies below counts too.
        let begun = self.b.steps;
        self.spend((self.state.len() + self.frame().exprs.len()) / 8)?;
        let mark = self.b.mark();
        let level = self.level;
        let state = self.state.clone();
        let exprs = self.frame().exprs.clone();
        let (range_top, loops) = (self.range_top, self.b.loops.len());
        let kept = self.frame().kept.as_ref().map_or(0, |k| k.values.len());
        let start = self.b.insts.len();
        let region = self.regions.len();
        let depth = self.depth;
        let (slot, frames) = (self.slot, self.frames.len());
        self.regions.push(Region { kind: RegionKind::Unrolled, slot, depth, merge: Vec::new() });
        let mut result = Err(Stop::Unroll);
        for _ in 0..UNROLL_ITERATIONS {
            match self.iteration(body, continuing, break_if) {
                Ok(Flow::Next) => {}
                other => {
                    result = other;
                    break;
                }
            }
            // Inner loops have already taken their steps from the same budget and are counted again, because they are tried again
            // in each turn.
            if self.b.insts.len() - start > self.unroll_budget || self.b.steps - begun > self.unroll_steps {
                break;
            }
        }
        self.unroll_steps = self.unroll_steps.saturating_sub(self.b.steps - begun);
        self.regions.truncate(region);
        match result {
            Ok(flow) => {
                self.unroll_budget = self.unroll_budget.saturating_sub(self.b.insts.len() - start);
                Ok(Some(if flow == Flow::Broke { Flow::Next } else { flow }))
            }
            Err(Stop::Unroll) => {
                self.b.rewind(&mark);
                self.b.loops.truncate(loops);
                self.state = state;
                self.frames.truncate(frames);
                self.frame_mut().exprs = exprs;
                if let Some(k) = &mut self.frame_mut().kept {
                    k.values.truncate(kept);
                }
                self.range_top = range_top;
                self.depth = depth;
                self.slot = slot;
                self.level = level;
                Ok(None)
            }
            Err(error) => Err(error),
        }
    }

    /// One iteration of an unrolled loop: `Next` goes on, `Broke` ends it, `Left` and `Returned` leave more.
    fn iteration(&mut self, body: &'a Block, continuing: &'a Block, break_if: Option<Handle<Expression>>) -> Result<Flow> {
        match self.block(body)? {
            Flow::Next | Flow::Continued => {}
            other => return Ok(other),
        }
        match self.block(continuing)? {
            Flow::Next => {}
            other => return Ok(other),
        }
        if let Some(h) = break_if {
            let c = self.scalar(h)?;
            return match self.b.known(c) {
                Some(0) => Ok(Flow::Next),
                Some(_) => Ok(Flow::Broke),
                None => Err(Stop::Unroll),
            };
        }
        Ok(Flow::Next)
    }

    pub fn lower_switch(&mut self, selector: Handle<Expression>, cases: &'a [SwitchCase]) -> Result<Flow> {
        let sel = self.scalar(selector)?;
        let early = cases.iter().any(|c| breaks_early(&c.body));
        let value = |v: SwitchValue| match v {
            SwitchValue::I32(i) => Some(i as u32),
            SwitchValue::U32(u) => Some(u),
            SwitchValue::Default => None,
        };
        let slot = self.slots(1)?;
        let region = self.regions.len();
        let mut merge = Vec::new();
        if early {
            let bodies: Vec<&Block> = cases.iter().map(|c| &c.body).collect();
            for i in self.assigned(&bodies) {
                let class = self.b.class();
                let d = self.b.version(class);
                self.b.push(Code::Undef, vec![d], vec![], 0);
                merge.push((i, class));
            }
            self.b.control(Code::RegionBegin, vec![], 0, [slot, 0, 0]);
        }
        let outer = self.depth;
        let scope = self.b.scope();
        if early {
            self.depth += 1;
        }
        self.regions.push(Region { kind: RegionKind::Switch, slot, depth: self.depth, merge });
        let flow = match self.b.known(sel) {
            Some(bits) => {
                let chosen = cases.iter().position(|c| value(c.value) == Some(bits));
                let chosen = chosen.or_else(|| cases.iter().position(|c| c.value == SwitchValue::Default));
                let mut flow = Flow::Next;
                for case in cases.iter().skip(chosen.unwrap_or(cases.len())) {
                    flow = self.block(&case.body)?;
                    if flow != Flow::Next || !case.fall_through {
                        break;
                    }
                }
                if flow == Flow::Broke { Flow::Next } else { flow }
            }
            None => self.cases(sel, region, cases, &value)?,
        };
        let flow = if early {
            if flow == Flow::Next {
                self.flush(region);
            }
            self.b.control(Code::RegionEnd, vec![], 0, [slot, 0, 0]);
            // Values that only the remaining lanes computed are not valid in the lanes that broke out.
            self.b.leave(scope);
            self.take_merged(region);
            if matches!(flow, Flow::Next | Flow::Left) { Flow::Next } else { flow }
        } else {
            flow
        };
        self.regions.truncate(region);
        self.depth = outer;
        self.slot = slot;
        Ok(flow)
    }

    /// The cases of a switch, one after the other, each under its own condition.
    fn cases(
        &mut self,
        sel: V,
        region: usize,
        cases: &'a [SwitchCase],
        value: &impl Fn(SwitchValue) -> Option<u32>,
    ) -> Result<Flow> {
        let mut conditions = Vec::with_capacity(cases.len());
        let mut any: Option<V> = None;
        for case in cases {
            conditions.push(value(case.value).map(|bits| {
                let k = self.b.constant(bits);
                self.b.op(Code::IEq, &[sel, k])
            }));
            if let Some(Some(c)) = conditions.last() {
                any = Some(any.map_or(*c, |a| self.b.op(Code::Or, &[a, *c])));
            }
        }
        let default = match any {
            Some(a) => self.b.op(Code::BNot, &[a]),
            None => self.b.constant(1),
        };
        let mut carry: Option<V> = None;
        let mut all_left = true;
        let mut has_default = false;
        for (case, condition) in cases.iter().zip(conditions) {
            has_default |= condition.is_none();
            let mut c = condition.unwrap_or(default);
            if let Some(previous) = carry.take() {
                c = self.b.op(Code::Or, &[previous, c]);
            }
            if case.fall_through {
                carry = Some(c);
                if case.body.is_empty() {
                    continue;
                }
            }
            // Inside the case, `break` at its own level is its end.
            self.regions[region].depth += 1;
            let known = self.b.known(c);
            let flow = if known == Some(1) {
                // The only case is the default.
                self.regions[region].depth -= 1;
                let flow = self.block(&case.body)?;
                return Ok(if flow == Flow::Broke { Flow::Next } else { flow });
            } else {
                let mut inner = Flow::Next;
                let mut broke = false;
                self.branch(
                    c,
                    |s| {
                        let flow = s.block(&case.body)?;
                        broke = flow == Flow::Broke;
                        inner = if broke { Flow::Next } else { flow };
                        Ok(inner)
                    },
                    |_| Ok(Flow::Next),
                    false,
                )?;
                // Its end is a `break`, under a condition that is known to hold: no invocation falls through.
                if broke {
                    carry = None;
                }
                inner
            };
            self.regions[region].depth -= 1;
            all_left &= flow != Flow::Next;
        }
        Ok(if all_left && has_default { Flow::Left } else { Flow::Next })
    }
}
