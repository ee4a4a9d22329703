//! What a unit is.

use super::Wires;
use super::sheet::Counted;
use num::Cycle;
use stats::{Cycles, Why};

/// What a unit did in a cycle. A tick of several stages is the greatest of what they did ([`Tick::or`]).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Tick {
    /// Nothing, and nothing is left to do; not the same as waiting for an input that may come, which is `Starved`.
    Idle,
    /// Nothing: the input was empty.
    Starved,
    /// Nothing moved, but an item is being worked on until a cycle given to [`Wires::sleep_until`]. Accounted as busy.
    Working,
    /// Nothing: data from memory have not come.
    Memory,
    /// Nothing: an output has no room.
    Blocked,
    /// Something moved: the unit ticks again in the next cycle.
    Moved,
}

impl Tick {
    /// What two stages of one unit did: the greater of both, so that a unit is busy if any stage moved, and blocked rather
    /// than starved if its last stage has no room and its first no input.
    #[inline(always)]
    #[must_use]
    pub fn or(self, other: Tick) -> Tick {
        if other as u8 > self as u8 { other } else { self }
    }

    /// `Moved` if `moved`, else the reason.
    #[inline(always)]
    pub fn moved_or(moved: bool, reason: Tick) -> Tick {
        if moved { Tick::Moved } else { reason }
    }

    /// The account's class.
    #[inline(always)]
    pub(super) fn why(self) -> Why {
        const CLASSES: [Why; 6] = [Why::Idle, Why::Starved, Why::Busy, Why::Memory, Why::Blocked, Why::Busy];
        CLASSES[self as usize]
    }
}

/// A unit of a machine whose units share a context `C` (the work that tokens point into).
///
/// The context carries what is behind a token. A unit may read what belongs to the machine as a whole, and read and write
/// what belongs to a token that it holds; anything else would bring back the order of ticks.
pub trait Unit<C>: Sized + 'static {
    /// One cycle: stages last to first, so that what a stage hands on makes room for the stage before it. The rules that let a
    /// unit sleep stand in the documentation of [`sim`](super).
    fn tick(&mut self, wires: &mut Wires, context: &mut C) -> Tick;

    /// Items done since the start, in the unit's own coin (its documentation says which).
    fn items(&self) -> u64;

    /// Items inside the unit now. When a run ends it must be 0.
    fn resident(&self) -> u64;

    /// The account of the cycles before `cycle`. `account` is the one that the results of its ticks give. A unit that holds items for long
    /// attributes the cycles in which it held some more exactly here, and gives the number of items held, summed over the cycles. The sum of
    /// the account stays, and so do the idle cycles.
    fn account(&self, account: Cycles, _cycle: Cycle) -> (Cycles, u64) {
        (account, 0)
    }

    /// Its groups of counters, in addition to items and cycles: each is named here and nowhere else.
    fn counted(_: &mut Counted<Self>) {}
}
