//! Wiring a network into a machine.

use super::credit::{Credit, CreditReturn};
use super::port::{Receiver, Sender};
use super::router::Router;
use super::topology::{End, LinkPlan, Plan};
use super::traffic::{MapLink, NetworkMap};
use super::{MAX_ENDS, NetworkConfig, Topology};
use sim::{In, Link, Out, Token, UnitId, Wiring};

/// The names of a network's units and channels in the statistics. The first two are fields of the machine.
#[derive(Clone, Copy, Debug)]
pub struct Names {
    /// Routers.
    pub router: &'static str,
    /// The unit that brings credits back.
    pub credit_return: &'static str,
    /// Direct channels: that from sender s to receiver r of R has number s R + r.
    pub direct: &'static str,
    /// Links from senders.
    pub inject: &'static str,
    /// Links between routers.
    pub link: &'static str,
    /// Links to receivers.
    pub eject: &'static str,
    /// Credits from receivers.
    pub freed: &'static str,
    /// Credits to senders.
    pub credit: &'static str,
}

impl Names {
    /// The names of the network that sorts.
    pub const SORT: Names = Names {
        router: "router",
        credit_return: "credit_return",
        direct: "sorted",
        inject: "sort_in",
        link: "sort_link",
        eject: "sort_out",
        freed: "sort_freed",
        credit: "sort_credit",
    };
}

/// A network while its machine is being wired:
/// 1. [`NetworkPlan::declare`] where the network's fields stand among the machine's fields, which are `Vec<Router>` and
///    `Option<CreditReturn>` in this order, named as in [`Names`],
/// 2. [`NetworkPlan::connect`] when the units at both ends are declared.
#[derive(Clone, Debug)]
pub struct NetworkPlan {
    config: NetworkConfig,
    names: Names,
    plan: Plan,
    senders: usize,
    receivers: usize,
    routers: Vec<UnitId>,
    credit_return: Option<UnitId>,
}

/// A network that carries tokens `T`.
#[derive(Clone, Debug)]
pub struct Network<T> {
    /// The senders' ends.
    pub senders: Vec<Sender<T>>,
    /// The receivers' ends.
    pub receivers: Vec<Receiver<T>>,
    /// For the machine's field.
    pub routers: Vec<Router>,
    /// For the machine's field.
    pub credit_return: Option<CreditReturn>,
    /// Where its links are.
    pub map: NetworkMap,
}

impl NetworkConfig {
    /// Cycles on a link.
    fn latency(&self, link: &LinkPlan) -> u32 {
        if link.near { 1 } else { self.link_latency }
    }

    /// Cycles from a parcel's sending to the cycle in which its place can be used again, over the longest way of an empty network. A
    /// sender that is to send one receiver a parcel in every cycle needs as many places there (`receive_queue`), and a third more on
    /// networks with routers, where a quarter of them may be waiting for their bundle of credits.
    #[cfg(test)]
    pub(super) fn round_trip(&self, senders: usize, receivers: usize) -> u32 {
        let plan = Plan::new(self.topology, self.radix, senders, receivers);
        if plan.routers.is_empty() {
            return self.link_latency + 1;
        }
        let pairs = (0..senders).flat_map(|from| (0..receivers).map(move |to| (from, to)));
        let way = |(from, to)| plan.way(from, to).iter().map(|&link| self.latency(&plan.links[link])).sum::<u32>();
        pairs.map(way).max().unwrap_or(0) + self.credit_latency
    }
}

/// A network cannot have as many ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("a network of {count} {what}: there must be 1 to {MAX_ENDS}")]
pub struct NetworkError {
    /// Ends that are asked for.
    pub count: usize,
    /// Their side: senders or receivers.
    pub what: &'static str,
}

impl NetworkPlan {
    /// A network whose units are still to be declared: as many routers as [`NetworkPlan::routers`] says, and a way back for credits
    /// if there is one.
    ///
    /// # Errors
    /// If there are no or too many senders or receivers.
    pub fn new(config: &NetworkConfig, names: Names, senders: usize, receivers: usize) -> Result<NetworkPlan, NetworkError> {
        for (count, what) in [(senders, "senders"), (receivers, "receivers")] {
            if !(1..=MAX_ENDS).contains(&count) {
                return Err(NetworkError { count, what });
            }
        }
        let plan = Plan::new(config.topology, config.radix, senders, receivers);
        let (routers, credit_return) = (Vec::new(), None);
        Ok(NetworkPlan { config: config.clone(), names, plan, senders, receivers, routers, credit_return })
    }

    /// Routers that it has.
    pub fn routers(&self) -> usize {
        self.plan.routers.len()
    }

    /// The units as they were declared.
    pub fn at(self, routers: Vec<UnitId>, credit_return: Option<UnitId>) -> NetworkPlan {
        NetworkPlan { routers, credit_return, ..self }
    }

    /// Declares the units, which come next in the wiring.
    ///
    /// # Errors
    /// If there are no or too many senders or receivers.
    pub fn declare(
        config: &NetworkConfig,
        names: Names,
        senders: usize,
        receivers: usize,
        wiring: &mut Wiring,
    ) -> Result<NetworkPlan, NetworkError> {
        let plan = NetworkPlan::new(config, names, senders, receivers)?;
        let routers = wiring.bank(names.router, plan.routers());
        let credit_return = (!routers.is_empty()).then(|| wiring.unit(names.credit_return, 0));
        Ok(plan.at(routers, credit_return))
    }

