//! A log of items on their way through a machine, cycle by cycle, in the format of [Konata](https://github.com/shioyadan/Konata).
//!
//! A machine is looked at between two cycles. What channels have taken and given in the cycle before says where each item is: in a channel, which
//! is a stage with the channel's name, or in the unit behind it, which is a stage with the unit's name. Nothing is asked of the units, so that a
//! machine that is not looked at does no more than before.
//!
//! | item | begins | ends |
//! |---|---|---|
//! | vertex | vertex fetch sends its batch | assembly has used its batch up |
//! | primitive | assembly sends it | it is clipped, or thrown away |
//! | triangle | clipping sends it | all its blocks are traversed, or it is thrown away |
//! | quad | traversal sends it | it is written, or thrown away |
//! | warp | its maker sends it to a core | its places are free |
//!
//! Requests of a warp to a texture unit or a constant cache are stages in lanes of their own: from the first request to the last answer.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet, VecDeque};
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

use anyhow::{Context, Result, bail, ensure};

use gfx::stage::Stage;
use host::PartialFile;
use machine::config::SortClass;
use machine::{Config, Machine, Watcher};
use num::{Cycle, NEVER};
use sim::{Reading, Wires};
use unit::card::{Card, Work};
use unit::network::Topology;
use unit::token::{GroupToken, Kind, Run, TriangleToken, VertexBatch, WarpToken};
use unit::warp::Warp;
use work::End;

/// What tells a log from other files: a label of its first item.
pub const MARK: &[u8] = b"L\t0\t1\tfillrate\n";

/// The largest log, in bytes.
pub const MOST: u64 = 2 << 30;

/// Bytes of text that are kept before they are written.
const KEPT: usize = 1 << 16;

/// The items of a log: those that begin in some cycles, of some draws.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Scope {
    /// The cycles, counted from the beginning of the run.
    pub cycles: Range<Cycle>,
    /// The draws, by their numbers in the frame. None: all, and dispatches.
    pub draws: Option<Range<u32>>,
}

impl Scope {
    /// The cycles as a user gives them.
    fn name(&self) -> String {
        let end = if self.cycles.end == NEVER { String::new() } else { self.cycles.end.to_string() };
        let draws = self.draws.as_ref().map_or(String::new(), |draws| format!(" of draws {}..{}", draws.start, draws.end));
        format!("cycles {}..{end}{draws}", self.cycles.start)
    }
}

/// What the tokens of a channel stand for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Carries {
    /// Batches of vertices whose indices have been read.
    Batches,
    /// Batches of vertices that are shaded.
    Shaded,
    /// Runs of primitives.
    Primitives,
    /// Runs of triangles.
    Clipped,
    Triangles,
    Groups,
    /// Warps of a cluster, from their maker to a core or back.
    Warps(usize),
    /// Warps with a request for a service, which has a lane, and with the answer.
    Asking(usize, usize),
    Answered(usize, usize),
}

/// A channel that carries items.
struct Port {
    channel: usize,
    name: String,
    carries: Carries,
    /// The unit behind it, and its number among those of its name.
    to: (usize, usize),
    /// Items may begin here.
    makes: bool,
    /// Tokens pushed since the start.
    pushed: u64,
    /// The items of each token inside, from the head on.
    inside: VecDeque<Vec<u64>>,
}

/// Names of items. Segments are named by their numbers on the machine.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Key {
    /// A vertex of a batch.
    Vertex(u32, u32),
    Primitive(u32, u32),
    /// A triangle in front of the network that sorts.
    Triangle(u32, u32),
    /// A triangle in a pipeline.
    Sorted(u32, u32, usize),
    /// A quad of a tile.
    Quad(u32, u32, u32),
    /// A warp of a cluster, by its serial number.
    Warp(usize, u64),
}

/// Where an item is: a place among the channels, or a unit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Place {
    Port(usize),
    Unit(usize),
}

