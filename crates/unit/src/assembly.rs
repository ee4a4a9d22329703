//! Primitive assembly: takes vertex batches in order, waits until they are shaded, and hands out primitives to the geometry units.

use super::card::Card;
use super::token::{Kind, Run, VertexBatch, WarpToken};
use knob::Allowed;
use sim::{Budget, In, Out, Tick, Token, Unit, Wires};

knob::choices! {
    /// How batches of primitives are dealt.
    pub enum Deal {
        /// To one after the other.
        Turn "round-robin",
        /// To the one with the most room in its queue; of several the next in turn.
        Least "least-loaded",
        /// To each pipeline one run of a pass's primitives, as long as all others; in sort-last-image only.
        Contiguous "contiguous",
    }
}

impl Deal {
    /// The output that gets the next batch: the one whose turn it is, or one with more room.
    #[inline(always)]
    pub fn choose<T: Token>(self, wires: &mut Wires, outputs: &[Out<T>], turn: usize) -> usize {
        if self != Deal::Least || outputs.len() == 1 {
            return turn;
        }
        let (mut best, mut most) = (turn, 0);
        for ahead in 0..outputs.len() {
            let output = (turn + ahead) % outputs.len();
            let room = wires.room(&outputs[output]);
            if room > most {
                (best, most) = (output, room);
            }
        }
        best
    }
}

knob::knobs! {
    /// Primitive assembly.
    pub struct AssemblyConfig {
        /// Primitives assembled per cycle.
        primitives_per_cycle: u32 ["primitives/cycle", Allowed::Range(1, 16),
            "assumed: as many as indices are read for; ATTILA bGPU.ini PRIMITIVEASSEMBLY TrianglesCycle = 2"]
            {estimate: Used, relax: Rate, advice: []},
        /// Primitives that get one sequence number and go to one geometry unit before the next one's turn.
        batch: u32 ["primitives", Allowed::Range(1, 1024),
            "assumed: GPUs switch geometry engines every 16 to 64 primitives; small enough to balance, large enough to amortise marks"]
            {estimate: RefusedUnless(AtMost(128), "draws of fewer primitives than a batch"), relax: Never, advice: []},
        /// Whether a batch ends before it has more quads than a pipeline can send on ahead of its turn, and primitives with more than that
        /// go to all pipelines, each of which draws its own tiles of them. Where quads or images are sorted only.
        by_size: bool ["", Allowed::Switch,
            "Pomegranate (Eldridge et al. 2000) bounds the work of rasterisers in fragments; assumed: sizes are known as primitives are dealt"]
            {estimate: Used, relax: Never, advice: []},
        /// Which geometry unit, or which pipeline whose geometry is its own, gets the next batch.
        deal: Deal ["", Allowed::Choice(Deal::NAMES), "in turn, as cards do; the other is Molnar et al.'s dynamic assignment"]
            {estimate: RefusedUnless(Is(&["round-robin", "least-loaded"]), "one run of a pass for each pipeline"), relax: Never, advice: []},
        /// Cycles from here to the geometry units.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini InputBusLatency = 10, less what shading adds here"]
            {estimate: Used, relax: Latency, advice: []},
        /// Runs of primitives queued before each geometry unit.
        queue: u32 ["runs", Allowed::Range(2, 1024), "assumed: covers the latency at the rate of primitives; ATTILA bGPU.ini AssemblyQueueSize = 32"]
            {estimate: RefusedUnless(AtLeast(4), "short queues in geometry"), relax: Room, advice: []},
    }
}

/// The most batches of vertices in flight.
pub const MAX_BATCHES: u32 = 1024;

/// Which batches in flight are shaded. Batches are numbered without gaps and retired in order, so that the numbers in flight span at most
/// [`MAX_BATCHES`] and no two of them have the same flag.
#[derive(Clone)]
struct Shaded {
    /// The first batch in flight.
    first: u32,
    /// By number modulo their count.
    flags: Vec<bool>,
}

