//! The funnel of a machine, by segment in flight.

use std::ops::{Index, IndexMut};

use work::Funnel;

/// The counts of each segment in flight, by its slot, and the sum of the counts of all segments before.
///
/// A unit counts for the segment whose token it holds. So the funnel of a draw is its own, whatever else is in the machine.
#[derive(Clone, Debug, Default)]
pub struct Funnels {
    slots: Vec<Funnel>,
    retired: Funnel,
}

impl Funnels {
    /// Funnels of `slots` slots, with nothing counted.
    pub fn new(slots: usize) -> Funnels {
        Funnels { slots: vec![Funnel::default(); slots], retired: Funnel::default() }
    }

    /// A segment has left the machine: what it has counted.
    pub fn retire(&mut self, slot: u16) -> Funnel {
        let own = std::mem::take(&mut self.slots[usize::from(slot)]);
        self.retired += own;
        own
    }

    /// The sum of the counts of all segments.
    pub fn total(&self) -> Funnel {
        self.slots.iter().fold(self.retired, |mut sum, own| {
            sum += *own;
            sum
        })
    }
}

impl Index<u16> for Funnels {
    type Output = Funnel;

    #[inline(always)]
    fn index(&self, slot: u16) -> &Funnel {
        &self.slots[usize::from(slot)]
    }
}

impl IndexMut<u16> for Funnels {
    #[inline(always)]
    fn index_mut(&mut self, slot: u16) -> &mut Funnel {
        &mut self.slots[usize::from(slot)]
    }
}
