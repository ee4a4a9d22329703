//! Which knobs an estimate knows: a configuration with values that it does not know is refused by name.
//!
//! A knob is read by an estimate, or it is in one of two tables here (a test goes through all knobs). [`HELD`] has the knobs that change
//! cycles and that no estimate reads, with the values for which estimates hold. Each was set to both ends of its range on the baseline, and
//! on the class that has it, with `bound` and with `cycle` (`traces/viewer.zip`, `town.zip`, `layers`, `cube`, `particles`, `spokes-msaa`). Where the cycles
//! moved by more than 5 % and the estimate did not, values were halved or doubled until they did so: what lies before is held.
//! [`SLIGHT`] has those that moved nothing, or both alike.

use std::sync::LazyLock;

use anyhow::{Result, bail};
use knob::Setting;
use machine::Config;

/// The values of a knob for which estimates hold.
#[derive(Clone, Copy)]
enum Holds {
    /// One of these.
    Is(&'static [&'static str]),
    /// This number and larger ones.
    AtLeast(u64),
    /// This number and smaller ones.
    AtMost(u64),
}
use Holds::{AtLeast, AtMost, Is};

impl Holds {
    fn holds(self, setting: &Setting) -> bool {
        match (self, setting) {
            (Is(values), Setting::Name(name)) => values.contains(&name.as_str()),
            (Is(values), other) => values.contains(&other.to_string().as_str()),
            (AtLeast(least), Setting::Number(number)) => *number >= least,
            (AtMost(most), Setting::Number(number)) => *number <= most,
            (AtLeast(_) | AtMost(_), _) => false,
        }
    }

    /// As a message has it.
    fn text(self) -> String {
        match self {
            Is(values) => values.join(" or "),
            AtLeast(least) => format!("{least} or more"),
            AtMost(most) => format!("{most} or less"),
        }
    }
}

