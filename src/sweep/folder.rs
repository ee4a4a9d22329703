//! The results in the folder of a sweep: a file for each shard, which grows and survives being killed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::Deserialize;

use super::entry::Entry;
use crate::host;

/// One part of a sweep's machines: every machine whose number leaves `index - 1` when divided by `of`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// From 1.
    pub index: u32,
    /// Shards in all.
    pub of: u32,
}

impl Default for Shard {
    /// All machines.
    fn default() -> Shard {
        Shard { index: 1, of: 1 }
    }
}

impl std::str::FromStr for Shard {
    type Err = String;

    fn from_str(text: &str) -> Result<Shard, String> {
        let numbers = text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match numbers {
            Some((index, of)) if 1 <= index && index <= of => Ok(Shard { index, of }),
            _ => Err("write it as I/N, with I from 1 to N".into()),
        }
    }
}

impl Shard {
    /// Whether a machine belongs to it.
    pub fn has(&self, machine: u32) -> bool {
        machine % self.of == self.index - 1
    }

    /// Its file in the folder.
    pub fn file(&self, folder: &Path) -> PathBuf {
        folder.join(format!("shard-{}-of-{}.jsonl", self.index, self.of))
    }
}

/// How the name of a file ends that grows.
const PART: &str = "part";

/// The results of a shard, or of a rung of a search, while it runs: `shard-I-of-N.jsonl.part`, a line per machine and trace, in the order in which they end.
pub struct Journal {
    file: File,
    part: PathBuf,
    place: PathBuf,
}

/// Which runs a shard has the results of: trace and machine.
pub type Done = std::collections::BTreeSet<(u32, u32)>;

impl Journal {
    /// The file that the results of a shard are in while it runs.
    fn part(place: &Path) -> PathBuf {
        place.with_extension(format!("jsonl.{PART}"))
    }

    /// Opens a file of results, such as that of a shard, with what an earlier run has left. A line that was cut off goes. None: they are complete.
    ///
    /// # Errors
    /// If another process writes them, or they cannot be written.
    pub fn open(place: &Path) -> Result<Option<(Journal, Done)>> {
        if place.exists() {
            return Ok(None);
        }
        let part = Journal::part(place);
        let name = part.display().to_string();
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(&part);
        let mut file = file.with_context(|| format!("cannot write {name}"))?;
        match file.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => bail!("another process writes {name}; wait for it, or use another --out"),
            // A file system without locks.
            Err(TryLockError::Error(_)) => {}
        }
        let (mut done, mut whole) = (Done::new(), 0);
        let mut lines = BufReader::new(&file);
        let mut line = Vec::new();
        loop {
            line.clear();
            let length = lines.read_until(b'\n', &mut line).with_context(|| format!("cannot read {name}"))?;
            let entry: Option<Entry> = line.strip_suffix(b"\n").and_then(|line| serde_json::from_slice(line).ok());
            let Some(entry) = entry else { break };
            done.insert((entry.trace, entry.machine));
            whole += length as u64;
        }
        file.set_len(whole).and_then(|()| file.seek(SeekFrom::Start(whole))).with_context(|| format!("cannot write {name}"))?;
        Ok(Some((Journal { file, part, place: place.to_owned() }, done)))
    }

    /// Adds a result.
    ///
    /// # Errors
    /// If it cannot be written; what was written before stays.
    pub fn add(&mut self, entry: &Entry) -> Result<()> {
        let mut line = serde_json::to_vec(entry)?;
        line.push(b'\n');
        self.file.write_all(&line).with_context(|| {
            format!("cannot write {}; results so far are kept, and the same command goes on from there", self.part.display())
        })
    }

    /// Puts the results into their order, and gives the file its name.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn end(self) -> Result<()> {
        let Journal { file, part, place } = self;
        let mut results = Results::default();
        results.add(file, &part)?;
        host::replace(&place, |out| -> Result<()> { results.each_line(|line| Ok(out.write_all(line)?)) }).with_context(
            || format!("cannot write {}; results so far are kept, and the same command goes on from there", place.display()),
        )?;
        std::fs::remove_file(&part).with_context(|| format!("cannot remove {}", part.display()))
    }
}

