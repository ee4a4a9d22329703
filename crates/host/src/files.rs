//! Opening files that others name: regular files only, and never so that opening one waits.

use std::fs::{File, FileType, Metadata, OpenOptions, TryLockError};
use std::io::{self, Read};
use std::path::Path;

/// What a symbolic link means where a file or folder is expected.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Links {
    /// It is refused: the path comes from an untrusted file.
    Refuse,
    /// What it leads to is meant: the path is the user's own, or `--follow-links` is given.
    Follow,
}

/// Length of a regular file in bytes, without opening it.
///
/// # Errors
/// If it is not there, is no regular file, or is a symbolic link where these are refused.
pub fn length(path: &Path, links: Links) -> io::Result<u64> {
    Ok(regular(path, links)?.len())
}

/// Opens a regular file for reading.
///
/// # Errors
/// If it is not there, cannot be read, is no regular file, or is a symbolic link where these are refused.
pub fn open(path: &Path, links: Links) -> io::Result<File> {
    regular(path, links)?;
    let mut options = OpenOptions::new();
    options.read(true);
    // Another process may swap the file between the look at it and the opening. A FIFO would then wait for a writer.
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt;
        let last = if links == Links::Refuse { libc::O_NOFOLLOW } else { 0 };
        options.custom_flags(libc::O_NONBLOCK | libc::O_NOCTTY | last);
    }
    let file = options.open(path)?;
    check_regular(&file.metadata()?)?;
    Ok(file)
}

/// Opens a regular file for reading and writing and locks it, until it is closed or the process ends. It is made where it is missing; a symbolic link
/// is not followed. None: another process has locked it. On a file system without locks it is not locked.
///
/// # Errors
/// If it cannot be made or opened, or is no regular file.
pub fn open_locked(path: &Path) -> io::Result<Option<File>> {
    loop {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        #[cfg(unix)]
        {
            use std::os::unix::fs::OpenOptionsExt;
            options.custom_flags(libc::O_NOFOLLOW | libc::O_NONBLOCK | libc::O_NOCTTY);
        }
        let file = options.open(path)?;
        check_regular(&file.metadata()?)?;
        if matches!(file.try_lock(), Err(TryLockError::WouldBlock)) {
            return Ok(None);
        }
        // The process that held the lock may have removed the file at its end: then what is locked here has no name any more.
        if is_at(&file, path) {
            return Ok(Some(file));
        }
    }
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let id = |of: &Metadata| (of.dev(), of.ino());
    matches!((file.metadata(), path.symlink_metadata()), (Ok(open), Ok(named)) if id(&open) == id(&named))
}

/// Whether an open file is the one at a path: elsewhere a file that is open is not removed.
#[cfg(not(unix))]
fn is_at(_: &File, _: &Path) -> bool {
    true
}

/// The text of a regular file of at most `most` bytes; the path is the user's own.
///
/// # Errors
/// As [`open`]; also if the file is longer, or not UTF-8.
pub fn read_text(path: &Path, most: u64) -> io::Result<String> {
    let file = open(path, Links::Follow)?;
    let length = file.metadata()?.len();
    if length > most {
        return Err(io::Error::other(format!("is {length} bytes long, at most {most} are read")));
    }
    let mut bytes = Vec::new();
    // The file may grow while it is read.
    file.take(most).read_to_end(&mut bytes)?;
    String::from_utf8(bytes)
        .map_err(|error| io::Error::other(format!("is not UTF-8 text: byte {} is invalid", error.utf8_error().valid_up_to())))
}

/// Checks that a path is a folder, and no symbolic link where these are refused.
///
/// # Errors
/// If it is not so.
pub fn check_folder(path: &Path, links: Links) -> io::Result<()> {
    let found = look(path, links)?;
    if found.is_dir() { Ok(()) } else { Err(io::Error::other(format!("is {}, a folder is needed", kind(found.file_type())))) }
}

fn regular(path: &Path, links: Links) -> io::Result<Metadata> {
    let found = look(path, links)?;
    check_regular(&found)?;
    Ok(found)
}

fn look(path: &Path, links: Links) -> io::Result<Metadata> {
    match links {
        Links::Follow => std::fs::metadata(path),
        Links::Refuse => {
            let found = std::fs::symlink_metadata(path)?;
            if found.is_symlink() {
                return Err(io::Error::other("is a symbolic link; --follow-links reads what links of a trace lead to"));
            }
            Ok(found)
        }
    }
}

fn check_regular(found: &Metadata) -> io::Result<()> {
    if found.is_file() {
        return Ok(());
    }
    Err(io::Error::other(format!("is {}, only regular files are read", kind(found.file_type()))))
}

fn kind(of: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if of.is_fifo() {
            return "a FIFO";
        } else if of.is_socket() {
            return "a socket";
        } else if of.is_char_device() || of.is_block_device() {
            return "a device";
        }
    }
    match of {
        of if of.is_dir() => "a folder",
        of if of.is_file() => "a file",
        _ => "neither a file nor a folder",
    }
}
