//! The loop that runs a machine, and the watchdog that stops it.

use std::fmt::Write;

use super::circuit::Circuit;
use crate::num::{Cycle, NEVER};

/// How time goes on. Statistics are the same under both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// Every unit ticks in every cycle.
    EveryCycle,
    /// Units that cannot move sleep, and cycles in which all sleep are skipped.
    #[default]
    SkipIdle,
    /// Every unit ticks in every cycle, in an order that is drawn anew for each cycle from this seed: for tests, which look for
    /// a unit that sees what another one does in the same cycle.
    Shuffled(u64),
}

/// Puts the numbers of all units in an order that depends on seed and cycle.
pub(super) fn shuffle(order: &mut Vec<usize>, units: usize, seed: u64, now: Cycle) {
    order.clear();
    order.extend(0..units);
    let mut state = seed ^ now.wrapping_mul(0x9e37_79b9_7f4a_7c15);
    for left in (1..units).rev() {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        order.swap(left, ((state >> 33) % (left as u64 + 1)) as usize);
    }
}

/// A machine that has stopped moving before it was done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing moved from cycle {since} to cycle {cycle}; the machine is stuck\n{contents}")]
pub struct Stuck {
    /// The last cycle in which a unit moved something.
    pub since: Cycle,
    /// The cycle in which the watchdog gave up.
    pub cycle: Cycle,
    /// What every unit waits for and what every queue holds, a line each.
    pub contents: String,
}

/// Runs until `done`, which is asked before each cycle and must depend on moved items only. Returns with
/// [`Wires::now`](super::Wires::now) at the number of cycles gone by.
///
/// # Errors
/// [`Stuck`] if nothing moved for more than `patience` cycles, or if nothing can ever move.
pub fn run<K: Circuit>(
    machine: &mut K,
    context: &mut K::Context,
    clock: Clock,
    patience: Cycle,
    mut done: impl FnMut(&K, &K::Context) -> bool,
) -> Result<(), Stuck> {
    // An earlier run may have ended long after the last move: patience counts from here.
    let start = machine.wires().now();
    let units = machine.wires().unit_labels().len();
    let mut order = Vec::new();
    while !done(machine, context) {
        machine.wires_mut().begin_cycle();
        let next = match clock {
            Clock::EveryCycle => {
                machine.cycle::<true>(context);
                machine.wires().now() + 1
            }
            Clock::SkipIdle => {
                machine.cycle::<false>(context);
                machine.wires().next_event()
            }
            Clock::Shuffled(seed) => {
                shuffle(&mut order, units, seed, machine.wires().now());
                machine.cycle_in(&order, context);
                machine.wires().now() + 1
            }
        };
        let since = machine.wires().last_move().max(start);
        if next == NEVER || next - since > patience {
            let cycle = if next == NEVER { machine.wires().now() } else { since + patience };
            return Err(stuck(machine, since, cycle));
        }
        machine.wires_mut().advance(next);
    }
    Ok(())
}

#[cold]
fn stuck<K: Circuit>(machine: &K, since: Cycle, cycle: Cycle) -> Stuck {
    let wires = machine.wires();
    let (_, resident) = machine.tally();
    let mut contents = String::new();
    for (number, label) in wires.unit_labels().iter().enumerate() {
        let why = format!("{:?}", wires.account(number).why()).to_lowercase();
        let _ = writeln!(contents, "unit {label}: {why}, {} inside", resident[number]);
    }
    for line in wires.contents() {
        let _ = writeln!(contents, "channel {line}");
    }
    Stuck { since, cycle, contents }
}