impl Shaded {
    fn new() -> Shaded {
        Shaded { first: 0, flags: vec![false; MAX_BATCHES as usize] }
    }

    #[inline(always)]
    fn flag(&mut self, number: u32) -> &mut bool {
        assert!(number.wrapping_sub(self.first) < MAX_BATCHES, "batch {number} is not in flight: {} is the first", self.first);
        &mut self.flags[(number % MAX_BATCHES) as usize]
    }

    /// Whether a batch can be assembled; one without vertices needs no shading.
    #[inline(always)]
    fn ready(&mut self, batch: &VertexBatch) -> bool {
        batch.vertices == 0 || *self.flag(batch.number)
    }

    /// The first batch in flight is used up.
    fn retire(&mut self, number: u32) {
        assert_eq!(number, self.first, "batches are used up in order");
        *self.flag(number) = false;
        self.first = number.wrapping_add(1);
    }
}

/// Ports of primitive assembly.
#[derive(Clone)]
pub struct AssemblyPorts {
    /// Batches in order, from vertex fetch.
    pub batches: In<VertexBatch>,
    /// Shaded batches, from each cluster's cores; the token's warp is the batch number.
    pub shaded: Vec<In<WarpToken>>,
    /// Batches whose vertices are no longer needed, to vertex fetch.
    pub retired: Out<WarpToken>,
    /// How many indices have been taken since the start, to vertex fetch, where it asks.
    pub passed: Option<Out<WarpToken>>,
    /// Primitives, to each geometry unit.
    pub geometry: Vec<Out<Run>>,
}

/// Where the primitives come from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Segment after segment: batches are made here, numbered, and dealt to geometry units.
    Segments,
    /// In runs with numbers, dealt to the one pipeline that this unit belongs to.
    Runs {
        /// Whether a mark for the end of each sequence number is sent on, so that later units can restore the order.
        marks: bool,
        /// Whether primitives are counted here. They are not where a primitive may come to several pipelines.
        counts: bool,
    },
}

/// Primitive assembly. Its items are primitives.
#[derive(Clone)]
pub struct Assembly {
    config: AssemblyConfig,
    ports: AssemblyPorts,
    shaded: Shaded,
    /// The next primitive of the current segment.
    next: u32,
    /// Sequence number of the current batch of primitives, and how many are in it.
    sequence: u32,
    in_batch: u32,
    /// The geometry unit that gets the open batch, once one has been chosen, and the one whose turn is next.
    open: Option<usize>,
    turn: usize,
    /// The end of the next run of primitives that was dealt to a pipeline.
    end: u32,
    mode: Mode,
    /// Entries of the streams of segments that are assembled; entries taken since the start, and how many of these have been
    /// reported to vertex fetch.
    before: u32,
    passed: u32,
    reported: u32,
    items: u64,
}

impl Assembly {
    /// An idle assembly unit.
    pub fn new(config: AssemblyConfig, mode: Mode, ports: AssemblyPorts) -> Assembly {
        Assembly {
            config,
            ports,
            shaded: Shaded::new(),
            next: 0,
            sequence: 0,
            in_batch: 0,
            open: None,
            turn: 0,
            end: 0,
            mode,
            before: 0,
            passed: 0,
            reported: 0,
            items: 0,
        }
    }

    /// Sends to the geometry unit of the open batch; false if it has no room.
    #[inline(always)]
    fn send(&mut self, wires: &mut Wires, run: Run) -> bool {
        let (deal, turn) = (self.config.deal, self.turn);
        let output = *self.open.get_or_insert_with(|| deal.choose(wires, &self.ports.geometry, turn));
        wires.try_push(&self.ports.geometry[output], run)
    }

    fn next_sequence(&mut self) {
        self.sequence = self.sequence.wrapping_add(1);
        self.in_batch = 0;
        self.open = None;
        self.turn = (self.turn + 1) % self.ports.geometry.len();
    }

