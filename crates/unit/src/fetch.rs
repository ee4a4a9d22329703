//! Index and attribute fetch with post-transform reuse: reads indices in order, shades each vertex once as long as it is among the
//! last few, gathers vertices into batches, fetches their attributes, and sends the batches to the cores.

use std::collections::VecDeque;

use super::card::{Card, Work};
use super::index_runs::{IndexRuns, Walk};
use super::misses::Misses;
use super::sorting::Waits;
use super::tags::{CacheCounts, Tags};
use super::token::{Kind, Piece, Run, VertexBatch, WarpToken};
use super::warp::{Item, Program};
use crate::assembly::MAX_BATCHES;
use gfx::state::StepMode;
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, Gate, In, Out, Tick, Unit, Wires};
use work::LINE;

knob::knobs! {
    /// Index and attribute fetch.
    pub struct FetchConfig {
        /// Indices read a cycle.
        indices_per_cycle: u32 ["indices/cycle", Allowed::Range(1, 32), "ATTILA bGPU.ini STREAMER IndicesCycle = 2; three make a triangle"],
        /// Lines of indices held or on their way: the index buffer.
        index_lines: u32 ["lines", Allowed::Range(1, 1024), "ATTILA bGPU.ini IndexBufferSize = 2048 bytes"],
        /// Vertices that are remembered as shaded, first in first out.
        reuse: u32 ["vertices", Allowed::Range(0, 4096), "16 to 32 in cards with a post-transform FIFO (Hoppe 1999, Forsyth 2006)"],
        /// Lines of vertex attributes looked up a cycle.
        lookups_per_cycle: u32 ["lines/cycle", Allowed::Range(1, 32), "ATTILA bGPU.ini SLAttributesCycle = 8 attributes"],
        /// Whether only those attributes are fetched that the vertex stage reads; if not, all that the vertex buffers of a draw have.
        skip_attributes: bool ["", Allowed::Switch, "drivers tell the fetch what the compiled shader reads; off shows what that is worth"],
        /// 64-byte lines of the attribute cache.
        cache_lines: u32 ["lines", Allowed::PowerOfTwo(2, 65536), "8 KB: ATTILA bGPU.ini SLInputCacheLines = 32 of 256 bytes"],
        /// Ways of the attribute cache.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(1, 65536), "fully associative in ATTILA"],
        /// Requests for lines of attributes in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "ATTILA bGPU.ini SLInputRequestQueueSize = 128"],
        /// Batches of vertices in flight, from the first index to the last primitive assembled.
        batches: u32 ["batches", Allowed::Range(1, MAX_BATCHES as u64), "ATTILA bGPU.ini OutputMemorySize = 512 vertices: 16 batches of 32"],
        /// Cycles without a further vertex after which a batch is started though it is not full. Only where geometry belongs to
        /// pipelines, which get their primitives in runs: elsewhere the end of a draw is known.
        patience: u32 ["cycles", Allowed::Range(1, 4096), "as that of fragments: short against an access to memory"],
        /// Cycles from here to the cores.
        latency: u32 ["cycles", Allowed::Range(1, 64), "wires and input registers"],
        /// Batches queued before each core.
        queue: u32 ["batches", Allowed::Range(2, 64), "two: one arriving, one waiting"],
    }
}

/// What vertex fetch is given.
pub enum FetchInput {
    /// Whole segments, from the command processor.
    Segments(In<Piece>),
    /// Runs of primitives, whose indices are read here.
    Runs(In<Run>),
    /// Runs of primitives that bring the numbers of their vertices with them.
    Routed(In<Run>),
    /// Runs of primitives that bring their vertices' attributes with them.
    Brought(In<Run>),
}

impl FetchInput {
    /// Whether they are runs.
    #[inline(always)]
    fn in_runs(&self) -> bool {
        !matches!(self, FetchInput::Segments(_))
    }
}

