//! The folder of a sweep: what it was made from, and a file of results for each shard, which grows and survives being killed.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{BufRead, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail, ensure};
use serde::{Deserialize, Serialize};

use super::entry::Entry;
use super::experiment::Experiment;
use super::plan::Plan;
use crate::host;
use crate::machine::Config;
use crate::report::compare::{KnobDifference, configurations};

/// What a sweep is made from. Two runs with the same inputs give the same bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Inputs {
    /// Version of the program.
    pub fillrate: String,
    /// Hash of the program.
    pub program: String,
    /// The experiment.
    pub experiment: Experiment,
    /// Hash of the base configuration, resolved.
    pub base: String,
    /// Hash of each trace.
    pub traces: Vec<String>,
    /// Machines of the plan.
    pub machines: u32,
    /// Shards that the machines are dealt to.
    pub shards: u32,
}

/// What a sweep in a folder was made from, with its base configuration, complete.
pub struct Begun<'b> {
    /// What it was made from.
    pub inputs: &'b Inputs,
    /// The text of its base configuration.
    pub base: &'b str,
}

/// In what two sweeps differ, each difference in words; `where_` says where the one and the other stand.
///
/// # Errors
/// If a base configuration cannot be read.
pub fn differences(a: &Begun<'_>, b: &Begun<'_>, where_: [&str; 2]) -> Result<Vec<String>> {
    let mut found = Vec::new();
    let mut put = |what: &str, a: &str, b: &str| {
        let word = |text: &str| if text.is_empty() { "none".to_owned() } else { text.to_owned() };
        if a != b {
            found.push(format!("{what}: {} {}, {} {}", word(a), where_[0], word(b), where_[1]));
        }
    };
    let (one, two) = (&a.inputs.experiment, &b.inputs.experiment);
    put("traces", &one.traces.join(", "), &two.traces.join(", "));
    if one.traces == two.traces {
        for (name, (a, b)) in one.traces.iter().zip(a.inputs.traces.iter().zip(&b.inputs.traces)) {
            put(&format!("hash of the trace {name}"), short(a), short(b));
        }
    }
    put("what traces differ in", &one.trace_axis, &two.trace_axis);
    put("frames", &one.frames, &two.frames);
    if a.inputs.base != b.inputs.base {
        let knobs = configurations(&Config::parse("base.ron", a.base)?, &Config::parse("base.ron", b.base)?);
        for KnobDifference { path, a, b } in knobs {
            put(&format!("{path} of the base configuration"), &a, &b);
        }
    }
    put("base configuration", &one.base, &two.base);
    if a.inputs.base == b.inputs.base {
        put("knobs that are set", &one.set.join(" "), &two.set.join(" "));
    }
    for (what, one, two) in [("axis", &one.vary, &two.vary), ("link", &one.link, &two.link)] {
        let (one, two) = (by_path(one), by_path(two));
        let of = |list: &[(&str, &str)], path: &str| {
            list.iter().find(|(own, _)| *own == path).map_or(String::new(), |(_, values)| (*values).to_owned())
        };
        let paths: Vec<&str> = one.iter().map(|own| own.0).collect();
        let new = two.iter().map(|own| own.0).filter(|path| !paths.contains(path));
        for path in paths.iter().copied().chain(new) {
            put(&format!("{what} {path}"), &of(&one, path), &of(&two, path));
        }
        if one.len() == two.len() && paths.iter().all(|path| of(&one, path) == of(&two, path)) {
            let order = |list: &[(&str, &str)]| list.iter().map(|own| own.0).collect::<Vec<_>>().join(", ");
            put(&format!("order of each {what}"), &order(&one), &order(&two));
        }
    }
    put("design", &written(&one.design)?, &written(&two.design)?);
    let screen = |own: &Experiment| own.screen.as_ref().map_or(Ok(String::new()), written);
    put("screen", &screen(one)?, &screen(two)?);
    put("kept statistics", &one.keep.join(", "), &two.keep.join(", "));
    put("measures", &one.measures.join(", "), &two.measures.join(", "));
    put("question", &one.question, &two.question);
    put("cost", &one.cost, &two.cost);
    put("shards", &a.inputs.shards.to_string(), &b.inputs.shards.to_string());
    put("version of the program", &a.inputs.fillrate, &b.inputs.fillrate);
    put("hash of the program", short(&a.inputs.program), short(&b.inputs.program));
    Ok(found)
}

