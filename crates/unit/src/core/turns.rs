//! A workgroup that is larger than its core: its warps run in turns.
//!
//! WebGPU lets a workgroup have 256 invocations on any card, a core here may hold 4. Cards that small have the compiler run a workgroup
//! as a loop over its invocations from barrier to barrier. So does the core: a warp at a barrier gives its place and registers to
//! the next one, and comes back when the whole group has arrived. Until then it is kept without cost, which is a deviation:
//! the loop of a real program keeps its variables in memory.

use std::collections::VecDeque;

use super::issue::bits;
use super::{Core, Resident};
use crate::card::Card;
use sim::Tick;

/// The workgroup that runs in turns.
#[derive(Clone, Debug)]
pub(super) struct Turns {
    /// Its number.
    pub number: u32,
    /// Its warps; the warps still to be taken in; the warps that are done.
    siblings: u32,
    pub coming: u32,
    ended: u32,
    /// Workgroup memory that it holds.
    shared: u32,
    /// Warps at the barrier, which hold no place.
    parked: Vec<Resident>,
    /// Warps past the barrier that have no place yet.
    waiting: VecDeque<Resident>,
}

impl Turns {
    pub fn new(number: u32, siblings: u32, shared: u32) -> Turns {
        let (parked, waiting) = (Vec::new(), VecDeque::new());
        Turns { number, siblings, coming: siblings, ended: 0, shared, parked, waiting }
    }

    /// Warps that hold no place.
    pub fn away(&self) -> usize {
        self.parked.len() + self.waiting.len()
    }
}

impl Core {
    /// A warp of a workgroup has left.
    #[cold]
    pub(super) fn end_turn(&mut self, resident: Resident) {
        let Some(turns) = self.turns.as_mut().filter(|turns| turns.number == resident.number) else { return };
        turns.ended += 1;
        if turns.ended == turns.siblings {
            self.shared += turns.shared;
            self.turns = None;
        }
    }

    /// Warps at the barrier give up their places; when all of the group are there they may go on, and do as there are places.
    #[cold]
    pub(super) fn turn(&mut self, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let Some(mut turns) = self.turns.take() else { return did };
        // 1. Warps that wait at the barrier make place.
        for place in bits(self.issue.barrier) {
            if !self.is_of_group(place, turns.number) {
                continue;
            }
            let resident = self.resident[place as usize];
            self.issue.barrier &= !(1 << place);
            self.held &= !(1 << place);
            self.registers += resident.registers;
            turns.parked.push(resident);
            did = Tick::Moved;
        }
        // 2. All are there that have not ended.
        let arrived = turns.parked.len() as u32;
        if arrived > 0 && arrived + turns.ended == turns.siblings {
            for resident in turns.parked.drain(..) {
                card.warps[self.cluster][resident.warp].step += 1;
                turns.waiting.push_back(resident);
            }
            did = Tick::Moved;
        }
        // 3. They go on in the order in which they came.
        while let Some(&resident) = turns.waiting.front() {
            let registers = self.asked(card.warps[self.cluster][resident.warp].registers);
            let Some(registers) = self.place_for(registers) else { break };
            self.settle(card, Resident { registers, ..resident });
            turns.waiting.pop_front();
            did = Tick::Moved;
        }
        self.turns = Some(turns);
        did
    }

    /// The registers of a warp whose invocations have `registers` registers each.
    pub(super) fn asked(&self, registers: u32) -> u32 {
        self.config.registers_of(registers)
    }

    /// The registers granted to a warp that asks for `registers`. None if the core has no free place or too few registers. A warp that asks
    /// for more than the whole core has runs alone, as if it spilled without cost.
    #[inline(always)]
    pub(super) fn place_for(&self, registers: u32) -> Option<u32> {
        let alone = registers > self.config.registers && self.held == 0;
        let room = self.registers >= registers + self.config.left_over(registers) || alone;
        (self.held != self.all && room).then_some(registers.min(self.registers))
    }

    /// A warp takes the first free place and begins its step.
    #[inline(always)]
    pub(super) fn settle(&mut self, card: &Card, resident: Resident) {
        let place = (self.all & !self.held).trailing_zeros();
        self.registers -= resident.registers;
        self.resident[place as usize] = resident;
        self.held |= 1 << place;
        self.fixed.take(place, self.born);
        self.hours.take(place, self.born);
        self.born += 1;
        self.enter_step(card, place);
    }

    /// Whether the place holds a warp of a workgroup.
    pub(super) fn is_of_group(&self, place: u32, number: u32) -> bool {
        let resident = &self.resident[place as usize];
        resident.stage.has_workgroups() && resident.number == number
    }
}
