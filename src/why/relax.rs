//! Relaxations: changes of a configuration that give a frame more of one resource.
//!
//! Most are found from the declarations of the knobs: what a knob counts says whether it is a rate, room for what is in flight, a cache or
//! a latency. A new unit's knobs take part without a word here.

use crate::knob::{Knob, Setting, Value};
use crate::machine::Config;
use crate::machine::config::MemoryKind;
use crate::unit::interleave::Pattern;

/// A change that gives a frame more of one resource.
#[derive(Clone, Debug, PartialEq)]
pub struct Relaxation {
    /// What it changes, in words.
    pub title: String,
    /// The section of the configuration whose unit it is about; empty where it is about several.
    pub section: &'static str,
    /// The resource.
    pub resource: Resource,
    /// The knobs, with their new values.
    pub changes: Vec<(String, Setting)>,
}

/// Changes that give more of several resources at once: a core brings a texture unit and caches, a pipeline all of its units.
const SEVERAL: &[&str] = &["core.per_pipeline", "pipelines", "geometry_units"];

/// What there is more of.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Resource {
    /// Items per cycle.
    Rate,
    /// Room for items in flight: queues and misses.
    Room,
    /// Cache.
    Cache,
    /// Units.
    Units,
    /// Speed of answers of memory.
    MemoryLatency,
    /// Bytes per cycle of memory.
    MemoryBandwidth,
    /// Shorter pipelines of units.
    Latency,
    /// Work that is left out.
    Skip,
    /// How evenly the screen is dealt to pipelines.
    Balance,
}

impl Relaxation {
    /// The machine with the change; none where it breaks a rule between knobs.
    pub fn of(&self, base: &Config) -> Option<Config> {
        let mut config = base.clone();
        for (path, setting) in &self.changes {
            config.put("a relaxation", path, setting).ok()?;
        }
        config.check().is_ok().then_some(config)
    }

    /// The changes as `--set` takes them.
    fn settings(&self) -> impl Iterator<Item = String> {
        self.changes.iter().map(|(path, setting)| match setting {
            Setting::Name(name) => format!("{path}={name}"),
            other => format!("{path}={other}"),
        })
    }

    /// The change as the options of a replay.
    pub fn options(&self) -> String {
        self.settings().map(|setting| format!("--set {setting}")).collect::<Vec<_>>().join(" ")
    }

    /// Whether the change gives more of several resources at once, so that it does not name one.
    pub fn is_broad(&self) -> bool {
        self.changes.iter().any(|(path, _)| SEVERAL.contains(&path.as_str()))
    }

    /// Whether the change is one of scan-out.
    pub fn is_of_scan_out(&self) -> bool {
        self.section == "scanout"
    }

    /// The knob and its value, where the change is one of a single knob.
    pub fn knob(&self) -> Option<String> {
        self.settings().next().filter(|_| self.changes.len() == 1)
    }
}

/// Skips that can be switched on, and what they leave out.
const SKIPS: &[(&str, &str, &str)] = &[
    ("depth.early", "true", "early Z"),
    ("traverse.hierarchical_z", "true", "hierarchical Z"),
    ("traverse.hierarchical_accept", "true", "acceptance by hierarchical Z"),
    ("color.compression", "true", "compressed colours"),
    ("depth.compression", "true", "compressed depths"),
    ("color.fast_clear", "true", "fast clears"),
    ("color.skip_reads", "true", "no reads of blocks that are overwritten whole"),
    ("color.masked_writes", "true", "blocks written in part, without reads"),
    ("command.overlap", "true", "passes and copies beside each other"),
    ("command.async_compute", "true", "dispatches beside passes"),
    ("command.skip_empty_passes", "true", "empty passes left out"),
    ("command.cull", "draws", "draws culled by their bounds"),
    ("command.cull", "instances", "draws and instances culled by their bounds"),
    ("fetch.skip_attributes", "true", "only attributes that are read"),
    ("interpolate.skip_varyings", "true", "only varyings that are read"),
    ("texture.skip_levels", "true", "only levels that have a weight"),
    ("clip.cull_facing", "true", "triangles that face away culled early"),
    ("clip.cull_frustum", "true", "primitives out of view culled early"),
    ("clip.cull_scissor", "true", "scissored primitives culled early"),
    ("clip.cull_no_sample", "true", "triangles between samples culled early"),
    ("distribute.overlap", "exact", "triangles sent to exactly those that draw them"),
    ("bin.overlap", "exact", "triangles binned exactly"),
    ("bin.compression", "true", "compressed bins"),
    ("bin.hide", "true", "hidden surfaces removed by tiles"),
    ("bin.skip_same_tiles", "true", "unchanged tiles not drawn"),
    ("compose.compression", "true", "compressed composition"),
    ("scanout.compressed", "true", "compressed scan-out"),
    ("scanout.enabled", "false", "no scan-out"),
];