/// Ports of vertex fetch.
pub struct FetchPorts {
    /// Primitives and fences.
    pub input: FetchInput,
    /// Vertex batches to each core that shades vertices, with the core's cluster of warps.
    pub cores: Vec<(usize, Out<WarpToken>)>,
    /// Batches in order, to assembly.
    pub batches: Out<VertexBatch>,
    /// Batches that assembly has used up.
    pub retired: In<WarpToken>,
    /// Memory, for indices.
    pub index: MemoryPort,
    /// Memory, for attributes.
    pub vertex: MemoryPort,
    /// Where it is told what it waits for.
    pub gate: Gate,
}

/// A batch whose attributes are on their way.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    slot: u16,
    number: u32,
    stream_end: u32,
    /// First vertex of the batch in `vertices`, and how many.
    count: u32,
    needs: Option<u32>,
    /// Announced to assembly already.
    announced: bool,
    /// Data, or a mark, which is only announced.
    kind: Kind,
}

/// Vertex fetch. Its items are indices.
pub struct Fetch {
    config: FetchConfig,
    width: u32,
    ports: FetchPorts,
    tags: Tags<u32>,
    misses: Misses,
    index_misses: Misses,
    /// Next line of indices to be requested, and how many of the segment were; relative to its first.
    index_next: u64,
    /// The vertices at hand, and the next of them.
    walk: Walk,
    position: u32,
    /// The segment that was begun last.
    segment: Option<u32>,
    /// When the open batch is started even if it is not full.
    start_at: Cycle,
    /// Slot of the segment whose vertices are in the open batch.
    open_slot: u16,
    /// The attribute and line of the current vertex to be looked up; the vertex is in the batch already.
    attribute: usize,
    attribute_line: u64,
    vertex_open: bool,
    /// The last line looked up: attributes of a vertex mostly share it.
    last_line: u64,
    last_needs: u32,
    /// Vertices shaded since the start, and for each vertex of the segment its number among them, or one long gone.
    shaded: u32,
    shaded_at: Vec<u32>,
    /// The last `reuse` vertices as (index, instance), kept over the segments of a draw.
    recent: VecDeque<(u32, u32)>,
    draw: Option<u32>,
    begun: bool,
    /// Runs taken in ahead.
    runs: IndexRuns,
    /// Whether the vertices of the input are counted here.
    counts: bool,
    /// Whether attributes have come with the primitives.
    brought: bool,
    /// Vertices of the batches gathered, in order, and of the one that is open.
    vertices: VecDeque<u32>,
    open: u32,
    open_needs: Option<u32>,
    number: u32,
    in_flight: u32,
    gathered: VecDeque<Gathered>,
    /// Of runs, the batches that are closed and not yet on a core.
    closed: VecDeque<Gathered>,
    core: usize,
    epoch: u32,
    items: u64,
}

impl Fetch {
    /// An empty one, which fills batches of `width` vertices.
    pub fn new(config: FetchConfig, width: u32, ports: FetchPorts) -> Fetch {
        Fetch {
            tags: Tags::new(config.cache_lines, config.cache_ways),
            misses: Misses::new(config.misses),
            index_misses: Misses::new(config.index_lines),
            index_next: 0,
            walk: Walk::default(),
            position: 0,
            segment: None,
            start_at: 0,
            open_slot: 0,
            attribute: 0,
            attribute_line: 0,
            vertex_open: false,
            last_line: u64::MAX,
            last_needs: 0,
            shaded: 0,
            shaded_at: Vec::new(),
            recent: VecDeque::with_capacity(config.reuse as usize + 1),
            draw: None,
            begun: false,
            runs: IndexRuns::new(config.index_lines),
            counts: matches!(ports.input, FetchInput::Segments(_) | FetchInput::Runs(_)),
            brought: matches!(ports.input, FetchInput::Brought(_)),
            vertices: VecDeque::new(),
            open: 0,
            open_needs: None,
            number: 0,
            in_flight: 0,
            gathered: VecDeque::new(),
            closed: VecDeque::new(),
            core: 0,
            epoch: 0,
            items: 0,
            config,
            width,
            ports,
        }
    }

    /// What the attribute cache counts.
    pub fn cache(&self) -> CacheCounts {
        self.tags.counts()
    }

