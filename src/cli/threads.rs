//! The threads that everything runs on.

use std::io::{Error, ErrorKind};
use std::sync::mpsc;

use anyhow::{Result, anyhow, bail};

/// Threads at most.
pub const MOST: u16 = 1024;

/// Address space in bytes that a thread needs before it works: its stack (the standard library's 2 MiB), the stack of its signal handler
/// and what the allocator asks for at once.
const THREAD_BYTES: usize = 8 << 20;

/// Address space in bytes that is kept free while threads start, for the end of those that started and for the error message.
const RESERVE_BYTES: usize = 8 << 20;

/// The variable that says how many, where no option does: that of the library.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// Starts the threads: so many, or as many as the environment says, or as there are processors. Started by the first that needs them,
/// they could not say why they fail to.
///
/// # Errors
/// If the environment asks for too many or does not say a number, or if they cannot be started.
pub fn start(option: Option<u16>) -> Result<()> {
    let threads = match option {
        Some(threads) => threads,
        None => match std::env::var_os(VARIABLE) {
            Some(text) => stated(&text.to_string_lossy())?,
            None => None,
        }
        .unwrap_or_else(processors),
    };
    pool(threads).map_err(|error| {
        anyhow!(
            "cannot start {threads} threads; ask for fewer (--threads N, or {VARIABLE}=N), or let the process have more (ulimit -u) and \
             more memory (ulimit -v): {error}"
        )
    })
}

/// Starts the library's threads one after the other. A thread that finds no memory for its first bytes ends the process without a message.
/// So a thread starts only if there is room for it, and no other thread starts until it has what it needs.
fn pool(threads: u16) -> Result<()> {
    let mut reserve = Some(room(RESERVE_BYTES)?);
    let (ready, started) = mpsc::channel();
    let spawn = |thread: rayon::ThreadBuilder| {
        let attempt = room(THREAD_BYTES).and_then(|free| {
            drop(free);
            std::thread::Builder::new().spawn(|| thread.run())
        });
        if let Err(error) = attempt {
            reserve = None;
            return Err(error);
        }
        started.recv().map_err(|_| Error::other("a thread ended before it began"))
    };
    let start = move |_| _ = ready.send(());
    Ok(rayon::ThreadPoolBuilder::new()
        .num_threads(usize::from(threads))
        .start_handler(start)
        .spawn_handler(spawn)
        .build_global()?)
}

/// A block of so many bytes that nobody has written: address space, not memory.
fn room(bytes: usize) -> Result<Vec<u8>, Error> {
    let mut block = Vec::new();
    block.try_reserve_exact(bytes).map_err(|error| Error::new(ErrorKind::OutOfMemory, error))?;
    // The compiler may leave out an allocation that nobody uses.
    Ok(std::hint::black_box(block))
}

/// The number that the variable states; none where it leaves it to the program.
fn stated(text: &str) -> Result<Option<u16>> {
    match text.trim().parse::<u64>() {
        Ok(0) => Ok(None),
        Ok(threads) if threads <= u64::from(MOST) => Ok(Some(threads as u16)),
        Err(_) if text.trim().is_empty() => Ok(None),
        _ => bail!(
            "{VARIABLE} is `{text}`, and must be a number of threads from 1 to {MOST}; 0 means as many as there are processors"
        ),
    }
}

fn processors() -> u16 {
    let found = std::thread::available_parallelism().map_or(1, |number| number.get());
    u16::try_from(found).unwrap_or(MOST).min(MOST)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_environment_states_a_number_or_nothing() {
        assert_eq!(stated("3").expect("a number"), Some(3));
        assert_eq!(stated(" 1024 ").expect("a number"), Some(1024));
        assert_eq!(stated("0").expect("left open"), None);
        assert_eq!(stated("").expect("left open"), None);
        for bad in ["1025", "-1", "two", "18446744073709551616"] {
            let error = stated(bad).expect_err(bad).to_string();
            assert!(error.contains(bad) && error.contains("1024"), "{error}");
        }
    }
}