/// How many times as large a cache is that is taken for perfect.
const PERFECT: u64 = 64;

/// Sections that are about memory, not about a unit of the pipeline.
fn is_memory(section: &str) -> bool {
    section.starts_with("memory")
}

/// Whether a knob is a rate that is better when it is higher.
fn is_rate(knob: &Knob) -> bool {
    knob.unit.ends_with("/cycle") || knob.unit == "lanes"
}

/// Whether a knob is the time of one item, better when it is lower.
fn is_interval(section: &str, knob: &Knob) -> bool {
    knob.unit.starts_with("cycles/") || (section, knob.name) == ("setup", "interval")
}

/// Whether a knob is room for what is in flight.
fn is_room(knob: &Knob) -> bool {
    const NAMES: &[&str] = &[
        "misses",
        "copy_misses",
        "waiting",
        "entries",
        "batches",
        "segments",
        "workgroup_runs",
        "index_lines",
        "reorder",
        "warps",
        "vertex_warps",
        "registers",
    ];
    NAMES.contains(&knob.name) || knob.name.ends_with("queue") || knob.name.ends_with("fifo")
}

/// Whether a knob is the size of a cache.
fn is_cache(section: &str, knob: &Knob) -> bool {
    matches!(knob.name, "cache_lines" | "cache_blocks" | "reuse") || (section, knob.name) == ("memory.l2", "lines")
}

/// Whether a knob is the latency of a unit of the pipeline.
fn is_latency(section: &str, knob: &Knob) -> bool {
    !is_memory(section) && knob.unit == "cycles" && (knob.name == "latency" || knob.name.ends_with("_latency"))
}

/// Whether a knob is part of the latency of memory.
fn is_memory_latency(section: &str, knob: &Knob) -> bool {
    match section {
        "memory" => knob.name.ends_with("latency"),
        "memory.l2" => knob.name == "latency",
        "memory.dram" => {
            knob.unit == "DRAM cycles" && !matches!(knob.name, "burst_cycles" | "t_ccd_l" | "page_idle" | "t_rfc" | "t_refi")
                || knob.name == "latency"
        }
        _ => false,
    }
}

struct Finder<'c> {
    base: &'c Config,
    found: Vec<Relaxation>,
}

impl Finder<'_> {
    /// A knob's value times `factor`, or as near to it as the knob allows; none where that is the value that it has.
    fn times(&self, path: &str, knob: &Knob, factor: u64) -> Option<Setting> {
        let (_, Setting::Number(value)) = self.base.knob("a relaxation", path).ok()? else { return None };
        let mut factor = factor;
        while factor > 1 {
            let setting = Setting::Number(value.checked_mul(factor)?);
            if knob.allowed.admits(&setting) && value > 0 {
                return Some(setting);
            }
            factor /= 2;
        }
        None
    }

    /// Half of a knob's value, rounded up; none where that is the value that it has.
    fn half(&self, path: &str, knob: &Knob) -> Option<Setting> {
        let (_, Setting::Number(value)) = self.base.knob("a relaxation", path).ok()? else { return None };
        let setting = Setting::Number(value.div_ceil(2));
        (value > 1 && knob.allowed.admits(&setting)).then_some(setting)
    }

    /// Adds a relaxation of knobs that are chosen by section and declaration, each changed by `change`; none are no relaxation.
    fn add(
        &mut self,
        title: String,
        section: &'static str,
        resource: Resource,
        change: impl Fn(&Self, &str, &str, &Knob) -> Option<Setting>,
    ) {
        let mut changes = Vec::new();
        for (own, knobs) in self.base.sections() {
            for knob in knobs.knobs() {
                let path = if own.is_empty() { knob.name.to_owned() } else { format!("{own}.{}", knob.name) };
                if let Some(setting) = change(self, own, &path, knob) {
                    changes.push((path, setting));
                }
            }
        }
        if !changes.is_empty() {
            self.found.push(Relaxation { title, section, resource, changes });
        }
    }

    /// Adds other ways to deal the screen to pipelines: smaller tiles, and every other pattern.
    fn balance(&mut self) {
        if self.base.card.pipelines == 1 {
            return;
        }
        for (parts, size) in [(2, "half"), (8, "an eighth")] {
            let title = format!("screen tiles {size} as wide");
            self.add(title, "distribute", Resource::Balance, |finder, _, path, knob| {
                let setting = Setting::Number(u64::from(finder.base.distribute.tile) / parts);
                (path == "distribute.tile" && knob.allowed.admits(&setting)).then_some(setting)
            });
        }
        let now = self.base.distribute.pattern.to_setting();
        for name in Pattern::NAMES {
            let setting = Setting::Name((*name).into());
            let title = format!("screen tiles dealt in the pattern {name}");
            self.add(title, "distribute", Resource::Balance, |_, _, path, _| {
                (path == "distribute.pattern" && setting != now).then(|| setting.clone())
            });
        }
    }
}

