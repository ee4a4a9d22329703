//! Why a replay stopped.

use machine::{ConfigError, MachineError};
use trace::TraceError;

/// Why a replay stopped before its end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The trace is wrong, or asks for what is not supported or allowed.
    #[error(transparent)]
    Trace(TraceError),
    /// The configuration describes no machine.
    #[error(transparent)]
    Config(ConfigError),
    /// The machine stopped, for a limit or a fault.
    #[error(transparent)]
    Machine(MachineError),
    /// The options exclude each other, or the host has not enough threads or memory.
    #[error("{0}")]
    Other(String),
}

impl From<anyhow::Error> for ReplayError {
    fn from(error: anyhow::Error) -> ReplayError {
        let error = match error.downcast() {
            Ok(trace) => return ReplayError::Trace(trace),
            Err(error) => error,
        };
        let error = match error.downcast() {
            Ok(config) => return ReplayError::Config(config),
            Err(error) => error,
        };
        match error.downcast() {
            Ok(machine) => ReplayError::Machine(machine),
            Err(error) => ReplayError::Other(format!("{error:#}")),
        }
    }
}
