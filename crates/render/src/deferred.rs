//! Shaders and pipelines are made when a draw or dispatch first uses them.
//!
//! A program often creates more of them than it draws with, and a recording can hold some that its own driver refused. What nothing uses costs
//! nothing and is refused nowhere. A refusal names the command that describes the object.

use std::sync::{Arc, Mutex, OnceLock, PoisonError};

use super::fault::{Failure, Fault, Reason};
use super::ledger::Claim;

/// An object that is made when it is first used.
#[derive(Debug)]
pub struct Deferred<D, T> {
    /// Number and name of the command that describes it.
    command: (u64, &'static str),
    /// The description, until the object is made.
    description: Mutex<Option<D>>,
    /// The object with its memory, or why there is none.
    made: OnceLock<Result<(Arc<T>, Claim), Failure>>,
}

impl<D, T> Deferred<D, T> {
    /// The object that this command describes.
    pub fn new(command: (u64, &'static str), description: D) -> Deferred<D, T> {
        Deferred { command, description: Mutex::new(Some(description)), made: OnceLock::new() }
    }

    /// The object. The first call makes it.
    ///
    /// # Errors
    /// Why it cannot be made. The error names the command that describes it, or an object that it is made of.
    pub(super) fn get(&self, make: impl FnOnce(D) -> Result<(T, Claim), Fault>) -> Result<Arc<T>, Fault> {
        if let Some(Ok((made, _))) = self.made.get() {
            return Ok(made.clone());
        }
        let description = self.description.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(description) = description {
            let made = match make(description) {
                Ok((made, claim)) => Ok((Arc::new(made), claim)),
                Err(Fault::Reason(reason)) => Err(Failure { command: self.command, reason: Box::new(reason) }),
                Err(Fault::Described(failure)) => Err(failure),
                Err(other) => return Err(other),
            };
            // One thread renders: nobody else has made it.
            let _ = self.made.set(made);
        }
        match self.made.get() {
            Some(Ok((made, _))) => Ok(made.clone()),
            Some(Err(failure)) => Err(Fault::Described(failure.clone())),
            None => Err(Fault::Reason(Reason::NotMade)),
        }
    }
}
