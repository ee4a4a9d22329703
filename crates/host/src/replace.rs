//! Writing files: complete, or not at all.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter, Write};
use std::path::Path;

use tempfile::NamedTempFile;

/// Writes a file beside its final place and then moves it there: under its name a file is complete, whenever the program ends. On an error
/// nothing is left, and a file that was there before stays as it was.
///
/// # Errors
/// What `fill` answers, or why the file cannot be written.
pub fn replace<E: From<io::Error>>(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), E>) -> Result<(), E> {
    let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let part = new_part(folder)?;
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

fn new_part(folder: &Path) -> io::Result<NamedTempFile> {
    // Opened here: the library's own files are their owner's alone, and its errors name the temporary file.
    let create = |path: &Path| OpenOptions::new().write(true).create_new(true).open(path);
    tempfile::Builder::new().prefix(".fillrate-").suffix(".part").make_in(folder, create)
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
    fn a_folder_that_is_not_there_is_an_error() {
        let error = write_file(Path::new("/not/there/out.txt"), b"").expect_err("no folder");
        assert_eq!(error.kind(), io::ErrorKind::NotFound);
    }
}
