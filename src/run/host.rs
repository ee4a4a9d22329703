//! Time of the host, for figures of speed only: no result depends on it.

use std::time::{Duration, Instant};

/// Processor time that this thread has used, where the system tells (Linux), else none.
pub fn thread_cpu_time() -> Option<Duration> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").ok()?;
    let nanoseconds = text.split_whitespace().next()?.parse().ok()?;
    Some(Duration::from_nanos(nanoseconds))
}

/// Measures a stretch of work on this thread: processor time where the system tells, else time on the clock.
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
