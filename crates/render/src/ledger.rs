//! The work that a rendering has done and the memory that it keeps alive, against the limits of its trace.
//!
//! Work whose amount is known is refused before it begins; other work is counted while it is done. Memory is claimed before it is
//! allocated. All claims are made on the renderer's thread, and sums of work do not depend on who did it: a trace that is refused is
//! refused at the same command with the same words, whatever the number of threads.

use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Mutex, PoisonError};

use num::{Limit, LimitExceeded, Limits, Meter};

/// What work beside shaders costs, in steps: a draw, each of its vertices, a triangle that is clipped, and a workgroup. Steps take about 7 ns.
/// A draw takes 4.5 us of a processor of 3 GHz, a vertex 13 to 42 ns beside its shader, a workgroup 0.6 us.
pub const DRAW_STEPS: u64 = 600;
/// See [`DRAW_STEPS`].
pub const VERTEX_STEPS: u64 = 4;
/// See [`DRAW_STEPS`].
pub const CLIPPED_STEPS: u64 = 64;
/// See [`DRAW_STEPS`].
pub const WORKGROUP_STEPS: u64 = 80;

/// Work and memory of one rendering of a trace.
#[derive(Debug)]
pub struct Ledger {
    /// Commands, those of bundles and the draws of indirect ones among them.
    pub commands: Meter,
    /// Vertices, or indices, times instances.
    pub vertices: Meter,
    /// Quads of triangles, and triangles of tiles.
    pub quads: Meter,
    /// Workgroups.
    pub workgroups: Meter,
    /// Steps of shaders.
    pub steps: Meter,
    /// Bytes created, copied and cleared.
    pub bytes: Meter,
    /// Bytes of shader source.
    pub sources: Meter,
    /// Bytes alive.
    memory: Limit,
    alive: AtomicU64,
    most_alive: AtomicU64,
    /// The command that runs: its number and name.
    command: Mutex<(u64, &'static str)>,
}

impl Ledger {
    /// Nothing done, nothing alive.
    pub fn new(limits: &Limits) -> Ledger {
        Ledger {
            commands: Meter::new(limits.work_commands),
            vertices: Meter::new(limits.work_vertices),
            quads: Meter::new(limits.work_quads),
            workgroups: Meter::new(limits.work_workgroups),
            steps: Meter::new(limits.work_steps),
            bytes: Meter::new(limits.work_bytes),
            sources: Meter::new(limits.work_sources),
            memory: limits.memory_bytes,
            alive: AtomicU64::new(0),
            most_alive: AtomicU64::new(0),
            command: Mutex::new((0, "")),
        }
    }

    /// All kinds of work.
    pub fn meters(&self) -> [&Meter; 7] {
        [&self.commands, &self.vertices, &self.quads, &self.workgroups, &self.steps, &self.bytes, &self.sources]
    }

    /// The work that has come nearest to its limit.
    pub fn nearest(&self) -> &Meter {
        let nearer = |a: &&Meter, b: &&Meter| a.percent().total_cmp(&b.percent());
        self.meters().into_iter().max_by(nearer).unwrap_or(&self.commands)
    }

    /// Notes which command runs, and counts it.
    ///
    /// # Errors
    /// If it is one too many.
    pub fn begin(&self, number: u64, name: &'static str) -> Result<(), LimitExceeded> {
        *self.command.lock().unwrap_or_else(PoisonError::into_inner) = (number, name);
        self.commands.charge(1)
    }

