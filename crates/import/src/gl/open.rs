//! Opens recordings in files.

use std::ops::Range;
use std::path::Path;

use host::Links;
use trace::{Reading, Trace, TraceError};

use crate::gl::background;
use crate::gl::recording::{Delivery, Recording, described};
use crate::report::{Report, Survey};

/// Opens a recording of apitrace or GLInterceptor, with the wanted frames. The recording is read up to the last of them. Of earlier frames,
/// only results that later frames can read are kept. The commands of a long recording are generated again at each reading
/// (`reading.in_memory`). A recording that has not been read to its end has no report: an unsupported feature then ends its commands with
/// an error (`TraceError::unsupported`), or is [left out](trace::Origin::left_out) if `reading.lenient` is set.
///
/// # Errors
/// If it is damaged, or asks for more than a limit allows; with the number of the call and its place.
pub fn open(
    path: &Path,
    apitrace: bool,
    links: Links,
    reading: &Reading,
    frames: Range<u64>,
    survey: Survey,
) -> Result<(Trace, Option<Report>), TraceError> {
    let recording = Recording::new(path, apitrace, links, reading, frames);
    let most = recording.in_memory();
    // What a long file has for its commands is longer as well: none of them would stay, and all would be read twice.
    let long = || host::open(path, links).and_then(|file| file.metadata()).is_ok_and(|file| file.len() > most);
    if survey == Survey::Start && long() {
        return Ok((Trace::from_stream(path, Box::new(recording), reading.limits), None));
    }
    if survey == Survey::Start {
        return background::open(recording, most);
    }
    let (trace, report) = recording.import(Delivery::All { most, survey, longer: None })?;
    let trace = trace.unwrap_or_else(|| Trace::from_stream(path, Box::new(recording), reading.limits));
    Ok((described(trace, report.as_ref()), report))
}
