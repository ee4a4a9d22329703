//! What the results in the folder of a sweep were made from: hashes of all inputs, the experiment, and the base configuration.

use std::io::{BufReader, Read};
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};
use serde::{Deserialize, Serialize};

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
/// If a part of an experiment cannot be written.
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
        match [a, b].map(|own| Config::parse("base.ron", own.base)) {
            [Ok(one), Ok(two)] => {
                for KnobDifference { path, a, b } in configurations(&one, &two) {
                    put(&format!("{path} of the base configuration"), &a, &b);
                }
            }
            // A program of another version had other knobs.
            _ => put("hash of the base configuration", short(&a.inputs.base), short(&b.inputs.base)),
        }
    }
    put("base configuration", &one.base, &two.base);
    if a.inputs.base == b.inputs.base {
        put("knobs that are set", &one.set.join(" "), &two.set.join(" "));
    }
    let listed = [("axis", &one.vary, &two.vary), ("variable", &one.variables, &two.variables), ("link", &one.link, &two.link)];
    for (what, one, two) in listed {
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
    put("conditions", &one.conditions.join(", "), &two.conditions.join(", "));
    put("design", &written(&one.design)?, &written(&two.design)?);
    let screen = |own: &Experiment| own.screen.as_ref().map_or(Ok(String::new()), written);
    put("screen", &screen(one)?, &screen(two)?);
    let search = |own: &Experiment| own.search.as_ref().map_or(Ok(String::new()), written);
    put("search", &search(one)?, &search(two)?);
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

/// The file of a folder that says what it is made from.
pub const INPUTS: &str = "inputs.json";

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

#[cfg(test)]
mod tests {
    use super::super::experiment::{Design, Screen};
    use super::*;

    fn inputs() -> Inputs {
        let experiment = Experiment::parse("e", "(traces: [\"a\"])").expect("an experiment");
        let (fillrate, program, base) = ("1".into(), "2".into(), "3".into());
        Inputs { fillrate, program, experiment, base, traces: vec!["4".into()], machines: 3, shards: 1 }
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
        let base = Config::built_in("four-pipelines").expect("it is built in");
        let mut other = base.clone();
        other.set("texture.cache_lines=32").expect("a knob");
        (a.base, b.base) = (hash(text(&base).as_bytes()), hash(text(&other).as_bytes()));
        a.experiment.vary = vec!["card.pipelines=2,4".into(), "core.warps=1..4".into()];
        b.experiment.vary = vec!["pipelines=2,8".into(), "depth.early=all".into()];
        b.experiment.design = Design::Random { machines: 3, seed: 4 };
        b.experiment.screen = Some(Screen { by: Default::default(), keep: 2 });
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

        // A configuration of a version that had other knobs is identified by its hash.
        b.base = "7".into();
        let (left, right) = (text(&base), "(pipelines: 4)");
        let old = differences(&Begun { inputs: &a, base: &left }, &Begun { inputs: &b, base: right }, ["now", "then"]);
        let old = old.expect("they are compared").join("; ");
        assert!(old.starts_with("hash of the base configuration: ") && old.contains("7 then"), "{old}");
    }
}
