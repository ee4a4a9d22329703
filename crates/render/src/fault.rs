//! Why a command cannot be run.

use std::io;
use std::sync::Arc;

use gfx::texture::ViewError;
use num::{LimitExceeded, LimitOverrun, NoMemory};
use shader::{ShaderError, ShaderFault};
use trace::TraceError;
use work::NotHeld;

use super::bind::BindError;
use super::compute::ComputeError;
use super::draw::DrawError;
use super::execute::Stop;
use super::ledger::TooMuchAlive;
use super::memory::{NoAddresses, NoSkip};
use super::pipeline::PipelineError;
use super::resources::{NoObject, ObjectError};
use super::state::StateError;
use super::transfer::CopyError;

/// What is wrong with a command. The message of its trace's error has the number and the name of the command before it.
#[derive(Clone, Debug, thiserror::Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "each variant is the error it holds")]
pub enum Reason {
    Limit(#[from] LimitExceeded),
    Overrun(#[from] LimitOverrun),
    NoMemory(#[from] NoMemory),
    TooMuchAlive(#[from] TooMuchAlive),
    NoAddresses(#[from] NoAddresses),
    NoSkip(#[from] NoSkip),
    NoObject(#[from] NoObject),
    Object(#[from] ObjectError),
    State(#[from] StateError),
    Bind(#[from] BindError),
    Copy(#[from] CopyError),
    View(#[from] ViewError),
    Module(#[from] ShaderError),
    Pipeline(#[from] PipelineError),
    Compute(#[from] ComputeError),
    Draw(#[from] DrawError),
    Shader(#[from] ShaderFault),
    NotHeld(#[from] NotHeld),
    #[error("what passes read and write cannot be kept: {0}")]
    Notes(Arc<io::Error>),
    #[error("an object could not be made before")]
    NotMade,
}

/// A command that could not be run: its number and name, and the reason.
#[derive(Clone, Debug)]
pub struct Failure {
    pub command: (u64, &'static str),
    pub reason: Box<Reason>,
}

/// Why a command could not be run.
pub enum Fault {
    /// The reason of the failure.
    Reason(Reason),
    /// A blob or text of the trace could not be read; the error names it.
    Trace(TraceError),
    /// The command uses an object that an earlier command describes and that cannot be made.
    Described(Failure),
    /// The receiver stopped.
    Stop,
}

impl<E> From<E> for Fault
where
    Reason: From<E>,
{
    fn from(reason: E) -> Fault {
        Fault::Reason(reason.into())
    }
}

impl From<TraceError> for Fault {
    fn from(error: TraceError) -> Fault {
        Fault::Trace(error)
    }
}

impl From<Stop> for Fault {
    fn from(_: Stop) -> Fault {
        Fault::Stop
    }
}
