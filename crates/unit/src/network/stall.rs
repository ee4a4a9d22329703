//! Why units at the ends of the network stall.

use sim::Tick;

/// Why a unit at an end of the network stalls: the state of a [`StallProbe`](sim::StallProbe).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Stall {
    /// It does not stall, or not because of the network.
    #[default]
    None,
    /// Nothing has come.
    NoInput,
    /// The tokens that have come are not next in order.
    OutOfOrder,
    /// The network does not take what is to be sent.
    NetworkFull,
    /// The receiver has no place for what is to be sent.
    ReceiverFull,
    /// Data from memory have not come.
    Memory,
}

impl Stall {
    /// Why a unit stalls that takes in its pipeline's work, by what it did in a cycle.
    #[inline(always)]
    pub fn of_front(did: Tick) -> Stall {
        match did {
            Tick::Starved => Stall::NoInput,
            Tick::Memory => Stall::Memory,
            _ => Stall::None,
        }
    }
}
