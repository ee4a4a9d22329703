//! The time of a render pass.

use super::flow::Rates;
use super::memory::Traffic;
use super::shading::Requests;
use super::texture::{Missed, Sharing, missed};
use super::{BLOCKS, Bound, PhaseEstimate, Roofs, Touched, compressed};
use crate::machine::config::MemoryKind;
use crate::mem::REQUEST_BYTES;
use crate::unit::interleave::Interleave;
use crate::unit::phase::PhaseKind;
use crate::work::profile::{
    AttachmentProfile, BLOCK_CACHES, BUNDLE, Cell, DrawProfile, FIRST, FLAT, LINES_FOLLOWED, LineProfile, PhaseProfile, REUSE,
    Toucher,
};
use crate::work::{LINE, TILE};

/// What a pass does to the second-level cache.
#[derive(Clone, Copy, Debug, Default)]
struct PassTraffic {
    all: Traffic,
    textures: Traffic,
    /// Blocks read, of colour and of depth.
    fills: [Traffic; 2],
    /// Of resolves, at the end.
    resolved: Traffic,
}

impl Bound<'_> {
    pub(super) fn pass(&mut self, phase: &PhaseProfile, touched: &Touched) -> PhaseEstimate {
        let PhaseProfile::Pass { number, label, size, draws, windows, cells, color, depth, blocks, block_misses, lines } =
            phase
        else {
            unreachable!("a pass")
        };
        let config = self.config;
        let owners = self.owners(*size, cells);
        let (textures, missed) = self.textures(draws, lines);
        let traffic = self.traffic(color, depth.as_ref(), &missed, touched);

        let mut roofs = Roofs::default();
        let segments = draws.iter().map(|draw| draw.segments).sum::<u64>();
        roofs.add("command", (segments + 2) as f64 * f64::from(config.command.command_cycles));
        let quads = f64::from(config.core.warp_width) / 4.0;
        let part = 1.0 - libm::exp(-missed.bundle * quads / f64::from(BUNDLE));
        let requests = Requests { missed: part, latency: self.latency(&traffic.textures) };
        let mut rates: Vec<Rates> = draws.iter().map(|draw| self.rates(&mut roofs, draw, &requests)).collect();
        let pins = self.attachments(&mut roofs, color, depth.as_ref(), blocks, block_misses, cells, &traffic);
        rates.iter_mut().for_each(|rates| (rates.color_block, rates.depth_block) = (pins[0], pins[1]));
        let quads: f64 = draws.iter().map(|draw| draw.fragment.requests() as f64).sum();
        let cycles = self
            .dram(&traffic.all)
            .max(rates.iter().zip(draws).map(|(r, d)| r.texture * d.fragment.runs as f64).sum::<f64>() / self.pipelines);
        let stalled = self.stalled(&traffic, quads, cycles);
        rates.iter_mut().zip(draws).filter(|(_, draw)| draw.fragment.runs > 0).for_each(|(rates, draw)| {
            rates.texture += stalled * draw.fragment.requests() as f64 / draw.fragment.runs as f64;
        });
        let fluid = self.fluid(&mut roofs, &rates, &owners, windows, cells);
        let port = f64::from(config.memory.port_width);
        let cores = self.pipelines * f64::from(config.core.per_pipeline);
        let misses = textures[1] / cores;
        roofs.add("texture port", misses * LINE as f64 / port);
        roofs.add("texture misses", misses * requests.latency / f64::from(config.texture.misses));
        let mut memory = traffic.all;
        let l2 = &config.l2;
        roofs.add("l2", memory.lookups / f64::from(l2.slices * l2.lookups_per_cycle));
        roofs.add("dram", self.dram(&memory));
        let (mut limit, mut most) = roofs.slowest();
        if fluid > most {
            // What is between units that take turns at being the slowest.
            (limit, most) = (if most > 0.9 * fluid { limit } else { "imbalance" }, fluid);
        }
        let latency = rates.iter().map(|rates| rates.latency).fold(0.0, f64::max);
        let drawn = if draws.iter().any(|draw| draw.primitives > 0) { latency + self.fill() } else { 0.0 };
        // Resolves begin when all is drawn.
        let resolve = self.resolve(color, blocks[1], &traffic.resolved);
        roofs.add("resolve", resolve);
        memory += traffic.resolved;
        limit = if resolve > most { "resolve" } else { limit };
        let skipped = draws.is_empty() && resolve == 0.0 && config.command.skip_empty_passes;
        let barrier = if skipped { 0.0 } else { f64::from(config.command.barrier_cycles) };
        let cycles = most + drawn + resolve + barrier;
        let (kind, number, label) = (PhaseKind::Pass, *number, label.clone());
        PhaseEstimate { kind, number, label, cycles, limit, units: roofs.units, memory, textures }
    }

    /// Cycles of resolving what is resolved, block after block: one that nothing was drawn into is only written; others are read too, over
    /// the same wires, behind whatever the port has queued, and are waited for in order.
    fn resolve(&self, color: &[AttachmentProfile], drawn: u64, traffic: &Traffic) -> f64 {
        let Some(attachment) = color.iter().find(|attachment| attachment.resolved > 0) else { return 0.0 };
        let (config, request) = (&self.config.resolve, REQUEST_BYTES as f64);
        let part = if self.config.color.compression { compressed(attachment) } else { 1.0 };
        let blocks = color.iter().map(|attachment| attachment.resolved as f64 / request).sum::<f64>().max(1.0);
        let drawn = (drawn as f64).min(blocks);
        let written = (request / f64::from(self.config.memory.port_width)).max(f64::from(config.block_cycles));
        let asked = (attachment.block_bytes as f64 * part / request).ceil();
        let queued = f64::from(self.config.memory.port_queue) * (written + asked) / (1.0 + asked);
        let misses = f64::from(config.misses);
        let units = (blocks - drawn) * written + drawn * (written + asked);
        let wait = self.latency(traffic) + queued + self.behind_writes(traffic, misses * traffic.miss_rate(), units);
        let read = (written + asked).max(wait * asked / misses);
        ((blocks - drawn) * written + drawn * read).max(self.dram(traffic))
    }

    /// How much longer the last of so many reads is under way because DRAM is writing what some traffic of so many cycles writes: half of a
    /// batch, if one of them meets any.
    fn behind_writes(&self, traffic: &Traffic, reads: f64, cycles: f64) -> f64 {
        if self.config.memory.kind == MemoryKind::Ideal {
            return 0.0;
        }
        let batch = self.batch() / self.dram_rate * f64::from(self.config.dram.channels);
        let writing = (traffic.written / self.dram_rate / cycles.max(1.0)).min(1.0);
        (1.0 - libm::pow(1.0 - writing, reads)) * 0.5 * batch
    }

    /// Who owns each cell; none: all in turn.
    fn owners(&self, size: [u32; 2], cells: &[Cell]) -> Vec<Option<u8>> {
        let distribute = &self.config.distribute;
        let mut interleave = Interleave::new(distribute.pattern, self.config.card.pipelines, distribute.tile);
        interleave.begin_pass(size[0], size[1]);
        // Tiles that are smaller than a screen tile share it evenly.
        let own = |[x, y]: [u16; 2]| {
            (distribute.tile >= TILE).then(|| interleave.owner(u32::from(x) * BLOCKS, u32::from(y) * BLOCKS))
        };
        cells.iter().map(|cell| own(cell.tile)).collect()
    }

    /// Lookups of the texture caches and their misses, and which these are.
    fn textures(&self, draws: &[DrawProfile], lines: &LineProfile) -> ([f64; 2], Missed) {
        let config = self.config;
        let sum = |of: fn(&DrawProfile) -> u64| draws.iter().map(of).sum::<u64>() as f64;
        let quads = sum(|draw| draw.fragment.runs);
        let lookups = sum(|draw| draw.fragment.texture_lines + draw.fragment.access_lines);
        // Those that have most lookups say how many warps are under way.
        let most = draws.iter().max_by_key(|draw| draw.fragment.texture_lines + draw.fragment.access_lines);
        let warps = most.map_or(1.0, |draw| self.resident(draw.registers[1]));
        let cores = f64::from(config.core.per_pipeline);
        let warps = warps.min(f64::from(config.dispatch.reorder) / cores).max(1.0);
        let ways = config.texture.cache_ways.min(config.texture.cache_lines);
        let sharing = Sharing {
            requests: sum(|draw| draw.fragment.requests()) / quads.max(1.0),
            resident: (warps * f64::from(config.core.warp_width) / f64::from(4 * BUNDLE)).max(1.0),
            pipelines: self.pipelines,
            sets: f64::from(config.texture.cache_lines / ways),
            ways,
            bundles: quads / f64::from(BUNDLE),
            followed: f64::from(LINES_FOLLOWED),
        };
        let missed = missed(lines, &sharing);
        ([lookups, missed.rate * lookups], missed)
    }

    /// What a pass does to the second-level cache.
    fn traffic(
        &mut self,
        color: &[AttachmentProfile],
        depth: Option<&AttachmentProfile>,
        missed: &Missed,
        touched: &Touched,
    ) -> PassTraffic {
        let c = self.config;
        let mut sum = PassTraffic::default();
        // A block has left its cache where as many others have come as all pipelines' caches hold.
        let class = |blocks: f64| BLOCK_CACHES.iter().position(|&known| known as f64 * std::f64::consts::SQRT_2 > blocks);
        let level = |blocks: f64| class(blocks * self.pipelines).unwrap_or(BLOCK_CACHES.len() - 1) as u8;
        let levels =
            [level(f64::from(c.color.cache_blocks) / color.len().max(1) as f64), level(f64::from(c.depth.cache_blocks))];
        let mut targets = [None; 8];
        targets.iter_mut().zip(color).for_each(|(target, attachment)| *target = Some(attachment));
        // What is missed as likely as not is missed every other time.
        let mut due = 0.0;
        // What is missed again soon is in the second level, unless that has hardly more room than all first levels together.
        let first = f64::from(c.texture.cache_lines * c.core.per_pipeline) * self.pipelines * LINE as f64;
        let second = f64::from(c.l2.slices) * f64::from(c.l2.lines * c.l2.line_bytes);
        let lost = if second < 2.0 * first { missed.inner } else { 0.0 };
        let inner = Traffic { lookups: missed.inner, misses: lost, read: lost * LINE as f64, written: 0.0 };
        (sum.textures, sum.all) = (inner, inner);
        for touch in touched.touches {
            if !self.shared.follows(touch.line, touched.sampled.shift) {
                continue;
            }
            let (attachment, level, compression, fast_clear) = match touch.by {
                Toucher::Texture => {
                    due += missed.class(touch.class);
                    if due >= 0.5 {
                        due -= 1.0;
                        let traffic = self.plain(touch, touched.sampled.shift);
                        sum.textures += traffic;
                        sum.all += traffic;
                    }
                    continue;
                }
                Toucher::Resolve => {
                    if let Some(attachment) = color.iter().find(|attachment| attachment.resolved > 0) {
                        let bytes = (attachment.block_bytes as f64 * compressed(attachment)) as u64;
                        sum.resolved += self.shared.access(touch.line, bytes, false);
                    }
                    continue;
                }
                Toucher::Write => {
                    sum.resolved += self.plain(touch, touched.sampled.shift);
                    continue;
                }
                Toucher::Color => {
                    let target = targets[usize::from(touch.step & !FLAT).min(7)].or(color.first());
                    (target, levels[0], c.color.compression, c.color.fast_clear)
                }
                Toucher::Depth => (depth, levels[1], c.depth.compression, c.color.fast_clear),
                _ => {
                    sum.all += self.plain(touch, touched.sampled.shift);
                    continue;
                }
            };
            let Some(attachment) = attachment else { continue };
            if touch.near <= level {
                continue;
            }
            let part = if compression { compressed(attachment) } else { 1.0 };
            let flat = compression && touch.step & FLAT != 0;
            let bytes = if flat { LINE } else { (attachment.block_bytes as f64 * part) as u64 };
            let mut traffic = Traffic::default();
            if touch.near != FIRST || attachment.loads || !fast_clear {
                traffic += self.shared.access(touch.line, bytes, false);
                sum.fills[usize::from(touch.by == Toucher::Depth)] += traffic;
            }
            // What is read only leaves without a trace.
            if touch.by == Toucher::Color || touch.step & !FLAT != 0 {
                traffic += self.shared.access(touch.line, bytes, true);
            }
            sum.all += traffic;
        }
        sum
    }

    /// Cycles that a quad's request costs a texture unit on average because quads leave it in order and DRAM is writing: of as many quads as
    /// are between address and filter all wait for one whose line lies behind a batch of writes. A pass takes `cycles` otherwise.
    fn stalled(&self, traffic: &PassTraffic, quads: f64, cycles: f64) -> f64 {
        let (dram, texture) = (&self.config.dram, &self.config.texture);
        if quads == 0.0 || self.config.memory.kind == MemoryKind::Ideal {
            return 0.0;
        }
        let batch = self.batch() / self.dram_rate * f64::from(dram.channels);
        let writing = (traffic.all.written / self.dram_rate / cycles.max(1.0)).min(1.0);
        let fifo = f64::from(texture.fifo);
        let reads = traffic.textures.read / LINE as f64 / quads * fifo;
        let covered = fifo / f64::from(texture.quads_per_cycle);
        let wait = self.memory_latency + f64::from(texture.latency) + 0.5 * batch - covered;
        (1.0 - libm::pow(1.0 - writing, reads)) * wait.max(0.0) / fifo
    }

    /// Cycles of the first item from the command processor to the ROPs, without what shaders take, and of the last block to memory.
    fn fill(&self) -> f64 {
        let c = self.config;
        let ways = [
            c.command.command_cycles,
            c.fetch.latency,
            c.assembly.latency,
            c.clip.latency,
            c.network.link_latency,
            c.setup.latency,
            c.traverse.latency,
            c.depth.latency,
            c.depth.output_latency,
            c.interpolate.latency,
            c.dispatch.latency,
            c.dispatch.output_latency,
            c.color.latency,
        ];
        ways.iter().map(|&n| f64::from(n)).sum::<f64>() + 2.0 * self.memory_latency
    }

    /// What the units take for an item of a draw; adds what its geometry takes in all.
    fn rates(&self, roofs: &mut Roofs, draw: &DrawProfile, requests: &Requests) -> Rates {
        let c = self.config;
        let per = |n: u64, rate: u32| n as f64 / f64::from(rate);
        let units = f64::from(c.card.geometry_units);

        // Geometry, for all primitives.
        let vertices = interpolated(&REUSE, &draw.shaded_vertices, c.fetch.reuse as usize);
        let attribute_lines = (draw.vertex_bytes as f64 / LINE as f64).max(draw.attributes.min(1) as f64);
        let lookups = vertices * attribute_lines / f64::from(c.fetch.lookups_per_cycle);
        let distinct = draw.shaded_vertices[REUSE.len() - 1].min(draw.vertex.runs) as f64;
        let fetched = distinct * draw.vertex_bytes as f64 + (draw.indices * draw.index_bytes) as f64;
        let shading =
            self.shading(&draw.vertex, 1.0, draw.registers[0], &Requests { missed: 1.0, latency: self.memory_latency });
        // A batch is in flight from its indices to the assembly of its last primitive.
        let stay = shading.latency + self.memory_latency + f64::from(c.fetch.latency + c.assembly.latency);
        // The last batch of a segment is half full on average.
        let batches = vertices / f64::from(c.core.warp_width) + 0.5 * draw.segments as f64;
        let invocations = batches * f64::from(c.core.warp_width);
        // Indices of a segment are asked for when those of the one before have been read.
        let indices = if draw.index_bytes > 0 { draw.segments as f64 * self.hit_latency } else { 0.0 };
        // So many lines of them are held or on their way; each behind these comes after a trip to the second level, once one is read.
        let (bytes, lines) = (draw.index_bytes.max(1) as f64, f64::from(c.fetch.index_lines));
        let behind = (draw.indices * draw.index_bytes) as f64 / LINE as f64 - draw.segments as f64 * lines;
        let trip = self.hit_latency + LINE as f64 / bytes / f64::from(c.fetch.indices_per_cycle);
        let stream = behind.max(0.0) * trip / lines;
        let clipping =
            per(draw.primitives, c.clip.primitives_per_cycle) + (draw.clipped * u64::from(c.clip.clip_cycles)) as f64;
        let fragment = self.shading(&draw.fragment, 4.0, draw.registers[1], requests);
        // A segment has its place until the last of it is written.
        let held = draw.segments as f64 * (shading.latency + fragment.latency + self.fill());
        let geometry = [
            ("command", held / f64::from(c.command.segments)),
            ("fetch", per(draw.indices, c.fetch.indices_per_cycle).max(lookups).max(stream) + indices),
            ("vertex batches", batches * stay / f64::from(c.fetch.batches)),
            ("fetch port", fetched / f64::from(c.memory.port_width)),
            ("assembly", per(draw.primitives, c.assembly.primitives_per_cycle)),
            ("clip", clipping / units),
            ("distribute", per(draw.triangles, c.distribute.triangles_per_cycle) / units),
        ];
        geometry.iter().for_each(|&(unit, cycles)| roofs.add(unit, cycles));
        let slowest = geometry.iter().map(|unit| unit.1).fold(0.0, f64::max);
        let primitives = (draw.primitives.max(1)) as f64;
        let cores = self.pipelines * f64::from(c.core.per_pipeline);

        // Rasterisers.
        let turns = draw.varyings.div_ceil(u64::from(c.interpolate.words_per_cycle)).max(1);
        let written = (draw.targets - draw.blended) as f64 / f64::from(c.color.quads_per_cycle);
        Rates {
            geometry: slowest / primitives,
            vertex_core: shading.core * invocations / cores / primitives,
            vertex_texture: shading.texture * invocations / cores / primitives,
            latency: shading.latency + fragment.latency,
            shaded: fragment.latency,
            setup: f64::from(c.setup.interval) / f64::from(c.setup.triangles_per_cycle),
            test: 1.0 / f64::from(c.traverse.tests_per_cycle),
            block: 1.0 / f64::from(c.traverse.blocks_per_cycle),
            group: 4.0 / f64::from(c.traverse.quads_per_cycle),
            depth: if draw.depth { 4.0 / f64::from(c.depth.quads_per_cycle) } else { 0.0 },
            interpolate: turns as f64 / f64::from(c.interpolate.quads_per_cycle),
            dispatch: 1.0 / f64::from(c.dispatch.quads_per_cycle),
            core: fragment.core / f64::from(c.core.per_pipeline),
            texture: fragment.texture / f64::from(c.core.per_pipeline),
            color: written + draw.blended as f64 / f64::from(c.color.blends_per_cycle),
            color_block: 0.0,
            depth_block: 0.0,
        }
    }

    /// Adds what the attachments of a pass move through their ports; the cycles that each block takes at least in colour and in depth.
    fn attachments(
        &self,
        roofs: &mut Roofs,
        color: &[AttachmentProfile],
        depth: Option<&AttachmentProfile>,
        blocks: &[u64; 2],
        misses: &[[u64; BLOCK_CACHES.len()]; 2],
        cells: &[Cell],
        traffic: &PassTraffic,
    ) -> [f64; 2] {
        let (port, c) = (f64::from(self.config.memory.port_width), self.config);
        let sum = |of: fn(&Cell) -> u32| cells.iter().map(|cell| u64::from(of(cell))).sum::<u64>() as f64;
        let groups = sum(|cell| cell.groups) / sum(|cell| cell.seen).max(1.0);
        let uses = [sum(|cell| cell.pins), sum(|cell| cell.seen)];
        let mut least = [0.0; 2];
        let mut rop =
            |unit: &'static str, attachment: &AttachmentProfile, side: usize, cache: f64, knobs: (bool, u32, u32, u32)| {
                let (compression, fifo, requests, latency) = knobs;
                let part = if compression { compressed(attachment) } else { 1.0 };
                let bytes = attachment.block_bytes as f64;
                let distinct = blocks[1 - side] as f64;
                let missed = interpolated(&BLOCK_CACHES, &misses[1 - side], (cache * self.pipelines) as usize);
                // What is not cleared by flag is read at the first touch; what came back is read again.
                let first = if attachment.loads || !c.color.fast_clear { distinct } else { 0.0 };
                let filled = first + (missed - distinct).max(0.0);
                let (read, written) = (filled * bytes * part, missed * bytes * part);
                roofs.add(unit, read.max(written) / self.pipelines / port);
                // Blocks between lookup and use stay in their sets, and go on in order: of as many as find room at once, all wait for one
                // that is missed.
                let at_once = self.in_use[side].min(f64::from(fifo) / groups.max(1.0)).max(1.0);
                // A block that is in use already takes no further place.
                let others = interpolated(&BLOCK_CACHES, &misses[1 - side], (at_once * self.pipelines) as usize).max(1.0);
                let again = (others / uses[side].max(1.0)).min(1.0);
                let filled = (filled / others).min(1.0);
                // What leaves goes first, and what comes takes its time on the wires.
                let moved = 2.0 * bytes * part / port + bytes * part / f64::from(c.l2.width);
                let wait = self.latency(&traffic.fills[side]) + f64::from(latency) + moved;
                let turn = again * (1.0 - libm::pow(1.0 - filled, at_once)) * wait / at_once;
                let in_flight = again * filled * (bytes * part / REQUEST_BYTES as f64).ceil() * wait / f64::from(requests);
                least[side] += turn.max(in_flight);
            };
        for attachment in color {
            let knobs = (c.color.compression, c.color.fifo, c.color.misses, c.color.latency);
            rop("color port", attachment, 0, f64::from(c.color.cache_blocks) / color.len() as f64, knobs);
        }
        if let Some(depth) = depth {
            let knobs = (c.depth.compression, c.depth.fifo, c.depth.misses, c.depth.latency);
            rop("depth port", depth, 1, f64::from(c.depth.cache_blocks), knobs);
        }
        least
    }
}

/// A count behind a cache of some size, between those for which it is known.
fn interpolated<const N: usize>(sizes: &[usize; N], counts: &[u64; N], size: usize) -> f64 {
    let above = sizes.iter().position(|&known| known >= size).unwrap_or(N - 1);
    let below = above.saturating_sub(1);
    if above == below || size >= sizes[above] || size <= sizes[below] {
        return counts[if size <= sizes[below] { below } else { above }] as f64;
    }
    let part = (size - sizes[below]) as f64 / (sizes[above] - sizes[below]) as f64;
    counts[below] as f64 + part * (counts[above] as f64 - counts[below] as f64)
}
