//! Pages of documentation that are generated from declarations. A test compares them with the files in `docs/` and fails when one
//! is stale; `FILLRATE_BLESS=1 cargo test --test program pages` writes them anew.

use super::files::VERSION;
use crate::machine::config::documentation;
use crate::machine::parts::Parts;
use crate::machine::{
    CLASS, Config, ConfigError, EFFICIENCY, LOAD_IMBALANCE, LossCounts, OVERLAP, PASSES_OUT_OF_ORDER, PassOrderCounts, SORTING,
    SORTING_LOSS, SORTING_NETWORK, STAGE, WRONG_PIXELS,
};
use crate::mem::{BUSY_CYCLES, CLIENTS, ClientCounts, DRAM, DramCounts};
use crate::report::rows::{GEOMETRY, TILES};
use crate::sim::{CAPACITY, CHANNELS, ChannelCounts, Description, MEAN_OCCUPANCY, UNITS, UnitCounts};
use crate::stats::{Cycles, Declaration, FRAME, FrameCounts, Group, Heading, SECONDS, counter, page};
use crate::unit::network::{HOT_SPOT, HOTTEST_SHARE, LINKS, LinkCounts, MEAN_SHARE};
use crate::unit::sorting::{OrderCounts, SortCounts};
use crate::work::{FUNNEL, Funnel};

const fn one(name: &'static str, unit: &'static str, meaning: &'static str) -> Declaration {
    Declaration::new(name, unit, meaning)
}

const RUN: &[Declaration] = &[FrameCounts::DECLARATIONS[0], SECONDS];

/// What `stats.json` has around the statistics.
fn file() -> Vec<Declaration> {
    vec![
        one(
            "version",
            "",
            "Version of this format, a whole number. It rises when a name goes or changes its meaning; new names alone leave it.",
        ),
        one("fillrate", "", "Version of the program that wrote the file."),
        one("trace", "", "The trace, as it was named on the command line."),
        one("config", "", "The configuration, as it was named on the command line."),
        one(
            "changed_knobs",
            "",
            "Every knob that differs from that configuration, by its path: `from` is its value there, `to` its value in this run.",
        ),
        one("fidelity", "", "`functional`, `bound`, `sampled` or `cycle`."),
        one("total", "", "Statistics of the run: all frames together."),
        one("frames", "", "Statistics of each frame, in the order of the trace."),
    ]
}

const PHASE: &[Declaration] = &[
    one("kind", "", "`transfers` (uploads, copies and clears outside passes), `pass`, `dispatch` or `scan-out`."),
    one("number", "", "Number of the pass or dispatch in its frame, from 0; 0 elsewhere."),
    one("label", "", "Label of the pass, or of the dispatch's pipeline."),
    one(
        "limit",
        "",
        "With `--fidelity bound`, the unit that bounds it, or two that do in turn, where none works nearly all the time.",
    ),
    one("cycles", "cycles", "From its beginning to that of the next; together those of the frame."),
];

const DRAW: &[Declaration] = &[
    one("number", "", "Number of the draw in its frame, from 0; null: the end of the pass, behind its last draw."),
    one("label", "", "Label of its pipeline."),
    one(
        "site",
        "",
        "Where the command that draws was made: a call of an OpenGL recording, a line of a wgpu trace, a block of a capture, a command of a native trace.",
    ),
    one("group", "", "Label of the innermost debug group that it is in; in `draws.csv` those of all, the outermost first."),
    one("groups", "", "Labels of all debug groups that it is in, the outermost first, if there are several."),
    one("cycles", "cycles", "From the retirement before it to its own; together those of the pass."),
    GEOMETRY,
    TILES,
];

const NETWORK: &[Declaration] =
    &[LINKS, LinkCounts::DECLARATIONS[0], LinkCounts::DECLARATIONS[1], MEAN_SHARE, HOTTEST_SHARE, HOT_SPOT];

