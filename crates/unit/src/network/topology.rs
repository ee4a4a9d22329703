//! Shapes of networks: which links there are, and which one leads to which receiver. No time here.
//!
//! A shape says where a sender's link leads, and where each router sends what is for a receiver. Everything else follows: all ways
//! from senders to receivers are walked once, the links that any of them takes are built and no others, and each router gets a
//! table. The way depends on router and receiver only, so that there is one way for each pair and order is kept on it.

use std::collections::{BTreeMap, BTreeSet};

use super::{ALL, MAX_ENDS, Topology};

/// The table's entry for what goes to all outputs at once.
pub(super) const EXPAND: u8 = 0xfe;

/// The table's entry for receivers that this router never sees anything for.
const NOWHERE: u8 = 0xff;

/// The place at which a link begins or ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum End {
    Sender(u16),
    Router(u16),
    Receiver(u16),
}

/// A link from one end to another.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct LinkPlan {
    pub from: End,
    pub to: End,
    /// Whether it is within a node, and short.
    pub near: bool,
}

/// A router: its links by their numbers, and the table.
#[derive(Clone, Debug)]
pub(super) struct RouterPlan {
    pub inputs: Vec<usize>,
    pub outputs: Vec<usize>,
    /// By receiver, and at [`ALL`], the place in `outputs`.
    pub table: Box<[u8; 256]>,
    /// The inputs from other routers, a bit each, if this router is on a ring; see [`Router`](super::Router).
    pub through: Option<u64>,
}

/// A network without its time.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub links: Vec<LinkPlan>,
    pub routers: Vec<RouterPlan>,
}

/// A shape with its numbers.
#[derive(Clone, Copy, Debug)]
struct Shape {
    topology: Topology,
    senders: usize,
    receivers: usize,
    nodes: usize,
    /// Nodes in a row of the mesh.
    columns: usize,
    /// Inputs and outputs of a butterfly's switch.
    radix: usize,
    /// Stages of the butterfly.
    stages: u32,
}

impl Shape {
    fn new(topology: Topology, radix: usize, senders: usize, receivers: usize) -> Shape {
        let ends = senders.max(receivers);
        let columns = (1..).find(|columns| columns * columns >= ends).unwrap_or(1);
        let stages = (1..).find(|&stages| radix.pow(stages) >= ends).unwrap_or(1);
        let nodes = if topology == Topology::Butterfly { radix.pow(stages) } else { ends };
        Shape { topology, senders, receivers, nodes, columns, radix, stages }
    }

    /// The node of a sender. The fewer of senders and receivers are spread evenly.
    fn of_sender(&self, sender: usize) -> usize {
        sender * self.nodes / self.senders
    }

    /// The node of a receiver.
    fn of_receiver(&self, receiver: usize) -> usize {
        receiver * self.nodes / self.receivers
    }

    /// The router that a sender's link leads to.
    fn entry(&self, sender: usize) -> usize {
        match self.topology {
            Topology::PointToPoint | Topology::Bus | Topology::Crossbar => 0,
            Topology::Ring | Topology::Mesh => self.of_sender(sender),
            Topology::Butterfly => self.switch(0, self.of_sender(sender)),
        }
    }

    /// The switch of a butterfly that a line enters at a stage.
    fn switch(&self, stage: u32, line: usize) -> usize {
        let weight = self.radix.pow(self.stages - 1 - stage);
        let within = line / (weight * self.radix) * weight + line % weight;
        stage as usize * (self.nodes / self.radix) + within
    }

    /// The next end on the path from a router to a receiver.
    fn step(&self, router: usize, receiver: usize) -> End {
        let node = self.of_receiver(receiver);
        let arrived = End::Receiver(receiver as u16);
        let next = match self.topology {
            Topology::PointToPoint | Topology::Crossbar => return arrived,
            // The arbiter, and what the receivers listen to.
            Topology::Bus if router == 0 => 1,
            Topology::Bus => return arrived,
            Topology::Ring | Topology::Mesh if router == node => return arrived,
            Topology::Ring => {
                let up = (node + self.nodes - router) % self.nodes;
                // Halfway round, even nodes go up and odd ones down.
                let goes_up = 2 * up < self.nodes || 2 * up == self.nodes && router.is_multiple_of(2);
                if goes_up { (router + 1) % self.nodes } else { (router + self.nodes - 1) % self.nodes }
            }
            Topology::Mesh => self.mesh_step(router, node),
            Topology::Butterfly => {
                // Stage by stage the line's digits become those of the receiver's line, the highest first.
                let switches = self.nodes / self.radix;
                let (stage, switch) = ((router / switches) as u32, router % switches);
                if stage + 1 == self.stages {
                    return arrived;
                }
                let weight = self.radix.pow(self.stages - 1 - stage);
                let digit = node / weight % self.radix;
                self.switch(stage + 1, switch / weight * weight * self.radix + digit * weight + switch % weight)
            }
        };
        End::Router(next as u16)
    }

