//! Putting a memory behind clients.

use super::cache::ShapeError;
use super::crossbar::{CLIENTS, ClientCounts, Crossbar, ReturnPath};
use super::dram::{BUSY_CYCLES, DRAM, Dram, DramConfig, DramCounts, DramError};
use super::ideal::{Ideal, IdealConfig};
use super::l2::{L2Config, L2Slice};
use super::port::{Answer, DramAnswer, DramRequest, MemoryPort, REQUEST_BYTES, Request, SliceAnswer, SliceRequest};
use super::tlb::TlbConfig;
use knob::Allowed;
use sim::{In, Link, Out, UnitId, Wiring};
use stats::{Group, Tree, counter};

/// How addresses are dealt to slices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interleave {
    slices: u32,
    /// Log2 of the bytes that stay together.
    shift: u32,
}

/// Values that make no memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum MemoryError {
    #[error("{slices} slices interleaved at {bytes} bytes: at least 1 and a power of two from {REQUEST_BYTES}")]
    Interleave { slices: u32, bytes: u32 },
    #[error("an ideal memory moves at least 1 byte a cycle")]
    Ideal,
    #[error("{channels} channels do not share {slices} slices evenly")]
    Channels { channels: u32, slices: u32 },
    #[error(transparent)]
    Shape(#[from] ShapeError),
    #[error(transparent)]
    Dram(#[from] DramError),
}

impl Interleave {
    /// Runs of `bytes` bytes go to one of `slices` slices in turn, with upper address bits folded in.
    ///
    /// # Errors
    /// If `bytes` is no power of two or less than [`REQUEST_BYTES`], or there is no slice.
    pub fn new(slices: u32, bytes: u32) -> Result<Interleave, MemoryError> {
        if slices == 0 || !bytes.is_power_of_two() || u64::from(bytes) < REQUEST_BYTES {
            return Err(MemoryError::Interleave { slices, bytes });
        }
        Ok(Interleave { slices, shift: bytes.trailing_zeros() })
    }

    /// Slices.
    pub fn slices(&self) -> u32 {
        self.slices
    }

    /// The slice of an address, and the address within the slice.
    #[inline(always)]
    pub fn split(&self, address: u64) -> (u32, u64) {
        let slices = u64::from(self.slices);
        let run = address >> self.shift;
        // Runs are dealt in rounds; each round starts elsewhere, so that a stride of a round does not stay on one slice.
        let (round, position) = if slices.is_power_of_two() {
            (run >> slices.trailing_zeros(), run & (slices - 1))
        } else {
            (run / slices, run % slices)
        };
        let start = round ^ (round >> 5) ^ (round >> 11);
        let slice = if slices.is_power_of_two() { (position + start) & (slices - 1) } else { (position + start) % slices };
        (slice as u32, round << self.shift | (address & ((1 << self.shift) - 1)))
    }
}

/// The part of a channel's addresses that belongs to one of its slices. Slices of a channel take runs of its addresses in turn, so that
/// no byte of one slice has the bank, row and column of a byte of another, and a row is shared by neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ChannelShare {
    /// Number of the slice among the slices of its channel.
    slice: u32,
    /// Slices of the channel.
    slices: u32,
    /// Log2 of the bytes of a run.
    shift: u32,
}

impl ChannelShare {
    /// The share of a slice where `slices` slices, dealt runs as `interleave` says, stand in front of `channels` channels in turn.
    pub(crate) fn new(interleave: Interleave, slice: u32, channels: u32) -> ChannelShare {
        ChannelShare { slice: slice / channels, slices: interleave.slices / channels, shift: interleave.shift }
    }

    /// The address within the channel that an address within the slice has.
    #[inline(always)]
    pub fn address(&self, address: u64) -> u64 {
        let run = (address >> self.shift) * u64::from(self.slices) + u64::from(self.slice);
        run << self.shift | (address & ((1 << self.shift) - 1))
    }
}

/// What stands behind the clients' ports.
#[derive(Clone, Copy, Debug)]
pub enum MemoryConfig {
    /// Fixed latency and bandwidth.
    Ideal(IdealConfig),
    /// Crossbar, slices and DRAM channels.
    Dram {
        /// The slices; a multiple of the channels.
        l2: L2Config,
        /// The channels.
        dram: DramConfig,
    },
}

knob::choices! {
    /// What is behind the units' memory ports.
    pub enum MemoryKind {
        /// Second-level cache and DRAM.
        Dram "dram",
        /// A memory of fixed latency and bandwidth.
        Ideal "ideal",
    }
}

