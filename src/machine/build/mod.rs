//! Building blocks of machines: each joins one stage of the data flow to the next. A sort class is a list of them.

mod cores;
mod front;
mod pixels;

use super::config::Config;
use super::parts::Parts;
use crate::mem::{MemoryPlan, MemoryPort};
use crate::sim::{In, Link, One, Out, Token, UnitId, Wiring};
use crate::unit::assembly::Assembly;
use crate::unit::clip::Clip;
use crate::unit::color::{Color, ColorPorts};
use crate::unit::command::Command;
use crate::unit::compute::Compute;
use crate::unit::depth::Depth;
use crate::unit::dispatch::Dispatch;
use crate::unit::distribute::Distribute;
use crate::unit::fetch::Fetch;
use crate::unit::interpolate::Interpolate;
use crate::unit::resolve::Resolve;
use crate::unit::scanout::Scanout;
use crate::unit::setup::Setup;
use crate::unit::token::{Ack, GroupToken, Piece, WarpToken, bytes};
use crate::unit::traverse::Traverse;

/// Both ends of channels, as they are handed out.
pub(super) type Ends<T> = (Vec<Out<T>>, Vec<In<T>>);

/// Names of memory clients, and the number of ports of each.
pub type Clients = Vec<(&'static str, usize)>;

/// How many a machine has of the units that not every class has one of in each pipeline.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shape {
    /// Vertex fetch units, each with an assembly unit and a share of the cores.
    pub fronts: usize,
    /// Clippers.
    pub clippers: usize,
    /// Distribution units.
    pub distributors: usize,
}

/// Numbers of the units.
struct Ids {
    command: UnitId,
    fetch: Vec<UnitId>,
    vertex_core: Vec<UnitId>,
    vertex_texture: Vec<UnitId>,
    assembly: Vec<UnitId>,
    clip: Vec<UnitId>,
    distribute: Vec<UnitId>,
    setup: Vec<UnitId>,
    traverse: Vec<UnitId>,
    depth: Vec<UnitId>,
    interpolate: Vec<UnitId>,
    dispatch: Vec<UnitId>,
    compute: UnitId,
    core: Vec<UnitId>,
    texture: Vec<UnitId>,
    color: Vec<UnitId>,
    resolve: UnitId,
    scanout: UnitId,
}

/// The units made so far, and ends that wait for theirs.
#[derive(Default)]
struct Made {
    command: Option<Command>,
    fetch: Vec<Fetch>,
    assembly: Vec<Assembly>,
    clip: Vec<Clip>,
    distribute: Vec<Distribute>,
    setup: Vec<Setup>,
    traverse: Vec<Traverse>,
    depth: Vec<Depth>,
    interpolate: Vec<Interpolate>,
    dispatch: Vec<Dispatch>,
    compute: Option<Compute>,
    color_ends: Vec<ColorPorts>,
    resolve_ends: Option<(In<Piece>, Out<Ack>)>,
    scanout_ends: Option<(In<Piece>, Out<Ack>)>,
    /// Of each core that shades vertices.
    vertex_ends: Vec<Option<(In<WarpToken>, Out<WarpToken>)>>,
    /// Of each core.
    fragment_ends: Vec<(In<WarpToken>, Out<WarpToken>)>,
    compute_ends: Vec<(In<WarpToken>, Out<WarpToken>)>,
    /// To the command processor.
    color_acks: Vec<Out<Ack>>,
    depth_acks: Vec<Out<Ack>>,
}

/// A machine in the making.
pub(super) struct Builder<'a> {
    config: &'a Config,
    wiring: Wiring,
    memory: MemoryPlan,
    id: Ids,
    made: Made,
}

/// A link for groups of quads: as wide as so many quads.
fn quads(queue: u32, quads: u32, latency: u32) -> Link {
    Link::bytes(queue, quads * bytes::QUAD, latency)
}

/// A few tokens a draw.
const CONTROL: Link = Link::items(16, 4, 1);

