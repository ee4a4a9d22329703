//! Floor 1: time. Channels, units, clocks and the watchdog; no graphics.
//!
//! A machine is a [`circuit!`](crate::circuit): units joined by channels.
//!
//! * A **channel** is a bounded queue with capacity, width and latency ([`Link`]). An item pushed in cycle t can be popped from
//!   t + latency; a slot freed in t can be filled from t + 1. A unit therefore never sees what another unit does in the same
//!   cycle, and the order in which units tick changes nothing.
//! * A **unit** ([`Unit`]) is configuration, state, counters and a `tick`. It reads and writes its channels through [`Wires`]
//!   and says what it did ([`Tick`]).
//! * A **clock** ([`Clock`]) ticks every unit in every cycle, or only those that could move, jumping over cycles in which none
//!   can. Both leave the same statistics.
//!
//! # How a unit sleeps
//!
//! Nobody lists what a unit waits for. Each question that [`Wires`] answers with no ("is there an item?", "is there room?")
//! notes what would change the answer: a cycle if it is known (the item is on its way, the slot was freed just now), else a mark
//! on the channel that the other end's next push or pop turns into a cycle. A unit that moved nothing sleeps until the earliest
//! cycle so noted. Three rules make this exact:
//!
//! 1. A tick that moves nothing changes no state, save noting.
//! 2. A tick that moves nothing has asked at least one question whose answer was no, or called [`Wires::sleep_until`], or is
//!    waiting for nothing at all.
//! 3. The reason that a tick gives depends only on the unit's state and on answers it was given.
//!
//! Between two ticks of a sleeping unit all those answers stay the same (a unit's own pushes and pops are all that can turn a
//! yes into a no), so the reason given last holds for the whole sleep and is accounted for in one step. A broken rule shows as a
//! difference between the two clocks, which every machine's tests look for.
//!
//! A machine is stuck when no unit moves and none waits for a known cycle. How long it may wait for one is not bounded, so no
//! configuration is slow enough to be taken for stuck. Against a unit that breaks the rules and wakes for ever, fruitless wake-ups
//! are counted ([`run`]).
//!
//! The reason for a stall may be known several units away. The unit that knows it sets the state of a [`StallProbe`] in every tick. By rule
//! 3 the state holds until that unit's next tick. Whenever the state changes, the probe reads the accounts of the units that it watches.
//!
//! # Alternatives measured
//!
//! Channels as typed fields of the machine and every unit polled in every cycle, against channels behind indices and units that
//! sleep, as here: 80 units in a ring with two channels from each to the next, nanoseconds per cycle on one quiet core.
//!
//! | moving | polled, typed | here |
//! |---|---|---|
//! | all 160 channels | 620 | 1280 |
//! | a quarter of them | 250 | 520 |
//! | one in twenty | 120 | 130 |
//! | none for a while | 120 per cycle | skipped |
//!
//! Polling is cheaper per transfer, because it keeps no wake times, but each poll of a real unit is a tick that looks at all of
//! its queues, and it cannot skip. Channels in arrays of fixed size instead of `Vec`s, so that indices are masked and not checked,
//! gained nothing; units in groups of 64 did. A unit trait object per tick was not pursued: it forbids inlining, and a machine's units are known when it is
//! compiled.

mod agenda;
mod budget;
mod channel;
mod circuit;
mod clock;
pub mod kit;
mod sheet;
mod stall_probe;
mod unit;
mod wires;
mod wiring;

#[doc(hidden)]
pub use agenda::GROUP;
pub use budget::Budget;
pub use channel::{ChannelCounts, Link};
pub use circuit::{Bank, Circuit, One, assemble, places};
pub use clock::{Cause, Clock, Stuck, run};
pub use sheet::{Counted, Description, Sheet, Sum};
pub use stall_probe::{STATES, StallProbe, StallProbeCounts};
pub use unit::{Tick, Unit};
pub use wires::{CHANNELS, In, Out, Reading, Token, UNITS, UnitCounts, UnitId, Wire, Wires};
pub use wiring::Wiring;

#[cfg(test)]
mod tests;