/// An item that has begun and not ended.
struct Item {
    key: Key,
    /// The stage that the log has it in.
    stage: Place,
    /// The unit that has taken it in this cycle.
    taken: Option<usize>,
    /// What becomes of it is drawn, as far as its work says.
    drawn: bool,
    /// Requests that are not answered, by lane.
    asked: [u32; LANES.len()],
}

/// The units whose answers a warp waits for. Their lanes are numbered from 1.
const LANES: [&str; 2] = ["texture", "constant"];

/// Writes the log of a run.
pub struct PipelineLog {
    scope: Scope,
    file: PartialFile,
    text: String,
    written: u64,
    failed: Option<std::io::Error>,
    /// The cycle of the next look.
    next: Cycle,
    /// Names of the units, and the cluster of each core.
    units: Vec<String>,
    per_cluster: usize,
    clusters: usize,
    ports: Vec<Port>,
    begun: bool,
    /// The cycle that the log is in.
    cycle: Option<Cycle>,
    items: BTreeMap<u64, Item>,
    ids: HashMap<Key, u64>,
    /// Names of items that have ended in this cycle: what was made of them begins in it at the latest.
    ended: Vec<Key>,
    /// Items that units have taken in this cycle.
    taken: Vec<u64>,
    /// Quads and warps in units.
    held: BTreeSet<u64>,
    /// Triangles that are traversed, by unit, in order.
    traversed: BTreeMap<usize, VecDeque<u64>>,
    count: u64,
    retired: u64,
}

impl PipelineLog {
    /// A log at a place. It is there when it is complete.
    ///
    /// # Errors
    /// If the file cannot be made, or items of such a machine are not followed.
    pub fn new(config: &Config, scope: Scope, path: &Path) -> Result<PipelineLog> {
        let sort = config.card.sort;
        ensure!(
            sort == SortClass::Middle && config.network.topology == Topology::PointToPoint,
            "the pipeline log follows items through a machine whose sort is sort-middle and whose network.topology is point-to-point; the sort of {} is {}, \
             and its topology {}",
            config.name,
            sort.name(),
            config.network.topology.name(),
        );
        let machine = Machine::new(config)?;
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        machine.units().for_each(|(name, _)| *counts.entry(name).or_default() += 1);
        let units = machine.units().map(|(name, index)| numbered(name, index, counts[name])).collect();
        let file = PartialFile::create(path).with_context(|| format!("cannot write {}", path.display()))?;
        Ok(PipelineLog {
            next: scope.cycles.start,
            scope,
            file,
            text: "Kanata\t0004\n".to_owned(),
            written: 0,
            failed: None,
            units,
            per_cluster: config.core.per_pipeline as usize,
            clusters: config.card.pipelines as usize,
            ports: Vec::new(),
            begun: false,
            cycle: None,
            items: BTreeMap::new(),
            ids: HashMap::new(),
            ended: Vec::new(),
            taken: Vec::new(),
            held: BTreeSet::new(),
            traversed: BTreeMap::new(),
            count: 0,
            retired: 0,
        })
    }

    /// The log is complete: items that are still on their way are flushed. The number of items.
    ///
    /// # Errors
    /// If it cannot be written, or is longer than [`MOST`]; the message names the range.
    pub fn finish(mut self) -> Result<u64> {
        let open: Vec<u64> = self.items.keys().copied().collect();
        open.into_iter().for_each(|id| self.end(id, true));
        self.write();
        if self.written > MOST {
            bail!("the pipeline log of {} is longer than {MOST} bytes: choose a shorter range", self.scope.name());
        }
        if let Some(error) = self.failed {
            return Err(error).context("cannot write the pipeline log");
        }
        self.file.keep()?;
        Ok(self.count)
    }

    fn write(&mut self) {
        self.written += self.text.len() as u64;
        if self.failed.is_none() && self.written <= MOST {
            self.failed = self.file.add(self.text.as_bytes()).err();
        }
        self.text.clear();
    }

