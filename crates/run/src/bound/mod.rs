//! The `bound` fidelity: cycles from counts, without a simulation.
//!
//! A frame is phases that follow each other (passes, dispatches, transfers, scan-out). In each, every unit has an amount of work and a
//! rate (the roofline of Williams et al. 2009 with a roof for each unit). In a pass, runs of primitives flow through geometry and the
//! pipelines that own the screen ([`flow`]), so that imbalance and what queues hold are in it; then the slowest of that, of DRAM and
//! of the ports takes the time. What nothing overlaps comes on top: the way of the first item through the machine and of the last
//! block to memory. What a sort class adds has a file of its own: lists of tiles ([`binned`]), routers ([`routed`]), batches that are dealt and
//! taken in order ([`dealt`]), composition ([`images`]). What a ROP's cache misses comes from counts of what first-in-first-out caches of several sizes miss, what a texture
//! cache misses from the times between lookups of the same line ([`texture`]), what the second-level cache misses from one in miniature
//! ([`memory`]), whose contents stay from frame to frame. Arbitration and conflicts of banks are not in it.

mod binned;
mod dealt;
mod flow;
pub mod frames;
mod images;
mod known;
mod memory;
mod pass;
mod routed;
mod shading;
mod texture;
mod traffic;

use std::collections::HashSet;

use anyhow::Result;

use memory::Shared;
pub use memory::Traffic;
use shading::Requests;

use machine::class::Sorted;
use machine::config::MemoryKind;
use machine::{Config, PhaseReport};
use mem::REQUEST_BYTES;
use num::Cycle;
use unit::block_cache::PLACE;
use unit::compression::Codec;
use unit::core::CoreConfig;
use unit::phase::{Phase, PhaseKind};
use unit::scanout::ScanoutMode;
use work::profile::{AttachmentProfile, FrameProfile, PhaseProfile, Sampled, Touch, Toucher};
use work::{BLOCK, LINE, TILE};

/// Places of a ROP's cache that a block of an attachment takes.
fn places(attachment: &AttachmentProfile) -> f64 {
    (attachment.block_bytes as f64 / f64::from(PLACE)).max(1.0)
}

/// The share of its raw size that a block of an attachment takes in memory on average where that codec compresses it; none: raw.
fn compressed(attachment: &AttachmentProfile, codec: Option<Codec>) -> f64 {
    codec
        .map_or(1.0, |codec| {
            f64::from(attachment.lines[codec as usize]) * LINE as f64 / (attachment.block_bytes as f64).max(1.0)
        })
        .min(1.0)
}

/// Blocks along the edge of a screen tile.
const BLOCKS: u32 = TILE / BLOCK;

/// Cycles in crossbar, slice, return path and the asking unit, one each.
const HOPS: f64 = 4.0;

/// The part of the bandwidth left by refreshes that DRAM sustains, in streams with some turns of the bus and misses of rows.
const STREAMING: f64 = 0.93;

/// Bounds in per cent of the median error in cycles, and of nine of ten errors: for generated scenes on the baseline with every sort class
/// (`docs/data/fidelity.md`).
pub const STATED_ERRORS: [u32; 2] = [11, 27];

/// Cycles of a phase.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseEstimate {
    /// The kind of the phase.
    pub kind: PhaseKind,
    /// Number of the pass or dispatch in its frame.
    pub number: u32,
    /// Label.
    pub label: String,
    /// Cycles.
    pub cycles: f64,
    /// The unit that bounds it.
    pub limit: &'static str,
    /// Where no unit works nearly all the time: the unit that takes turns with it. Else empty.
    pub turns: &'static str,
    /// Each unit's own time.
    pub units: Vec<(&'static str, f64)>,
    /// The traffic of the second-level cache and of DRAM.
    pub memory: Traffic,
    /// Lookups of the first-level texture caches by fragments, and misses.
    pub textures: [f64; 2],
}

/// What stands behind two units that bound a phase in turn.
pub const IN_TURN: &str = " in turn";

