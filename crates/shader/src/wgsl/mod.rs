//! WGSL, rewritten where naga's front end would read it otherwise than the specification says, or would refuse what is valid.
//!
//! * Before naga reads a text: alignments of structures in structures ([`layout`]), `bitcast` to vectors of 16-bit numbers.
//! * Where naga refuses it: what its error asks for ([`mend`], [`fold`]), and naga reads it again. A text that naga takes is never touched.
//! * In naga's form of it: ends of functions that are never reached ([`returns`]), pointers to memory as parameters ([`pointers`]).
//!
//! Errors keep the places of the text as it was given ([`edits`]).

mod edits;
mod fold;
mod layout;
mod mend;
mod pointers;
mod returns;

use naga::front::Typifier;
use naga::proc::ResolveContext;
use naga::{Expression, ScalarKind, TypeInner};
use num::Limits;

pub(crate) use edits::Text;

use crate::module::{PAIRS, ShaderLocation, capabilities, place_of};
use crate::nesting;
use crate::unsupported;
use mend::{Parsed, Problem};

/// Why a text is refused, and where.
pub(crate) type Refusal = (Option<ShaderLocation>, String);

/// How often a text is rewritten because naga refuses it. Each time naga reads it again.
const REWRITINGS: usize = 256;

/// Work that naga may do again because of that, in bytes of source.
const WORK: u64 = 16 << 20;

/// A text as naga has read it.
pub(crate) struct Read {
    pub text: Text,
    /// Whether a call of abstract numbers was made one of concrete numbers.
    pub has_made_concrete: bool,
    /// Bytes and pairs of tokens that naga has gone over.
    pub work: (u64, u64),
}

/// The place of a byte.
pub(crate) fn place(text: &str, at: usize) -> ShaderLocation {
    let at = at.min(text.len()) as u32;
    place_of(naga::Span::new(at, at).location(text))
}

/// An error of naga, as it is shown.
fn shown(error: &naga::front::wgsl::ParseError) -> String {
    let labels: Vec<&str> = error.labels().map(|l| l.1).filter(|l| !l.is_empty()).collect();
    let mut message = error.message().to_owned();
    if message.starts_with("brace nesting limit") {
        message.push_str(": more than 127 blocks inside each other, which WGSL does not have; a part can be a function");
    }
    if message.contains("`wgpu_int16`") {
        message = unsupported::named(unsupported::INT16);
    } else if !labels.is_empty() {
        message = format!("{message} ({})", labels.join("; "));
    }
    message
}

/// What a text is rewritten to before naga reads it.
fn before(text: &str) -> Result<Vec<edits::Edit>, (usize, String)> {
    let mut edits = Vec::new();
    let has_halves = text.contains("bitcast") && (text.contains("f16") || text.contains("vec2h") || text.contains("vec4h"));
    if text.contains("align") || has_halves {
        let parsed = Parsed::new(text);
        edits.extend(layout::attributes(text, &parsed.tokens)?);
        edits.extend(parsed.half_targets());
    }
    Ok(edits)
}

/// What an error of naga asks for.
fn asked(
    read: &Read,
    error: &naga::front::wgsl::ParseError,
    folds: Option<&Limits>,
) -> Result<Option<Vec<edits::Edit>>, String> {
    let parsed = Parsed::new(read.text.as_str());
    let span = error.labels().next().and_then(|(span, _)| span.to_range());
    let label = error.labels().next().map_or("", |(_, label)| label);
    if error.message().starts_with("Not implemented as constant expression") {
        return span.zip(folds).map_or(Ok(None), |(span, limits)| parsed.folded(span, limits));
    }
    let problem = Problem { span: span.clone(), message: error.message(), label };
    if error.message().contains("concrete type") {
        let edits = parsed.edits(&problem);
        let inner = span.and_then(|span| parsed.abstract_call(span)).filter(|_| edits.is_none());
        return inner.zip(folds).map_or(Ok(edits), |(call, limits)| parsed.folded(call, limits));
    }
    let all = format!("{} {}", error.message(), error.labels().map(|label| label.1).collect::<Vec<_>>().join(" "));
    if ["u16", "i16"].into_iter().any(|ty| all.contains(ty)) {
        let found = error.labels().filter_map(|(span, _)| span.to_range()).find_map(|span| parsed.half_source(span));
        return Ok(found);
    }
    Ok(parsed.edits(&problem))
}

