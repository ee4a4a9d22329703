//! Relaxations: changes of a configuration that give a frame more of one resource.
//!
//! The declaration of a knob says whether it is a rate, room for what is in flight, a cache or a latency ([`Relax`]). A new unit's knobs take
//! part without a word here.

use crate::knob::{Allowed, Knob, Relax, Setting};
use crate::machine::Config;
use crate::machine::config::MemoryKind;

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
    pub fn settings(&self) -> impl Iterator<Item = String> {
        self.changes.iter().map(|(path, setting)| match setting {
            Setting::Name(name) => format!("{path}={name}"),
            other => format!("{path}={other}"),
        })
    }

    /// The change as the options of a replay.
    pub fn options(&self) -> String {
        self.settings().map(|setting| format!("--set {setting}")).collect::<Vec<_>>().join(" ")
    }

    /// Eight times as much where this gives twice as much; none where the knobs do not allow more than this.
    pub fn eightfold(&self, base: &Config) -> Option<Relaxation> {
        let finder = Finder { base, found: Vec::new() };
        let more = |(path, setting): &(String, Setting)| {
            let (knob, _) = base.knob("a relaxation", path).ok()?;
            Some((path.clone(), finder.times(path, knob, 8).unwrap_or_else(|| setting.clone())))
        };
        let changes: Vec<(String, Setting)> = self.changes.iter().map(more).collect::<Option<_>>()?;
        let title = self.title.replace("twice", "eight times");
        (changes != self.changes).then(|| Relaxation { title, changes, ..self.clone() })
    }

    /// Whether the change gives more of several resources at once, so that it does not name one: a core brings a texture unit and caches, a
    /// pipeline all of its units.
    pub fn is_broad(&self) -> bool {
        self.resource == Resource::Units
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

/// How many times as large a cache is that is taken for perfect.
const PERFECT: u64 = 64;

/// Whether a section, or the knob of a path, is about memory and not about a unit of the pipeline.
fn is_memory(path: &str) -> bool {
    path.starts_with("memory")
}

/// Whether the knob of a path is one of a section, and not of a section within it.
fn is_of(section: &str, path: &str) -> bool {
    path.rsplit_once('.').map_or("", |(own, _)| own) == section
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

    /// Adds a relaxation of all knobs that `change` changes, by path and declaration. Without a change there is no relaxation.
    fn add(
        &mut self,
        title: String,
        section: &'static str,
        resource: Resource,
        change: impl Fn(&Self, &str, &Knob) -> Option<Setting>,
    ) {
        let changed = |(path, knob): (String, &Knob)| change(self, &path, knob).map(|setting| (path, setting));
        let changes: Vec<(String, Setting)> = self.base.knobs().filter_map(changed).collect();
        if !changes.is_empty() {
            self.found.push(Relaxation { title, section, resource, changes });
        }
    }

    /// Adds the relaxations that change one knob alone.
    fn add_single(&mut self, section: &'static str, path: String, knob: &Knob) {
        let Ok((_, now)) = self.base.knob("a relaxation", &path) else { return };
        let (resource, tried) = match knob.relax {
            Relax::Units(title) => (Resource::Units, vec![(title.to_owned(), self.times(&path, knob, 2))]),
            Relax::Wait(title) => (Resource::Latency, vec![(title.to_owned(), self.half(&path, knob))]),
            // A single pipeline gets all of the work, however it is dealt.
            Relax::Parts(_) | Relax::Each(_) if self.base.card.pipelines == 1 => return,
            Relax::Parts(parts) => {
                let part = |by| if let Setting::Number(size) = now { Some(Setting::Number(size / by)) } else { None };
                let divided = |(by, text)| (format!("{parts} {text} as wide"), part(by));
                (Resource::Balance, [(2, "half"), (8, "an eighth")].map(divided).to_vec())
            }
            Relax::Each(title) => {
                let names = if let Allowed::Choice(names) = knob.allowed { names } else { &[] };
                let named = |&name: &&str| (format!("{title} {name}"), Some(Setting::from(name)));
                (Resource::Balance, names.iter().map(named).collect())
            }
            Relax::Skip(values) => {
                let switched = |&(value, title): &(&str, &str)| (title.to_owned(), Some(Setting::from(value)));
                (Resource::Skip, values.iter().map(switched).collect())
            }
            Relax::Never | Relax::Rate | Relax::Interval | Relax::Room | Relax::Cache | Relax::Latency | Relax::Bandwidth => {
                return;
            }
        };
        for (title, setting) in tried {
            if let Some(setting) = setting.filter(|setting| *setting != now && knob.allowed.admits(setting)) {
                self.found.push(Relaxation { title, section, resource, changes: vec![(path.clone(), setting)] });
            }
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
        finder.add(format!("{section}: twice as fast"), section, Resource::Rate, |finder, path, knob| match knob.relax {
            Relax::Rate if is_of(section, path) => finder.times(path, knob, 2),
            Relax::Interval if is_of(section, path) => finder.half(path, knob),
            _ => None,
        });
        finder.add(format!("{section}: twice as much in flight"), section, Resource::Room, |finder, path, knob| {
            if knob.relax == Relax::Room && is_of(section, path) { finder.times(path, knob, 2) } else { None }
        });
    }
    for (section, _) in base.sections() {
        if absent(section) {
            continue;
        }
        for (title, factor) in [("twice as large a cache", 2), ("a cache that is never full", PERFECT)] {
            finder.add(format!("{section}: {title}"), section, Resource::Cache, |finder, path, knob| {
                if knob.relax == Relax::Cache && is_of(section, path) { finder.times(path, knob, factor) } else { None }
            });
        }
    }
    let larger = "cores alone twice as large: lanes, issue, warps and registers";
    finder.add(larger.into(), "core", Resource::Units, |finder, path, knob| {
        let own = is_of("core", path) && matches!(knob.relax, Relax::Rate | Relax::Room);
        if own { finder.times(path, knob, 2) } else { None }
    });
    finder.add("half the latency of all units".into(), "", Resource::Latency, |finder, path, knob| {
        if knob.relax == Relax::Latency && !is_memory(path) { finder.half(path, knob) } else { None }
    });
    // Of DRAM and the ideal memory the machine has one, and the other's knobs have no effect.
    let acts = |path: &str| base.no_effect(path).is_none();
    finder.add("half the memory latency".into(), "memory", Resource::MemoryLatency, |finder, path, knob| {
        if knob.relax == Relax::Latency && is_memory(path) && acts(path) { finder.half(path, knob) } else { None }
    });
    // Bursts that take one cycle cannot be shorter: twice the channels then.
    let bursts = base.memory.kind == MemoryKind::Dram && base.dram.burst_cycles > 1;
    finder.add("twice the memory bandwidth".into(), "memory", Resource::MemoryBandwidth, |finder, path, knob| {
        match knob.relax {
            Relax::Interval if is_memory(path) && bursts => finder.half(path, knob),
            Relax::Bandwidth if !bursts && acts(path) => finder.times(path, knob, 2),
            _ => None,
        }
    });
    finder.add("memory: twice as wide ports and slices".into(), "memory", Resource::MemoryBandwidth, |finder, path, knob| {
        if knob.relax == Relax::Rate && is_memory(path) { finder.times(path, knob, 2) } else { None }
    });
    finder.add("memory: twice as many requests in flight".into(), "memory", Resource::Room, |finder, path, knob| {
        if knob.relax == Relax::Room && is_memory(path) { finder.times(path, knob, 2) } else { None }
    });
    for (section, knobs) in base.sections() {
        for knob in knobs.knobs() {
            // The screen is dealt in tiles without a bank of this name, too.
            if !absent(section) || !matches!(knob.relax, Relax::Skip(_)) {
                finder.add_single(section, knob.path(section), knob);
            }
        }
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
        assert_eq!(options(&list, "twice the cores, texture units and texture caches"), "--set core.per_pipeline=2");
        let alone = options(&list, "cores alone twice as large: lanes, issue, warps and registers");
        assert!(alone.contains("core.issue=") && alone.contains("core.registers=") && !alone.contains("texture"), "{alone}");
        // What is full at twice is tried at eight times.
        let twice = list.iter().find(|own| own.title == "texture: twice as much in flight").expect("a change");
        let eight = twice.eightfold(&base).expect("more");
        assert_eq!(eight.title, "texture: eight times as much in flight");
        assert!(eight.of(&base).is_some() && eight.changes.iter().zip(&twice.changes).all(|(eight, twice)| eight.0 == twice.0));
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
