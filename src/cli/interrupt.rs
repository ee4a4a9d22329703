//! What Ctrl-C ends with: one line that says what is kept, and no file that is not complete.

use std::sync::{Mutex, PoisonError};

/// Exit code of a program that Ctrl-C has ended: what shells report.
const INTERRUPTED: i32 = 130;

/// What the files that were written are good for.
static KEPT: Mutex<String> = Mutex::new(String::new());

/// States what is kept if the program is interrupted from here on.
pub fn keeps(what: String) {
    *KEPT.lock().unwrap_or_else(PoisonError::into_inner) = what;
}

/// Begins to wait for Ctrl-C.
pub fn watch() {
    let end = || {
        let kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
        eprintln!("interrupted: {}", if kept.is_empty() { "nothing is kept" } else { &kept });
        host::exit_without_parts(INTERRUPTED)
    };
    // A parent that ignores the signal for its children is obeyed. Without a thread Ctrl-C ends the program without a word.
    let _ = ctrlc::try_set_handler(end);
}