    /// Notes the channels that carry items.
    fn begin_ports(&mut self, wires: &Wires) {
        let names: Vec<(&str, usize)> = wires.units().collect();
        let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
        wires.wires().for_each(|wire| *counts.entry(wire.name).or_default() += 1);
        for (channel, wire) in wires.wires().enumerate() {
            let [(from, from_index), (to, to_index)] = [names[wire.from], names[wire.to]];
            let cluster = |(name, index): (&str, usize)| match name {
                "vertex_core" => self.clusters,
                _ => index / self.per_cluster,
            };
            let lane = |name: &str| LANES.iter().position(|lane| name.ends_with(lane));
            let carries = if wires.carries::<VertexBatch>(channel) {
                Some(Carries::Batches)
            } else if wires.carries::<Run>(channel) {
                Some(if from == "assembly" { Carries::Primitives } else { Carries::Clipped })
            } else if wires.carries::<TriangleToken>(channel) {
                Some(Carries::Triangles)
            } else if wires.carries::<GroupToken>(channel) {
                Some(Carries::Groups)
            } else if wires.carries::<WarpToken>(channel) {
                match (from, to) {
                    ("core" | "vertex_core", "assembly") => Some(Carries::Shaded),
                    ("core" | "vertex_core", "dispatch") => Some(Carries::Warps(cluster((from, from_index)))),
                    ("core" | "vertex_core", name) => lane(name).map(|lane| Carries::Asking(cluster((from, from_index)), lane)),
                    ("fetch" | "dispatch" | "compute", "core" | "vertex_core") => Some(Carries::Warps(cluster((to, to_index)))),
                    (name, "core" | "vertex_core") => lane(name).map(|lane| Carries::Answered(cluster((to, to_index)), lane)),
                    _ => None,
                }
            } else {
                None
            };
            let Some(carries) = carries else { continue };
            let (pushed, inside) = wires.carried(channel);
            let name = numbered(wire.name, wire.index, counts[wire.name]);
            let inside = vec![Vec::new(); inside as usize].into();
            let makes = match carries {
                Carries::Groups => from == "traverse",
                Carries::Warps(_) => from != "core" && from != "vertex_core",
                _ => true,
            };
            let to = (wire.to, to_index);
            self.ports.push(Port { channel, name, carries, to, makes, pushed, inside });
        }
    }

    fn name(&self, stage: Place) -> &str {
        match stage {
            Place::Port(port) => &self.ports[port].name,
            Place::Unit(unit) => &self.units[unit],
        }
    }

    /// A line of the log in the cycle that has just gone by.
    fn line(&mut self, line: std::fmt::Arguments<'_>) {
        let now = self.next - 1;
        match self.cycle.replace(now) {
            None => self.text.push_str(&format!("C=\t{now}\n")),
            Some(before) if before < now => self.text.push_str(&format!("C\t{}\n", now - before)),
            Some(_) => {}
        }
        let _ = self.text.write_fmt(line);
        self.text.push('\n');
        if self.text.len() >= KEPT {
            self.write();
        }
    }

    fn step(&mut self, id: u64, lane: usize, letter: char, stage: &str) {
        self.line(format_args!("{letter}\t{id}\t{lane}\t{stage}"));
    }

    /// Whether items of a draw that begin now belong to the log.
    fn in_scope(&self, work: Option<&Work>) -> bool {
        let draw = self.scope.draws.as_ref().is_none_or(|draws| work.is_some_and(|work| draws.contains(&work.draw.number)));
        draw && self.scope.cycles.contains(&(self.next - 1))
    }

    /// An item begins in a channel.
    fn begin(&mut self, key: Key, port: usize, drawn: bool, label: &str) -> u64 {
        let id = self.count;
        self.count += 1;
        self.line(format_args!("I\t{id}\t{id}\t0"));
        self.line(format_args!("L\t{id}\t0\t{label}"));
        if id == 0 {
            self.text.push_str(&String::from_utf8_lossy(MARK));
        }
        let name = self.ports[port].name.clone();
        self.step(id, 0, 'S', &name);
        let item = Item { key, stage: Place::Port(port), taken: None, drawn, asked: [0; LANES.len()] };
        self.items.insert(id, item);
        self.ids.insert(key, id);
        id
    }