    /// Makes ready for a segment. What was shaded lately in the same draw is still there; a new draw starts afresh.
    #[cold]
    fn begin(&mut self, card: &Card, slot: u16) {
        let work = card.work(slot);
        let vertices = &work.segment.vertices;
        self.shaded_at.clear();
        // A vertex that was never shaded stands as one of half the numbers ago; a segment is far shorter than that.
        self.shaded_at.resize(vertices.len(), self.shaded.wrapping_sub(1 << 31));
        if self.draw != Some(work.draw_number) {
            self.draw = Some(work.draw_number);
            self.recent.clear();
        } else if !self.recent.is_empty() {
            let mut known: Vec<_> = self.recent.iter().enumerate().map(|(at, &vertex)| (vertex, at)).collect();
            known.sort_unstable();
            let first = self.shaded.wrapping_sub(self.recent.len() as u32);
            for (vertex, at) in vertices.iter().zip(&mut self.shaded_at) {
                let wanted = (vertex.index, vertex.instance);
                if let Ok(found) = known.binary_search_by_key(&wanted, |&(vertex, _)| vertex) {
                    *at = first.wrapping_add(known[found].1 as u32);
                }
            }
        }
        if self.epoch != card.epoch {
            self.epoch = card.epoch;
            self.tags.clear();
        }
        self.last_line = u64::MAX;
        self.last_needs = self.misses.frontier();
        self.segment = Some(work.number);
    }

    /// Takes a segment or a run in hand.
    fn open(&mut self, card: &Card, run: Run) {
        let work = card.work(run.slot);
        if self.segment != Some(work.number) {
            self.begin(card, run.slot);
        }
        self.walk = if self.ports.input.in_runs() {
            self.announce(Kind::RUN, run.slot, run.sequence, run.first, run.count);
            Walk::run(&work.segment, run.first, run.count)
        } else {
            Walk::segment(&work.segment)
        };
        self.position = 0;
        self.index_next = 0;
        self.begun = true;
    }

    /// Puts a mark for assembly behind the batches.
    fn announce(&mut self, kind: Kind, slot: u16, number: u32, stream_end: u32, count: u32) {
        self.gathered.push_back(Gathered { slot, number, stream_end, count, needs: None, announced: false, kind });
    }

    /// Entries of the segment's stream that have been read, as far as primitives of the run at hand are concerned.
    #[inline(always)]
    fn stream_end(&self) -> u32 {
        if self.begun && self.position >= self.walk.head_count { self.walk.entry(self.position) } else { 0 }
    }

    /// Requests lines of indices ahead of their use; true if any was.
    #[inline(always)]
    fn request_indices(&mut self, wires: &mut Wires, work: &Work) -> bool {
        let Some(start) = work.segment.index_address else { return false };
        let bytes = u64::from(self.walk.length) * u64::from(work.segment.index_bytes);
        if bytes == 0 {
            return false;
        }
        let (first, last) = (start / LINE, (start + bytes - 1) / LINE);
        // The line of the next index is the first that still takes a place of the index buffer.
        let used = (start % LINE + u64::from(self.position) * u64::from(work.segment.index_bytes)) / LINE;
        let end = used + u64::from(self.config.index_lines);
        let mut moved = false;
        while first + self.index_next <= last && self.index_next < end && self.ports.index.can_send(wires) {
            let tag = self.index_misses.issue();
            self.ports.index.read(wires, (first + self.index_next) * LINE, LINE as u32, tag);
            self.index_next += 1;
            moved = true;
        }
        moved
    }

    /// The first vertex at hand whose index has not come.
    #[inline(always)]
    fn indices_here(&self, work: &Work) -> u32 {
        let length = self.walk.length;
        let Some(start) = work.segment.index_address else { return length };
        // The misses of this segment are the last `index_next` issued; those before the frontier are back.
        let away = self.index_misses.in_flight().min(self.index_next as u32);
        let lines = self.index_next - u64::from(away);
        let bytes = (lines * LINE).saturating_sub(start % LINE);
        // A draw with indices of no bytes reads none.
        (bytes / u64::from(work.segment.index_bytes.max(1))).min(u64::from(length)) as u32
    }

