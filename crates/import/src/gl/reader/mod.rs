//! Readers of recordings: each returns one call after another.

pub mod apitrace;
pub mod chunks;
pub mod gli;

use crate::gl::call::Call;
use crate::gl::reader::apitrace::Apitrace;
use crate::gl::reader::chunks::ReadError;
use crate::gl::reader::gli::GliText;

/// A recording that is being read.
pub enum Reader {
    /// apitrace's container.
    Apitrace(Box<Apitrace>),
    /// GLInterceptor's text.
    Gli(Box<GliText>),
}

impl Reader {
    /// The next call; none at the end of the recording.
    pub fn next(&mut self) -> Result<Option<Call>, ReadError> {
        match self {
            Reader::Apitrace(reader) => reader.next(),
            Reader::Gli(reader) => reader.next(),
        }
    }

    /// Takes back a call that has been run.
    pub fn done(&mut self, call: Call) {
        if let Reader::Apitrace(reader) = self {
            reader.done(call);
        }
    }

    /// How the recording's end is cut, if it has been read to there. The program crashed or was killed: the calls before are whole.
    pub fn cut(&self) -> Option<&ReadError> {
        match self {
            Reader::Apitrace(reader) => reader.cut.as_ref(),
            Reader::Gli(reader) => reader.cut.as_ref(),
        }
    }

    /// The window's size, if the recording has stated it so far.
    pub fn window(&self) -> Option<[u32; 2]> {
        match self {
            Reader::Apitrace(_) => None,
            Reader::Gli(reader) => reader.window,
        }
    }
}