    /// The item goes to another stage.
    fn go(&mut self, id: u64, stage: Place) {
        let Some(item) = self.items.get_mut(&id) else { return };
        item.taken = None;
        if matches!(stage, Place::Port(_)) {
            self.held.remove(&id);
        }
        let before = std::mem::replace(&mut item.stage, stage);
        let [before, stage] = [before, stage].map(|stage| self.name(stage).to_owned());
        self.step(id, 0, 'E', &before);
        self.step(id, 0, 'S', &stage);
    }

    /// The item is done, or thrown away.
    fn end(&mut self, id: u64, flushed: bool) {
        let Some(item) = self.items.remove(&id) else { return };
        self.held.remove(&id);
        for (lane, name) in LANES.iter().enumerate().filter(|&(lane, _)| item.asked[lane] > 0) {
            self.step(id, lane + 1, 'E', name);
        }
        let stage = self.name(item.stage).to_owned();
        self.step(id, 0, 'E', &stage);
        let number = self.retired;
        self.retired += u64::from(!flushed);
        self.line(format_args!("R\t{id}\t{number}\t{}", u8::from(flushed)));
        self.ended.push(item.key);
    }

    /// What was made of an item waits for it.
    fn link(&mut self, made: u64, of: Option<u64>) {
        if let Some(of) = of {
            self.line(format_args!("W\t{made}\t{of}\t0"));
        }
    }

    /// A channel gives a token away.
    fn popped(&mut self, port: usize, ids: Vec<u64>) {
        let Port { carries, to, .. } = self.ports[port];
        for id in ids {
            let Some(item) = self.items.get_mut(&id) else { continue };
            match carries {
                Carries::Primitives => {
                    let flushed = !item.drawn;
                    self.end(id, flushed);
                }
                Carries::Batches => self.end(id, false),
                Carries::Asking(..) => {}
                Carries::Answered(_, lane) => {
                    item.asked[lane] = item.asked[lane].saturating_sub(1);
                    if item.asked[lane] == 0 {
                        self.step(id, lane + 1, 'E', LANES[lane]);
                    }
                }
                Carries::Shaded | Carries::Clipped | Carries::Triangles | Carries::Groups | Carries::Warps(_) => {
                    // A triangle of a run may have gone on before the last of the run.
                    if item.stage == Place::Port(port) {
                        item.taken = Some(to.0);
                        if matches!(item.key, Key::Quad(..) | Key::Warp(..)) {
                            self.held.insert(id);
                        }
                        self.taken.push(id);
                    }
                }
            }
        }
    }

