//! A unit of your own, in a circuit small enough to be followed by hand.
//!
//! ```text
//! source ──requests──► coalesce ──reads──► memory
//! ```
//!
//! The source asks for words of memory, one after another. The unit hands on one read per memory line. The memory takes a read in every eighth
//! cycle.
//!
//! `cargo run --example your_unit` prints what the unit counted and what its cycles went to. `docs/architecture.md` says how a unit
//! becomes part of a card.

use fillrate::sim::kit::{Item, Sink, Source};
use fillrate::sim::{Budget, Circuit, Clock, In, Link, One, Out, Stuck, Tick, Unit, Wires, Wiring, run};
use fillrate::stats::Group;

fillrate::stats::counters! {
    /// The counters of the unit, in addition to its items and to the account of its cycles, which every unit has.
    pub struct CoalesceCounts {
        /// Requests for the line of the request before them, which need no read of their own.
        joined: "requests",
    }
}

/// The unit. Its items are requests.
pub struct Coalesce {
    /// Configuration: requests per cycle, and words per memory line.
    rate: u32,
    words: u64,
    /// State: the line of the last read.
    line: Option<u64>,
    items: u64,
    counts: CoalesceCounts,
    /// The ends of the two channels.
    input: In<Item>,
    output: Out<Item>,
}

impl Unit<()> for Coalesce {
    fn tick(&mut self, wires: &mut Wires, _: &mut ()) -> Tick {
        let mut budget = Budget::new(self.rate);
        // The account gives this cycle to what the tick returns: nothing came, there was no room, or something moved.
        let mut did = Tick::Starved;
        while budget.left() > 0 {
            let Some(request) = wires.front(&self.input) else { break };
            let line = request.number / self.words;
            if self.line == Some(line) {
                self.counts.joined += 1;
            } else if wires.try_push(&self.output, request) {
                self.line = Some(line);
            } else {
                return did.or(Tick::Blocked);
            }
            wires.take(&self.input);
            budget.spend();
            self.items += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        0
    }
}

fillrate::sim::circuit! {
    /// The units in the order of the data flow. Units of this circuit share nothing: their context is `()`.
    struct Example for () {
        source: One<Source>,
        coalesce: One<Coalesce>,
        memory: One<Sink>,
    }
}

/// Runs 256 requests through the circuit. Returns a text of what the unit did.
///
/// # Errors
/// If nothing can move any more although requests are left.
pub fn report(clock: Clock) -> Result<String, Stuck> {
    let mut wiring = Wiring::new();
    let [source, coalesce, memory] = ["source", "coalesce", "memory"].map(|name| wiring.unit(name, 0));
    // Capacity, items per cycle, and cycles from the push of an item to its pop.
    let (requests, input) = wiring.channel("requests", 0, Link::items(64, 4, 10), source, coalesce);
    let (output, reads) = wiring.channel("reads", 0, Link::items(4, 1, 2), coalesce, memory);
    let unit = Coalesce { rate: 4, words: 16, line: None, items: 0, counts: CoalesceCounts::default(), input, output };
    let slow = Sink { rest: 8, ..Sink::new(1, reads) };
    let mut circuit = Example::new(wiring, One(Source::new(256, 4, requests)), One(unit), One(slow));
    run(&mut circuit, &mut (), clock, 100, |circuit, ()| circuit.memory.log.len() == 16)?;

    // The account is closed: a unit that waits for an input now is idle.
    circuit.wires_mut().settle();
    let account = circuit.wires().accounts().nth(1).expect("the account of the second unit");
    let counts = account.named().chain(circuit.coalesce.counts.named());
    let lines: String = counts.map(|(name, value)| format!("{name} {value}\n")).collect();
    Ok(format!("{} cycles, {} requests\n{lines}", circuit.wires().now(), circuit.coalesce.items))
}

fn main() -> Result<(), Stuck> {
    print!("{}", report(Clock::SkipIdle)?);
    Ok(())
}
