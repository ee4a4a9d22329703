//! The sort-middle machine: primitives are transformed and clipped by any geometry unit, then sorted, as screen-space triangles, to
//! the pipelines that own the pixels. Its units in data-flow order are its block diagram.

use super::config::Config;
use crate::mem::{Crossbar, Dram, Ideal, L2Slice, MemoryPlan, MemoryPort, ReturnPath};
use crate::sim::{In, Link, One, Out, UnitId, Wiring};
use crate::unit::assembly::{Assembly, AssemblyPorts};
use crate::unit::card::Card;
use crate::unit::clip::Clip;
use crate::unit::color::{Color, ColorPorts};
use crate::unit::command::{Command, CommandPorts};
use crate::unit::compute::{Compute, ComputePorts};
use crate::unit::core::{Core, CoreConfig, CorePorts};
use crate::unit::depth::{Depth, DepthPorts};
use crate::unit::dispatch::{Dispatch, DispatchPorts};
use crate::unit::distribute::Distribute;
use crate::unit::fetch::{Fetch, FetchPorts};
use crate::unit::interpolate::Interpolate;
use crate::unit::resolve::Resolve;
use crate::unit::scanout::Scanout;
use crate::unit::setup::Setup;
use crate::unit::texture::Texture;
use crate::unit::token::{WarpToken, bytes};
use crate::unit::traverse::Traverse;

crate::circuit! {
    /// A sort-middle machine with G geometry units and R pipelines.
    pub struct SortMiddle for Card {
        /// Reads events, hands out draws, keeps passes apart.
        command: One<Command>,
        /// Reads indices, finds vertices to be shaded, fetches attributes.
        fetch: One<Fetch>,
        /// Vertex cores, where shading is not unified.
        vertex_core: Vec<Core>,
        /// Their texture units.
        vertex_texture: Vec<Texture>,
        /// Makes primitives of shaded vertices, hands them to geometry units in turn.
        assembly: One<Assembly>,
        /// G: clips and culls.
        clip: Vec<Clip>,
        /// G: the sort. Sends each triangle to the pipelines that own what it touches.
        distribute: Vec<Distribute>,
        /// R: restores API order, sets triangles up.
        setup: Vec<Setup>,
        /// R: finds blocks and quads, culls by hierarchical Z.
        traverse: Vec<Traverse>,
        /// R: early and late depth and stencil tests.
        depth: Vec<Depth>,
        /// R: interpolates attributes.
        interpolate: Vec<Interpolate>,
        /// R: packs quads into warps, restores their order after shading.
        dispatch: Vec<Dispatch>,
        /// Makes warps of workgroups.
        compute: One<Compute>,
        /// Shader cores of all pipelines.
        core: Vec<Core>,
        /// A texture unit for each core.
        texture: Vec<Texture>,
        /// R: blends into colour buffers.
        color: Vec<Color>,
        /// Turns samples into pixels.
        resolve: One<Resolve>,
        /// Shows frames.
        scanout: One<Scanout>,
        /// Memory: from the units to the slices of the second-level cache,
        crossbar: Option<Crossbar>,
        /// the slices,
        l2: Vec<L2Slice>,
        /// the DRAM channels behind them,
        dram: Vec<Dram>,
        /// and the way back to the units;
        return_path: Option<ReturnPath>,
        /// or an ideal memory instead of all these.
        ideal: Option<Ideal>,
    }
}

/// Both ends of channels, as they are handed out.
type Ends<T> = (Vec<Out<T>>, Vec<In<T>>);

/// Joins units pairwise.
fn joins<T: crate::sim::Token>(
    wiring: &mut Wiring,
    name: &'static str,
    link: Link,
    pairs: impl IntoIterator<Item = (UnitId, UnitId)>,
) -> Ends<T> {
    pairs.into_iter().enumerate().map(|(index, (from, to))| wiring.channel(name, index, link, from, to)).unzip()
}

