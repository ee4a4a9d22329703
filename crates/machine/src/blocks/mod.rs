//! Building blocks of machines: each joins one stage of the data flow to the next. A sort class is a list of them.

mod compose;
mod cores;
mod front;
mod pixels;

use std::rc::Rc;

use super::class::Sorted;
use super::config::Config;
pub(super) use super::parts::Shape;
use super::parts::{Banks, Ids, Parts, Stage};
use mem::{Memory, MemoryIds, MemoryPlan, MemoryPort, MemoryUnits};
use sim::{In, Link, Out, StallProbe, Token, UnitId, Wiring};
use unit::color::{Color, ColorConfig, ColorPorts};
use unit::compression::Compression;
use unit::network::{Names, Network, NetworkMap, NetworkPlan, Receiver, Sender};
use unit::resolve::Resolve;
use unit::scanout::Scanout;
use unit::token::{Ack, GroupToken, Packing, Piece, Turn, WarpToken, bytes};

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

/// Ends that wait for their units.
#[derive(Default)]
struct Open {
    color: Vec<ColorPorts>,
    /// Of each composition unit, from and to the command processor.
    compose: Vec<(In<Piece>, Out<Ack>)>,
    /// Ways of the colour caches.
    color_ways: u32,
    resolve: Vec<(In<Piece>, Out<Ack>)>,
    scanout: Vec<(In<Piece>, Out<Ack>)>,
    /// Of each core that shades vertices.
    vertex: Vec<Option<(In<WarpToken>, Out<WarpToken>)>>,
    /// Of each core.
    fragment: Vec<(In<WarpToken>, Out<WarpToken>)>,
    compute: Vec<(In<WarpToken>, Out<WarpToken>)>,
    /// Of each dispatch, to vertex fetch, where batches of vertices follow warps of fragments.
    begun: Vec<Out<Packing>>,
    /// Of each distribution unit, from the command processor, where draws wait for each other.
    turns: Vec<In<Turn>>,
    /// Reports of binned segments.
    binned: Vec<Out<Ack>>,
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
    map: Option<NetworkMap>,
    /// The units at the end of the network, when it is joined.
    behind_network: Vec<UnitId>,
    id: Rc<Ids>,
    made: Banks,
    open: Open,
}

/// A link for groups of quads that carries `quads` quads per cycle.
fn quads(queue: u32, quads: u32, latency: u32) -> Link {
    Link::bytes(queue, quads * bytes::QUAD, latency)
}

/// A few tokens per draw.
const CONTROL: Link = Link::items(16, 4, 1);

impl<'a> Builder<'a> {
    /// Declares the units; `network` has as many senders and receivers.
    ///
    /// # Errors
    /// If the memory's values do not make one.
    pub fn new(config: &'a Config, mut shape: Shape, network: (usize, usize)) -> Result<Builder<'a>, String> {
        let network = NetworkPlan::new(&config.network, Names::SORT, network.0, network.1)?;
        shape.router = network.routers();
        shape.credit_return = usize::from(shape.router > 0);
        let memory = config.memory()?;
        let MemoryUnits { crossbar, l2, dram, ideal } = memory.units();
        shape = Shape { crossbar, l2, dram, return_path: crossbar, ideal, ..shape };
        let mut wiring = Wiring::new();
        let id = Rc::new(Ids::declare(&shape, &mut wiring));
        let network = network.at(id.router.clone(), id.credit_return.first().copied());
        let (front, back) = (id.crossbar.first().or(id.ideal.first()), id.return_path.first().or(id.ideal.first()));
        let (Some(&front), Some(&back)) = (front, back) else { return Err("a machine has a memory".to_owned()) };
        let ids = MemoryIds { front, l2: id.l2.clone(), dram: id.dram.clone(), back };
        let memory = MemoryPlan::new(memory, ids)?.translating(config.tlb);
        let (made, open) = (Banks::default(), Open::default());
        Ok(Builder { config, wiring, memory, network: Some(network), map: None, behind_network: Vec::new(), id, made, open })
    }

    /// Pipelines.
    fn pipelines(&self) -> usize {
        self.config.card.pipelines as usize
    }

    /// What is sorted.
    fn sorted(&self) -> Sorted {
        self.config.card.sort.class().sorted
    }

    /// The units of a pipeline: those before its ROP, and those of its ROP.
    fn units(&self, pipeline: usize, before: bool, rop: bool) -> Vec<UnitId> {
        let (id, pipelines) = (&self.id, self.pipelines());
        // Geometry in front of the network belongs to no pipeline.
        let own = before && self.sorted().own_geometry();
        let stages = [(Stage::Geometry, own), (Stage::Pixels, before), (Stage::Rop, rop)];
        let banks = stages.into_iter().filter(|&(_, of)| of).flat_map(|(stage, _)| id.of_stage(stage));
        let of = |bank: &'_ [UnitId]| {
            let each = bank.len() / pipelines;
            bank[pipeline * each..][..each].to_vec()
        };
        banks.flat_map(of).collect()
    }