/// Knobs that change cycles and that no estimate reads: the values for which estimates hold, and what the others have that is not estimated.
const HELD: &[(&str, Holds, &str)] = &[
    ("assembly.deal", Is(&["round-robin", "least-loaded"]), "one run of a pass for each pipeline"),
    ("bin.cache_lines", AtLeast(32), "vertices that tiles read again"),
    ("bin.hide", Is(&["false"]), "quads that are held back"),
    ("bin.skip_same_tiles", Is(&["false"]), "tiles that are left out"),
    ("clip.cull_facing", Is(&["true"]), "triangles that are not drawn"),
    ("clip.cull_frustum", Is(&["true"]), "triangles that are not drawn"),
    ("clip.cull_no_sample", Is(&["true"]), "triangles that are not drawn"),
    ("clip.cull_scissor", Is(&["true"]), "triangles that are not drawn"),
    ("clip.queue", AtLeast(4), "short queues in geometry"),
    ("color.cache_sets", Is(&["hashed"]), "sets by position"),
    ("color.codec", Is(&["planes"]), "blocks compressed by references"),
    ("color.masked_writes", Is(&["false"]), "blocks that are written in part"),
    ("color.recompress", Is(&["true"]), "blocks that stay raw"),
    ("command.cull", Is(&["none"]), "tests of bounds"),
    ("command.drain", Is(&["false"]), "draws that wait for the one before"),
    ("command.state_cycles", AtMost(64), "changes of state"),
    ("command.states", AtLeast(4), "draws that wait for a free state"),
    ("core.execution", Is(&["longest"]), "the paths that quads take"),
    ("core.instructions", Is(&["scalar"]), "instructions on several components"),
    ("core.unified", Is(&["true"]), "cores for vertices alone"),
    ("depth.cache_sets", Is(&["hashed"]), "sets by position"),
    ("depth.codec", Is(&["planes"]), "blocks compressed by references"),
    ("depth.early", Is(&["true"]), "late tests of everything"),
    ("depth.pass_end", Is(&["write-back"]), "depths that stay in the cache"),
    ("depth.recompress", Is(&["true"]), "blocks that stay raw"),
    ("dispatch.output_queue", AtLeast(4), "short queues behind the cores"),
    ("fetch.announced", AtLeast(64), "short queues in front of assembly"),
    ("fetch.cache_lines", AtLeast(32), "misses of attributes"),
    ("fetch.deal", Is(&["round-robin"]), "vertices that are not dealt in turn"),
    ("fetch.line_bytes", Is(&["64"]), "longer lines of attributes"),
    ("fetch.misses", AtLeast(32), "waits for attributes"),
    ("fetch.patience", AtMost(64), "vertices that wait for a full warp"),
    ("fetch.runs", AtLeast(32), "draws whose indices are not asked for ahead"),
    ("fetch.batch_indices", Is(&["96"]), "other batches of vertices"),
    ("fetch.reuse_until", Is(&["batch", "replaced"]), "vertices that are kept for their last index"),
    ("fetch.skip_attributes", Is(&["true"]), "attributes that no vertex shader reads"),
    ("fetch.vertices_per_cycle", Is(&["0"]), "a rate of vertices to the cores"),
    ("memory.dram.banks", AtLeast(8), "conflicts of banks"),
    ("memory.dram.page", Is(&["open"]), "rows that are closed early"),
    ("memory.dram.refresh", Is(&["all-banks"]), "refreshes of single banks"),
    ("memory.dram.t_ccd_l", AtMost(3), "bursts of bank groups"),
    ("memory.dram.t_faw", AtMost(56), "a limit on activations"),
    ("memory.dram.t_ras", AtMost(126), "rows that stay open"),
    ("memory.dram.t_rp", AtMost(72), "misses of rows"),
    ("memory.dram.t_rrd", AtMost(14), "a limit on activations"),
    ("memory.dram.t_rtp", AtMost(64), "misses of rows"),
    ("memory.dram.t_wr", AtMost(72), "misses of rows"),
    ("memory.l2.cached", Is(&["true"]), "memory without a second-level cache"),
    ("memory.l2.entries", AtLeast(4), "waits of the second-level cache"),
    ("memory.l2.interleave", AtMost(16384), "slices and channels with unequal load"),
    ("memory.l2.misses", AtLeast(8), "waits of the second-level cache"),
    ("memory.l2.waiting", AtLeast(8), "waits of the second-level cache"),
    ("memory.port_queue", AtLeast(128), "ports that carry less than a request per cycle"),
    ("order.early", Is(&["none"]), "early tests of quads that others own"),
    ("order.keep", Is(&["always", "never"]), "quads in any order"),
    ("resolve.misses", AtLeast(64), "resolves with few requests in flight"),
    ("route.fifo", AtLeast(32), "waits of routing for vertices"),
    ("route.latency", AtMost(96), "waits of routing for vertices"),
    ("route.misses", AtLeast(8), "waits of routing for vertices"),
    ("route.mode", Is(&["retained"]), "vertices that are sent"),
    ("route.reuse", AtLeast(4), "vertices that are transformed again"),
    ("scanout.compressed", Is(&["false"]), "compressed scan-out"),
    ("scanout.swap", Is(&["immediate"]), "frames that wait for a display or are copied to it"),
    ("texture.line_bytes", Is(&["64", "128"]), "longer lines of textures"),
    ("texture.sector_bytes", Is(&["32", "64"]), "longer lines of textures"),
    ("traverse.gather", Is(&["false"]), "triangles that wait for others"),
    ("traverse.hierarchical_latency", AtMost(64), "waits for hierarchical Z"),
    ("traverse.hierarchical_lines", Is(&["0"]), "bounds behind a cache"),
    ("traverse.hierarchical_test", Is(&["block"]), "quads that hierarchical Z rejects"),
    ("traverse.walk", Is(&["blocks"]), "walks that test single pixels"),
];

