//! Statements: one step at a time, so that an invocation may stop anywhere and go on later.

use std::rc::Rc;

use naga::{Barrier, Block, Expression, Handle, Statement, SwitchValue};

use super::Fault;
use super::groups::Request;
use super::machine::{Control, Invocation, State, World};
use super::memory::Pointee;
use super::value::{Number, Pointer, Value, broken};

impl<'a> Invocation<'a> {
    /// Runs until it ends or waits for others.
    pub fn run(&mut self, world: &mut World<'a>) -> Result<(), Fault> {
        while let State::Runs = self.state {
            world.step()?;
            self.advance(world)?;
        }
        Ok(())
    }

    fn open(&mut self, branch: u32, statements: &'a Block) -> Result<(), Fault> {
        self.frame()?.control.push(Control::Block { branch, statements, next: 0 });
        Ok(())
    }

    /// Goes on with the innermost construct that is open.
    fn advance(&mut self, world: &mut World<'a>) -> Result<(), Fault> {
        match self.frame()?.control.last_mut() {
            // The end of the function's body.
            None => self.leave(world, None),
            Some(Control::Block { statements, next, .. }) => {
                let statements: &'a Block = statements;
                match statements.get(*next) {
                    Some(statement) => {
                        *next += 1;
                        self.statement(world, statement)
                    }
                    None => self.close(),
                }
            }
            Some(Control::Emit(range)) => match range.next() {
                Some(h) => self.emit(world, h),
                None => self.close(),
            },
            // The body or the continuing block has ended.
            Some(Control::Loop { body, continuing, break_if, turn, in_continuing }) => {
                let (body, continuing): (&'a Block, &'a Block) = (body, continuing);
                if !*in_continuing {
                    *in_continuing = true;
                    return self.open(1, continuing);
                }
                *in_continuing = false;
                *turn += 1;
                let leave = match *break_if {
                    Some(condition) => self.evaluate(world, condition)?.truth()?,
                    None => false,
                };
                if leave { self.close() } else { self.open(0, body) }
            }
            // A case has ended.
            Some(Control::Switch { cases, case }) => {
                if cases[*case].fall_through {
                    *case += 1;
                    let (cases, case) = (*cases, *case);
                    return match cases.get(case) {
                        Some(next) => self.open(case as u32, &next.body),
                        None => broken("the last case of a switch falls through"),
                    };
                }
                self.close()
            }
        }
    }

    /// Ends the innermost construct.
    fn close(&mut self) -> Result<(), Fault> {
        self.frame()?.control.pop();
        Ok(())
    }