/// All relaxations of a configuration. `has` says whether the machine has units of a bank.
pub fn relaxations(base: &Config, has: &dyn Fn(&str) -> bool) -> Vec<Relaxation> {
    let mut finder = Finder { base, found: Vec::new() };
    let absent = |section: &str| matches!(section, "bin" | "route" | "compose" | "distribute") && !has(section);
    for (section, _) in base.sections() {
        if section.is_empty() || is_memory(section) || absent(section) {
            continue;
        }
        finder.add(format!("{section}: twice as fast"), section, Resource::Rate, |finder, own, path, knob| match () {
            () if own != section => None,
            () if is_rate(knob) => finder.times(path, knob, 2),
            () if is_interval(own, knob) => finder.half(path, knob),
            () => None,
        });
        finder.add(format!("{section}: twice as much in flight"), section, Resource::Room, |finder, own, path, knob| {
            if own == section && is_room(knob) { finder.times(path, knob, 2) } else { None }
        });
    }
    for (section, _) in base.sections() {
        if absent(section) {
            continue;
        }
        for (title, factor) in [("twice as large a cache", 2), ("a cache that is never full", PERFECT)] {
            finder.add(format!("{section}: {title}"), section, Resource::Cache, |finder, own, path, knob| {
                if own == section && is_cache(own, knob) { finder.times(path, knob, factor) } else { None }
            });
        }
    }
    let units = [
        ("core.per_pipeline", "core", "twice the cores, each with its texture unit"),
        ("geometry_units", "", "twice the geometry units"),
        ("pipelines", "", "twice the pipelines"),
    ];
    for (path, section, title) in units {
        finder.add(
            title.into(),
            section,
            Resource::Units,
            |finder, _, own, knob| {
                if own == path { finder.times(own, knob, 2) } else { None }
            },
        );
    }
    finder.balance();
    finder.add("half the latency of all units".into(), "", Resource::Latency, |finder, own, path, knob| {
        if is_latency(own, knob) { finder.half(path, knob) } else { None }
    });
    finder.add("command: barriers half as long".into(), "command", Resource::Latency, |finder, _, path, knob| {
        if path == "command.barrier_cycles" { finder.half(path, knob) } else { None }
    });
    finder.add("half the memory latency".into(), "memory", Resource::MemoryLatency, |finder, own, path, knob| {
        // Of DRAM and the ideal memory the machine has one.
        let other = match own {
            "memory.dram" | "memory.l2" => finder.base.memory.kind == MemoryKind::Ideal,
            _ => knob.name == "ideal_latency" && finder.base.memory.kind != MemoryKind::Ideal,
        };
        if is_memory_latency(own, knob) && !other { finder.half(path, knob) } else { None }
    });
    // Bursts that take one cycle cannot be shorter: twice the channels then.
    let (wide, ideal) = (base.dram.burst_cycles == 1, base.memory.kind == MemoryKind::Ideal);
    finder.add("twice the memory bandwidth".into(), "memory", Resource::MemoryBandwidth, |finder, _, path, knob| match path {
        "memory.dram.burst_cycles" | "memory.dram.t_ccd_l" if !ideal && !wide => finder.half(path, knob),
        "memory.dram.channels" | "memory.l2.slices" if !ideal && wide => finder.times(path, knob, 2),
        "memory.ideal_bytes_per_cycle" if ideal => finder.times(path, knob, 2),
        _ => None,
    });
    finder.add(
        "memory: twice as wide ports and slices".into(),
        "memory",
        Resource::MemoryBandwidth,
        |finder, _, path, knob| match path {
            "memory.port_width" | "memory.l2.width" | "memory.l2.lookups_per_cycle" => finder.times(path, knob, 2),
            _ => None,
        },
    );
    finder.add("memory: twice as many requests in flight".into(), "memory", Resource::Room, |finder, own, path, knob| {
        if is_memory(own) && is_room(knob) { finder.times(path, knob, 2) } else { None }
    });
    for (path, value, title) in SKIPS {
        let section = path.split_once('.').map_or("", |(section, _)| section);
        if absent(section) {
            continue;
        }
        let value = match *value {
            "true" => Setting::Switch(true),
            "false" => Setting::Switch(false),
            name => Setting::Name(name.into()),
        };
        finder.add((*title).into(), section, Resource::Skip, |finder, _, own, _| {
            let differs = || finder.base.knob("a relaxation", own).is_ok_and(|(_, now)| now != value);
            (own == *path && differs()).then(|| value.clone())
        });
    }
    finder.found
}

