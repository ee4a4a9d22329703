//! What a replay may remove or replace: files that an earlier one has written, and nothing else.

use std::collections::BTreeSet;
use std::fs::File;
use std::io::{ErrorKind, Read, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::host::{self, Links};

/// The list of a folder's files that replays have written. A running replay holds it locked.
const LIST: &str = ".fillrate-files";

/// The first line of the list.
const HEAD: &str = "# Files that fillrate replay has written here. The next replay into this folder removes them.\n";

/// Bytes of a list that are read at most: the pictures of some ten million frames.
const LIST_MAX: u64 = 256 << 20;

/// Bytes at the beginning of a file in which its mark stands.
const MARK_WITHIN: u64 = 4096;

/// A folder that one replay writes to.
///
/// Each file is listed before it is made, so that a replay that is killed leaves no file without an entry.
pub struct Owned {
    folder: PathBuf,
    file: File,
    /// Files of earlier replays.
    earlier: BTreeSet<String>,
    /// Files of this replay.
    own: BTreeSet<String>,
}

impl Owned {
    /// Locks a folder, which is made where it is missing. `is_output` says whether a replay writes files of a name. With `force`, files of such names that
    /// no replay has written count as files of an earlier replay.
    ///
    /// # Errors
    /// If another process writes to the folder, if there is a file of such a name that no replay has written, or if the list cannot be read or
    /// written.
    pub fn lock(folder: &Path, is_output: impl Fn(&str) -> bool, force: bool) -> Result<Owned> {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        let list = folder.join(LIST);
        let locked = host::open_locked(&list).with_context(|| format!("cannot write {}", list.display()))?;
        let mut file = locked
            .with_context(|| format!("another process writes to {}: wait for it, or use another --out", folder.display()))?;
        let mut text = String::new();
        let read = (&mut file).take(LIST_MAX).read_to_string(&mut text);
        read.with_context(|| format!("cannot read {}", list.display()))?;
        ensure!(
            text.is_empty() || text.starts_with(HEAD.trim_end()),
            "{} is not the list of a replay's files: remove it, or use another --out",
            list.display()
        );
        let earlier = text.lines().filter(|name| is_output(name)).map(str::to_owned).collect();
        let mut owned = Owned { folder: folder.to_owned(), file, earlier, own: BTreeSet::new() };
        let entries = std::fs::read_dir(folder).with_context(|| format!("cannot read {}", folder.display()))?;
        let names = entries.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        let foreign: BTreeSet<String> = names.filter(|name| is_output(name) && !owned.earlier.contains(name)).collect();
        if let (Some(first), false) = (foreign.first(), force) {
            let more = if foreign.len() > 1 { format!(" (and {} more)", foreign.len() - 1) } else { String::new() };
            bail!(
                "{} is there{more}, and no replay has written it: use another --out, or --force to replace such files",
                folder.join(first).display()
            );
        }
        owned.earlier.extend(foreign);
        owned.write()?;
        Ok(owned)
    }

    /// Lists a file that is about to be made.
    ///
    /// # Errors
    /// If the list cannot be written.
    pub fn add(&mut self, name: &str) -> Result<()> {
        if !self.own.insert(name.to_owned()) || self.earlier.contains(name) {
            return Ok(());
        }
        self.file
            .write_all(format!("{name}\n").as_bytes())
            .with_context(|| format!("cannot write {}", self.folder.join(LIST).display()))
    }

    /// Removes the files of earlier replays.
    ///
    /// # Errors
    /// If one cannot be removed, or the list cannot be written.
    pub fn remove_earlier(&mut self) -> Result<()> {
        for name in std::mem::take(&mut self.earlier).difference(&self.own) {
            let path = self.folder.join(name);
            match std::fs::remove_file(&path) {
                Err(error) if error.kind() != ErrorKind::NotFound => {
                    return Err(error).with_context(|| format!("cannot replace {}", path.display()));
                }
                _ => {}
            }
        }
        self.write()
    }

    /// Writes the whole list, in the order of names.
    fn write(&mut self) -> Result<()> {
        let names: Vec<&str> = self.earlier.union(&self.own).map(String::as_str).collect();
        let text = names.iter().fold(HEAD.to_owned(), |text, name| text + name + "\n");
        // The old text is longer or shorter; a process that is killed in between leaves lines of both.
        let mut written = || {
            self.file.rewind()?;
            self.file.write_all(text.as_bytes())?;
            self.file.set_len(text.len() as u64)
        };
        written().with_context(|| format!("cannot write {}", self.folder.join(LIST).display()))
    }
}

impl Drop for Owned {
    /// Leaves the files that are there in the list, and no list where there is none.
    fn drop(&mut self) {
        let folder = &self.folder;
        for names in [&mut self.earlier, &mut self.own] {
            names.retain(|name| folder.join(name).symlink_metadata().is_ok());
        }
        // The files are written; a list that cannot be kept makes the next replay ask for --force.
        let _ = match self.earlier.is_empty() && self.own.is_empty() {
            true => std::fs::remove_file(folder.join(LIST)).map_err(Into::into),
            false => self.write(),
        };
    }
}

/// Checks that a file may be written: there is none, it is empty, or its beginning holds the `mark` that a file of this kind gets here. With `force`
/// any regular file may be replaced.
///
/// # Errors
/// If it is no regular file, cannot be read, or lacks the mark.
pub fn check_replaceable(path: &Path, mark: &[u8], force: bool) -> Result<()> {
    let fail = || format!("cannot write {}", path.display());
    match path.metadata() {
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(error) => return Err(error).with_context(fail),
        Ok(found) if found.is_file() && (force || found.len() == 0) => return Ok(()),
        Ok(_) => {}
    }
    let mut start = Vec::new();
    host::open(path, Links::Follow).and_then(|file| file.take(MARK_WITHIN).read_to_end(&mut start)).with_context(fail)?;
    ensure!(
        start.windows(mark.len()).any(|bytes| bytes == mark),
        "{} is there, and fillrate has not written it: use another name, or --force to replace it",
        path.display()
    );
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_output(name: &str) -> bool {
        name.ends_with(".out")
    }

    #[test]
    fn only_listed_files_are_removed() {
        let home = tempfile::tempdir().expect("a folder");
        let folder = home.path();
        let put = |owned: &mut Owned, name: &str| {
            owned.add(name).expect("listed");
            std::fs::write(folder.join(name), name).expect("written");
        };
        let mut owned = Owned::lock(folder, is_output, false).expect("an empty folder");
        let second = Owned::lock(folder, is_output, false).err().expect("it is locked").to_string();
        assert!(second.contains("another process writes to"), "{second}");
        put(&mut owned, "b.out");
        put(&mut owned, "a.out");
        owned.add("never-made.out").expect("listed");
        drop(owned);
        assert_eq!(std::fs::read_to_string(folder.join(LIST)).expect("there"), format!("{HEAD}a.out\nb.out\n"));

        std::fs::write(folder.join("notes.txt"), "mine").expect("written");
        std::fs::write(folder.join("c.out"), "mine").expect("written");
        let foreign = Owned::lock(folder, is_output, false).err().expect("a file of somebody else").to_string();
        assert!(foreign.contains("c.out is there, and no replay has written it"), "{foreign}");
        std::fs::remove_file(folder.join("c.out")).expect("removed");

        let mut owned = Owned::lock(folder, is_output, false).expect("all files are listed");
        put(&mut owned, "b.out");
        owned.remove_earlier().expect("removed");
        drop(owned);
        let there = |name: &str| folder.join(name).exists();
        assert_eq!(["a.out", "b.out", "notes.txt"].map(there), [false, true, true]);

        std::fs::write(folder.join("c.out"), "mine").expect("written");
        let mut owned = Owned::lock(folder, is_output, true).expect("by force");
        owned.remove_earlier().expect("removed");
        drop(owned);
        assert_eq!(["b.out", "c.out", "notes.txt", LIST].map(there), [false, false, true, false]);
    }

    #[test]
    fn a_list_names_no_file_elsewhere() {
        let home = tempfile::tempdir().expect("a folder");
        let folder = home.path().join("out");
        std::fs::create_dir(&folder).expect("made");
        std::fs::write(home.path().join("notes.txt"), "mine").expect("written");
        std::fs::write(folder.join(LIST), format!("{HEAD}../notes.txt\nnotes.txt\n")).expect("written");
        let mut owned = Owned::lock(&folder, is_output, false).expect("a list");
        owned.remove_earlier().expect("nothing to remove");
        drop(owned);
        assert!(home.path().join("notes.txt").exists());
        std::fs::write(folder.join(LIST), "a poem\n").expect("written");
        let other = Owned::lock(&folder, is_output, true).err().expect("no list").to_string();
        assert!(other.contains("is not the list of a replay's files"), "{other}");
        assert_eq!(std::fs::read_to_string(folder.join(LIST)).expect("there"), "a poem\n");
    }

    #[test]
    fn files_with_the_mark_are_replaced() {
        let home = tempfile::tempdir().expect("a folder");
        let path = home.path().join("page.html");
        let check = |force| check_replaceable(&path, b"by fillrate", force).map_err(|error| error.to_string());
        assert_eq!(check(false), Ok(()));
        std::fs::write(&path, "").expect("written");
        assert_eq!(check(false), Ok(()));
        std::fs::write(&path, "<p>by fillrate</p>").expect("written");
        assert_eq!(check(false), Ok(()));
        std::fs::write(&path, "Trace(version: 1)").expect("written");
        let refused = check(false).expect_err("somebody else's");
        assert!(refused.contains("page.html is there, and fillrate has not written it"), "{refused}");
        assert_eq!(check(true), Ok(()));
        assert!(check_replaceable(home.path(), b"", true).is_err(), "a folder");
    }
}
