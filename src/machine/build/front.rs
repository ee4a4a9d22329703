//! From the command processor to triangles that are set up.

use super::{Builder, CONTROL, Ends};
use crate::sim::{In, Link, Out};
use crate::unit::assembly::{Assembly, AssemblyPorts};
use crate::unit::clip::Clip;
use crate::unit::command::{Command, CommandPorts};
use crate::unit::compute::{Compute, ComputePorts};
use crate::unit::distribute::Distribute;
use crate::unit::fetch::{Fetch, FetchPorts};
use crate::unit::setup::Setup;
use crate::unit::token::{Ack, Piece, Run, TriangleToken, WarpToken, bytes};

impl Builder<'_> {
    /// The command processor and what it commands directly: compute dispatch, resolve, scan-out. Gives the stream of segments to
    /// the unit `to`.
    pub fn command(&mut self) -> In<Piece> {
        let config = self.config;
        let command = self.id.command;
        let (to_fetch, pieces) = self.wiring.channel("pieces", 0, CONTROL, command, self.id.fetch[0]);
        let (to_compute, compute_input) = self.wiring.channel("workgroups", 0, CONTROL, command, self.id.compute);
        let (computed, from_compute) = self.wiring.channel("workgroups_done", 0, CONTROL, self.id.compute, command);
        let (to_resolve, resolve_input) = self.wiring.channel("resolves", 0, CONTROL, command, self.id.resolve);
        let (resolved, from_resolve) = self.wiring.channel("resolved", 0, CONTROL, self.id.resolve, command);
        let (to_scanout, scanout_input) = self.wiring.channel("shown", 0, CONTROL, command, self.id.scanout);
        let (scanned, from_scanout) = self.wiring.channel("scanned", 0, CONTROL, self.id.scanout, command);
        let acking: Vec<_> = self.id.color.iter().chain(&self.id.depth).copied().collect();
        let (mut acks, from_acks) = self.join("acks", CONTROL, acking.into_iter().map(|unit| (unit, command)));
        self.made.depth_acks = acks.split_off(self.pipelines());
        self.made.color_acks = acks;

        let memory = self.port("command", 0, command);
        self.made.command = Some(Command::new(
            config.command.clone(),
            config.card.pipelines,
            (config.color.fast_clear, config.color.clears_per_cycle * config.card.pipelines),
            config.scanout.enabled,
            CommandPorts {
                fetch: to_fetch,
                compute: to_compute,
                computed: from_compute,
                resolve: to_resolve,
                resolved: from_resolve,
                scanout: to_scanout,
                scanned: from_scanout,
                acks: from_acks,
                memory,
            },
        ));
        self.compute(compute_input, computed);
        self.made.resolve_ends = Some((resolve_input, resolved));
        self.made.scanout_ends = Some((scanout_input, scanned));
        pieces
    }

    /// Compute dispatch, with its ways to all cores and back.
    fn compute(&mut self, input: In<Piece>, ack: Out<Ack>) {
        let config = self.config;
        let (compute, cores) = (self.id.compute, self.id.core.clone());
        let groups = Link::items(config.compute.queue, 1, config.compute.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let (outputs, group_input): Ends<WarpToken> =
            self.join("compute_warps", groups, cores.iter().map(|&core| (compute, core)));
        let (group_output, finished): Ends<WarpToken> = self.join("computed", done, cores.iter().map(|&core| (core, compute)));
        self.made.compute_ends = group_input.into_iter().zip(group_output).collect();
        let per_pipeline = config.core.per_pipeline as usize;
        let cores = outputs.into_iter().enumerate().map(|(n, output)| (n / per_pipeline, output)).collect();
        let slots = config.command.workgroup_runs as usize;
        let ports = ComputePorts { input, cores, finished, ack };
        let unit = Compute::new(config.compute.clone(), config.core.warp_width, config.core.warps, slots, ports);
        self.made.compute = Some(unit);
    }

    /// Vertex fetch, shading and assembly: a front for each input. The primitives of front `f` go to the clippers whose number
    /// modulo the number of fronts is `f`.
    pub fn vertices(&mut self, inputs: Vec<In<Piece>>) -> Vec<In<Run>> {
        let config = self.config;
        let fronts = inputs.len();
        let unified = config.core.unified;
        let shading = if unified { self.id.core.clone() } else { self.id.vertex_core.clone() };
        let per_front = shading.len() / fronts;
        let to_core = Link::items(config.fetch.queue, 1, config.fetch.latency);
        let done = Link::items(config.core.output_queue, 1, 1);
        let (fetch, assembly, clip) = (self.id.fetch.clone(), self.id.assembly.clone(), self.id.clip.clone());
        let fronts_cores: Vec<_> = shading.iter().enumerate().map(|(n, &core)| (n / per_front, core)).collect();
        let (to_shading, vertex_input): Ends<WarpToken> =
            self.join("vertex_warps", to_core, fronts_cores.iter().map(|&(front, core)| (fetch[front], core)));
        let (vertex_output, from_shading): Ends<WarpToken> =
            self.join("vertices_shaded", done, fronts_cores.iter().map(|&(front, core)| (core, assembly[front])));
        self.made.vertex_ends = vertex_input.into_iter().zip(vertex_output).map(Some).collect();
        let batches = Link::items(config.fetch.batches.max(2) + 2, 2, 1);
        let (to_assembly, from_fetch) = self.chain("vertex_batches", batches, &fetch, &assembly);
        let (retired, from_assembly) = self.chain("vertices_retired", batches, &assembly, &fetch);
        let primitives = Link::items(config.assembly.queue, 1, config.assembly.latency);
        let (to_clip, clip_input) =
            self.join("primitives", primitives, clip.iter().enumerate().map(|(n, &clip)| (assembly[n % fronts], clip)));

        // A cluster of warps is a pipeline's; vertex cores have one of their own.
        let per_pipeline = config.core.per_pipeline as usize;
        let cluster = |n: usize| if unified { n / per_pipeline } else { config.card.pipelines as usize };
        let mut to_shading = to_shading.into_iter().enumerate().map(|(n, output)| (cluster(n), output));
        let mut from_shading = from_shading.into_iter();
        let mut geometry: Vec<Vec<_>> = (0..fronts).map(|_| Vec::new()).collect();
        for (n, output) in to_clip.into_iter().enumerate() {
            geometry[n % fronts].push(output);
        }
        let ends = inputs.into_iter().zip(to_assembly).zip(from_assembly).zip(from_fetch).zip(retired).zip(geometry);
        for (front, (((((input, batches), from_assembly), from_fetch), retired), geometry)) in ends.enumerate() {
            let ports = FetchPorts {
                input,
                cores: to_shading.by_ref().take(per_front).collect(),
                batches,
                retired: from_assembly,
                index: self.port("index", front, fetch[front]),
                vertex: self.port("vertex", front, fetch[front]),
            };
            self.made.fetch.push(Fetch::new(config.fetch.clone(), config.core.warp_width, ports));
            let shaded = from_shading.by_ref().take(per_front).collect();
            let ports = AssemblyPorts { batches: from_fetch, shaded, retired, geometry };
            self.made.assembly.push(Assembly::new(config.assembly.clone(), ports));
        }
        clip_input
    }

    /// Clipping and culling, to the units `to`.
    fn clip<T: crate::sim::Token>(&mut self, inputs: Vec<In<Run>>, outputs: Vec<Out<Run>>, rest: Vec<In<T>>) -> Vec<In<T>> {
        let units = inputs.into_iter().zip(outputs).map(|(input, output)| Clip::new(self.config.clip.clone(), input, output));
        self.made.clip = units.collect();
        rest
    }

    /// Clipping, culling, and distribution of triangles to the rasterisers that own what they touch: for each of these its ways
    /// from all distribution units.
    pub fn clip_and_distribute(&mut self, inputs: Vec<In<Run>>) -> Vec<Vec<In<TriangleToken>>> {
        let config = self.config;
        let pipelines = self.pipelines();
        let (clip, distribute, setup) = (self.id.clip.clone(), self.id.distribute.clone(), self.id.setup.clone());
        let triangles = Link::items(config.clip.queue, 1, config.clip.latency);
        let (outputs, clipped) = self.chain("triangles", triangles, &clip, &distribute);
        let clipped = self.clip(inputs, outputs, clipped);
        let sorted =
            Link::bytes(config.distribute.queue, config.distribute.link_width * bytes::TRIANGLE, config.distribute.latency);
        let pairs = distribute.iter().flat_map(|&from| setup.iter().map(move |&to| (from, to)));
        let (to_setup, setup_input) = self.join("sorted", sorted, pairs);
        let mut to_setup = to_setup.into_iter();
        for input in clipped {
            let outputs = to_setup.by_ref().take(pipelines).collect();
            self.made.distribute.push(Distribute::new(config.distribute.clone(), input, outputs));
        }
        let mut of_setup: Vec<Vec<_>> = (0..pipelines).map(|_| Vec::new()).collect();
        for (index, input) in setup_input.into_iter().enumerate() {
            of_setup[index % pipelines].push(input);
        }
        of_setup
    }

    /// Triangle setup in each pipeline.
    pub fn setup(&mut self, inputs: Vec<Vec<In<TriangleToken>>>) -> Vec<In<TriangleToken>> {
        let setup = &self.config.setup;
        let link = Link::items(setup.queue, setup.triangles_per_cycle, setup.latency);
        let (from, to) = (self.id.setup.clone(), self.id.traverse.clone());
        let (outputs, set_up) = self.chain("set_up", link, &from, &to);
        let units = inputs.into_iter().zip(outputs).map(|(inputs, output)| Setup::new(setup.clone(), inputs, output));
        self.made.setup = units.collect();
        set_up
    }
}
