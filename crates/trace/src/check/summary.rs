//! What is in a trace.

use std::collections::BTreeMap;

use serde::Serialize;

use super::super::command::Command;

/// Counts over a whole trace.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// Commands.
    pub commands: u64,
    /// Commands of each name.
    pub by_name: BTreeMap<&'static str, u64>,
    /// Frames: presents; 1 in a trace without one.
    pub frames: u64,
    /// Width and height of what was last presented.
    pub presented: Option<[u32; 2]>,
    /// Render passes.
    pub render_passes: u64,
    /// Compute passes.
    pub compute_passes: u64,
    /// Draw commands as executed: those of a bundle count each time; an indirect command counts once.
    pub draws: u64,
    /// Dispatch commands.
    pub dispatches: u64,
    /// Vertices or indices times instances of all direct draws.
    pub vertices: u64,
    /// Bytes of all buffers that are created.
    pub buffer_bytes: u64,
    /// Bytes of all textures that are created.
    pub texture_bytes: u64,
    /// Bytes of live buffers and textures at their peak.
    pub peak_bytes: u64,
    /// Bytes that are written from blobs.
    pub written_bytes: u64,
    /// Blobs that are used.
    pub blobs: u64,
    /// Bytes of the blobs that are used.
    pub blob_bytes: u64,
}

/// How often each name came, the common ones at the front: few names make up most of a trace, and a map of strings would be asked for each
/// command.
#[derive(Default)]
pub(super) struct Names(Vec<(&'static str, u64)>);

impl Names {
    #[inline]
    pub(super) fn count(&mut self, command: &Command) {
        let name = command.name();
        // A literal's address tells it apart. Should a compiler keep a text twice, it is counted in two places and added up in the end.
        let Some(at) = self.0.iter().position(|(known, _)| std::ptr::eq(*known, name)) else {
            self.0.push((name, 1));
            return;
        };
        self.0[at].1 += 1;
        if at > 0 && self.0[at - 1].1 < self.0[at].1 {
            self.0.swap(at - 1, at);
        }
    }
}

impl Summary {
    pub(super) fn finish(&mut self, names: Names) {
        for (name, count) in names.0 {
            self.commands += count;
            *self.by_name.entry(name).or_default() += count;
        }
        self.frames = self.commands_named("Present").max(1);
    }

    /// Whether no pass draws, no dispatch computes, and nothing is shown: the trace is one frame without work and without a picture.
    pub fn draws_nothing(&self) -> bool {
        let shows = ["Present", "CopyTextureToBuffer"].iter().any(|name| self.commands_named(name) > 0);
        self.render_passes == 0 && self.dispatches == 0 && !shows
    }

    /// Commands of a name.
    pub fn commands_named(&self, name: &str) -> u64 {
        self.by_name.get(name).copied().unwrap_or(0)
    }
}