    /// A channel has taken a token: the items that it stands for.
    fn pushed(&mut self, at: usize, back: u32, wires: &Wires, card: &Card) -> Vec<u64> {
        let Port { channel, carries, to, .. } = self.ports[at];
        let mut ids = Vec::new();
        match carries {
            Carries::Batches => {
                let Some(batch) = wires.newest::<VertexBatch>(channel, back).filter(|batch| batch.kind == Kind::DATA) else {
                    return ids;
                };
                self.vertices(at, batch.slot, batch.number, batch.vertices, false, card, &mut ids);
            }
            Carries::Shaded => {
                let Some(WarpToken { warp: batch }) = wires.newest(channel, back) else { return ids };
                ids.extend((0..).map_while(|vertex| self.ids.get(&Key::Vertex(batch, vertex)).copied()));
                ids.iter().for_each(|&id| self.go(id, Place::Port(at)));
            }
            Carries::Primitives => {
                let Some(run) = wires.newest::<Run>(channel, back).filter(|run| run.kind == Kind::DATA) else { return ids };
                let work = card.work(run.slot);
                let numbers = if self.in_scope(Some(work)) { run.first..run.first + run.count } else { 0..0 };
                for number in numbers {
                    let drawn = work.segment.primitives[number as usize].triangles > 0;
                    let label = format!("primitive {number}, draw {}", work.draw.number);
                    ids.push(self.begin(Key::Primitive(work.number, number), at, drawn, &label));
                }
            }
            Carries::Clipped => {
                let Some(run) = wires.newest::<Run>(channel, back).filter(|run| run.kind == Kind::DATA) else { return ids };
                let work = card.work(run.slot);
                for number in run.first..run.first + run.count {
                    let key = Key::Triangle(work.number, number);
                    ids.extend(self.triangle(key, at, work, number));
                }
            }
            Carries::Triangles => {
                let token = wires.newest::<TriangleToken>(channel, back).filter(|token| token.kind == Kind::DATA);
                let Some(TriangleToken { slot, triangle, .. }) = token else { return ids };
                let work = card.work(slot);
                let [before, key] = [Key::Triangle(work.number, triangle), Key::Sorted(work.number, triangle, to.1)];
                if let Some(id) = self.ids.get(&key).copied() {
                    self.go(id, Place::Port(at));
                    ids.push(id);
                } else if let Some(id) = self.ids.remove(&before).filter(|id| self.items.contains_key(id)) {
                    self.ids.insert(key, id);
                    if let Some(item) = self.items.get_mut(&id) {
                        item.key = key;
                    }
                    self.go(id, Place::Port(at));
                    ids.push(id);
                } else {
                    ids.extend(self.triangle(key, at, work, triangle));
                }
            }
            Carries::Groups => {
                let Some(token) = wires.newest::<GroupToken>(channel, back).filter(|token| token.kind == Kind::DATA) else {
                    return ids;
                };
                self.quads(at, token, card, &mut ids);
            }
            Carries::Warps(cluster) => {
                let Some(WarpToken { warp }) = wires.newest(channel, back) else { return ids };
                let warp = &card.warps[cluster][warp];
                let key = Key::Warp(cluster, warp.serial);
                let id = match self.ids.get(&key).copied() {
                    Some(id) => {
                        self.go(id, Place::Port(at));
                        Some(id)
                    }
                    None if self.ports[at].makes => self.warp(key, at, warp, card),
                    None => None,
                };
                ids.extend(id);
                if warp.stage == Stage::Vertex && self.ports[at].makes {
                    self.vertices(at, warp.slot, warp.number, warp.items.len() as u32, true, card, &mut ids);
                }
            }
            Carries::Asking(cluster, lane) => {
                let Some(WarpToken { warp }) = wires.newest(channel, back) else { return ids };
                let Some(&id) = self.ids.get(&Key::Warp(cluster, card.warps[cluster][warp].serial)) else { return ids };
                if let Some(item) = self.items.get_mut(&id) {
                    item.asked[lane] += 1;
                    if item.asked[lane] == 1 {
                        self.step(id, lane + 1, 'S', LANES[lane]);
                    }
                }
            }
            Carries::Answered(cluster, _) => {
                let Some(WarpToken { warp }) = wires.newest(channel, back) else { return ids };
                ids.extend(self.ids.get(&Key::Warp(cluster, card.warps[cluster][warp].serial)));
            }
        }
        ids
    }

    /// The vertices of a batch, which begin here unless they have. With `moves` they go on here.
    #[allow(clippy::too_many_arguments, reason = "a token's fields")]
    fn vertices(&mut self, at: usize, slot: u16, batch: u32, count: u32, moves: bool, card: &Card, ids: &mut Vec<u64>) {
        for vertex in 0..count {
            let key = Key::Vertex(batch, vertex);
            match self.ids.get(&key).copied() {
                Some(id) => {
                    if moves {
                        self.go(id, Place::Port(at));
                    }
                    ids.push(id);
                }
                None if self.in_scope(Some(card.work(slot))) => {
                    let label = format!("vertex {vertex} of batch {batch}, draw {}", card.work(slot).draw.number);
                    ids.push(self.begin(key, at, true, &label));
                }
                None => {}
            }
        }
    }

