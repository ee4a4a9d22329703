//! Work counted against a limit, from any number of threads.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};

use super::limits::{Limit, LimitExceeded, LimitOverrun};

/// Counts work of one kind.
///
/// Whether a sum passes the limit does not depend on the order in which threads add to it. So threads may add what they have done, and
/// look whether the sum is over; they all stop in every run, or in none.
#[derive(Debug)]
pub struct Meter {
    limit: Limit,
    spent: AtomicU64,
}

impl Meter {
    /// Nothing done so far.
    pub fn new(limit: Limit) -> Meter {
        Meter { limit, spent: AtomicU64::new(0) }
    }

    /// With something counted already.
    pub fn from(limit: Limit, spent: u64) -> Meter {
        Meter { limit, spent: AtomicU64::new(spent) }
    }

    /// The limit.
    pub fn limit(&self) -> Limit {
        self.limit
    }

    /// What has been counted.
    pub fn spent(&self) -> u64 {
        self.spent.load(Relaxed)
    }

    /// What is counted of the limit, in percent.
    pub fn percent(&self) -> f64 {
        100.0 * self.spent() as f64 / self.limit.get().max(1) as f64
    }

    /// Counts work that is about to begin, whose amount is known. Nothing is counted if it is refused. For one thread: between the look and
    /// the count others may add.
    ///
    /// # Errors
    /// If it would pass the limit.
    pub fn charge(&self, amount: u64) -> Result<(), LimitExceeded> {
        self.check(amount)?;
        self.spent.fetch_add(amount, Relaxed);
        Ok(())
    }

    /// Sets the amount counted so far to `spent`.
    pub fn restart(&self, spent: u64) {
        self.spent.store(spent, Relaxed);
    }

    /// Checks that `amount` more work may begin.
    ///
    /// # Errors
    /// If it would pass the limit.
    pub fn check(&self, amount: u64) -> Result<(), LimitExceeded> {
        self.limit.check(self.spent().saturating_add(amount))
    }

    /// Counts work that has been done; whether the sum is still allowed.
    pub fn add(&self, amount: u64) -> bool {
        self.spent.fetch_add(amount, Relaxed).saturating_add(amount) <= self.limit.get()
    }

    /// Whether all that was added is allowed.
    ///
    /// # Errors
    /// If it is more than the limit.
    pub fn verify(&self) -> Result<(), LimitOverrun> {
        if self.spent() > self.limit.get() { Err(self.overrun()) } else { Ok(()) }
    }

    /// What to say of a sum that is over.
    pub fn overrun(&self) -> LimitOverrun {
        LimitOverrun::of(self.limit)
    }
}

#[cfg(test)]
mod tests {
    use super::super::Limits;
    use super::*;

    #[test]
    fn the_limit_itself_is_allowed_and_one_more_is_not() {
        let meter = Meter::new(Limits::default().work_vertices.with(10));
        assert_eq!(meter.charge(9), Ok(()));
        assert_eq!(meter.charge(2).expect_err("11 of 10").asked, 11);
        assert_eq!((meter.charge(1), meter.spent()), (Ok(()), 10), "what was refused is not counted");
        assert_eq!(meter.verify(), Ok(()));
        assert!(meter.charge(u64::MAX).is_err());
        assert!(!meter.add(1));
        let text = meter.verify().expect_err("11 of 10").to_string();
        assert_eq!(text, "more than 10 vertices drawn, the limit; --limit work.vertices=N allows more");
    }
}
