//! Readers of statistics use the declarations of counters: none spells the name of one, so that a renamed counter does not compile where it is read.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use fillrate::machine::config::BUILT_IN;
use fillrate::machine::{Config, Machine};
use fillrate::report::pages;

/// Source files below a folder.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the project") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            sources(&path, found);
        } else if path.extension().is_some_and(|of| of == "rs") {
            found.push(path);
        }
    }
}

/// The paths of all counters, without the numbers of units, as the page of all statistics lists them: `units.NAME.busy`.
fn declared() -> Vec<String> {
    let (mut found, mut place) = (Vec::new(), String::new());
    for line in pages::statistics().lines() {
        if let Some(heading) = line.strip_prefix("## `") {
            place = heading.trim_end_matches('`').replace("[i]", "");
        } else if let Some(row) = line.strip_prefix("| `")
            && !matches!(place.as_str(), "stats.json" | "phases" | "phases.draws")
        {
            let name = row.split('`').next().expect("a name");
            found.push(if place == "(top)" { name.to_owned() } else { format!("{place}.{name}") });
        }
    }
    found
}

/// The text literals of a source outside of comments and tests, each with the number of its line and what stands before it.
fn literals(source: &str) -> Vec<(usize, &str, &str)> {
    let source = source.split("#[cfg(test)]\nmod tests").next().unwrap_or(source);
    let mut found = Vec::new();
    for (at, line) in source.lines().enumerate().filter(|(_, line)| !line.trim_start().starts_with("//")) {
        let mut pieces = line.split('"');
        let mut before = pieces.next().unwrap_or("");
        while let (Some(text), Some(behind)) = (pieces.next(), pieces.next()) {
            found.push((at + 1, before, text));
            before = behind;
        }
    }
    found
}

/// Whether a text names one of these counters: by a word with `_`, or by a path; where it is looked up in a tree, by any word.
fn names_a_counter(before: &str, text: &str, paths: &[String], words: &BTreeSet<&str>) -> bool {
    let is_word = |text: &str| words.contains(text);
    let looked_up =
        ["number(", "get(", "count(", "ratio(", "level(", "real(", "leaf("].iter().any(|call| before.ends_with(call));
    let fits = |path: &str, declared: &str| {
        let mut steps = path.split('.').map(|step| step.split('[').next().unwrap_or(step));
        let same = |step: &str, own: &str| own == "NAME" && !step.is_empty() || own == step;
        declared.split('.').all(|own| steps.next().is_some_and(|step| same(step, own))) && steps.next().is_none()
    };
    let separate = |c: char| !c.is_ascii_alphanumeric() && !"_.[]{}*-".contains(c);
    let path = |text: &str| text.contains('.') && paths.iter().any(|declared| fits(text, declared));
    // A name in braces is a variable's.
    let mut words = text.split(|c: char| !c.is_ascii_alphanumeric() && !"_{}".contains(c));
    looked_up && is_word(text) || text.split(separate).any(path) || words.any(|word| word.contains('_') && is_word(word))
}

#[test]
fn no_reader_spells_the_name_of_a_counter() {
    let paths = declared();
    let mut words: BTreeSet<&str> = paths.iter().map(|path| path.rsplit('.').next().expect("a name")).collect();
    assert!(words.len() > 100, "the page lists {} counters", words.len());
    // Channels and knobs have some of these names, too.
    for (name, _) in BUILT_IN {
        let config = Config::built_in(name).expect("it is built in");
        let channels = Machine::new(&config).expect("a machine").wires().map(|wire| wire.name).collect::<Vec<_>>();
        let knobs = config.knobs().map(|(_, knob)| knob.name);
        knobs.chain(channels).for_each(|name| {
            words.remove(name);
        });
    }
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    ["src/report", "src/why", "crates/accuracy/src", "crates/run/src"]
        .iter()
        .for_each(|part| sources(&root.join(part), &mut found));
    assert!(found.len() > 100, "the test looks at {} files", found.len());
    let mut wrong = Vec::new();
    for path in found {
        let text = fs::read_to_string(&path).expect("text");
        let name = path.strip_prefix(root).unwrap_or(&path).display();
        let spelled = literals(&text).into_iter().filter(|(_, before, text)| names_a_counter(before, text, &paths, &words));
        wrong.extend(spelled.map(|(line, _, text)| format!("{name}:{line}: {text}")));
    }
    wrong.sort();
    assert!(wrong.is_empty(), "read these by their declarations (stats::Heading, stats::Key):\n{}", wrong.join("\n"));
}

#[test]
fn spelled_counters_are_found() {
    let paths = ["units.NAME.busy", "memory.dram.read_bytes", "cycles"].map(str::to_owned);
    let words = BTreeSet::from(["busy", "read_bytes", "cycles"]);
    let source = "a.number(\"busy\"); // \"busy\"\n// \"units.core.busy\"\nb(\"busy\", \"of units.{unit}[*].busy\");\n\
                  #[cfg(test)]\nmod tests { \"read_bytes\" }";
    let spelled = |(before, text): (&str, &str)| names_a_counter(before, text, &paths, &words);
    let found: Vec<(usize, bool)> =
        literals(source).into_iter().map(|(line, before, text)| (line, spelled((before, text)))).collect();
    assert_eq!(found, [(1, true), (1, false), (3, false), (3, true)]);
    let texts =
        [("tree.get(", "cycles"), ("", "cycles"), ("", "dram {read_bytes}"), ("", "memory.port_width"), ("[", "read_bytes")];
    assert_eq!(texts.map(spelled), [true, false, false, false, true]);
}
