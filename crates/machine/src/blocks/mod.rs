//! Building blocks of machines: each joins one stage of the data flow to the next. A sort class is a list of them.

mod compose;
mod cores;
mod ends;
mod front;
mod pixels;

use std::rc::Rc;

use super::class::{BuildError, Sorted};
use super::config::Config;
pub(super) use super::parts::Shape;
use super::parts::{Banks, Ids, Parts, PipelineSection};
pub(super) use ends::Ends;
use ends::{Joint, Untaken, complaint};
use mem::{Memory, MemoryIds, MemoryPlan, MemoryPort, MemoryUnits};
use sim::{In, Link, Out, StallProbe, Token, UnitId, Wiring};
use unit::color::{Color, ColorConfig, ColorPorts};
use unit::compression::Compression;
use unit::network::{Names, Network, NetworkMap, NetworkPlan, Receiver, Sender};
use unit::resolve::Resolve;
use unit::scanout::Scanout;
use unit::token::{Ack, NextDraw, Packing, Piece, WarpToken, bytes};

/// Both ends of channels.
type Both<T> = (Ends<Out<T>>, Ends<In<T>>);

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
    compose: (Ends<In<Piece>>, Ends<Out<Ack>>),
    /// Ways of the colour caches.
    color_ways: u32,
    resolve: (Ends<In<Piece>>, Ends<Out<Ack>>),
    scanout: (Ends<In<Piece>>, Ends<Out<Ack>>),
    /// Of each core that shades vertices.
    vertex: (Ends<In<WarpToken>>, Ends<Out<WarpToken>>),
    /// Of each core.
    fragment: (Ends<In<WarpToken>>, Ends<Out<WarpToken>>),
    compute: (Ends<In<WarpToken>>, Ends<Out<WarpToken>>),
    /// Of each dispatch, to vertex fetch, where batches of vertices follow warps of fragments.
    begun: Ends<Out<Packing>>,
    /// Of each distribution unit, from the command processor, where draws wait for each other.
    turns: Ends<In<NextDraw>>,
    /// Reports of binned segments.
    binned: Ends<Out<Ack>>,
    /// To the command processor.
    color_acks: Ends<Out<Ack>>,
    depth_acks: Ends<Out<Ack>>,
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
    untaken: Untaken,
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
    pub fn new(config: &'a Config, mut shape: Shape, network: (usize, usize)) -> Result<Builder<'a>, BuildError> {
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
        let (Some(&front), Some(&back)) = (front, back) else { return Err(BuildError::NoMemory) };
        let ids = MemoryIds { front, l2: id.l2.clone(), dram: id.dram.clone(), back };
        let memory = MemoryPlan::new(memory, ids)?.translating(config.tlb);
        let (made, open, untaken) = (Banks::default(), Open::default(), Untaken::default());
        let network = Some(network);
        Ok(Builder { config, wiring, memory, network, map: None, behind_network: Vec::new(), id, made, open, untaken })
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
        let stages = [(PipelineSection::Geometry, own), (PipelineSection::Pixels, before), (PipelineSection::Rop, rop)];
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
    fn join<T: Token>(&mut self, name: &'static str, link: Link, pairs: impl IntoIterator<Item = (UnitId, UnitId)>) -> Both<T> {
        let wiring = &mut self.wiring;
        let joined = pairs.into_iter().enumerate().map(|(index, (from, to))| {
            let (joint, (output, input)) = (Joint { name, index, from, to }, wiring.channel(name, index, link, from, to));
            ((joint, output), (joint, input))
        });
        let (outputs, inputs): (Vec<_>, Vec<_>) = joined.unzip();
        (Ends::new(outputs, &self.untaken), Ends::new(inputs, &self.untaken))
    }

    /// Joins the units of two banks one to one.
    fn chain<T: Token>(&mut self, name: &'static str, link: Link, from: &[UnitId], to: &[UnitId]) -> Both<T> {
        assert_eq!(from.len(), to.len(), "{name} joins banks of as many units");
        self.join(name, link, from.iter().copied().zip(to.iter().copied()))
    }

    /// Puts a bank in front of these inputs, if the machine has it. Each of its units gets what came to one of the inputs, and sends over a
    /// new channel to the unit behind. `make` makes a unit and puts it into its bank. Gives the inputs of the units behind.
    fn splice<T: Token>(
        &mut self,
        bank: &[UnitId],
        name: &'static str,
        link: Link,
        mut inputs: Ends<In<T>>,
        make: impl Fn(&mut Banks, usize, In<T>, Out<T>),
    ) -> Ends<In<T>> {
        if bank.is_empty() {
            return inputs;
        }
        assert_eq!(bank.len(), inputs.len(), "a bank that is put in between has a unit for each channel");
        let inputs = inputs.take_all(0..bank.len());
        let behind: Vec<_> = bank.iter().zip(&inputs).map(|(&unit, input)| (unit, self.wiring.redirect(input, unit))).collect();
        let (mut outputs, passed) = self.join(name, link, behind);
        for (n, input) in inputs.into_iter().enumerate() {
            make(&mut self.made, n, input, outputs.take(n));
        }
        passed
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
    ///
    /// # Errors
    /// If a channel has an end that no unit has taken.
    pub fn finish(mut self) -> Result<Built, BuildError> {
        let config = self.config;
        self.cores();
        for (n, ports) in std::mem::take(&mut self.open.color).into_iter().enumerate() {
            let config = ColorConfig { cache_ways: self.open.color_ways, ..config.color.clone() };
            let memory = self.rop_port("color", n, self.id.color[n]);
            self.made.color.push(Color::new(config, n as u8, ports, memory));
        }
        let c = &config.color;
        let compression = Compression { enabled: c.compression, codec: c.codec, again: c.recompress };
        let (mut inputs, mut outputs) = std::mem::take(&mut self.open.resolve);
        for n in 0..self.id.resolve.len() {
            let (input, output) = (inputs.take(n), outputs.take(n));
            let memory = self.port("resolve", n, self.id.resolve[n]);
            self.made.resolve.push(Resolve::new(config.resolve.clone(), n as u8, compression, input, output, memory));
        }
        let (input, output) = (self.open.scanout.0.take(0), self.open.scanout.1.take(0));
        let port = self.port("scanout", 0, self.id.scanout[0]);
        self.made.scanout.push(Scanout::new(config.scanout.clone(), config.memory.port_width, input, output, port));
        drop((inputs, outputs));
        let Builder { mut wiring, memory, map, mut made, open, untaken, .. } = self;
        drop(open);
        if let Some(complaint) = complaint(&untaken, &wiring) {
            return Err(complaint);
        }
        let Memory { crossbar, l2, dram, return_path, ideal, clients } = memory.build(&mut wiring);
        made.crossbar.extend(crossbar);
        made.l2.extend(l2);
        made.dram.extend(dram);
        made.return_path.extend(return_path);
        made.ideal.extend(ideal);
        Ok(Built { parts: Parts::new(wiring, made), clients, network: map })
    }
}
