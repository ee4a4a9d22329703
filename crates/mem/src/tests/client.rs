//! A client that sends a list of requests and notes when they were sent and answered.

use crate::{AccessKind, MemoryPort};
use num::Cycle;
use sim::{Tick, Unit, Wires};

/// What to do: not before `from`, and with what.
#[derive(Clone, Copy, Debug)]
pub struct Order {
    pub from: Cycle,
    pub kind: AccessKind,
    pub address: u64,
    pub bytes: u32,
}

impl Order {
    pub fn read(from: Cycle, address: u64, bytes: u32) -> Order {
        Order { from, kind: AccessKind::Read, address, bytes }
    }

    pub fn write(from: Cycle, address: u64, bytes: u32) -> Order {
        Order { from, kind: AccessKind::Write, address, bytes }
    }
}

pub struct Client {
    pub orders: Vec<Order>,
    pub next: usize,
    pub sent: Vec<Cycle>,
    /// By order, the cycle of the answer.
    pub answered: Vec<Option<Cycle>>,
    pub answers: u64,
    pub expected: u64,
    pub port: MemoryPort,
}

impl Client {
    pub fn new(orders: Vec<Order>, port: MemoryPort) -> Client {
        let answered = vec![None; orders.len()];
        let expected = orders.iter().filter(|order| order.kind.is_answered()).count() as u64;
        Client { orders, next: 0, sent: Vec::new(), answered, answers: 0, expected, port }
    }

    pub fn done(&self) -> bool {
        self.next == self.orders.len() && self.answers == self.expected
    }

    /// Cycles from sending to the answer.
    pub fn latency(&self, order: usize) -> Cycle {
        self.answered[order].unwrap() - self.sent[order]
    }
}

impl<C> Unit<C> for Client {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut did = if self.answers < self.expected { Tick::Memory } else { Tick::Idle };
        while let Some(tag) = self.port.answer(wires) {
            assert_eq!(self.answered[tag as usize], None, "one answer a request");
            self.answered[tag as usize] = Some(wires.now());
            self.answers += 1;
            did = Tick::Moved;
        }
        while let Some(&order) = self.orders.get(self.next) {
            if order.from > wires.now() {
                wires.sleep_until(order.from);
                break;
            }
            if !self.port.can_send(wires) {
                did = did.or(Tick::Blocked);
                break;
            }
            let tag = self.next as u32;
            match order.kind {
                AccessKind::Read => self.port.read(wires, order.address, order.bytes, tag),
                AccessKind::Write => self.port.write(wires, order.address, order.bytes),
                AccessKind::Atomic => self.port.atomic(wires, order.address, order.bytes, tag),
            }
            self.sent.push(wires.now());
            self.next += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.answers
    }

    fn resident(&self) -> u64 {
        0
    }
}
