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

impl Summary {
    pub(super) fn count(&mut self, command: &Command) {
        self.commands += 1;
        *self.by_name.entry(command.name()).or_default() += 1;
    }

    pub(super) fn finish(&mut self) {
        self.frames = self.commands_named("Present").max(1);
    }

    /// Commands of a name.
    pub fn commands_named(&self, name: &str) -> u64 {
        self.by_name.get(name).copied().unwrap_or(0)
    }
}
