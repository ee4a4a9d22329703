//! Identities of whole machines, and of circuits under every clock.

use anyhow::Result;

use super::circuits::{at_random, tandem};
use crate::harness::{config, counts, each, funnel, items};
use crate::{Row, Section, Setting, Target};
use machine::config::SortClass;
use machine::{Config, Machine, MachineReport};
use mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, L2Counts, SLICES};
use sim::kit::{Item, Sink, Source};
use sim::{self, CHANNELS, ChannelCounts, Circuit, Clock, Link, One, Tick, UNITS, Unit, Wires, Wiring};
use stats::{Cycles, Tree};
use synthetic::{Scene, events};
use work::{Event, Shade};

pub(super) const CONSERVATION: Target = Target {
    id: "conservation",
    section: Section::Exact,
    what: "What goes into a unit comes out or is counted as ended there: primitives of the work, warps, requests, lookups, quads, \
           fragments, bytes from clients to the second-level cache, on machines of every sort class",
    bound: "exact",
    fault: "the last triangle of each draw is lost on its way to the machine",
    check: conservation,
};

pub(super) const ACCOUNT: Target = Target {
    id: "account",
    section: Section::Exact,
    what: "Busy, starved, blocked, memory, latency and idle cycles of every unit add up to the cycles of the run",
    bound: "exact",
    fault: "a circuit runs on for a cycle after its cycles were counted",
    check: account,
};

pub(super) const CLOCKS: Target = Target {
    id: "clocks",
    section: Section::Exact,
    what: "Every statistic is the same whether every unit ticks in every cycle or idle ones sleep, and in any order of ticks",
    bound: "exact",
    fault: "a unit of the circuit looks at what another one does in the same cycle",
    check: clocks,
};

/// A machine of every sort class.
pub(super) fn machines() -> Result<Vec<Config>> {
    let machine = |class: &SortClass| match class {
        SortClass::LastImage => config("four-pipelines", &[&format!("sort={}", class.name())]),
        _ => config(class.name(), &[]),
    };
    SortClass::ALL.iter().map(machine).collect()
}

/// Small scenes of several kinds.
fn scenes(setting: &Setting) -> Vec<Scene> {
    let triangles = setting.pick(16, 60, 600);
    let plain = Scene { width: 72, height: 56, size: 40.0, triangles, seed: setting.seed, ..Scene::default() };
    let late = Scene { samples: 4, early: false, discard: true, ..plain.clone() };
    let small = Scene { size: 5.0, triangles: 2 * triangles, frames: 2, textures: 2, ..plain.clone() };
    setting.pick(vec![plain.clone()], vec![plain.clone(), late.clone(), small.clone()], vec![plain, late, small])
}

fn work_of(config: &Config, scene: &Scene) -> Vec<Event> {
    events(&Scene { covered: config.render_key().shade == Shade::Covered, ..scene.clone() })
}

fn run(config: &Config, work: Vec<Event>, clock: Clock) -> Result<MachineReport> {
    Ok(Machine::new(config)?.run(work.into_iter(), clock)?)
}

