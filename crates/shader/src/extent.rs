//! Depth and size of a module that was not text: of SPIR-V before naga reads it, of naga's IR before any pass walks it.

use naga::{ArraySize, Block, Expression, Handle, Span, Statement, TypeInner};

use super::lower::each_statement;
use super::nesting::pairs;
use host::one_line;
use num::{LimitExceeded, Limits};

/// The instructions of a SPIR-V module: their first words and their codes. Five words of header come before them. Each begins with its
/// length in words and its code. A length of 0 ends the module.
pub(super) fn instructions(words: &[u32]) -> impl Iterator<Item = (usize, u32)> {
    let mut at = 5;
    std::iter::from_fn(move || {
        let first = *words.get(at)?;
        let here = at;
        at += (first >> 16) as usize;
        (at > here).then_some((here, first & 0xffff))
    })
}

/// Checks how deep the structured control flow of a SPIR-V module is nested: naga's front end calls itself for it; and how many instructions
/// its functions have. What is no such module is naga's to refuse. Returns the [`pairs`] of the functions; each begins with an expression for
/// each constant and variable outside of functions.
///
/// # Errors
/// If it is nested deeper or has more pairs than the limits allow, with the word of the instruction.
pub(super) fn check_spirv(words: &[u32], limits: &Limits) -> Result<u64, (u32, String)> {
    const FUNCTION: u32 = 54;
    const FUNCTION_END: u32 = 56;
    const LOOP_MERGE: u32 = 246;
    const SELECTION_MERGE: u32 = 247;
    const LABEL: u32 = 248;
    // Blocks of constructs that are open, each with the id of the block where it ends. That block comes after all others of its construct.
    let mut open: Vec<u32> = Vec::new();
    let mut ends = std::collections::HashMap::<u32, usize>::new();
    let (mut outside, mut inside, mut sum) = (0_u64, 0_u64, 0_u64);
    for (at, code) in instructions(words) {
        let operand = words.get(at + 1).copied().unwrap_or(0);
        inside += 1;
        match code {
            FUNCTION => {
                open.clear();
                ends.clear();
                outside += std::mem::take(&mut inside);
            }
            FUNCTION_END => {
                let own = std::mem::take(&mut inside);
                sum = sum.saturating_add(pairs(own, own.saturating_add(outside)));
                limits.shader_pairs.check(sum).map_err(|error| (at as u32, error.to_string()))?;
            }
            LOOP_MERGE | SELECTION_MERGE => {
                ends.insert(operand, open.len());
                open.push(operand);
                limits.shader_nesting.check(open.len() as u64).map_err(|error| (at as u32, error.to_string()))?;
            }
            LABEL => {
                if let Some(depth) = ends.remove(&operand) {
                    for inner in open.drain(depth.min(open.len())..) {
                        ends.remove(&inner);
                    }
                }
            }
            _ => {}
        }
    }
    Ok(sum)
}

/// The deepest of statements inside statements.
fn blocks(block: &Block) -> u64 {
    let nested = |statement: &Statement| match statement {
        Statement::Block(b) => blocks(b) + 1,
        Statement::If { accept, reject, .. } => blocks(accept).max(blocks(reject)) + 1,
        Statement::Switch { cases, .. } => cases.iter().map(|case| blocks(&case.body)).max().unwrap_or(0) + 1,
        Statement::Loop { body, continuing, .. } => blocks(body).max(blocks(continuing)) + 1,
        _ => 0,
    };
    block.iter().map(nested).max().unwrap_or(0)
}

