//! Runs a function of the machine, whether its call was recorded or comes from a display list.

use crate::gl::call::{Call, Fault, GlResult, INVALID_OPERATION};
use crate::gl::machine::{CallClass, Gl, Handler};

/// Maximum number of objects of each kind, so that a recording cannot use much memory with few calls.
const NAMES_MAX: usize = 1 << 20;
/// Maximum number of calls that display lists run: this many, and more for each call of the recording. Nested lists cause much work with
/// few bytes.
const STEPS_MAX: u64 = 1 << 30;
const STEPS_A_CALL: u64 = 1 << 14;
/// Maximum number of list calls, nested ones included, that one recorded call runs: the size of the largest list. Without it, one list that
/// calls itself twice could use up the limit for the whole recording.
const STEPS_A_LIST: u64 = 1 << 24;
/// Steps between two checks of the numbers of objects: a call makes at most one object.
const STEPS_A_LOOK: u64 = 64;

impl Gl {
    /// Runs a call, whether it was recorded or comes from a list.
    pub fn execute(&mut self, handler: Handler, call: &Call) -> GlResult {
        match handler.class {
            CallClass::Vertex | CallClass::Element | CallClass::Ignored => return (handler.run)(self, call, handler.shape),
            CallClass::System => {}
            _ if self.context.open_primitive.is_some() => return Err(INVALID_OPERATION),
            CallClass::Server | CallClass::Matrix => self.flush()?,
            CallClass::Client | CallClass::Arrays => {}
        }
        (handler.run)(self, call, handler.shape)
    }

    /// Counts the error or the unsupported feature of a call.
    pub fn settle(&mut self, call: &Call, outcome: GlResult) -> Result<(), String> {
        match outcome {
            Ok(()) => {}
            Err(Fault::Unsupported(what)) => self.log.refuse(what),
            Err(Fault::Error(error)) => self.log.note_error(&format!("{}: {error}", call.function.name)),
            Err(Fault::Damaged(reason)) | Err(Fault::Limit(reason)) => {
                let name = &*call.function.name;
                // With nested lists, the name is put in front only once.
                return Err(if reason.starts_with(name) { reason } else { format!("{name}: {reason}") });
            }
        }
        self.progress.steps += 1;
        if self.progress.depth > 0 && self.progress.steps - self.progress.list_began > STEPS_A_LIST {
            return Err(format!("{}: display lists of more than {STEPS_A_LIST} calls run in one", call.function.name));
        }
        if self.progress.steps > STEPS_MAX.saturating_add(self.log.number.saturating_mul(STEPS_A_CALL)) {
            return Err(format!("{}: display lists of more than {STEPS_MAX} calls run", call.function.name));
        }
        if let Err(error) = self.limits.memory_bytes.check(self.card.bytes + self.card.on_card_bytes) {
            return Err(format!("{}: {error}", call.function.name));
        }
        if self.progress.steps.is_multiple_of(STEPS_A_LOOK) && self.most_objects() > NAMES_MAX {
            return Err(format!("{}: more than {NAMES_MAX} objects of one kind", call.function.name));
        }
        Ok(())
    }
}