/// Places in the order of the page; others follow.
const ORDER: &[&str] = &[
    "",
    "funnel",
    "phases[i]",
    "phases[i].draws[i]",
    "units.NAME[i]",
    "channels.NAME[i]",
    "caches.NAME[i]",
    "memory.clients.NAME",
    "memory.dram",
    "memory.l2[i]",
    "rop.NAME[i]",
    "hierarchical.traverse[i]",
    "setup.setup[i]",
    "shading.core[i]",
    "shading.texture[i]",
    "sort",
    "sort.loss",
    "command",
    "binning",
    "early.early[i]",
    "hiding.hide[i]",
    "routing.route[i]",
    "composition.compose[i]",
    "sort.network",
];

/// Places in the statistics, what they are about, and what is declared there.
fn places() -> Vec<(&'static str, &'static str, Vec<Declaration>)> {
    let all = |own: &[Declaration], counted: &[Declaration]| {
        let mut list = counted.to_vec();
        list.extend(own.iter().filter(|d| counted.iter().all(|c| c.name != d.name)));
        list
    };
    let dram: Vec<Declaration> =
        DramCounts::DECLARATIONS.iter().copied().filter(|d| d.name != counter!(DramCounts, bus_cycles).name()).collect();
    let here = |heading: Heading, declared| (heading.path, heading.about, declared);
    let mut places = vec![
        here(FRAME, RUN.to_vec()),
        here(FUNNEL, Funnel::DECLARATIONS.to_vec()),
        (
            "phases[i]",
            "Of a frame: what is done one after another, in `stats.json` and `passes.csv`. Where it is simulated, each has `funnel` (passes only), `units.NAME`, `caches.NAME`, `shading.NAME`, `memory.clients.NAME` and `memory.dram` of its own cycles, banks summed; `starved` includes `idle`. `stats.json` leaves out what is 0, and units that only starved. Lines that stay in a cache are written back in a later phase.",
            PHASE.to_vec(),
        ),
        (
            "phases[i].draws[i]",
            "With `--per-draw`, of a pass: its draws in order, in `stats.json` and `draws.csv`, with the counters of phases. The funnel is the draw's own; the others count the cycles from the retirement before it to its own, in which later draws are in the machine too. A machine that bins retires draws together, when their tiles are drawn: there `cycles` are shared by work, and the end of the pass has all counters but the funnels.",
            DRAW.to_vec(),
        ),
        here(UNITS, all(Cycles::DECLARATIONS, UnitCounts::DECLARATIONS)),
        here(CHANNELS, all(&[MEAN_OCCUPANCY, CAPACITY], ChannelCounts::DECLARATIONS)),
        here(CLIENTS, ClientCounts::DECLARATIONS.to_vec()),
        here(DRAM, all(&[BUSY_CYCLES], &dram)),
        here(
            SORTING,
            all(
                &[CLASS, OVERLAP, LOAD_IMBALANCE, PASSES_OUT_OF_ORDER, WRONG_PIXELS],
                &[SortCounts::DECLARATIONS, OrderCounts::DECLARATIONS, PassOrderCounts::DECLARATIONS].concat(),
            ),
        ),
        here(SORTING_LOSS, all(&[STAGE, EFFICIENCY], LossCounts::DECLARATIONS)),
        here(SORTING_NETWORK, NETWORK.to_vec()),
    ];
    // What units count they say themselves.
    for Description { heading, declarations } in Parts::descriptions() {
        let counted = match places.iter_mut().find(|(path, ..)| *path == heading.path) {
            Some((_, _, counted)) => counted,
            None => {
                places.push((heading.path, heading.about, Vec::new()));
                &mut places.last_mut().expect("just pushed").2
            }
        };
        let more: Vec<_> = declarations.iter().filter(|&d| !counted.contains(d)).copied().collect();
        counted.extend(more);
    }
    places.sort_by_key(|(path, ..)| ORDER.iter().position(|known| known == path).unwrap_or(ORDER.len()));
    places
}

