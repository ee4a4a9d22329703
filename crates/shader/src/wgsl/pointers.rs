//! Pointers to storage, uniform and workgroup memory as parameters, which naga's validation refuses.
//!
//! A function with such parameters is copied for each place that its callers point to: the parameter becomes the variable and the path to
//! the place, and indices on that path become parameters. `f(&list.items[i])` calls a copy of `f` that has `list.items[i0]` for its pointer
//! and is given `i` for `i0`. The functions are written callees first, as naga wants them.

use std::collections::HashMap;

use naga::front::Typifier;
use naga::{
    AddressSpace, Arena, Block, Expression, Function, FunctionArgument, GlobalVariable, Handle, ImageQuery, Module,
    SampleLevel, Span, Statement, Type, TypeInner,
};

use super::types_of;

type Refusal = (Span, String);

/// A step from a variable to a place in it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Step {
    Part(u32),
    /// By an index of this type, which is known when the function is called.
    Index(Handle<Type>),
}

#[derive(Clone, Debug, PartialEq, Eq, Hash)]
struct Path {
    variable: Handle<GlobalVariable>,
    steps: Vec<Step>,
}

/// A function, and what its pointers point to; none for other parameters.
type Key = (Handle<Function>, Vec<Option<Path>>);

fn is_memory(module: &Module, ty: Handle<Type>) -> bool {
    let space = module.types[ty].inner.pointer_space();
    matches!(space, Some(AddressSpace::Storage { .. } | AddressSpace::Uniform | AddressSpace::WorkGroup))
}

/// Expressions of all copies.
const EXPRESSIONS: usize = 1 << 20;

struct Copies {
    old: Arena<Function>,
    new: Arena<Function>,
    made: HashMap<Key, Handle<Function>>,
    /// Expressions that may still be copied.
    left: usize,
}

/// Copies functions so that no parameter is a pointer to memory.
///
/// # Errors
/// If a pointer does not lead to a variable, or there are too many copies.
pub(super) fn specialise(module: &mut Module) -> Result<(), Refusal> {
    let has = |function: &Function| function.arguments.iter().any(|argument| is_memory(module, argument.ty));
    if !module.functions.iter().any(|(_, function)| has(function)) {
        return Ok(());
    }
    let old = std::mem::take(&mut module.functions);
    let mut copies = Copies { old, new: Arena::new(), made: HashMap::new(), left: EXPRESSIONS };
    // Functions that nothing calls are kept if they can be.
    let handles: Vec<Handle<Function>> = copies.old.iter().map(|(handle, _)| handle).collect();
    for handle in handles {
        let arguments = &copies.old[handle].arguments;
        if !arguments.iter().any(|argument| is_memory(module, argument.ty)) {
            let key = (handle, vec![None; arguments.len()]);
            copies.copy(module, key)?;
        }
    }
    for n in 0..module.entry_points.len() {
        let function = module.entry_points[n].function.clone();
        let targets = vec![None; function.arguments.len()];
        module.entry_points[n].function = copies.rewrite(module, &function, &targets)?;
    }
    module.functions = copies.new;
    Ok(())
}

/// A function that is being written anew.
struct Rewriting {
    /// New numbers of the expressions.
    map: Vec<Handle<Expression>>,
    /// The indices on the path of each pointer parameter.
    indices: Vec<Vec<Handle<Expression>>>,
}

/// A call: the copy that it calls, and the indices that it gives in addition.
struct Call {
    function: Handle<Function>,
    dropped: Vec<bool>,
    indices: Vec<Index>,
}

/// An index on a path: one of the caller's expressions, or one that the caller was given.
#[derive(Clone, Copy)]
enum Index {
    Own(Handle<Expression>),
    Given { parameter: usize, number: usize },
}

impl Copies {
    fn copy(&mut self, module: &mut Module, key: Key) -> Result<Handle<Function>, Refusal> {
        if let Some(&made) = self.made.get(&key) {
            return Ok(made);
        }
        let span = self.old.get_span(key.0);
        let function = self.old[key.0].clone();
        if key.1.iter().any(Option::is_some) {
            let left = self.left.checked_sub(function.expressions.len() + 1).ok_or_else(|| {
                let message = format!(
                    "copies of functions for each place that their pointers to memory lead to have more than {EXPRESSIONS} expressions"
                );
                (span, message)
            })?;
            self.left = left;
        }
        let rewritten = self.rewrite(module, &function, &key.1)?;
        let made = self.new.append(rewritten, span);
        self.made.insert(key, made);
        Ok(made)
    }

