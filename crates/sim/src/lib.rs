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
//!
//! # Example
//!
//! A queue before a worker that is slower than the source:
//!
//! ```
//! use sim::kit::{Sink, Source, Worker};
//! use sim::{Circuit, Clock, Link, One, Wiring, run};
//!
//! sim::circuit! {
//!     /// The units in the order of the data flow.
//!     struct Queue for () {
//!         source: One<Source>,
//!         worker: One<Worker>,
//!         sink: One<Sink>,
//!     }
//! }
//!
//! let mut wiring = Wiring::new();
//! let [source, worker, sink] = ["source", "worker", "sink"].map(|name| wiring.unit(name, 0));
//! let (offer, offered) = wiring.channel("offered", 0, Link::items(4, 1, 1), source, worker);
//! let (finish, finished) = wiring.channel("finished", 0, Link::items(4, 1, 1), worker, sink);
//! let (source, worker, sink) = (Source::new(10, 1, offer), Worker::new(3, offered, finish), Sink::new(1, finished));
//! let mut queue = Queue::new(wiring, One(source), One(worker), One(sink));
//! run(&mut queue, &mut (), Clock::SkipIdle, 100, |queue, ()| queue.sink.log.len() == 10)?;
//!
//! // The first item waits one cycle in each channel and three cycles in the worker. The others follow every three cycles.
//! assert_eq!(queue.wires().now(), 5 + 9 * 3 + 1);
//! // The account is closed: the worker, which waits for an item now, is idle.
//! queue.wires_mut().settle();
//! assert_eq!(queue.tree().number("units.worker[0].starved"), Some(1.0));
//! # Ok::<(), sim::Stuck>(())
//! ```

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
pub use wires::{CAPACITY, CHANNELS, In, MEAN_OCCUPANCY, Out, Reading, Token, UNITS, UnitCounts, UnitId, Wire, Wires};
pub use wiring::Wiring;

// For the code that `circuit!` makes.
#[doc(hidden)]
pub use num::Cycle;

#[cfg(test)]
mod tests;
