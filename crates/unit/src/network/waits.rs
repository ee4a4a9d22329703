//! What units at the ends of the network wait for.

use sim::Tick;

/// What a unit at an end of the network waits for: the state of a [`Gate`](sim::Gate).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Waits {
    /// For nothing, or nothing of the network.
    #[default]
    Open,
    /// For something to come.
    Nothing,
    /// For what is next in order; others have come.
    Order,
    /// For the network to take what is to be sent.
    Network,
    /// For a place at the receiver of what is to be sent.
    Place,
    /// For data from memory.
    Memory,
}

impl Waits {
    /// What a unit waits for that takes in its pipeline's work, by what it did in a cycle.
    #[inline(always)]
    pub fn of_front(did: Tick) -> Waits {
        match did {
            Tick::Starved => Waits::Nothing,
            Tick::Memory => Waits::Memory,
            _ => Waits::Open,
        }
    }
}