/// What the statistics are: places, and what is declared at each.
pub struct Glossary(Vec<(&'static str, &'static str, Vec<Declaration>)>);

impl Default for Glossary {
    fn default() -> Glossary {
        Glossary(places())
    }
}

impl Glossary {
    /// The declaration of a statistic, given by its path in `stats.json`, such as `units.setup[2].busy`, or by that in tables whose banks are
    /// summed, `units.setup.busy`.
    pub fn find(&self, path: &str) -> Option<&Declaration> {
        let (place, name) = path.rsplit_once('.').unwrap_or(("", path));
        // A path has the numbers of all its banks, or of none.
        let summed = !place.contains('[');
        let fits = |pattern: &str| {
            let mut steps = place.split('.').filter(|s| !s.is_empty());
            let mut wanted = pattern.split('.').filter(|s| !s.is_empty());
            loop {
                match (steps.next(), wanted.next()) {
                    (None, None) => break true,
                    (Some(step), Some(pattern)) => {
                        let (step, index) = step.split_once('[').map_or((step, false), |(step, _)| (step, true));
                        let (pattern, many) = pattern.strip_suffix("[i]").map_or((pattern, false), |pattern| (pattern, true));
                        if index != many && !summed || pattern != "NAME" && pattern != step {
                            break false;
                        }
                    }
                    _ => break false,
                }
            }
        };
        self.0.iter().filter(|(pattern, ..)| fits(pattern)).find_map(|(.., list)| list.iter().find(|d| d.name == name))
    }

    /// The path in tables that is meant by one that [`Glossary::find`] does not find.
    pub fn nearest(&self, path: &str) -> Option<String> {
        // A name that a configuration gives is taken from the path.
        let named =
            |(at, step): (usize, &str)| if step == "NAME" { path.split('.').nth(at).unwrap_or(step) } else { step }.to_owned();
        let path_of = |pattern: &str, name: &str| {
            let place = pattern.replace("[i]", "");
            place.split('.').filter(|step| !step.is_empty()).chain([name]).enumerate().map(named).collect::<Vec<_>>().join(".")
        };
        let paths: Vec<String> =
            self.0.iter().flat_map(|(pattern, _, list)| list.iter().map(move |d| path_of(pattern, d.name))).collect();
        num::nearest(paths.iter().map(String::as_str), path).map(str::to_owned)
    }
}

/// `docs/data/statistics.md`
pub fn statistics() -> String {
    let mut text = format!(
        "# Statistics\n\nGenerated from the declarations in the code; `cargo test --test program pages` checks it.\n\n\
         `stats.json` (this is version {VERSION} of it) holds `total` and, for each frame, an entry of `frames` with these names (and `frame`, its number). `stats.csv` \
         has a row for each frame and a column for each path, such as `units.setup[2].busy`. Functional runs have the funnel only.\n\n",
    );
    text.push_str(&page("stats.json", "The outermost names of the file, in their order.", &file()));
    text.push('\n');
    for (place, about, declarations) in places() {
        text.push_str(&page(if place.is_empty() { "(top)" } else { place }, about, &declarations));
        text.push('\n');
    }
    text.truncate(text.trim_end().len());
    text.push('\n');
    text
}

/// `docs/data/configuration.md`
///
/// # Errors
/// If the built-in baseline is wrong.
pub fn configuration() -> Result<String, ConfigError> {
    let mut text = String::from(
        "# Configuration\n\nGenerated from the declarations in the code; `cargo test --test program pages` checks it.\n\n\
         A configuration is RON with comments. `extends: \"baseline\"` takes every knob that is not named from there; an unknown key or \
         a value outside its range is an error. `--set fetch.cache_lines=512` sets one knob from the command line, \
         `fillrate configs NAME` prints a configuration with every knob. `--fidelity bound` refuses a value for which estimates do not \
         hold.\n\n",
    );
    text.push_str(&documentation(&Config::built_in("baseline")?));
    text.truncate(text.trim_end().len());
    text.push('\n');
    Ok(text)
}
