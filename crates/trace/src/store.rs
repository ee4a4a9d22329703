//! The payload of a trace: named pieces of bytes, each in a file, in an archive or in memory, loaded at first use and checked once.

use std::collections::BTreeMap;
use std::io::{self, Read};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use memmap2::Mmap;

use super::archive::{self, Archive};
use super::error::TraceError;
use host::Links;

/// Files up to this many bytes are read, larger ones are mapped: a page table entry costs more than copying a few pages, and
/// the kernel bounds the number of mappings of a process.
const MAP_FROM: u64 = 16 << 10;

/// Bytes of a name at most.
pub const NAME_MAX: usize = 128;

/// Shared read-only bytes: in memory, or a range of a mapped file.
#[derive(Clone)]
pub struct Bytes(Repr);

#[derive(Clone)]
enum Repr {
    Owned { bytes: Arc<Vec<u8>>, start: usize, end: usize },
    Mapped { map: Arc<Mmap>, start: usize, end: usize },
}

impl Bytes {
    /// The contents of a regular file: mapped, unless small. The file must not change while the trace is in use. The path is the
    /// user's own: it may be a symbolic link.
    ///
    /// # Errors
    /// If it is not there, cannot be read, or is no regular file.
    pub fn from_file(path: &Path) -> io::Result<Bytes> {
        Bytes::read(path, Links::Follow)
    }

    /// As [`Bytes::from_file`], with a rule for symbolic links.
    pub(crate) fn read(path: &Path, links: Links) -> io::Result<Bytes> {
        let file = host::open(path, links)?;
        let length = file.metadata()?.len();
        if length == 0 {
            // Files that are made up by the system say so, and reading some of them waits.
            return Ok(Vec::new().into());
        }
        if length < MAP_FROM {
            let mut bytes = Vec::with_capacity(length as usize);
            file.take(length).read_to_end(&mut bytes)?;
            if bytes.len() as u64 != length {
                return Err(io::Error::other("became shorter while it was read"));
            }
            return Ok(bytes.into());
        }
        // SAFETY: the mapping is private to this process and read-only, and every access goes through a shared slice. What is
        // left is that another process truncates or rewrites the file meanwhile, which no reader of mapped files can rule out;
        // the documentation of `Trace` makes it the caller's duty. Gain: 100 MB of blobs are ready at once and not copied.
        #[allow(unsafe_code, reason = "a file that is mapped may change")]
        let map = unsafe { Mmap::map(&file)? };
        let end = map.len();
        Ok(Bytes(Repr::Mapped { map: Arc::new(map), start: 0, end }))
    }

    /// A part of these bytes that shares their memory, or none if the range reaches outside.
    pub fn slice(&self, start: usize, length: usize) -> Option<Bytes> {
        self.get(start..start.checked_add(length)?)?;
        Some(match &self.0 {
            Repr::Owned { bytes, start: base, .. } => {
                Bytes(Repr::Owned { bytes: bytes.clone(), start: base + start, end: base + start + length })
            }
            Repr::Mapped { map, start: base, .. } => {
                Bytes(Repr::Mapped { map: map.clone(), start: base + start, end: base + start + length })
            }
        })
    }

    /// Whether the bytes are those of a mapped file.
    pub fn is_mapped(&self) -> bool {
        matches!(self.0, Repr::Mapped { .. })
    }
}

impl PartialEq for Bytes {
    fn eq(&self, other: &Bytes) -> bool {
        **self == **other
    }
}

impl std::fmt::Debug for Bytes {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        (**self).fmt(f)
    }
}

impl From<Vec<u8>> for Bytes {
    fn from(bytes: Vec<u8>) -> Bytes {
        let end = bytes.len();
        Bytes(Repr::Owned { bytes: Arc::new(bytes), start: 0, end })
    }
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match &self.0 {
            Repr::Owned { bytes, start, end } => &bytes[*start..*end],
            Repr::Mapped { map, start, end } => &map[*start..*end],
        }
    }
}

impl AsRef<[u8]> for Bytes {
    fn as_ref(&self) -> &[u8] {
        self
    }
}

/// Where the bytes of a blob come from.
enum BlobSource {
    /// They are here.
    Ready(Bytes),
    /// A file, opened at first use.
    File(PathBuf, Links),
    /// An entry of an archive, inflated at first use.
    Entry(Archive, usize),
}

/// One blob.
pub(super) struct Blob {
    source: BlobSource,
    size: u64,
    /// What the trace says of its contents; none for blobs that never were in a native trace.
    expected: Option<blake3::Hash>,
    loaded: OnceLock<Result<Bytes, String>>,
}

impl Blob {
    fn new(source: BlobSource, size: u64, expected: Option<blake3::Hash>) -> Blob {
        Blob { source, size, expected, loaded: OnceLock::new() }
    }

    fn load(&self) -> Result<Bytes, String> {
        let bytes = match &self.source {
            BlobSource::Ready(bytes) => bytes.clone(),
            BlobSource::File(path, links) => Bytes::read(path, *links).map_err(|error| error.to_string())?,
            BlobSource::Entry(archive, index) => archive::inflate(archive, *index, self.size)?.into(),
        };
        if bytes.len() as u64 != self.size {
            return Err(format!("is {} bytes long, the trace says {}", bytes.len(), self.size));
        }
        if let Some(expected) = self.expected {
            let hash = blake3::hash(&bytes);
            if hash != expected {
                return Err(format!("contents have hash {}, the trace says {}: damaged", hash.to_hex(), expected.to_hex()));
            }
        }
        Ok(bytes)
    }
}