/// Knobs that no estimate reads by name, and on which cycles hardly depend: by at most 5 % at both ends of their ranges, or as much as the
/// estimate. Some act on what is rendered, or through a unit that the estimate asks.
#[cfg(test)]
const SLIGHT: &[&str] = &[
    "bin.compression",
    "bin.memory_kib",
    "bin.overlap",
    "bin.segments",
    "clock_mhz",
    "color.blend_full",
    "color.blend_halves",
    "color.blend_packed",
    "color.blend_pair",
    "color.blend_single",
    "color.clears_per_cycle",
    "color.samples",
    "color.write_128",
    "color.write_64",
    "command.async_compute",
    "command.cull_cycles",
    "command.overlap",
    "command.workgroup_runs",
    "compute.latency",
    "compute.queue",
    "compute.warps_per_cycle",
    "constant.bytes",
    "constant.fifo",
    "constant.line_bytes",
    "constant.misses",
    "constant.queue",
    "constant.second_bytes",
    "constant.second_latency",
    "constant.second_line_bytes",
    "constant.second_ways",
    "constant.ways",
    "core.output_queue",
    "core.scheduling",
    "core.shared_bytes",
    "core.vertex_cores",
    "core.vertex_issue",
    "core.vertex_warps",
    "dispatch.patience",
    "dispatch.queue",
    "distribute.overlap",
    "fetch.ahead",
    "fetch.cache_ways",
    "fetch.deal_warps",
    "fetch.queue",
    "interpolate.skip_varyings",
    "memory.dram.bank_groups",
    "memory.dram.hash_banks",
    "memory.dram.page_idle",
    "memory.dram.row_bytes",
    "memory.dram.window",
    "memory.dram.write_queue",
    "memory.l2.sector_bytes",
    "memory.tlb.entries",
    "memory.tlb.page_bytes",
    "memory.tlb.queue",
    "memory.tlb.second_entries",
    "memory.tlb.second_latency",
    "memory.tlb.second_page_bytes",
    "memory.tlb.walk_latency",
    "network.arbitration",
    "network.credit_latency",
    "network.queue",
    "network.radix",
    "order.early_bytes",
    "order.early_latency",
    "order.early_queue",
    "resolve.block_cycles",
    "route.cache_lines",
    "route.cache_ways",
    "scanout.fifo",
    "scanout.show_last",
    "texture.filter_full",
    "texture.filter_halves",
    "texture.filter_pair",
    "texture.filter_single",
    "texture.load_full",
    "texture.queue",
    "texture.skip_levels",
    "traverse.hierarchical_accept",
    "traverse.hierarchical_queue",
    "traverse.hierarchical_update",
    "traverse.pixel_tests_per_cycle",
    "traverse.triangles",
    "watchdog",
];

/// The built-in configurations on which errors are measured (`docs/data/fidelity.md`) although they have values beyond those of [`HELD`].
static MEASURED: LazyLock<[Config; 1]> = LazyLock::new(|| [Config::built_in("tiny").expect("it is built in")]);

/// The value of a knob; none where it has no effect.
fn value(config: &Config, path: &str) -> Option<Setting> {
    let (_, setting) = config.knob("", path).expect("a knob of the table");
    config.no_effect(path).is_none().then_some(setting)
}

