//! Pre-transformation and routing, one unit per pipeline of a sort-first machine: reads the indices and positions of its share of the
//! primitives, transforms them so far that their bounds on the screen are known, and sends each to the pipelines that own what it
//! touches. Geometry and shading follow there.

use std::collections::VecDeque;

use super::card::{Card, Work, is_newer};
use super::distribute::{Overlap, owners};
use super::index_runs::{IndexRuns, Walk};
use super::misses::Misses;
use super::network::{Sender, SenderCounts};
use super::sorting::SortCounts;
use super::tags::{CacheCounts, Tags};
use super::token::{Kind, Run, TriangleToken, bytes};
use gfx::state::StepMode;
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, In, Tick, Unit, Wires};
use stats::Heading;
use work::LINE;

knob::choices! {
    /// The data that is sent of a primitive.
    pub enum Retained {
        /// The numbers of its vertices: every pipeline reads their attributes from memory, where the scene is kept.
        Retained "retained",
        /// Its vertices with all attributes, as a host would that keeps no scene.
        Immediate "immediate",
    }
}

knob::knobs! {
    /// Pre-transformation of primitives and their routing to the pipelines that own the screen.
    pub struct RouteConfig {
        /// Vertices transformed per cycle: a matrix times a position, and the division.
        vertices_per_cycle: u32 ["vertices/cycle", Allowed::Range(1, 16), "four dot products; one fixed-function transform as in cards of 1999"]
            {estimate: Used, relax: Rate, advice: []},
        /// Primitives routed per cycle.
        primitives_per_cycle: u32 ["primitives/cycle", Allowed::Range(1, 16), "assumed: bounds of three vertices against the regions"]
            {estimate: Used, relax: Rate, advice: []},
        /// Transformed vertices that are remembered, first in first out.
        reuse: u32 ["vertices", Allowed::Range(0, 64), "assumed: 16, as post-transform caches of the time"]
            {estimate: RefusedUnless(AtLeast(4), "vertices that are transformed again"), relax: Cache, advice: []},
        /// Lines of positions remembered.
        cache_lines: u32 ["lines", Allowed::PowerOfTwo(2, 65536), "assumed: 4 KB"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Cache, advice: []},
        /// Ways of the cache of positions.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(1, 65536), "assumed: as the attribute cache's"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Requests for lines of positions in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtLeast(8), "waits of routing for vertices"), relax: Room, advice: []},
        /// Primitives between the lookup of their positions and routing.
        fifo: u32 ["primitives", Allowed::Range(1, 4096), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtLeast(32), "waits of routing for vertices"), relax: Room, advice: []},
        /// Cycles from positions to bounds.
        latency: u32 ["cycles", Allowed::Range(1, 256), "assumed: transform, division, comparison"]
            {estimate: RefusedUnless(AtMost(96), "waits of routing for vertices"), relax: Latency, advice: []},
        /// The data that is sent of a primitive.
        mode: Retained ["", Allowed::Choice(Retained::NAMES), "Molnar et al. 1994 compare both; both traffics are counted whichever is simulated"]
            {estimate: RefusedUnless(Is(&["retained"]), "vertices that are sent"), relax: Never, advice: []},
    }
}

stats::counters! {
    /// What pre-transformation does.
    pub struct RouteCounts {
        /// Vertices transformed for their bounds.
        transformed: "vertices",
    }
}

/// A primitive between lookup and routing, or a mark.
#[derive(Clone, Copy, Debug)]
struct RoutedPrimitive {
    token: TriangleToken,
    needs: Option<u32>,
    from: Cycle,
}

/// Ports of routing.
#[derive(Clone)]
pub struct RoutePorts {
    /// Batches of primitives.
    pub input: In<Run>,
    /// To all pipelines.
    pub network: Sender<TriangleToken>,
    /// Memory, for indices.
    pub index: MemoryPort,
    /// Memory, for positions.
    pub position: MemoryPort,
}