knob::knobs! {
    /// The units' memory ports, and the ideal memory.
    pub struct MemoryKnobs {
        /// What is behind the ports.
        kind: MemoryKind ["", Allowed::Choice(MemoryKind::NAMES), "the ideal one isolates the units"]
            {estimate: Used, relax: Never, advice: []},
        /// Bytes per cycle that each port takes and gives.
        port_width: u32 ["bytes/cycle", Allowed::Range(8, 4096), "assumed; ATTILA bGPU.ini bus widths = 64"]
            {estimate: Used, relax: Rate, advice: [Transfers]},
        /// Cycles from a unit to the crossbar, and from the crossbar back.
        port_latency: u32 ["cycles", Allowed::Range(1, 1024), "assumed: of the 207 cycles of an L2 hit on GM204 (Jia et al. 2019, table 3.1), less than half are the way to the slice and back"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from a depth or colour unit to the crossbar, and from the crossbar back.
        rop_latency: u32 ["cycles", Allowed::Range(1, 1024), "assumed to be short: 16 ROPs and 512 KB of L2 stand at each memory controller of GM204 (NVIDIA 2014, GeForce GTX 980 white paper)"]
            {estimate: RefusedUnless(AtMost(64), "long ways from ROPs to memory"), relax: Latency, advice: []},
        /// Requests, and answers, under way on each port.
        port_queue: u32 ["requests", Allowed::Range(2, 4096), "assumed: two per cycle of the latency, so that the port carries its width in halves of lines"]
            {estimate: RefusedUnless(AtLeast(128), "ports that carry less than a request per cycle"), relax: Room, advice: []},
        /// Latency of the ideal memory.
        ideal_latency: u32 ["cycles", Allowed::Range(1, 65535), "assumed: the shortest: what units wait for is then their own time, and no hit of the memory that it replaces is sooner"]
            {estimate: Used, relax: Latency, advice: []},
        /// Bytes per cycle of the ideal memory.
        ideal_bytes_per_cycle: u32 ["bytes/cycle", Allowed::Range(1, 1048576), "assumed: more than all ports carry"]
            {estimate: Used, relax: Bandwidth, advice: []},
    }
}

impl MemoryKnobs {
    /// A unit's port.
    pub fn port(&self) -> PortShape {
        PortShape { width: self.port_width, latency: self.port_latency, queue: self.port_queue }
    }

    /// The port of a depth or colour unit.
    pub fn rop_port(&self) -> PortShape {
        PortShape { latency: self.rop_latency, ..self.port() }
    }
}

/// How many units of each kind a memory has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct MemoryUnits {
    /// Crossbars, and as many return paths.
    pub crossbar: usize,
    /// Slices.
    pub l2: usize,
    /// DRAM channels.
    pub dram: usize,
    /// Ideal memories.
    pub ideal: usize,
}

impl MemoryConfig {
    /// The memory that knobs say.
    ///
    /// # Errors
    /// If a slice's cache has no shape.
    pub fn new(knobs: &MemoryKnobs, l2: L2Config, dram: DramConfig) -> Result<MemoryConfig, ShapeError> {
        if knobs.kind == MemoryKind::Ideal {
            let ideal = IdealConfig { latency: knobs.ideal_latency, bytes_per_cycle: knobs.ideal_bytes_per_cycle };
            return Ok(MemoryConfig::Ideal(ideal));
        }
        l2.shape()?;
        Ok(MemoryConfig::Dram { l2, dram })
    }

    /// Its units.
    pub fn units(&self) -> MemoryUnits {
        match *self {
            MemoryConfig::Ideal(_) => MemoryUnits { crossbar: 0, l2: 0, dram: 0, ideal: 1 },
            MemoryConfig::Dram { l2, dram } => {
                MemoryUnits { crossbar: 1, l2: l2.slices as usize, dram: dram.channels as usize, ideal: 0 }
            }
        }
    }
}

/// Numbers of a memory's units in the wiring.
#[derive(Clone, Debug)]
pub struct MemoryIds {
    /// What clients' requests go to: the crossbar, or the ideal memory.
    pub front: UnitId,
    /// The slices.
    pub l2: Vec<UnitId>,
    /// The channels.
    pub dram: Vec<UnitId>,
    /// What clients' answers come from: the return path, or the ideal memory.
    pub back: UnitId,
}

/// How wide and long a client's port is.
#[derive(Clone, Copy, Debug)]
pub struct PortShape {
    /// Bytes per cycle on the way out and on the way back.
    pub width: u32,
    /// Cycles each way.
    pub latency: u32,
    /// Requests and answers under way, each.
    pub queue: u32,
}

