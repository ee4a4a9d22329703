//! Stall probes: what some units did while another unit was in each of its states.
//!
//! A unit's account says how long it was starved, but not why. Another unit, several links away, may know the reason: it waits for the
//! next token in order, or for a link. A probe joins the two. The unit that knows the reason sets the state of the probe. At each
//! change of the state, the probe reads the accounts of the units that it watches. So it counts, to the cycle, how long each watched
//! unit was starved in each state.

use super::agenda::Agenda;
use super::wires::UnitId;
use num::Cycle;

/// States of a probe.
pub const STATES: usize = 6;

/// The handle by which a unit sets the state of a probe ([`Wires::set_probe`](super::Wires::set_probe)). Each probe has one. The default
/// belongs to no probe; setting its state does nothing.
#[derive(Clone, Debug)]
pub struct StallProbe(pub(super) u16);

impl Default for StallProbe {
    fn default() -> StallProbe {
        StallProbe(u16::MAX)
    }
}

/// What the watched units did in each state of a probe.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StallProbeCounts {
    /// By state, its cycles.
    pub cycles: [u64; STATES],
    /// For each unit, by its place in the order of declaration, and by state: how long it was at work or waited for data from memory,
    /// and how long its output had no room.
    pub held: Vec<(usize, [[u64; STATES]; 2])>,
}

impl StallProbeCounts {
    /// What was counted since an earlier reading.
    pub fn since(&self, earlier: &StallProbeCounts) -> StallProbeCounts {
        let since = |now: [u64; STATES], then: [u64; STATES]| std::array::from_fn(|state| now[state] - then[state]);
        let both = |now: [[u64; STATES]; 2], then: [[u64; STATES]; 2]| [since(now[0], then[0]), since(now[1], then[1])];
        let held = self.held.iter().zip(&earlier.held).map(|(now, then)| (now.0, both(now.1, then.1)));
        StallProbeCounts { cycles: since(self.cycles, earlier.cycles), held: held.collect() }
    }

    /// How long a unit was starved, or idle, in each state, and how long it was blocked; none if this probe does not watch it.
    pub fn rested(&self, unit: usize) -> Option<[[u64; STATES]; 2]> {
        let (_, [held, blocked]) = self.held.iter().find(|(known, _)| *known == unit)?;
        Some([std::array::from_fn(|state| self.cycles[state] - held[state] - blocked[state]), *blocked])
    }
}

/// A probe and its counts.
#[derive(Clone, Debug, Default)]
pub(super) struct StallProbeState {
    pub state: u8,
    since: Cycle,
    counts: StallProbeCounts,
    /// Of each unit, the same from the beginning to the last change.
    before: Vec<[u64; 2]>,
}

impl StallProbeState {
    pub fn new(units: &[UnitId]) -> StallProbeState {
        let held = units.iter().map(|unit| (usize::from(unit.0), [[0; STATES]; 2])).collect();
        let counts = StallProbeCounts { held, ..StallProbeCounts::default() };
        StallProbeState { counts, before: vec![[0; 2]; units.len()], ..StallProbeState::default() }
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
    pub fn counts(&self, now: Cycle, agenda: &Agenda) -> StallProbeCounts {
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
    fn a_units_rest_is_counted_by_the_state_of_its_probe() {
        let mut agenda = Agenda::new(2);
        let mut probe = StallProbeState::new(&[UnitId(1)]);
        let note = |at, why, agenda: &mut Agenda| agenda.set(1, NEVER, at).note(at, why);
        note(0, Why::Starved, &mut agenda);
        probe.change(2, 3, &agenda);
        note(5, Why::Busy, &mut agenda);
        note(8, Why::Blocked, &mut agenda);
        probe.change(0, 10, &agenda);
        let early = probe.counts(11, &agenda);
        assert_eq!(early.cycles, [4, 0, 7, 0, 0, 0]);
        assert_eq!(early.rested(1), Some([[3, 0, 2, 0, 0, 0], [1, 0, 2, 0, 0, 0]]));
        assert_eq!(early.rested(0), None);
        // A reading changes nothing, and the difference of two is what happened between.
        note(12, Why::Idle, &mut agenda);
        let late = probe.counts(20, &agenda).since(&early);
        assert_eq!(late.rested(1), Some([[8, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, 0]]));
    }
}