/// Whether the experiment of a folder can be gone on with now: not by another program, and not where files have changed that it names.
fn can_go_on(known: &Inputs, now: &Inputs) -> bool {
    let (one, two) = (&known.experiment, &now.experiment);
    let named = one.base == two.base && one.set == two.set;
    (&known.fillrate, &known.program) == (&now.fillrate, &now.program)
        && (!named || known.base == now.base)
        && (one.traces != two.traces || known.traces == now.traces)
}

/// Enough of a hash to tell it from another.
fn short(hash: &str) -> &str {
    hash.get(..12).unwrap_or(hash)
}

/// Axes or links by their paths: `PATH=VALUES`.
fn by_path(list: &[String]) -> Vec<(&str, &str)> {
    list.iter()
        .map(|text| text.split_once('=').unwrap_or((text, "")))
        .map(|(path, rest)| (Config::path(path), rest.trim()))
        .collect()
}

/// A part of an experiment as its file has it.
fn written(part: &impl Serialize) -> Result<String> {
    Ok(ron::ser::to_string(part)?)
}

/// The hash of bytes, as the inputs have it.
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// The hash of a file; of a folder, that of the names and hashes of all files in it and below.
///
/// # Errors
/// If one cannot be read.
pub fn hash_path(path: &Path) -> Result<String> {
    let read = || format!("cannot read {}", path.display());
    if !path.is_dir() {
        let mut hasher = blake3::Hasher::new();
        let mut file = BufReader::new(host::open(path, host::Links::Follow).with_context(read)?);
        let mut bytes = vec![0; 1 << 16];
        loop {
            match file.read(&mut bytes).with_context(read)? {
                0 => return Ok(hasher.finalize().to_hex().to_string()),
                read => hasher.update(&bytes[..read]),
            };
        }
    }
    let mut names = Vec::new();
    for entry in std::fs::read_dir(path).with_context(read)? {
        names.push(entry.with_context(read)?.file_name());
    }
    names.sort();
    let mut hasher = blake3::Hasher::new();
    for name in names {
        let own = path.join(&name);
        // What is no regular file cannot be part of a trace.
        let kind = std::fs::symlink_metadata(&own).with_context(read)?.file_type();
        if kind.is_dir() || kind.is_file() {
            hasher.update(name.as_encoded_bytes()).update(&[0]).update(hash_path(&own)?.as_bytes());
        }
    }
    Ok(hasher.finalize().to_hex().to_string())
}

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

/// The file of a folder that says what it is made from.
const INPUTS: &str = "inputs.json";

/// The file of a folder that has its base configuration.
const BASE: &str = "base.ron";

/// Bytes of a base configuration at most; the largest built-in one has 45,000.
const BASE_MAX: u64 = 256 << 10;