/// Checks a module that nothing has looked at yet: handles may lead anywhere.
///
/// # Errors
/// If it is nested deeper, has more declarations, or its constants reach further than the limits allow: where, and what by naga's handle.
pub(super) fn check_ir(module: &naga::Module, limits: &Limits) -> Result<(), (Span, String)> {
    let of_all = |error: LimitExceeded| (Span::UNDEFINED, error.to_string());
    let declarations = module.functions.len() + module.global_variables.len() + module.entry_points.len();
    limits.shader_declarations.check(declarations as u64).map_err(of_all)?;
    // What stands before may be referred to; what does not is refused by naga.
    let before = |known: &[u64], index: usize| known.get(index).copied().unwrap_or(0);

    // Depth and number of parts of each type when it is written out: naga asks of each part of a structure, and of the parts of those,
    // whether it can be constructed. And the number of elements of its values.
    let mut types: Vec<u64> = Vec::with_capacity(module.types.len());
    let mut parts: Vec<u64> = Vec::with_capacity(module.types.len());
    let mut elements: Vec<u64> = Vec::with_capacity(module.types.len());
    let mut written = 0u64;
    for (handle, ty) in module.types.iter() {
        let refuse = |error: LimitExceeded| (module.types.get_span(handle), format!("type {handle:?}: {error}"));
        elements.push(match ty.inner {
            TypeInner::Array { base, size: ArraySize::Constant(size), .. } => {
                before(&elements, base.index()).saturating_mul(u64::from(size.get()))
            }
            TypeInner::Struct { ref members, .. } => {
                members.iter().fold(0, |sum, member| sum.saturating_add(before(&elements, member.ty.index())))
            }
            _ => 1,
        });
        let (mut depth, mut size) = (0, 1u64);
        let mut part = |ty: Handle<naga::Type>| {
            depth = depth.max(before(&types, ty.index()));
            size = size.saturating_add(before(&parts, ty.index()));
        };
        match ty.inner {
            TypeInner::Array { base, .. } | TypeInner::BindingArray { base, .. } | TypeInner::Pointer { base, .. } => {
                part(base)
            }
            TypeInner::Struct { ref members, .. } => members.iter().for_each(|member| part(member.ty)),
            _ => {}
        }
        limits.shader_nesting.check(depth + 1).map_err(refuse)?;
        limits.shader_constants.check(size).map_err(refuse)?;
        written = written.saturating_add(size);
        types.push(depth + 1);
        parts.push(size);
    }
    limits.shader_instructions.check(written).map_err(of_all)?;

    // Depth and number of expressions of each constant when it is written out; and the elements of zero values in it, which naga makes a list
    // of where it computes with them. It asks for the types of operands only then.
    let (mut depths, mut sizes): (Vec<u64>, Vec<u64>) = Default::default();
    let mut zeros: Vec<u64> = Vec::new();
    let mut computed = 0u64;
    let init = |c: Handle<naga::Constant>| module.constants.try_get(c).map_or(usize::MAX, |constant| constant.init.index());
    for (handle, expression) in module.global_expressions.iter() {
        let refuse = |error: LimitExceeded| {
            (module.global_expressions.get_span(handle), format!("constant expression {handle:?}: {error}"))
        };
        let (mut depth, mut size, mut zero) = (0, 1u64, 0u64);
        let mut part = |index: usize| {
            depth = depth.max(before(&depths, index));
            size = size.saturating_add(before(&sizes, index));
            zero = zero.saturating_add(before(&zeros, index));
        };
        operands(expression, &mut |h| part(h.index()));
        match *expression {
            Expression::Constant(c) => part(init(c)),
            Expression::ZeroValue(ty) => zero = before(&elements, ty.index()),
            Expression::Compose { .. } | Expression::Access { .. } | Expression::AccessIndex { .. } => {}
            // What is computed is no larger than a matrix.
            _ => computed = computed.saturating_add(std::mem::replace(&mut zero, 16)),
        }
        limits.shader_nesting.check(depth + 1).map_err(refuse)?;
        limits.shader_constants.check(size.max(computed)).map_err(refuse)?;
        depths.push(depth + 1);
        sizes.push(size);
        zeros.push(zero);
    }

    let mut total = module.global_expressions.len() as u64;
    let mut functions: Vec<u64> = Vec::with_capacity(module.functions.len());
    let all = module.functions.iter().map(|(handle, f)| (module.functions.get_span(handle), f));
    for (span, function) in all.chain(module.entry_points.iter().map(|entry| (Span::UNDEFINED, &entry.function))) {
        let number = functions.len();
        let refuse = |error: LimitExceeded| {
            let entry = number.checked_sub(module.functions.len()).and_then(|entry| module.entry_points.get(entry));
            let name = entry.map(|entry| &entry.name).or(function.name.as_ref()).map(|name| format!(" `{}`", one_line(name)));
            let what = if entry.is_some() { "entry point".to_owned() } else { format!("function [{number}]") };
            (span, format!("{what}{}: {error}", name.unwrap_or_default()))
        };
        for (_, expression) in function.expressions.iter() {
            total += 1;
            if let Expression::Constant(c) = *expression {
                total = total.saturating_add(before(&sizes, init(c)));
            }
        }
        limits.shader_constants.check(total).map_err(refuse)?;
        let mut called = 0;
        each_statement(&function.body, &mut |statement| {
            if let Statement::Call { function, .. } = statement {
                called = called.max(before(&functions, function.index()));
            }
        });
        let depth = blocks(&function.body) + 1 + called;
        limits.shader_nesting.check(depth).map_err(refuse)?;
        functions.push(depth);
    }
    Ok(())
}

/// Calls `f` for each operand of a constant expression.
fn operands(expression: &Expression, f: &mut dyn FnMut(Handle<Expression>)) {
    match *expression {
        Expression::Compose { ref components, .. } => components.iter().copied().for_each(f),
        Expression::Access { base, index } => [base, index].into_iter().for_each(f),
        Expression::AccessIndex { base, .. } => f(base),
        Expression::Splat { value, .. } => f(value),
        Expression::Swizzle { vector, .. } => f(vector),
        Expression::Unary { expr, .. } | Expression::As { expr, .. } => f(expr),
        Expression::Binary { left, right, .. } => [left, right].into_iter().for_each(f),
        Expression::Select { condition, accept, reject } => [condition, accept, reject].into_iter().for_each(f),
        Expression::Relational { argument, .. } => f(argument),
        Expression::Math { arg, arg1, arg2, arg3, .. } => [Some(arg), arg1, arg2, arg3].into_iter().flatten().for_each(f),
        _ => {}
    }
}

/// Frees the blocks of a module one after the other: what the compiler makes of it calls itself for each that is nested, on whatever stack
/// there is.
pub(super) fn take_apart(module: &mut naga::Module) {
    let functions = module.functions.iter_mut().map(|(_, function)| function);
    let mut open: Vec<Block> = functions
        .chain(module.entry_points.iter_mut().map(|entry| &mut entry.function))
        .map(|function| std::mem::take(&mut function.body))
        .collect();
    while let Some(mut block) = open.pop() {
        for (statement, _) in block.span_iter_mut() {
            match statement {
                Statement::Block(inner) => open.push(std::mem::take(inner)),
                Statement::If { accept, reject, .. } => open.extend([std::mem::take(accept), std::mem::take(reject)]),
                Statement::Switch { cases, .. } => open.extend(cases.iter_mut().map(|case| std::mem::take(&mut case.body))),
                Statement::Loop { body, continuing, .. } => open.extend([std::mem::take(body), std::mem::take(continuing)]),
                _ => {}
            }
        }
    }
}