/// Routing. Its items are primitives.
#[derive(Clone)]
pub struct Route {
    config: RouteConfig,
    overlap: Overlap,
    pipeline: u8,
    ports: RoutePorts,
    runs: IndexRuns,
    tags: Tags<u32>,
    misses: Misses,
    /// Of the current run: its walk, where in it the unit is, and the next primitive.
    walk: Walk,
    begun: bool,
    position: u32,
    next: u32,
    /// The lines of the current vertex that are not yet looked up, half-open; and what the primitive needs so far.
    lines: (u64, u64),
    needs: Option<u32>,
    /// Vertices transformed last, and the segment that they are of.
    recent: VecDeque<u32>,
    segment: Option<u32>,
    epoch: u32,
    fifo: VecDeque<RoutedPrimitive>,
    /// Pipelines that the primitive or mark at the head has still to be sent to, once they are known.
    pending: Option<u64>,
    counts: RouteCounts,
    sorting: SortCounts,
}

impl Route {
    /// Numbers of the memory ports for indices and for positions.
    pub(super) fn ports(&self) -> [u16; 2] {
        [self.ports.index.number, self.ports.position.number]
    }

    /// An idle routing unit of pipeline `pipeline`. `runs` are the runs of primitives to be routed.
    pub fn new(config: RouteConfig, overlap: Overlap, runs: IndexRuns, pipeline: u8, ports: RoutePorts) -> Route {
        Route {
            runs,
            tags: Tags::new(config.cache_lines, config.cache_ways),
            misses: Misses::new(config.misses),
            walk: Walk::default(),
            begun: false,
            position: 0,
            next: 0,
            lines: (0, 0),
            needs: None,
            recent: VecDeque::with_capacity(config.reuse as usize + 1),
            segment: None,
            epoch: 0,
            fifo: VecDeque::with_capacity(config.fifo as usize + 2),
            pending: None,
            counts: RouteCounts::default(),
            sorting: SortCounts::default(),
            config,
            overlap,
            pipeline,
            ports,
        }
    }

    /// The counters of what the unit has sent.
    pub fn sorting(&self) -> SortCounts {
        self.sorting
    }

    /// The counters of the unit's waits.
    pub fn waits(&self) -> SenderCounts {
        self.ports.network.counts()
    }

    /// The counters of what the unit has transformed.
    pub fn counts(&self) -> RouteCounts {
        self.counts
    }

    /// The counters of the cache of positions.
    pub fn cache(&self) -> CacheCounts {
        self.tags.counts()
    }

    /// The pipelines that own what a primitive touches; of one that has to be cut before it is known to be outside, any.
    fn receivers(&self, card: &Card, work: &Work, number: u32) -> u64 {
        let primitive = &work.segment.primitives[number as usize];
        let triangles = &work.segment.triangles[primitive.first_triangle as usize..][..usize::from(primitive.triangles)];
        let pipelines = self.ports.network.receivers();
        if primitive.cut_away {
            return 1 << (number as usize % pipelines);
        }
        triangles.iter().fold(0, |mask, triangle| mask | owners(card, work, triangle, self.overlap, pipelines))
    }