/// A link for groups of quads: as wide as so many quads.
fn quads(queue: u32, quads: u32, latency: u32) -> Link {
    Link::bytes(queue, quads * bytes::QUAD, latency)
}

/// Names of memory clients, and the number of ports of each.
pub type Clients = Vec<(&'static str, usize)>;

/// The machine of a configuration, and the names of its memory clients.
///
/// # Errors
/// If the memory's values do not make one.
pub fn build(config: &Config) -> Result<(SortMiddle, Clients), String> {
    let pipelines = config.card.pipelines as usize;
    let geometry = config.card.geometry_units as usize;
    let per_pipeline = config.core.per_pipeline as usize;
    let cores = pipelines * per_pipeline;
    let unified = config.core.unified;
    let vertex_cores = if unified { 0 } else { config.core.vertex_cores as usize };
    let width = config.core.warp_width;

    // Units, in the order of the machine's fields.
    let mut w = Wiring::new();
    let command = w.unit("command", 0);
    let fetch = w.unit("fetch", 0);
    let vertex_core = w.bank("vertex_core", vertex_cores);
    let vertex_texture = w.bank("vertex_texture", vertex_cores);
    let assembly = w.unit("assembly", 0);
    let clip = w.bank("clip", geometry);
    let distribute = w.bank("distribute", geometry);
    let setup = w.bank("setup", pipelines);
    let traverse = w.bank("traverse", pipelines);
    let depth = w.bank("depth", pipelines);
    let interpolate = w.bank("interpolate", pipelines);
    let dispatch = w.bank("dispatch", pipelines);
    let compute = w.unit("compute", 0);
    let core = w.bank("core", cores);
    let texture = w.bank("texture", cores);
    let color = w.bank("color", pipelines);
    let resolve = w.unit("resolve", 0);
    let scanout = w.unit("scanout", 0);
    let mut memory = MemoryPlan::declare(config.memory()?, &mut w)?;
    let knobs = &config.memory;
    let mut port = |w: &mut Wiring, name: &'static str, index: usize, unit: UnitId| -> MemoryPort {
        memory.client(w, name, index, unit, knobs.port_width, knobs.port_latency, knobs.port_queue)
    };

    // Control: a few tokens a draw.
    let control = Link::items(16, 4, 1);
    let zip = |a: &[UnitId], b: &[UnitId]| a.iter().copied().zip(b.iter().copied()).collect::<Vec<_>>();
    let (to_fetch, from_command) = w.channel("pieces", 0, control, command, fetch);
    let (to_compute, compute_input) = w.channel("workgroups", 0, control, command, compute);
    let (computed, from_compute) = w.channel("workgroups_done", 0, control, compute, command);
    let (to_resolve, resolve_input) = w.channel("resolves", 0, control, command, resolve);
    let (resolved, from_resolve) = w.channel("resolved", 0, control, resolve, command);
    let (to_scanout, scanout_input) = w.channel("shown", 0, control, command, scanout);
    let (scanned, from_scanout) = w.channel("scanned", 0, control, scanout, command);
    let acking: Vec<UnitId> = color.iter().chain(&depth).copied().collect();
    let (acks, from_acks): Ends<_> = joins(&mut w, "acks", control, acking.iter().map(|&unit| (unit, command)));
    let (end, from_end): Ends<_> = joins(&mut w, "pass_ends", control, zip(&color, &depth));

    // Vertices.
    let to_core = Link::items(config.fetch.queue, 1, config.fetch.latency);
    let done = Link::items(config.core.output_queue, 1, 1);
    let shading = if unified { &core } else { &vertex_core };
    let (to_shading, vertex_input): Ends<WarpToken> =
        joins(&mut w, "vertex_warps", to_core, shading.iter().map(|&core| (fetch, core)));
    let (vertex_output, from_shading): Ends<WarpToken> =
        joins(&mut w, "vertices_shaded", done, shading.iter().map(|&core| (core, assembly)));
    let batches = Link::items(config.fetch.batches.max(2) + 2, 2, 1);
    let (to_assembly, from_fetch) = w.channel("vertex_batches", 0, batches, fetch, assembly);
    let (retired, from_assembly) = w.channel("vertices_retired", 0, batches, assembly, fetch);

    // Primitives and triangles.
    let primitives = Link::items(config.assembly.queue, 1, config.assembly.latency);
    let triangles = Link::items(config.clip.queue, 1, config.clip.latency);
    let sorted =
        Link::bytes(config.distribute.queue, config.distribute.link_width * bytes::TRIANGLE, config.distribute.latency);
    let set_up = Link::items(config.setup.queue, config.setup.triangles_per_cycle, config.setup.latency);
    let (to_clip, clip_input): Ends<_> = joins(&mut w, "primitives", primitives, clip.iter().map(|&clip| (assembly, clip)));
    let (to_distribute, distribute_input): Ends<_> = joins(&mut w, "triangles", triangles, zip(&clip, &distribute));
    let sort = distribute.iter().flat_map(|&from| setup.iter().map(move |&to| (from, to)));
    let (to_setup, setup_input): Ends<_> = joins(&mut w, "sorted", sorted, sort);
    let (to_traverse, traverse_input): Ends<_> = joins(&mut w, "set_up", set_up, zip(&setup, &traverse));

    // Quads.
    let (t, d, i, p) = (&config.traverse, &config.depth, &config.interpolate, &config.dispatch);
    let updates = Link::items(t.hierarchical_queue, 1, t.hierarchical_latency);
    let (to_depth, depth_early): Ends<_> =
        joins(&mut w, "rasterized", quads(t.queue, t.quads_per_cycle, t.latency), zip(&traverse, &depth));
    let (depth_updates, traverse_updates): Ends<_> = joins(&mut w, "depth_bounds", updates, zip(&depth, &traverse));
    let (to_interpolate, interpolate_input): Ends<_> =
        joins(&mut w, "tested_early", quads(d.output_queue, d.quads_per_cycle, d.output_latency), zip(&depth, &interpolate));
    let (to_dispatch, dispatch_input): Ends<_> =
        joins(&mut w, "interpolated", quads(i.queue, i.quads_per_cycle, i.latency), zip(&interpolate, &dispatch));
    let rop = quads(p.output_queue, p.output_quads, p.output_latency);
    let (to_late, depth_late): Ends<_> = joins(&mut w, "to_late_test", rop, zip(&dispatch, &depth));
    let (to_color, color_shaded): Ends<_> = joins(&mut w, "shaded", rop, zip(&dispatch, &color));
    let (late, color_tested): Ends<_> =
        joins(&mut w, "tested_late", quads(d.output_queue, d.quads_per_cycle, d.output_latency), zip(&depth, &color));

    // Warps.
    let of_core: Vec<(UnitId, UnitId)> = core.iter().enumerate().map(|(n, &core)| (dispatch[n / per_pipeline], core)).collect();
    let back: Vec<(UnitId, UnitId)> = of_core.iter().map(|&(dispatch, core)| (core, dispatch)).collect();
    let warps = Link::items(p.queue, 1, p.latency);
    let groups = Link::items(config.compute.queue, 1, config.compute.latency);
    let (to_cores, fragment_input): Ends<WarpToken> = joins(&mut w, "fragment_warps", warps, of_core);
    let (fragment_output, from_cores): Ends<WarpToken> = joins(&mut w, "fragments_shaded", done, back);
    let (compute_cores, group_input): Ends<WarpToken> =
        joins(&mut w, "compute_warps", groups, core.iter().map(|&core| (compute, core)));
    let (group_output, compute_finished): Ends<WarpToken> =
        joins(&mut w, "computed", done, core.iter().map(|&core| (core, compute)));
    let asks = Link::items(config.texture.queue, 1, 1);
    let answers = Link::items(config.core.warps.max(2), 1, 1);
    let (ask, texture_input): Ends<WarpToken> = joins(&mut w, "texture_requests", asks, zip(&core, &texture));
    let (texture_output, answer): Ends<WarpToken> = joins(&mut w, "texture_answers", answers, zip(&texture, &core));
    let (vertex_ask, vertex_texture_input): Ends<WarpToken> =
        joins(&mut w, "vertex_texture_requests", asks, zip(&vertex_core, &vertex_texture));
    let (vertex_texture_output, vertex_answer): Ends<WarpToken> =
        joins(&mut w, "vertex_texture_answers", answers, zip(&vertex_texture, &vertex_core));

    // Units. A cluster of warps is a pipeline's; vertex cores have one of their own.
    let command_unit = Command::new(
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
            memory: port(&mut w, "command", 0, command),
        },
    );
    let cluster = |n: usize| if unified { n / per_pipeline } else { pipelines };
    let fetch_ports = FetchPorts {
        input: from_command,
        cores: to_shading.into_iter().enumerate().map(|(n, output)| (cluster(n), output)).collect(),
        batches: to_assembly,
        retired: from_assembly,
        index: port(&mut w, "index", 0, fetch),
        vertex: port(&mut w, "vertex", 0, fetch),
    };
    let fetch_unit = Fetch::new(config.fetch.clone(), width, fetch_ports);
    let assembly_ports = AssemblyPorts { batches: from_fetch, shaded: from_shading, retired, geometry: to_clip };
    let assembly_unit = Assembly::new(config.assembly.clone(), assembly_ports);
    let mut vertex_ends: Vec<_> = vertex_input.into_iter().zip(vertex_output).map(Some).collect();

    let clips = clip_input.into_iter().zip(to_distribute);
    let clip_units = clips.map(|(input, output)| Clip::new(config.clip.clone(), input, output)).collect();
    let mut to_setup = to_setup.into_iter();
    let distribute_units = distribute_input
        .into_iter()
        .map(|input| Distribute::new(config.distribute.clone(), input, to_setup.by_ref().take(pipelines).collect()));
    let distribute_units = distribute_units.collect();
    let mut of_setup: Vec<Vec<_>> = (0..pipelines).map(|_| Vec::new()).collect();
    for (index, input) in setup_input.into_iter().enumerate() {
        of_setup[index % pipelines].push(input);
    }
    let setups = of_setup.into_iter().zip(to_traverse);
    let setup_units = setups.map(|(inputs, output)| Setup::new(config.setup.clone(), inputs, output)).collect();

    let traverses = traverse_input.into_iter().zip(traverse_updates).zip(to_depth).enumerate();
    let traverse_units = traverses
        .map(|(n, ((input, updates), output))| Traverse::new(config.traverse.clone(), n as u8, input, updates, output))
        .collect();
    let mut acks = acks.into_iter();
    let color_acks: Vec<_> = acks.by_ref().take(pipelines).collect();
    let depth_parts =
        depth_early.into_iter().zip(to_interpolate).zip(depth_late).zip(late).zip(depth_updates).zip(from_end).zip(acks);
    let depth_units = depth_parts
        .enumerate()
        .map(|(n, ((((((early, interpolate), late), color), updates), end), ack))| {
            let ports = DepthPorts { early, interpolate, late, color, updates, end, ack };
            let update = config.traverse.hierarchical_update;
            Depth::new(config.depth.clone(), n as u8, update, ports, port(&mut w, "depth", n, depth[n]))
        })
        .collect();
    let interpolates = interpolate_input.into_iter().zip(to_dispatch).enumerate();
    let interpolate_units =
        interpolates.map(|(n, (input, output))| Interpolate::new(config.interpolate.clone(), n as u8, input, output)).collect();
    let (mut to_cores, mut from_cores) = (to_cores.into_iter(), from_cores.into_iter());
    let dispatches = dispatch_input.into_iter().zip(to_late).zip(to_color).enumerate();
    let dispatch_units = dispatches
        .map(|(n, ((input, late), color))| {
            let cores = to_cores.by_ref().take(per_pipeline).collect();
            let shaded = from_cores.by_ref().take(per_pipeline).collect();
            let ports = DispatchPorts { input, cores, shaded, late, color };
            Dispatch::new(config.dispatch.clone(), n as u8, width, ports)
        })
        .collect();

    let compute_ports = ComputePorts {
        input: compute_input,
        cores: compute_cores.into_iter().enumerate().map(|(n, output)| (n / per_pipeline, output)).collect(),
        finished: compute_finished,
        ack: computed,
    };
    let slots = config.command.workgroup_runs as usize;
    let compute_unit = Compute::new(config.compute.clone(), width, config.core.warps, slots, compute_ports);
    let core_parts = fragment_input.into_iter().zip(fragment_output).zip(group_input.into_iter().zip(group_output));
    let core_units = core_parts
        .zip(ask.into_iter().zip(answer))
        .enumerate()
        .map(|(n, ((fragment, compute), texture))| {
            let vertex = if unified { vertex_ends[n].take() } else { None };
            let ports = CorePorts { fragment: Some(fragment), vertex, compute: Some(compute), texture };
            Core::new(config.core.clone(), n / per_pipeline, ports)
        })
        .collect();
    let textures = texture_input.into_iter().zip(texture_output).enumerate();
    let texture_units = textures
        .map(|(n, (input, output))| {
            let memory = port(&mut w, "texture", n, texture[n]);
            Texture::new(config.texture.clone(), n / per_pipeline, input, output, memory)
        })
        .collect();
    let vertex_config = CoreConfig { warps: config.core.vertex_warps, issue: config.core.vertex_issue, ..config.core.clone() };
    let vertex_core_units = vertex_ask
        .into_iter()
        .zip(vertex_answer)
        .enumerate()
        .map(|(n, texture)| {
            let ports = CorePorts { fragment: None, vertex: vertex_ends[n].take(), compute: None, texture };
            Core::new(vertex_config.clone(), pipelines, ports)
        })
        .collect();
    let vertex_textures = vertex_texture_input.into_iter().zip(vertex_texture_output).enumerate();
    let vertex_texture_units = vertex_textures
        .map(|(n, (input, output))| {
            let memory = port(&mut w, "texture", cores + n, vertex_texture[n]);
            Texture::new(config.texture.clone(), pipelines, input, output, memory)
        })
        .collect();

    let color_parts = color_shaded.into_iter().zip(color_tested).zip(end).zip(color_acks).enumerate();
    let color_units = color_parts
        .map(|(n, (((shaded, tested), end), ack))| {
            let ports = ColorPorts { shaded, tested, end, ack };
            Color::new(config.color.clone(), n as u8, ports, port(&mut w, "color", n, color[n]))
        })
        .collect();
    let resolve_port = port(&mut w, "resolve", 0, resolve);
    let resolve_unit = Resolve::new(config.resolve.clone(), resolve_input, resolved, resolve_port);
    let scanout_port = port(&mut w, "scanout", 0, scanout);
    let scanout_unit = Scanout::new(config.scanout.clone(), scanout_input, scanned, scanout_port);
    let memory = memory.build(&mut w);

    let machine = SortMiddle::new(
        w,
        One(command_unit),
        One(fetch_unit),
        vertex_core_units,
        vertex_texture_units,
        One(assembly_unit),
        clip_units,
        distribute_units,
        setup_units,
        traverse_units,
        depth_units,
        interpolate_units,
        dispatch_units,
        One(compute_unit),
        core_units,
        texture_units,
        color_units,
        One(resolve_unit),
        One(scanout_unit),
        memory.crossbar,
        memory.l2,
        memory.dram,
        memory.return_path,
        memory.ideal,
    );
    Ok((machine, memory.clients))
}