/// Units of the memory while the machine is being wired. Declared first of all, as clients' channels lead to them:
/// 1. [`MemoryPlan::declare`] where the memory's fields stand among the machine's fields,
/// 2. [`MemoryPlan::client`] for each client,
/// 3. [`MemoryPlan::build`].
///
/// The machine has the fields `crossbar: Option<Crossbar>`, `l2: Vec<L2Slice>`, `dram: Vec<Dram>`, `return_path: Option<ReturnPath>`
/// and `ideal: Option<Ideal>`, in this order.
#[derive(Clone, Debug)]
pub struct MemoryPlan {
    config: MemoryConfig,
    tlb: Option<TlbConfig>,
    interleave: Interleave,
    ids: MemoryIds,
    names: Vec<(&'static str, usize)>,
    requests: Vec<In<Request>>,
    answers: Vec<Out<Answer>>,
}

/// The units of a memory, for the machine's fields of the same names.
#[derive(Clone, Debug)]
pub struct Memory {
    /// From clients to slices.
    pub crossbar: Option<Crossbar>,
    /// The slices.
    pub l2: Vec<L2Slice>,
    /// The channels.
    pub dram: Vec<Dram>,
    /// From slices to clients.
    pub return_path: Option<ReturnPath>,
    /// The ideal memory instead of all these.
    pub ideal: Option<Ideal>,
    /// The name of each client's port.
    pub clients: Vec<(&'static str, usize)>,
}

/// Requests, and answers, that pass between a slice and its channel in a cycle.
const DRAM_RATE: u32 = 2;

/// The slices' ends at one channel.
#[derive(Clone, Debug, Default)]
struct DramPorts {
    requests: Vec<In<DramRequest>>,
    answers: Vec<Out<DramAnswer>>,
}

impl MemoryPlan {
    /// Declares the units, which come next in the wiring.
    ///
    /// # Errors
    /// If the slices cannot be interleaved as asked, or the channels do not share them evenly, or a channel's values are wrong.
    pub fn declare(config: MemoryConfig, wiring: &mut Wiring) -> Result<MemoryPlan, MemoryError> {
        let ids = match config.units() {
            MemoryUnits { ideal: 1, .. } => {
                let ideal = wiring.unit("ideal", 0);
                MemoryIds { front: ideal, l2: Vec::new(), dram: Vec::new(), back: ideal }
            }
            MemoryUnits { l2, dram, .. } => MemoryIds {
                front: wiring.unit("crossbar", 0),
                l2: wiring.bank("l2", l2),
                dram: wiring.bank("dram", dram),
                back: wiring.unit("return_path", 0),
            },
        };
        MemoryPlan::new(config, ids)
    }

    /// A memory whose units are declared.
    ///
    /// # Errors
    /// If the slices cannot be interleaved as asked, or the channels do not share them evenly, or a channel's values are wrong.
    pub fn new(config: MemoryConfig, ids: MemoryIds) -> Result<MemoryPlan, MemoryError> {
        let interleave = match config {
            MemoryConfig::Ideal(ideal) => {
                if ideal.bytes_per_cycle == 0 {
                    return Err(MemoryError::Ideal);
                }
                Interleave::new(1, REQUEST_BYTES as u32)?
            }
            MemoryConfig::Dram { l2, dram } => {
                let interleave = Interleave::new(l2.slices, l2.interleave)?;
                let (slices, channels) = (l2.slices, dram.channels);
                if channels == 0 || slices % channels != 0 {
                    return Err(MemoryError::Channels { channels, slices });
                }
                l2.shape()?;
                dram.check()?;
                interleave
            }
        };
        let (names, requests, answers) = (Vec::new(), Vec::new(), Vec::new());
        Ok(MemoryPlan { config, tlb: None, interleave, ids, names, requests, answers })
    }

    /// The same with addresses that are translated. An ideal memory translates none.
    #[must_use]
    pub fn translating(self, tlb: TlbConfig) -> MemoryPlan {
        MemoryPlan { tlb: Some(tlb), ..self }
    }

    /// A port for a client. Ports of one name are one client in the statistics.
    pub fn client(
        &mut self,
        wiring: &mut Wiring,
        name: &'static str,
        index: usize,
        unit: UnitId,
        shape: PortShape,
    ) -> MemoryPort {
        let link = Link::bytes(shape.queue, shape.width, shape.latency);
        let port = self.names.len();
        let (requests, taken) = wiring.channel("memory_requests", port, link, unit, self.ids.front);
        let (given, answers) = wiring.channel("memory_answers", port, link, self.ids.back, unit);
        self.names.push((name, index));
        self.requests.push(taken);
        self.answers.push(given);
        MemoryPort { number: port as u16, requests, answers }
    }

