//! Traces as zip archives: stored entries are used where they lie, deflated ones are inflated at first use.

use std::io::{Cursor, Read};
use std::path::Path;

use zip::result::ZipError;
use zip::{CompressionMethod, ZipArchive};

use super::COMMANDS_FILE;
use super::archive_end as end;
use super::error::TraceError;
use super::pieces::CommandSource;
use super::store::{Bytes, Store};
use super::text::FileEntry;
use num::Limits;

/// An open archive; clones share its directory.
pub(super) type Archive = ZipArchive<Cursor<Bytes>>;

/// The largest number of bytes that one deflated byte can become.
const DEFLATE_MAX: u64 = 1032;

/// A trace's archive and the folder in it that holds the trace ("" or "NAME/").
pub(super) struct Package {
    bytes: Bytes,
    archive: Archive,
    folder: String,
}

impl Package {
    /// Opens an archive; the command list is at its root or in its only folder.
    pub fn open(path: &Path, bytes: Bytes, limits: &Limits) -> Result<Package, TraceError> {
        let fail = |reason: String| TraceError::new(path, reason);
        let no_archive = |error: ZipError| fail(format!("not a zip archive, or cut off before its end: {error}"));
        limits.trace_bytes.check(bytes.len() as u64).map_err(|error| TraceError::new(path, error))?;
        let entries = end::most_entries(&bytes).map_err(|reason| fail(reason.to_owned()))?;
        limits.trace_files.check(entries).map_err(|error| TraceError::new(path, error))?;
        let mut archive = ZipArchive::new(Cursor::new(bytes.clone())).map_err(no_archive)?;
        if archive.has_duplicate_names() {
            return Err(fail("the archive has two entries of one name: which is meant is not clear".to_owned()));
        }
        if archive.has_overlapping_files().map_err(no_archive)? {
            return Err(fail("entries of the archive overlap: the same bytes would be inflated several times".to_owned()));
        }
        let mut expanded = 0_u64;
        for index in 0..archive.len() {
            // An entry that is damaged, or that says more than it can become, is refused where it is used.
            let becomes = archive
                .by_index_raw(index)
                .map_or(0, |entry| entry.size().min(entry.compressed_size().saturating_mul(DEFLATE_MAX)));
            expanded = expanded.saturating_add(becomes);
        }
        limits.check_expansion(bytes.len() as u64, expanded).map_err(|error| TraceError::new(path, error))?;
        let mut folder = None;
        for name in archive.file_names() {
            let name =
                name.map_err(|error| TraceError::new(path, format!("the archive has an entry with a bad name: {error}")))?;
            let Some(prefix) = name.strip_suffix(COMMANDS_FILE) else { continue };
            let outermost = prefix.is_empty() || prefix.find('/') == Some(prefix.len() - 1);
            if outermost && folder.replace(prefix.to_owned()).is_some() {
                return Err(TraceError::new(path, format!("the archive holds more than one {COMMANDS_FILE}")));
            }
        }
        let missing =
            || TraceError::new(path, format!("the archive holds no {COMMANDS_FILE} at its root or in a folder there"));
        let folder = folder.ok_or_else(missing)?;
        Ok(Package { bytes, archive, folder })
    }

    /// Where the command list lies, and its length; `mapped` is what the archive was mapped from, if that is a file.
    pub fn commands_source(
        &mut self,
        path: &Path,
        mapped: Option<&Path>,
        limits: &Limits,
    ) -> Result<(CommandSource, u64), TraceError> {
        let ArchiveEntry { size, packed, stored, crc, .. } = self.entry(path, COMMANDS_FILE)?;
        limits
            .trace_bytes
            .check(size)
            .map_err(|error| TraceError::new(path, format!("{COMMANDS_FILE} in the archive: {error}")))?;
        let (file, archive) = (mapped.map(Path::to_owned), self.bytes.clone());
        Ok((CommandSource::Entry { file, archive, packed, deflated: stored.is_none(), crc }, size))
    }

