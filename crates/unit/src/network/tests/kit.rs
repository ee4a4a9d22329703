//! Source, sink, circuit; and the run that must come out the same under every clock.

use crate::network::{
    Arbitration, CreditReturn, Names, NetworkConfig, NetworkMap, NetworkPlan, Receiver, Router, Sender, Topology, Traffic,
};
use num::Cycle;
use sim::{Circuit, Clock, Tick, Unit, Wires, Wiring, run};
use stats::Tree;

pub const ALL: [Topology; 6] =
    [Topology::PointToPoint, Topology::Bus, Topology::Crossbar, Topology::Ring, Topology::Mesh, Topology::Butterfly];

/// A token of these tests: the sender, and the number of the token among those of its source.
pub type Item = [u32; 2];

/// A token to be sent.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    /// Not before this cycle.
    pub at: Cycle,
    /// The receiver; all of them if there is none.
    pub to: Option<usize>,
    pub bytes: u32,
}

impl Order {
    pub fn new(at: Cycle, to: usize, bytes: u32) -> Order {
        Order { at, to: Some(to), bytes }
    }
}

/// Sends its orders one after another, each as soon as it can.
pub struct OrderSender {
    number: u32,
    orders: Vec<Order>,
    /// When each was sent.
    pub sent: Vec<Cycle>,
    sender: Sender<Item>,
}

impl Unit<()> for OrderSender {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut moved = self.sender.poll(wires);
        loop {
            let Some(&Order { at, to, bytes }) = self.orders.get(self.sent.len()) else {
                return wires.stop(Tick::moved_or(moved, Tick::Idle), Tick::Idle);
            };
            if at > wires.now() {
                wires.sleep_until(at);
                return wires.stop(Tick::moved_or(moved, Tick::Working), Tick::Working);
            }
            let can = match to {
                Some(to) => self.sender.can_send(wires, to),
                None => self.sender.can_send_all(wires),
            };
            if !can {
                return wires.stop(Tick::moved_or(moved, Tick::Blocked), Tick::Blocked);
            }
            let item = [self.number, self.sent.len() as u32];
            match to {
                Some(to) => self.sender.send(wires, to, item, bytes),
                None => self.sender.send_all(wires, item, bytes),
            }
            self.sent.push(wires.now());
            moved = true;
        }
    }

    fn items(&self) -> u64 {
        self.sent.len() as u64
    }

    fn resident(&self) -> u64 {
        (self.orders.len() - self.sent.len()) as u64
    }
}

/// The order in which a sink takes tokens.
#[derive(Clone, Debug)]
pub enum Taste {
    /// Whatever has come, from senders in turn.
    Any,
    /// Tokens of these senders in this order, which it knows.
    Order(Vec<usize>),
    /// The same, looked for by the token among all that is here.
    Sought(Vec<usize>),
}

/// Takes tokens.
pub struct Sink {
    taste: Taste,
    /// Cycles from one token to the next; 0 for as many in a cycle as there are.
    rest: Cycle,
    /// Takes nothing before this cycle.
    start: Cycle,
    /// When each token was taken, and the token.
    pub got: Vec<(Cycle, Item)>,
    receiver: Receiver<Item>,
}

impl Unit<()> for Sink {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        self.receiver.poll(wires);
        let mut did = Tick::Starved;
        loop {
            let ready = self.got.last().map_or(self.start, |&(last, _)| last + self.rest).max(self.start);
            if ready > wires.now() {
                wires.sleep_until(ready);
                return wires.stop(did, Tick::Working);
            }
            let next = match &self.taste {
                Taste::Any => {
                    let (senders, first) =
                        (self.receiver.senders(), self.got.last().map_or(0, |(_, token)| token[0] as usize + 1));
                    let mut turns = (0..senders).map(|turn| (first + turn) % senders);
                    turns.find_map(|from| self.receiver.front(wires, from).map(|token| (from, token)))
                }
                Taste::Order(order) => match order.get(self.got.len()) {
                    Some(&from) => self.receiver.front(wires, from).map(|token| (from, token)),
                    None => None,
                },
                Taste::Sought(order) => match order.get(self.got.len()) {
                    Some(&from) => self.receiver.find(wires, |token| token[0] as usize == from),
                    None => None,
                },
            };
            let Some((from, token)) = next else { return wires.stop(did, Tick::Starved) };
            assert_eq!(from, token[0] as usize, "the token is that of its sender");
            self.receiver.take(wires, from);
            self.got.push((wires.now(), token));
            did = Tick::Moved;
        }
    }

    fn items(&self) -> u64 {
        self.got.len() as u64
    }

    fn resident(&self) -> u64 {
        self.receiver.resident()
    }
}

sim::circuit! {
    pub struct Rig for () {
        source: Vec<OrderSender>,
        router: Vec<Router>,
        credit_return: Option<CreditReturn>,
        sink: Vec<Sink>,
    }
}

/// A network's test.
#[derive(Clone, Debug)]
pub struct Case {
    pub config: NetworkConfig,
    /// By sender.
    pub orders: Vec<Vec<Order>>,
    /// By receiver: what it takes, how long it rests, when it starts.
    pub sinks: Vec<(Taste, Cycle, Cycle)>,
}

/// Links of 16 bytes per cycle and 3 cycles.
pub fn config(topology: Topology) -> NetworkConfig {
    NetworkConfig {
        topology,
        link_bytes: 16,
        link_latency: 3,
        queue: 8,
        receive_queue: 32,
        credit_latency: 4,
        arbitration: Arbitration::RoundRobin,
        radix: 2,
        ..NetworkConfig::default()
    }
}

