//! Statements.

use naga::{AtomicFunction, Block, Expression, Handle, ScalarKind, Statement};

use super::{Flow, Lowerer, Result, Val};
use crate::code::Code;
use crate::ir::{NONE, V};
use crate::program::{AtomicOp, Fold, SubgroupOp};

impl<'a> Lowerer<'a> {
    pub fn block(&mut self, block: &'a Block) -> Result<Flow> {
        self.deeper(|s| s.statements(block))
    }

    fn statements(&mut self, block: &'a Block) -> Result<Flow> {
        for (statement, span) in block.span_iter() {
            if span.is_defined() {
                self.go_to(*span);
            }
            self.spend(1)?;
            let flow = self.statement(statement)?;
            if flow != Flow::Next {
                return Ok(flow);
            }
        }
        Ok(Flow::Next)
    }

    fn statement(&mut self, statement: &'a Statement) -> Result<Flow> {
        match *statement {
            Statement::Emit(ref range) => {
                for h in range.clone() {
                    // An emitted expression is computed now, also if a loop comes here again.
                    let value = self.compute(h)?;
                    self.keep(h, &value);
                    self.frame_mut().exprs[h.index()] = Some(value);
                }
            }
            Statement::Block(ref b) => return self.block(b),
            Statement::If { condition, ref accept, ref reject } => return self.lower_if(condition, accept, reject),
            Statement::Switch { selector, ref cases } => return self.lower_switch(selector, cases),
            Statement::Loop { ref body, ref continuing, break_if } => {
                return self.lower_loop(body, continuing, break_if);
            }
            Statement::Break => return self.lower_break(),
            Statement::Continue => return self.lower_continue(),
            Statement::Return { value } => return self.lower_return(value),
            Statement::Kill => {
                self.flags.discards = true;
                self.b.control(Code::Discard, vec![], 0, [0; 3]);
            }
            Statement::ControlBarrier(barrier) => {
                if barrier.intersects(naga::Barrier::STORAGE | naga::Barrier::WORK_GROUP | naga::Barrier::TEXTURE) {
                    self.barrier();
                }
            }
            // Lanes of a batch run in lockstep, and batches one after the other, so that all accesses to memory are in order.
            Statement::MemoryBarrier(_) => {}
            Statement::Store { pointer, value } => {
                let place = self.place(pointer)?;
                let value = self.data(value)?;
                self.store(&place, &value)?;
            }
            Statement::Atomic { pointer, fun, value, result } => self.lower_atomic(pointer, fun, value, result)?,
            Statement::WorkGroupUniformLoad { pointer, result } => {
                self.barrier();
                let place = self.place(pointer)?;
                let value = self.load(&place)?;
                self.frame_mut().exprs[result.index()] = Some(value);
                self.barrier();
            }
            Statement::Call { function, ref arguments, result } => {
                return self.lower_call(function, arguments, result);
            }
            Statement::ImageStore { image, coordinate, array_index, value } => {
                self.image_store(image, coordinate, array_index, value)?;
            }
            Statement::ImageAtomic { image, coordinate, array_index, fun, value } => {
                self.image_atomic(image, coordinate, array_index, fun, value)?;
            }
            Statement::SubgroupBallot { result, predicate } => {
                let p = predicate.map(|p| self.scalar(p)).transpose()?.unwrap_or(NONE);
                self.flags.subgroups = true;
                let v = self.subgroup(SubgroupOp::Ballot, p, NONE, 4);
                self.frame_mut().exprs[result.index()] = Some(Val::Data((v..v + 4).collect()));
            }
            Statement::SubgroupGather { mode, argument, result } => self.subgroup_gather(mode, argument, result)?,
            Statement::SubgroupCollectiveOperation { op, collective_op, argument, result } => {
                self.subgroup_collective(op, collective_op, argument, result)?;
            }
            Statement::RayQuery { .. } | Statement::RayPipelineFunction(_) => {
                return self.refuse("ray queries are not supported");
            }
            Statement::CooperativeStore { .. } => return self.refuse("cooperative matrices are not supported"),
        }
        Ok(Flow::Next)
    }

    fn barrier(&mut self) {
        self.flags.barriers = true;
        self.b.control(Code::Barrier, vec![], 0, [0; 3]);
    }