    /// Takes turns for a segment that is warmed with: one for each batch of primitives, and one for the mark behind them.
    pub(super) fn visit(&mut self, primitives: usize) {
        let units = self.ports.geometry.len();
        self.turn = (self.turn + primitives.div_ceil(self.config.batch as usize) + 1) % units;
    }

    /// Assembles the primitives of runs.
    fn runs(&mut self, wires: &mut Wires, card: &mut Card, marks: bool, counts: bool) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = Budget::new(self.config.primitives_per_cycle);
        while let Some(batch) = wires.front(&self.ports.batches) {
            let output = &self.ports.geometry[0];
            match batch.kind {
                // 1. A run begins.
                Kind::RUN => {
                    self.sequence = batch.number;
                    self.next = batch.stream_end;
                    self.end = batch.stream_end + batch.vertices;
                }
                // 2. Its primitives, as far as their vertices are shaded.
                Kind::DATA | Kind::PART => {
                    if !self.shaded.ready(&batch) {
                        return did.or(Tick::Starved);
                    }
                    if self.next < self.end {
                        let primitives = &card.work(batch.slot).segment.primitives[self.next as usize..self.end as usize];
                        let ready = primitives.iter().take_while(|p| p.stream_end <= batch.stream_end).count() as u32;
                        if ready > 0 {
                            let count = ready.min(budget.left());
                            if count == 0 {
                                return Tick::Moved;
                            }
                            let (slot, sequence, first) = (batch.slot, self.sequence, self.next);
                            if !wires.try_push(output, Run { slot, kind: Kind::DATA, sequence, first, count }) {
                                return did.or(Tick::Blocked);
                            }
                            budget.take(count);
                            self.next += count;
                            self.items += u64::from(count);
                            // Primitives that go to all pipelines are counted where they are dealt.
                            let counted = counts && !card.work(slot).is_shared(first);
                            card.funnel[slot].primitives_in += if counted { u64::from(count) } else { 0 };
                            did = Tick::Moved;
                            if count < ready {
                                return did;
                            }
                        }
                    }
                    if batch.kind == Kind::DATA && batch.vertices > 0 {
                        if !wires.try_push(&self.ports.retired, WarpToken { warp: batch.number }) {
                            return did.or(Tick::Blocked);
                        }
                        self.shaded.retire(batch.number);
                    }
                }
                // 3. Marks go on, with their numbers.
                kind => {
                    let run = Run { slot: batch.slot, kind, sequence: batch.number, first: 0, count: 0 };
                    if (marks || kind.is_fence()) && !wires.try_push(output, run) {
                        return did.or(Tick::Blocked);
                    }
                }
            }
            wires.take(&self.ports.batches);
            did = Tick::Moved;
        }
        did
    }

    /// Ends the open sequence number. With one geometry unit there is nothing to merge and no mark is sent.
    fn close(&mut self, wires: &mut Wires, slot: u16) -> bool {
        if self.ports.geometry.len() > 1 {
            let run = Run { slot, kind: Kind::END, sequence: self.sequence, first: 0, count: 0 };
            if !self.send(wires, run) {
                return false;
            }
        }
        self.next_sequence();
        true
    }
}

impl Assembly {
    /// Takes the indices of a shaded batch, as far as there is place for them.
    #[cold]
    fn take_indices(&mut self, card: &Card, batch: &VertexBatch) {
        let primitives = &card.work(batch.slot).segment.primitives;
        let assembled = self.next.checked_sub(1).map_or(0, |last| primitives[last as usize].stream_end);
        let taken = self.before.wrapping_add(batch.stream_end.min(assembled + self.config.queue));
        if (taken.wrapping_sub(self.passed) as i32) > 0 {
            self.passed = taken;
        }
    }

