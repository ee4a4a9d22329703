//! Runs recorded calls.

use num::CallSite;

use crate::gl::call::{Call, Fault};
use crate::gl::machine::{CallClass, CalledFunction, Gl};
use crate::gl::table;

impl Gl {
    /// Runs a call. An error ends the import.
    pub fn call(&mut self, call: &Call) -> Result<(), String> {
        self.log.number = call.number;
        self.card.recorder.set_call_site(CallSite::Call(call.number));
        if call.thread != self.contexts.thread {
            let entered = self.enter_thread(call.thread);
            self.settle(call, entered)?;
        }
        let id = call.function.id as usize;
        if self.functions.len() <= id {
            self.functions.resize(id + 1, None);
        }
        let new = || CalledFunction { handler: table::find(&call.function.name), function: call.function.clone(), times: 0 };
        let called_function = self.functions[id].get_or_insert_with(new);
        called_function.times += 1;
        let handler = called_function.handler;
        if self.contexts.now.context.is_none() && handler.class != CallClass::System {
            // As in Mesa, it does nothing.
            let outcome = if handler.class == CallClass::Ignored { Ok(()) } else { Err(Fault::Error("no current context")) };
            return self.settle(call, outcome);
        }
        if matches!(handler.class, CallClass::Server | CallClass::Matrix | CallClass::Vertex)
            && let Some((name, execute, list)) = self.context.compiling.take()
        {
            self.context.compiling = Some((name, execute, self.compile(list, handler, call)?));
            if !execute {
                return Ok(());
            }
        }
        let outcome = self.execute(handler, call);
        self.settle(call, outcome)
    }
}