    /// First along the row, then along the column. From a last row too short to have the column: up first.
    fn mesh_step(&self, router: usize, node: usize) -> usize {
        let (x, y) = (router % self.columns, router / self.columns);
        let (to_x, to_y) = (node % self.columns, node / self.columns);
        if x != to_x {
            return match y * self.columns + to_x < self.nodes {
                true if to_x > x => router + 1,
                true => router - 1,
                false => router - self.columns,
            };
        }
        if to_y > y { router + self.columns } else { router - self.columns }
    }

    /// Whether a link is within a node.
    fn is_near(&self, from: End, to: End) -> bool {
        let of_end = matches!(from, End::Sender(_)) || matches!(to, End::Receiver(_));
        of_end && matches!(self.topology, Topology::Bus | Topology::Ring | Topology::Mesh)
    }
}

impl Plan {
    /// The links and routers of a topology; none of either for direct channels, which take no router.
    pub fn new(topology: Topology, radix: u32, senders: usize, receivers: usize) -> Plan {
        debug_assert!((1..=MAX_ENDS).contains(&senders) && (1..=MAX_ENDS).contains(&receivers));
        if topology == Topology::PointToPoint {
            return Plan { links: Vec::new(), routers: Vec::new() };
        }
        let shape = Shape::new(topology, radix as usize, senders, receivers);
        // 1. Walk all ways.
        let mut links = BTreeSet::new();
        let mut routes = BTreeMap::new();
        for sender in 0..senders {
            for receiver in 0..receivers {
                let mut at = shape.entry(sender);
                links.insert((End::Sender(sender as u16), End::Router(at as u16)));
                loop {
                    let next = shape.step(at, receiver);
                    links.insert((End::Router(at as u16), next));
                    routes.insert((at as u16, receiver as u16), next);
                    let End::Router(router) = next else { break };
                    at = usize::from(router);
                }
            }
        }
        // 2. Number the routers that are on one.
        let mut numbers = BTreeMap::new();
        for &(router, _) in routes.keys() {
            let number = numbers.len() as u16;
            numbers.entry(router).or_insert(number);
        }
        let renumbered = |end| match end {
            End::Router(router) => End::Router(numbers[&router]),
            end => end,
        };
        let links = links.into_iter().map(|(from, to)| LinkPlan {
            from: renumbered(from),
            to: renumbered(to),
            near: shape.is_near(from, to),
        });
        let links: Vec<LinkPlan> = links.collect();
        // 3. Give each its links and its table.
        let router = |number: u16| {
            let here = End::Router(number);
            let links = &links;
            let of = |end: fn(&LinkPlan) -> End| (0..links.len()).filter(move |&link| end(&links[link]) == here);
            RouterPlan {
                inputs: of(|link| link.to).collect(),
                outputs: of(|link| link.from).collect(),
                table: Box::new([NOWHERE; 256]),
                through: None,
            }
        };
        let mut routers: Vec<RouterPlan> = (0..numbers.len() as u16).map(router).collect();
        for (&(router, receiver), &next) in &routes {
            let plan = &mut routers[usize::from(numbers[&router])];
            let next = renumbered(next);
            let output = plan.outputs.iter().position(|&link| links[link].to == next).unwrap_or(usize::from(NOWHERE));
            plan.table[usize::from(receiver)] = output as u8;
        }
        if topology == Topology::Ring {
            for plan in &mut routers {
                let of_router = |&(_, &link): &(usize, &usize)| matches!(links[link].from, End::Router(_));
                plan.through = Some(plan.inputs.iter().enumerate().filter(of_router).map(|(place, _)| 1 << place).sum());
            }
        }
        if topology == Topology::Bus {
            routers[0].table[usize::from(ALL)] = 0;
            routers[1].table[usize::from(ALL)] = EXPAND;
        }
        Plan { links, routers }
    }

    /// The links on the way from a sender to a receiver, in order.
    #[cfg(test)]
    pub fn way(&self, sender: usize, receiver: usize) -> Vec<usize> {
        let first = self.links.iter().position(|link| link.from == End::Sender(sender as u16)).expect("a sender's link");
        let mut way = vec![first];
        while let End::Router(router) = self.links[way[way.len() - 1]].to {
            let plan = &self.routers[usize::from(router)];
            way.push(plan.outputs[usize::from(plan.table[receiver])]);
        }
        way
    }
}