/// Lines of files of results, in the order of traces and machines.
#[derive(Default)]
pub struct Results {
    files: Vec<(File, PathBuf)>,
    /// Trace and machine; file, first byte and bytes.
    lines: std::collections::BTreeMap<(u32, u32), (usize, u64, usize)>,
}

/// Whether two files have the same bytes.
fn same_bytes(a: &Path, b: &Path) -> Result<bool> {
    let open = |path: &Path| File::open(path).with_context(|| format!("cannot read {}", path.display()));
    let (mut a, mut b) = (BufReader::new(open(a)?), BufReader::new(open(b)?));
    loop {
        let (left, right) = (a.fill_buf()?, b.fill_buf()?);
        let length = left.len().min(right.len());
        if left[..length] != right[..length] || length == 0 {
            return Ok(left.len() == right.len());
        }
        a.consume(length);
        b.consume(length);
    }
}

/// What orders a line.
#[derive(Deserialize)]
struct Key {
    trace: u32,
    machine: u32,
}

impl Results {
    /// The results of one file.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(path: &Path) -> Result<Results> {
        let mut results = Results::default();
        let file = File::open(path).with_context(|| format!("cannot read {}", path.display()))?;
        results.add(file, path)?;
        Ok(results)
    }

    /// The results of all shards, each in one or more of some folders.
    ///
    /// # Errors
    /// If a shard has not ended, or has other results in another folder.
    pub fn open(folders: &[PathBuf], shards: u32) -> Result<Results> {
        let mut results = Results::default();
        let places = |index: u32| {
            let files = folders.iter().map(move |folder| Shard { index, of: shards }.file(folder));
            files.filter(|file| file.exists())
        };
        let missing: Vec<String> =
            (1..=shards).filter(|&index| places(index).next().is_none()).map(|index| format!("{index}/{shards}")).collect();
        if let Some(first) = missing.first() {
            bail!(
                "{} of {shards} shards have not ended, shard {first} among them: run them with --shard {first}",
                missing.len()
            );
        }
        for index in 1..=shards {
            let mut files = places(index);
            let Some(path) = files.next() else { continue };
            for other in files {
                let same = same_bytes(&path, &other).with_context(|| format!("cannot compare with {}", path.display()))?;
                ensure!(
                    same,
                    "shards disagree: {} and {} are results of the same shard and differ; remove the wrong one",
                    path.display(),
                    other.display()
                );
            }
            let file = File::open(&path).with_context(|| format!("cannot read {}", path.display()))?;
            results.add(file, &path)?;
        }
        Ok(results)
    }

    /// The results that there are so far in a folder: of shards that have ended, and of those that run or were killed. Also whether all shards have
    /// ended.
    ///
    /// # Errors
    /// If one cannot be read.
    pub fn so_far(folder: &Path, shards: u32) -> Result<(Results, bool)> {
        let (mut results, mut ended) = (Results::default(), true);
        for index in 1..=shards {
            let whole = Shard { index, of: shards }.file(folder);
            let path = if whole.exists() { whole } else { Journal::part(&whole) };
            ended &= path.extension().is_none_or(|ending| ending != PART);
            if path.exists() {
                let file = File::open(&path).with_context(|| format!("cannot read {}", path.display()))?;
                results.add(file, &path)?;
            }
        }
        Ok((results, ended))
    }

    fn add(&mut self, mut file: File, path: &Path) -> Result<()> {
        let read = || format!("cannot read {}", path.display());
        file.seek(SeekFrom::Start(0)).with_context(read)?;
        let (mut begin, mut line, mut lines) = (0, Vec::new(), BufReader::new(&file));
        for number in 1.. {
            line.clear();
            let length = lines.read_until(b'\n', &mut line).with_context(read)?;
            // A line without an end was cut off, or is being written.
            if length == 0 || line.last() != Some(&b'\n') && path.extension().is_some_and(|ending| ending == PART) {
                break;
            }
            let key: Key = serde_json::from_slice(&line)
                .with_context(|| format!("{}:{number}: no result of a machine", path.display()))?;
            let twice = self.lines.insert((key.trace, key.machine), (self.files.len(), begin, length));
            if twice.is_some() {
                bail!(
                    "{}:{number}: machine {} has two results on trace {}: shards disagree; remove this file and run its shard again",
                    path.display(),
                    key.machine,
                    key.trace
                );
            }
            begin += length as u64;
        }
        self.files.push((file, path.to_owned()));
        Ok(())
    }

    /// The first of some traces and machines that has no result.
    pub fn missing(&self, mut wanted: impl Iterator<Item = (u32, u32)>) -> Option<(u32, u32)> {
        wanted.find(|pair| !self.lines.contains_key(pair))
    }

    /// How many results there are.
    pub fn len(&self) -> usize {
        self.lines.len()
    }

    /// Whether there is none.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    fn each_line(&mut self, mut each: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        let mut bytes = Vec::new();
        for &(file, begin, length) in self.lines.values() {
            let (file, path) = &mut self.files[file];
            bytes.resize(length, 0);
            let read = file.seek(SeekFrom::Start(begin)).and_then(|_| file.read_exact(&mut bytes));
            read.with_context(|| format!("cannot read {}", path.display()))?;
            each(&bytes)?;
        }
        Ok(())
    }

    /// Calls `each` with every result, in the order of traces and machines.
    ///
    /// # Errors
    /// If a line cannot be read, or `each` fails.
    pub fn each(&mut self, mut each: impl FnMut(Entry) -> Result<()>) -> Result<()> {
        self.each_line(|line| each(serde_json::from_slice(line).map_err(|error| anyhow!("a result is damaged: {error}"))?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(machine: u32) -> Entry {
        Entry::failed(0, machine, String::new(), "none".into())
    }

    #[test]
    fn a_journal_goes_on_behind_the_last_whole_line_and_ends_sorted() {
        let home = tempfile::tempdir().expect("a folder");
        let shard = Shard::default();
        let (mut journal, done) = Journal::open(&shard.file(home.path())).expect("it opens").expect("nothing is there");
        assert!(done.is_empty());
        journal.add(&entry(2)).expect("written");
        // Nobody else writes it now.
        let other = Journal::open(&shard.file(home.path())).map(|_| ()).expect_err("locked").to_string();
        assert!(other.contains("another process"), "{other}");
        journal.file.write_all(b"{\"trace\":0,\"mach").expect("written");
        drop(journal);
        let (mut journal, done) = Journal::open(&shard.file(home.path())).expect("it opens").expect("it has not ended");
        assert_eq!(done, Done::from([(0, 2)]));
        journal.add(&entry(0)).expect("written");
        journal.end().expect("it ends");
        assert!(Journal::open(&shard.file(home.path())).expect("it opens").is_none());
        let mut machines = Vec::new();
        let mut results = Results::open(&[home.path().to_owned()], 1).expect("all shards");
        let each = |entry: Entry| {
            machines.push(entry.machine);
            Ok(())
        };
        results.each(each).expect("whole");
        assert_eq!(machines, [0, 2]);
        assert_eq!(std::fs::read_dir(home.path()).expect("a folder").count(), 1, "the part is gone");
        let error = Results::open(&[home.path().to_owned()], 2).map(|_| ()).expect_err("none of two").to_string();
        assert!(error.contains("2 of 2 shards") && error.contains("--shard 1/2"), "{error}");
    }

    #[test]
    fn a_shard_is_written_as_a_fraction() {
        assert_eq!("2/4".parse(), Ok(Shard { index: 2, of: 4 }));
        for wrong in ["0/4", "5/4", "2", "a/b", ""] {
            assert!(wrong.parse::<Shard>().is_err(), "{wrong}");
        }
        let owners = |machine| (1..=3).filter(|&index| Shard { index, of: 3 }.has(machine)).count();
        assert!((0..9).all(|machine| owners(machine) == 1));
    }
}
