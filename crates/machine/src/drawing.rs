//! Whether anything but a free-running display moves.

use sim::Circuit;

use crate::parts::Parts;

/// Drawing is stuck when no unit that draws has moved for this number of refreshes. A frame that waits for the display goes on once per refresh.
pub(super) const REFRESHES: u64 = 8;

/// Looks once per refresh at the units that draw. The display and memory, which serves it, move for ever, so that the watchdog of all units
/// sees nothing.
#[derive(Debug, Default)]
pub(super) struct Drawing {
    /// The cycle of the next look, and that of the last in which something had moved.
    due: u64,
    since: u64,
    /// Cycles in which those units moved, as of the last look.
    busy: u64,
    stuck: bool,
}

impl Drawing {
    /// Whether no unit that draws has moved for [`REFRESHES`] refreshes and for `patience` cycles.
    pub(super) fn is_stuck(&mut self, circuit: &Parts, patience: u64) -> bool {
        let now = circuit.wires().now();
        if now < self.due || self.stuck {
            return self.stuck;
        }
        // Before its first frame the display moves nothing.
        let Some(period) = circuit.scanout.period() else {
            (self.due, self.since) = (now + patience, now);
            return false;
        };
        // Units are declared in the order of the data flow: the display is behind all that draw, and memory behind the display.
        let wires = circuit.wires();
        let drawing = wires.units().zip(wires.accounts()).take_while(|((name, _), _)| *name != "scanout");
        let busy = drawing.map(|(_, cycles)| cycles.busy).sum();
        if busy != self.busy {
            (self.busy, self.since) = (busy, now);
        }
        self.due = now + period;
        self.stuck = now - self.since >= patience.max(REFRESHES.saturating_mul(period));
        self.stuck
    }

    /// What every unit that draws holds, a line each.
    pub(super) fn contents(circuit: &Parts) -> String {
        let held = circuit.tally().1;
        let units = circuit.wires().units().zip(held).take_while(|((name, _), _)| *name != "scanout");
        units.map(|((name, index), held)| format!("unit {name}[{index}]: {held} inside\n")).collect()
    }
}
