//! Time of the host, for figures of speed only: no result depends on it.
#![allow(unsafe_code, reason = "a call of the C library")]

use std::time::{Duration, Instant};

/// The time of a clock of the system, if it has that clock.
#[cfg(unix)]
fn read(clock: libc::clockid_t) -> Option<Duration> {
    let mut time = libc::timespec { tv_sec: 0, tv_nsec: 0 };
    // SAFETY: the pointer is valid for the call, which writes one `timespec`.
    let failed = unsafe { libc::clock_gettime(clock, &raw mut time) };
    let seconds = u64::try_from(time.tv_sec).ok().filter(|_| failed == 0)?;
    Some(Duration::new(seconds, u32::try_from(time.tv_nsec).ok()?))
}

/// Processor time that this thread has used; none where the system does not report it.
#[cfg(unix)]
pub fn thread_cpu_time() -> Option<Duration> {
    read(libc::CLOCK_THREAD_CPUTIME_ID)
}

/// Processor time that all threads of this process have used, where the system tells, else none.
#[cfg(unix)]
pub fn process_cpu_time() -> Option<Duration> {
    read(libc::CLOCK_PROCESS_CPUTIME_ID)
}

/// Processor time that this thread has used: this system does not report it.
#[cfg(not(unix))]
pub fn thread_cpu_time() -> Option<Duration> {
    None
}

/// Processor time that all threads of this process have used: this system does not tell.
#[cfg(not(unix))]
pub fn process_cpu_time() -> Option<Duration> {
    None
}

/// Measures a stretch of work on this thread: processor time where the system reports it, else time on the clock.
pub struct Stopwatch {
    cpu: Option<Duration>,
    clock: Instant,
}

impl Stopwatch {
    /// Starts now.
    pub fn start() -> Stopwatch {
        Stopwatch { cpu: thread_cpu_time(), clock: Instant::now() }
    }

    /// Processor time since the start, or time on the clock.
    pub fn elapsed(&self) -> Duration {
        match (self.cpu, thread_cpu_time()) {
            (Some(then), Some(now)) => now.saturating_sub(then),
            _ => self.clock.elapsed(),
        }
    }

    /// Time on the clock since the start.
    pub fn clock(&self) -> Duration {
        self.clock.elapsed()
    }
}