    fn rewrite(&mut self, module: &mut Module, function: &Function, targets: &[Option<Path>]) -> Result<Function, Refusal> {
        let types = types_of(module, &self.old, function)?;
        // Callees come first. Calls are found in the order in which they are written again.
        let mut calls = Vec::new();
        self.calls(module, function, &types, targets, &function.body, &mut calls)?;

        let mut new = Function { name: function.name.clone(), result: function.result.clone(), ..Function::default() };
        new.diagnostic_filter_leaf = function.diagnostic_filter_leaf;
        let mut kept = Vec::new();
        for (argument, target) in function.arguments.iter().zip(targets) {
            kept.push(new.arguments.len() as u32);
            if target.is_none() {
                new.arguments.push(argument.clone());
            }
        }
        let mut rewriting = Rewriting { map: Vec::new(), indices: Vec::new() };
        let mut variables = Vec::new();
        for target in targets {
            let mut indices = Vec::new();
            for step in target.iter().flat_map(|path| &path.steps) {
                if let Step::Index(ty) = *step {
                    let number = new.arguments.len() as u32;
                    new.arguments.push(FunctionArgument { name: Some(format!("index_{number}")), ty, binding: None });
                    indices.push(new.expressions.append(Expression::FunctionArgument(number), Span::UNDEFINED));
                }
            }
            rewriting.indices.push(indices);
            variables.push(
                target.as_ref().map(|path| new.expressions.append(Expression::GlobalVariable(path.variable), Span::UNDEFINED)),
            );
        }
        let begin = new.expressions.len();
        for (n, target) in targets.iter().enumerate() {
            let (Some(path), Some(variable)) = (target, variables[n]) else { continue };
            let mut indices = rewriting.indices[n].iter();
            let mut base = variable;
            for step in &path.steps {
                let expression = match (step, indices.as_slice().first()) {
                    (Step::Part(index), _) => Expression::AccessIndex { base, index: *index },
                    (Step::Index(_), Some(&index)) => {
                        indices.next();
                        Expression::Access { base, index }
                    }
                    (Step::Index(_), None) => continue,
                };
                base = new.expressions.append(expression, Span::UNDEFINED);
            }
            variables[n] = Some(base);
        }
        let paths = new.expressions.range_from(begin);
        let results: HashMap<Handle<Expression>, Handle<Function>> = results(&function.body, &calls);
        for (handle, expression) in function.expressions.iter() {
            let mut expression = expression.clone();
            let mut place = None;
            match &mut expression {
                Expression::FunctionArgument(n) => {
                    place = variables[*n as usize];
                    *n = kept[*n as usize];
                    if let Some(target) = place {
                        // Never used, and it keeps the numbers in line.
                        expression = match new.expressions[target] {
                            Expression::GlobalVariable(variable) => Expression::GlobalVariable(variable),
                            _ => Expression::Literal(naga::Literal::U32(0)),
                        };
                    }
                }
                Expression::CallResult(called) => {
                    if let Some(&copy) = results.get(&handle) {
                        *called = copy;
                    }
                }
                other => of_expression(other, &mut |h| *h = rewriting.map[h.index()]),
            }
            let here = new.expressions.append(expression, function.expressions.get_span(handle));
            rewriting.map.push(place.unwrap_or(here));
        }
        for (_, local) in function.local_variables.iter() {
            let mut local = local.clone();
            local.init = local.init.map(|init| rewriting.map[init.index()]);
            new.local_variables.append(local, Span::UNDEFINED);
        }
        for (handle, name) in &function.named_expressions {
            new.named_expressions.insert(rewriting.map[handle.index()], name.clone());
        }
        let mut calls = calls.into_iter();
        let offset = new.expressions.len() - function.expressions.len();
        new.body = rewriting.block(&function.body, &mut calls, &new.expressions, offset);
        if new.expressions.len() > begin && paths.first_and_last().is_some() {
            let mut body = Block::new();
            body.push(Statement::Emit(paths), Span::UNDEFINED);
            body.append(&mut new.body);
            new.body = body;
        }
        Ok(new)
    }

    /// Finds what the calls of a block call, and makes the copies.
    fn calls(
        &mut self,
        module: &mut Module,
        function: &Function,
        types: &Typifier,
        targets: &[Option<Path>],
        block: &Block,
        out: &mut Vec<Call>,
    ) -> Result<(), Refusal> {
        for (statement, &span) in block.span_iter() {
            if let Statement::Call { function: called, arguments, .. } = statement {
                let mut call = Call { function: *called, dropped: Vec::new(), indices: Vec::new() };
                let parameters: Vec<Handle<Type>> = self.old[*called].arguments.iter().map(|argument| argument.ty).collect();
                let mut paths = Vec::new();
                for (&argument, ty) in arguments.iter().zip(parameters) {
                    let path = if is_memory(module, ty) {
                        if *types[argument].inner_with(&module.types) != module.types[ty].inner {
                            return Err((span, "a pointer of another type than the function's parameter".to_owned()));
                        }
                        let found = path(module, function, types, targets, argument);
                        let (path, indices) = found.ok_or_else(|| {
                            (span, "a pointer that leads to no variable of the module is given to a function".to_owned())
                        })?;
                        call.indices.extend(indices);
                        Some(path)
                    } else {
                        None
                    };
                    call.dropped.push(path.is_some());
                    paths.push(path);
                }
                call.function = self.copy(module, (*called, paths))?;
                out.push(call);
            }
            for inner in blocks(statement) {
                self.calls(module, function, types, targets, inner, out)?;
            }
        }
        Ok(())
    }
}