impl PhaseEstimate {
    /// What bounds it: a unit, or two in turn.
    pub fn limited(&self) -> String {
        if self.turns.is_empty() { self.limit.to_owned() } else { format!("{} and {}{IN_TURN}", self.limit, self.turns) }
    }
}

/// Cycles of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameEstimate {
    /// The trace's own number.
    pub number: u32,
    /// Its phases in order.
    pub phases: Vec<PhaseEstimate>,
}

impl FrameEstimate {
    /// The phases with whole cycles, as a report has them.
    pub fn phases(&self) -> Vec<PhaseReport> {
        let phase =
            |p: &PhaseEstimate| Phase { kind: p.kind, number: p.number, label: p.label.clone(), begin: 0, limit: p.limited() };
        self.phases.iter().map(|p| PhaseReport::estimated(phase(p), p.cycles.round() as Cycle)).collect()
    }
}

/// The memory that a phase touches.
struct Touched<'p> {
    sampled: &'p Sampled,
    touches: &'p [Touch],
}

/// Estimates for one configuration, of frames one after another.
pub struct Bound<'c> {
    config: &'c Config,
    sorted: Sorted,
    /// Whether sorted triangles wait in bins until the pass is complete.
    binned: bool,
    pipelines: f64,
    /// The core that shades vertices.
    vertex_core: CoreConfig,
    /// Cycles of an access that the second-level cache has, and of one that it has not, unloaded.
    hit_latency: f64,
    memory_latency: f64,
    /// Bytes per cycle of all DRAM channels.
    dram_rate: f64,
    /// Blocks of 32-bit pixels that can be in use at once in a colour cache, and in a depth cache, before a set is full of them.
    in_use: [f64; 2],
    /// The second-level cache, from frame to frame.
    shared: Shared,
    /// A free-running display: bytes that it reads in a cycle, and the surfaces that have been presented since they were drawn into, each by its
    /// line, with its bytes.
    display: f64,
    presented: Vec<(u32, u64)>,
    /// Batches and fences dealt so far.
    turn: u64,
    /// Blocks that the pass under way has written, of those that are followed: their first lines in the surface.
    drawn: HashSet<u32>,
}

/// The work of the units in a phase, in cycles.
#[derive(Default)]
struct Roofs {
    units: Vec<(&'static str, f64)>,
}

impl Roofs {
    fn add(&mut self, unit: &'static str, cycles: f64) {
        match self.units.iter_mut().find(|(known, _)| *known == unit) {
            Some((_, sum)) => *sum += cycles,
            None => self.units.push((unit, cycles)),
        }
    }

    /// The unit with most work beside the slowest.
    fn second(&self) -> &'static str {
        let (slowest, _) = self.slowest();
        let others = self.units.iter().copied().filter(|&(unit, _)| unit != slowest);
        others.fold(("", 0.0), |most, unit| if unit.1 > most.1 { unit } else { most }).0
    }

    fn slowest(&self) -> (&'static str, f64) {
        self.units.iter().copied().fold(("nothing", 0.0), |most, unit| if unit.1 > most.1 { unit } else { most })
    }
}

