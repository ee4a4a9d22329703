//! Invocations together: their order, barriers, subgroups, quads.

use naga::{CollectiveOperation, DerivativeAxis, DerivativeControl, GatherMode, SubgroupOperation};

use super::machine::{Invocation, State, Wait, World};
use super::memory::Pointee;
use super::textures::SampleArguments;
use super::value::{Number, Pointer, Value, broken};
use super::{Fault, LANES, builtins};

/// What an invocation waits for.
#[derive(Clone, Debug)]
pub enum Request {
    /// All of the workgroup.
    Barrier,
    /// The same, and then what a pointer points to.
    UniformLoad(Pointer, Pointee),
    /// Those of the subgroup that come to the same place; so are the next three.
    SubgroupBarrier,
    Ballot(bool),
    Gather {
        mode: GatherMode,
        index: u32,
        value: Value,
    },
    Collective {
        op: SubgroupOperation,
        kind: CollectiveOperation,
        value: Value,
    },
    /// The quad, as is the next.
    Derivative {
        axis: DerivativeAxis,
        control: DerivativeControl,
        value: Value,
    },
    Sample(Box<SampleArguments>),
}

impl Request {
    fn is_of_workgroup(&self) -> bool {
        matches!(self, Request::Barrier | Request::UniformLoad(..))
    }

    fn is_of_quad(&self) -> bool {
        matches!(self, Request::Derivative { .. } | Request::Sample(_))
    }
}

/// An invocation that came to a meeting place: its place in the subgroup, and what it asks.
type Member = (usize, Request);

/// Runs invocations to their end.
pub fn run_all<'a>(world: &mut World<'a>, invocations: &mut [Invocation<'a>]) -> Result<(), Fault> {
    loop {
        for invocation in invocations.iter_mut() {
            invocation.run(world)?;
        }
        if invocations.iter().all(|i| matches!(i.state, State::Ended)) {
            return Ok(());
        }
        end_dead_quads(world, invocations);
        let mut met = false;
        for subgroup in subgroups(invocations) {
            met |= meet(world, invocations, &subgroup)?;
        }
        // Where nothing but barriers is left in any subgroup, the whole workgroup must have come to one.
        if !met {
            release(world, invocations)?;
        }
    }
}

/// Ends the invocations of quads of which the last has been discarded: nobody is left whom helpers could help.
fn end_dead_quads(world: &World<'_>, invocations: &mut [Invocation<'_>]) {
    if world.module.entry_points[world.entry].stage != naga::ShaderStage::Fragment {
        return;
    }
    for quad in invocations.chunk_by_mut(|a, b| a.index / 4 == b.index / 4) {
        if quad.iter().all(|i| !i.has_effects()) && quad.iter().any(|i| i.discarded) {
            quad.iter_mut().for_each(|i| i.state = State::Ended);
        }
    }
}