    /// Declares the channels, and makes the ends and the units.
    ///
    /// # Panics
    /// If these are not as many units as were declared: the machine is wrong.
    pub fn connect<T: Token>(self, wiring: &mut Wiring, senders: &[UnitId], receivers: &[UnitId]) -> Network<T> {
        assert_eq!((senders.len(), receivers.len()), (self.senders, self.receivers), "the network's ends");
        match self.credit_return {
            None => self.connect_directly(wiring, senders, receivers),
            Some(credit_return) => self.connect_routed(wiring, senders, receivers, credit_return),
        }
    }

    fn connect_directly<T: Token>(self, wiring: &mut Wiring, senders: &[UnitId], receivers: &[UnitId]) -> Network<T> {
        let c = &self.config;
        let link = Link::bytes(c.receive_queue, c.link_bytes, c.link_latency);
        let mut places = Vec::new();
        let mut outputs: Vec<Vec<Out<T>>> = Vec::new();
        let mut inputs: Vec<Vec<In<T>>> = receivers.iter().map(|_| Vec::new()).collect();
        for (s, &from) in senders.iter().enumerate() {
            outputs.push(Vec::new());
            for (r, &to) in receivers.iter().enumerate() {
                let index = s * receivers.len() + r;
                let (output, input) = wiring.channel(self.names.direct, index, link, from, to);
                outputs[s].push(output);
                inputs[r].push(input);
                let (from, to) = (format!("sender {s}"), format!("receiver {r}"));
                places.push(MapLink { name: self.names.direct, index, from, to });
            }
        }
        Network {
            senders: outputs.into_iter().map(Sender::direct).collect(),
            receivers: inputs.into_iter().map(Receiver::direct).collect(),
            routers: Vec::new(),
            credit_return: None,
            map: NetworkMap::new(c.link_bytes, places),
        }
    }

    fn connect_routed<T: Token>(
        self,
        wiring: &mut Wiring,
        senders: &[UnitId],
        receivers: &[UnitId],
        credit_return: UnitId,
    ) -> Network<T> {
        let (c, names) = (&self.config, &self.names);
        // 1. The links.
        let unit = |end| match end {
            End::Sender(number) => senders[usize::from(number)],
            End::Router(number) => self.routers[usize::from(number)],
            End::Receiver(number) => receivers[usize::from(number)],
        };
        let label = |end| match end {
            End::Sender(number) => format!("sender {number}"),
            End::Router(number) => format!("router {number}"),
            End::Receiver(number) => format!("receiver {number}"),
        };
        let mut places = Vec::new();
        let (mut outputs, mut inputs) = (Vec::new(), Vec::new());
        let mut between = 0..;
        for plan in &self.plan.links {
            let (from, to) = (plan.from, plan.to);
            let (name, index) = match (from, to) {
                (End::Sender(number), _) => (names.inject, usize::from(number)),
                (_, End::Receiver(number)) => (names.eject, usize::from(number)),
                _ => (names.link, between.next().unwrap_or_default()),
            };
            let link = Link::bytes(c.queue, c.link_bytes, c.latency(plan));
            let (output, input) = wiring.channel(name, index, link, unit(from), unit(to));
            outputs.push(Some(output));
            inputs.push(Some(input));
            places.push(MapLink { name, index, from: label(from), to: label(to) });
        }
        // 2. The way back of credits.
        let freed = Link::items(2, 1, 1);
        let credit = Link::items(c.credit_latency, 1, c.credit_latency - 1);
        let (to_return, freed): (Vec<Out<Credit>>, Vec<In<Credit>>) = (receivers.iter().enumerate())
            .map(|(r, &receiver)| wiring.channel(names.freed, r, freed, receiver, credit_return))
            .unzip();
        let (from_return, credits): (Vec<Out<Credit>>, Vec<In<Credit>>) = (senders.iter().enumerate())
            .map(|(s, &sender)| wiring.channel(names.credit, s, credit, credit_return, sender))
            .unzip();
        // 3. Routers and ends; each link has one unit at either end.
        let mut output = |link: usize| outputs[link].take().expect("a link begins once");
        let mut input = |link: usize| inputs[link].take().expect("a link ends once");
        let routers = self.plan.routers.iter().map(|plan| {
            let inputs = plan.inputs.iter().map(|&link| input(link)).collect();
            let outputs = plan.outputs.iter().map(|&link| output(link)).collect();
            Router::new(plan, c.arbitration, c.queue, inputs, outputs)
        });
        let routers = routers.collect();
        let at = |end: End| {
            self.plan.links.iter().position(|link| link.from == end || link.to == end).expect("every end has a link")
        };
        let capacity = c.receive_queue as u16;
        let shared = c.topology == Topology::Bus;
        let (sending, receiving) = (self.senders as u8, self.receivers as u8);
        let ends = (0..sending).zip(credits);
        let ends =
            ends.map(|(s, credits)| Sender::routed(s, receiving, capacity, shared, output(at(End::Sender(s.into()))), credits));
        let senders = ends.collect();
        let ends = (0..receiving).zip(to_return);
        let ends = ends.map(|(r, credits)| Receiver::routed(r, sending, capacity, input(at(End::Receiver(r.into()))), credits));
        Network {
            senders,
            receivers: ends.collect(),
            routers,
            credit_return: Some(CreditReturn::new(freed, from_return)),
            map: NetworkMap::new(c.link_bytes, places),
        }
    }
}
