//! `docs/data/limits.md`: what an untrusted trace may ask for, with the table of limits from its declarations.

use super::summary::grouped;
use crate::num::Limits;

const BEFORE: &str = "\
# Limits

Generated from the declarations in the code; `cargo test --test program pages` checks it, and `FILLRATE_BLESS=1 cargo test --test program pages` writes it
anew.

A trace is a program: its commands and shaders can ask for work without an end and for memory without a bound, and its files can be
anything that a file system holds. Traces are passed around, so all of them are read as if they came from a stranger. Input that cannot be
used ends with exit status 2 and a message with file, place, reason and remedy, never with a killed process or a wrong picture.

## What is limited

Each limit stops one kind of request, before it is served. Real programs stay far below: each row states the largest figure that recorded
traces have. `--limit NAME=VALUE` sets a limit; it may be given several times, and values may have underscores:

    fillrate replay recorded/trace --limit trace.bytes=16_000_000_000 --limit trace.files=200_000 --out out

All subcommands that read a trace take it, and so does `compare`. A message about a limit names the limit. Defaults of limits of work (`work.*`, without
`work.loop_turns`) are those of a trace up to 1 MiB; one whose files have N MiB may do N times as much.

| name | default | unit | what |
|---|---|---|---|
";

const AFTER: &str = "
## What the default limits cover

Input below 1 MB is read, imported, compiled and drawn by functional rendering, or refused, in 30 s of two processors of 3 GHz and 3 GB. Each form of hostile input
that is known here was measured so (`cargo test --release --test robust every_form -- --ignored --nocapture`): shaders, texts, recordings, archives, pictures and commands. Budgets
count steps and bytes, so that a refusal does not depend on the host.

A machine of the cycle fidelity takes more. `traces/flight.zip`, a recording of 0.93 MB with 600 frames, takes 38 s and some 1,300 million steps on the
baseline, and 82 s and nearly three times as many steps on `tiny`: a limit that ends each input below 1 MB in 30 s would refuse it. A step takes 25 to 50 ns on every machine,
so the default of `work.machine_steps` ends endless work after 3 to 10 minutes, and `--limit work.machine_steps=600_000_000` after 15 to 30 s. Rendering in front of a
machine and beside it has the limits above. Cycles say little about time: `tiny` simulates 7 million in a second, `wide` 0.1 million.
Sweeps and `why` run many machines, each with this limit. The fidelities bound and sampled render a trace several times.

## Which files are read

The path on the command line is the user's word: it may be a symbolic link. What a trace names is not:

* Only regular files inside the trace's folder are read. FIFOs, sockets, devices and folders are refused by name, before they are opened.
* Symbolic links in the folder are refused, whether they lead out of it or stay inside: `trace.ron`, the files that it names, and the
  folder `trace` where a trace's folder has one. `--follow-links` reads what they lead to; that must still be a regular file.
* Files must not change while a trace is in use: large ones are mapped, and a file that becomes shorter under a mapping ends the process
  with a bus error. Lengths are checked when a trace is opened and when a file is first used, contents when they are first used.

The same holds for files that the user names: configurations (256 KiB at most) and what `compare` reads (statistics of 1 GiB at most,
pictures of `picture.pixels`) are regular files.

## What no option allows

* Names of files other than plain ones: `..`, `/`, `\\`, control characters, more than 128 characters.
* Archives with two entries of one name, with entries that overlap, with encrypted ones, or packed otherwise than deflated; entries whose
  header says more than their bytes can become, or that become more than it says; a wrong checksum or hash.
* Text (trace, naga IR, configuration) nested deeper than 128 levels.
* More than 1,024 threads, by `--threads` or `RAYON_NUM_THREADS`.
* Shaders with more than 200 levels of brackets, templates and blocks, or 127 blocks inside each other, which naga's parser and WGSL do not
  have; with more than 60,000 registers, or 65,535 loops, masks or bindings, which operations cannot number.
* Zero values of arrays (`array<f32, N>()`) in larger expressions where the length is made of more than whole numbers, constants, brackets,
  `+ - * / % << & | ^`, `u32`, `i32`, `min` and `max`.

## What is printed, and what is written

Labels, names, paths and messages are printed with control characters escaped (`\\u{1b}`): C0, DEL and C1, changes of direction, and
characters without width. JSON on the standard output escapes them as JSON does. Pages (HTML, Markdown, SVG) have them escaped, too; JSON and CSV
files have them as they are. A cell of a CSV file that a spreadsheet would run as a formula begins with an apostrophe.

Files are written under a temporary name (`.fillrate-….part`) in their folder and then moved to their place: under its name a file is
complete, or it is what it was before. The tables of a replay grow frame by frame, as `stats.csv.part` and `stats.json.part`, and get
their names at its end. A replay writes `stats.json` last, an import `trace.ron`: a folder that has it is complete.

A replay removes what an earlier one has left in its `--out`, and nothing else: `.fillrate-files` in that folder lists the files. A folder with
`frame-0000.png` or another file of such a name that no replay has written is refused, and so is a folder to which another replay writes.
`--report`, `--timeline`, `--difference`, the `--json` of `why` and the `--out` of `report` replace files that Fillrate has written, and no others.
`--force` allows all of these but the second.
";

/// The page.
pub fn page() -> String {
    let mut text = BEFORE.to_owned();
    for row in Limits::table() {
        text.push_str(&format!("| `{}` | {} | {} | {} |\n", row.name, default(row.default), row.unit, row.about.trim()));
    }
    text + AFTER
}

/// A number, and in binary units where it is a round one.
fn default(value: u64) -> String {
    let units = [(1 << 30, "Gi"), (1 << 20, "Mi"), (1 << 10, "Ki")];
    let round = units.iter().find(|&&(unit, _)| value >= unit && value.is_multiple_of(unit) && value / unit < 1 << 20);
    round.map_or_else(|| grouped(value), |&(unit, name)| format!("{} ({} {name})", grouped(value), grouped(value / unit)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_limit_has_a_row_with_its_default() {
        let page = page();
        for row in Limits::table() {
            assert!(
                page.lines().any(|line| line.starts_with(&format!("| `{}` | ", row.name)) && line.contains(row.unit)),
                "{}",
                row.name
            );
        }
        assert_eq!(default(4 << 30), "4,294,967,296 (4 Gi)");
        assert_eq!(default(256), "256");
        assert_eq!(default(3 << 9), "1,536");
    }
}