    /// Looks up the lines of the current vertex's attributes.
    #[inline(always)]
    fn look_up(&mut self, wires: &mut Wires, work: &Work, budget: &mut u32) -> Result<(), Tick> {
        let Some(&vertex) = self.vertices.back() else { return Ok(()) };
        let vertex = &work.segment.vertices[vertex as usize];
        while let Some(fetch) = work.draw.attributes.get(self.attribute) {
            let element = match fetch.step {
                StepMode::Vertex => vertex.index,
                StepMode::Instance => vertex.instance,
            };
            let address = fetch.address + u64::from(element) * fetch.stride;
            let last = (address + u64::from(fetch.bytes.max(1)) - 1) / LINE;
            loop {
                let line = address / LINE + self.attribute_line;
                if line > last {
                    break;
                }
                if line != self.last_line {
                    if *budget == 0 {
                        return Err(Tick::Moved);
                    }
                    self.last_needs = if let Some(place) = self.tags.find(line) {
                        *self.tags.data(place)
                    } else {
                        if self.misses.room() == 0 {
                            return Err(Tick::Memory);
                        }
                        if !self.ports.vertex.can_send(wires) {
                            return Err(Tick::Blocked);
                        }
                        let tag = self.misses.issue();
                        self.ports.vertex.read(wires, line * LINE, LINE as u32, tag);
                        let place = self.tags.victim(line, |_| true).expect("any line may go");
                        self.tags.replace(place, line, self.misses.issued());
                        self.misses.issued()
                    };
                    *budget -= 1;
                    self.last_line = line;
                }
                // The same line as just before, for this vertex or the one before, is not looked up again.
                if !self.misses.reached(self.last_needs) {
                    self.open_needs = self.misses.later(self.open_needs, self.last_needs);
                }
                self.attribute_line += 1;
            }
            self.attribute += 1;
            self.attribute_line = 0;
        }
        self.vertex_open = false;
        Ok(())
    }

    /// Closes the open batch.
    fn close(&mut self, slot: u16) {
        let batch = Gathered {
            slot,
            number: self.number,
            stream_end: self.stream_end(),
            count: self.open,
            needs: self.open_needs,
            announced: false,
            kind: Kind::DATA,
        };
        self.gathered.push_back(batch);
        if self.ports.input.in_runs() {
            self.closed.push_back(batch);
        }
        self.number = self.number.wrapping_add(1);
        self.in_flight += u32::from(self.open > 0);
        self.open = 0;
        self.open_needs = None;
    }

