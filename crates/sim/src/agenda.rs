//! Who wakes when: a wheel of the next 64 cycles, each a set of units, and the rest by their number.
//!
//! A machine has some fifty units of which about ten tick in a cycle; looking at every unit's wake time took a tenth of all time.

use num::{Cycle, NEVER};
use stats::Account;

/// Cycles that the wheel holds.
const WHEEL: u64 = 64;

/// What every tick of a unit touches, in one cache line of the host.
#[derive(Clone, Debug)]
#[repr(align(64))]
struct UnitAgenda {
    /// When the unit wakes: the truth. A bit on the wheel whose unit wakes later is out of date.
    wake: Cycle,
    account: Account,
}

/// Units that are numbered one after another.
pub const GROUP: usize = 64;

/// Up to [`GROUP`] units. All that the tick of a unit touches is found with one comparison of its number: that of the group.
#[derive(Clone, Debug)]
#[repr(C, align(64))]
struct Group {
    /// Places beyond the last unit never wake.
    units: [UnitAgenda; GROUP],
    /// For each cycle of the wheel, those that wake in it.
    wheel: [u64; WHEEL as usize],
    /// Those that may be due in this cycle.
    due: u64,
}

/// Wake times and accounts of all units.
#[derive(Clone, Debug)]
pub struct Agenda {
    groups: Vec<Group>,
    units: usize,
    /// Cycles of the wheel with a unit, a bit each.
    occupied: u64,
    /// No unit that is not on the wheel wakes before this.
    far: Cycle,
}

impl Agenda {
    /// Every one of `units` units wakes in cycle 0.
    pub fn new(units: usize) -> Agenda {
        let nobody = UnitAgenda { wake: NEVER, account: Account::new(0) };
        let group = Group { units: std::array::from_fn(|_| nobody.clone()), wheel: [0; WHEEL as usize], due: 0 };
        let mut agenda = Agenda { groups: vec![group; units.div_ceil(GROUP).max(1)], units, occupied: 0, far: NEVER };
        agenda.wake_all(0);
        agenda
    }

    /// The account of a unit.
    pub fn account(&self, unit: usize) -> &Account {
        &self.groups[unit / GROUP].units[unit % GROUP].account
    }

    /// The accounts of all units.
    pub fn accounts(&self) -> impl Iterator<Item = &Account> {
        self.groups.iter().flat_map(|group| &group.units).take(self.units).map(|unit| &unit.account)
    }

    /// The accounts of all units.
    pub fn accounts_mut(&mut self) -> impl Iterator<Item = &mut Account> {
        self.groups.iter_mut().flat_map(|group| &mut group.units).take(self.units).map(|unit| &mut unit.account)
    }

    /// Every unit wakes in cycle `now`, which has not begun.
    pub fn wake_all(&mut self, now: Cycle) {
        for unit in 0..self.units {
            self.set(unit, now, now);
        }
    }

    /// A unit sleeps until `cycle`, which is `now` or later. Returns its account.
    #[inline(always)]
    pub fn set(&mut self, unit: usize, cycle: Cycle, now: Cycle) -> &mut Account {
        let group = &mut self.groups[unit / GROUP];
        let entry = &mut group.units[unit % GROUP];
        entry.wake = cycle;
        if cycle < now + WHEEL {
            let slot = cycle % WHEEL;
            group.wheel[slot as usize] |= 1 << (unit % GROUP);
            self.occupied |= 1 << slot;
        } else {
            self.far = self.far.min(cycle);
        }
        &mut entry.account
    }

    /// A unit wakes in `cycle`, unless it does so before.
    #[inline(always)]
    pub fn wake(&mut self, unit: usize, cycle: Cycle, now: Cycle) {
        if cycle < self.groups[unit / GROUP].units[unit % GROUP].wake {
            self.set(unit, cycle, now);
        }
    }

    /// Cycle `now` begins.
    #[inline(always)]
    pub fn begin(&mut self, now: Cycle) {
        if self.far < now + WHEEL {
            self.approach(now);
        }
        let slot = now % WHEEL;
        let begin = |group: &mut Group| group.due = std::mem::take(&mut group.wheel[slot as usize]);
        // Most machines have one group, and what a loop does before its first turn is done in every cycle.
        if let Some((first, others)) = self.groups.split_first_mut() {
            begin(first);
            if !others.is_empty() {
                others.iter_mut().for_each(begin);
            }
        }
        self.occupied &= !(1 << slot);
    }

    /// Puts units on the wheel that have come near.
    #[cold]
    fn approach(&mut self, now: Cycle) {
        self.far = NEVER;
        for unit in 0..self.units {
            let cycle = self.groups[unit / GROUP].units[unit % GROUP].wake;
            if cycle >= now && cycle != NEVER {
                self.set(unit, cycle, now);
            }
        }
    }

    /// Of the units of a group those that may be due in this cycle, a bit each; [`Agenda::due`] says which are.
    #[inline(always)]
    pub fn candidates(&self, group: usize) -> u64 {
        self.groups[group].due
    }

    /// Whether a unit wakes in `now` or before.
    #[inline(always)]
    pub fn due(&self, unit: usize, now: Cycle) -> bool {
        self.groups[unit / GROUP].units[unit % GROUP].wake <= now
    }

    /// A cycle after `now` before which no unit wakes; [`NEVER`] if none ever does.
    #[inline(always)]
    pub fn next(&self, now: Cycle) -> Cycle {
        let start = (now + 1) % WHEEL;
        let ahead = self.occupied.rotate_right(start as u32);
        let near = if ahead == 0 { NEVER } else { now + 1 + u64::from(ahead.trailing_zeros()) };
        near.min(self.far)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_wake_when_they_said() {
        let mut agenda = Agenda::new(130);
        agenda.begin(0);
        assert_eq!((agenda.groups.len(), agenda.candidates(0), agenda.candidates(2)), (3, u64::MAX, 3));
        let mut expected: Vec<Cycle> = (0..130).map(|unit| 1 + (unit * unit * 37) % 700).collect();
        for (unit, &cycle) in expected.iter().enumerate() {
            agenda.set(unit, cycle, 0);
        }
        // One is woken before its time; the earlier bit of another is out of date.
        agenda.wake(7, 3, 0);
        expected[7] = expected[7].min(3);
        agenda.set(9, 650, 0);
        expected[9] = 650;
        let (mut now, mut woken) = (0, vec![NEVER; 130]);
        loop {
            now = agenda.next(now);
            if now == NEVER {
                break;
            }
            agenda.begin(now);
            for unit in 0..130 {
                if agenda.candidates(unit / 64) >> (unit % 64) & 1 == 1 && agenda.due(unit, now) {
                    woken[unit] = now;
                    agenda.set(unit, NEVER, now);
                }
            }
        }
        assert_eq!(woken, expected);
    }
}