/// Makes a folder for a sweep, or finds the one that an earlier run of the same sweep has begun.
///
/// # Errors
/// If it holds the results of another experiment, or cannot be made.
pub fn begin(folder: &Path, inputs: &Inputs, base: &str) -> Result<()> {
    let place = folder.display();
    std::fs::create_dir_all(folder).with_context(|| format!("cannot create {place}"))?;
    if folder.join(INPUTS).exists() {
        let (known, known_base) = (read_inputs(folder)?, read_base(folder)?);
        let (there, here) = (Begun { inputs: &known, base: &known_base }, Begun { inputs, base });
        let found = differences(&there, &here, ["there", "here"])?;
        if !found.is_empty() {
            let mut remedy = "use another --out, or remove that folder".to_owned();
            if can_go_on(&known, inputs) {
                let shard = if known.shards > 1 { format!(" --shard I/{}", known.shards) } else { String::new() };
                remedy = format!(
                    "use another --out, remove that folder, or go on with what it holds: fillrate sweep {place}/experiment.ron --out {place}{shard}"
                );
            }
            bail!("{place} holds the results of another experiment: {}; {remedy}", found.join("; "));
        }
        return Ok(());
    }
    let put = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        host::write_file(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    let text = ron::ser::to_string_pretty(&inputs.experiment, ron::ser::PrettyConfig::default())?;
    put("experiment.ron", format!("{text}\n").as_bytes())?;
    put(BASE, base.as_bytes())?;
    // Last: a folder with inputs is one that can be gone on with.
    put(INPUTS, format!("{}\n", serde_json::to_string_pretty(inputs)?).as_bytes())
}

/// What the results in a folder were made from.
///
/// # Errors
/// If it is no folder of a sweep.
pub fn read_inputs(folder: &Path) -> Result<Inputs> {
    let path = folder.join(INPUTS);
    let text = host::read_text(&path, 1 << 24)
        .with_context(|| format!("{} is no folder of a sweep: cannot read {}", folder.display(), path.display()))?;
    serde_json::from_str(&text).with_context(|| format!("{} does not say what a sweep is made from", path.display()))
}

/// The base configuration of a sweep, complete: the one of that name may have changed since.
///
/// # Errors
/// If it cannot be read.
pub fn read_base(folder: &Path) -> Result<String> {
    let path = folder.join(BASE);
    host::read_text(&path, BASE_MAX).with_context(|| format!("cannot read {}", path.display()))
}

/// What a sweep in a folder was made from, and its machines.
///
/// # Errors
/// If it is no folder of a sweep, or its base configuration is not the one that it was begun with.
pub fn begun(folder: &Path) -> Result<(Inputs, Plan)> {
    let (inputs, base) = (read_inputs(folder)?, read_base(folder)?);
    let name = folder.join(BASE).display().to_string();
    ensure!(hash(base.as_bytes()) == inputs.base, "{name} is not the configuration that the sweep was begun with");
    let plan = Plan::new(Config::parse(&name, &base)?, &inputs.experiment, u64::from(u32::MAX))
        .with_context(|| folder.join(INPUTS).display().to_string())?;
    ensure!(
        plan.len() == inputs.machines,
        "{} says that it has {} machines, and its experiment has {}; run the sweep again into another --out",
        folder.join(INPUTS).display(),
        inputs.machines,
        plan.len()
    );
    Ok((inputs, plan))
}

/// The results of a shard while it runs: `shard-I-of-N.jsonl.part`, a line a machine and trace, in the order in which they end.
pub struct Journal {
    file: File,
    part: PathBuf,
    place: PathBuf,
}

/// Which runs a shard has the results of: trace and machine.
pub type Done = std::collections::BTreeSet<(u32, u32)>;

impl Journal {
    /// Opens the results of a shard, with what an earlier run of it has left. A line that was cut off goes. None: they are complete.
    ///
    /// # Errors
    /// If another process writes them, or they cannot be written.
    pub fn open(folder: &Path, shard: Shard) -> Result<Option<(Journal, Done)>> {
        let place = shard.file(folder);
        if place.exists() {
            return Ok(None);
        }
        let part = place.with_extension("jsonl.part");
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
        Ok(Some((Journal { file, part, place }, done)))
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
        let mut results = Results::read(file, &part)?;
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
    fn read(file: File, path: &Path) -> Result<Results> {
        let mut results = Results::default();
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

    fn add(&mut self, mut file: File, path: &Path) -> Result<()> {
        let read = || format!("cannot read {}", path.display());
        file.seek(SeekFrom::Start(0)).with_context(read)?;
        let (mut begin, mut line, mut lines) = (0, Vec::new(), BufReader::new(&file));
        for number in 1.. {
            line.clear();
            let length = lines.read_until(b'\n', &mut line).with_context(read)?;
            if length == 0 {
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

    fn inputs() -> Inputs {
        let experiment = Experiment::parse("e", "(traces: [\"a\"])").expect("an experiment");
        let (fillrate, program, base) = ("1".into(), "2".into(), "3".into());
        Inputs { fillrate, program, experiment, base, traces: vec!["4".into()], machines: 3, shards: 1 }
    }

    #[test]
    fn a_journal_goes_on_behind_the_last_whole_line_and_ends_sorted() {
        let home = tempfile::tempdir().expect("a folder");
        let shard = Shard::default();
        let (mut journal, done) = Journal::open(home.path(), shard).expect("it opens").expect("nothing is there");
        assert!(done.is_empty());
        journal.add(&entry(2)).expect("written");
        // Nobody else writes it now.
        let other = Journal::open(home.path(), shard).map(|_| ()).expect_err("locked").to_string();
        assert!(other.contains("another process"), "{other}");
        journal.file.write_all(b"{\"trace\":0,\"mach").expect("written");
        drop(journal);
        let (mut journal, done) = Journal::open(home.path(), shard).expect("it opens").expect("it has not ended");
        assert_eq!(done, Done::from([(0, 2)]));
        journal.add(&entry(0)).expect("written");
        journal.end().expect("it ends");
        assert!(Journal::open(home.path(), shard).expect("it opens").is_none());
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
    fn a_folder_of_another_experiment_is_refused() {
        let home = tempfile::tempdir().expect("a folder");
        begin(home.path(), &inputs(), "()").expect("it begins");
        begin(home.path(), &inputs(), "()").expect("it goes on");
        let mut other = inputs();
        other.experiment.vary = vec!["pipelines=1,2".into()];
        other.shards = 2;
        let error = begin(home.path(), &other, "()").expect_err("another").to_string();
        assert!(
            error.contains("another experiment: axis pipelines: none there, 1,2 here; shards: 1 there, 2 here; use"),
            "{error}"
        );
        assert!(error.contains("remove that folder") && error.contains("experiment.ron --out"), "{error}");
        // Neither an own program nor a changed file lets it go on.
        for change in [|own: &mut Inputs| own.program = "9".into(), |own: &mut Inputs| own.traces = vec!["9".into()]] {
            let mut other = inputs();
            change(&mut other);
            let error = begin(home.path(), &other, "()").expect_err("another").to_string();
            assert!(
                error.contains(" there, 9 here; use another --out, or remove that folder") && !error.contains("go on"),
                "{error}"
            );
        }
    }

    #[test]
    fn what_differs_is_told_with_both_values() {
        let text = |base: &Config| base.resolved();
        let (mut a, mut b) = (inputs(), inputs());
        let base = Config::built_in("baseline").expect("it is built in");
        let mut other = base.clone();
        other.set("texture.cache_lines=32").expect("a knob");
        (a.base, b.base) = (hash(text(&base).as_bytes()), hash(text(&other).as_bytes()));
        a.experiment.vary = vec!["card.pipelines=2,4".into(), "core.warps=1..4".into()];
        b.experiment.vary = vec!["pipelines=2,8".into(), "depth.early=all".into()];
        b.experiment.design = super::super::experiment::Design::Random { machines: 3, seed: 4 };
        b.experiment.screen = Some(super::super::experiment::Screen { by: Default::default(), keep: 2 });
        b.traces = vec!["5".into()];
        let of = |a: &Inputs, b: &Inputs| {
            let (left, right) = (text(&base), text(&other));
            differences(&Begun { inputs: a, base: &left }, &Begun { inputs: b, base: &right }, ["then", "now"])
                .expect("they are read")
        };
        assert_eq!(
            of(&a, &b),
            [
                "hash of the trace a: 4 then, 5 now",
                "texture.cache_lines of the base configuration: 256 then, 32 now",
                "axis pipelines: 2,4 then, 2,8 now",
                "axis core.warps: 1..4 then, none now",
                "axis depth.early: none then, all now",
                "design: grid then, random(machines:3,seed:4) now",
                "screen: none then, (by:\"bound\",keep:2) now",
            ]
        );
        b = a.clone();
        b.experiment.vary.reverse();
        assert_eq!(of(&a, &b), ["order of each axis: pipelines, core.warps then, core.warps, pipelines now"]);
        assert!(of(&a, &a).is_empty());
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