impl<'a> Builder<'a> {
    /// Declares the units.
    ///
    /// # Errors
    /// If the memory's values do not make one.
    pub fn new(config: &'a Config, shape: Shape) -> Result<Builder<'a>, String> {
        let pipelines = config.card.pipelines as usize;
        let cores = pipelines * config.core.per_pipeline as usize;
        let vertex_cores = if config.core.unified { 0 } else { config.core.vertex_cores as usize };
        // In the order of the machine's fields.
        let mut w = Wiring::new();
        let id = Ids {
            command: w.unit("command", 0),
            fetch: w.bank("fetch", shape.fronts),
            vertex_core: w.bank("vertex_core", vertex_cores),
            vertex_texture: w.bank("vertex_texture", vertex_cores),
            assembly: w.bank("assembly", shape.fronts),
            clip: w.bank("clip", shape.clippers),
            distribute: w.bank("distribute", shape.distributors),
            setup: w.bank("setup", pipelines),
            traverse: w.bank("traverse", pipelines),
            depth: w.bank("depth", pipelines),
            interpolate: w.bank("interpolate", pipelines),
            dispatch: w.bank("dispatch", pipelines),
            compute: w.unit("compute", 0),
            core: w.bank("core", cores),
            texture: w.bank("texture", cores),
            color: w.bank("color", pipelines),
            resolve: w.unit("resolve", 0),
            scanout: w.unit("scanout", 0),
        };
        let memory = MemoryPlan::declare(config.memory()?, &mut w)?;
        Ok(Builder { config, wiring: w, memory, id, made: Made::default() })
    }

    /// Pipelines.
    fn pipelines(&self) -> usize {
        self.config.card.pipelines as usize
    }

    /// A memory port of a unit.
    fn port(&mut self, name: &'static str, index: usize, unit: UnitId) -> MemoryPort {
        let knobs = &self.config.memory;
        self.memory.client(&mut self.wiring, name, index, unit, knobs.port_width, knobs.port_latency, knobs.port_queue)
    }

    /// Joins units pairwise.
    fn join<T: Token>(&mut self, name: &'static str, link: Link, pairs: impl IntoIterator<Item = (UnitId, UnitId)>) -> Ends<T> {
        let wiring = &mut self.wiring;
        pairs.into_iter().enumerate().map(|(index, (from, to))| wiring.channel(name, index, link, from, to)).unzip()
    }

    /// Joins the units of two banks one to one.
    fn chain<T: Token>(&mut self, name: &'static str, link: Link, from: &[UnitId], to: &[UnitId]) -> Ends<T> {
        self.join(name, link, from.iter().copied().zip(to.iter().copied()))
    }

    /// The link from the cores to the ROPs.
    fn to_rop(&self) -> Link {
        let dispatch = &self.config.dispatch;
        quads(dispatch.output_queue, dispatch.output_quads, dispatch.output_latency)
    }

    /// The machine, and the names of its memory clients.
    pub fn finish(mut self) -> (Parts, Clients) {
        let config = self.config;
        let cores = self.cores();
        let color = self.id.color.clone();
        let ends = std::mem::take(&mut self.made.color_ends).into_iter().enumerate();
        let colors =
            ends.map(|(n, ports)| Color::new(config.color.clone(), n as u8, ports, self.port("color", n, color[n]))).collect();
        let (input, output) = self.made.resolve_ends.take().expect("a machine resolves");
        let resolve = Resolve::new(config.resolve.clone(), input, output, self.port("resolve", 0, self.id.resolve));
        let (input, output) = self.made.scanout_ends.take().expect("a machine shows frames");
        let scanout = Scanout::new(config.scanout.clone(), input, output, self.port("scanout", 0, self.id.scanout));
        let Builder { mut wiring, memory, made, .. } = self;
        let memory = memory.build(&mut wiring);
        let machine = Parts::new(
            wiring,
            One(made.command.expect("a machine has a command processor")),
            made.fetch,
            cores.vertex_core,
            cores.vertex_texture,
            made.assembly,
            made.clip,
            made.distribute,
            made.setup,
            made.traverse,
            made.depth,
            made.interpolate,
            made.dispatch,
            One(made.compute.expect("a machine computes")),
            cores.core,
            cores.texture,
            colors,
            One(resolve),
            One(scanout),
            memory.crossbar,
            memory.l2,
            memory.dram,
            memory.return_path,
            memory.ideal,
        );
        (machine, memory.clients)
    }
}

/// The two ways from shading to the colour unit of a pipeline.
pub(super) struct Shaded {
    /// To the late test.
    late: In<GroupToken>,
    /// Straight to the colour unit.
    color: In<GroupToken>,
}
