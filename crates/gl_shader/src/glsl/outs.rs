//! Components of vectors as arguments for `out` and `inout`. WGSL has no pointers to components, so the function gets a variable of its own, whose
//! value goes to the component after the call.

use naga::front::Typifier;
use naga::proc::ResolveContext;
use naga::{Block, Expression, Function, Handle, LocalVariable, Module, Range, Statement, Type, TypeInner};

/// Replaces such arguments in all functions.
pub fn outs(module: &mut Module) {
    let handles: Vec<Handle<Function>> = module.functions.iter().map(|(handle, _)| handle).collect();
    for handle in handles {
        let mut function = std::mem::take(&mut module.functions[handle]);
        let mut types = Typifier::new();
        let context = ResolveContext::with_locals(module, &function.local_variables, &function.arguments);
        // What has no type is an error that the validation names.
        let typed = function.expressions.iter().all(|(it, _)| types.grow(it, &function.expressions, &context).is_ok());
        if typed {
            let component = |argument: Handle<Expression>| match *types.get(argument, &module.types) {
                TypeInner::ValuePointer { size: None, scalar, .. } => Some(TypeInner::Scalar(scalar)),
                _ => None,
            };
            let is_place = |of: &Expression| matches!(of, Expression::Access { .. } | Expression::AccessIndex { .. });
            let places = function.expressions.iter().filter(|(_, of)| is_place(of));
            let found: Vec<_> = places.filter_map(|(it, _)| Some((it, component(it)?))).collect();
            let mut kinds: Vec<(Handle<Expression>, Handle<Type>)> = Vec::new();
            for (it, inner) in found {
                kinds.push((it, module.types.insert(Type { name: None, inner }, naga::Span::default())));
            }
            if !kinds.is_empty() {
                let mut body = std::mem::take(&mut function.body);
                calls(&mut body, &mut function, &kinds);
                function.body = body;
            }
        }
        module.functions[handle] = function;
    }
}

/// Rewrites the calls of a block. `kinds` are the pointers to components with the types of these, in order.
fn calls(block: &mut Block, function: &mut Function, kinds: &[(Handle<Expression>, Handle<Type>)]) {
    let statements = std::mem::take(block);
    for (mut statement, span) in statements.span_into_iter() {
        let mut after = Vec::new();
        match &mut statement {
            Statement::Block(inner) => calls(inner, function, kinds),
            Statement::If { accept, reject, .. } => [accept, reject].into_iter().for_each(|of| calls(of, function, kinds)),
            Statement::Loop { body, continuing, .. } => {
                [body, continuing].into_iter().for_each(|of| calls(of, function, kinds));
            }
            Statement::Switch { cases, .. } => cases.iter_mut().for_each(|case| calls(&mut case.body, function, kinds)),
            Statement::Call { arguments, .. } => {
                for argument in arguments {
                    let Ok(at) = kinds.binary_search_by_key(argument, |of| of.0) else { continue };
                    let place = *argument;
                    let variable = LocalVariable { name: None, ty: kinds[at].1, init: None };
                    let variable = Expression::LocalVariable(function.local_variables.append(variable, span));
                    *argument = function.expressions.append(variable, span);
                    copy(place, *argument, function, span, &mut |statement| block.push(statement, span));
                    after.push((*argument, place));
                }
            }
            _ => {}
        }
        block.push(statement, span);
        for (from, to) in after {
            copy(from, to, function, span, &mut |statement| block.push(statement, span));
        }
    }
}

/// Copies the value behind a pointer to another.
fn copy(
    from: Handle<Expression>,
    to: Handle<Expression>,
    function: &mut Function,
    span: naga::Span,
    push: &mut dyn FnMut(Statement),
) {
    let value = function.expressions.append(Expression::Load { pointer: from }, span);
    push(Statement::Emit(Range::new_from_bounds(value, value)));
    push(Statement::Store { pointer: to, value });
}