/// Sums of what goes in and of what comes out, by name, and in how many runs they differed.
#[derive(Default)]
struct Pairs(Vec<(&'static str, f64, f64, u64)>);

impl Pairs {
    fn add(&mut self, name: &'static str, expected: f64, measured: f64) {
        let differs = u64::from(expected != measured);
        match self.0.iter_mut().find(|pair| pair.0 == name) {
            Some(pair) => *pair = (name, pair.1 + expected, pair.2 + measured, pair.3 + differs),
            None => self.0.push((name, expected, measured, differs)),
        }
    }

    fn rows(self) -> Vec<Row> {
        let row = |(name, expected, measured, differ): (&str, f64, f64, u64)| Row {
            case: name.to_owned(),
            expected,
            measured,
            error: differ as f64,
            allowed: 0.0,
        };
        self.0.into_iter().map(row).collect()
    }
}

fn conservation(setting: &Setting) -> Result<Vec<Row>> {
    let mut pairs = Pairs::default();
    for scene in scenes(setting) {
        for config in machines()? {
            let work = work_of(&config, &scene);
            let primitives = |event: &Event| match event {
                Event::Segment(segment) => segment.primitives.len(),
                _ => 0,
            };
            let primitives = work.iter().map(primitives).sum::<usize>() as f64;
            let lost = u32::from(setting.inject_fault);
            let given = work_of(&config, &Scene { triangles: scene.triangles - lost, ..scene.clone() });
            conserved(&run(&config, given, Clock::SkipIdle)?.total, primitives, &mut pairs)?;
        }
    }
    Ok(pairs.rows())
}

fn conserved(tree: &Tree, primitives: f64, pairs: &mut Pairs) -> Result<()> {
    let funnel = funnel(tree)?;
    let sent = |channels| Ok::<_, anyhow::Error>(counts::<ChannelCounts>(tree, CHANNELS.named(channels))?.items as f64);
    pairs.add("primitives of the work: in (error: runs)", primitives, funnel.primitives_in as f64);
    pairs.add("vertex warps: to cores and back", sent("vertex_warps")?, sent("vertices_shaded")?);
    pairs.add("vertex warps: to cores and given up", sent("vertex_warps")?, sent("vertices_retired")?);
    pairs.add("fragment warps: to cores and back", sent("fragment_warps")?, sent("fragments_shaded")?);
    pairs.add("texture requests: sent and answered", sent("texture_requests")?, sent("texture_answers")?);
    let quads = funnel.quads_shaded as f64;
    pairs.add("quads: interpolated and shaded", items(tree, "interpolate")?, quads);
    pairs.add("quads: to warps and shaded", items(tree, "dispatch")?, quads);
    let ended = funnel.fragments_written + funnel.fragments_discarded + funnel.fragments_late_failed;
    pairs.add("fragments: shaded, and written or ended", funnel.fragments_shaded as f64, ended as f64);
    let fragments = funnel.fragments_shaded + funnel.helper_fragments;
    pairs.add("fragments and helpers: in quads", 4.0 * quads, fragments as f64);
    for cache in ["vertex", "texture", "depth", "color", "l2"] {
        let CacheCounts { accesses, hits, misses, .. } = counts(tree, CACHES.named(cache))?;
        pairs.add("caches: lookups, and hits and misses", accesses as f64, (hits + misses) as f64);
    }
    let (clients, slices): (ClientCounts, L2Counts) = (counts(tree, CLIENTS)?, counts(tree, SLICES)?);
    let [read, written] = [slices.read_bytes, slices.write_bytes].map(|bytes| bytes as f64);
    pairs.add("memory: bytes read, by clients and by slices", clients.read_bytes as f64, read);
    pairs.add("memory: bytes written, by clients and by slices", clients.write_bytes as f64, written);
    pairs.add("memory: requests, by clients and by slices", clients.requests as f64, items(tree, "l2")?);
    Ok(())
}

fn account(setting: &Setting) -> Result<Vec<Row>> {
    let mut pairs = Pairs::default();
    for scene in scenes(setting) {
        for config in machines()? {
            let report = run(&config, work_of(&config, &scene), Clock::SkipIdle)?;
            let frames = report.frames.iter().map(|frame| (&frame.tree, frame.cycles));
            for (tree, cycles) in frames.chain([(&report.total, report.cycles)]) {
                for spent in each::<Cycles>(tree, UNITS)? {
                    let spent = spent.total() as f64;
                    pairs.add("units of machines, of every frame and run: cycles (error: units)", cycles as f64, spent);
                }
            }
        }
    }
    let circuits = setting.pieces(setting.pick(20, 500, 20_000), |_, random| -> Result<Vec<(u64, u64)>> {
        let (service, links) = at_random(random);
        let n = 1 + u64::from(random.below(100));
        let mut machine = tandem(n, &service, &links);
        sim::run(&mut machine, &mut (), Clock::SkipIdle, 100_000, |m, _| m.sink.log.len() as u64 == n)?;
        let cycles = machine.wires().now();
        if setting.inject_fault {
            machine.source.n += 1;
            machine.wires_mut().wake_all();
            sim::run(&mut machine, &mut (), Clock::EveryCycle, 100_000, |m, _| m.wires().now() > cycles)?;
        }
        machine.wires_mut().settle();
        Ok(machine.reading().units.iter().map(|unit| (cycles, unit.total())).collect())
    });
    for units in circuits {
        for (cycles, spent) in units? {
            pairs.add("units of random tandems: cycles (error: units)", cycles as f64, spent as f64);
        }
    }
    Ok(pairs.rows())
}

/// A source that tells how many items it has sent where another unit may look.
struct Telling(Source);

impl Unit<u64> for Telling {
    fn tick(&mut self, wires: &mut Wires, told: &mut u64) -> Tick {
        let did = self.0.tick(wires, told);
        *told = self.0.next;
        did
    }

    fn items(&self) -> u64 {
        self.0.next
    }

    fn resident(&self) -> u64 {
        0
    }
}

/// A sink, which may look there.
struct Looking {
    sink: Sink,
    looks: bool,
    seen: u64,
}

impl Unit<u64> for Looking {
    fn tick(&mut self, wires: &mut Wires, told: &mut u64) -> Tick {
        if self.looks {
            self.seen += *told;
        }
        self.sink.tick(wires, told)
    }

    fn items(&self) -> u64 {
        self.sink.log.len() as u64 + self.seen
    }

    fn resident(&self) -> u64 {
        0
    }
}

sim::circuit! {
    struct Watched for u64 {
        source: One<Telling>,
        sink: One<Looking>,
    }
}

/// Everything that can be read of a circuit when its work is done.
fn watched(n: u64, link: Link, rest: u64, looks: bool, clock: Clock) -> Result<String> {
    let mut wiring = Wiring::new();
    let (source, sink) = (wiring.unit("source", 0), wiring.unit("sink", 0));
    let (output, input) = wiring.channel::<Item>("items", 0, link, source, sink);
    let mut sink = Sink::new(1, input);
    sink.rest = rest;
    let mut machine = Watched::new(wiring, One(Telling(Source::new(n, 1, output))), One(Looking { sink, looks, seen: 0 }));
    sim::run(&mut machine, &mut 0, clock, 100_000, |m, _| m.sink.sink.log.len() as u64 == n)?;
    machine.wires_mut().settle();
    Ok(format!("{:?} {:?} {:?}", machine.reading(), machine.tally(), machine.sink.sink.log))
}

/// All leaves that the statistics of a run print, whatever they are called: each is compared with itself.
fn leaves(config: &Config, work: &[Event], clock: Clock) -> Result<Vec<String>> {
    let report = run(config, work.to_vec(), clock)?;
    let mut all = Vec::new();
    for tree in report.frames.iter().map(|frame| &frame.tree).chain([&report.total]) {
        tree.leaves(&mut |path, leaf| all.push(format!("{path} {leaf:?}")));
    }
    Ok(all)
}

fn clocks(setting: &Setting) -> Result<Vec<Row>> {
    let orders: Vec<Clock> = [Clock::EveryCycle]
        .into_iter()
        .chain((0..setting.pick(1, 4, 16)).map(|k| Clock::Shuffled(setting.seed.wrapping_add(k))))
        .collect();
    let (mut all, mut differ) = (0, 0);
    for scene in scenes(setting) {
        for config in machines()? {
            let work = work_of(&config, &scene);
            let expected = leaves(&config, &work, Clock::SkipIdle)?;
            for &clock in &orders {
                let other = leaves(&config, &work, clock)?;
                all += expected.len();
                differ += other.len().abs_diff(expected.len()) + other.iter().zip(&expected).filter(|(a, b)| a != b).count();
            }
        }
    }
    let circuits = setting.pieces(setting.pick(20, 500, 20_000), |_, random| -> Result<u64> {
        let latency = 1 + random.below(4);
        let (link, rest) = (Link::items(1 + random.below(6), 1, latency), u64::from(random.below(6)));
        let n = 20 + u64::from(random.below(50));
        let expected = watched(n, link, rest, setting.inject_fault, Clock::SkipIdle)?;
        let mut differ = 0;
        for &clock in &orders {
            differ += u64::from(watched(n, link, rest, setting.inject_fault, clock)? != expected);
        }
        Ok(differ)
    });
    Ok(vec![
        Row::at_least("statistics compared, of machines of every sort class", 1000.0, all as f64),
        Row::none("of them, those that differ", differ as u64),
        Row::none("runs of random circuits that differ", circuits.into_iter().sum::<Result<u64>>()?),
    ])
}
