//! Reading a machine while it runs.

use num::{Cycle, NEVER};
use sim::{Reading, Wires};
use unit::card::Card;

/// Reads a machine while it runs. It sees accounts as they are: that a unit without input has nothing left to do is only known where a frame
/// ends.
///
/// A clock that jumps over cycles in which nothing moves may jump over the cycle that is asked for. It is read all the same, when the clock has
/// landed: accounts and channels say what they were at any cycle of a jump. So readings do not depend on the clock.
pub trait Watcher {
    /// The cycle of the next reading, behind that of the last.
    fn due(&self) -> Cycle;

    /// What units and channels have counted up to that cycle, or to the end of a frame.
    fn read(&mut self, reading: Reading);

    /// The accounts of a frame are closed: what was starved up to its end counts as idle. What follows is counted from here.
    fn settled(&mut self, reading: Reading);

    /// The cycle of the next look at items, behind that of the last.
    fn looks(&self) -> Cycle {
        NEVER
    }

    /// Looks at the items that channels carry, and at what they stand for, before that cycle begins. What has moved since the last look has
    /// moved in the cycle before this one if every cycle is looked at. `resident` gives the items inside of each unit.
    fn look(&mut self, _wires: &Wires, _card: &Card, _resident: &dyn Fn() -> Vec<u64>) {}
}

impl<W: Watcher + ?Sized> Watcher for &mut W {
    fn due(&self) -> Cycle {
        (**self).due()
    }

    fn read(&mut self, reading: Reading) {
        (**self).read(reading);
    }

    fn settled(&mut self, reading: Reading) {
        (**self).settled(reading);
    }

    fn looks(&self) -> Cycle {
        (**self).looks()
    }

    fn look(&mut self, wires: &Wires, card: &Card, resident: &dyn Fn() -> Vec<u64>) {
        (**self).look(wires, card, resident);
    }
}
