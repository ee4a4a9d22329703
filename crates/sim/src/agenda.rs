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
struct Entry {
    /// When the unit wakes: the truth. A bit on the wheel whose unit wakes later is out of date.
    wake: Cycle,
    account: Account,
}

/// Wake times and accounts of all units.
#[derive(Clone, Debug)]
pub struct Agenda {
    units: Vec<Entry>,
    /// For each 64 units and each cycle of the wheel, those that wake in it.
    wheel: Vec<[u64; WHEEL as usize]>,
    /// Cycles of the wheel with a unit, a bit each.
    occupied: u64,
    /// No unit that is not on the wheel wakes before this.
    far: Cycle,
    /// The units that may be due in this cycle.
    due: Vec<u64>,
}

impl Agenda {
    /// Every one of `units` units wakes in cycle 0.
    pub fn new(units: usize) -> Agenda {
        let words = units.div_ceil(64).max(1);
        let mut agenda = Agenda {
            units: vec![Entry { wake: 0, account: Account::new(0) }; units],
            wheel: vec![[0; WHEEL as usize]; words],
            occupied: 0,
            far: NEVER,
            due: vec![0; words],
        };
        agenda.wake_all(0);
        agenda
    }

    /// The account of a unit.
    pub fn account(&self, unit: usize) -> &Account {
        &self.units[unit].account
    }

    /// The accounts of all units.
    pub fn accounts(&self) -> impl Iterator<Item = &Account> {
        self.units.iter().map(|unit| &unit.account)
    }

    /// The accounts of all units.
    pub fn accounts_mut(&mut self) -> impl Iterator<Item = &mut Account> {
        self.units.iter_mut().map(|unit| &mut unit.account)
    }

    /// Every unit wakes in cycle `now`, which has not begun.
    pub fn wake_all(&mut self, now: Cycle) {
        for unit in 0..self.units.len() {
            self.set(unit, now, now);
        }
    }

    /// A unit sleeps until `cycle`, which is `now` or later. Returns its account.
    #[inline(always)]
    pub fn set(&mut self, unit: usize, cycle: Cycle, now: Cycle) -> &mut Account {
        let entry = &mut self.units[unit];
        entry.wake = cycle;
        if cycle < now + WHEEL {
            let slot = cycle % WHEEL;
            self.wheel[unit / 64][slot as usize] |= 1 << (unit % 64);
            self.occupied |= 1 << slot;
        } else {
            self.far = self.far.min(cycle);
        }
        &mut entry.account
    }

    /// A unit wakes in `cycle`, unless it does so before.
    #[inline(always)]
    pub fn wake(&mut self, unit: usize, cycle: Cycle, now: Cycle) {
        if cycle < self.units[unit].wake {
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
        for (due, units) in self.due.iter_mut().zip(&mut self.wheel) {
            *due = std::mem::take(&mut units[slot as usize]);
        }
        self.occupied &= !(1 << slot);
    }

    /// Puts units on the wheel that have come near.
    #[cold]
    fn approach(&mut self, now: Cycle) {
        self.far = NEVER;
        for unit in 0..self.units.len() {
            let cycle = self.units[unit].wake;
            if cycle >= now && cycle != NEVER {
                self.set(unit, cycle, now);
            }
        }
    }

    /// Words of a set of units.
    #[inline(always)]
    pub fn words(&self) -> usize {
        self.due.len()
    }

    /// Of units `64 word` and the 63 after it those that may be due, a bit each; [`Agenda::due`] says which are.
    #[inline(always)]
    pub fn candidates(&self, word: usize) -> u64 {
        self.due[word]
    }

    /// Whether a unit wakes in `now` or before.
    #[inline(always)]
    pub fn due(&self, unit: usize, now: Cycle) -> bool {
        self.units[unit].wake <= now
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
        assert_eq!((agenda.words(), agenda.candidates(0), agenda.candidates(2)), (3, u64::MAX, 3));
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
