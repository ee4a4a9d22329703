//! Warps: invocations that run in lockstep. A warp is too large for a token, so it lies here and tokens carry its number.

use std::collections::VecDeque;

use super::token::GroupToken;
use gfx::stage::Stage;
use work::{Class, Cost, CostId, CostTable, InFlight, Point, RequestKind, Service, ServiceMap, Step};

/// Most invocations of a warp.
pub const MAX_WIDTH: u32 = 64;

knob::choices! {
    /// What a warp executes where its parts take different paths, and in which order.
    pub enum Execution {
        /// Step by step the most that any part needs, class by class, in no order.
        Longest "longest",
        /// Every instruction that a part needs, once for all parts that need it at the time; in no order.
        Lockstep "lockstep",
        /// The same, in the order of the program.
        InOrder "in-order",
    }
}

/// A part of a warp with a cost of its own: a quad, a vertex, or four invocations of a workgroup.
#[derive(Clone, Copy, Debug, Default)]
pub struct Item {
    /// The place of its cost and requests. For a quad, the tile in its segment; else 0.
    pub source: u32,
    /// Its next request to each service. That to the constant cache is set where the warp has any.
    pub next: ServiceMap<u32>,
    /// Its cost.
    pub cost: CostId,
}

impl Item {
    /// A part with this cost, whose first request among those of `source` is number `request`.
    pub fn new(source: u32, request: u32, cost: CostId) -> Item {
        let mut item = Item { source, cost, ..Item::default() };
        item.next[Service::Texture] = request;
        item
    }
}

/// A warp.
#[derive(Clone, Debug, Default)]
pub struct Warp {
    /// Its number among the warps that its cluster has made, from 1.
    pub serial: u64,
    /// The stage whose program it runs.
    pub stage: Stage,
    /// Slot of its segment or workgroups.
    pub slot: u16,
    /// Registers of one invocation.
    pub registers: u32,
    /// Its parts.
    pub items: Vec<Item>,
    /// How its parts' paths become what it executes.
    pub execution: Execution,
    /// The steps that it executes.
    pub steps: Vec<Step>,
    /// Which parts make the request of each step, where paths are followed; else none, and the parts' own steps say it.
    takes: Vec<u64>,
    /// The instructions of all steps in order, and where those of each step end; none where they have no order.
    runs: Vec<(Class, u32)>,
    run_ends: Vec<u32>,
    /// The step it is in.
    pub step: u32,
    /// The steps whose requests each unit has still to look at, in order: a warp may be in a later one.
    pub asked: ServiceMap<VecDeque<u32>>,
    /// Whether a step of a part asks another service than the texture unit.
    pub apart: bool,
    /// Whether all parts take the same path.
    pub uniform: bool,
    /// Groups of quads, of a fragment warp, in order.
    pub groups: Vec<GroupToken>,
    /// Whether it has been shaded.
    pub done: bool,
    /// Its place in its core.
    pub place: u32,
    /// Vertex batch, or workgroup.
    pub number: u32,
    /// Warps of its workgroup.
    pub siblings: u32,
    /// Bytes of workgroup memory of its group.
    pub shared_bytes: u32,
}

