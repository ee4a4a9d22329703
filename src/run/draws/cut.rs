//! Cuts passes into pieces, and estimates what each takes.

use std::collections::VecDeque;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use crate::machine::Config;
use crate::machine::config::MemoryKind;
use crate::run::bound::{Bound, Traffic};
use crate::unit::interleave::Interleave;
use crate::work::profile::Profiler;
use crate::work::{BLOCK, Block, Class, Cost, EndFrame, Event, LINE, Pass, QUAD_SHADED, Segment, TILE, TileWork};

/// Estimated cycles of a piece, at least.
pub const GRAIN: f64 = 500.0;

/// Whole segments of a pass, one after another.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Piece {
    /// Their numbers in the stream.
    pub segments: Range<u32>,
    /// The first piece of its pass.
    pub pass: usize,
    /// It is that, or the last.
    pub edge: bool,
}

/// What is expected of a piece.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Estimate {
    /// Cycles.
    pub cycles: f64,
    /// What each unit has to do, in cycles.
    pub units: Vec<(&'static str, f64)>,
    /// What it does to the second-level cache and DRAM.
    pub memory: Traffic,
    /// Misses of texture caches.
    pub texture_misses: f64,
    /// Blocks of triangles with shaded quads, and with covered ones.
    pub blocks: [f64; 2],
    /// Lines of memory that its fragments ask for.
    pub lines: f64,
    /// Indices.
    pub indices: f64,
    /// Lines of memory that these lie in.
    pub index_lines: f64,
}

/// Part of what pieces are weighed by that is cycles, whatever is weighed: where nothing of a kind is expected, little is.
const REST: f64 = 0.05;

/// What is expected of pieces, of what a count is in proportion to.
pub fn weights(pieces: &[Estimate], path: &str) -> Vec<f64> {
    let cycles = |piece: &Estimate| piece.cycles;
    let of: fn(&Estimate) -> f64 = match path.split(['.', '[']).collect::<Vec<_>>()[..] {
        ["caches" | "rop", "color", ..] | ["memory", "clients", "color", ..] => |piece| piece.blocks[0],
        ["caches" | "rop", "depth", ..] | ["memory", "clients", "depth", ..] => |piece| piece.blocks[1],
        ["caches", "texture", "misses"] | ["memory", "clients", "texture", ..] => |piece| piece.texture_misses,
        ["caches", "texture", ..] => |piece| piece.lines,
        ["caches", "vertex", ..] | ["memory", "clients", "vertex", ..] => |piece| piece.indices,
        ["memory", "clients", "index", ..] => |piece| piece.index_lines,
        ["caches", "l2", "misses"] => |piece| piece.memory.misses,
        ["caches", "l2", ..] => |piece| piece.memory.lookups,
        ["memory", "dram", "read_bytes"] => |piece| piece.memory.read,
        ["memory", "dram", "write_bytes"] => |piece| piece.memory.written,
        ["memory", "dram", "bytes"] => |piece| piece.memory.read + piece.memory.written,
        _ => cycles,
    };
    let all: f64 = pieces.iter().map(of).sum();
    let time: f64 = pieces.iter().map(cycles).sum();
    let part = if all > 0.0 { (1.0 - REST) / all } else { 0.0 };
    pieces.iter().map(|piece| part * of(piece) + REST / time * piece.cycles).collect()
}

/// When the segments of a pass retire, about: geometry takes them one after another, and each goes on to the pipelines that own what it
/// covers, which take them in order. Only so many segments are in between.
struct Flow {
    interleave: Interleave,
    /// Whether a screen tile has one owner.
    whole: bool,
    /// When geometry is done with the last segment, and each pipeline.
    geometry: f64,
    pipelines: Vec<f64>,
    /// When the segments retire that are in between.
    retiring: VecDeque<f64>,
    places: usize,
}

