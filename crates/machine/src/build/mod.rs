//! Building blocks of machines: each joins one stage of the data flow to the next. A sort class is a list of them.

mod compose;
mod cores;
mod front;
mod pixels;

use super::config::{Config, SortClass};
use super::parts::Parts;
use mem::{MemoryPlan, MemoryPort};
use sim::{Gate, In, Link, One, Out, Token, UnitId, Wiring};
use unit::assembly::Assembly;
use unit::bin::Bin;
use unit::clip::Clip;
use unit::color::{Color, ColorConfig, ColorPorts};
use unit::command::Command;
use unit::compose::Compose;
use unit::compute::Compute;
use unit::deal::Deal;
use unit::depth::Depth;
use unit::dispatch::Dispatch;
use unit::distribute::Distribute;
use unit::early::Early;
use unit::fetch::Fetch;
use unit::gather::Gather;
use unit::hide::Hide;
use unit::interpolate::Interpolate;
use unit::network::{CreditReturn, Names, Network, NetworkMap, NetworkPlan, Receiver, Router, Sender};
use unit::order::Order;
use unit::resolve::Resolve;
use unit::route::Route;
use unit::scanout::Scanout;
use unit::setup::Setup;
use unit::tile_fetch::TileFetch;
use unit::token::{Ack, GroupToken, Piece, WarpToken, bytes};
use unit::traverse::Traverse;

/// Both ends of channels, as they are handed out.
pub(super) type Ends<T> = (Vec<Out<T>>, Vec<In<T>>);

/// A machine that is wired.
pub(super) struct Built {
    /// Its units.
    pub parts: Parts,
    /// Names of its memory clients, and the number of ports of each.
    pub clients: Clients,
    /// The network that sorts.
    pub network: Option<NetworkMap>,
}

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
    /// Units that deal batches.
    pub dealers: usize,
    /// Units that route primitives, and as many that gather them.
    pub routers: usize,
    /// Units that bin.
    pub bins: usize,
    /// Units that read tiles.
    pub tile_fetches: usize,
    /// Units that test depths ahead of the ROPs that own them.
    pub earlies: usize,
    /// Units that remove hidden surfaces.
    pub hides: usize,
    /// Units that restore the order at the ROP.
    pub orders: usize,
    /// Units that compose frame buffers.
    pub composers: usize,
    /// Ends of the network that sorts: senders and receivers.
    pub network: Option<(usize, usize)>,
}

/// Numbers of the units.
struct Ids {
    command: UnitId,
    deal: Vec<UnitId>,
    route: Vec<UnitId>,
    gather: Vec<UnitId>,
    fetch: Vec<UnitId>,
    vertex_core: Vec<UnitId>,
    vertex_texture: Vec<UnitId>,
    assembly: Vec<UnitId>,
    clip: Vec<UnitId>,
    distribute: Vec<UnitId>,
    bin: Vec<UnitId>,
    tile_fetch: Vec<UnitId>,
    setup: Vec<UnitId>,
    traverse: Vec<UnitId>,
    early: Vec<UnitId>,
    depth: Vec<UnitId>,
    hide: Vec<UnitId>,
    interpolate: Vec<UnitId>,
    dispatch: Vec<UnitId>,
    order: Vec<UnitId>,
    compute: UnitId,
    core: Vec<UnitId>,
    texture: Vec<UnitId>,
    color: Vec<UnitId>,
    compose: Vec<UnitId>,
    resolve: UnitId,
    scanout: UnitId,
}