#[cfg(test)]
mod tests {
    use super::*;

    fn all(config: &Config) -> Vec<Relaxation> {
        relaxations(config, &|bank| !matches!(bank, "bin" | "route" | "compose"))
    }

    fn options(list: &[Relaxation], title: &str) -> String {
        list.iter().find(|relaxation| relaxation.title == title).map_or(String::new(), Relaxation::options)
    }

    #[test]
    fn the_baselines_relaxations_are_machines() {
        let base = Config::built_in("four-pipelines").expect("it is built in");
        let list = all(&base);
        assert_eq!(
            options(&list, "traverse: twice as fast"),
            "--set traverse.blocks_per_cycle=2 --set traverse.tests_per_cycle=8 --set traverse.pixel_tests_per_cycle=512 \
             --set traverse.quads_per_cycle=8 --set traverse.depth_quads_per_cycle=16"
        );
        assert_eq!(options(&list, "texture: twice as large a cache"), "--set texture.cache_lines=512");
        assert_eq!(options(&list, "twice the cores, each with its texture unit"), "--set core.per_pipeline=2");
        assert_eq!(
            options(&list, "twice the memory bandwidth"),
            "--set memory.dram.burst_cycles=1 --set memory.dram.t_ccd_l=2"
        );
        assert!(options(&list, "half the memory latency").starts_with(
            "--set memory.port_latency=23 --set memory.rop_latency=2 --set memory.l2.latency=28 --set memory.dram.latency=30 \
                 --set memory.dram.t_rcd=9"
        ));
        assert_eq!(options(&list, "draws culled by their bounds"), "--set command.cull=draws");
        assert_eq!(options(&list, "screen tiles an eighth as wide"), "--set distribute.tile=8");
        assert_eq!(options(&list, "screen tiles dealt in the pattern morton"), "--set distribute.pattern=morton");
        assert_eq!(options(&list, "twice the pipelines"), "--set pipelines=8");
        // What the baseline has already is none.
        assert_eq!(options(&list, "screen tiles dealt in the pattern skewed"), "");
        assert_eq!(options(&list, "early Z"), "");
        assert!(list.len() > 40, "{}", list.len());
        let broken: Vec<&str> = list.iter().filter(|own| own.of(&base).is_none()).map(|own| own.title.as_str()).collect();
        assert!(broken.is_empty(), "{broken:?}");
        assert!(list.iter().all(|own| own.of(&base).is_some_and(|config| config != base)));
    }

    #[test]
    fn sections_without_units_are_left_out_and_limits_of_knobs_are_kept() {
        let mut base = Config::built_in("four-pipelines").expect("it is built in");
        base.traverse.blocks_per_cycle = 8;
        base.dram.burst_cycles = 1;
        let list = all(&base);
        assert!(list.iter().all(|own| own.section != "bin" && own.section != "route"));
        assert!(!options(&list, "traverse: twice as fast").contains("blocks_per_cycle"));
        assert!(options(&list, "twice the memory bandwidth").contains("memory.dram.channels=8"));
    }
}
