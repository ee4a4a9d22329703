//! Types of numbers that naga knows and this implementation does not have, named as wgpu's features are.
//!
//! naga's validator finds them too, but often says only what it fails at ("Unable to cast"). So they are looked for where it refuses a module.

use naga::{Expression, Function, Handle, Literal, Module, Scalar, ScalarKind, Span, Type, TypeInner};

/// Numbers that are not supported: what they are, and wgpu's feature.
pub type Numbers = (&'static str, &'static str);

pub const INT64: Numbers = ("64-bit integers", "SHADER_INT64");
pub const FLOAT64: Numbers = ("64-bit floating-point numbers", "SHADER_F64");
pub const INT16: Numbers = ("16-bit integers", "SHADER_I16");

/// The message that numbers are not supported.
pub fn named((numbers, feature): Numbers) -> String {
    format!("{numbers} (feature {feature}) are not supported")
}

/// The first place of a module that has numbers which are not supported, and the message.
pub fn scalar(module: &Module) -> Option<(Span, String)> {
    // Of each type and of what it is made of: handles point backwards.
    let mut types: Vec<Option<Numbers>> = Vec::with_capacity(module.types.len());
    for (_, ty) in module.types.iter() {
        let before = |ty: Handle<Type>| types.get(ty.index()).copied().flatten();
        types.push(match &ty.inner {
            TypeInner::Array { base, .. } | TypeInner::BindingArray { base, .. } | TypeInner::Pointer { base, .. } => {
                before(*base)
            }
            TypeInner::Struct { members, .. } => members.iter().find_map(|member| before(member.ty)),
            inner => of_type(inner),
        });
    }
    let of = |ty: Handle<Type>| types.get(ty.index()).copied().flatten();
    let mut found: Vec<(Span, Numbers)> = Vec::new();
    // Built-in types have no place: what is declared with them has.
    found.extend(module.types.iter().filter_map(|(ty, _)| Some((module.types.get_span(ty), of(ty)?))));
    found.extend(module.constants.iter().filter_map(|(at, item)| Some((module.constants.get_span(at), of(item.ty)?))));
    found.extend(module.overrides.iter().filter_map(|(at, item)| Some((module.overrides.get_span(at), of(item.ty)?))));
    found.extend(
        module.global_variables.iter().filter_map(|(at, item)| Some((module.global_variables.get_span(at), of(item.ty)?))),
    );
    let expression = |expression: &Expression| match *expression {
        Expression::Literal(literal) => of_literal(literal),
        Expression::As { kind, convert: Some(width), .. } => of_scalar(Scalar { kind, width }),
        Expression::ZeroValue(ty) | Expression::Compose { ty, .. } => of(ty),
        _ => None,
    };
    let expressions = module.global_expressions.iter();
    found.extend(expressions.filter_map(|(at, item)| Some((module.global_expressions.get_span(at), expression(item)?))));
    let mut function = |function: &Function, span: Span| {
        let locals = function.local_variables.iter();
        found.extend(locals.filter_map(|(at, item)| Some((function.local_variables.get_span(at), of(item.ty)?))));
        let expressions = function.expressions.iter();
        found.extend(expressions.filter_map(|(at, item)| Some((function.expressions.get_span(at), expression(item)?))));
        let interface = function.arguments.iter().map(|item| item.ty).chain(function.result.as_ref().map(|item| item.ty));
        found.extend(interface.filter_map(|ty| Some((span, of(ty)?))));
    };
    module.functions.iter().for_each(|(at, item)| function(item, module.functions.get_span(at)));
    module.entry_points.iter().for_each(|item| function(&item.function, Span::UNDEFINED));
    let start = |span: &Span| span.to_range().map_or(usize::MAX, |range| range.start);
    found.into_iter().min_by_key(|(span, _)| start(span)).map(|(span, numbers)| (span, named(numbers)))
}

fn of_type(inner: &TypeInner) -> Option<Numbers> {
    match *inner {
        TypeInner::Scalar(scalar)
        | TypeInner::Vector { scalar, .. }
        | TypeInner::Matrix { scalar, .. }
        | TypeInner::Atomic(scalar)
        | TypeInner::ValuePointer { scalar, .. } => of_scalar(scalar),
        _ => None,
    }
}

fn of_literal(literal: Literal) -> Option<Numbers> {
    match literal {
        Literal::I64(_) | Literal::U64(_) => Some(INT64),
        Literal::F64(_) => Some(FLOAT64),
        other => of_scalar(other.scalar()),
    }
}

fn of_scalar(scalar: Scalar) -> Option<Numbers> {
    match (scalar.kind, scalar.width) {
        (ScalarKind::Sint | ScalarKind::Uint, 8) => Some(INT64),
        (ScalarKind::Sint | ScalarKind::Uint, 2) => Some(INT16),
        (ScalarKind::Float, 8) => Some(FLOAT64),
        _ => None,
    }
}
