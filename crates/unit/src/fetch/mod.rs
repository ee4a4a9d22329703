//! Index and attribute fetch with post-transform reuse: reads indices in order, shades each vertex once as long as it is among the
//! last few, gathers vertices into batches, fetches their attributes, and sends the batches to the cores.

mod ahead;
mod batch;
mod batched;
mod deal;
mod input;

use std::collections::VecDeque;

use super::card::Card;
use super::index_runs::{IndexRuns, Walk};
use super::misses::Misses;
use super::network::Stall;
use super::tags::{CacheCounts, Tags};
use super::token::{Kind, Packing, Piece, Run, VertexBatch, WarpToken};
use crate::assembly::MAX_BATCHES;
use batched::Reading;
use deal::Deal;
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, In, Out, StallProbe, Tick, Unit, Wires};

knob::choices! {
    /// Which core gets the next batch of vertices.
    pub enum VertexDeal {
        /// The next that has place for it, in turn.
        RoundRobin "round-robin",
        /// The first that has place for it.
        First "first",
        /// The next, from the one that the last warp of fragments went to, or that quads wait for in the first pipeline or in one that is held up.
        AfterFragments "after-fragments",
    }
}

knob::choices! {
    /// How long a vertex that is shaded once can be used again.
    pub enum Reuse {
        /// Until `fetch.reuse` others have been shaded.
        Replaced "replaced",
        /// Until the last of its indices that have been read goes to assembly. At most `fetch.reuse` indices are on their way there.
        Assembled "assembled",
        /// Within its batch, until `fetch.reuse` others have been shaded. A batch holds whole primitives.
        Batch "batch",
    }
}

