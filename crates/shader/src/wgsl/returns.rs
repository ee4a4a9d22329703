//! Ends of functions that are never reached.
//!
//! naga puts a `return` without a value wherever a function's text ends without one, also after a loop that only `return` leaves. Its
//! validation then finds a `return` that does not fit. Whether the end is reached is WGSL's behaviour analysis: what can be is an error of
//! the text, and what cannot is taken out.

use naga::{Block, Function, Module, Span, Statement};

/// Takes out what naga has put in where it is never reached.
///
/// # Errors
/// If the end of a function with a result is reached.
pub(super) fn tidy(module: &mut Module) -> Result<(), (Span, String)> {
    let functions = module.functions.iter_mut().map(|(_, function)| (function.name.clone(), function));
    let entries = module.entry_points.iter_mut().map(|entry| (Some(entry.name.clone()), &mut entry.function));
    let mut lacking = None;
    for (name, function) in functions.chain(entries) {
        if function.result.is_some() && end_is_reached(function) {
            lacking = Some((name.unwrap_or_default(), last_span(&function.body)));
            break;
        }
    }
    let Some((name, span)) = lacking else { return Ok(()) };
    let message = format!(
        "function `{}` has a result, but its end is reached without `return`: each way through it must end with a `return` and a value",
        host::one_line(&name)
    );
    Err((span, message))
}

/// The span of the last statement that the text has.
fn last_span(block: &Block) -> Span {
    block.span_iter().map(|(_, span)| *span).filter(Span::is_defined).last().unwrap_or(Span::UNDEFINED)
}

/// Whether the end of a function is reached. Takes out the ends that are not.
fn end_is_reached(function: &mut Function) -> bool {
    let mut reached = false;
    let falls = goes_on(&mut function.body, &mut reached);
    falls || reached
}

/// Whether what comes after a block is reached. `reached`: whether an end that naga has put in is.
fn goes_on(block: &mut Block, reached: &mut bool) -> bool {
    let mut live = true;
    let mut ends = Vec::new();
    for (n, (statement, span)) in block.span_iter_mut().enumerate() {
        let own = span.is_none_or(|span| !span.is_defined());
        live &= match statement {
            Statement::Return { value: None } if own => {
                *reached |= live;
                if !live {
                    ends.push(n);
                }
                false
            }
            Statement::Return { .. } | Statement::Kill | Statement::Break | Statement::Continue => false,
            Statement::Block(inner) => goes_on(inner, reached),
            Statement::If { accept, reject, .. } => {
                let accepted = goes_on(accept, reached);
                goes_on(reject, reached) || accepted
            }
            Statement::Switch { cases, .. } => {
                let mut on = false;
                for case in cases {
                    // A case without statements leads to the next one.
                    on |= goes_on(&mut case.body, reached) && !case.fall_through || breaks(&case.body);
                }
                on
            }
            Statement::Loop { body, continuing, break_if } => {
                // Their ends begin the next turn.
                goes_on(body, reached);
                goes_on(continuing, reached);
                break_if.is_some() || breaks(body)
            }
            _ => true,
        };
    }
    for n in ends.into_iter().rev() {
        block.cull(n..=n);
    }
    live
}

/// Whether a block has a `break` that leaves what is around it.
fn breaks(block: &Block) -> bool {
    block.iter().any(|statement| match statement {
        Statement::Break => true,
        Statement::Block(inner) => breaks(inner),
        Statement::If { accept, reject, .. } => breaks(accept) || breaks(reject),
        _ => false,
    })
}