    /// Sends what is ready at the head of the queue.
    fn send(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::moved_or(self.ports.network.poll(wires), Tick::Starved);
        let mut budget = self.config.primitives_per_cycle;
        while let Some(&RoutedPrimitive { token, needs, from }) = self.fifo.front() {
            if from > wires.now() {
                wires.sleep_until(from);
                return did.or(Tick::Working);
            }
            if needs.is_some_and(|needs| !self.misses.reached(needs)) {
                return did.or(Tick::Memory);
            }
            let data = token.kind == Kind::DATA;
            if data && budget == 0 {
                return Tick::Moved;
            }
            // 1. Where it goes.
            let work = if data { card.work[usize::from(token.slot)].as_ref() } else { None };
            let pending = match (self.pending, work) {
                (Some(pending), _) => pending,
                (None, Some(work)) => self.receivers(card, work, token.triangle),
                (None, None) => u64::MAX >> (64 - self.ports.network.receivers()),
            };
            if self.pending.is_none() && data {
                // All three positions are known, so that the tests of geometry can be made. What several pipelines get would be
                // counted by each.
                if let Some(work) = work {
                    let primitive = work.segment.primitives[token.triangle as usize];
                    card.funnel[token.slot].end(&primitive, pending.count_ones());
                }
                self.sorting.sent += u64::from(pending != 0);
                did = Tick::Moved;
            }
            // 2. Find its bytes on the network.
            let work = if data { card.work[usize::from(token.slot)].as_ref() } else { None };
            let attributes = work.map_or(0, |work| work.draw.attributes.iter().map(|fetch| fetch.bytes).sum::<u32>());
            let (retained, immediate) = (bytes::MARK + 12, bytes::MARK + 3 * attributes);
            let size = match self.config.mode {
                _ if !data => bytes::MARK,
                Retained::Retained => retained,
                Retained::Immediate => immediate,
            };
            // 3. A copy to each that has room.
            let mut left = pending;
            let mut still = pending;
            while left != 0 {
                let to = left.trailing_zeros() as usize;
                left &= left - 1;
                if !self.ports.network.can_send(wires, to) {
                    continue;
                }
                self.ports.network.send(wires, to, token, size);
                still &= !(1 << to);
                did = Tick::Moved;
                let counts = &mut self.sorting;
                if data {
                    counts.copy(1, size, to != usize::from(self.pipeline));
                    counts.retained_bytes += u64::from(retained);
                    counts.immediate_bytes += u64::from(immediate);
                } else {
                    counts.marks += 1;
                }
            }
            if still != 0 {
                self.pending = Some(still);
                return did.or(Tick::Blocked);
            }
            self.pending = None;
            budget -= u32::from(data);
            self.sorting.sorted_items += u64::from(data);
            self.fifo.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Looks up what is left of the current vertex; false if it has to wait, with the reason.
    fn look_up(&mut self, wires: &mut Wires) -> Result<(), Tick> {
        while self.lines.0 < self.lines.1 {
            let line = self.lines.0;
            let needs = if let Some(place) = self.tags.find(line) {
                *self.tags.data(place)
            } else {
                if self.misses.room() == 0 {
                    return Err(Tick::Memory);
                }
                if !self.ports.position.can_send(wires) {
                    return Err(Tick::Blocked);
                }
                let tag = self.misses.issue();
                self.ports.position.read(wires, line * LINE, LINE as u32, tag);
                let place = self.tags.victim(line, |_| true).expect("any line may go");
                self.tags.replace(place, line, self.misses.issued());
                self.misses.issued()
            };
            if !self.misses.reached(needs) {
                self.needs = self.misses.later(self.needs, needs);
            }
            self.lines.0 += 1;
        }
        Ok(())
    }

    /// Reads primitives and looks up their positions.
    fn read(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut vertices = self.config.vertices_per_cycle;
        loop {
            let Some(run) = self.runs.front() else { return did };
            if self.fifo.len() >= self.config.fifo as usize {
                return did.or(Tick::Blocked);
            }
            let from = wires.now() + Cycle::from(self.config.latency);
            if run.kind != Kind::DATA {
                let Run { slot, kind, sequence, .. } = run;
                let token = TriangleToken { slot, kind, sequence, triangle: 0 };
                self.fifo.push_back(RoutedPrimitive { token, needs: None, from });
                self.runs.take();
                did = Tick::Moved;
                continue;
            }
            let work = card.work[usize::from(run.slot)].as_ref().expect("a run's segment is in flight");
            if !self.begun {
                self.begun = true;
                self.walk = Walk::run(&work.segment, &run);
                self.position = 0;
                self.next = run.first;
                self.needs = None;
                if self.segment != Some(work.number) {
                    self.segment = Some(work.number);
                    self.recent.clear();
                }
                if is_newer(work.epoch, self.epoch) {
                    self.epoch = work.epoch;
                    self.tags.clear();
                }
                // Vertices that no other run counts.
                let first = work.segment.primitives[run.first as usize].stream_end;
                let before = if run.first == 0 { 0 } else { work.segment.primitives[run.first as usize - 1].stream_end };
                let last = work.segment.primitives[(run.first + run.count) as usize - 1].stream_end;
                let restarts = |from: u32, to: u32| {
                    work.segment.stream[from as usize..to as usize].iter().filter(|&&v| v == u32::MAX).count() as u32
                };
                debug_assert!(before <= first);
                card.funnel[run.slot].vertices_in += u64::from(last - before - restarts(before, last));
                card.funnel[run.slot].primitives_in += u64::from(run.count);
                did = Tick::Moved;
            }
            let work = card.work[usize::from(run.slot)].as_ref().expect("a run's segment is in flight");
            // 1. Lines of the current vertex.
            let before = self.lines.0;
            let looked_up = self.look_up(wires);
            if self.lines.0 != before {
                did = Tick::Moved;
            }
            if let Err(stall) = looked_up {
                return did.or(stall);
            }
            // 2. A primitive whose vertices are all looked up waits for its turn.
            let end = run.first + run.count;
            if self.next < end
                && work.segment.primitives[self.next as usize].stream_end <= self.walk.entry(self.position)
                && self.position >= self.walk.head_count
            {
                let token = TriangleToken { slot: run.slot, kind: Kind::DATA, sequence: run.sequence, triangle: self.next };
                self.fifo.push_back(RoutedPrimitive { token, needs: self.needs.take(), from });
                self.next += 1;
                did = Tick::Moved;
                continue;
            }
            if self.next == end {
                self.begun = false;
                self.runs.take();
                did = Tick::Moved;
                continue;
            }
            // 3. The next vertex.
            if vertices == 0 {
                return Tick::Moved;
            }
            let here = self.runs.here(work, &self.walk, self.position);
            let ahead = self.walk.ahead(&work.segment, self.position, here.max(self.position));
            let Some(&vertex) = ahead.first() else { return did.or(Tick::Memory) };
            self.position += 1;
            did = Tick::Moved;
            if vertex == u32::MAX || self.recent.contains(&vertex) {
                continue;
            }
            if self.config.reuse > 0 {
                if self.recent.len() as u32 == self.config.reuse {
                    self.recent.pop_front();
                }
                self.recent.push_back(vertex);
            }
            vertices -= 1;
            self.counts.transformed += 1;
            // The first attribute is taken to be the position.
            if let Some(fetch) = work.draw.attributes.first() {
                let vertex = &work.segment.vertices[vertex as usize];
                let element = if fetch.step == StepMode::Vertex { vertex.index } else { vertex.instance };
                let address = fetch.address + u64::from(element) * fetch.stride;
                self.lines = (address / LINE, (address + u64::from(fetch.bytes.max(1)) - 1) / LINE + 1);
            }
        }
    }
}

impl Unit<Card> for Route {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Take the lines that memory has brought.
        let mut did = Tick::Starved;
        while let Some(tag) = self.ports.position.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }

        // 2. Primitives whose bounds are known go to their pipelines.
        did = did.or(self.send(wires, card));

        // 3. Batches come in, and their indices.
        let RoutePorts { input, index, .. } = &self.ports;
        did = did.or(self.runs.take_in(wires, card, |wires| wires.pop(input), Walk::run, Some(index)));

        // 4. Their vertices are looked up and transformed.
        did = did.or(self.read(wires, card));
        if self.runs.freed() { Tick::Moved } else { did }
    }

    fn items(&self) -> u64 {
        self.sorting.sorted_items
    }

    fn resident(&self) -> u64 {
        self.fifo.len() as u64 + self.runs.resident() + u64::from(self.misses.in_flight())
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("position"), |unit| unit.tags.counts());
        groups.group(Heading::new("routing.route[i]", "Sort-first: pre-transformation."), |unit| unit.counts);
    }
}