impl Warp {
    /// Merges the paths of the parts into the steps that the warp executes, once all parts are in.
    ///
    /// By [`Execution::Longest`], parts that differ run in lockstep as far as they agree in what a step ends with, which is exact
    /// for loops of different length and for early exits; a branch whose two sides both run is counted as the longer side
    /// (deliberate deviation: its costs name no reconvergence points). The others follow the parts' paths, if they are recorded.
    pub fn merge<'a>(&mut self, table: impl Fn(&Item) -> &'a CostTable) {
        (self.step, self.apart) = (0, false);
        self.asked.values_mut().for_each(VecDeque::clear);
        self.steps.clear();
        self.takes.clear();
        self.runs.clear();
        self.run_ends.clear();
        self.uniform = true;
        self.merge_paths(&table);
        if self.apart {
            // Loads from uniform buffers stand behind all other requests.
            for item in &mut self.items {
                let others = table(item)[item.cost].asking().filter(|step| step.then != RequestKind::Constant);
                item.next[Service::Constant] = item.next[Service::Texture] + others.count() as u32;
            }
        }
    }

    fn merge_paths<'a>(&mut self, table: &impl Fn(&Item) -> &'a CostTable) {
        let is_apart = |step: &Step| step.then.service().is_some_and(|service| service != Service::Texture);
        if self.execution != Execution::Longest && self.follow(table) {
            self.apart = self.steps.iter().any(is_apart);
            return;
        }
        let Some(first) = self.items.first() else { return };
        let cost: &Cost = &table(first)[first.cost];
        self.steps.extend_from_slice(&cost.steps);
        self.apart = self.steps.iter().any(is_apart);
        let mut last = (first.source, first.cost);
        for at in 1..self.items.len() {
            let item = self.items[at];
            if (item.source, item.cost) == last {
                continue;
            }
            last = (item.source, item.cost);
            let other = &table(&item)[item.cost];
            if self.uniform && other.steps == self.steps {
                continue;
            }
            self.uniform = false;
            for (k, step) in other.steps.iter().enumerate() {
                match self.steps.get_mut(k) {
                    Some(mine) => {
                        for class in 0..Class::COUNT {
                            mine.instructions[class] = mine.instructions[class].max(step.instructions[class]);
                            mine.chain[class] = mine.chain[class].max(step.chain[class]);
                        }
                        mine.in_flight = mine.in_flight.and(step.in_flight);
                        if mine.then == RequestKind::End {
                            mine.then = step.then;
                        }
                        self.apart |= is_apart(step);
                    }
                    None => {
                        self.apart |= is_apart(step);
                        self.steps.push(*step);
                    }
                }
            }
        }
    }
}

impl Warp {
    /// Follows the paths of the parts through the program: those that have got least far go on, so that parts meet again where
    /// branches end and loops are left. False where a path was not recorded.
    #[cold]
    fn follow<'a>(&mut self, table: &impl Fn(&Item) -> &'a CostTable) -> bool {
        let mut paths: Vec<(&CostTable, &[Point])> = Vec::with_capacity(self.items.len());
        for item in &self.items {
            let table = table(item);
            let path = table[item.cost].path.as_slice();
            if path.is_empty() {
                return false;
            }
            paths.push((table, path));
        }
        self.uniform = false;
        let (mut instructions, mut chain) = ([0; Class::COUNT], [0; Class::COUNT]);
        let mut in_flight = InFlight::ANY;
        let at = |(table, path): &(&CostTable, &[Point])| path.first().map(|point| table.spans[point.span as usize].at);
        while let Some(least) = paths.iter().filter_map(at).min() {
            let (mut takes, mut then, mut begun) = (0, RequestKind::End, false);
            for (part, entry) in paths.iter_mut().enumerate() {
                let (table, path) = *entry;
                if at(entry) != Some(least) {
                    continue;
                }
                if !begun {
                    let span = &table.spans[path[0].span as usize];
                    chain.iter_mut().zip(span.chain).for_each(|(sum, count)| *sum += count);
                    for &(class, count) in &span.runs {
                        instructions[class as usize] += count;
                        self.run(class, count);
                    }
                    begun = true;
                }
                in_flight = in_flight.and(path[0].in_flight);
                if path[0].then != RequestKind::End {
                    then = path[0].then;
                    takes |= 1_u64 << part;
                }
                entry.1 = &path[1..];
            }
            if then != RequestKind::End {
                let (instructions, chain) = (std::mem::take(&mut instructions), std::mem::take(&mut chain));
                let in_flight = std::mem::replace(&mut in_flight, InFlight::ANY);
                self.end_step(Step { instructions, chain, in_flight, then }, takes);
            }
        }
        self.end_step(Step { instructions, chain, in_flight, then: RequestKind::End }, 0);
        true
    }

    /// Appends `count` instructions of a class, if the order of instructions counts.
    fn run(&mut self, class: Class, count: u32) {
        if self.execution != Execution::InOrder {
            return;
        }
        let begin = self.run_ends.last().map_or(0, |&end| end as usize);
        match self.runs[begin..].last_mut() {
            Some((last, sum)) if *last == class => *sum += count,
            _ => self.runs.push((class, count)),
        }
    }

    fn end_step(&mut self, step: Step, takes: u64) {
        self.steps.push(step);
        self.takes.push(takes);
        self.run_ends.push(self.runs.len() as u32);
    }

    /// The instructions of a step in order; none where they have no order.
    pub fn order(&self, step: u32) -> &[(Class, u32)] {
        let step = step as usize;
        let Some(&end) = self.run_ends.get(step) else { return &[] };
        let begin = if step == 0 { 0 } else { self.run_ends[step - 1] };
        &self.runs[begin as usize..end as usize]
    }

    /// The step whose request a unit looks at.
    #[inline(always)]
    pub fn asking(&self, unit: Service) -> u32 {
        self.asked[unit].front().copied().unwrap_or(self.step)
    }

    /// The request that ends a step for a part with this cost.
    #[inline(always)]
    pub fn then<'a>(&self, step: u32, part: usize, cost: impl FnOnce() -> &'a Cost) -> RequestKind {
        let step = step as usize;
        if self.uniform {
            return self.steps[step].then;
        }
        match self.takes.get(step) {
            Some(takes) if takes >> part & 1 != 0 => self.steps[step].then,
            Some(_) => RequestKind::End,
            None => cost().steps.get(step).map_or(RequestKind::End, |step| step.then),
        }
    }
}