    /// Reports to vertex fetch how many indices have been taken: those of shaded vertices, as far as there is place for them before the
    /// primitives that are assembled next.
    #[cold]
    fn tell(&mut self, wires: &mut Wires, card: &Card) -> Tick {
        if let Some(batch) = wires.front(&self.ports.batches)
            && batch.kind == Kind::DATA
            && self.shaded.ready(&batch)
        {
            self.take_indices(card, &batch);
        }
        let Some(output) = &self.ports.passed else { return Tick::Starved };
        if self.passed != self.reported && wires.try_push(output, WarpToken { warp: self.passed }) {
            self.reported = self.passed;
            return Tick::Moved;
        }
        Tick::Starved
    }
}

impl Unit<Card> for Assembly {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        if self.ports.passed.is_some() { did.or(self.tell(wires, card)) } else { did }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.shaded.flags.iter().filter(|&&shaded| shaded).count() as u64
    }
}

impl Assembly {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Note the batches that cores have shaded.
        for shaded in &self.ports.shaded {
            while let Some(batch) = wires.pop(shaded) {
                *self.shaded.flag(batch.warp) = true;
                did = Tick::Moved;
            }
        }

        if let Mode::Runs { marks, counts } = self.mode {
            return did.or(self.runs(wires, card, marks, counts));
        }

        // 2. Assemble primitives of the batch at the head, as far as its vertices go.
        let mut budget = Budget::new(self.config.primitives_per_cycle);
        while let Some(batch) = wires.front(&self.ports.batches) {
            if batch.kind == Kind::DATA {
                if !self.shaded.ready(&batch) {
                    // Shaders are at work: another item will come.
                    return did.or(Tick::Starved);
                }
                let work = card.work(batch.slot);
                let primitives = &work.segment.primitives[self.next as usize..];
                let room = self.config.batch - self.in_batch;
                let most = primitives.len().min(room.min(budget.left()) as usize);
                let count = primitives[..most].iter().take_while(|p| p.stream_end <= batch.stream_end).count() as u32;
                if count > 0 {
                    let run = Run { slot: batch.slot, kind: Kind::DATA, sequence: self.sequence, first: self.next, count };
                    if !self.send(wires, run) {
                        return did.or(Tick::Blocked);
                    }
                    budget.take(count);
                    self.next += count;
                    self.in_batch += count;
                    self.items += u64::from(count);
                    card.funnel[batch.slot].primitives_in += u64::from(count);
                    did = Tick::Moved;
                }
                if self.in_batch == self.config.batch {
                    if !self.close(wires, batch.slot) {
                        return did.or(Tick::Blocked);
                    }
                    did = Tick::Moved;
                }
                let more = card.work(batch.slot).segment.primitives.get(self.next as usize);
                if more.is_some_and(|p| p.stream_end <= batch.stream_end) {
                    if budget.left() == 0 {
                        return Tick::Moved;
                    }
                    continue;
                }
            } else {
                // A mark has a sequence number of its own.
                if self.in_batch > 0 {
                    if !self.close(wires, batch.slot) {
                        return did.or(Tick::Blocked);
                    }
                    did = Tick::Moved;
                }
                let run = Run { slot: batch.slot, kind: batch.kind, sequence: self.sequence, first: 0, count: 0 };
                if !self.send(wires, run) {
                    return did.or(Tick::Blocked);
                }
                self.next_sequence();
                did = Tick::Moved;
            }

            // 3. The batch is used up: its vertices may be overwritten.
            if batch.kind == Kind::DATA && self.ports.passed.is_some() {
                self.take_indices(card, &batch);
            }
            if batch.kind == Kind::DATA && batch.vertices > 0 {
                if !wires.try_push(&self.ports.retired, WarpToken { warp: batch.number }) {
                    return did.or(Tick::Blocked);
                }
                self.shaded.retire(batch.number);
            }
            if batch.kind == Kind::SEGMENT {
                self.next = 0;
                if self.ports.passed.is_some() {
                    self.before = self.before.wrapping_add(card.work(batch.slot).segment.stream.len() as u32);
                    self.passed = self.before;
                }
            }
            wires.take(&self.ports.batches);
            did = Tick::Moved;
        }
        did
    }
}
