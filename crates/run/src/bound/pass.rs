//! The time of a render pass.

use super::flow::Rates;
use super::images::Composed;
use super::memory::Traffic;
use super::shading::Requests;
use super::texture::{Missed, Sharing, missed};
use super::traffic::PassTraffic;
use super::{BLOCKS, Bound, PhaseEstimate, Roofs, Touched, compressed, places};
use gfx::stage::Stage;
use machine::class::Sorted;
use machine::config::MemoryKind;
use mem::{HEADER, REQUEST_BYTES};
use unit::compression::Codec;
use unit::fetch::Reuse;
use unit::interleave::{Interleave, Pattern};
use unit::network::Topology;
use unit::phase::PhaseKind;
use unit::token::bytes;
use work::profile::{
    AttachmentProfile, BLOCK_CACHES, BUNDLE, Cell, DEALT, DrawProfile, LINES_FOLLOWED, LineProfile, PhaseProfile, REUSE,
};
use work::{BLOCK, LINE, TILE};

/// Vertices of a warp where primitives come one by one from several routers, so that warps start before they are full: measured over
/// the traces of the repository, on the baseline.
const ROUTED: f64 = 8.0;

impl Bound<'_> {
    pub(super) fn pass(&mut self, phase: &PhaseProfile, touched: &Touched) -> PhaseEstimate {
        let PhaseProfile::Pass {
            number,
            label,
            size,
            draws,
            windows,
            cells,
            color,
            depth,
            blocks,
            block_misses,
            copies,
            lines,
        } = phase
        else {
            unreachable!("a pass")
        };
        let config = self.config;
        let owners = self.owners(*size, cells);
        let (textures, missed) = self.textures(draws, lines);
        let binned = self.binned;
        let lists = binned.then(|| self.lists(draws, windows, cells));
        let followed = lists.as_ref().map(|lists| self.followed(lists, windows, cells, *size));
        let shown = self.shown(draws);
        let images = self.sorted == Sorted::Images;
        let copies = if images { self.copies_of(draws, self.copies(copies)) } else { 1.0 };
        // All composed blocks are resolved, drawn or not.
        let all = f64::from(size[0].div_ceil(BLOCK) * size[1].div_ceil(BLOCK));
        let drawn = if images && self.pipelines > 1.0 { all } else { blocks[1] as f64 };
        let resolved = drawn / (blocks[1] as f64).max(1.0);
        let traffic = self.traffic(
            color,
            depth.as_ref(),
            &missed,
            touched,
            lists.as_ref().zip(followed.as_ref()),
            [shown, copies, resolved, blocks[1] as f64 / all.max(1.0)],
        );

        let mut roofs = Roofs::default();
        let segments = draws.iter().map(|draw| draw.segments).sum::<u64>();
        roofs.add("command", (segments + 2) as f64 * f64::from(config.command.command_cycles));
        let quads = f64::from(config.core.warp_width) / 4.0;
        let part = |bundle: f64| 1.0 - libm::exp(-bundle * quads / f64::from(BUNDLE));
        let requests = Requests {
            missed: part(missed.bundle),
            slow: part(missed.bundle * traffic.textures.miss_rate()),
            latency: self.latency(&traffic.textures),
            line: missed.rate,
            port: LINE as f64 / f64::from(config.memory.port_width),
        };
        // Lines of indices that the second level has lost wait behind what is written meanwhile, the longer the sooner a pass is over. Where
        // geometry waits for pixels anyway, as in sort-middle, the trip without that is nearer to the truth.
        let index = self.latency(&traffic.indices);
        let (attributes, fill) = (self.latency(&traffic.attributes), self.fill(&traffic));
        let first: f64 = draws
            .iter()
            .map(|draw| self.rates(&mut Roofs::default(), (draw, color), &requests, [index, attributes, fill]))
            .zip(draws)
            .map(|(rates, draw)| rates.geometry * draw.primitives as f64)
            .sum();
        let meanwhile = if binned { &traffic.binned } else { &traffic.all };
        let lines = f64::from(config.fetch.index_lines) * traffic.indices.miss_rate();
        let waits = index + self.behind_writes(meanwhile, lines, first.max(self.dram(meanwhile)));
        let index = if self.sorted == Sorted::Triangles && !binned { index } else { waits };
        let mut rates: Vec<Rates> =
            draws.iter().map(|draw| self.rates(&mut roofs, (draw, color), &requests, [index, attributes, fill])).collect();
        // Indices and attributes have ports of their own. The cache of attributes has at most what is not read from DRAM.
        if self.sorted != Sorted::Primitives {
            let fronts = if self.sorted.own_geometry() { self.pipelines } else { 1.0 };
            roofs.add("vertex port", traffic.attributes.read / f64::from(config.memory.port_width) / fronts);
        }
        let (pins, left) = self.attachments(&mut roofs, color, depth.as_ref(), blocks, block_misses, cells, &traffic);
        rates.iter_mut().for_each(|rates| (rates.color_block, rates.depth_block) = (pins[0], pins[1]));
        let quads: f64 = draws.iter().map(|draw| draw.costs[Stage::Fragment].requests() as f64).sum();
        let units = rates.iter().zip(draws).map(|(r, d)| r.texture * d.costs[Stage::Fragment].runs as f64).sum::<f64>()
            / self.pipelines;
        let cycles = self.dram(&traffic.all).max(units);
        let each = units * self.pipelines * f64::from(config.core.per_pipeline) / quads.max(1.0);
        let stalled = self.stalled(&traffic, quads, [cycles, each]);
        rates.iter_mut().zip(draws).filter(|(_, draw)| draw.costs[Stage::Fragment].runs > 0).for_each(|(rates, draw)| {
            rates.texture += stalled * draw.costs[Stage::Fragment].requests() as f64 / draw.costs[Stage::Fragment].runs as f64;
        });
        let (mut geometry, mut roofs) = if lists.is_some() { (roofs, Roofs::default()) } else { (Roofs::default(), roofs) };
        let mut binning = 0.0;
        let fluid = match &lists {
            None if matches!(self.sorted, Sorted::Fragments | Sorted::Images) => {
                self.dealt(&mut roofs, (draws, &rates), &owners, (windows, cells))
            }
            None if self.sorted == Sorted::Primitives => self.routed(&mut roofs, &rates, &owners, (windows, cells)),
            None => self.fluid(&mut roofs, &rates, &owners, windows, cells),
            Some(lists) => {
                let (work, attachments) = ((&windows[..], &cells[..]), (&color[..], depth.as_ref()));
                let mut both = [geometry, roofs];
                let read = self.latency(&traffic.listed);
                let [first, drawn] = self.tiles(&mut both, lists, &rates, (&owners, *size), work, attachments, [read, fill]);
                [geometry, roofs] = both;
                geometry.add("dram", self.dram(&traffic.binned));
                binning = first.max(geometry.slowest().1);
                drawn
            }
        };
        let port = f64::from(config.memory.port_width);
        let cores = self.pipelines * f64::from(config.core.per_pipeline);
        let misses = textures[1] / cores;
        roofs.add("texture port", misses * LINE as f64 / port);
        roofs.add("texture misses", misses * requests.latency / f64::from(config.texture.misses));
        let mut memory = traffic.all;
        let l2 = &config.l2;
        // On a tile-based machine this is the traffic that is left when all is binned.
        let rest = memory.without(&traffic.binned);
        roofs.add("l2", rest.lookups / f64::from(l2.slices * l2.lookups_per_cycle));
        roofs.add("dram", self.dram(&rest));
        let (mut limit, mut most) = roofs.slowest();
        let mut turns = "";
        if fluid > most {
            // The difference comes from units that take turns at being the slowest.
            turns = if most > 0.9 * fluid { "" } else { roofs.second() };
            most = fluid;
        }
        if binning > most {
            (limit, turns) = (geometry.slowest().0, "");
        }
        most += binning;
        geometry.units.iter().for_each(|&(unit, cycles)| roofs.add(unit, cycles));
        let latency = rates.iter().map(|rates| rates.latency).fold(0.0, f64::max);
        let first_and_last = if draws.iter().any(|draw| draw.primitives > 0) { latency + fill } else { 0.0 };
        // Copies are composed when all is drawn.
        let composed = if images && !draws.is_empty() {
            self.composed(draws, (color, depth.as_ref()), *size, [blocks[1] as f64, copies])
        } else {
            Composed::default()
        };
        roofs.add("compose", composed.cycles);
        memory += composed.traffic;
        if composed.cycles > most {
            let dram = self.dram(&composed.traffic) > composed.units;
            (limit, turns) = (if dram { "dram" } else { "compose" }, "");
        }
        // Resolves begin when all is drawn.
        let resolve = self.resolve(color, [blocks[1] as f64, drawn], &traffic.resolved);
        roofs.add("resolve", resolve);
        memory += traffic.resolved;
        if resolve > most.max(composed.cycles) {
            (limit, turns) = ("resolve", "");
        }
        let skipped = draws.is_empty() && resolve == 0.0 && config.command.skip_empty_passes;
        let barrier = if skipped { 0.0 } else { f64::from(config.command.barrier_cycles) };
        let cleared = self.cleared(*size, color.iter().chain(depth));
        memory += Traffic { written: cleared, ..Traffic::default() };
        let clears = cleared / f64::from(config.memory.port_width);
        let cycles = most + first_and_last + left + composed.cycles + resolve + barrier + clears;
        let (kind, number, label) = (PhaseKind::Pass, *number, label.clone());
        PhaseEstimate { kind, number, label, cycles, limit, turns, units: roofs.units, memory, textures }
    }

    /// Bytes that a pass clears in memory before it begins: of attachments that it does not load, where clears are not by flag.
    fn cleared<'p>(&self, size: [u32; 2], attachments: impl Iterator<Item = &'p AttachmentProfile>) -> f64 {
        if self.config.color.fast_clear {
            return 0.0;
        }
        let blocks = u64::from(size[0].div_ceil(BLOCK)) * u64::from(size[1].div_ceil(BLOCK));
        attachments.filter(|attachment| !attachment.loads).map(|attachment| (blocks * attachment.block_bytes) as f64).sum()
    }

    /// Cycles of a triangle on its link to a pipeline, where triangles are sorted.
    fn link(&self) -> f64 {
        if self.sorted != Sorted::Triangles || self.binned {
            return 0.0;
        }
        let network = &self.config.network;
        let links = match network.topology {
            // One from each sender.
            Topology::PointToPoint => f64::from(self.config.card.geometry_units),
            // One for all.
            Topology::Bus => 1.0 / self.pipelines,
            Topology::Crossbar | Topology::Ring | Topology::Mesh | Topology::Butterfly => 1.0,
        };
        f64::from(bytes::TRIANGLE) / f64::from(network.link_bytes) / links
    }

    /// The part of an attachment's raw size that a pass leaves in memory.
    pub(super) fn left(&self, attachment: &AttachmentProfile) -> f64 {
        let c = self.config;
        let composed = self.sorted == Sorted::Images && c.card.pipelines > 1;
        compressed(attachment, if composed { self.composed_codec() } else { self.color_codec() })
    }

    /// The share of its raw size that a block of pixels takes which an attachment's samples are resolved to, where a share of the blocks is
    /// drawn: these are compressed as their samples are, and the others have one colour, which takes a line.
    pub(super) fn pixels(&self, attachment: &AttachmentProfile, drawn: f64) -> f64 {
        let Some(codec) = self.color_codec() else { return 1.0 };
        let drawn = drawn.min(1.0);
        drawn * compressed(attachment, Some(codec)) + (1.0 - drawn) * LINE as f64 / REQUEST_BYTES as f64
    }

    /// Cycles of resolving what is resolved, block after block in each pipeline: one that nothing was drawn into is only written; others are
    /// read too, which has wires of its own but for the requests, and are waited for in order.
    fn resolve(&self, color: &[AttachmentProfile], [touched, drawn]: [f64; 2], traffic: &Traffic) -> f64 {
        let Some(attachment) = color.iter().find(|attachment| attachment.resolved > 0) else { return 0.0 };
        let (resolve, request, header) = (&self.config.resolve, REQUEST_BYTES as f64, f64::from(HEADER));
        let part = self.left(attachment);
        let blocks = color.iter().map(|attachment| attachment.resolved as f64 / request).sum::<f64>().max(1.0);
        let drawn = drawn.min(blocks);
        let port = f64::from(self.config.memory.port_width);
        let pixels = request * self.pixels(attachment, touched / blocks);
        let written = ((pixels + header) / port).max(f64::from(resolve.block_cycles));
        let bytes = attachment.block_bytes as f64 * part;
        let asked = (bytes / request).ceil();
        let misses = f64::from(resolve.misses);
        let (blocks, drawn) = (blocks / self.pipelines, drawn / self.pipelines);
        let units = (blocks - drawn) * written + drawn * written.max(bytes / port);
        let wait = self.latency(traffic) + self.behind_writes(traffic, misses * traffic.miss_rate(), units);
        let read = written.max(bytes / port).max((pixels + (1.0 + asked) * header) / port).max(wait * asked / misses);
        ((blocks - drawn) * written + drawn * read + self.latency(traffic)).max(self.dram(traffic))
    }

    /// The cycles by which DRAM's writes delay the last of `reads` reads. `traffic` writes for `cycles` cycles. If any of the reads comes while
    /// a batch is written, the delay is half of the batch.
    fn behind_writes(&self, traffic: &Traffic, reads: f64, cycles: f64) -> f64 {
        if self.config.memory.kind == MemoryKind::Ideal {
            return 0.0;
        }
        let batch = self.batch() / self.dram_rate * f64::from(self.config.dram.channels);
        let writing = (traffic.written / self.dram_rate / cycles.max(1.0)).min(1.0);
        (1.0 - libm::pow(1.0 - writing, reads)) * 0.5 * batch
    }

    /// The owner of each cell; none: all in turn.
    fn owners(&self, size: [u32; 2], cells: &[Cell]) -> Vec<Option<u8>> {
        let distribute = &self.config.distribute;
        // The larger of distribute.tile and bin.tile.
        let tile = self.config.owned_tile();
        let mut interleave = Interleave::new(distribute.pattern, self.config.card.pipelines, tile);
        interleave.begin_pass(size[0], size[1]);
        // Tiles that are smaller than a screen tile share it evenly, unless those of a pipeline lie together.
        let together = matches!(distribute.pattern, Pattern::Bands | Pattern::Blocks | Pattern::Balanced);
        let own = |[x, y]: [u16; 2]| {
            (together || tile >= TILE).then(|| interleave.owner(u32::from(x) * BLOCKS, u32::from(y) * BLOCKS))
        };
        cells.iter().map(|cell| own(cell.tile)).collect()
    }

    /// Lookups of the texture caches and their misses, and which these are.
    fn textures(&self, draws: &[DrawProfile], lines: &LineProfile) -> ([f64; 2], Missed) {
        let config = self.config;
        let sum = |of: fn(&DrawProfile) -> u64| draws.iter().map(of).sum::<u64>() as f64;
        let quads = sum(|draw| draw.costs[Stage::Fragment].runs);
        let lookups = sum(|draw| draw.costs[Stage::Fragment].texture_lines + draw.costs[Stage::Fragment].access_lines);
        // The draw with most lookups decides how many warps are under way.
        let most = draws
            .iter()
            .max_by_key(|draw| draw.costs[Stage::Fragment].texture_lines + draw.costs[Stage::Fragment].access_lines);
        let warps = most.map_or(1.0, |draw| self.resident(draw.registers[Stage::Fragment]));
        let cores = f64::from(config.core.per_pipeline);
        let warps = warps.min(f64::from(config.dispatch.reorder) / cores).max(1.0);
        // Lookups and misses are of 64 bytes: a longer line has several, which share a tag.
        let pieces = config.texture.cache_lines * config.texture.line_bytes / LINE as u32;
        let ways = config.texture.cache_ways.min(pieces);
        let sharing = Sharing {
            requests: sum(|draw| draw.costs[Stage::Fragment].requests()) / quads.max(1.0),
            resident: (warps * f64::from(config.core.warp_width) / f64::from(4 * BUNDLE)).max(1.0),
            pipelines: self.pipelines,
            sets: f64::from(pieces / ways),
            ways,
            bundles: quads / f64::from(BUNDLE),
            followed: f64::from(LINES_FOLLOWED),
        };
        let missed = missed(lines, &sharing);
        ([lookups, missed.rate * lookups], missed)
    }

    /// Cycles that a quad's request costs a texture unit on average because quads leave it in order and DRAM is writing: of as many quads as
    /// are between address and filter all wait for one whose line lies behind a batch of writes. A pass takes `cycles` otherwise, a request `each`.
    fn stalled(&self, traffic: &PassTraffic, quads: f64, [cycles, each]: [f64; 2]) -> f64 {
        let (dram, texture) = (&self.config.dram, &self.config.texture);
        if quads == 0.0 || self.config.memory.kind == MemoryKind::Ideal {
            return 0.0;
        }
        let batch = self.batch() / self.dram_rate * f64::from(dram.channels);
        let writing = (traffic.all.written / self.dram_rate / cycles.max(1.0)).min(1.0);
        let fifo = f64::from(texture.fifo);
        let reads = traffic.textures.read / LINE as f64 / quads * fifo;
        let covered = fifo * each;
        let wait = self.memory_latency + f64::from(texture.latency) + 0.5 * batch - covered;
        (1.0 - libm::pow(1.0 - writing, reads)) * wait.max(0.0) / fifo
    }

    /// Cycles of the first item from the command processor to the ROPs, without what shaders take, and of the last block to the second level.
    /// Indices come first, then attributes.
    pub(super) fn fill(&self, traffic: &PassTraffic) -> f64 {
        let trip = |traffic: &Traffic| if traffic.lookups > 0.0 { self.latency(traffic) } else { 0.0 };
        let trips = trip(&traffic.indices) + trip(&traffic.attributes) + self.hit_latency;
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
        ways.iter().map(|&n| f64::from(n)).sum::<f64>() + trips
    }

    /// The cycles that the units take for an item of a draw. Adds the cycles that its geometry takes in all.
    fn rates(
        &self,
        roofs: &mut Roofs,
        (draw, color): (&DrawProfile, &[AttachmentProfile]),
        requests: &Requests,
        [index, attributes, fill]: [f64; 3],
    ) -> Rates {
        let c = self.config;
        let per = |n: u64, rate: u32| n as f64 / f64::from(rate);
        // Fronts that fetch and assemble, and units that clip, for all primitives or for those of one pipeline.
        let own = self.sorted.own_geometry();
        let units = if own { 1.0 } else { f64::from(c.card.geometry_units) };
        let fronts = if own { self.pipelines } else { 1.0 };

        // Geometry, for all primitives. A pipeline that gets them in batches shades vertices again that the batch before has.
        let vertices = interpolated(&REUSE, &draw.shaded_vertices, c.fetch.reuse as usize);
        let again = draw.dealt_vertices.saturating_sub(draw.shaded_vertices[REUSE.len() - 1]) as f64;
        let vertices = if own { vertices + again * f64::from(DEALT) / self.batch_of(self.expected(draw)) } else { vertices };
        // Batches of vertices are as short as those of primitives.
        let vertices = if c.fetch.reuse_until == Reuse::Batch { draw.batched_vertices as f64 } else { vertices };
        // A line that was looked up just before is not looked up again. Between two vertices of one stream lie those of the others.
        let shared = draw.streams < 2;
        let bytes = if shared { draw.vertex_bytes } else { draw.stream_lines };
        let attribute_lines = (bytes as f64 / LINE as f64).max(draw.attributes.min(1) as f64);
        let lookups = vertices * attribute_lines / f64::from(c.fetch.lookups_per_cycle);
        let shading = self.shading(
            &self.vertex_core,
            &draw.costs[Stage::Vertex],
            1.0,
            draw.registers[Stage::Vertex],
            &Requests { missed: 1.0, slow: 1.0, latency: self.memory_latency, ..Requests::default() },
        );
        // A batch is in flight from its indices to the assembly of its last primitive.
        let stay = shading.latency + attributes + f64::from(c.fetch.latency + c.assembly.latency);
        // The last batch of a segment is half full on average.
        let full = f64::from(c.core.warp_width).min(if self.sorted == Sorted::Primitives { ROUTED } else { f64::INFINITY });
        let batches = vertices / full + 0.5 * draw.segments as f64;
        let invocations = batches * f64::from(c.core.warp_width);
        // Lanes that are empty ask nothing.
        let asking = invocations.min(vertices + (0.5 * draw.segments as f64) * f64::from(c.core.warp_width));
        // At most `fetch.index_lines` lines of indices are held or under way, of one segment after the other. Each comes after a trip to the
        // second level, which begins once a line before it is read.
        let (bytes, lines) = (draw.index_bytes.max(1) as f64, f64::from(c.fetch.index_lines));
        let all = (draw.indices * draw.index_bytes) as f64 / LINE as f64;
        let trip = index + LINE as f64 / bytes / f64::from(c.fetch.indices_per_cycle);
        let stream = all * trip / lines;
        let clipping = per(draw.primitives, c.clip.primitives_per_cycle) * f64::from(c.clip.interval)
            + (draw.clipped * u64::from(c.clip.clip_cycles)) as f64;
        let fragment = self.shading(&c.core, &draw.costs[Stage::Fragment], 4.0, draw.registers[Stage::Fragment], requests);
        // Vertex cores shade in front of assembly, the cores of pipelines beside fragments.
        let unified = c.core.unified;
        let cores = if unified {
            self.pipelines / fronts * f64::from(c.core.per_pipeline)
        } else {
            f64::from(c.core.vertex_cores) / fronts
        };
        let [core, texture] = [shading.core * invocations / cores, shading.texture * asking / cores];
        let separate = [("vertex core", core), ("vertex texture", texture)];
        let separate = if unified { &[] } else { &separate[..] };
        // Warps of a core issue in turn, so that the first is held up by those that come while it runs, at most by all that the core holds.
        let each = shading.core * f64::from(c.core.warp_width);
        let held =
            batches.min(cores * f64::from(self.vertex_core.resident_warps(draw.registers[Stage::Vertex].max(1)))) / cores;
        let between = per(draw.indices, c.fetch.indices_per_cycle).max(lookups).max(stream) / batches.max(1.0) * cores;
        let first = (between * (libm::exp(each / between.max(1e-3)) - 1.0)).min(held * each);
        let vertex_latency = if unified { shading.latency } else { shading.latency.max(first) };
        // A segment has its place until the last of it is written.
        let held = draw.segments as f64 * (shading.latency + fragment.latency + fill);
        let held = held / f64::from(c.command.segments);
        let geometry = [
            ("command", if own { 0.0 } else { held }),
            ("fetch", per(draw.indices, c.fetch.indices_per_cycle).max(lookups).max(stream)),
            ("vertex batches", batches * stay / f64::from(c.fetch.batches)),
            ("fetch port", (draw.indices * draw.index_bytes) as f64 / f64::from(c.memory.port_width)),
            ("assembly", per(draw.primitives, c.assembly.primitives_per_cycle)),
            ("clip", clipping / units),
            ("distribute", draw.triangles as f64 * apart(c.distribute.triangles_per_cycle, c.distribute.interval) / units),
        ];
        // Where primitives are routed it is not known here how many come to which.
        let shares = if self.sorted == Sorted::Primitives { 0.0 } else { 1.0 / fronts };
        let geometry = || geometry.iter().chain(separate);
        geometry().for_each(|&(unit, cycles)| roofs.add(unit, cycles * shares));
        roofs.add("command", if own { held } else { 0.0 });
        let slowest = geometry().map(|unit| unit.1).fold(0.0, f64::max);
        let primitives = (draw.primitives.max(1)) as f64;

        // Rasterisers.
        let turns = draw.varyings.div_ceil(u64::from(c.interpolate.words_per_cycle)).max(1);
        // How many times as long the attachments take on average, written and blended.
        let [replaced, blended] = [false, true].map(|blended| {
            let times = |of: &AttachmentProfile| c.color.times(of.texel, of.samples, blended) as f64;
            color.iter().map(times).sum::<f64>() / color.len().max(1) as f64 * f64::from(c.color.interval)
        });
        let written = (draw.targets - draw.blended) as f64 * replaced / f64::from(c.color.quads_per_cycle);
        let blended = draw.blended as f64 * blended / f64::from(c.color.blends_per_cycle);
        let plain = draw.registers[Stage::Fragment] == 0;
        let traversed = if plain { c.traverse.depth_quads_per_cycle } else { c.traverse.quads_per_cycle };
        let route = (vertices / f64::from(c.route.vertices_per_cycle))
            .max(per(draw.primitives, c.route.primitives_per_cycle))
            .max(stream);
        Rates {
            route: route / primitives,
            geometry: slowest / primitives,
            vertex_core: if unified { core / primitives } else { 0.0 },
            vertex_texture: if unified { texture / primitives } else { 0.0 },
            latency: vertex_latency + fragment.latency,
            shaded: fragment.latency,
            setup: apart(c.setup.triangles_per_cycle, c.setup.interval).max(self.link()),
            test: 1.0 / f64::from(c.traverse.tests_per_cycle),
            block: 1.0 / f64::from(c.traverse.blocks_per_cycle),
            group: 4.0 * f64::from(c.traverse.interval) / f64::from(traversed),
            depth: if draw.depth { 4.0 / f64::from(c.depth.quads_per_cycle) } else { 0.0 },
            interpolate: turns as f64 * f64::from(c.interpolate.interval) / f64::from(c.interpolate.quads_per_cycle),
            dispatch: f64::from(c.dispatch.interval) / f64::from(c.dispatch.quads_per_cycle),
            core: fragment.core / f64::from(c.core.per_pipeline),
            texture: fragment.texture / f64::from(c.core.per_pipeline),
            color: written + blended,
            color_block: 0.0,
            depth_block: 0.0,
        }
    }

    /// Adds what the attachments of a pass move through their ports while it draws. Gives the cycles that each block takes at least in colour
    /// and in depth, and those in which the blocks that are in the caches when all is drawn leave them: each pipeline's colours and depths
    /// through a port of their own.
    fn attachments(
        &self,
        roofs: &mut Roofs,
        color: &[AttachmentProfile],
        depth: Option<&AttachmentProfile>,
        blocks: &[u64; 2],
        misses: &[[u64; BLOCK_CACHES.len()]; 2],
        cells: &[Cell],
        traffic: &PassTraffic,
    ) -> ([f64; 2], f64) {
        let (port, c) = (f64::from(self.config.memory.port_width), self.config);
        let sum = |of: fn(&Cell) -> u32| cells.iter().map(|cell| u64::from(of(cell))).sum::<u64>() as f64;
        let groups = sum(|cell| cell.groups) / sum(|cell| cell.seen).max(1.0);
        let uses = [sum(|cell| cell.pins), sum(|cell| cell.seen)];
        let (mut least, mut left) = ([0.0; 2], [0.0; 2]);
        let mut rop = |unit: &'static str,
                       attachment: &AttachmentProfile,
                       side: usize,
                       cache: f64,
                       knobs: (Option<Codec>, u32, u32, u32)| {
            let (codec, fifo, requests, latency) = knobs;
            let part = compressed(attachment, codec);
            let bytes = attachment.block_bytes as f64;
            let distinct = blocks[1 - side] as f64;
            let cached = |blocks: f64| interpolated(&BLOCK_CACHES, &misses[1 - side], (blocks * self.pipelines) as usize);
            // Where tiles are drawn one by one a block is missed once: it stays until its tile ends.
            let missed = if self.binned { distinct } else { cached(cache) };
            // A block that is not cleared by flag is read at its first touch, and again whenever it comes back.
            let first = if attachment.loads || !c.color.fast_clear { distinct } else { 0.0 };
            // Blocks that are replaced whole are not read.
            let kept = if side == 0 { 1.0 - traffic.replaced[1] / traffic.replaced[0].max(1.0) } else { 1.0 };
            let filled = (first + (missed - distinct).max(0.0)) * kept;
            // Tiles are written one by one, while others are drawn.
            let last = if self.binned || !attachment.stores { 0.0 } else { distinct.min(cache * self.pipelines).min(missed) };
            let (read, written) = (filled * bytes * part, (missed - last) * bytes * part);
            roofs.add(unit, read.max(written) / self.pipelines / port);
            left[side] += last * bytes * part / self.pipelines / port;
            // Blocks between lookup and use stay in their sets, and go on in order: of as many as find room at once, all wait for one
            // that is missed.
            let at_once = (self.in_use[side] / places(attachment)).min(f64::from(fifo) / groups.max(1.0)).max(1.0);
            // A block that is in use already takes no further place.
            let others = if self.binned { distinct } else { cached(at_once) }.max(1.0);
            let again = (others / uses[side].max(1.0)).min(1.0);
            let filled = (filled / others).min(1.0);
            // The outgoing block goes first, and the incoming block takes its time on the wires.
            let moved = 2.0 * bytes * part / port + bytes * part / f64::from(c.l2.width);
            let nearer = 2.0 * (f64::from(c.memory.port_latency) - f64::from(c.memory.rop_latency));
            let wait = self.latency(&traffic.fills[side]) - nearer + f64::from(latency) + moved;
            let turn = again * (1.0 - libm::pow(1.0 - filled, at_once)) * wait / at_once;
            let in_flight = again * filled * (bytes * part / REQUEST_BYTES as f64).ceil() * wait / f64::from(requests);
            least[side] += turn.max(in_flight);
        };
        let held = color.iter().map(places).sum::<f64>();
        for attachment in color {
            let knobs = (self.color_codec(), c.color.fifo, c.color.misses, c.color.latency);
            rop("color port", attachment, 0, f64::from(c.color.cache_blocks) / held, knobs);
        }
        if let Some(depth) = depth {
            let knobs = (self.depth_codec(), c.depth.fifo, c.depth.misses, c.depth.latency);
            rop("depth port", depth, 1, f64::from(c.depth.cache_blocks) / places(depth), knobs);
        }
        (least, left[0].max(left[1]))
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

/// Cycles per triangle of a unit that takes `per_cycle` triangles per cycle. With an interval of more than one cycle, it takes one per interval.
fn apart(per_cycle: u32, interval: u32) -> f64 {
    if interval > 1 { f64::from(interval) } else { 1.0 / f64::from(per_cycle) }
}

#[cfg(test)]
mod tests {
    use super::apart;

    #[test]
    fn an_interval_lets_one_triangle_through_whatever_a_cycle_takes() {
        assert_eq!([apart(1, 1), apart(2, 1), apart(1, 4), apart(2, 4)], [1.0, 0.5, 4.0, 4.0]);
    }
}
