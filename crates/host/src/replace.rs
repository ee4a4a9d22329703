//! Writing files: complete, or not at all.

use std::collections::BTreeSet;
use std::ffi::OsString;
use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Seek, Write};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

use tempfile::NamedTempFile;

/// Files that are not complete.
static PARTS: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());

/// The files that are not complete. While they are held, none is added.
fn parts() -> MutexGuard<'static, BTreeSet<PathBuf>> {
    PARTS.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Ends the program, whatever its threads do, without a file that [`replace`] or a [`PartialFile`] has begun.
pub fn exit_without_parts(code: i32) -> ! {
    let parts = parts();
    for part in parts.iter() {
        // It may have moved to its place, and what cannot be removed stays.
        let _ = std::fs::remove_file(part);
    }
    std::process::exit(code)
}

/// Writes a file beside its final place and then moves it there: under its name a file is complete, whenever the program ends. On an error
/// nothing is left, and a file that was there before stays as it was.
///
/// # Errors
/// What `fill` answers, or why the file cannot be written.
pub fn replace<E: From<io::Error>>(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>) -> Result<(), E> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let part = new_part(folder)?;
    let _unfinished = Unfinished(part.path().to_owned());
    let (file, place) = part.into_parts();
    // From here on the place removes the file unless it is kept.
    let mut file = BufWriter::new(file);
    fill(&mut file)?;
    let file = file.into_inner().map_err(|error| error.into_error())?;
    NamedTempFile::from_parts(file, place).persist(path).map_err(|failed| failed.error)?;
    Ok(())
}

/// Writes a file as [`replace`] does.
///
/// # Errors
/// If it cannot be written.
pub fn write_file(path: &Path, bytes: &[u8]) -> io::Result<()> {
    replace(path, |file| file.write_all(bytes))
}

/// A file that grows while a program works. Until it is kept it is called `NAME.part`: what a killed program leaves can be read, and nobody
/// takes it for the complete file. A file that is dropped is removed.
pub struct PartialFile {
    file: BufWriter<File>,
    /// Where it is now.
    part: PathBuf,
    /// Where it belongs.
    place: PathBuf,
}

impl PartialFile {
    /// An empty file for a place. What a killed program left there goes.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn create(place: &Path) -> io::Result<PartialFile> {
        let mut name = OsString::from(place);
        name.push(".part");
        let part = PathBuf::from(name);
        match std::fs::remove_file(&part) {
            Err(error) if error.kind() != io::ErrorKind::NotFound => return Err(error),
            _ => {}
        }
        // A link that somebody else has put there in the meantime is not followed.
        let mut parts = parts();
        let file = OpenOptions::new().read(true).write(true).create_new(true).open(&part)?;
        parts.insert(part.clone());
        Ok(PartialFile { file: BufWriter::new(file), part, place: place.to_owned() })
    }

    /// Adds bytes, which the file has when this returns.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.file.write_all(bytes)?;
        self.file.flush()
    }

    /// Copies the whole file to another.
    ///
    /// # Errors
    /// If it cannot be read, or the other cannot be written.
    pub fn copy_to(&mut self, out: &mut dyn Write) -> io::Result<()> {
        let file = self.file.get_mut();
        file.rewind()?;
        io::copy(file, out)?;
        file.seek(io::SeekFrom::End(0))?;
        Ok(())
    }

    /// The file is complete, and goes to its place.
    ///
    /// # Errors
    /// If it cannot be moved.
    pub fn keep(self) -> io::Result<()> {
        // What is dropped behind this has nothing to remove.
        std::fs::rename(&self.part, &self.place)
    }
}

impl Drop for PartialFile {
    fn drop(&mut self) {
        // It has moved, or nobody wants it.
        let _ = std::fs::remove_file(&self.part);
        parts().remove(&self.part);
    }
}

/// A name in the list of files that are not complete; dropped, it leaves the list.
struct Unfinished(PathBuf);

impl Drop for Unfinished {
    fn drop(&mut self) {
        parts().remove(&self.0);
    }
}

fn new_part(folder: &Path) -> io::Result<NamedTempFile> {
    // Opened here: the library's own files are their owner's alone, and its errors name the temporary file.
    let create = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
    let mut parts = parts();
    let part = tempfile::Builder::new().prefix(".fillrate-").suffix(".part").make_in(folder, create)?;
    parts.insert(part.path().to_owned());
    Ok(part)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_is_complete_or_as_it_was() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("out.txt");
        write_file(&path, b"first").expect("written");
        let failed = replace(&path, |file| {
            file.write_all(b"half of the sec")?;
            file.flush()?;
            Err(io::Error::other("the disk is full"))
        });
        assert_eq!(failed.expect_err("it failed").to_string(), "the disk is full");
        assert_eq!(std::fs::read(&path).expect("there"), b"first");
        write_file(&path, b"second").expect("written");
        assert_eq!(std::fs::read(&path).expect("there"), b"second");
        assert_eq!(std::fs::read_dir(home.path()).expect("a folder").count(), 1, "nothing else is left");
    }

    #[test]
    fn a_file_that_grows_has_another_name_until_it_is_kept() {
        let home = tempfile::tempdir().expect("a folder");
        let (place, part) = (home.path().join("out.csv"), home.path().join("out.csv.part"));
        std::fs::write(&part, "left by a killed program").expect("written");
        let mut file = PartialFile::create(&place).expect("made");
        file.add(b"one\n").expect("written");
        assert_eq!(std::fs::read(&part).expect("there"), b"one\n");
        let mut copy = Vec::new();
        file.copy_to(&mut copy).expect("read");
        file.add(b"two\n").expect("written");
        assert_eq!(copy, b"one\n");
        assert!(!place.exists());
        file.keep().expect("moved");
        assert_eq!(std::fs::read(&place).expect("there"), b"one\ntwo\n");
        drop(PartialFile::create(&place).expect("made"));
        assert_eq!(std::fs::read_dir(home.path()).expect("a folder").count(), 1, "nothing else is left");
    }

    #[test]
    fn a_folder_that_is_not_there_is_an_error() {
        let error = write_file(Path::new("/not/there/out.txt"), b"").expect_err("no folder");
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