/// Checks that estimates hold for a configuration. They do if all of its knobs have values for which estimates are known to hold, or if all
/// knobs that no estimate reads have the values of a configuration on which the errors are measured.
///
/// # Errors
/// The first knob that has another value.
pub(super) fn check(config: &Config) -> Result<()> {
    let other = HELD.iter().find_map(|(path, holds, what)| {
        let setting = value(config, path).filter(|setting| !holds.holds(setting))?;
        Some((path, setting, holds.text(), what))
    });
    let Some((path, setting, known, what)) = other else { return Ok(()) };
    let same = |measured: &Config| HELD.iter().all(|(path, ..)| value(config, path) == value(measured, path));
    if MEASURED.iter().any(same) {
        return Ok(());
    }
    bail!(
        "{path} is {setting}, and estimates of the bound fidelity hold where it is {known}: they know nothing of {what}; use \
         --fidelity cycle"
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    /// All knobs of configurations.
    fn knobs() -> Vec<String> {
        let config = Config::built_in("four-pipelines").expect("it is built in");
        let of = |(section, knobs): (&str, &dyn knob::Section)| -> Vec<String> {
            let path =
                |knob: &knob::Knob| if section.is_empty() { knob.name.to_owned() } else { format!("{section}.{}", knob.name) };
            knobs.knobs().iter().map(path).collect()
        };
        config.sections().into_iter().flat_map(of).collect()
    }

    /// The sources of the estimates.
    fn sources() -> String {
        let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/src/bound");
        let files = std::fs::read_dir(folder).expect("the folder of this file");
        let files = files.map(|file| file.expect("a file").path()).filter(|path| path.file_name() != Some("known.rs".as_ref()));
        files.map(|path| std::fs::read_to_string(path).expect("a source")).collect()
    }

    #[test]
    fn every_knob_is_read_or_known_to_be_unread() {
        let sources = sources();
        let knobs = knobs();
        for path in &knobs {
            // `config.fetch.reuse`, `self.config.dram.channels`, or a section that has a name of its own.
            let (section, name) = path.rsplit_once('.').unwrap_or(("card", path));
            let field = format!("{}.{name}", section.rsplit('.').next().expect("a name"));
            let word = |at: usize, c: &str| {
                let before = sources[..at].chars().next_back().is_some_and(|c| c.is_alphanumeric() || c == '_');
                let after = sources[at + c.len()..].chars().next().is_some_and(|c| c.is_alphanumeric() || c == '_');
                !before && !after
            };
            let read = sources.match_indices(&field).any(|(at, field)| word(at, field));
            let held = HELD.iter().any(|(held, ..)| held == path);
            let slight = SLIGHT.contains(&path.as_str());
            // A knob that is held may be read for the values for which estimates hold.
            let once = if held { !slight } else { read != slight };
            assert!(
                once,
                "{path}: the estimates read {field}: {read}; in HELD: {held}, in SLIGHT: {slight}; one of these must be so"
            );
        }
        let all = HELD.iter().map(|(path, ..)| *path).chain(SLIGHT.iter().copied());
        for path in all {
            assert!(knobs.iter().any(|knob| knob == path), "there is no knob {path}");
        }
    }

    #[test]
    fn the_values_of_the_classes_and_of_tiny_are_known_and_no_others() {
        let with = |name: &str, changes: &[&str]| {
            let mut config = Config::built_in(name).expect("it is built in");
            changes.iter().for_each(|change| config.set(change).expect("a knob"));
            check(&config).map_err(|error| error.to_string())
        };
        for name in [
            "four-pipelines",
            "wide",
            "gtx-titan",
            "tiny",
            "sort-first",
            "sort-middle-binned",
            "sort-last-fragment",
            "sort-last-image",
        ] {
            assert_eq!(with(name, &[]), Ok(()), "{name}");
        }
        for name in ["attila", "geforce2-ultra"] {
            with(name, &[]).expect_err(name);
        }
        // Estimates hold for `tiny` as a whole, but are not known to hold for its values one by one.
        for change in ["fetch.misses=8", "fetch.cache_lines=16"] {
            with("four-pipelines", &[change]).expect_err(change);
        }
        assert_eq!(
            with("four-pipelines", &["memory.dram.t_faw=400"]),
            Err("memory.dram.t_faw is 400, and estimates of the bound fidelity hold where it is 56 or less: they know nothing of a limit \
                 on activations; use --fidelity cycle"
                .to_owned())
        );
        // Knobs without effect are not checked.
        assert_eq!(
            with("four-pipelines", &["memory.dram.t_faw=400", "memory.kind=ideal", "route.mode=immediate", "bin.hide=true"]),
            Ok(())
        );
        with("sort-first", &["route.mode=immediate"]).expect_err("it has an effect");
    }
}
