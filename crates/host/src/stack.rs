//! Threads with stacks of stated sizes.
//!
//! naga's front ends and validator and the lowering of shaders call themselves for what is nested, and so does what frees a syntax tree.
//! The stack of the caller's thread is not known, so the work is done on a thread whose stack is: its size follows from the limit on nesting.
//! The program itself runs on such a thread, too, because the system's limit (`ulimit -s`) sets the stack of the first one.

use std::panic::resume_unwind;
use std::thread::{Builder, scope};

/// Bytes of stack for one level of nesting. Measured as the smallest stack on which a shader of a given depth compiles, for each kind of
/// nesting that `tests/robust/generated.rs` makes: an operator takes 0.6 KiB, a dereference 1.2, a call 1.4, an `else if` 1.3 in a release
/// and 1.7 in the development profile, a switch 2.4. The rest is for other compilers.
const LEVEL: u64 = 16 << 10;

/// Bytes of stack beside: naga's parser goes 200 levels of brackets deep whatever the limit is, and takes up to 3.3 KiB for each.
const BASE: u64 = 8 << 20;

/// No more than this is asked for: the address space of a process is not much larger.
const LARGEST: u64 = 1 << 46;

/// Bytes of stack of the program, as most systems give to its first thread.
const PROGRAM: u64 = 8 << 20;

/// Runs a function on a thread whose stack has room for `levels` levels of nesting. The system provides the memory as it is used.
///
/// # Errors
/// If the system has no such thread.
pub fn with_room_for<T: Send>(levels: u64, run: impl FnOnce() -> T + Send) -> Result<T, String> {
    let bytes = levels.saturating_mul(LEVEL).saturating_add(BASE).min(LARGEST);
    with_stack("shader", bytes, run)
        .map_err(|error| format!("{error}; a lower --limit shader.nesting=N (now {levels}) needs less"))
}

/// Does the work of the program on a thread whose stack does not depend on the system's limit.
///
/// # Errors
/// If the system has no such thread.
pub fn with_program_stack<T: Send>(run: impl FnOnce() -> T + Send) -> Result<T, String> {
    with_stack("main", PROGRAM, run)
}

/// Does work on a thread of its own. A panic goes on in the caller.
fn with_stack<T: Send>(name: &str, bytes: u64, run: impl FnOnce() -> T + Send) -> Result<T, String> {
    scope(|scope| {
        let thread = Builder::new().name(name.to_owned()).stack_size(bytes as usize).spawn_scoped(scope, run);
        let thread =
            thread.map_err(|error| format!("the system gives no thread with a stack of {} MiB: {error}", bytes >> 20))?;
        Ok(thread.join().unwrap_or_else(|panic| resume_unwind(panic)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Recurses through `levels` stack frames of 2 KiB, of which an unoptimised build makes several copies.
    fn descend(levels: u64) -> u64 {
        let frame = std::hint::black_box([levels; 256]);
        if levels == 0 { 0 } else { descend(levels - 1) + std::hint::black_box(frame)[3] / levels }
    }

    #[test]
    fn the_stack_grows_with_the_levels() {
        assert_eq!(with_room_for(10, || descend(100)), Ok(100));
        assert_eq!(with_room_for(20_000, || descend(20_000)), Ok(20_000));
    }

    #[test]
    fn no_thread_is_an_error() {
        let error = with_room_for(u64::MAX, || 0).expect_err("no machine has such a stack");
        assert!(error.contains("shader.nesting"), "{error}");
    }

    #[test]
    fn a_panic_reaches_the_caller() {
        let caught = std::panic::catch_unwind(|| with_room_for(1, || resume_unwind(Box::new("on purpose"))));
        assert_eq!(caught.expect_err("a panic").downcast_ref(), Some(&"on purpose"));
    }
}