/// The units made so far, and ends that wait for theirs.
#[derive(Default)]
struct Made {
    command: Option<Command>,
    deal: Vec<Deal>,
    route: Vec<Route>,
    gather: Vec<Gather>,
    fetch: Vec<Fetch>,
    assembly: Vec<Assembly>,
    clip: Vec<Clip>,
    distribute: Vec<Distribute>,
    bin: Vec<Bin>,
    tile_fetch: Vec<TileFetch>,
    setup: Vec<Setup>,
    traverse: Vec<Traverse>,
    early: Vec<Early>,
    depth: Vec<Depth>,
    hide: Vec<Hide>,
    interpolate: Vec<Interpolate>,
    dispatch: Vec<Dispatch>,
    router: Vec<Router>,
    credit_return: Option<CreditReturn>,
    network: Option<NetworkMap>,
    order: Vec<Order>,
    compute: Option<Compute>,
    color_ends: Vec<ColorPorts>,
    compose: Vec<Compose>,
    /// Of each composition unit, from and to the command processor.
    compose_commands: Vec<(In<Piece>, Out<Ack>)>,
    /// Ways of the colour caches.
    color_ways: u32,
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
    network: Option<NetworkPlan>,
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
        let mut network = None;
        let id = Ids {
            command: w.unit("command", 0),
            deal: w.bank("deal", shape.dealers),
            route: w.bank("route", shape.routers),
            gather: w.bank("gather", shape.routers),
            fetch: w.bank("fetch", shape.fronts),
            vertex_core: w.bank("vertex_core", vertex_cores),
            vertex_texture: w.bank("vertex_texture", vertex_cores),
            assembly: w.bank("assembly", shape.fronts),
            clip: w.bank("clip", shape.clippers),
            distribute: w.bank("distribute", shape.distributors),
            bin: w.bank("bin", shape.bins),
            tile_fetch: w.bank("tile_fetch", shape.tile_fetches),
            setup: {
                if let Some((senders, receivers)) = shape.network {
                    let plan = NetworkPlan::declare(&config.network, Names::SORT, senders, receivers, &mut w)?;
                    network = Some(plan);
                }
                w.bank("setup", pipelines)
            },
            traverse: w.bank("traverse", pipelines),
            early: w.bank("early", shape.earlies),
            depth: w.bank("depth", pipelines),
            hide: w.bank("hide", shape.hides),
            interpolate: w.bank("interpolate", pipelines),
            dispatch: w.bank("dispatch", pipelines),
            order: w.bank("order", shape.orders),
            compute: w.unit("compute", 0),
            core: w.bank("core", cores),
            texture: w.bank("texture", cores),
            color: w.bank("color", pipelines),
            compose: w.bank("compose", shape.composers),
            resolve: w.unit("resolve", 0),
            scanout: w.unit("scanout", 0),
        };
        let memory = MemoryPlan::declare(config.memory()?, &mut w)?;
        Ok(Builder { config, wiring: w, memory, network, id, made: Made::default() })
    }

    /// Pipelines.
    fn pipelines(&self) -> usize {
        self.config.card.pipelines as usize
    }

    /// The units of a pipeline: those before its ROP, and those of its ROP.
    fn units(&self, pipeline: usize, before: bool, rop: bool) -> Vec<UnitId> {
        let (id, pipelines) = (&self.id, self.pipelines());
        let front = [&id.gather, &id.fetch, &id.assembly, &id.clip, &id.distribute];
        let pixels = [
            &id.tile_fetch,
            &id.setup,
            &id.traverse,
            &id.early,
            &id.hide,
            &id.interpolate,
            &id.dispatch,
            &id.core,
            &id.texture,
        ];
        let rops = [&id.order, &id.depth, &id.color];
        // Geometry in front of the network belongs to no pipeline.
        let own = before && !matches!(self.config.card.sort, SortClass::Middle | SortClass::MiddleBinned);
        let banks = front.into_iter().filter(|_| own).chain(pixels.into_iter().filter(|_| before));
        let banks = banks.chain(rops.into_iter().filter(|_| rop));
        let of = |bank: &'_ Vec<UnitId>| {
            let each = bank.len() / pipelines;
            bank[pipeline * each..][..each].to_vec()
        };
        banks.flat_map(of).collect()
    }

    /// A gate that these units of a pipeline hang on.
    fn gate(&mut self, pipeline: usize, before: bool, rop: bool) -> Gate {
        let units = self.units(pipeline, before, rop);
        self.wiring.gate(&units)
    }

    /// The gate of a pipeline's own front: where that is the end of all sorting before composition, its pipeline hangs on it. Whoever deals
    /// out work does too.
    fn front_gate(&mut self, pipeline: usize) -> Gate {
        let mut units = match self.config.card.sort {
            SortClass::LastFragment => Vec::new(),
            SortClass::LastImage => self.units(pipeline, true, true),
            _ => return Gate::default(),
        };
        units.extend(&self.id.deal);
        self.wiring.gate(&units)
    }

    /// The gate that the units of all pipelines hang on, the first of a machine.
    fn card_gate(&mut self) -> Gate {
        let units: Vec<_> = (0..self.pipelines()).flat_map(|pipeline| self.units(pipeline, true, true)).collect();
        self.wiring.gate(&units)
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

    /// The network that sorts, between these units.
    fn sort_network<T: Token>(&mut self, from: &[UnitId], to: &[UnitId]) -> (Vec<Sender<T>>, Vec<Receiver<T>>) {
        let plan = self.network.take().expect("the machine's shape has a network");
        let Network { senders, receivers, routers, credit_return, map } = plan.connect(&mut self.wiring, from, to);
        self.made.router = routers;
        self.made.credit_return = credit_return;
        self.made.network = Some(map);
        (senders, receivers)
    }

    /// The link from the cores to the ROPs.
    fn to_rop(&self) -> Link {
        let dispatch = &self.config.dispatch;
        quads(dispatch.output_queue, dispatch.output_quads, dispatch.output_latency)
    }

    /// The machine.
    pub fn finish(mut self) -> Built {
        let config = self.config;
        let cores = self.cores();
        let color = self.id.color.clone();
        let ends = std::mem::take(&mut self.made.color_ends).into_iter().enumerate();
        let colors = ends
            .map(|(n, ports)| {
                let config = ColorConfig { cache_ways: self.made.color_ways, ..config.color.clone() };
                Color::new(config, n as u8, ports, self.port("color", n, color[n]))
            })
            .collect();
        let (input, output) = self.made.resolve_ends.take().expect("a machine resolves");
        let resolve = Resolve::new(config.resolve.clone(), input, output, self.port("resolve", 0, self.id.resolve));
        let (input, output) = self.made.scanout_ends.take().expect("a machine shows frames");
        let scanout = Scanout::new(config.scanout.clone(), input, output, self.port("scanout", 0, self.id.scanout));
        let Builder { mut wiring, memory, made, .. } = self;
        let memory = memory.build(&mut wiring);
        let network = made.network;
        let parts = Parts::new(
            wiring,
            One(made.command.expect("a machine has a command processor")),
            made.deal,
            made.route,
            made.gather,
            made.fetch,
            cores.vertex_core,
            cores.vertex_texture,
            made.assembly,
            made.clip,
            made.distribute,
            made.bin,
            made.tile_fetch,
            made.router,
            made.credit_return,
            made.setup,
            made.traverse,
            made.early,
            made.depth,
            made.hide,
            made.interpolate,
            made.dispatch,
            made.order,
            One(made.compute.expect("a machine computes")),
            cores.core,
            cores.texture,
            colors,
            made.compose,
            One(resolve),
            One(scanout),
            memory.crossbar,
            memory.l2,
            memory.dram,
            memory.return_path,
            memory.ideal,
        );
        Built { parts, clients: memory.clients, network }
    }
}

/// The two ways from shading to the colour unit of a pipeline.
pub(super) struct Shaded {
    /// To the late test.
    late: In<GroupToken>,
    /// Straight to the colour unit.
    color: In<GroupToken>,
}