/// Where a pointer leads, and the indices on the path.
fn path(
    module: &mut Module,
    function: &Function,
    types: &Typifier,
    targets: &[Option<Path>],
    pointer: Handle<Expression>,
) -> Option<(Path, Vec<Index>)> {
    match function.expressions[pointer] {
        Expression::GlobalVariable(variable) => Some((Path { variable, steps: Vec::new() }, Vec::new())),
        Expression::FunctionArgument(n) => {
            let path = targets.get(n as usize)?.clone()?;
            let count = path.steps.iter().filter(|step| matches!(step, Step::Index(_))).count();
            let indices = (0..count).map(|number| Index::Given { parameter: n as usize, number }).collect();
            Some((path, indices))
        }
        Expression::AccessIndex { base, index } => {
            let (mut found, indices) = path(module, function, types, targets, base)?;
            found.steps.push(Step::Part(index));
            Some((found, indices))
        }
        Expression::Access { base, index } => {
            let (mut found, mut indices) = path(module, function, types, targets, base)?;
            let TypeInner::Scalar(scalar) = *types[index].inner_with(&module.types) else { return None };
            let ty = module.types.insert(Type { name: None, inner: TypeInner::Scalar(scalar) }, Span::UNDEFINED);
            found.steps.push(Step::Index(ty));
            indices.push(Index::Own(index));
            Some((found, indices))
        }
        _ => None,
    }
}

/// The blocks inside of a statement.
fn blocks(statement: &Statement) -> Vec<&Block> {
    match statement {
        Statement::Block(block) => vec![block],
        Statement::If { accept, reject, .. } => vec![accept, reject],
        Statement::Switch { cases, .. } => cases.iter().map(|case| &case.body).collect(),
        Statement::Loop { body, continuing, .. } => vec![body, continuing],
        _ => Vec::new(),
    }
}

/// Which copy each result of a call comes from.
fn results(block: &Block, calls: &[Call]) -> HashMap<Handle<Expression>, Handle<Function>> {
    fn visit<'c>(
        block: &Block,
        calls: &mut impl Iterator<Item = &'c Call>,
        out: &mut HashMap<Handle<Expression>, Handle<Function>>,
    ) {
        for statement in block.iter() {
            if let Statement::Call { result, .. } = statement
                && let Some(call) = calls.next()
            {
                out.extend(result.map(|result| (result, call.function)));
            }
            for inner in blocks(statement) {
                visit(inner, calls, out);
            }
        }
    }
    let mut out = HashMap::new();
    visit(block, &mut calls.iter(), &mut out);
    out
}

impl Rewriting {
    fn index(&self, index: Index) -> Handle<Expression> {
        match index {
            Index::Own(handle) => self.map[handle.index()],
            Index::Given { parameter, number } => self.indices[parameter][number],
        }
    }

    fn block(
        &self,
        block: &Block,
        calls: &mut std::vec::IntoIter<Call>,
        expressions: &Arena<Expression>,
        offset: usize,
    ) -> Block {
        let mut out = Block::with_capacity(block.len());
        for (statement, &span) in block.span_iter() {
            let mut statement = statement.clone();
            let call = if matches!(statement, Statement::Call { .. }) { calls.next() } else { None };
            match &mut statement {
                Statement::Emit(range) => {
                    let moved = range.index_range();
                    let shift = |n: u32| n + offset as u32;
                    *range = naga::Range::from_index_range(shift(moved.start)..shift(moved.end), expressions);
                }
                Statement::Block(inner) => *inner = self.block(inner, calls, expressions, offset),
                Statement::If { accept, reject, .. } => {
                    *accept = self.block(accept, calls, expressions, offset);
                    *reject = self.block(reject, calls, expressions, offset);
                }
                Statement::Switch { cases, .. } => {
                    cases.iter_mut().for_each(|case| case.body = self.block(&case.body, calls, expressions, offset));
                }
                Statement::Loop { body, continuing, .. } => {
                    *body = self.block(body, calls, expressions, offset);
                    *continuing = self.block(continuing, calls, expressions, offset);
                }
                _ => {}
            }
            of_statement(&mut statement, &mut |h| *h = self.map[h.index()]);
            if let (Statement::Call { function, arguments, .. }, Some(call)) = (&mut statement, call) {
                *function = call.function;
                let mut dropped = call.dropped.iter();
                arguments.retain(|_| dropped.next() != Some(&true));
                arguments.extend(call.indices.iter().map(|&index| self.index(index)));
            }
            out.push(statement, span);
        }
        out
    }
}

