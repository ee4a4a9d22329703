//! The threads that everything runs on.

use anyhow::{Result, anyhow, bail};

/// Threads at most.
pub const MOST: u16 = 1024;

/// Address space in bytes that is asked for each thread before any starts: its stack (the standard library's 2 MiB), and for the stack of its
/// signal handler and what it allocates at once.
const THREAD_BYTES: usize = 3 << 20;

/// The variable that says how many, where no option does: that of the library.
const VARIABLE: &str = "RAYON_NUM_THREADS";

/// Starts the threads. Their number is `option`, else what the environment says, else the number of processors. If the first use started them,
/// a failure could not be explained.
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

/// Starts the library's threads. A thread that finds no memory for its first bytes ends the process without a message. So none starts unless there
/// is room for all: address space, which nobody writes.
fn pool(threads: u16) -> Result<()> {
    let mut room: Vec<u8> = Vec::new();
    room.try_reserve_exact(usize::from(threads) * THREAD_BYTES)?;
    // The compiler may leave out an allocation that nobody uses.
    drop(std::hint::black_box(room));
    Ok(rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global()?)
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
