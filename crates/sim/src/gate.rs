//! What other units did while one was in a state of its own.
//!
//! A unit's account says how long it was starved, not what for: that may be known several units away, where something waits for its
//! turn, or for a link. A gate joins the two. The unit that knows tells its state whenever that changes, and at each change the
//! accounts of those that hang on it are read. So it is known to the cycle how long each of them was starved in each state.

use super::agenda::Agenda;
use super::wires::UnitId;
use num::Cycle;

/// States of a gate.
pub const STATES: usize = 6;

/// The telling end of a gate: one for each, held by the unit that knows. The default is of none, to which telling is nothing.
#[derive(Debug)]
pub struct Gate(pub(super) u16);

impl Default for Gate {
    fn default() -> Gate {
        Gate(u16::MAX)
    }
}

/// What the units at a gate did in each of its states.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct GateCounts {
    /// By state, its cycles.
    pub cycles: [u64; STATES],
    /// For each unit, by its place in the order of declaration, and by state: how long it was at work or waited for data from memory,
    /// and how long its output had no room.
    pub held: Vec<(usize, [[u64; STATES]; 2])>,
}

impl GateCounts {
    /// What was counted since an earlier reading.
    pub fn since(&self, earlier: &GateCounts) -> GateCounts {
        let since = |now: [u64; STATES], then: [u64; STATES]| std::array::from_fn(|state| now[state] - then[state]);
        let both = |now: [[u64; STATES]; 2], then: [[u64; STATES]; 2]| [since(now[0], then[0]), since(now[1], then[1])];
        let held = self.held.iter().zip(&earlier.held).map(|(now, then)| (now.0, both(now.1, then.1)));
        GateCounts { cycles: since(self.cycles, earlier.cycles), held: held.collect() }
    }

    /// How long a unit was starved, or idle, in each state, and how long it was blocked; none if it does not hang on this gate.
    pub fn rested(&self, unit: usize) -> Option<[[u64; STATES]; 2]> {
        let (_, [held, blocked]) = self.held.iter().find(|(known, _)| *known == unit)?;
        Some([std::array::from_fn(|state| self.cycles[state] - held[state] - blocked[state]), *blocked])
    }
}

/// A gate and its counts.
#[derive(Debug, Default)]
pub(super) struct GateState {
    pub state: u8,
    since: Cycle,
    counts: GateCounts,
    /// Of each unit, the same from the beginning to the last change.
    before: Vec<[u64; 2]>,
}

impl GateState {
    pub fn new(units: &[UnitId]) -> GateState {
        let held = units.iter().map(|unit| (usize::from(unit.0), [[0; STATES]; 2])).collect();
        let counts = GateCounts { held, ..GateCounts::default() };
        GateState { counts, before: vec![[0; 2]; units.len()], ..GateState::default() }
    }

    /// The state is another from `now` on.
    #[inline(never)]
    pub fn change(&mut self, state: u8, now: Cycle, agenda: &Agenda) {
        let old = usize::from(self.state);
        self.counts.cycles[old] += now - self.since;
        for ((unit, held), before) in self.counts.held.iter_mut().zip(&mut self.before) {
            let cycles = agenda.account(*unit).held(now);
            held[0][old] += cycles[0] - before[0];
            held[1][old] += cycles[1] - before[1];
            *before = cycles;
        }
        self.since = now;
        self.state = state;
    }

    /// The counts up to `now`.
    pub fn counts(&self, now: Cycle, agenda: &Agenda) -> GateCounts {
        let mut counts = self.counts.clone();
        let state = usize::from(self.state);
        counts.cycles[state] += now - self.since;
        for ((unit, held), before) in counts.held.iter_mut().zip(&self.before) {
            let cycles = agenda.account(*unit).held(now);
            held[0][state] += cycles[0] - before[0];
            held[1][state] += cycles[1] - before[1];
        }
        counts
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num::NEVER;
    use stats::Why;

    #[test]
    fn a_units_rest_is_parted_by_the_state_of_its_gate() {
        let mut agenda = Agenda::new(2);
        let mut gate = GateState::new(&[UnitId(1)]);
        let note = |at, why, agenda: &mut Agenda| agenda.set(1, NEVER, at).note(at, why);
        note(0, Why::Starved, &mut agenda);
        gate.change(2, 3, &agenda);
        note(5, Why::Busy, &mut agenda);
        note(8, Why::Blocked, &mut agenda);
        gate.change(0, 10, &agenda);
        let early = gate.counts(11, &agenda);
        assert_eq!(early.cycles, [4, 0, 7, 0, 0, 0]);
        assert_eq!(early.rested(1), Some([[3, 0, 2, 0, 0, 0], [1, 0, 2, 0, 0, 0]]));
        assert_eq!(early.rested(0), None);
        // A reading changes nothing, and the difference of two is what happened between.
        note(12, Why::Idle, &mut agenda);
        let late = gate.counts(20, &agenda).since(&early);
        assert_eq!(late.rested(1), Some([[8, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]));
    }
}