/// Calls `f` for each expression that an expression names.
fn of_expression(expression: &mut Expression, f: &mut dyn FnMut(&mut Handle<Expression>)) {
    match expression {
        Expression::Compose { components, .. } => components.iter_mut().for_each(f),
        Expression::Access { base, index } => [base, index].into_iter().for_each(f),
        Expression::AccessIndex { base, .. } => f(base),
        Expression::Splat { value, .. } => f(value),
        Expression::Swizzle { vector, .. } => f(vector),
        Expression::Load { pointer } => f(pointer),
        Expression::ImageSample { image, sampler, coordinate, array_index, offset, level, depth_ref, .. } => {
            [image, sampler, coordinate].into_iter().for_each(&mut *f);
            [array_index, offset, depth_ref].into_iter().flatten().for_each(&mut *f);
            match level {
                SampleLevel::Auto | SampleLevel::Zero => {}
                SampleLevel::Exact(level) | SampleLevel::Bias(level) => f(level),
                SampleLevel::Gradient { x, y } => [x, y].into_iter().for_each(f),
            }
        }
        Expression::ImageLoad { image, coordinate, array_index, sample, level } => {
            [image, coordinate].into_iter().for_each(&mut *f);
            [array_index, sample, level].into_iter().flatten().for_each(f);
        }
        Expression::ImageQuery { image, query } => {
            f(image);
            if let ImageQuery::Size { level: Some(level) } = query {
                f(level);
            }
        }
        Expression::Unary { expr, .. } | Expression::Derivative { expr, .. } | Expression::As { expr, .. } => f(expr),
        Expression::Binary { left, right, .. } => [left, right].into_iter().for_each(f),
        Expression::Select { condition, accept, reject } => [condition, accept, reject].into_iter().for_each(f),
        Expression::Relational { argument, .. } | Expression::ArrayLength(argument) => f(argument),
        Expression::Math { arg, arg1, arg2, arg3, .. } => {
            f(arg);
            [arg1, arg2, arg3].into_iter().flatten().for_each(f);
        }
        // No other has operands, but for those of ray queries and cooperative matrices, which are not supported.
        _ => {}
    }
}

/// Calls `f` for each expression that a statement names, without those of blocks inside of it and of `Emit`.
fn of_statement(statement: &mut Statement, f: &mut dyn FnMut(&mut Handle<Expression>)) {
    match statement {
        Statement::If { condition, .. } => f(condition),
        Statement::Switch { selector, .. } => f(selector),
        Statement::Loop { break_if, .. } => break_if.iter_mut().for_each(f),
        Statement::Return { value } => value.iter_mut().for_each(f),
        Statement::Store { pointer, value } => [pointer, value].into_iter().for_each(f),
        Statement::ImageStore { image, coordinate, array_index, value } => {
            [image, coordinate, value].into_iter().for_each(&mut *f);
            array_index.iter_mut().for_each(f);
        }
        Statement::Atomic { pointer, fun, value, result } => {
            [pointer, value].into_iter().for_each(&mut *f);
            result.iter_mut().for_each(&mut *f);
            if let naga::AtomicFunction::Exchange { compare: Some(compare) } = fun {
                f(compare);
            }
        }
        Statement::ImageAtomic { image, coordinate, array_index, fun, value } => {
            [image, coordinate, value].into_iter().for_each(&mut *f);
            array_index.iter_mut().for_each(&mut *f);
            if let naga::AtomicFunction::Exchange { compare: Some(compare) } = fun {
                f(compare);
            }
        }
        Statement::WorkGroupUniformLoad { pointer, result } => [pointer, result].into_iter().for_each(f),
        Statement::Call { arguments, result, .. } => arguments.iter_mut().chain(result).for_each(f),
        Statement::SubgroupBallot { result, predicate } => {
            f(result);
            predicate.iter_mut().for_each(f);
        }
        Statement::SubgroupGather { mode, argument, result } => {
            [argument, result].into_iter().for_each(&mut *f);
            match mode {
                naga::GatherMode::BroadcastFirst | naga::GatherMode::QuadSwap(_) => {}
                naga::GatherMode::Broadcast(h)
                | naga::GatherMode::Shuffle(h)
                | naga::GatherMode::ShuffleDown(h)
                | naga::GatherMode::ShuffleUp(h)
                | naga::GatherMode::ShuffleXor(h)
                | naga::GatherMode::QuadBroadcast(h) => f(h),
            }
        }
        Statement::SubgroupCollectiveOperation { argument, result, .. } => [argument, result].into_iter().for_each(f),
        _ => {}
    }
}
