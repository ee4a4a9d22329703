//! Foreign front ends on input that nobody vouches for.
//!
//! naga's SPIR-V front end panics on some malformed binaries instead of refusing them. What it was given is thrown away with it, so
//! nothing half-made survives, and the panic is reported as the error that it stands for.

use std::any::Any;
use std::cell::Cell;
use std::panic::{AssertUnwindSafe, catch_unwind};

thread_local! {
    static INSIDE: Cell<bool> = const { Cell::new(false) };
}

/// Whether this thread is in a call whose panics become errors: a panic hook may stay silent then.
pub fn is_guarded() -> bool {
    INSIDE.get()
}

/// Runs foreign code; a panic in it becomes a message.
///
/// # Errors
/// What the panic says.
pub fn guarded<T>(run: impl FnOnce() -> T) -> Result<T, String> {
    let outer = INSIDE.replace(true);
    // What `run` changes is its own, and is not looked at after a panic.
    let result = catch_unwind(AssertUnwindSafe(run));
    INSIDE.set(outer);
    result.map_err(|panic| format!("the front end gave up: {}", text_of(&*panic)))
}

fn text_of(panic: &(dyn Any + Send)) -> &str {
    match (panic.downcast_ref::<&str>(), panic.downcast_ref::<String>()) {
        (Some(text), _) => text,
        (_, Some(text)) => text,
        _ => "no reason given",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_panic_is_a_message() {
        assert_eq!(guarded(|| 7), Ok(7));
        assert!(!is_guarded());
        let hook = guarded(|| assert!(!is_guarded(), "it was {}", is_guarded()));
        assert_eq!(hook, Err("the front end gave up: it was true".to_owned()));
        assert!(!is_guarded());
    }
}