    /// Announces batches to assembly, and starts them on cores when their attributes are there.
    #[inline(always)]
    fn start(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        // Assembly may wait for a batch of runs before its announcement has a place on the way there.
        while let Some(&batch) = self.closed.front() {
            if let Err(stall) = self.shade(wires, card, batch) {
                did = did.or(stall);
                break;
            }
            self.closed.pop_front();
            did = Tick::Moved;
        }
        while let Some(batch) = self.gathered.front_mut() {
            if !batch.announced {
                let Gathered { slot, kind, number, stream_end, count, .. } = *batch;
                let token = VertexBatch { slot, kind, number, stream_end, vertices: count };
                if !wires.try_push(&self.ports.batches, token) {
                    return did.or(Tick::Blocked);
                }
                batch.announced = true;
                did = Tick::Moved;
            }
            let batch = *batch;
            if !self.ports.input.in_runs()
                && batch.count > 0
                && let Err(stall) = self.shade(wires, card, batch)
            {
                return did.or(stall);
            }
            self.gathered.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Starts a batch on a core.
    #[inline(always)]
    fn shade(&mut self, wires: &mut Wires, card: &mut Card, batch: Gathered) -> Result<(), Tick> {
        if batch.needs.is_some_and(|needs| !self.misses.reached(needs)) {
            return Err(Tick::Memory);
        }
        let cores = self.ports.cores.len();
        let free = (0..cores).map(|ahead| (self.core + ahead) % cores).find(|&core| {
            let (_, output) = &self.ports.cores[core];
            wires.can_push(output)
        });
        let Some(core) = free else { return Err(Tick::Blocked) };
        self.core = (core + 1) % cores;
        let (cluster, output) = &self.ports.cores[core];
        let Card { work, warps, .. } = card;
        let work = work[usize::from(batch.slot)].as_ref().expect("a batch's segment is in flight");
        let index = warps[*cluster].insert(Program::Vertex, batch.slot, work.draw.vertex.registers);
        let warp = &mut warps[*cluster][index];
        warp.number = batch.number;
        for vertex in self.vertices.drain(..batch.count as usize) {
            let vertex = &work.segment.vertices[vertex as usize];
            warp.items.push(Item { source: 0, request: vertex.first_request, cost: vertex.cost });
        }
        warp.merge(|_| &work.segment.costs);
        wires.push(output, WarpToken { warp: index });
        Ok(())
    }

    /// What is at the head of the input, or of the runs that have been taken in ahead.
    #[inline(always)]
    fn front(&mut self, wires: &mut Wires) -> Option<Run> {
        match &self.ports.input {
            FetchInput::Segments(input) => {
                let Piece { slot, kind } = wires.front(input)?;
                Some(Run { slot, kind, sequence: 0, first: 0, count: 0 })
            }
            _ => self.runs.front(),
        }
    }

    /// Takes it.
    fn take(&mut self, wires: &mut Wires) {
        match &self.ports.input {
            FetchInput::Segments(input) => wires.take(input),
            _ => self.runs.take(),
        }
    }

    /// With nothing at the input: in time the open batch is started as it is.
    fn wait(&mut self, wires: &mut Wires) -> Tick {
        if self.open == 0 || !self.ports.input.in_runs() {
            return Tick::Starved;
        }
        if self.start_at > wires.now() {
            wires.sleep_until(self.start_at);
            return Tick::Starved;
        }
        self.close(self.open_slot);
        Tick::Moved
    }

    /// Reads indices, finds vertices that must be shaded, looks up their attributes.
    #[inline(always)]
    fn read(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut indices = self.config.indices_per_cycle;
        let mut lookups = self.config.lookups_per_cycle;
        loop {
            let Some(piece) = self.front(wires) else { return did.or(self.wait(wires)) };
            if piece.kind.is_fence() {
                // In runs the batch may still be open.
                if self.open > 0 {
                    self.close(self.open_slot);
                    return Tick::Moved;
                }
                // A fence follows the batches before it.
                if !self.gathered.is_empty() || !self.closed.is_empty() {
                    return did;
                }
                let Run { slot, kind, sequence, .. } = piece;
                let token = VertexBatch { slot, kind, number: sequence, stream_end: 0, vertices: 0 };
                if !wires.try_push(&self.ports.batches, token) {
                    return did.or(Tick::Blocked);
                }
                self.take(wires);
                did = Tick::Moved;
                continue;
            }
            if !self.begun && self.gathered.len() > 2 * self.config.batches as usize {
                // What assembly waits for may be the open batch.
                if self.open > 0 {
                    self.close(self.open_slot);
                    return Tick::Moved;
                }
                return did.or(Tick::Blocked);
            }
            if piece.kind == Kind::END {
                self.announce(Kind::END, piece.slot, piece.sequence, 0, 0);
                self.take(wires);
                did = Tick::Moved;
                continue;
            }
            if !self.begun {
                // A warp runs one program with one state, and vertices are known by their number in a segment.
                if self.open > 0 && self.segment != Some(card.work(piece.slot).number) {
                    self.close(self.open_slot);
                }
                self.open(card, piece);
                did = Tick::Moved;
            }
            let work = card.work[usize::from(piece.slot)].as_ref().expect("a piece is in flight");
            if !self.ports.input.in_runs() && self.request_indices(wires, work) {
                did = Tick::Moved;
            }
            let length = self.walk.length;
            let here = if self.ports.input.in_runs() {
                self.runs.here(work, &self.walk, self.position)
            } else {
                self.indices_here(work)
            };
            loop {
                // 1. The attributes of the vertex at hand.
                if self.vertex_open {
                    let before = (self.attribute, self.attribute_line);
                    let result = self.look_up(wires, work, &mut lookups);
                    if result.is_ok() || before != (self.attribute, self.attribute_line) {
                        did = Tick::Moved;
                    }
                    if let Err(stall) = result {
                        return did.or(stall);
                    }
                }
                // 2. A full batch goes on its way.
                if self.open == self.width {
                    self.close(piece.slot);
                    did = Tick::Moved;
                }
                if self.position == length {
                    break;
                }
                if self.in_flight >= self.config.batches {
                    return did.or(Tick::Blocked);
                }
                // 3. Indices of vertices that are still among the last few shaded need nothing more.
                let stream = self.walk.ahead(&work.segment, self.position, here.max(self.position));
                let mut vertex = u32::MAX;
                let (mut read, mut restarts) = (0, 0);
                for &next in &stream[..stream.len().min(indices as usize)] {
                    read += 1;
                    if next == u32::MAX {
                        restarts += 1;
                    } else if self.shaded.wrapping_sub(self.shaded_at[next as usize]) > self.config.reuse {
                        vertex = next;
                        break;
                    }
                }
                if read == 0 {
                    return if stream.is_empty() { did.or(Tick::Memory) } else { Tick::Moved };
                }
                did = Tick::Moved;
                indices -= read;
                self.position += read;
                self.items += u64::from(read - restarts);
                if self.counts {
                    card.funnel.vertices_in += u64::from(read - restarts);
                }
                if vertex == u32::MAX {
                    continue;
                }
                // 4. It must be shaded.
                self.shaded_at[vertex as usize] = self.shaded;
                self.shaded = self.shaded.wrapping_add(1);
                card.funnel.vertices_shaded += 1;
                if self.config.reuse > 0 {
                    if self.recent.len() as u32 == self.config.reuse {
                        self.recent.pop_front();
                    }
                    let vertex = &work.segment.vertices[vertex as usize];
                    self.recent.push_back((vertex.index, vertex.instance));
                }
                self.vertices.push_back(vertex);
                self.open += 1;
                self.open_slot = piece.slot;
                self.start_at = wires.now() + Cycle::from(self.config.patience);
                (self.attribute, self.attribute_line, self.vertex_open) = (0, 0, !self.brought);
            }
            // 5. All is read. What is left of a segment is a batch too; what is left of a run waits for that of the next.
            if !self.ports.input.in_runs() {
                self.close(piece.slot);
            } else {
                let waits = u32::from(self.open > 0);
                self.announce(Kind::PART, piece.slot, self.number, self.stream_end(), waits);
            }
            self.begun = false;
            self.take(wires);
            did = Tick::Moved;
        }
    }
}

impl Fetch {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. What memory has brought, and what assembly no longer needs.
        while let Some(tag) = self.ports.vertex.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        if !self.ports.input.in_runs() {
            while let Some(tag) = self.ports.index.answer(wires) {
                self.index_misses.answer(tag);
                did = Tick::Moved;
            }
        }
        while wires.pop(&self.ports.retired).is_some() {
            self.in_flight -= 1;
            did = Tick::Moved;
        }

        // 2. Complete batches go to the cores.
        did = did.or(self.start(wires, card));

        // 3. Indices come in.
        match &self.ports.input {
            FetchInput::Segments(_) => {}
            FetchInput::Runs(input) => did = did.or(self.runs.take_in(wires, card, input, Some(&self.ports.index))),
            FetchInput::Routed(input) | FetchInput::Brought(input) => {
                did = did.or(self.runs.take_in(wires, card, input, None));
            }
        }
        did = did.or(self.read(wires, card));
        if self.runs.freed() { Tick::Moved } else { did }
    }
}

impl Unit<Card> for Fetch {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        wires.tell(&self.ports.gate, Waits::of_front(did) as u8);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        (self.gathered.len() + self.closed.len()) as u64
            + u64::from(self.open)
            + u64::from(self.in_flight)
            + self.runs.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("vertex"), |unit| unit.tags.counts());
    }
}