    /// The command list, with its checksum verified.
    pub fn commands(&mut self, path: &Path) -> Result<Bytes, TraceError> {
        let entry = self.entry(path, COMMANDS_FILE)?;
        if let Some(bytes) = entry.stored {
            let mut reader = self.archive.by_index(entry.index).map_err(|error| TraceError::new(path, error))?;
            std::io::copy(&mut reader, &mut std::io::sink())
                .map_err(|error| TraceError::new(path, format!("{COMMANDS_FILE} is damaged: {error}")))?;
            return Ok(bytes);
        }
        inflate(&self.archive, entry.index, entry.size)
            .map(Bytes::from)
            .map_err(|reason| TraceError::new(path, format!("{COMMANDS_FILE} {reason}")))
    }

    /// Adds a blob of the trace to its store.
    pub fn add(&mut self, path: &Path, store: &mut Store, name: &str, file: &FileEntry) -> Result<(), TraceError> {
        let entry = self.entry(path, name)?;
        if entry.size != file.size {
            let reason = format!("blob {name:?} is {} bytes long, the trace says {}", entry.size, file.size);
            return Err(TraceError::new(path, reason));
        }
        match entry.stored {
            Some(bytes) => store.add_bytes(name, bytes, Some(file.hash)),
            None => store.add_entry(name, self.archive.clone(), entry.index, entry.size, Some(file.hash)),
        }
        .map_err(|reason| TraceError::new(path, reason))
    }

    fn entry(&mut self, path: &Path, name: &str) -> Result<ArchiveEntry, TraceError> {
        let full = format!("{}{name}", self.folder);
        let missing = || TraceError::new(path, format!("the archive holds no {full}"));
        let index = self.archive.index_for_name(&full).ok_or_else(missing)?;
        let file = self
            .archive
            .by_index_raw(index)
            .map_err(|error| TraceError::new(path, format!("{full} in the archive is damaged: {error}")))?;
        let (size, packed, crc) = (file.size(), file.compressed_size(), file.crc32());
        let start = file.data_start().and_then(|start| usize::try_from(start).ok());
        if file.encrypted() {
            return Err(TraceError::new(path, format!("{full} in the archive is encrypted")));
        }
        let stored = match file.compression() {
            CompressionMethod::Stored => {
                let length = usize::try_from(packed).ok().filter(|_| packed == size);
                let bytes = start.zip(length).and_then(|(start, length)| self.bytes.slice(start, length));
                let outside = || TraceError::new(path, format!("{full} in the archive reaches outside of it"));
                Some(bytes.ok_or_else(outside)?)
            }
            CompressionMethod::Deflated if size / DEFLATE_MAX > packed => {
                let reason = format!("its header says {size} bytes, more than its {packed} deflated bytes can become");
                return Err(TraceError::new(path, format!("{full} in the archive is damaged: {reason}")));
            }
            CompressionMethod::Deflated => None,
            other => {
                return Err(TraceError::new(
                    path,
                    format!("{full} in the archive is packed with {other}: only deflate is read"),
                ));
            }
        };
        let outside = || TraceError::new(path, format!("{full} in the archive reaches outside of it"));
        let packed = start.zip(usize::try_from(packed).ok()).ok_or_else(outside)?;
        Ok(ArchiveEntry { index, size, stored, crc, packed })
    }
}

struct ArchiveEntry {
    index: usize,
    size: u64,
    /// The bytes, if they lie in the archive as they are.
    stored: Option<Bytes>,
    /// Its checksum.
    crc: u32,
    /// Where it begins in the archive, and how many bytes it has there.
    packed: (usize, usize),
}

/// Inflates an entry to the size that it states.
pub(super) fn inflate(archive: &Archive, index: usize, size: u64) -> Result<Vec<u8>, String> {
    let mut archive = archive.clone();
    let file = archive.by_index(index).map_err(|error| format!("cannot be inflated: {error}"))?;
    let mut bytes = Vec::new();
    let room = usize::try_from(size).ok().and_then(|size| bytes.try_reserve_exact(size.saturating_add(1)).ok());
    room.ok_or_else(|| format!("becomes {size} bytes: there is not enough memory"))?;
    // One byte beyond the stated size tells a longer stream from a complete one.
    file.take(size.saturating_add(1)).read_to_end(&mut bytes).map_err(|error| format!("cannot be inflated: {error}"))?;
    if bytes.len() as u64 != size {
        return Err(format!("inflates to {} bytes, its header says {size}", bytes.len()));
    }
    Ok(bytes)
}