    /// A triangle begins.
    fn triangle(&mut self, key: Key, at: usize, work: &Work, number: u32) -> Option<u64> {
        if !self.in_scope(Some(work)) {
            return None;
        }
        let triangle = &work.segment.triangles[number as usize];
        let label = format!("triangle {number} of primitive {}, draw {}", triangle.primitive, work.draw.number);
        let id = self.begin(key, at, triangle.end == End::Nowhere && triangle.visits > 0, &label);
        self.link(id, self.ids.get(&Key::Primitive(work.number, triangle.primitive)).copied());
        Some(id)
    }

    /// The quads of a group go on. Those of which no sample is left end.
    fn quads(&mut self, at: usize, token: GroupToken, card: &Card, ids: &mut Vec<u64>) {
        let group = &card.groups[usize::from(token.pool)][token.group];
        let work = card.work(group.slot);
        let tile = &work.segment.tiles[group.tile as usize];
        let across = card.pass_of(group.slot).map_or(1, |pass| pass.blocks_across);
        for (place, &live) in (group.first..).zip(&group.live[..usize::from(group.count)]) {
            let key = Key::Quad(work.number, group.tile, place);
            match self.ids.get(&key).copied() {
                Some(id) if live == 0 => self.end(id, true),
                Some(id) => {
                    self.go(id, Place::Port(at));
                    ids.push(id);
                }
                None if live != 0 && self.ports[at].makes && self.in_scope(Some(work)) => {
                    let position = u32::from(tile.quads[place as usize].position);
                    let x = group.block % across * 8 + position % 4 * 2;
                    let y = group.block / across * 8 + position / 4 * 2;
                    let label = format!("quad at ({x}, {y}) of triangle {}, draw {}", group.triangle, work.draw.number);
                    let id = self.begin(key, at, true, &label);
                    let sorted = (0..self.clusters)
                        .find_map(|pipeline| self.ids.get(&Key::Sorted(work.number, group.triangle, pipeline)).copied());
                    self.link(id, sorted);
                    ids.push(id);
                }
                None => {}
            }
        }
    }

    /// A warp begins. The quads in it wait for it.
    fn warp(&mut self, key: Key, at: usize, warp: &Warp, card: &Card) -> Option<u64> {
        let work = (warp.stage != Stage::Compute).then(|| card.work(warp.slot));
        if !self.in_scope(work) {
            return None;
        }
        let parts = warp.items.len();
        let label = match (warp.stage, work) {
            (Stage::Vertex, Some(work)) => {
                format!("warp of {parts} vertices, batch {}, draw {}", warp.number, work.draw.number)
            }
            (Stage::Fragment, Some(work)) => format!("warp of {parts} quads, draw {}", work.draw.number),
            _ => format!("warp of workgroup {}, dispatch {}", warp.number, card.compute(warp.slot).dispatch.number),
        };
        let id = self.begin(key, at, true, &label);
        for token in warp.groups.iter().filter(|token| token.kind == Kind::DATA) {
            let group = &card.groups[usize::from(token.pool)][token.group];
            let number = card.work(group.slot).number;
            for quad in group.first..group.first + u32::from(group.count) {
                if let Some(&quad) = self.ids.get(&Key::Quad(number, group.tile, quad)) {
                    self.link(quad, Some(id));
                }
            }
        }
        Some(id)
    }

