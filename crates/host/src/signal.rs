//! Signals whose default would end the program without a message.
#![allow(unsafe_code, reason = "a call of the C library")]

/// Ignores the signal for a file that grows beyond the process's limit (`ulimit -f`); to be called before there are other threads. The write then fails
/// with an error, which is reported as one of a full disk is, and unfinished files are removed.
pub fn survive_full_files() {
    #[cfg(unix)]
    // SAFETY: the call sets a signal to be ignored. No handler is installed, so no code runs in a signal's context.
    unsafe {
        libc::signal(libc::SIGXFSZ, libc::SIG_IGN);
    }
}