    /// Number and name of the command that runs.
    pub fn command(&self) -> (u64, &'static str) {
        *self.command.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes alive.
    pub fn alive(&self) -> u64 {
        self.alive.load(Relaxed)
    }

    /// The most bytes that were alive at one time.
    pub fn most_alive(&self) -> u64 {
        self.most_alive.load(Relaxed)
    }

    /// Checks that `bytes` bytes more may be alive for a moment.
    ///
    /// # Errors
    /// If they pass the limit; the message says what they are for.
    pub fn passing(&self, what: &'static str, bytes: u64) -> Result<(), TooMuchAlive> {
        let alive = self.alive();
        let refused = |exceeded| TooMuchAlive { bytes, what, alive, exceeded };
        self.memory.check(alive.saturating_add(bytes)).map_err(refused)
    }

    /// Claims memory before it is allocated; it counts as alive until the claim is dropped.
    ///
    /// # Errors
    /// If it passes the limit; the message says what it is for.
    pub fn claim(self: &Arc<Ledger>, what: &'static str, bytes: u64) -> Result<Claim, TooMuchAlive> {
        self.passing(what, bytes)?;
        self.claim_made(bytes);
        Ok(Claim { ledger: self.clone(), bytes })
    }

    fn claim_made(&self, bytes: u64) {
        let alive = self.alive.fetch_add(bytes, Relaxed) + bytes;
        self.most_alive.fetch_max(alive, Relaxed);
    }

    /// A meter for memory that threads claim while they work, which begins with what is alive.
    pub fn growth(&self) -> Meter {
        Meter::from(self.memory, self.alive())
    }
}

/// A command asks for more memory than may be alive.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("asks for {bytes} bytes for {what} where {alive} are alive: {exceeded}")]
pub struct TooMuchAlive {
    /// Bytes that are asked for.
    pub bytes: u64,
    /// The purpose of the memory.
    pub what: &'static str,
    /// Bytes that are alive.
    pub alive: u64,
    /// The limit.
    pub exceeded: LimitExceeded,
}

/// Memory that counts as alive.
#[derive(Debug)]
pub struct Claim {
    ledger: Arc<Ledger>,
    bytes: u64,
}

impl Claim {
    /// As much more.
    ///
    /// # Errors
    /// If it passes the limit.
    pub fn grow(&mut self, what: &'static str, bytes: u64) -> Result<(), TooMuchAlive> {
        self.ledger.passing(what, bytes)?;
        self.ledger.claim_made(bytes);
        self.bytes += bytes;
        Ok(())
    }
}

impl Drop for Claim {
    fn drop(&mut self) {
        self.ledger.alive.fetch_sub(self.bytes, Relaxed);
    }
}

/// The ledger of the rendering that is under way, for a thread that waits for its end.
#[derive(Debug, Default)]
pub struct Watch {
    ledger: Mutex<Option<Arc<Ledger>>>,
}

impl Watch {
    /// A rendering begins.
    pub(super) fn begin(&self, ledger: &Arc<Ledger>) {
        *self.ledger.lock().unwrap_or_else(PoisonError::into_inner) = Some(ledger.clone());
    }

    /// The ledger of the rendering that began last.
    pub fn ledger(&self) -> Option<Arc<Ledger>> {
        self.ledger.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// A line about a rendering: the command that runs, and the limit that is nearest once it is at one in a hundred.
    pub fn line(&self) -> Option<String> {
        let ledger = self.ledger()?;
        let nearest = ledger.nearest();
        let (number, name) = ledger.command();
        let percent = nearest.percent();
        (percent >= 1.0)
            .then(|| format!("command {number}: {name}: {percent:.0} % of the limit {}", nearest.limit().info().name))
    }
}

/// The memory that the consumer of events keeps of them. It counts as memory in use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ConsumerMemory {
    /// Images of every attachment that it has, beside the renderer's.
    pub images: u64,
    /// Recorded pieces of work that it has at one time, pieces in flight included.
    pub pieces: u64,
    /// Whether it keeps every frame's picture and statistics to the end.
    pub frames: bool,
}

impl Default for ConsumerMemory {
    /// A consumer that keeps nothing.
    fn default() -> ConsumerMemory {
        ConsumerMemory { images: 0, pieces: 1, frames: false }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn memory_is_claimed_up_to_the_limit_and_comes_back() {
        let mut limits = Limits::default();
        limits.memory_bytes = limits.memory_bytes.with(100);
        let ledger = Arc::new(Ledger::new(&limits));
        let mut first = ledger.claim("a buffer", 60).expect("60 of 100");
        let refused = ledger.claim("a texture", 41).expect_err("101 of 100").to_string();
        assert!(refused.starts_with("asks for 41 bytes for a texture where 60 are alive: 101 bytes of memory"), "{refused}");
        assert!(refused.ends_with("the limit of 100; --limit memory.bytes=N allows more"), "{refused}");
        first.grow("a buffer", 40).expect("100 of 100");
        assert!(first.grow("a buffer", 1).is_err());
        drop(first);
        assert_eq!((ledger.alive(), ledger.most_alive()), (0, 100));
        drop(ledger.claim("a buffer", 100).expect("100 of 100"));
    }

    #[test]
    fn the_nearest_limit_is_told() {
        let mut limits = Limits::default();
        limits.work_steps = limits.work_steps.with(1000);
        let watch = Watch::default();
        assert_eq!(watch.line(), None);
        let ledger = Arc::new(Ledger::new(&limits));
        watch.begin(&ledger);
        ledger.begin(17, "Dispatch").expect("one command");
        assert_eq!(watch.line(), None, "nothing is near its limit");
        ledger.steps.add(120);
        assert_eq!(watch.line().as_deref(), Some("command 17: Dispatch: 12 % of the limit work.shader_steps"));
    }
}
