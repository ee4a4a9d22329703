//! The way back: how a sender learns that a receiver has room again.

use bytemuck::{Pod, Zeroable};

use super::next_from;
use sim::{In, Out, Tick, Unit, Wires};

/// Places that have become free at a receiver for a sender's parcels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Credit {
    /// The sender.
    pub sender: u8,
    /// The receiver.
    pub receiver: u8,
    /// Places.
    pub count: u16,
}

/// Brings credits from all receivers to all senders. Its items are messages delivered.
///
/// It never holds a receiver up: what a sender is owed is a number for each receiver, which grows while the message waits. So no
/// sender's silence keeps credits from another.
#[derive(Clone, Debug)]
pub struct CreditReturn {
    /// From each receiver.
    inputs: Vec<In<Credit>>,
    /// To each sender.
    outputs: Vec<Out<Credit>>,
    /// By sender and then receiver.
    owed: Vec<u16>,
    /// By sender, the receivers that owe it something.
    debtors: Vec<u64>,
    /// Senders that are owed something.
    creditors: u64,
    /// By sender, the receiver whose credits it gets next, if there are any.
    turn: Vec<u8>,
    items: u64,
}

impl CreditReturn {
    pub(super) fn new(inputs: Vec<In<Credit>>, outputs: Vec<Out<Credit>>) -> CreditReturn {
        CreditReturn {
            owed: vec![0; inputs.len() * outputs.len()],
            debtors: vec![0; outputs.len()],
            creditors: 0,
            turn: vec![0; outputs.len()],
            items: 0,
            inputs,
            outputs,
        }
    }
}

impl<C> Unit<C> for CreditReturn {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut moved = false;
        // 1. All that has come is noted.
        for input in &self.inputs {
            while let Some(credit) = wires.pop(input) {
                let (sender, receiver) = (usize::from(credit.sender), usize::from(credit.receiver));
                self.owed[sender * self.inputs.len() + receiver] += credit.count;
                self.debtors[sender] |= 1 << receiver;
                self.creditors |= 1 << sender;
                moved = true;
            }
        }
        // 2. Each sender that is owed something gets the credits of as many receivers as its link carries.
        let mut creditors = self.creditors;
        while creditors != 0 {
            let sender = creditors.trailing_zeros() as usize;
            creditors &= creditors - 1;
            while self.debtors[sender] != 0 && wires.can_push(&self.outputs[sender]) {
                let receiver = next_from(self.debtors[sender], self.turn[sender]);
                self.turn[sender] = (receiver as u8 + 1) % 64;
                let count = std::mem::take(&mut self.owed[sender * self.inputs.len() + receiver]);
                wires.push(&self.outputs[sender], Credit { sender: sender as u8, receiver: receiver as u8, count });
                self.debtors[sender] &= !(1 << receiver);
                self.items += 1;
                moved = true;
            }
            if self.debtors[sender] == 0 {
                self.creditors &= !(1 << sender);
            }
        }
        let why = if self.creditors != 0 { Tick::Blocked } else { Tick::Starved };
        wires.stop(Tick::moved_or(moved, why), why)
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.debtors.iter().map(|debtors| u64::from(debtors.count_ones())).sum()
    }
}
