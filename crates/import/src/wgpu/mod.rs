//! Import of wgpu 30 API traces: a folder with `trace.ron`, one list of actions, and the files that it names.
//!
//! The text is mapped and read action by action ([`reader`], [`schema`]), each action translated at once ([`translate`]); files of the trace
//! become blobs in place. What an importer of this format must know:
//!
//! * Objects are named by address, and addresses are used again. An address names the object that was created last at it.
//! * A drop may come before the submit that uses the object, so a drop does not destroy it. Dropped objects are destroyed after
//!   their last use ([`lifetime`]), which bounds the memory of long traces.
//! * File order is execution order.
//! * Actions that wgpu refused stand in the file like others. What they should have made is invalid ([`objects`]), and writes that it refused
//!   do nothing ([`refuse`]). `FailedCommands` never ran, nor did the other command buffers of a submission that they failed in.
//! * A recording of a program that was killed has no end. What is whole of it is the trace.
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
mod refuse;
mod resource;
pub mod schema;
mod translate;

use std::path::Path;

use host::Links;
use trace::{Reading, TextLocation, Trace, TraceError, read_commands_file};

use reader::{Cut, Step};
use translate::Stop;

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
    let mut next = reader.step()?;
    let mut lost = None;
    while let Some(Step { number, name, place, action, lines }) = next {
        // The file of data that the last action names may be cut as the text is.
        let following = reader.step();
        let last = matches!(following, Ok(None)) && reader.cut().is_some();
        match translator.step((number, name, place), action, lines) {
            Ok(()) => {}
            Err(Stop { error, data: true }) if last => lost = Some(error.reason),
            Err(Stop { error, .. }) => return Err(error),
        }
        next = following?;
    }
    let cut = reader.cut().map(|cut| cut_warning(cut, lost.as_deref()));
    Ok(translator.finish(cut)?.with_limits(reading.limits))
}

/// What is said of a recording that has no end.
fn cut_warning(cut: &Cut, lost: Option<&str>) -> String {
    let TextLocation { line, column } = cut.place;
    let part = match (&cut.half, lost) {
        (Some(name), None) => format!(" and inside action {} ({name}), which is left out", cut.number),
        (Some(name), Some(lost)) => format!(" and inside action {} ({name}); left out are this and {lost}", cut.number),
        (None, Some(lost)) => format!("; left out is {lost}"),
        (None, None) => String::new(),
    };
    format!(
        "{line}:{column}: the recording ends after {} actions without the closing `]`{part}: its program was killed, or left before it dropped \
         the device. What is whole is replayed; nothing of a frame that was not presented is shown",
        cut.number
    )
}
