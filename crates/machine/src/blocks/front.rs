//! From the command processor to triangles that are set up.

use super::{Both, Builder, CONTROL, Ends};
use sim::{In, Link, Out, StallProbe};
use unit::assembly::{Assembly, AssemblyPorts, Mode};
use unit::bin::{Bin, BinPorts};
use unit::clip::Clip;
use unit::command::{Command, CommandConfig, CommandPorts};
use unit::compute::{Compute, ComputePorts};
use unit::deal::{Deal, most_groups};
use unit::distribute::Distribute;
use unit::fetch::{Fetch, FetchInput, FetchPorts, Reuse, VertexDeal};
use unit::gather::Gather;
use unit::index_runs::IndexRuns;
use unit::network::{Receiver, Sender};
use unit::route::{Retained, Route, RoutePorts};
use unit::setup::Setup;
use unit::tile_fetch::{TileFetch, TileFetchPorts};
use unit::token::{Ack, Piece, Run, TriangleToken, WarpToken};

impl Builder<'_> {
    /// The command processor and what it commands directly: compute dispatch, resolve, scan-out. Gives the stream of segments.
    pub fn command(&mut self) -> In<Piece> {
        let (config, id) = (self.config, self.id.clone());
        let (command, compute) = (id.command[0], id.compute[0]);
        let scanout = id.scanout[0];
        let (to_fetch, pieces) =
            self.wiring.channel("pieces", 0, CONTROL, command, id.deal.first().copied().unwrap_or(id.fetch[0]));
        let (to_compute, compute_input) = self.wiring.channel("workgroups", 0, CONTROL, command, compute);
        let (computed, from_compute) = self.wiring.channel("workgroups_done", 0, CONTROL, compute, command);
        let (to_resolve, resolve_input) = self.join("resolves", CONTROL, id.resolve.iter().map(|&resolve| (command, resolve)));
        let (resolved, from_resolve) = self.join("resolved", CONTROL, id.resolve.iter().map(|&resolve| (resolve, command)));
        let (mut to_scanout, scanout_input) = self.join("shown", CONTROL, [(command, scanout)]);
        let (scanned, mut from_scanout) = self.join("scanned", CONTROL, [(scanout, command)]);
        self.open.scanout = (scanout_input, scanned);
        let acking: Vec<_> = id.color.iter().chain(&id.depth).copied().collect();
        let (mut acks, from_acks) = self.join("acks", CONTROL, acking.into_iter().map(|unit| (unit, command)));
        self.open.depth_acks = acks.split_off(self.pipelines());
        self.open.color_acks = acks;

        let (to_compose, compose_input) = self.join("composes", CONTROL, id.compose.iter().map(|&compose| (command, compose)));
        let (composed, from_compose) = self.join("composed", CONTROL, id.compose.iter().map(|&compose| (compose, command)));
        self.open.compose = (compose_input, composed);
        let distribution: &[_] = if config.command.drain { &id.distribute } else { &[] };
        let (turns, heeded) = self.join("turns", CONTROL, distribution.iter().map(|&distribute| (command, distribute)));
        self.open.turns = heeded;
        let (binned, from_bin) = self.join("segments_binned", CONTROL, id.bin.iter().map(|&bin| (bin, command)));
        self.open.binned = binned;
        let memory = self.port("command", 0, command);
        let probe = self.card_probe();
        self.made.command.push(Command::new(
            CommandConfig { overlap: config.overlaps(), ..config.command.clone() },
            (config.card.pipelines, config.segments()),
            (config.color.fast_clear, config.color.clears_per_cycle * config.card.pipelines),
            &config.scanout,
            CommandPorts {
                fetch: to_fetch,
                compute: to_compute,
                computed: from_compute,
                resolve: to_resolve.all(),
                resolved: from_resolve.all(),
                scanout: to_scanout.take(0),
                scanned: from_scanout.take(0),
                compose: to_compose.all(),
                composed: from_compose.all(),
                acks: from_acks.all(),
                binned: from_bin.all(),
                next_draw: turns.all(),
                memory,
                probe,
            },
        ));
        self.compute(compute_input, computed);
        self.open.resolve = (resolve_input, resolved);
        pieces
    }

    /// Compute dispatch, with its ways to all cores and back.
    fn compute(&mut self, input: In<Piece>, ack: Out<Ack>) {
        let (config, id) = (self.config, self.id.clone());
        let compute = id.compute[0];
        let groups = Link::items(config.compute.queue, 1, config.compute.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let (outputs, group_input): Both<WarpToken> =
            self.join("compute_warps", groups, id.core.iter().map(|&core| (compute, core)));
        let (group_output, finished): Both<WarpToken> =
            self.join("computed", done, id.core.iter().map(|&core| (core, compute)));
        self.open.compute = (group_input, group_output);
        let per_pipeline = config.core.per_pipeline as usize;
        let cores = outputs.all().into_iter().enumerate().map(|(n, output)| (n / per_pipeline, output)).collect();
        let slots = config.command.workgroup_runs as usize;
        let ports = ComputePorts { input, cores, finished: finished.all(), ack };
        let unit = Compute::new(config.compute.clone(), config.core.warp_width, config.core.warps, slots, ports);
        self.made.compute.push(unit);
    }

    /// Vertex fetch, shading and assembly: a front for each input. The primitives of front `f` go to the clippers whose number
    /// modulo the number of fronts is `f`.
    pub fn vertices(&mut self, inputs: Vec<FetchInput>, mode: Mode) -> Ends<In<Run>> {
        let (config, id) = (self.config, self.id.clone());
        let fronts = inputs.len();
        let unified = config.core.unified;
        let shading = if unified { &id.core } else { &id.vertex_core };
        let per_front = shading.len() / fronts;
        let to_core = Link::items(config.fetch.queue, 1, config.fetch.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let fronts_cores: Vec<_> = shading.iter().enumerate().map(|(n, &core)| (n / per_front, core)).collect();
        let (mut to_shading, vertex_input): Both<WarpToken> =
            self.join("vertex_warps", to_core, fronts_cores.iter().map(|&(front, core)| (id.fetch[front], core)));
        let (vertex_output, mut from_shading): Both<WarpToken> =
            self.join("vertices_shaded", done, fronts_cores.iter().map(|&(front, core)| (core, id.assembly[front])));
        self.open.vertex = (vertex_input, vertex_output);
        let announced = Link::items(config.fetch.announced, 2, 1);
        let batches = Link::items(config.fetch.batches.max(2) + 2, 2, 1);
        let (mut to_assembly, mut from_fetch) = self.chain("vertex_batches", announced, &id.fetch, &id.assembly);
        let (mut retired, mut from_assembly) = self.chain("vertices_retired", batches, &id.assembly, &id.fetch);
        let passes = config.fetch.reuse_until == Reuse::Assembled;
        let (passing, heeding): (&[_], &[_]) = if passes { (&id.assembly, &id.fetch) } else { (&[], &[]) };
        let (mut passed, mut heeded) = self.chain("vertices_passed", CONTROL, passing, heeding);
        let beginning: &[_] = if config.fetch.deal == VertexDeal::AfterFragments { &id.dispatch } else { &[] };
        let (begun, fragments) =
            self.join("fragments_begun", CONTROL, beginning.iter().map(|&dispatch| (dispatch, id.fetch[0])));
        self.open.begun = begun;
        let mut fragments = fragments.all();
        // What is assembled in a cycle may be parts of several batches of vertices.
        let runs = config.assembly.primitives_per_cycle.div_ceil(2);
        let primitives = Link::items(config.assembly.queue, runs, config.assembly.latency);
        let (mut to_clip, clip_input) =
            self.join("primitives", primitives, id.clip.iter().enumerate().map(|(n, &clip)| (id.assembly[n % fronts], clip)));

        // A cluster of warps is a pipeline's; vertex cores have one of their own.
        let per_pipeline = config.core.per_pipeline as usize;
        let cluster = |n: usize| if unified { n / per_pipeline } else { config.card.pipelines as usize };
        // Those that route have read the indices.
        let indices = id.route.len();
        for (front, input) in inputs.into_iter().enumerate() {
            let cores = front * per_front..(front + 1) * per_front;
            let ports = FetchPorts {
                input,
                cores: cores.clone().map(|n| (cluster(n), to_shading.take(n))).collect(),
                batches: to_assembly.take(front),
                retired: from_assembly.take(front),
                passed: heeded.take_if_any(front),
                fragments: std::mem::take(&mut fragments),
                index: self.port("index", indices + front, id.fetch[front]),
                vertex: self.port("vertex", front, id.fetch[front]),
                probe: self.front_probe(front),
            };
            self.made.fetch.push(Fetch::new(config.fetch.clone(), config.core.warp_width, ports));
            let ports = AssemblyPorts {
                batches: from_fetch.take(front),
                shaded: from_shading.take_all(cores),
                retired: retired.take(front),
                passed: passed.take_if_any(front),
                geometry: (front..id.clip.len()).step_by(fronts).map(|n| to_clip.take(n)).collect(),
            };
            self.made.assembly.push(Assembly::new(config.assembly.clone(), mode, ports));
        }
        clip_input
    }

    /// Clipping and culling, to the distribution units.
    fn clip(&mut self, mut inputs: Ends<In<Run>>) -> Ends<In<Run>> {
        let (config, id) = (self.config, self.id.clone());
        // A run, and the mark behind the one before.
        let triangles = Link::items(config.clip.queue, 2, config.clip.latency);
        let (mut outputs, clipped) = self.chain("triangles", triangles, &id.clip, &id.distribute);
        // A unit that routes primitives to several pipelines knows how they end, and counts each once.
        let counts = id.route.is_empty();
        for n in 0..id.clip.len() {
            self.made.clip.push(Clip::new(config.clip.clone(), counts, inputs.take(n), outputs.take(n)));
        }
        clipped
    }

    /// Clipping, culling, and distribution of triangles to the rasterisers that own what they touch: for each of these its ways
    /// from all distribution units.
    pub fn clip_and_distribute(&mut self, inputs: Ends<In<Run>>) -> Vec<Receiver<TriangleToken>> {
        let (config, id) = (self.config, self.id.clone());
        let to = if id.bin.is_empty() { &id.setup } else { &id.bin };
        let mut clipped = self.clip(inputs);
        let (senders, receivers) = self.sort_network(&id.distribute, to);
        let mut turns = std::mem::take(&mut self.open.turns);
        for (n, network) in senders.into_iter().enumerate() {
            let unit = Distribute::new(config.distribute.clone(), n, clipped.take(n), network);
            self.made.distribute.push(match turns.take_if_any(n) {
                Some(turns) => unit.in_turn(turns),
                None => unit,
            });
        }
        receivers
    }

    /// Clipping and culling in pipelines whose geometry is their own, each with a way to its own rasteriser.
    pub fn clip_in_place(&mut self, inputs: Ends<In<Run>>) -> Vec<Receiver<TriangleToken>> {
        let (config, id) = (self.config, self.id.clone());
        let mut clipped = self.clip(inputs);
        let link = Link::items(config.setup.queue, config.distribute.triangles_per_cycle, 1);
        let (mut outputs, inputs) = self.chain("clipped", link, &id.distribute, &id.setup);
        for n in 0..id.distribute.len() {
            let network = Sender::direct(vec![outputs.take(n)]);
            self.made.distribute.push(Distribute::new(config.distribute.clone(), 0, clipped.take(n), network));
        }
        inputs.all().into_iter().map(|input| Receiver::direct(vec![input])).collect()
    }

    /// Routing of primitives by their bounds, to the fronts of the pipelines that own what they touch.
    pub fn route(&mut self, mut inputs: Ends<In<Run>>) -> Vec<FetchInput> {
        let (config, id) = (self.config, self.id.clone());
        let (senders, receivers) = self.sort_network(&id.route, &id.gather);
        for (n, network) in senders.into_iter().enumerate() {
            let input = inputs.take(n);
            let index = self.port("index", n, id.route[n]);
            let position = self.port("position", n, id.route[n]);
            let ports = RoutePorts { input, network, index, position };
            let runs = IndexRuns::new(config.fetch.index_lines, config.fetch.runs);
            self.made.route.push(Route::new(config.route.clone(), config.distribute.overlap, runs, n as u8, ports));
        }
        let link = Link::items(config.assembly.queue, 2, 1);
        let (mut outputs, gathered) = self.chain("gathered", link, &id.gather, &id.fetch);
        let rate = config.assembly.primitives_per_cycle;
        for (n, input) in receivers.into_iter().enumerate() {
            let probe = self.probe(n, true, true);
            self.made.gather.push(Gather::new(rate, config.order.keep, probe, input, outputs.take(n)));
        }
        let brought = config.route.mode == Retained::Immediate;
        let input = |input| if brought { FetchInput::Brought(input) } else { FetchInput::Routed(input) };
        gathered.all().into_iter().map(input).collect()
    }

    /// Dealing of batches to units of all pipelines.
    pub fn deal(&mut self, input: In<Piece>) -> Ends<In<Run>> {
        let (config, id) = (self.config, self.id.clone());
        let deal = id.deal[0];
        let link = Link::items(config.assembly.queue, 1, 1);
        let to = if id.route.is_empty() { &id.fetch } else { &id.route };
        let (outputs, inputs) = self.join("batches", link, to.iter().map(|&to| (deal, to)));
        // Where no later unit sends fences to all pipelines, this one does.
        let everyone = !id.compose.is_empty();
        let most = most_groups(config.network.receive_queue, config.dispatch.reorder, config.core.warp_width);
        let most = id.route.is_empty().then_some(most);
        self.made.deal.push(Deal::new(&config.assembly, config.order.keep, everyone, most, input, outputs.all()));
        inputs
    }

    /// Binning of all triangles into the lists of tiles, which the pipelines read one after the other.
    pub fn bin(&mut self, input: Receiver<TriangleToken>) -> Vec<Receiver<TriangleToken>> {
        let (config, id) = (self.config, self.id.clone());
        let bin = id.bin[0];
        let tiles = Link::items(4, 1, 1);
        let (to_fetch, mut fetch_input) = self.join("tiles", tiles, id.tile_fetch.iter().map(|&fetch| (bin, fetch)));
        let (mut read, from_fetch) = self.join("tiles_read", tiles, id.tile_fetch.iter().map(|&fetch| (fetch, bin)));
        let link = Link::items(config.setup.queue, config.setup.triangles_per_cycle, 1);
        let (mut outputs, inputs) = self.chain("binned", link, &id.tile_fetch, &id.setup);
        let memory = self.port("bin", 0, bin);
        let binned = self.open.binned.take(0);
        let ports = BinPorts { input, tiles: to_fetch.all(), read: from_fetch.all(), binned, memory };
        self.made.bin.push(Bin::new(config.bin.clone(), config.order.keep, config.segments(), ports));
        for n in 0..id.tile_fetch.len() {
            let (input, read, output) = (fetch_input.take(n), read.take(n), outputs.take(n));
            let memory = self.port("tile_fetch", n, id.tile_fetch[n]);
            let probe = self.probe(n, true, true);
            let ports = TileFetchPorts { input, read, output, memory, probe };
            self.made.tile_fetch.push(TileFetch::new(config.bin.clone(), ports));
        }
        inputs.all().into_iter().map(|input| Receiver::direct(vec![input])).collect()
    }

    /// Triangle setup in each pipeline. With `marks` the order is restored behind it.
    pub fn setup(&mut self, inputs: Vec<Receiver<TriangleToken>>, marks: bool) -> Ends<In<TriangleToken>> {
        let (config, id) = (self.config, self.id.clone());
        let (setup, keep) = (&config.setup, config.order.keep);
        let link = Link::items(setup.queue, setup.triangles_per_cycle, setup.latency);
        let (mut outputs, set_up) = self.chain("set_up", link, &id.setup, &id.traverse);
        for (n, input) in inputs.into_iter().enumerate() {
            let probe = if self.behind_network == id.setup { self.probe(n, true, true) } else { StallProbe::default() };
            self.made.setup.push(Setup::new(setup.clone(), input, marks, keep, probe, outputs.take(n)));
        }
        set_up
    }
}
