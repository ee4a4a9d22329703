//! Payload of a trace: files beside it, which are used in place, and bytes in its text.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use trace::command::Data;
use trace::{Builder, Reading, check_name};

use super::objects::Reason;
use super::schema;

/// Turns the payload of actions into blobs of a trace.
pub struct Blobs {
    folder: PathBuf,
    reading: Reading,
    /// Bytes of the trace so far, including its text.
    bytes: u64,
    /// Sizes of the files that already are blobs.
    sizes: HashMap<String, u64>,
    /// Number of blobs made from bytes inside the text.
    inline: u32,
}

impl Blobs {
    /// Blobs of a trace in this folder. `text` is the size of its text in bytes.
    pub fn new(folder: &Path, reading: &Reading, text: u64) -> Blobs {
        Blobs { folder: folder.to_path_buf(), reading: *reading, bytes: text, sizes: HashMap::new(), inline: 0 }
    }

    /// Makes a blob of a payload. Returns its name and size.
    pub fn add(&mut self, builder: &mut Builder, data: schema::Data) -> Result<(String, u64), Reason> {
        match data {
            schema::Data::File(name) => {
                if let Some(&size) = self.sizes.get(&name) {
                    return Ok((name, size));
                }
                // The name must not lead out of the folder.
                check_name(&name).map_err(Reason::Damaged)?;
                let path = self.folder.join(&name);
                let fail = |reason| Reason::Data(format!("data file {}: {reason}", host::path_line(&path)));
                let size = builder.add_linked_file(&name, &path, self.reading.links()).map_err(|error| fail(error.reason))?;
                self.bytes = self.bytes.saturating_add(size);
                let limits = self.reading.limits;
                let beyond =
                    |error: num::LimitExceeded| Reason::Damaged(format!("data file {}: {error}", host::path_line(&path)));
                limits.trace_bytes.check(self.bytes).map_err(beyond)?;
                self.sizes.insert(name.clone(), size);
                limits.trace_files.check(self.sizes.len() as u64).map_err(beyond)?;
                Ok((name, size))
            }
            schema::Data::String(kind, text) => self.add_inline(builder, kind, text.into_bytes()),
            schema::Data::Binary(kind, bytes) => self.add_inline(builder, kind, bytes),
        }
    }

    fn add_inline(&mut self, builder: &mut Builder, kind: schema::DataKind, bytes: Vec<u8>) -> Result<(String, u64), Reason> {
        let extension = match kind {
            schema::DataKind::Wgsl => "wgsl",
            schema::DataKind::Ron => "ron",
            schema::DataKind::Spv => "spv",
            _ => "bin",
        };
        let name = format!("inline{}.{extension}", self.inline);
        self.inline += 1;
        let size = bytes.len() as u64;
        builder.add_blob(&name, bytes).map_err(|error| Reason::Damaged(error.reason))?;
        Ok((name, size))
    }

    /// Makes a blob of a payload. Returns its first `size` bytes: the file of a recorder may be longer than what was written.
    pub fn add_prefix(&mut self, builder: &mut Builder, data: schema::Data, size: u64) -> Result<Data, Reason> {
        let (blob, length) = self.add(builder, data)?;
        if length < size {
            return Err(Reason::Data(format!("data {blob:?} has {length} bytes, {size} are needed")));
        }
        Ok(Data { blob, offset: 0, size })
    }
}