impl Flow {
    fn new(config: &Config) -> Flow {
        let distribute = &config.distribute;
        Flow {
            interleave: Interleave::new(distribute.pattern, config.card.pipelines, distribute.tile),
            whole: distribute.tile >= TILE,
            geometry: 0.0,
            pipelines: vec![0.0; config.card.pipelines as usize],
            retiring: VecDeque::new(),
            places: config.command.segments as usize,
        }
    }

    /// A pass begins, behind all that was before.
    fn begin(&mut self, pass: &Pass) {
        self.interleave.begin_pass(pass.width, pass.height);
        self.geometry = 0.0;
        self.pipelines.fill(0.0);
        self.retiring.clear();
    }

    /// When a segment retires.
    fn segment(&mut self, segment: &Segment, config: &Config) -> f64 {
        if self.retiring.len() >= self.places {
            self.geometry = self.geometry.max(self.retiring.pop_front().unwrap_or(0.0));
        }
        self.geometry += geometry(segment, config);
        let count = self.pipelines.len();
        for tile in &segment.tiles {
            let cycles = pixels(tile, config);
            let [x, y] = [tile.x, tile.y].map(|at| u32::from(at) * TILE / BLOCK);
            let owner = usize::from(self.interleave.owner(x, y));
            let (owners, cycles) = if self.whole { (owner..owner + 1, cycles) } else { (0..count, cycles / count as f64) };
            for end in &mut self.pipelines[owners] {
                *end = end.max(self.geometry) + cycles;
            }
        }
        let end = self.pipelines.iter().copied().fold(self.geometry, f64::max);
        self.retiring.push_back(end);
        end
    }
}

/// Cycles that geometry takes for a segment. Fetch asks for the first indices of one after the other, and waits for them.
fn geometry(segment: &Segment, config: &Config) -> f64 {
    let mut cycles = segment.stream.len() as f64 / f64::from(config.fetch.indices_per_cycle);
    if segment.index_address.is_some() {
        let memory = &config.memory;
        let behind = if memory.kind == MemoryKind::Ideal { memory.ideal_latency } else { 2 * config.l2.latency };
        cycles += f64::from(2 * memory.port_latency + behind);
    }
    cycles.max(f64::from(config.command.command_cycles))
}

/// Cycles that a pipeline takes for the quads of a tile.
fn pixels(tile: &TileWork, config: &Config) -> f64 {
    let costs: Vec<f64> = tile.costs.costs.iter().map(|cost| quad(cost, config)).collect();
    let shaded = tile.quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0);
    let cores: f64 = shaded.map(|quad| costs.get(usize::from(quad.cost)).copied().unwrap_or(0.0)).sum();
    let filters: u64 = tile.requests.iter().map(|request| u64::from(request.operations)).sum();
    let filters = filters as f64 / f64::from(config.texture.filters_per_cycle);
    let tests = tile.quads.len() as f64 / f64::from(config.depth.quads_per_cycle);
    tests.max(cores.max(filters) / f64::from(config.core.per_pipeline))
}

/// Cycles in which a core issues what a quad takes of a warp.
fn quad(cost: &Cost, config: &Config) -> f64 {
    let core = &config.core;
    let lanes = [core.float_lanes, core.integer_lanes, core.special_lanes, core.control_lanes];
    let instructions: [u32; Class::COUNT] = cost.instructions();
    let issue = f64::from(instructions.iter().sum::<u32>()) / f64::from(core.issue);
    let class = |(&n, lanes): (&u32, u32)| f64::from(n) * f64::from(core.warp_width) / f64::from(lanes);
    instructions.iter().zip(lanes).map(class).fold(issue, f64::max) * 4.0 / f64::from(core.warp_width)
}

/// Cuts a stream of events, and estimates what each piece takes.
pub(super) struct Cutter<'c> {
    config: &'c Config,
    bound: Bound<'c>,
    profiler: Profiler,
    flow: Flow,
    pub pieces: Vec<Piece>,
    pub estimates: Vec<Estimate>,
    /// Counts of the piece that is open.
    counts: Estimate,
    /// The first piece of the pass; whether one is open; and when the last one has retired, and its last segment.
    first: usize,
    open: bool,
    begin: f64,
    end: f64,
    segments: u32,
    /// The pass and the draw at hand.
    pass: Option<Event>,
    draw: Option<Event>,
    /// Host time of the estimates, profiles left out.
    pub time: Duration,
}

