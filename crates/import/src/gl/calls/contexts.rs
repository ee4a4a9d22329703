//! Contexts that are made, current, shared and destroyed.

use crate::gl::call::GlResult;
use crate::gl::machine::Gl;
use crate::gl::state::contexts::Current;

impl Gl {
    /// Makes a context. It replaces one of the same handle, which the program must have destroyed in a way that was not recorded.
    pub fn create_context(&mut self, handle: u64, share: Option<u64>) -> GlResult {
        self.destroy_context(handle)?;
        let share = share.map(|share| self.known_context(share)).transpose()?;
        self.contexts.add(self.log.number, handle, share).map(drop)
    }

    /// The context of a handle. The first one whose creation was not recorded is the one that has run all calls so far.
    pub fn known_context(&mut self, handle: u64) -> GlResult<u32> {
        if let Some(key) = self.contexts.known(handle).or_else(|| self.contexts.adopt(self.log.number, handle)) {
            return Ok(key);
        }
        self.log.refuse("several contexts of which the recording does not have the creation".into());
        self.contexts.add(self.log.number, handle, Some(0))
    }

    /// Makes a context current in the thread that calls; `Current::NONE` makes none current.
    pub fn make_current(&mut self, to: Current) -> GlResult {
        let before = self.contexts.now;
        if !std::mem::replace(&mut self.contexts.explicit, true)
            && to.context != Some(0)
            && let Some(window) = self.card.windows.at(0)
        {
            // The calls before it had no context: a clear of them is none of the window.
            window.early = Default::default();
        }
        self.contexts.set_current(to)?;
        self.switch(to)?;
        if let Some(key) = before.context {
            self.free_context(key);
        }
        self.free_windows([before.draw, before.read]);
        Ok(())
    }

    /// Continues with a call of another thread.
    pub fn enter_thread(&mut self, thread: u32) -> GlResult {
        self.contexts.thread = thread;
        self.switch(self.contexts.current_in(thread))
    }

    /// Exchanges what is current.
    fn switch(&mut self, to: Current) -> GlResult {
        let from = self.contexts.now;
        if from == to {
            return Ok(());
        }
        // Primitives that wait belong to what was current.
        self.flush()?;
        if from.context != to.context {
            for key in [from.context, to.context].into_iter().flatten() {
                self.contexts.exchange(key, &mut self.state, &mut self.context, &mut self.objects);
            }
        }
        self.contexts.now = to;
        (self.card.windows.draw, self.card.windows.read) = (to.draw, to.read);
        self.fit();
        Ok(())
    }

    /// Destroys a context as soon as it is current in no thread.
    pub fn destroy_context(&mut self, handle: u64) -> GlResult {
        if let Some(key) = self.contexts.doom(handle) {
            self.free_context(key);
        }
        Ok(())
    }

    /// Frees a context that is destroyed and current in no thread, and the objects that no context shares any more.
    fn free_context(&mut self, key: u32) {
        if let Some(objects) = self.contexts.free(key) {
            objects.free(&mut self.card);
        }
    }

    /// Lets a context share the objects of another one from now on (`wglShareLists`).
    pub fn share(&mut self, from: u64, with: u64) -> GlResult {
        let (from, with) = (self.known_context(from)?, self.known_context(with)?);
        // The state of both is stored meanwhile.
        let now = self.contexts.now;
        self.switch(Current::NONE)?;
        if !self.contexts.share(from, with) {
            self.log.refuse("wglShareLists of a context that has objects".into());
        }
        self.switch(now)
    }

    /// Destroys a drawable as soon as it is current in no thread.
    pub fn destroy_window(&mut self, handle: u64) {
        if let Some(number) = self.card.windows.forget(handle) {
            if let Some(window) = self.card.windows.at(number) {
                window.doomed = true;
            }
            self.free_windows([Some(number), None]);
        }
    }

    /// Frees those of these drawables that are destroyed and current in no thread.
    fn free_windows(&mut self, numbers: [Option<u32>; 2]) {
        for number in numbers.into_iter().flatten() {
            if self.card.windows.at(number).is_some_and(|window| window.doomed) && !self.contexts.uses_window(number) {
                self.card.free_window(number);
            }
        }
    }
}