    /// Computes an expression; one that needs other invocations waits for them.
    fn emit(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<(), Fault> {
        if let Some(request) = self.request_of(world, h)? {
            self.wait(h.index(), request, Some(h));
            return Ok(());
        }
        let value = self.compute(world, h)?;
        self.frame()?.expressions[h.index()] = Some(value);
        Ok(())
    }

    /// Sets the result of a statement.
    fn set(&mut self, h: Handle<Expression>, value: Value) -> Result<(), Fault> {
        self.frame()?.expressions[h.index()] = Some(value);
        Ok(())
    }

    /// A pointer and the type of what it points to.
    fn pointer(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<(Rc<Pointer>, Pointee), Fault> {
        let pointee = Pointee::of(self.type_of(world, h)?)?;
        match self.evaluate(world, h)? {
            Value::Pointer(pointer) => Ok((pointer, pointee)),
            _ => broken("a pointer was expected"),
        }
    }

    fn statement(&mut self, world: &mut World<'a>, statement: &'a Statement) -> Result<(), Fault> {
        match *statement {
            Statement::Emit(ref range) => self.frame()?.control.push(Control::Emit(range.clone())),
            Statement::Block(ref block) => self.open(0, block)?,
            Statement::If { condition, ref accept, ref reject } => {
                if self.evaluate(world, condition)?.truth()? {
                    self.open(0, accept)?;
                } else {
                    self.open(1, reject)?;
                }
            }
            Statement::Switch { selector, ref cases } => {
                let selector = self.evaluate(world, selector)?.number()?;
                let is = |value: SwitchValue| match value {
                    SwitchValue::I32(x) => selector == Number::Sint(x),
                    SwitchValue::U32(x) => selector == Number::Uint(x),
                    SwitchValue::Default => false,
                };
                let chosen = cases.iter().position(|c| is(c.value));
                let default = || cases.iter().position(|c| c.value == SwitchValue::Default);
                let Some(case) = chosen.or_else(default) else { return broken("a switch without a default case") };
                self.frame()?.control.push(Control::Switch { cases, case });
                self.open(case as u32, &cases[case].body)?;
            }
            Statement::Loop { ref body, ref continuing, break_if } => {
                let turn = 0;
                self.frame()?.control.push(Control::Loop { body, continuing, break_if, turn, in_continuing: false });
                self.open(0, body)?;
            }
            Statement::Break => loop {
                match self.frame()?.control.pop() {
                    Some(Control::Loop { .. } | Control::Switch { .. }) => break,
                    Some(_) => {}
                    None => return broken("`break` outside of a loop or switch"),
                }
            },
            // What is inside of the loop is closed; the loop itself then goes on with its continuing block.
            Statement::Continue => loop {
                match self.frame()?.control.last() {
                    Some(Control::Loop { .. }) => break,
                    Some(_) => self.close()?,
                    None => return broken("`continue` outside of a loop"),
                }
            },
            Statement::Return { value } => {
                let value = value.map(|h| self.evaluate(world, h)).transpose()?;
                self.leave(world, value)?;
            }
            Statement::Kill => self.discarded = true,
            Statement::ControlBarrier(barrier) => {
                if barrier.intersects(Barrier::STORAGE | Barrier::WORK_GROUP | Barrier::TEXTURE) {
                    self.wait(0, Request::Barrier, None);
                } else if barrier.contains(Barrier::SUB_GROUP) {
                    self.wait(0, Request::SubgroupBarrier, None);
                }
            }
            // One invocation runs at a time, and all see the same memory.
            Statement::MemoryBarrier(_) => {}
            Statement::Store { pointer, value } => {
                let (pointer, pointee) = self.pointer(world, pointer)?;
                let value = self.evaluate(world, value)?;
                world.store(self, &pointer, pointee, value)?;
            }
            Statement::Atomic { pointer, fun, value, result } => {
                let (pointer, _) = self.pointer(world, pointer)?;
                let value = self.evaluate(world, value)?.number()?;
                let compare = match fun {
                    naga::AtomicFunction::Exchange { compare: Some(h) } => Some(self.evaluate(world, h)?.number()?),
                    _ => None,
                };
                let (old, exchanged) = world.atomic(self, &pointer, fun, value, compare)?;
                if let Some(h) = result {
                    let old = Value::Number(old);
                    let both = matches!(self.type_of(world, h)?, naga::TypeInner::Struct { .. });
                    let exchanged = Value::Number(Number::Bool(exchanged));
                    self.set(h, if both { Value::Parts(vec![old, exchanged]) } else { old })?;
                }
            }
            Statement::WorkGroupUniformLoad { pointer, result } => {
                let (pointer, pointee) = self.pointer(world, pointer)?;
                self.wait(0, Request::UniformLoad(Pointer::clone(&pointer), pointee), Some(result));
            }
            Statement::Call { function, ref arguments, result } => {
                let arguments = arguments.iter().map(|&h| self.evaluate(world, h)).collect::<Result<Vec<_>, _>>()?;
                let (module, info) = (world.module, world.info);
                self.call(world, &module.functions[function], &info[function], arguments, result)?;
            }
            Statement::ImageStore { image, coordinate, array_index, value } => {
                self.image_store(world, image, coordinate, array_index, value)?;
            }
            Statement::ImageAtomic { image, coordinate, array_index, fun, value } => {
                self.image_atomic(world, image, coordinate, array_index, fun, value)?;
            }
            Statement::SubgroupBallot { result, predicate } => {
                let vote = match predicate {
                    Some(h) => self.evaluate(world, h)?.truth()?,
                    None => true,
                };
                self.wait(0, Request::Ballot(vote), Some(result));
            }
            Statement::SubgroupGather { mode, argument, result } => {
                use naga::GatherMode as G;
                let index = match mode {
                    G::BroadcastFirst | G::QuadSwap(_) => 0,
                    G::Broadcast(h) | G::Shuffle(h) | G::ShuffleDown(h) | G::ShuffleUp(h) | G::ShuffleXor(h) => {
                        self.evaluate(world, h)?.integer()?
                    }
                    G::QuadBroadcast(h) => self.evaluate(world, h)?.integer()?,
                };
                let value = self.evaluate(world, argument)?;
                self.wait(0, Request::Gather { mode, index, value }, Some(result));
            }
            Statement::SubgroupCollectiveOperation { op, collective_op, argument, result } => {
                let value = self.evaluate(world, argument)?;
                self.wait(0, Request::Collective { op, kind: collective_op, value }, Some(result));
            }
            Statement::RayQuery { .. } | Statement::RayPipelineFunction(_) | Statement::CooperativeStore { .. } => {
                return Err(Fault::Unsupported("ray queries and cooperative matrices".into()));
            }
        }
        Ok(())
    }
}