knob::knobs! {
    /// Index and attribute fetch.
    pub struct FetchConfig {
        /// Indices read per cycle.
        indices_per_cycle: u32 ["indices/cycle", Allowed::Range(1, 32), "three make a triangle: eight triangles, which cards of 2014 cull, twice what they draw (zeux.io 2023, Fine-grained backface culling)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Segments of draws (or runs of primitives, where geometry belongs to pipelines) and their marks, taken in ahead of their turn. The
        /// indices of all of them are requested.
        runs: u32 ["entries", Allowed::Range(1, 4096), "assumed: covers the latency of memory with draws of one triangle, each of which has a mark"]
            {estimate: RefusedUnless(AtLeast(32), "draws whose indices are not asked for ahead"), relax: Never, advice: []},
        /// Lines of indices held or on their way: the index buffer.
        index_lines: u32 ["lines", Allowed::Range(1, 1024), "assumed: covers the latency of memory at the rate of indices; ATTILA bGPU.ini IndexBufferSize = 2048 bytes"]
            {estimate: Used, relax: Room, advice: []},
        /// Vertices that are remembered as shaded, first in first out; of a batch at most its own, where they are reused within it.
        reuse: u32 ["vertices", Allowed::Range(0, 4096), "batches of 32 vertices (Kerbl et al. 2018); 16 to 32 in cards with a post-transform FIFO (Hoppe 1999, Forsyth 2006)"]
            {estimate: RefusedUnless(AtLeast(4), "vertices that are shaded again because few are kept"), relax: Cache, advice: []},
        /// How long a vertex that is shaded once can be used again. `assembled` is for whole draws, not for runs of primitives.
        reuse_until: Reuse ["", Allowed::Choice(Reuse::NAMES), "batches in cards of 2012 to 2018 (Kerbl et al. 2018), a FIFO in older ones; ATTILA frees a line of its output memory with the last index on its way"]
            {estimate: RefusedUnless(Is(&["batch", "replaced"]), "vertices that are kept for their last index"), relax: Never, advice: []},
        /// Indices of the primitives of a batch of vertices, at most, where vertices are reused within their batch.
        batch_indices: u32 ["indices", Allowed::Range(3, 4096), "96 on NVIDIA cards, 384 on AMD's (Kerbl et al. 2018, Revisiting the Vertex Cache)"]
            {estimate: RefusedUnless(Is(&["96"]), "other batches of vertices"), relax: Never, advice: []},
        /// Vertices that wait for their attributes to be looked up while further indices are read, where vertices are reused until they are
        /// assembled.
        ahead: u32 ["vertices", Allowed::Range(1, 1024), "assumed; ATTILA bGPU.ini SLInputRequestQueueSize = 128"]
            {estimate: Ignored("without effect where fetch.reuse_until is not assembled"), relax: Never, advice: []},
        /// Lines of vertex attributes looked up per cycle.
        lookups_per_cycle: u32 ["lines/cycle", Allowed::Range(1, 32), "assumed: two for each triangle read; ATTILA bGPU.ini SLAttributesCycle = 8 attributes"]
            {estimate: Used, relax: Rate, advice: []},
        /// Whether only those attributes are fetched that the vertex stage reads; if not, all that the vertex buffers of a draw have.
        skip_attributes: bool ["", Allowed::Switch, "drivers tell the fetch what the compiled shader reads; off shows what that is worth"]
            {estimate: RefusedUnless(Is(&["true"]), "attributes that no vertex shader reads"), relax: Skip(&[("true", "only attributes that are read")]), advice: []},
        /// Bytes of a line of the attribute cache, which is fetched whole.
        line_bytes: u32 ["bytes", Allowed::PowerOfTwo(64, 256), "assumed: a memory line; ATTILA bGPU.ini SLInputCacheLineSize = 256"]
            {estimate: RefusedUnless(Is(&["64"]), "longer lines of attributes"), relax: Never, advice: []},
        /// Lines of the attribute cache.
        cache_lines: u32 ["lines", Allowed::PowerOfTwo(2, 65536), "assumed: 256 KB stand for the first-level caches of 16 multiprocessors; ATTILA bGPU.ini SLInputCacheLines = 32 of 256 bytes"]
            {estimate: RefusedUnless(AtLeast(32), "misses of attributes"), relax: Cache, advice: [Cache("vertex")]},
        /// Ways of the attribute cache.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(1, 65536), "fully associative in ATTILA"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Requests for lines of attributes in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory at the rate of attributes; ATTILA bGPU.ini SLInputRequestQueueSize = 128"]
            {estimate: RefusedUnless(AtLeast(32), "waits for attributes"), relax: Room, advice: []},
        /// Batches of vertices in flight, from the first index to the last primitive assembled.
        batches: u32 ["batches", Allowed::Range(1, MAX_BATCHES as u64), "assumed: covers the latency of memory at the rate of indices; ATTILA bGPU.ini OutputMemorySize = 512 vertices: 16 batches of 32"]
            {estimate: Used, relax: Room, advice: []},
        /// Batches, runs and marks that have been read and that assembly has not taken.
        announced: u32 ["entries", Allowed::Range(4, 8192), "assumed: three entries for each run of primitives in a few batches"]
            {estimate: RefusedUnless(AtLeast(64), "short queues in front of assembly"), relax: Never, advice: []},
        /// Cycles without a further vertex after which a batch is started though it is not full. Only where geometry belongs to
        /// pipelines, which get their primitives in runs: elsewhere the end of a draw is known.
        patience: u32 ["cycles", Allowed::Range(1, 4096), "assumed: as that of fragments: short against an access to memory"]
            {estimate: RefusedUnless(AtMost(64), "vertices that wait for a full warp"), relax: Never, advice: []},
        /// Which core gets the next batch of vertices.
        deal: VertexDeal ["", Allowed::Choice(VertexDeal::NAMES), "in turn; ATTILA has one pointer for vertices and fragments (FragmentFIFO, TiledShaderDistribution = TRUE)"]
            {estimate: RefusedUnless(Is(&["round-robin"]), "vertices that are not dealt in turn"), relax: Never, advice: []},
        /// Warps of vertices and fragments that one core gets, where vertices follow fragments, before the turn goes to the next core.
        deal_warps: u32 ["warps", Allowed::Range(1, 4096), "assumed; ATTILA bGPU.ini ShaderInputBatchSize = 64 invocations: four warps"]
            {estimate: Ignored("without effect where fetch.deal is round-robin"), relax: Never, advice: []},
        /// Vertices that go to the cores in a cycle; 0: a whole batch.
        vertices_per_cycle: u32 ["vertices/cycle", Allowed::Range(0, 64), "assumed to be no limit; ATTILA bGPU.ini SLIndicesCycle = 2"]
            {estimate: RefusedUnless(Is(&["0"]), "a rate of vertices to the cores"), relax: Rate, advice: []},
        /// Cycles from here to the cores.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed: wires and input registers"] {estimate: Used, relax: Latency, advice: []},
        /// Batches queued before each core.
        queue: u32 ["batches", Allowed::Range(2, 64), "assumed: two: one arriving, one waiting"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

/// The input of vertex fetch.
#[derive(Clone)]
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
    /// Whether the input is runs of primitives.
    #[inline(always)]
    fn in_runs(&self) -> bool {
        !matches!(self, FetchInput::Segments(_))
    }
}

/// Ports of vertex fetch.
#[derive(Clone)]
pub struct FetchPorts {
    /// Primitives and fences.
    pub input: FetchInput,
    /// Vertex batches to each core that shades vertices, with the core's cluster of warps.
    pub cores: Vec<(usize, Out<WarpToken>)>,
    /// Batches in order, to assembly.
    pub batches: Out<VertexBatch>,
    /// Batches that assembly has used up.
    pub retired: In<WarpToken>,
    /// How many indices assembly has taken since the start, where vertices can be used again until then.
    pub passed: Option<In<WarpToken>>,
    /// Which cores fragments go to, from each pipeline, where batches of vertices follow them.
    pub fragments: Vec<In<Packing>>,
    /// Memory, for indices.
    pub index: MemoryPort,
    /// Memory, for attributes.
    pub vertex: MemoryPort,
    /// Its state is what the unit waits for.
    pub probe: StallProbe,
}

/// A whole segment, or a fence, as a run.
fn whole(Piece { slot, kind }: Piece) -> Run {
    Run { slot, kind, sequence: 0, first: 0, count: 0 }
}

/// Entries on their way to assembly in a cycle, beyond which no further run is taken in hand.
const ENTRIES: usize = 2;

/// A batch whose attributes are on their way.
#[derive(Clone, Copy, Debug)]
struct Gathered {
    slot: u16,
    number: u32,
    stream_end: u32,
    /// First vertex of the batch in `vertices`, and how many.
    count: u32,
    needs: Option<u32>,
    /// Data, or a mark, which is only announced.
    kind: Kind,
}

/// Vertex fetch. Its items are indices.
#[derive(Clone)]
pub struct Fetch {
    config: FetchConfig,
    width: u32,
    ports: FetchPorts,
    tags: Tags<u32>,
    misses: Misses,
    /// The current vertices, and the next of them.
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
    /// Vertices shaded since the start, and for each vertex of the segment its number among them, or one long gone. Where vertices are
    /// reused until they are assembled, indices are counted instead, and each vertex has the number of its last.
    shaded: u32,
    shaded_at: Vec<u32>,
    /// The last `reuse` vertices, or the indices that assembly has not taken, as (index, instance); kept over the segments of a draw.
    recent: VecDeque<(u32, u32)>,
    /// Vertices that wait for their attributes to be looked up, each with the place in the stream behind its index.
    waiting: VecDeque<(u32, u32)>,
    /// That place of the last vertex of the open batch; and how far the batches that are closed go.
    open_end: u32,
    closed_end: u32,
    draw: Option<u32>,
    begun: bool,
    /// Segments or runs taken in ahead.
    runs: IndexRuns,
    /// The primitive that is read, if vertices are reused within their batch.
    reading: Reading,
    /// Whether the vertices of the input are counted here.
    counts: bool,
    /// Whether attributes have come with the primitives.
    brought: bool,
    /// Vertices of the batches gathered, in order, and of the one that is open.
    vertices: VecDeque<u32>,
    open: u32,
    open_needs: Option<u32>,
    /// The number of the open batch. Those of all batches in flight are the numbers before it, without gaps.
    number: u32,
    in_flight: u32,
    /// The batches that are to be announced to assembly, in order.
    gathered: VecDeque<Gathered>,
    /// The batches that are closed and not yet on a core.
    closed: VecDeque<Gathered>,
    deal: Deal,
    epoch: u32,
    /// The cycle from which the path to the cores is free, if it has a width.
    way_free: Cycle,
    items: u64,
}

impl Fetch {
    /// Numbers of the memory ports for indices and for attributes.
    pub(super) fn ports(&self) -> [u16; 2] {
        [self.ports.index.number, self.ports.vertex.number]
    }

    /// An idle fetch unit, which fills batches of `width` vertices.
    pub fn new(config: FetchConfig, width: u32, ports: FetchPorts) -> Fetch {
        Fetch {
            tags: Tags::new(config.cache_lines, config.cache_ways),
            misses: Misses::new(config.misses),
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
            waiting: VecDeque::new(),
            open_end: 0,
            closed_end: 0,
            draw: None,
            begun: false,
            runs: IndexRuns::new(config.index_lines, config.runs),
            reading: Reading::default(),
            counts: matches!(ports.input, FetchInput::Segments(_) | FetchInput::Runs(_)),
            brought: matches!(ports.input, FetchInput::Brought(_)),
            vertices: VecDeque::new(),
            open: 0,
            open_needs: None,
            number: 0,
            in_flight: 0,
            gathered: VecDeque::new(),
            closed: VecDeque::new(),
            deal: Deal::new(&config, ports.cores.len(), ports.fragments.len()),
            epoch: 0,
            way_free: 0,
            items: 0,
            config,
            width,
            ports,
        }
    }

    /// The counters of the attribute cache.
    pub fn cache(&self) -> CacheCounts {
        self.tags.counts()
    }
}

impl Fetch {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Take the lines that memory has brought, and the batches that assembly no longer needs.
        while let Some(tag) = self.ports.vertex.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        while wires.pop(&self.ports.retired).is_some() {
            self.in_flight -= 1;
            did = Tick::Moved;
        }
        while let Some(passed) = self.ports.passed.as_ref().and_then(|passed| wires.pop(passed)) {
            self.pass(passed.warp);
            did = Tick::Moved;
        }
        let (mut told, mut started) = (false, false);
        for (pipeline, fragments) in self.ports.fragments.iter().enumerate() {
            while let Some(packing) = wires.pop(fragments) {
                self.deal.told(pipeline, packing);
                (told, started) = (true, started | packing.has(Packing::STARTED));
            }
        }
        if told {
            self.deal.settle(started);
            did = Tick::Moved;
        }

        // 2. Complete batches go to the cores.
        did = did.or(self.start(wires, card));

        // 3. Indices come in.
        if self.begun
            && let Some(run) = self.runs.front()
        {
            self.runs.use_up(card.work(run.slot), &self.walk, self.position);
        }
        let (runs, index) = (&mut self.runs, &self.ports.index);
        did = did.or(match &self.ports.input {
            FetchInput::Segments(input) => {
                let next = |wires: &mut Wires| wires.pop(input).map(whole);
                runs.take_in(wires, card, next, Walk::segment, Some(index))
            }
            FetchInput::Runs(input) => runs.take_in(wires, card, |wires| wires.pop(input), Walk::run, Some(index)),
            FetchInput::Routed(input) | FetchInput::Brought(input) => {
                runs.take_in(wires, card, |wires| wires.pop(input), Walk::run, None)
            }
        });
        did = did.or(self.read(wires, card));
        if self.runs.freed() { Tick::Moved } else { did }
    }
}

impl Unit<Card> for Fetch {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        wires.set_probe(&self.ports.probe, Stall::of_front(did) as u8);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        (self.gathered.len() + self.closed.len()) as u64
            + u64::from(self.open)
            + self.waiting.len() as u64
            + u64::from(self.in_flight)
            + self.runs.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("vertex"), |unit| unit.tags.counts());
    }
}
