//! "N per cycle" is a budget that is spent.

/// What a unit may still do in this cycle.
#[derive(Clone, Copy, Debug)]
pub struct Budget {
    left: u32,
}

impl Budget {
    /// The budget of a cycle.
    #[inline(always)]
    pub fn new(a_cycle: u32) -> Budget {
        Budget { left: a_cycle }
    }

    /// Spends one if there is one.
    #[inline(always)]
    pub fn spend(&mut self) -> bool {
        self.take(1)
    }

    /// Spends `amount` if there is as much.
    #[inline(always)]
    pub fn take(&mut self, amount: u32) -> bool {
        let enough = self.left >= amount;
        if enough {
            self.left -= amount;
        }
        enough
    }

    /// What is left.
    #[inline(always)]
    pub fn left(&self) -> u32 {
        self.left
    }
}