impl<'c> Bound<'c> {
    /// Estimates for a configuration.
    ///
    /// # Errors
    /// If a knob has an effect that is not estimated; it is named.
    pub fn new(config: &'c Config) -> Result<Bound<'c>> {
        known::check(config)?;
        Ok(Bound::proxy(config))
    }

    /// Whether geometry belongs to pipelines, which get primitives in batches: only then does it read what
    /// [`Profiler::whole`](work::profile::Profiler::whole) leaves out.
    pub fn deals(&self) -> bool {
        self.sorted.own_geometry()
    }

    /// How colours leave their caches; none: raw.
    fn color_codec(&self) -> Option<Codec> {
        self.config.color.compression.then_some(self.config.color.codec)
    }

    /// How depths leave their caches; none: raw.
    fn depth_codec(&self) -> Option<Codec> {
        self.config.depth.compression.then_some(self.config.depth.codec)
    }

    /// How composed blocks are written; none: raw.
    fn composed_codec(&self) -> Option<Codec> {
        self.config.compose.compression.then_some(Codec::Planes)
    }

    /// Estimates without knobs that have an effect which is not estimated: near enough to tell frames apart, not to be reported.
    pub fn proxy(config: &'c Config) -> Bound<'c> {
        let (memory, dram) = (&config.memory, &config.dram);
        let tick = f64::from(dram.card_cycles) / f64::from(dram.clock);
        let ways = 2.0 * f64::from(memory.port_latency);
        let ideal = memory.kind == MemoryKind::Ideal;
        let hit_latency =
            ways + if ideal { f64::from(memory.ideal_latency) } else { 2.0 * f64::from(config.l2.latency) + HOPS };
        let controller = 2.0 * f64::from(dram.latency - 1);
        let array = if ideal { 0.0 } else { controller + tick * f64::from(dram.t_rcd + dram.cl + dram.burst_cycles) };
        let memory_latency = hit_latency + array;
        let refresh = if dram.t_refi == 0 { 0.0 } else { f64::from(dram.t_rfc) / f64::from(dram.t_refi) };
        let peak = f64::from(dram.channels) * f64::from(dram.burst_bytes) / (f64::from(dram.burst_cycles) * tick);
        let dram_rate = if ideal { f64::from(memory.ideal_bytes_per_cycle) } else { peak * (1.0 - refresh) * STREAMING };
        let in_use =
            [(config.color.cache_blocks, config.color.cache_ways), (config.depth.cache_blocks, config.depth.cache_ways)]
                .map(|(blocks, ways)| in_use(blocks, ways));
        let pipelines = f64::from(config.card.pipelines);
        let class = config.card.sort.class();
        Bound {
            config,
            sorted: class.sorted,
            binned: class.one_place,
            pipelines,
            vertex_core: config.core.of_vertices(),
            hit_latency,
            memory_latency,
            dram_rate,
            in_use,
            shared: Shared::new(config),
            display: 0.0,
            presented: Vec::new(),
            turn: 0,
            drawn: HashSet::new(),
        }
    }

    /// The time of the frame that comes next, by phases. What it finds in the second-level cache is what the frames before have left.
    pub fn frame(&mut self, frame: &FrameProfile) -> FrameEstimate {
        let sampled = &frame.sampled;
        self.shared.follow(sampled.shift);
        let mut begin = 0;
        let mut phases = Vec::with_capacity(frame.phases.len());
        for (at, phase) in frame.phases.iter().enumerate() {
            let count = sampled.touches[begin..].iter().take_while(|touch| usize::from(touch.phase) == at).count();
            let touches = &sampled.touches[begin..begin + count];
            phases.push(self.phase(phase, &Touched { sampled, touches }));
            begin += count;
        }
        // A display that has shown a frame reads all the time.
        let read = self.display * phases.iter().map(|phase| phase.cycles).sum::<f64>();
        if let Some(phase) = phases.iter_mut().rfind(|phase| phase.kind == PhaseKind::ScanOut) {
            phase.memory.read += read;
        }
        self.begin_display(&frame.phases);
        FrameEstimate { number: frame.number, phases }
    }

    /// Whether a display runs while frames are drawn.
    fn runs_free(&self) -> bool {
        self.config.scanout.enabled && self.config.scanout.mode == ScanoutMode::FreeRunning
    }

    /// A frame has ended: its picture goes to the display, which reads it once per refresh. Its line begins with those of the vertical blank.
    fn begin_display(&mut self, phases: &[PhaseProfile]) {
        let shown = phases.iter().rev().find_map(|phase| match phase {
            &PhaseProfile::ScanOut { bytes, line, lines } => Some((line, bytes, lines)),
            _ => None,
        });
        let Some((line, bytes, lines)) = shown.filter(|_| self.runs_free()) else { return };
        let scanout = &self.config.scanout;
        self.display = bytes as f64 / (f64::from(lines + scanout.blank_lines) * f64::from(scanout.line_cycles));
        if scanout.buffers > 1 {
            self.presented.retain(|&(known, _)| known != line);
            self.presented.push((line, bytes));
        }
    }

    /// Bytes that are copied before a pass because it loads what only the display's buffers have.
    fn reloads(&mut self, color: &[AttachmentProfile]) -> u64 {
        let mut sum = 0;
        for attachment in color {
            let Some(at) = self.presented.iter().position(|&(line, _)| line == attachment.line) else { continue };
            let (_, bytes) = self.presented.swap_remove(at);
            sum += if attachment.loads { bytes } else { 0 };
        }
        sum
    }

    /// Cycles of the copy engine for a transfer that reads `read` and writes `written` bytes, from the first request on.
    fn copied(&self, read: f64, written: f64, latency: f64) -> f64 {
        // Requests and answers have wires of their own.
        let port = read.max(written) / f64::from(self.config.memory.port_width);
        port.max(self.in_flight(read, self.config.command.copy_misses, latency))
    }

    fn phase(&mut self, phase: &PhaseProfile, touched: &Touched) -> PhaseEstimate {
        if let PhaseProfile::Pass { color, .. } = phase {
            let reloads = self.reloads(color) as f64;
            let mut estimate = self.pass(phase, touched);
            if reloads > 0.0 {
                estimate.cycles += self.copied(reloads, reloads, self.memory_latency) + self.memory_latency;
                estimate.memory += Traffic { read: reloads, written: reloads, ..Traffic::default() };
            }
            return estimate;
        }
        let mut memory = Traffic::default();
        // A display that runs free reads the frame elsewhere, later.
        let elsewhere = matches!(phase, PhaseProfile::ScanOut { .. }) && self.runs_free();
        let touches = if elsewhere { &[] } else { touched.touches };
        touches.iter().for_each(|touch| memory += self.plain(touch, touched.sampled.shift));
        let mut roofs = Roofs::default();
        roofs.add("dram", self.dram(&memory));
        let miss = self.latency(&memory);
        let mut textures = [0.0; 2];
        let (kind, number, label, latency) = match phase {
            PhaseProfile::Pass { .. } => unreachable!("done above"),
            PhaseProfile::Dispatch { number, label, cost, registers, lines, runs, .. } => {
                roofs.add("command", *runs as f64 * f64::from(self.config.command.command_cycles));
                let cores = self.pipelines * f64::from(self.config.core.per_pipeline);
                // A line is missed once; a warp waits for the last of its lines.
                let misses = *lines as f64 / (cost.texture_lines + cost.access_lines).max(1) as f64;
                let packets = f64::from(self.config.core.warp_width) / 4.0;
                let lookups = (cost.texture_lines + cost.access_lines) as f64 / cost.requests().max(1) as f64;
                let part = |misses: f64| 1.0 - libm::pow(1.0 - misses.min(1.0), lookups * packets);
                let requests = Requests {
                    missed: part(misses),
                    slow: part(misses * memory.miss_rate()),
                    latency: miss,
                    line: misses.min(1.0),
                    port: LINE as f64 / f64::from(self.config.memory.port_width),
                };
                let shading = self.shading(&self.config.core, cost, 4.0, *registers, &requests);
                roofs.add("core", shading.core * cost.runs as f64 / cores);
                roofs.add("texture", shading.texture * cost.runs as f64 / cores);
                textures = [(cost.texture_lines + cost.access_lines) as f64, *lines as f64];
                (PhaseKind::Dispatch, *number, label.clone(), shading.latency + 2.0 * self.memory_latency)
            }
            PhaseProfile::Transfers { transfers } => {
                let (mut cycles, mut latencies) = (0.0, 0.0);
                for &[read, written] in transfers {
                    let (read, written) = (read as f64, written as f64);
                    cycles += self.copied(read, written, miss);
                    latencies += if read > 0.0 { miss } else { 0.0 } + f64::from(self.config.command.command_cycles);
                }
                roofs.add("command", cycles);
                (PhaseKind::Transfers, 0, String::new(), latencies)
            }
            &PhaseProfile::ScanOut { bytes, .. } => {
                let reads = self.config.scanout.enabled && !self.runs_free();
                if !reads {
                    memory = Traffic::default();
                    roofs = Roofs::default();
                }
                let bytes = if reads { bytes as f64 } else { 0.0 };
                let port = bytes / f64::from(self.config.memory.port_width);
                roofs.add("scanout", port.max(self.in_flight(bytes, self.config.scanout.misses, miss)));
                (PhaseKind::ScanOut, 0, String::new(), if bytes > 0.0 { miss } else { 0.0 })
            }
        };
        let (limit, most) = roofs.slowest();
        PhaseEstimate { kind, number, label, cycles: most + latency, limit, turns: "", units: roofs.units, memory, textures }
    }

    /// The second level's traffic of a touch that no first-level cache serves.
    fn plain(&mut self, touch: &Touch, shift: u8) -> Traffic {
        if !self.shared.follows(touch.line, shift) {
            return Traffic::default();
        }
        let groups = 4 * LINE * u64::from(touch.class);
        match touch.by {
            Toucher::Read => self.shared.access(touch.line, groups, false),
            Toucher::Write => self.shared.access(touch.line, groups, true),
            Toucher::Store => {
                let mut traffic = self.shared.access(touch.line, LINE, false);
                traffic += Traffic { lookups: 0.0, ..self.shared.access(touch.line, LINE, true) };
                traffic
            }
            Toucher::Vertex if touch.class > 0 => self.shared.access(touch.line, groups, false),
            _ => self.shared.access(touch.line, LINE, false),
        }
    }

    /// Bytes that a channel writes at once: from the high watermark of its writes down to the low one.
    fn batch(&self) -> f64 {
        let dram = &self.config.dram;
        f64::from(dram.write_high() - dram.write_low()) * f64::from(self.config.l2.line_bytes)
    }

    /// Cycles that DRAM takes for some traffic. Its buses turn round for each batch of writes, and back.
    fn dram(&self, memory: &Traffic) -> f64 {
        let dram = &self.config.dram;
        let moved = (memory.read + memory.written) / (self.dram_rate - self.display).max(1.0);
        if self.config.memory.kind == MemoryKind::Ideal {
            return moved;
        }
        let batch = self.batch() * f64::from(dram.channels);
        let turn =
            f64::from(dram.t_rtw + dram.cwl + dram.t_wtr + dram.cl) * f64::from(dram.card_cycles) / f64::from(dram.clock);
        moved + memory.written.min(memory.read) / batch * turn
    }

    /// Cycles of an access of some traffic, unloaded.
    fn latency(&self, memory: &Traffic) -> f64 {
        self.hit_latency + memory.miss_rate() * (self.memory_latency - self.hit_latency)
    }

    /// Cycles of a stream of reads, of which at most `misses` are in flight (Little's law).
    fn in_flight(&self, bytes: f64, misses: u32, latency: f64) -> f64 {
        bytes / REQUEST_BYTES as f64 * latency / f64::from(misses)
    }
}

/// How many blocks, thrown at random into the sets of a cache, fall before one finds its set full: on average. With as many sets as
/// ways to each and time for throws that is Poisson's, it is the time for which all sets have room (Flajolet, Gardy and Thimonier 1992).
fn in_use(blocks: u32, ways: u32) -> f64 {
    let ways = ways.min(blocks).max(1);
    let sets = f64::from((blocks / ways).max(1));
    let step = 1.0 / 64.0;
    let (mut sum, mut load) = (0.0, 0.5 * step);
    loop {
        // The part of the sets with at most as many blocks as ways.
        let (mut term, mut room) = (1.0, 1.0);
        for k in 1..=ways {
            term *= load / f64::from(k);
            room += term;
        }
        let all = libm::pow(libm::exp(-load) * room, sets);
        sum += all * step;
        load += step;
        if all < 1e-3 {
            return (sum * sets).min(f64::from(blocks)).max(1.0);
        }
    }
}