/// Named blobs.
#[derive(Default)]
pub(super) struct Store {
    blobs: BTreeMap<String, Blob>,
    /// Blobs of parts of a stream that are read at present, and how many readers have each.
    passing: Mutex<BTreeMap<String, (Bytes, usize)>>,
}

impl Store {
    /// Adds bytes.
    pub fn add_bytes(&mut self, name: &str, bytes: Bytes, expected: Option<blake3::Hash>) -> Result<(), String> {
        let size = bytes.len() as u64;
        self.add(name, Blob::new(BlobSource::Ready(bytes), size, expected))
    }

    /// Adds a file that is there and has this size.
    pub fn add_file(
        &mut self,
        name: &str,
        path: PathBuf,
        links: Links,
        size: u64,
        expected: Option<blake3::Hash>,
    ) -> Result<(), String> {
        self.add(name, Blob::new(BlobSource::File(path, links), size, expected))
    }

    /// Adds an entry of an archive that becomes this many bytes.
    pub fn add_entry(
        &mut self,
        name: &str,
        archive: Archive,
        index: usize,
        size: u64,
        expected: Option<blake3::Hash>,
    ) -> Result<(), String> {
        self.add(name, Blob::new(BlobSource::Entry(archive, index), size, expected))
    }

    fn add(&mut self, name: &str, blob: Blob) -> Result<(), String> {
        check_name(name)?;
        match self.blobs.entry(name.to_owned()) {
            std::collections::btree_map::Entry::Occupied(_) => Err(format!("blob {name:?} is given twice")),
            std::collections::btree_map::Entry::Vacant(place) => {
                place.insert(blob);
                Ok(())
            }
        }
    }

    /// Whether there is a blob of this name.
    pub fn contains(&self, name: &str) -> bool {
        self.blobs.contains_key(name)
    }

    /// Size of a blob, without loading it.
    pub fn size(&self, name: &str) -> Option<u64> {
        let passing = || self.passing().get(name).map(|(bytes, _)| bytes.len() as u64);
        self.blobs.get(name).map(|blob| blob.size).or_else(passing)
    }

    /// The blobs that are in memory.
    pub fn take_ready(&mut self) -> Vec<(String, Bytes)> {
        let ready = |(name, blob): (String, Blob)| match blob.source {
            BlobSource::Ready(bytes) => Some((name, bytes)),
            BlobSource::File(..) | BlobSource::Entry(..) => None,
        };
        std::mem::take(&mut self.blobs).into_iter().filter_map(ready).collect()
    }

    /// Names, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.blobs.keys().map(String::as_str)
    }

    fn passing(&self) -> std::sync::MutexGuard<'_, BTreeMap<String, (Bytes, usize)>> {
        // Each change is one step, so what a reader that has failed leaves is whole.
        self.passing.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Holds the blobs of a part while `read` runs.
    pub fn with<T>(&self, blobs: Vec<(String, Bytes)>, read: impl FnOnce() -> T) -> T {
        let names: Vec<String> = blobs.iter().map(|(name, _)| name.clone()).collect();
        for (name, bytes) in blobs {
            self.passing().entry(name).or_insert((bytes, 0)).1 += 1;
        }
        let result = read();
        let mut passing = self.passing();
        for name in names {
            if let Some((_, readers)) = passing.get_mut(&name) {
                *readers -= 1;
                if *readers == 0 {
                    passing.remove(&name);
                }
            }
        }
        result
    }

    /// The bytes of a blob; the first call loads and checks them.
    pub fn get(&self, home: &Path, name: &str) -> Result<Bytes, TraceError> {
        let Some(blob) = self.blobs.get(name) else {
            let passing = self.passing().get(name).map(|(bytes, _)| bytes.clone());
            return passing.ok_or_else(|| TraceError::new(home, format!("there is no blob {name:?}")));
        };
        blob.loaded.get_or_init(|| blob.load()).clone().map_err(|reason| match &blob.source {
            BlobSource::File(path, _) => TraceError::new(path, reason),
            _ => TraceError::new(home, format!("blob {name:?} {reason}")),
        })
    }
}

/// Checks a blob's name: a plain file name that means the same on every file system.
pub fn check_name(name: &str) -> Result<(), String> {
    let plain = |c: char| c.is_ascii_alphanumeric() || matches!(c, '.' | '_' | '-');
    let reason = if name.is_empty() || name.len() > NAME_MAX {
        "must have 1 to 128 characters"
    } else if name.starts_with('.') || name.contains("..") {
        "must not start with a dot or contain two in a row"
    } else if !name.chars().all(plain) {
        "may only contain ASCII letters, digits, dot, underscore and hyphen"
    } else if name.eq_ignore_ascii_case(super::COMMANDS_FILE) {
        "is the name of the command list"
    } else {
        return Ok(());
    };
    Err(format!("blob name {name:?} {reason}"))
}