impl Case {
    /// Sinks that take whatever comes at once.
    pub fn new(config: NetworkConfig, orders: Vec<Vec<Order>>, receivers: usize) -> Case {
        Case { config, orders, sinks: vec![(Taste::Any, 0, 0); receivers] }
    }

    pub fn build(&self) -> (Rig, NetworkMap) {
        let mut wiring = Wiring::new();
        let sources = wiring.bank("source", self.orders.len());
        let plan = NetworkPlan::declare(&self.config, Names::SORT, self.orders.len(), self.sinks.len(), &mut wiring);
        let plan = plan.expect("a network");
        let sinks = wiring.bank("sink", self.sinks.len());
        let network = plan.connect(&mut wiring, &sources, &sinks);
        let source = network.senders.into_iter().zip(&self.orders).enumerate().map(|(number, (sender, orders))| OrderSender {
            number: number as u32,
            orders: orders.clone(),
            sent: Vec::new(),
            sender,
        });
        let source = source.collect();
        let sink = network.receivers.into_iter().zip(&self.sinks).map(|(receiver, (taste, rest, start))| Sink {
            taste: taste.clone(),
            rest: *rest,
            start: *start,
            got: Vec::new(),
            receiver,
        });
        let sink = sink.collect();
        (Rig::new(wiring, source, network.routers, network.credit_return, sink), network.map)
    }

    /// Runs under one clock until nothing is left anywhere, credits included.
    pub fn run(&self, clock: Clock) -> RigResult {
        let (mut rig, map) = self.build();
        run(&mut rig, &mut (), clock, 5_000, |rig, ()| is_over(rig))
            .unwrap_or_else(|stuck| panic!("{:?}: {clock:?}: {stuck}", self.config));
        RigResult::of(rig, &map)
    }

    /// Runs under all clocks, which must agree in everything.
    pub fn settle(&self) -> RigResult {
        let expected = self.run(Clock::EveryCycle);
        for clock in [Clock::SkipIdle, Clock::Shuffled(1), Clock::Shuffled(2)] {
            assert_eq!(self.run(clock), expected, "{:?}: {clock:?} against every cycle", self.config);
        }
        self.check(&expected);
        expected
    }

    /// Every token sent has come to its receiver once, and those of a pair in order.
    pub fn check(&self, outcome: &RigResult) {
        let receivers = self.sinks.len();
        for receiver in 0..receivers {
            for (sender, orders) in self.orders.iter().enumerate() {
                let expected = (0..orders.len()).filter(|&n| orders[n].to.is_none_or(|to| to == receiver));
                let got = outcome.got[receiver].iter().filter(|(_, item)| item[0] as usize == sender);
                assert!(
                    got.map(|(_, item)| item[1] as usize).eq(expected),
                    "{:?}: tokens from {sender} at {receiver}: {:?}",
                    self.config,
                    outcome.got[receiver]
                );
            }
        }
    }
}

pub fn is_over(rig: &Rig) -> bool {
    rig.wires().resident() == 0 && rig.tally().1.iter().all(|&resident| resident == 0)
}

/// The outcome of a run.
#[derive(Clone, Debug, PartialEq)]
pub struct RigResult {
    pub cycles: Cycle,
    /// By receiver.
    pub got: Vec<Vec<(Cycle, Item)>>,
    /// By sender.
    pub sent: Vec<Vec<Cycle>>,
    pub traffic: Traffic,
    pub tree: Tree,
}

impl RigResult {
    pub fn of(mut rig: Rig, map: &NetworkMap) -> RigResult {
        rig.wires_mut().settle();
        for unit in rig.reading().units {
            assert_eq!(unit.total(), rig.wires().now(), "the account of a unit");
        }
        let (cycles, tree) = (rig.wires().now(), rig.tree());
        RigResult {
            cycles,
            traffic: map.traffic(&tree, cycles),
            tree,
            got: rig.sink.into_iter().map(|sink| sink.got).collect(),
            sent: rig.source.into_iter().map(|source| source.sent).collect(),
        }
    }

    /// The cycle in which the last token was taken.
    pub fn last(&self) -> Cycle {
        self.got.iter().flatten().map(|&(at, _)| at).max().unwrap_or(0)
    }
}

/// The near and the other links on the way of a pair, by the topology's formula.
pub fn hops(config: &NetworkConfig, senders: usize, receivers: usize, from: usize, to: usize) -> (u64, u64) {
    let nodes = senders.max(receivers);
    let (from, to) = (from * nodes / senders, to * nodes / receivers);
    match config.topology {
        Topology::PointToPoint => (0, 1),
        Topology::Bus => (2, 1),
        Topology::Crossbar => (0, 2),
        Topology::Ring => {
            let apart = from.abs_diff(to);
            (2, apart.min(nodes - apart) as u64)
        }
        Topology::Mesh => {
            let columns = (nodes as f64).sqrt().ceil() as usize;
            let along = (from % columns).abs_diff(to % columns) + (from / columns).abs_diff(to / columns);
            (2, along as u64)
        }
        Topology::Butterfly => {
            let (mut stages, mut lines) = (1, config.radix as usize);
            while lines < nodes {
                (stages, lines) = (stages + 1, lines * config.radix as usize);
            }
            (0, stages + 1)
        }
    }
}