/// The warps of a cluster of cores.
#[derive(Clone, Debug, Default)]
pub struct Warps {
    execution: Execution,
    made: u64,
    warps: Vec<Warp>,
    free: Vec<u32>,
}

impl Warps {
    /// None, of a cluster that executes warps so.
    pub fn new(execution: Execution) -> Warps {
        Warps { execution, ..Warps::default() }
    }

    /// An empty warp. What it holds keeps its memory from use to use.
    pub fn insert(&mut self, stage: Stage, slot: u16, registers: u32) -> u32 {
        let index = self.free.pop().unwrap_or_else(|| {
            self.warps.push(Warp::default());
            (self.warps.len() - 1) as u32
        });
        let warp = &mut self.warps[index as usize];
        warp.items.clear();
        warp.groups.clear();
        warp.steps.clear();
        self.made += 1;
        (warp.serial, warp.stage, warp.slot, warp.registers) = (self.made, stage, slot, registers);
        warp.execution = self.execution;
        (warp.step, warp.done, warp.number, warp.siblings, warp.shared_bytes) = (0, false, 0, 1, 0);
        index
    }

    /// Gives a warp up.
    pub fn remove(&mut self, index: u32) {
        self.free.push(index);
    }

    /// The warps held, by index.
    pub fn held(&self) -> impl Iterator<Item = &Warp> {
        let mut free = vec![false; self.warps.len()];
        self.free.iter().for_each(|&index| free[index as usize] = true);
        self.warps.iter().zip(free).filter_map(|(warp, free)| (!free).then_some(warp))
    }

    /// Warps held.
    pub fn len(&self) -> usize {
        self.warps.len() - self.free.len()
    }

    /// Whether the pool holds no warp.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
}

impl std::ops::Index<u32> for Warps {
    type Output = Warp;

    #[inline(always)]
    fn index(&self, index: u32) -> &Warp {
        &self.warps[index as usize]
    }
}

impl std::ops::IndexMut<u32> for Warps {
    #[inline(always)]
    fn index_mut(&mut self, index: u32) -> &mut Warp {
        &mut self.warps[index as usize]
    }
}
