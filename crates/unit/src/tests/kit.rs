//! Generator, echo, checker, memory; and the run that must come out the same whatever the clock.

use std::collections::VecDeque;
use std::fmt::Debug;

use crate::card::Card;
use mem::{IdealConfig, MemoryConfig, MemoryPlan, MemoryPort, PortShape};
use num::Cycle;
use sim::{Circuit, Clock, In, Link, Out, Tick, Token, Unit, UnitId, Wires, Wiring, run};

/// Pushes its items in order, each as soon as it can and not before its cycle.
pub struct TokenSource<T> {
    pub items: Vec<(Cycle, T)>,
    next: usize,
    output: Out<T>,
}

impl<T> TokenSource<T> {
    pub fn new(items: Vec<(Cycle, T)>, output: Out<T>) -> TokenSource<T> {
        TokenSource { items, next: 0, output }
    }
}

impl<T: Token> Unit<Card> for TokenSource<T> {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(&(at, item)) = self.items.get(self.next) {
            if at > wires.now() {
                wires.sleep_until(at);
                return did.or(Tick::Working);
            }
            if !wires.try_push(&self.output, item) {
                return did.or(Tick::Blocked);
            }
            self.next += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.next as u64
    }

    fn resident(&self) -> u64 {
        (self.items.len() - self.next) as u64
    }
}

/// Takes whatever comes, and notes when.
pub struct Sink<T> {
    pub got: Vec<(Cycle, T)>,
    input: In<T>,
}

impl<T> Sink<T> {
    pub fn new(input: In<T>) -> Sink<T> {
        Sink { got: Vec::new(), input }
    }

    /// When each item came.
    pub fn times(&self) -> Vec<Cycle> {
        self.got.iter().map(|&(at, _)| at).collect()
    }

    /// When each item came, and what of it matters.
    pub fn log<R>(&self, of: impl Fn(&T) -> R) -> Vec<(Cycle, R)> {
        self.got.iter().map(|(at, item)| (*at, of(item))).collect()
    }
}

impl<T: Token> Unit<Card> for Sink<T> {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(item) = wires.pop(&self.input) {
            self.got.push((wires.now(), item));
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.got.len() as u64
    }

    fn resident(&self) -> u64 {
        0
    }
}

/// Answers each item `after` cycles after it came, and notes when it came.
pub struct Echo<T, U = T> {
    pub got: Vec<(Cycle, T)>,
    after: Cycle,
    held: VecDeque<(Cycle, T)>,
    of: fn(T, &mut Card) -> U,
    input: In<T>,
    output: Out<U>,
}

impl<T> Echo<T> {
    /// An echo that sends back the item that came.
    pub fn new(after: Cycle, input: In<T>, output: Out<T>) -> Echo<T> {
        Echo::answering(after, |item, _| item, input, output)
    }
}

impl<T, U> Echo<T, U> {
    /// An echo that sends back what `of` makes of the item.
    pub fn answering(after: Cycle, of: fn(T, &mut Card) -> U, input: In<T>, output: Out<U>) -> Echo<T, U> {
        Echo { got: Vec::new(), after, held: VecDeque::new(), of, input, output }
    }

    /// When each item came.
    pub fn times(&self) -> Vec<Cycle> {
        self.got.iter().map(|&(at, _)| at).collect()
    }
}

impl<T: Token, U: Token> Unit<Card> for Echo<T, U> {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(item) = wires.pop(&self.input) {
            self.got.push((wires.now(), item));
            self.held.push_back((wires.now() + self.after, item));
            did = Tick::Moved;
        }
        while let Some(&(at, item)) = self.held.front() {
            if at > wires.now() {
                wires.sleep_until(at);
                return did.or(Tick::Working);
            }
            if !wires.can_push(&self.output) {
                return did.or(Tick::Blocked);
            }
            let answer = (self.of)(item, card);
            wires.push(&self.output, answer);
            self.held.pop_front();
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.got.len() as u64
    }

    fn resident(&self) -> u64 {
        self.held.len() as u64
    }
}

/// A channel that is never in the way.
pub const FREE: Link = Link::items(4096, 4096, 1);

/// Bytes per cycle of each memory port here.
pub const PORT: u32 = 64;

/// Cycles on a port, each way.
const PORT_LATENCY: u32 = 2;

/// Cycles that the memory here takes; its bandwidth is never in the way.
const MEMORY_LATENCY: u32 = 50;

/// Cycles from the request to the answer of a read, on a port with nothing else on it: two ways, the memory, and of the answer's
/// bytes all but those that the port carries in its first cycle.
pub const fn round_trip(bytes: u32) -> Cycle {
    (2 * PORT_LATENCY + MEMORY_LATENCY + bytes.div_ceil(PORT) - 1) as Cycle
}

/// The cycle in which write `number` of a row of writes of `bytes` bytes can be sent, counted from the first: each takes its
/// bytes and 8 of a header, and the port begins the next as soon as it has bytes left in a cycle.
pub const fn write_time(number: u32, bytes: u32) -> Cycle {
    (number * (bytes + 8) / PORT) as Cycle
}

/// An ideal memory, declared after all other units.
pub fn memory(wiring: &mut Wiring) -> MemoryPlan {
    let ideal = IdealConfig { latency: MEMORY_LATENCY, bytes_per_cycle: 1 << 16 };
    MemoryPlan::declare(MemoryConfig::Ideal(ideal), wiring).expect("a memory")
}

/// A port to it.
pub fn port(plan: &mut MemoryPlan, wiring: &mut Wiring, unit: UnitId) -> MemoryPort {
    plan.client(wiring, "port", 0, unit, PortShape { width: PORT, latency: PORT_LATENCY, queue: 256 })
}

/// Runs a circuit until it is done, under every clock and in several orders of ticks. All of them must take as many cycles, leave
/// the same statistics, and give what is read from the circuit at its end, which is returned.
pub fn settle<K: Circuit<Context = Card>, R: PartialEq + Debug>(
    make: impl Fn() -> (K, Card),
    done: impl Fn(&K, &Card) -> bool,
    read: impl Fn(&K, &Card) -> R,
) -> R {
    let outcome = |clock| {
        let (mut circuit, mut card) = make();
        run(&mut circuit, &mut card, clock, 10_000, &done).unwrap_or_else(|stuck| panic!("{clock:?}: {stuck}"));
        assert_eq!(card.fault, None, "{clock:?}");
        circuit.wires_mut().settle();
        for unit in circuit.reading().units {
            assert_eq!(unit.total(), circuit.wires().now(), "{clock:?}: the account of a unit");
        }
        (circuit.wires().now(), circuit.tree().json().to_string(), card.funnel.total(), read(&circuit, &card))
    };
    let expected = outcome(Clock::EveryCycle);
    for clock in [Clock::SkipIdle, Clock::Shuffled(1), Clock::Shuffled(2), Clock::Shuffled(3)] {
        assert_eq!(outcome(clock), expected, "{clock:?} against every cycle");
    }
    expected.3
}