/// Which of the invocations make up each subgroup.
fn subgroups(invocations: &[Invocation<'_>]) -> Vec<Vec<usize>> {
    let mut out: Vec<Vec<usize>> = Vec::new();
    for (at, invocation) in invocations.iter().enumerate() {
        let number = invocation.index / LANES;
        out.resize_with(out.len().max(number + 1), Vec::new);
        out[number].push(at);
    }
    out
}

/// What an invocation waits for.
fn wait_of<'i>(invocations: &'i [Invocation<'_>], at: usize) -> Option<&'i Wait> {
    match &invocations[at].state {
        State::Waits(wait) => Some(wait),
        _ => None,
    }
}

/// Lets those of a subgroup meet that wait at its first place; says whether there was something to do.
fn meet<'a>(world: &mut World<'a>, invocations: &mut [Invocation<'a>], subgroup: &[usize]) -> Result<bool, Fault> {
    let Some(first) = subgroup.iter().filter_map(|&at| wait_of(invocations, at)).map(|w| &w.place).min().cloned() else {
        return Ok(false);
    };
    let here = |at: usize| wait_of(invocations, at).filter(|w| w.place == first);
    let members: Vec<Member> =
        subgroup.iter().filter_map(|&at| Some((invocations[at].index % LANES, here(at)?.request.clone()))).collect();
    let indices: Vec<usize> = subgroup.iter().copied().filter(|&at| here(at).is_some()).collect();
    let request = &members[0].1;
    if request.is_of_workgroup() {
        return Ok(false);
    }
    let answers = if request.is_of_quad() {
        // Members are in order: those of a quad follow each other.
        let mut answers = Vec::new();
        for quad in members.chunk_by(|a, b| a.0 / 4 == b.0 / 4) {
            let Ok(quad) = <&[Member; 4]>::try_from(quad) else {
                return Err(Fault::Undefined("a derivative that not all of a quad come to".into()));
            };
            answers.extend(quad_answers(world, quad)?.map(Some));
        }
        answers
    } else {
        subgroup_answers(&members)?
    };
    for (at, answer) in indices.into_iter().zip(answers) {
        go_on(&mut invocations[at], answer)?;
    }
    Ok(true)
}

/// Hands an invocation what it waited for.
fn go_on(invocation: &mut Invocation<'_>, answer: Option<Value>) -> Result<(), Fault> {
    let State::Waits(wait) = std::mem::replace(&mut invocation.state, State::Runs) else {
        return broken("an answer for an invocation that does not wait");
    };
    if let Some(h) = wait.result {
        invocation.frame()?.expressions[h.index()] = answer;
    }
    Ok(())
}

/// Lets the workgroup pass its barrier.
fn release<'a>(world: &mut World<'a>, invocations: &mut [Invocation<'a>]) -> Result<(), Fault> {
    let place = wait_of(invocations, 0).map(|w| w.place.clone());
    if place.is_none() || (0..invocations.len()).any(|at| wait_of(invocations, at).map(|w| &w.place) != place.as_ref()) {
        return Err(Fault::Undefined("a barrier that not all of a workgroup come to".into()));
    }
    // All read before any goes on and may write.
    let mut answers = Vec::new();
    for at in 0..invocations.len() {
        let request = wait_of(invocations, at).map(|w| w.request.clone());
        answers.push(match request {
            Some(Request::UniformLoad(pointer, pointee)) => Some(world.load(&mut invocations[at], &pointer, pointee)?),
            _ => None,
        });
    }
    for (invocation, answer) in invocations.iter_mut().zip(answers) {
        go_on(invocation, answer)?;
    }
    Ok(())
}

/// What each member of a subgroup operation gets.
fn subgroup_answers(members: &[Member]) -> Result<Vec<Option<Value>>, Fault> {
    match members[0].1 {
        Request::SubgroupBarrier => Ok(vec![None; members.len()]),
        Request::Ballot(_) => {
            let mut bits = 0u64;
            for (lane, request) in members {
                if let Request::Ballot(true) = request {
                    bits |= 1 << lane;
                }
            }
            let words = [bits as u32, (bits >> 32) as u32, 0, 0].map(Number::Uint);
            Ok(vec![Some(Value::vector(&words)); members.len()])
        }
        Request::Gather { .. } => members.iter().map(|member| gather(members, member).map(Some)).collect(),
        Request::Collective { op, kind, .. } => collective(members, op, kind),
        _ => broken("a subgroup operation was expected"),
    }
}

/// The value that a member of a shuffle gets; zero from an invocation that is not there.
fn gather(members: &[Member], (lane, request): &Member) -> Result<Value, Fault> {
    let Request::Gather { mode, index, value } = request else { return broken("a shuffle was expected") };
    let (lane, index) = (*lane as u32, *index);
    let from = match *mode {
        GatherMode::BroadcastFirst => Some(members[0].0 as u32),
        GatherMode::Broadcast(_) | GatherMode::Shuffle(_) => Some(index),
        GatherMode::ShuffleDown(_) => lane.checked_add(index),
        GatherMode::ShuffleUp(_) => lane.checked_sub(index),
        GatherMode::ShuffleXor(_) => Some(lane ^ index),
        GatherMode::QuadBroadcast(_) => Some(lane / 4 * 4 + index % 4),
        GatherMode::QuadSwap(direction) => Some(match direction {
            naga::Direction::X => lane ^ 1,
            naga::Direction::Y => lane ^ 2,
            naga::Direction::Diagonal => lane ^ 3,
        }),
    };
    let giver = from.and_then(|from| members.iter().find(|(lane, _)| *lane as u32 == from));
    match giver {
        Some((_, Request::Gather { value, .. })) => Ok(value.clone()),
        _ => value.map(&mut |n| {
            Ok(match n {
                Number::Bool(_) => Number::Bool(false),
                Number::Sint(_) => Number::Sint(0),
                Number::Uint(_) => Number::Uint(0),
                Number::Float(_) => Number::Float(0.0),
                Number::Half(_) => Number::Half(0.0),
            })
        }),
    }
}

/// Votes, sums, products and the like. A sum of floats begins with zero and adds in the order of the invocations; one of `f16`
/// is computed in 32 bits and each result rounded.
fn collective(members: &[Member], op: SubgroupOperation, kind: CollectiveOperation) -> Result<Vec<Option<Value>>, Fault> {
    let mut values = Vec::new();
    for (_, request) in members {
        match request {
            Request::Collective { value, .. } => values.push(value),
            _ => return broken("a collective operation was expected"),
        }
    }
    if let SubgroupOperation::All | SubgroupOperation::Any = op {
        let votes = values.iter().map(|v| v.truth()).collect::<Result<Vec<_>, _>>()?;
        let all = op == SubgroupOperation::All;
        let result = if all { votes.iter().all(|&v| v) } else { votes.iter().any(|&v| v) };
        return Ok(vec![Some(Value::Number(Number::Bool(result))); members.len()]);
    }
    // In 32 bits until the end.
    let wide = |n: Number| if let Number::Half(x) = n { Number::Float(x) } else { n };
    let narrow = |model: &Value, sum: &Value| {
        let half = matches!(model.numbers()?[0], Number::Half(_));
        let number = |n: Number| match n {
            Number::Float(x) if half => Number::Half(0.0).same_float(x),
            other => other,
        };
        sum.map(&mut |n| Ok(number(n)))
    };
    let mut sum = values[0].map(&mut |n| neutral(op, wide(n)))?;
    let mut before = Vec::new();
    let mut after = Vec::new();
    for value in &values {
        before.push(narrow(value, &sum)?);
        sum = sum.zip(&value.map(&mut |n| Ok(wide(n)))?, &mut |a, b| combine(op, a, b))?;
        after.push(narrow(value, &sum)?);
    }
    Ok(match kind {
        CollectiveOperation::Reduce => vec![after.last().cloned(); members.len()],
        CollectiveOperation::InclusiveScan => after.into_iter().map(Some).collect(),
        CollectiveOperation::ExclusiveScan => before.into_iter().map(Some).collect(),
    })
}

/// The number that changes nothing when it is combined.
fn neutral(op: SubgroupOperation, like: Number) -> Result<Number, Fault> {
    use SubgroupOperation as S;
    let number = |float: f32, signed: i32, unsigned: u32| match like {
        Number::Float(_) => Ok(Number::Float(float)),
        Number::Sint(_) => Ok(Number::Sint(signed)),
        Number::Uint(_) => Ok(Number::Uint(unsigned)),
        _ => broken("a collective operation of `bool`"),
    };
    match op {
        S::Add => number(0.0, 0, 0),
        S::Mul => number(1.0, 1, 1),
        S::Min => number(f32::INFINITY, i32::MAX, u32::MAX),
        S::Max => number(f32::NEG_INFINITY, i32::MIN, 0),
        S::And => number(f32::NAN, -1, u32::MAX),
        S::Or | S::Xor => number(f32::NAN, 0, 0),
        S::All | S::Any => broken("a vote has no neutral number"),
    }
}

fn combine(op: SubgroupOperation, a: Number, b: Number) -> Result<Number, Fault> {
    use Number::{Float, Sint, Uint};
    use SubgroupOperation as S;
    Ok(match (op, a, b) {
        (S::Add, Float(a), Float(b)) => Float(a + b),
        (S::Add, Sint(a), Sint(b)) => Sint(a.wrapping_add(b)),
        (S::Add, Uint(a), Uint(b)) => Uint(a.wrapping_add(b)),
        (S::Mul, Float(a), Float(b)) => Float(a * b),
        (S::Mul, Sint(a), Sint(b)) => Sint(a.wrapping_mul(b)),
        (S::Mul, Uint(a), Uint(b)) => Uint(a.wrapping_mul(b)),
        (S::Min, Float(a), Float(b)) => Float(builtins::min(a, b)),
        (S::Min, Sint(a), Sint(b)) => Sint(a.min(b)),
        (S::Min, Uint(a), Uint(b)) => Uint(a.min(b)),
        (S::Max, Float(a), Float(b)) => Float(builtins::max(a, b)),
        (S::Max, Sint(a), Sint(b)) => Sint(a.max(b)),
        (S::Max, Uint(a), Uint(b)) => Uint(a.max(b)),
        (S::And, Sint(a), Sint(b)) => Sint(a & b),
        (S::And, Uint(a), Uint(b)) => Uint(a & b),
        (S::Or, Sint(a), Sint(b)) => Sint(a | b),
        (S::Or, Uint(a), Uint(b)) => Uint(a | b),
        (S::Xor, Sint(a), Sint(b)) => Sint(a ^ b),
        (S::Xor, Uint(a), Uint(b)) => Uint(a ^ b),
        _ => return broken("a collective operation of these numbers"),
    })
}

/// What each pixel of a quad gets. Pixels are numbered along rows: 0 and 1 above 2 and 3.
fn quad_answers(world: &mut World<'_>, quad: &[Member; 4]) -> Result<[Value; 4], Fault> {
    match &quad[0].1 {
        &Request::Derivative { axis, control, .. } => {
            let mut values = Vec::new();
            for (_, request) in quad {
                match request {
                    Request::Derivative { value, .. } => values.push(value),
                    _ => return broken("a derivative was expected"),
                }
            }
            derivatives(axis, control, &values)
        }
        Request::Sample(_) => {
            let mut arguments = Vec::new();
            for (_, request) in quad {
                match request {
                    Request::Sample(a) => arguments.push(&**a),
                    _ => return broken("a sample was expected"),
                }
            }
            let mut out = Vec::new();
            for pixel in 0..4 {
                out.push(world.sample(&arguments, pixel)?);
            }
            <[Value; 4]>::try_from(out).map_err(|_| Fault::Unsupported("a quad of other than four".into()))
        }
        _ => broken("a derivative was expected"),
    }
}

fn derivatives(axis: DerivativeAxis, control: DerivativeControl, values: &[&Value]) -> Result<[Value; 4], Fault> {
    let coarse = control == DerivativeControl::Coarse;
    let minus =
        |b: usize, a: usize| values[b].zip(values[a], &mut |b, a| super::number::binary(naga::BinaryOperator::Subtract, b, a));
    // Along x: within the pixel's row, or in the upper row; along y: within its column, or in the left one.
    let along_x = |pixel: usize| if coarse || pixel < 2 { minus(1, 0) } else { minus(3, 2) };
    let along_y = |pixel: usize| if coarse || pixel.is_multiple_of(2) { minus(2, 0) } else { minus(3, 1) };
    let one = |pixel: usize| match axis {
        DerivativeAxis::X => along_x(pixel),
        DerivativeAxis::Y => along_y(pixel),
        DerivativeAxis::Width => along_x(pixel)?.zip(&along_y(pixel)?, &mut |x, y| match (x, y) {
            (Number::Float(a), Number::Float(b)) | (Number::Half(a), Number::Half(b)) => Ok(x.same_float(a.abs() + b.abs())),
            _ => broken("a derivative of something that is no float"),
        }),
    };
    Ok([one(0)?, one(1)?, one(2)?, one(3)?])
}