/// `bitcast` of a vector of 16-bit numbers to numbers of 32 bits: naga keeps the width of the components.
fn half_sources(module: &naga::Module, text: &str) -> Option<Vec<edits::Edit>> {
    let is_half = |inner: &TypeInner| matches!(*inner, TypeInner::Vector { scalar, .. } if scalar.kind == ScalarKind::Float && scalar.width == 2);
    if !text.contains("bitcast") || !module.types.iter().any(|(_, ty)| is_half(&ty.inner)) {
        return None;
    }
    let parsed = Parsed::new(text);
    let functions = module.functions.iter().map(|(_, function)| function);
    for function in functions.chain(module.entry_points.iter().map(|entry| &entry.function)) {
        let types = types_of(module, &module.functions, function).ok()?;
        for (handle, expression) in function.expressions.iter() {
            let Expression::As { expr, kind, convert: None } = *expression else { continue };
            if !is_half(types[expr].inner_with(&module.types)) {
                continue;
            }
            let Some(span) = function.expressions.get_span(handle).to_range() else { continue };
            let target = text.get(span.clone()).unwrap_or("");
            let to_half = kind == ScalarKind::Float && (target.contains("f16") || target.contains("h>"));
            if let Some(edits) = parsed.half_source(span).filter(|_| !to_half) {
                return Some(edits);
            }
        }
    }
    None
}

/// The types of the expressions of a function.
fn types_of(
    module: &naga::Module,
    functions: &naga::Arena<naga::Function>,
    function: &naga::Function,
) -> Result<Typifier, (naga::Span, String)> {
    let context = ResolveContext {
        constants: &module.constants,
        overrides: &module.overrides,
        types: &module.types,
        special_types: &module.special_types,
        global_vars: &module.global_variables,
        local_vars: &function.local_variables,
        functions,
        arguments: &function.arguments,
    };
    let mut types = Typifier::new();
    for (handle, _) in function.expressions.iter() {
        types
            .grow(handle, &function.expressions, &context)
            .map_err(|error| (function.expressions.get_span(handle), crate::module::chain(&error)))?;
    }
    Ok(types)
}

/// Reads a text.
///
/// # Errors
/// If it is larger than the limits allow, or naga refuses it and nothing here can change that.
pub(crate) fn parse(text: &str, limits: &Limits) -> Result<(naga::Module, Read), Refusal> {
    read(text, limits, true)
}

/// As [`parse`]. `folds`: whether constants are computed, which needs a text of its own to be read.
pub(crate) fn read(text: &str, limits: &Limits, folds: bool) -> Result<(naga::Module, Read), Refusal> {
    let extent = nesting::check(text, limits).map_err(|(place, message)| (Some(place), message))?;
    let mut read = Read { text: Text::new(text), has_made_concrete: false, work: (0, 0) };
    let edits = before(text).map_err(|(at, message)| (Some(place(text, at)), message))?;
    if !edits.is_empty() {
        read.text.apply(edits);
    }
    let of_span = |read: &Read, span: naga::Span| span.to_range().map(|range| place(text, read.text.origin(range.start)));
    let mut turns = 0;
    let mut module = loop {
        let options = naga::front::wgsl::Options { parse_doc_comments: false, capabilities: capabilities() };
        let parsed = naga::front::wgsl::Frontend::new_with_options(options).parse(read.text.as_str());
        read.work = (read.work.0 + text.len() as u64, read.work.1.saturating_add(extent.pairs));
        turns += 1;
        let may_rewrite = turns <= REWRITINGS && (turns == 1 || read.work.0.saturating_add(read.work.1 / PAIRS) <= WORK);
        match parsed {
            Ok(module) => match half_sources(&module, read.text.as_str()) {
                Some(edits) if may_rewrite => read.text.apply(edits),
                _ => break module,
            },
            Err(error) => {
                // The only error that names no place.
                if error.labels().next().is_none() && error.emit_to_string("").contains("recursion limit") {
                    let message = "brackets, templates and blocks inside each other go deeper than naga's parser can follow, which is \
                                   200 levels and fixed; give parts of it names of their own";
                    return Err((Some(extent.deepest), message.to_owned()));
                }
                let at = error.labels().next().and_then(|(span, _)| of_span(&read, span));
                let edits = if may_rewrite {
                    asked(&read, &error, folds.then_some(limits)).map_err(|message| (at, message))?
                } else {
                    None
                };
                let Some(edits) = edits else { return Err((at, shown(&error))) };
                read.has_made_concrete |= error.message().contains("concrete type");
                read.text.apply(edits);
            }
        }
    };
    let refuse = |(span, message)| (of_span(&read, span), message);
    returns::tidy(&mut module).map_err(refuse)?;
    pointers::specialise(&mut module).map_err(refuse)?;
    Ok((module, read))
}