    /// A probe that watches these units of a pipeline.
    fn probe(&mut self, pipeline: usize, before: bool, rop: bool) -> StallProbe {
        let units = self.units(pipeline, before, rop);
        self.wiring.stall_probe(&units)
    }

    /// The probe of a pipeline's own front. It watches the whole pipeline if nothing is sorted before composition, and the unit that deals
    /// out batches.
    fn front_probe(&mut self, pipeline: usize) -> StallProbe {
        let mut units = match self.sorted() {
            Sorted::Fragments => Vec::new(),
            Sorted::Images => self.units(pipeline, true, true),
            Sorted::Primitives | Sorted::Triangles => return StallProbe::default(),
        };
        units.extend(&self.id.deal);
        self.wiring.stall_probe(&units)
    }

    /// The probe that watches the units of all pipelines, the first of a machine.
    fn card_probe(&mut self) -> StallProbe {
        let units: Vec<_> = (0..self.pipelines()).flat_map(|pipeline| self.units(pipeline, true, true)).collect();
        self.wiring.stall_probe(&units)
    }

    /// A memory port of a unit.
    fn port(&mut self, name: &'static str, index: usize, unit: UnitId) -> MemoryPort {
        self.memory.client(&mut self.wiring, name, index, unit, self.config.memory.port())
    }

    /// The memory port of a depth or colour unit.
    fn rop_port(&mut self, name: &'static str, index: usize, unit: UnitId) -> MemoryPort {
        self.memory.client(&mut self.wiring, name, index, unit, self.config.memory.rop_port())
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

    /// Puts a bank in front of these inputs, if the machine has it. Each of its units gets what came to one of the inputs, and sends over a
    /// new channel to the unit behind. `make` makes a unit and puts it into its bank. Gives the inputs of the units behind.
    fn splice<T: Token>(
        &mut self,
        bank: &[UnitId],
        name: &'static str,
        link: Link,
        inputs: Vec<In<T>>,
        make: impl Fn(&mut Banks, usize, In<T>, Out<T>),
    ) -> Vec<In<T>> {
        if bank.is_empty() {
            return inputs;
        }
        assert_eq!(bank.len(), inputs.len(), "a bank that is put in between has a unit for each channel");
        let units = bank.iter().zip(inputs).enumerate();
        units
            .map(|(n, (&unit, input))| {
                let behind = self.wiring.redirect(&input, unit);
                let (output, passed) = self.wiring.channel(name, n, link, unit, behind);
                make(&mut self.made, n, input, output);
                passed
            })
            .collect()
    }

    /// The network that sorts, between these units.
    fn sort_network<T: Token>(&mut self, from: &[UnitId], to: &[UnitId]) -> (Vec<Sender<T>>, Vec<Receiver<T>>) {
        let plan = self.network.take().expect("a machine has one network that sorts");
        let Network { senders, receivers, routers, credit_return, map } = plan.connect(&mut self.wiring, from, to);
        self.made.router = routers;
        self.made.credit_return.extend(credit_return);
        self.map = Some(map);
        self.behind_network = to.to_vec();
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
        self.cores();
        for (n, ports) in std::mem::take(&mut self.open.color).into_iter().enumerate() {
            let config = ColorConfig { cache_ways: self.open.color_ways, ..config.color.clone() };
            let memory = self.rop_port("color", n, self.id.color[n]);
            self.made.color.push(Color::new(config, n as u8, ports, memory));
        }
        let c = &config.color;
        let compression = Compression { enabled: c.compression, codec: c.codec, again: c.recompress };
        for (n, (input, output)) in std::mem::take(&mut self.open.resolve).into_iter().enumerate() {
            let memory = self.port("resolve", n, self.id.resolve[n]);
            self.made.resolve.push(Resolve::new(config.resolve.clone(), n as u8, compression, input, output, memory));
        }
        for (input, output) in std::mem::take(&mut self.open.scanout) {
            let memory = self.port("scanout", 0, self.id.scanout[0]);
            self.made.scanout.push(Scanout::new(config.scanout.clone(), config.memory.port_width, input, output, memory));
        }
        let Builder { mut wiring, memory, map, mut made, .. } = self;
        let Memory { crossbar, l2, dram, return_path, ideal, clients } = memory.build(&mut wiring);
        made.crossbar.extend(crossbar);
        made.l2.extend(l2);
        made.dram.extend(dram);
        made.return_path.extend(return_path);
        made.ideal.extend(ideal);
        Built { parts: Parts::new(wiring, made), clients, network: map }
    }
}

/// The two ways from shading to the colour unit of a pipeline.
pub(super) struct Shaded {
    /// To the late test.
    late: In<GroupToken>,
    /// Straight to the colour unit.
    color: In<GroupToken>,
}