    /// Items that units have taken are in these units, unless they have gone on or ended.
    fn settle(&mut self, card: &Card, resident: &dyn Fn() -> Vec<u64>) {
        let mut inside: HashSet<Key> = HashSet::new();
        if !self.held.is_empty() {
            for group in card.groups.iter().flat_map(|pool| pool.held()) {
                let number = card.work(group.slot).number;
                let quads = (group.first..).zip(&group.live[..usize::from(group.count)]).filter(|(_, live)| **live != 0);
                inside.extend(quads.map(|(quad, _)| Key::Quad(number, group.tile, quad)));
            }
        }
        for (cluster, warps) in card.warps.iter().enumerate().filter(|_| !self.held.is_empty()) {
            inside.extend(warps.held().map(|warp| Key::Warp(cluster, warp.serial)));
        }
        // What is in no pool any more has ended in the unit that it was in.
        let over: Vec<(u64, usize)> = self
            .held
            .iter()
            .filter_map(|id| {
                let item = self.items.get(id).filter(|item| !inside.contains(&item.key))?;
                match (item.taken, item.stage) {
                    (Some(unit), _) | (None, Place::Unit(unit)) => Some((*id, unit)),
                    (None, Place::Port(_)) => None,
                }
            })
            .collect();
        for (id, unit) in over {
            let written = self.units[unit].starts_with("color");
            let warp = self.items.get(&id).is_some_and(|item| matches!(item.key, Key::Warp(..)));
            self.end(id, !written && !warp);
        }
        for id in std::mem::take(&mut self.taken) {
            let Some(Item { taken: Some(unit), key, .. }) = self.items.get(&id) else { continue };
            let (unit, triangle) = (*unit, matches!(key, Key::Triangle(..) | Key::Sorted(..)));
            if triangle && !self.units[unit].starts_with("traverse") {
                // Distribution and setup send a triangle on in the cycle in which they take it.
                self.end(id, true);
                continue;
            }
            self.go(id, Place::Unit(unit));
            if triangle {
                self.traversed.entry(unit).or_default().push_back(id);
            }
        }
        if self.traversed.values().any(|triangles| !triangles.is_empty()) {
            let resident = resident();
            for (unit, mut triangles) in std::mem::take(&mut self.traversed) {
                while triangles.len() as u64 > resident[unit] {
                    let Some(id) = triangles.pop_front() else { break };
                    let flushed = self.items.get(&id).is_some_and(|item| !item.drawn);
                    self.end(id, flushed);
                }
                self.traversed.insert(unit, triangles);
            }
        }
        for key in std::mem::take(&mut self.ended) {
            self.ids.remove(&key);
        }
    }
}

impl Watcher for PipelineLog {
    fn due(&self) -> Cycle {
        NEVER
    }

    fn read(&mut self, _: Reading) {}

    fn settled(&mut self, _: Reading) {}

    fn looks(&self) -> Cycle {
        let over = self.next > self.scope.cycles.end && self.items.is_empty();
        if over || self.failed.is_some() || self.written > MOST { NEVER } else { self.next }
    }

    fn look(&mut self, wires: &Wires, card: &Card, resident: &dyn Fn() -> Vec<u64>) {
        if !std::mem::replace(&mut self.begun, true) {
            self.begin_ports(wires);
        }
        let mut new = Vec::with_capacity(self.ports.len());
        for port in 0..self.ports.len() {
            let (pushed, inside) = wires.carried(self.ports[port].channel);
            let of = &mut self.ports[port];
            let taken = (pushed - std::mem::replace(&mut of.pushed, pushed)) as u32;
            let gone = of.inside.len() + taken as usize - inside as usize;
            let gone: Vec<Vec<u64>> = of.inside.drain(..gone).collect();
            new.push(taken);
            gone.into_iter().for_each(|ids| self.popped(port, ids));
        }
        for (port, new) in new.into_iter().enumerate() {
            for back in (0..new).rev() {
                let ids = self.pushed(port, back, wires, card);
                self.ports[port].inside.push_back(ids);
            }
        }
        self.settle(card, resident);
        self.next = wires.now() + 1;
    }
}

/// The name of a unit or channel, with its number if there are several.
fn numbered(name: &str, index: usize, count: usize) -> String {
    if count > 1 { format!("{name}[{index}]") } else { name.to_owned() }
}
