//! Import of wgpu 30 API traces: a folder with `trace.ron`, one list of actions, and the files that it names.
//!
//! The text is mapped and read action by action ([`reader`]), each action translated at once ([`translate`]); files of the trace
//! become blobs in place. What an importer of this format must know:
//!
//! * Objects are named by address, and addresses are used again. An address names the object that was created last at it.
//! * A drop may come before the submit that uses the object, so a drop does not destroy it. Dropped objects are destroyed after
//!   their last use ([`lifetime`]), which bounds the memory of long traces.
//! * File order is execution order.
//! * Actions that never ran (`FailedCommands`, the creation of invalid textures) are skipped. It is an error to use such an object.
//!
//! These features are not supported and refused by name, with the place in the file: ray tracing, external textures, mesh pipelines,
//! multiview, conservative rasterisation, and texture formats that Fillrate does not have.

mod blob;
mod copy;
mod lifetime;
mod objects;
mod pass;
mod pipeline;
mod reader;
mod resource;
mod translate;

use std::path::Path;

use host::Links;
use trace::{Reading, Trace, TraceError, read_commands_file};

pub(super) use reader::trivia;

/// Opens the wgpu trace whose `trace.ron` this is.
pub fn open(file: &Path) -> Result<Trace, TraceError> {
    open_with(file, &Reading::default())
}

/// As [`open`], with limits and rules for its files other than the default ones.
pub fn open_with(file: &Path, reading: &Reading) -> Result<Trace, TraceError> {
    open_linked(file, Links::Follow, reading)
}

/// As [`open_with`]; `links` says whether `file` may be a symbolic link.
pub(super) fn open_linked(file: &Path, links: Links, reading: &Reading) -> Result<Trace, TraceError> {
    import_with(file, &read_commands_file(file, links, &reading.limits)?, reading)
}

/// Imports a trace from its text; the files that it names lie beside `file`.
pub fn import(file: &Path, text: &[u8]) -> Result<Trace, TraceError> {
    import_with(file, text, &Reading::default())
}

fn import_with(file: &Path, text: &[u8], reading: &Reading) -> Result<Trace, TraceError> {
    let mut reader = reader::Reader::new(file, text)?;
    let mut translator = translate::Translator::new(file, reading, text.len() as u64);
    while let Some(step) = reader.step()? {
        translator.action(step.place, step.action).map_err(|reason| {
            let reason = format!("action {} ({}): {reason}", step.number, step.name);
            TraceError::new(file, reason).at(Some(step.place))
        })?;
    }
    Ok(translator.finish()?.with_limits(reading.limits))
}