    /// The units.
    pub fn build(self, wiring: &mut Wiring) -> Memory {
        let (mut memory, clients) = (
            Memory { crossbar: None, l2: Vec::new(), dram: Vec::new(), return_path: None, ideal: None, clients: Vec::new() },
            self.names,
        );
        memory.clients = clients;
        match self.config {
            MemoryConfig::Ideal(config) => memory.ideal = Some(Ideal::new(config, self.requests, self.answers)),
            MemoryConfig::Dram { l2, dram } => {
                let (slices, channels) = (l2.slices, dram.channels);
                let way = Link::bytes(l2.latency + 8, l2.width, l2.latency);
                // As many requests as can be under way, and as fill the scheduler's window.
                let under_way = DRAM_RATE * (dram.latency + 1);
                let to_dram = Link::items(dram.window.max(under_way), DRAM_RATE, dram.latency);
                let from_dram = Link::items(under_way.max(8), DRAM_RATE, dram.latency);
                let (mut to_slices, mut from_slices) = (Vec::new(), Vec::new());
                let mut ports: Vec<DramPorts> = (0..channels).map(|_| DramPorts::default()).collect();
                for slice in 0..slices as usize {
                    let channel = slice % channels as usize;
                    let id = self.ids.l2[slice];
                    let (to_slice, input) = wiring.channel::<SliceRequest>("l2_requests", slice, way, self.ids.front, id);
                    let (output, from_slice) = wiring.channel::<SliceAnswer>("l2_answers", slice, way, id, self.ids.back);
                    let (to, at_dram) = wiring.channel("dram_requests", slice, to_dram, id, self.ids.dram[channel]);
                    let (answers, from) = wiring.channel("dram_answers", slice, from_dram, self.ids.dram[channel], id);
                    to_slices.push(to_slice);
                    from_slices.push(from_slice);
                    ports[channel].requests.push(at_dram);
                    ports[channel].answers.push(answers);
                    let share = ChannelShare::new(self.interleave, slice as u32, channels);
                    memory.l2.push(L2Slice::new(l2, share, input, output, to, from));
                }
                memory.dram = ports.into_iter().map(|ports| Dram::new(dram, ports.requests, ports.answers)).collect();
                memory.crossbar = Some(Crossbar::new(self.interleave, self.tlb, self.requests, to_slices));
                memory.return_path = Some(ReturnPath::new(from_slices, self.answers));
            }
        }
        memory
    }
}

/// What memory has counted, up to now or between two readings.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MemoryCounts {
    /// The clients of each name together.
    pub clients: Vec<(&'static str, ClientCounts)>,
    /// The channels of DRAM together, or the ideal memory.
    pub dram: DramCounts,
    busy_cycles: u64,
    ideal: bool,
}

impl MemoryCounts {
    /// What was counted up to now. `counts` are those of the clients, in the order of their ports.
    pub fn read(
        clients: &[(&'static str, usize)],
        counts: &[ClientCounts],
        dram: &[Dram],
        ideal: Option<&Ideal>,
    ) -> MemoryCounts {
        let mut sums: Vec<(&'static str, ClientCounts)> = Vec::new();
        for (&(name, _), counts) in clients.iter().zip(counts) {
            match sums.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += *counts,
                None => sums.push((name, *counts)),
            }
        }
        let (dram, busy_cycles) = match ideal {
            Some(ideal) => {
                let ClientCounts { read_bytes, write_bytes, .. } = counts.iter().copied().sum();
                (DramCounts { read_bytes, write_bytes, ..DramCounts::default() }, ideal.busy_cycles())
            }
            None => (dram.iter().map(Dram::counts).sum(), dram.iter().map(Dram::busy_cycles).sum()),
        };
        MemoryCounts { clients: sums, dram, busy_cycles, ideal: ideal.is_some() }
    }

    /// What was counted since an earlier reading of the same memory.
    pub fn since(&self, earlier: &MemoryCounts) -> MemoryCounts {
        let clients = self.clients.iter().zip(&earlier.clients).map(|((name, now), (_, then))| (*name, now.since(then)));
        MemoryCounts {
            clients: clients.collect(),
            dram: self.dram.since(&earlier.dram),
            busy_cycles: self.busy_cycles - earlier.busy_cycles,
            ideal: self.ideal,
        }
    }

    /// Adds what an equal memory has counted.
    pub fn add(&mut self, later: &MemoryCounts) {
        self.clients.iter_mut().zip(&later.clients).for_each(|((_, sum), (_, own))| *sum += *own);
        self.dram += later.dram;
        self.busy_cycles += later.busy_cycles;
    }

    /// The leaves of the statistics under [`CLIENTS`] and [`DRAM`].
    pub fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        for (name, counts) in &self.clients {
            CLIENTS.named(name).at(&mut tree, 0).extend(counts.tree());
        }
        let total = DRAM.at(&mut tree, 0);
        counter!(DramCounts, read_bytes).put(total, self.dram.read_bytes);
        counter!(DramCounts, write_bytes).put(total, self.dram.write_bytes);
        counter!(DramCounts, row_hits).put(total, self.dram.row_hits);
        counter!(DramCounts, row_misses).put(total, self.dram.row_misses);
        total.count(BUSY_CYCLES.name, self.busy_cycles);
        if !self.ideal {
            counter!(DramCounts, refreshes).put(total, self.dram.refreshes);
        }
        tree
    }
}
