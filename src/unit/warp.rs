//! Warps: invocations that run in lockstep. A warp is too large for a token, so it lies here and tokens carry its number.

use super::card::Card;
use super::token::GroupToken;
use crate::work::{Class, Cost, CostId, CostTable, RequestKind, Step};

/// Most invocations of a warp.
pub const MAX_WIDTH: u32 = 64;

/// What a warp runs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Program {
    /// Quads of fragments.
    #[default]
    Fragment,
    /// Vertices.
    Vertex,
    /// Invocations of a workgroup.
    Compute,
}

impl Program {
    /// In the order in which a core takes their warps in: vertices first, since fragments wait for them.
    pub const ALL: [Program; 3] = [Program::Vertex, Program::Compute, Program::Fragment];
}

/// What has a cost of its own in a warp: a quad, a vertex, or four invocations of a workgroup.
#[derive(Clone, Copy, Debug, Default)]
pub struct Item {
    /// Where its cost and requests are: of a quad the tile in its segment; else 0.
    pub source: u32,
    /// Its next memory request.
    pub request: u32,
    /// Its cost.
    pub cost: CostId,
}

/// A warp.
#[derive(Clone, Debug, Default)]
pub struct Warp {
    /// What it runs.
    pub program: Program,
    /// Slot of its segment or workgroups.
    pub slot: u16,
    /// Registers of one invocation.
    pub registers: u32,
    /// Its parts.
    pub items: Vec<Item>,
    /// What it executes: where its parts take different paths, step by step the most that any part needs.
    pub steps: Vec<Step>,
    /// The step it is in.
    pub step: u32,
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
    /// Parts that differ run in lockstep as far as they agree in what a step ends with, which is exact for loops of different
    /// length and for early exits; a branch whose two sides both run is counted as the longer side (deliberate deviation: costs
    /// name no reconvergence points).
    pub fn merge<'a>(&mut self, table: impl Fn(&Item) -> &'a CostTable) {
        self.step = 0;
        self.steps.clear();
        self.uniform = true;
        let Some(first) = self.items.first() else { return };
        let cost: &Cost = &table(first)[first.cost];
        self.steps.extend_from_slice(&cost.steps);
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
                        }
                        if mine.then == RequestKind::End {
                            mine.then = step.then;
                        }
                    }
                    None => self.steps.push(*step),
                }
            }
        }
    }
}

/// The cost table that an item's cost is in.
#[inline(always)]
pub fn costs<'a>(card: &'a Card, program: Program, slot: u16, item: &Item) -> &'a CostTable {
    match program {
        Program::Fragment => &card.work(slot).segment.tiles[item.source as usize].costs,
        Program::Vertex => &card.work(slot).segment.costs,
        Program::Compute => &card.compute(slot).groups.costs,
    }
}

/// The warps of a cluster of cores.
#[derive(Clone, Debug, Default)]
pub struct Warps {
    warps: Vec<Warp>,
    free: Vec<u32>,
}

impl Warps {
    /// An empty warp. What it holds keeps its memory from use to use.
    pub fn insert(&mut self, program: Program, slot: u16, registers: u32) -> u32 {
        let index = self.free.pop().unwrap_or_else(|| {
            self.warps.push(Warp::default());
            (self.warps.len() - 1) as u32
        });
        let warp = &mut self.warps[index as usize];
        warp.items.clear();
        warp.groups.clear();
        warp.steps.clear();
        (warp.program, warp.slot, warp.registers) = (program, slot, registers);
        (warp.step, warp.done, warp.number, warp.siblings, warp.shared_bytes) = (0, false, 0, 1, 0);
        index
    }

    /// Gives a warp up.
    pub fn remove(&mut self, index: u32) {
        self.free.push(index);
    }

    /// Warps held.
    pub fn len(&self) -> usize {
        self.warps.len() - self.free.len()
    }

    /// Whether none is held.
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
