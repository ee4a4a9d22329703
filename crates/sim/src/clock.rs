//! The loop that runs a machine, and the watchdog that stops it.

use std::fmt::Write;

use super::circuit::Circuit;
use num::{Cycle, NEVER, OUR_FAULT, Random};

/// How time goes on. Statistics are the same under both.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Clock {
    /// Every unit ticks in every cycle.
    EveryCycle,
    /// Units that cannot move sleep, and cycles in which all sleep are skipped.
    #[default]
    SkipIdle,
    /// Every unit ticks in every cycle, in an order that is drawn anew for each cycle from this seed: for checks (unit tests and
    /// `fillrate accuracy clocks`), which look for a unit that sees what another one does in the same cycle.
    Shuffled(u64),
}

/// Puts the numbers of all units in an order that depends on seed and cycle.
pub(super) fn shuffle(order: &mut Vec<usize>, units: usize, seed: u64, now: Cycle) {
    order.clear();
    order.extend(0..units);
    Random::nth(seed, now).shuffle(order);
}

/// A machine that has stopped moving before it was done.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("nothing has moved since cycle {since}, and {cause}; the machine is stuck\n{OUR_FAULT}\n{contents}")]
pub struct Stuck {
    /// The last cycle in which a unit moved something.
    pub since: Cycle,
    /// How it is known that nothing will move any more.
    pub cause: Cause,
    /// What every unit waits for and what every queue holds, a line each.
    pub contents: String,
}

/// How it is known that a machine is stuck.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Cause {
    /// No unit waits for a known cycle, and nothing is on its way: the machine stays as it is for ever.
    #[error("nothing is on its way to any unit")]
    Dead,
    /// Units wake again and again, and none moves.
    #[error("units woke in {0} cycles without moving anything")]
    Restless(u64),
}

/// Runs until `done`, which is asked before each cycle and must depend on moved items only. Returns with
/// [`Wires::now`](super::Wires::now) at the number of cycles gone by.
///
/// How long a machine may wait is not bounded: a unit that knows the cycle in which it can go on, however far, is not stuck. Both
/// clocks keep what all units wait for, so a machine in which nothing is awaited any more is stopped at once. `patience` bounds
/// something else: how often units may wake, one after another, without one that moves. Of sound units that is fewer times than
/// there are questions to be asked ([`Wires::questions`](super::Wires)), which are added to `patience`; a unit that asks for ever is not sound.
///
/// # Errors
/// [`Stuck`] if nothing can ever move, or if units wake without moving more often than `patience` allows.
pub fn run<K: Circuit>(
    machine: &mut K,
    context: &mut K::Context,
    clock: Clock,
    patience: u64,
    mut done: impl FnMut(&K, &K::Context) -> bool,
) -> Result<(), Stuck> {
    let patience = patience.saturating_add(machine.wires().questions());
    let units = machine.wires().unit_labels().len();
    let mut order = Vec::new();
    // The cycle from which somebody was to wake, and how many such cycles have gone by since one of them was of use.
    let (mut awaited, mut fruitless) = (0, 0);
    while !done(machine, context) {
        machine.wires_mut().begin_cycle();
        match clock {
            Clock::EveryCycle => machine.cycle::<true>(context),
            Clock::SkipIdle => machine.cycle::<false>(context),
            Clock::Shuffled(seed) => {
                shuffle(&mut order, units, seed, machine.wires().now());
                machine.cycle_in(&order, context);
            }
        }
        let now = machine.wires().now();
        let next = machine.wires().next_event();
        if machine.wires().lives() {
            fruitless = 0;
        } else if next == NEVER {
            return Err(stuck(machine, Cause::Dead));
        } else if now >= awaited {
            fruitless += 1;
            if fruitless > patience {
                return Err(stuck(machine, Cause::Restless(fruitless)));
            }
        }
        awaited = next;
        machine.wires_mut().advance(if clock == Clock::SkipIdle { next } else { now + 1 });
    }
    Ok(())
}

#[cold]
fn stuck<K: Circuit>(machine: &K, cause: Cause) -> Stuck {
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
    Stuck { since: wires.last_move(), cause, contents }
}
