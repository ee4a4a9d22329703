//! Who wakes when: a wheel of the next 64 cycles, each a set of units, and the rest by their number.
//!
//! A machine has some fifty units of which about ten tick in a cycle; looking at every unit's wake time took a tenth of all time.

use crate::num::{Cycle, NEVER};

/// Cycles that the wheel holds.
const WHEEL: u64 = 64;

/// Wake times of all units.
#[derive(Clone, Debug)]
pub struct Agenda {
    /// When each unit wakes: the truth. A bit on the wheel whose unit wakes later is out of date.
    wake: Vec<Cycle>,
    /// Words of a set of units.
    words: usize,
    /// For each cycle of the wheel, the units that wake in it.
    wheel: Vec<u64>,
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
            wake: vec![0; units],
            words,
            wheel: vec![0; words * WHEEL as usize],
            occupied: 0,
            far: NEVER,
            due: vec![0; words],
        };
        agenda.wake_all(0);
        agenda
    }

    /// Every unit wakes in cycle `now`, which has not begun.
    pub fn wake_all(&mut self, now: Cycle) {
        for unit in 0..self.wake.len() {
            self.set(unit, now, now);
        }
    }

    /// A unit sleeps until `cycle`, which is `now` or later.
    #[inline(always)]
    pub fn set(&mut self, unit: usize, cycle: Cycle, now: Cycle) {
        self.wake[unit] = cycle;
        if cycle < now + WHEEL {
            let slot = cycle % WHEEL;
            self.wheel[slot as usize * self.words + unit / 64] |= 1 << (unit % 64);
            self.occupied |= 1 << slot;
        } else {
            self.far = self.far.min(cycle);
        }
    }

    /// A unit wakes in `cycle`, unless it does so before.
    #[inline(always)]
    pub fn wake(&mut self, unit: usize, cycle: Cycle, now: Cycle) {
        if cycle < self.wake[unit] {
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
        let start = slot as usize * self.words;
        for (due, units) in self.due.iter_mut().zip(&mut self.wheel[start..start + self.words]) {
            *due = std::mem::take(units);
        }
        self.occupied &= !(1 << slot);
    }

    /// Puts units on the wheel that have come near.
    #[cold]
    fn approach(&mut self, now: Cycle) {
        self.far = NEVER;
        for unit in 0..self.wake.len() {
            let cycle = self.wake[unit];
            if cycle >= now && cycle != NEVER {
                self.set(unit, cycle, now);
            }
        }
    }

    /// Of `count` units (at most 64) from `base` on those that may be due; [`Agenda::due`] says which are.
    #[inline(always)]
    pub fn candidates(&self, base: usize, count: usize) -> u64 {
        let (word, shift) = (base / 64, base % 64);
        let mut bits = self.due[word] >> shift;
        if shift + count > 64 {
            bits |= self.due[word + 1] << (64 - shift);
        }
        bits & (u64::MAX >> (64 - count))
    }

    /// Whether a unit wakes in `now` or before.
    #[inline(always)]
    pub fn due(&self, unit: usize, now: Cycle) -> bool {
        self.wake[unit] <= now
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
        assert_eq!(agenda.candidates(0, 64), u64::MAX);
        assert_eq!(agenda.candidates(100, 30), u64::MAX >> 34);
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
                if agenda.candidates(unit, 1) == 1 && agenda.due(unit, now) {
                    woken[unit] = now;
                    agenda.set(unit, NEVER, now);
                }
            }
        }
        assert_eq!(woken, expected);
    }
}
