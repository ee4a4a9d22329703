//! Bytes that a program keeps for later without keeping them in memory.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::sync::{Mutex, PoisonError};

/// Bytes that are held in memory at most.
const HELD: usize = 16 << 10;

/// Bytes that are added one after another, and read or replaced at any place. The last of them are in memory, the others in a temporary file
/// that has no name and ends with the value. So memory does not grow with them, and a short spool needs no file.
#[derive(Debug, Default)]
pub struct Spool {
    file: Option<Mutex<File>>,
    /// Bytes in the file, in front of those held.
    filed: u64,
    held: Vec<u8>,
}

impl Spool {
    /// Bytes in it.
    pub fn len(&self) -> u64 {
        self.filed + self.held.len() as u64
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds bytes at the end.
    ///
    /// # Errors
    /// If the temporary file cannot be made or written to; the error names its folder.
    pub fn add(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.held.len() + bytes.len() > HELD && !self.held.is_empty() {
            if self.file.is_none() {
                self.file = Some(Mutex::new(tempfile::tempfile().map_err(of_folder)?));
            }
            self.in_file(self.filed, |file| file.write_all(&self.held))?;
            self.filed += self.held.len() as u64;
            self.held.clear();
        }
        self.held.extend_from_slice(bytes);
        Ok(())
    }

    /// Fills a buffer with the bytes from a place on.
    ///
    /// # Errors
    /// If they are not all there, or the temporary file cannot be read.
    pub fn read(&self, from: u64, bytes: &mut [u8]) -> io::Result<()> {
        self.check(from, bytes.len())?;
        let (filed, held) = bytes.split_at_mut(self.of_file(from, bytes.len()));
        if !filed.is_empty() {
            self.in_file(from, |file| file.read_exact(filed))?;
        }
        if !held.is_empty() {
            let at = self.held_at(from);
            held.copy_from_slice(&self.held[at..at + held.len()]);
        }
        Ok(())
    }

    /// Replaces bytes that are there.
    ///
    /// # Errors
    /// If they are not all there, or the temporary file cannot be written to.
    pub fn replace(&mut self, from: u64, bytes: &[u8]) -> io::Result<()> {
        self.check(from, bytes.len())?;
        let (filed, held) = bytes.split_at(self.of_file(from, bytes.len()));
        if !filed.is_empty() {
            self.in_file(from, |file| file.write_all(filed))?;
        }
        if !held.is_empty() {
            let at = self.held_at(from);
            self.held[at..at + held.len()].copy_from_slice(held);
        }
        Ok(())
    }

    fn check(&self, from: u64, length: usize) -> io::Result<()> {
        let end = from.checked_add(length as u64);
        if end.is_none_or(|end| end > self.len()) {
            return Err(io::Error::other(format!("bytes {from} + {length} reach past {} that are kept", self.len())));
        }
        Ok(())
    }

    /// The number of the `length` bytes from `from` on that are in the file.
    fn of_file(&self, from: u64, length: usize) -> usize {
        self.filed.saturating_sub(from).min(length as u64) as usize
    }

    /// Where the first of the bytes from a place on stands that are held.
    fn held_at(&self, from: u64) -> usize {
        from.saturating_sub(self.filed) as usize
    }

    /// Reads or writes the file from a place on.
    fn in_file(&self, from: u64, act: impl FnOnce(&mut File) -> io::Result<()>) -> io::Result<()> {
        // Each use begins by its own place, so one that has failed leaves nothing behind.
        let Some(file) = &self.file else { return Err(io::Error::other("there is no temporary file")) };
        let mut file = file.lock().unwrap_or_else(PoisonError::into_inner);
        file.seek(SeekFrom::Start(from)).and_then(|_| act(&mut file)).map_err(of_folder)
    }
}

/// An error of a file that has no name.
fn of_folder(error: io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("a temporary file in {}: {error}", std::env::temp_dir().display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_kept_comes_back_from_memory_and_from_the_file() {
        let byte = |at: u64| (at * 7 + at / 256) as u8;
        let mut spool = Spool::default();
        let all: Vec<u8> = (0..3 * HELD as u64).map(byte).collect();
        let mut parts = all.as_slice();
        for length in (1..).map(|n| n * 37 % 1000) {
            let (part, rest) = parts.split_at(length.min(parts.len()));
            spool.add(part).expect("added");
            parts = rest;
            assert!(spool.held.capacity() <= 2 * HELD);
            if rest.is_empty() {
                break;
            }
        }
        assert!(spool.filed > HELD as u64 && !spool.held.is_empty());
        // Across the end of the file, too.
        for from in [0, 1000, spool.filed - 10, spool.filed, spool.len() - 30] {
            let mut read = [0; 30];
            spool.read(from, &mut read).expect("read");
            assert_eq!(read, all[from as usize..][..30], "from {from}");
            spool.replace(from, &[3; 30]).expect("replaced");
            spool.read(from, &mut read).expect("read");
            assert_eq!(read, [3; 30], "from {from}");
            spool.replace(from, &all[from as usize..][..30]).expect("replaced");
        }
        let mut whole = vec![0; all.len()];
        spool.read(0, &mut whole).expect("read");
        assert_eq!(whole, all);
        assert!(spool.read(spool.len() - 1, &mut [0; 2]).is_err_and(|error| error.to_string().contains("reach past")));
        assert!(spool.replace(u64::MAX, &[0]).is_err());
    }

    #[test]
    fn a_short_one_has_no_file() {
        let mut spool = Spool::default();
        spool.add(&[1; 1000]).expect("added");
        assert!(spool.file.is_none() && spool.len() == 1000);
    }
}