    /// The operation of an atomic function on scalars of a kind.
    pub fn atomic_op(&self, fun: AtomicFunction, kind: ScalarKind) -> Result<AtomicOp> {
        let signed = kind == ScalarKind::Sint;
        let float = kind == ScalarKind::Float;
        Ok(match fun {
            AtomicFunction::Add if float => AtomicOp::AddF,
            AtomicFunction::Subtract if float => AtomicOp::SubF,
            AtomicFunction::Exchange { compare: None } => AtomicOp::Exchange,
            AtomicFunction::Exchange { compare: Some(_) } => AtomicOp::CompareExchange,
            _ if float => return self.refuse(format!("atomic {fun:?} of floating-point numbers is not supported")),
            AtomicFunction::Add => AtomicOp::Add,
            AtomicFunction::Subtract => AtomicOp::Sub,
            AtomicFunction::And => AtomicOp::And,
            AtomicFunction::ExclusiveOr => AtomicOp::Xor,
            AtomicFunction::InclusiveOr => AtomicOp::Or,
            AtomicFunction::Min => {
                if signed {
                    AtomicOp::MinS
                } else {
                    AtomicOp::MinU
                }
            }
            AtomicFunction::Max => {
                if signed {
                    AtomicOp::MaxS
                } else {
                    AtomicOp::MaxU
                }
            }
        })
    }

    fn subgroup(&mut self, op: SubgroupOp, argument: V, index: V, results: usize) -> V {
        self.b.subgroup.push(op);
        let entry = (self.b.subgroup.len() - 1) as u32;
        self.b.ops(Code::Subgroup, &[argument, index], entry, results, false)
    }

    fn subgroup_gather(
        &mut self,
        mode: naga::GatherMode,
        argument: Handle<Expression>,
        result: Handle<Expression>,
    ) -> Result<()> {
        self.flags.subgroups = true;
        let (op, index) = match mode {
            naga::GatherMode::BroadcastFirst => (SubgroupOp::BroadcastFirst, None),
            naga::GatherMode::Broadcast(h) => (SubgroupOp::Broadcast, Some(h)),
            naga::GatherMode::Shuffle(h) => (SubgroupOp::Shuffle, Some(h)),
            naga::GatherMode::ShuffleDown(h) => (SubgroupOp::ShuffleDown, Some(h)),
            naga::GatherMode::ShuffleUp(h) => (SubgroupOp::ShuffleUp, Some(h)),
            naga::GatherMode::ShuffleXor(h) => (SubgroupOp::ShuffleXor, Some(h)),
            naga::GatherMode::QuadBroadcast(h) => (SubgroupOp::QuadBroadcast, Some(h)),
            naga::GatherMode::QuadSwap(direction) => (SubgroupOp::QuadSwap(direction as u8), None),
        };
        let index = index.map(|h| self.scalar(h)).transpose()?.unwrap_or(NONE);
        let d = self.data(argument)?;
        let out = d.iter().map(|&v| self.subgroup(op, v, index, 1)).collect();
        self.frame_mut().exprs[result.index()] = Some(Val::Data(out));
        Ok(())
    }

    fn subgroup_collective(
        &mut self,
        op: naga::SubgroupOperation,
        collective: naga::CollectiveOperation,
        argument: Handle<Expression>,
        result: Handle<Expression>,
    ) -> Result<()> {
        use naga::SubgroupOperation as S;
        self.flags.subgroups = true;
        let scalar = self.scalar_of(argument)?;
        let kind = scalar.kind;
        let by_kind = |float, signed, unsigned| match kind {
            ScalarKind::Float => float,
            ScalarKind::Sint => signed,
            _ => unsigned,
        };
        let fold = match op {
            S::All | S::Any => None,
            S::Add => Some(by_kind(Fold::AddF, Fold::AddI, Fold::AddI)),
            S::Mul => Some(by_kind(Fold::MulF, Fold::MulI, Fold::MulI)),
            S::Min => Some(by_kind(Fold::MinF, Fold::MinS, Fold::MinU)),
            S::Max => Some(by_kind(Fold::MaxF, Fold::MaxS, Fold::MaxU)),
            S::And => Some(Fold::And),
            S::Or => Some(Fold::Or),
            S::Xor => Some(Fold::Xor),
        };
        let op = match (fold, collective) {
            (None, _) if op == S::All => SubgroupOp::All,
            (None, _) => SubgroupOp::Any,
            (Some(f), naga::CollectiveOperation::Reduce) => SubgroupOp::Reduce(f),
            (Some(f), naga::CollectiveOperation::InclusiveScan) => SubgroupOp::Inclusive(f),
            (Some(f), naga::CollectiveOperation::ExclusiveScan) => SubgroupOp::Exclusive(f),
        };
        let d = self.data(argument)?;
        // Sums and products of 16-bit numbers are computed in 32 bits and rounded at the end.
        let one = |&v: &V| {
            let result = self.subgroup(op, v, NONE, 1);
            self.rounded(result, scalar)
        };
        let out = d.iter().map(one).collect();
        self.frame_mut().exprs[result.index()] = Some(Val::Data(out));
        Ok(())
    }
}
