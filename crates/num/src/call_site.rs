//! Where a command comes from.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Where a command was made, as the tools of its recording count.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum CallSite {
    /// Number of a call in a recording of OpenGL, from 0, as apitrace and GLInterceptor count.
    Call(u64),
    /// Line of the text of a wgpu trace, from 1.
    Line(u64),
    /// Index of a block in a capture of GFXReconstruct, from 0.
    Block(u64),
    /// Number of a command in a native trace, from 0.
    Command(u64),
}

impl CallSite {
    /// The kind of number, and the number.
    pub fn parts(self) -> (&'static str, u64) {
        match self {
            CallSite::Call(number) => ("call", number),
            CallSite::Line(number) => ("line", number),
            CallSite::Block(number) => ("block", number),
            CallSite::Command(number) => ("command", number),
        }
    }
}

impl fmt::Display for CallSite {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (kind, number) = self.parts();
        write!(f, "{kind} {number}")
    }
}