impl<'c> Cutter<'c> {
    pub fn new(config: &'c Config) -> Cutter<'c> {
        Cutter {
            config,
            bound: Bound::proxy(config),
            profiler: Profiler::default(),
            flow: Flow::new(config),
            pieces: Vec::new(),
            estimates: Vec::new(),
            counts: Estimate::default(),
            first: 0,
            open: false,
            begin: 0.0,
            end: 0.0,
            segments: 0,
            pass: None,
            draw: None,
            time: Duration::ZERO,
        }
    }

    pub fn event(&mut self, event: &Event) {
        match event {
            Event::BeginPass(pass) => {
                self.flow.begin(pass);
                (self.pass, self.first) = (Some(event.clone()), self.pieces.len());
                (self.begin, self.end) = (0.0, 0.0);
            }
            Event::Draw(_) => {
                self.draw = Some(event.clone());
                if self.open {
                    self.profiler.event(event);
                }
            }
            Event::Segment(segment) => self.segment(event, segment),
            Event::EndPass => {
                self.close();
                let last = self.pieces.len().checked_sub(1);
                for at in [Some(self.first), last].into_iter().flatten().filter(|&at| at >= self.first) {
                    if let Some(piece) = self.pieces.get_mut(at) {
                        piece.edge = true;
                    }
                }
            }
            _ => {}
        }
    }

    /// A segment goes to the piece that is open, until that is long enough.
    fn segment(&mut self, event: &Event, segment: &Segment) {
        if !std::mem::replace(&mut self.open, true) {
            self.pieces.push(Piece { segments: self.segments..self.segments, pass: self.first, edge: false });
            for event in self.pass.iter().chain(&self.draw) {
                self.profiler.event(event);
            }
        }
        self.profiler.event(event);
        self.segments += 1;
        if let Some(piece) = self.pieces.last_mut() {
            piece.segments.end = self.segments;
        }
        let start = Instant::now();
        self.end = self.flow.segment(segment, self.config);
        self.counts.indices += segment.stream.len() as f64;
        if let Some(address) = segment.index_address {
            let end = address + u64::from(segment.index_bytes) * segment.stream.len() as u64;
            self.counts.index_lines += (end.div_ceil(LINE) - address / LINE) as f64;
        }
        for tile in &segment.tiles {
            let shaded = |block: &&Block| {
                let quads = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
                quads.iter().any(|quad| quad.flags & QUAD_SHADED != 0)
            };
            self.counts.blocks[0] += tile.blocks.iter().filter(shaded).count() as f64;
            self.counts.blocks[1] += tile.blocks.len() as f64;
            self.counts.lines += tile.lines.len() as f64;
        }
        self.time += start.elapsed();
        if self.end - self.begin >= GRAIN {
            self.close();
        }
    }

    /// The piece that is open ends.
    fn close(&mut self) {
        if !std::mem::take(&mut self.open) {
            return;
        }
        let end = EndFrame { number: 0, shown: None, reference: Arc::new([]), drawn: false };
        self.profiler.event(&Event::EndPass);
        let profile = self.profiler.event(&Event::EndFrame(end)).unwrap_or_default();
        let start = Instant::now();
        let estimate = self.bound.frame(&profile).phases.into_iter().next();
        self.time += start.elapsed();
        let cycles = (self.end - self.begin).max(1.0);
        self.begin = self.end;
        let counts = std::mem::take(&mut self.counts);
        let estimate = estimate.map_or(counts.clone(), |estimate| {
            let mut units = estimate.units;
            units.push(("flow", cycles));
            Estimate { units, memory: estimate.memory, texture_misses: estimate.textures[1], ..counts }
        });
        self.estimates.push(Estimate { cycles, ..estimate });
    }
}
