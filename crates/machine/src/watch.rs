//! Reading a machine while it runs.

use num::Cycle;
use sim::Reading;

/// Reads a machine while it runs. It sees accounts as they are: that a unit without input has nothing left to do is only known where a frame
/// ends.
///
/// A clock that jumps over cycles in which nothing moves may jump over the cycle that is asked for. The reading then comes at the first cycle
/// that is visited, and says which one that is: between two readings all cycles are accounted for.
pub trait Watcher {
    /// The cycle from which the next reading is wanted.
    fn due(&self) -> Cycle;

    /// What units and channels have counted up to now.
    fn read(&mut self, reading: Reading);

    /// The accounts of a frame are closed: what was starved up to its end counts as idle. What follows is counted from here.
    fn settled(&mut self, reading: Reading);
}
