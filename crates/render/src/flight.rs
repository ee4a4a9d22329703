//! Render passes in flight.
//!
//! The draws of a pass are handed to a task of the thread pool, one after the other, while the renderer's thread goes on to the next pass. A
//! pass that begins with its attachments cleared depends on none before it, so frames of many small draws, each of which is not worth other
//! threads, are drawn side by side; one that loads what another draws begins after it. What reads an image of such a pass waits for it
//! ([`Tiles`]). Where fewer passes can go on than there are threads, the geometry of a pass's draws is computed ahead
//! ([`RenderPass::draw_all`]).
//!
//! What comes out is what comes out of one thread, errors included:
//! * Events wait behind the passes before them.
//! * A draw in flight reads buffers that are not written any more: a command that writes one goes on with a copy
//!   ([`Buffer::unshared`](super::resources::Buffer::unshared)). Draws with effects beside pixels, and dispatches, wait until nothing is in flight.
//! * A pass counts its work in a ledger of its own. Passes are in flight only while all sums are far from their limits
//!   ([`Ledger::has_room`]). Where anything stops a draw, its own limits or a fault, the whole pass is drawn again by the renderer's thread, with
//!   the sums that one thread would have had, and so is a pass that comes to more than is left behind the passes before it. For this its draws are
//!   kept, and so are those of the passes whose images it loads, back to one that began cleared or from a copy ([`Start`]).
//! * A pass that was drawn again may come to more than its share of a limit. The renderer's own charges since may then be wrong: where the sums
//!   are over a limit when it lands, the trace is rendered again without passes in flight ([`render`](super::render)).

mod again;
mod flights;
mod images;
mod turn;

use std::collections::VecDeque;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering::*};
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use gfx::format::Format;
use work::{Aspects, Funnel};

use super::attachments::{Clearing, discard};
use super::draw::RenderPass;
use super::ledger::Ledger;
use super::queued::{QueuedDraw, Shared};
use super::surface::{ALL, Shape, TileSurface};

pub(super) use flights::{Departure, Flights};
use images::Away;
pub(super) use images::{Source, Tiles};

/// Draws that a task does before it lets others have the thread.
const TURN: usize = 32;

/// Draws of a pass in flight, at most: they are kept until all are done. A longer pass lands and takes off again.
pub(super) const DRAWS: usize = 1 << 13;

/// Draws that are kept of passes whose images are loaded, and how many such passes there may be one behind the other: beyond these a pass begins
/// from a copy.
const KEPT: usize = 1 << 12;
const CHAIN: usize = 64;

/// Draws that wait, at most: beyond this the renderer's thread helps.
const WAITING: usize = 1 << 12;

/// Bytes of the attachments of a pass in flight, at most: each pass has its own.
const ATTACHMENTS: u64 = 128 << 20;

/// The time that a thread sleeps when it waits for a pass and finds nothing to help with.
const NAP: Duration = Duration::from_micros(100);

/// The number of times that a waiting thread looks for halves of draws before it sleeps.
const LOOKS: u32 = 100;

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // The data of a task that panics are not read: the panic is handed on.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// How the first tiles of an attachment can be had again.
enum Start {
    /// They are of one value.
    Cleared([u32; 4]),
    /// A copy.
    Copy(TileSurface),
    /// The contents that the pass before it leaves.
    Behind(Away, Clearing),
}

/// An attachment of a pass in flight.
#[derive(Clone, Copy, Debug)]
struct Attached {
    shape: Shape,
    /// Format in which it is drawn.
    format: Format,
    keeps: Aspects,
    /// A texel of which these bits are known when the pass begins.
    value: [u32; 4],
    known: [u32; 4],
}

/// An attachment of a pass that takes off.
pub(super) struct Boarding {
    pub source: Source,
    /// Format in which it is drawn.
    pub format: Format,
    pub keeps: Aspects,
}

/// A pass as it begins.
pub(super) struct Begin {
    pub width: u32,
    pub height: u32,
    pub samples: u32,
    pub shared: Shared,
    /// Whether its frame is wanted.
    pub wanted: bool,
    /// The counts of draws of the same pass that were done before it took off.
    pub counted: Option<Funnel>,
}

/// Whether a pass with attachments of these shapes may be in flight: each has memory of its own.
pub(super) fn fits(shapes: impl Iterator<Item = Shape>) -> bool {
    shapes.map(|shape| shape.tiled_bytes()).sum::<u64>() <= ATTACHMENTS
}

/// The outcome of a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Landed {
    /// The counts of its draws. None if it has no draws.
    pub counted: Option<Funnel>,
    /// Fragments whose colours were not computed.
    pub overwritten: u64,
    /// Work beside what the renderer's thread counted.
    pub steps: u64,
    pub quads: u64,
    pub bytes: u64,
}

/// Why a draw could not be done: its command, and what it says.
#[derive(Clone, Debug)]
pub(super) struct Failure {
    pub command: (u64, &'static str),
    pub reason: String,
}

/// How a pass ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Close {
    /// Its attachments go to their textures.
    End,
    /// The renderer's thread goes on with it.
    Home,
}

#[derive(Default)]
struct Queue {
    /// Draws in lists of [`TURN`]; the last list of a pass may be shorter.
    draws: VecDeque<Vec<QueuedDraw>>,
    closed: Option<Close>,
    /// A task works on it.
    running: bool,
    /// Its draws are done in halves.
    ahead: bool,
    /// Passes that have to be over before it begins.
    behind: usize,
}

struct Painter {
    /// The initial contents of its attachments: colours by location, then depth.
    starts: Vec<Option<Start>>,
    pass: Option<RenderPass>,
    begun: bool,
    /// Draws that were done, or could not be done.
    done: Vec<Vec<QueuedDraw>>,
    panic: Option<Box<dyn std::any::Any + Send>>,
    landed: Landed,
    /// The failure that drawing it again has shown.
    failure: Option<Failure>,
    /// Where the pass has ended.
    tiles: Vec<Option<TileSurface>>,
}

/// A pass in flight.
pub(super) struct Flight {
    begin: Begin,
    /// Colours by location, then depth.
    attachments: Vec<Option<Attached>>,
    /// Draws that are kept for the passes before it whose images it loads, and how many these are.
    kept: (usize, usize),
    /// Draws of its own.
    draws: AtomicUsize,
    /// Passes that begin when it is over.
    behind: Mutex<Vec<Arc<Flight>>>,
    /// No other pass can load its images any more.
    unneeded: AtomicBool,
    /// The renderer's sums when it began, without those of the passes ahead.
    sums: [u64; 7],
    /// Passes that were in flight when it began.
    ahead: Mutex<Vec<Arc<Flight>>>,
    /// The renderer's ledger, for its limits.
    whole: Arc<Ledger>,
    /// Its own.
    ledger: Ledger,
    queue: Mutex<Queue>,
    painter: Mutex<Painter>,
    /// Draws that wait, of all passes.
    waiting: Arc<AtomicUsize>,
    /// Passes that a task works on.
    running: Arc<AtomicUsize>,
    /// Passes whose draws are done in halves.
    halved: Arc<AtomicUsize>,
    /// Nobody wants it any more.
    cancelled: AtomicBool,
    /// It has to be drawn again.
    failed: AtomicBool,
    /// All draws are done.
    over: AtomicBool,
    sleepers: (Mutex<()>, Condvar),
    /// It has been looked at, and drawn again where that was necessary.
    finished: AtomicBool,
}

impl Flight {
    fn new(begin: Begin, boarding: Vec<Option<Boarding>>, ledger: &Arc<Ledger>, flights: &Flights) -> Arc<Flight> {
        let (mut starts, mut surfaces, mut attachments) = (Vec::new(), Vec::new(), Vec::new());
        let mut sources: Vec<Arc<Flight>> = Vec::new();
        for boarding in boarding {
            let Some(Boarding { source, format, keeps }) = boarding else {
                starts.push(None);
                surfaces.push(None);
                attachments.push(None);
                continue;
            };
            let shape = source.shape();
            let (start, tiles, (value, known)) = match source {
                Source::Tiles(tiles) if tiles.is_clear() => {
                    let value = tiles.clear_value();
                    (Start::Cleared(value), Some(tiles), (value, ALL))
                }
                Source::Tiles(tiles) => (Start::Copy(tiles.clone()), Some(tiles), ([0; 4], [0; 4])),
                Source::Behind(away, clearing) => {
                    if !sources.iter().any(|flight| Arc::ptr_eq(flight, away.flight())) {
                        sources.push(away.flight().clone());
                    }
                    let texel = away.after(clearing);
                    (Start::Behind(away, clearing), None, texel)
                }
            };
            starts.push(Some(start));
            surfaces.push(tiles);
            attachments.push(Some(Attached { shape, format, keeps, value, known }));
        }
        let begun = sources.is_empty();
        let pass = begun.then(|| begin.pass(&attachments, std::mem::take(&mut surfaces)));
        let tiles = if begun { attachments.iter().map(|_| None).collect() } else { surfaces };
        let landed = begin.landed();
        let painter = Painter { starts, pass, begun, done: Vec::new(), panic: None, landed, failure: None, tiles };
        let kept = |sum: (usize, usize), flight: &Arc<Flight>| {
            (sum.0 + flight.kept.0 + flight.draws.load(Relaxed), sum.1.max(flight.kept.1 + 1))
        };
        let flight = Arc::new(Flight {
            begin,
            attachments,
            kept: sources.iter().fold((0, 0), kept),
            draws: AtomicUsize::new(0),
            behind: Mutex::default(),
            unneeded: AtomicBool::new(false),
            sums: ledger.sums(),
            ahead: Mutex::new(flights.air.iter().cloned().collect()),
            whole: ledger.clone(),
            ledger: ledger.share(),
            queue: Mutex::new(Queue { behind: sources.len(), ..Queue::default() }),
            painter: Mutex::new(painter),
            waiting: flights.waiting.clone(),
            running: flights.running.clone(),
            halved: flights.halved.clone(),
            cancelled: AtomicBool::new(false),
            failed: AtomicBool::new(false),
            over: AtomicBool::new(false),
            sleepers: Default::default(),
            finished: AtomicBool::new(false),
        });
        for source in sources {
            let mut behind = lock(&source.behind);
            match source.is_over() {
                true => lock(&flight.queue).behind -= 1,
                false => behind.push(flight.clone()),
            }
        }
        flight
    }

    fn attached(&self, slot: usize) -> &Attached {
        self.attachments[slot].as_ref().expect("an attachment of the pass")
    }

    /// Hands draws on.
    fn push(self: &Arc<Flight>, draws: &mut Vec<QueuedDraw>) {
        if draws.is_empty() {
            return;
        }
        self.waiting.fetch_add(draws.len(), Relaxed);
        let mut queue = lock(&self.queue);
        queue.draws.push_back(std::mem::replace(draws, Vec::with_capacity(TURN)));
        self.start(queue);
    }

    fn close(self: &Arc<Flight>, how: Close) {
        let mut queue = lock(&self.queue);
        queue.closed = Some(how);
        self.start(queue);
    }

    fn start(self: &Arc<Flight>, mut queue: MutexGuard<'_, Queue>) {
        let due = queue.behind == 0 && (!queue.draws.is_empty() || queue.closed.is_some());
        if due && !std::mem::replace(&mut queue.running, true) {
            drop(queue);
            self.running.fetch_add(1, Relaxed);
            self.spawn();
        }
    }

    fn spawn(self: &Arc<Flight>) {
        let flight = self.clone();
        rayon::spawn(move || flight.turn());
    }

    /// Another pass that it waits for is over.
    fn go_on(self: &Arc<Flight>) {
        let mut queue = lock(&self.queue);
        queue.behind -= 1;
        self.start(queue);
    }

    /// The attachments of the pass at its end.
    fn ended(&self, pass: RenderPass) -> Vec<Option<TileSurface>> {
        let ended = pass.end();
        let mut tiles: Vec<_> = ended.color.into_iter().chain([ended.depth]).collect();
        for (tiles, attachment) in tiles.iter_mut().zip(&self.attachments) {
            if let (Some(tiles), Some(attachment)) = (tiles, attachment) {
                discard(attachment.keeps, tiles);
            }
        }
        tiles
    }

    /// No other pass can load its images any more.
    fn forget(&self) {
        self.unneeded.store(true, SeqCst);
        if self.finished.load(SeqCst) {
            drop(self.kept_draws());
        }
    }

    /// Whether all its draws are done, so that [`Flight::finish`] need not wait.
    fn is_over(&self) -> bool {
        self.over.load(Acquire)
    }

    /// Waits for its end, and helps meanwhile. Then what it came to is known, of the passes ahead of it too.
    fn finish(&self) {
        if self.finished.load(Relaxed) {
            return;
        }
        let ahead = std::mem::take(&mut *lock(&self.ahead));
        ahead.iter().for_each(|flight| flight.finish());
        let mut helper = Helper { halved: &self.halved, looked: 0 };
        while !self.is_over() {
            if !helper.help() {
                let asleep = lock(&self.sleepers.0);
                if !self.is_over() {
                    let _ = self.sleepers.1.wait_timeout(asleep, NAP);
                }
            }
        }
        let panic = lock(&self.painter).panic.take();
        if let Some(panic) = panic {
            resume_unwind(panic);
        }
        // The failure of a pass before it comes first: the contents that this pass was drawn on do not exist.
        let failure = ahead.iter().find_map(|flight| lock(&flight.painter).failure.clone());
        if failure.is_some() {
            lock(&self.painter).failure = failure;
        } else if self.failed.load(Relaxed) || self.passes_limits(&ahead) {
            self.again(&ahead);
        }
        self.finished.store(true, SeqCst);
        if self.is_home() || self.unneeded.load(SeqCst) {
            drop(self.kept_draws());
        }
    }
}

impl Flight {
    /// Whether its frame is wanted.
    pub fn is_wanted(&self) -> bool {
        self.begin.wanted
    }

    /// Whether the renderer's thread goes on with the pass itself.
    pub fn is_home(&self) -> bool {
        lock(&self.queue).closed == Some(Close::Home)
    }

    /// The outcome of the pass. Waits for its end.
    ///
    /// # Errors
    /// If a draw could not be done.
    fn settle(&self) -> Result<Landed, Failure> {
        self.finish();
        let painter = lock(&self.painter);
        painter.failure.clone().map_or(Ok(painter.landed), Err)
    }
}

impl Begin {
    /// The outcome before the first draw.
    fn landed(&self) -> Landed {
        Landed { counted: self.counted, ..Landed::default() }
    }

    /// The pass, on these images: colours by location, then depth.
    fn pass(&self, attachments: &[Option<Attached>], surfaces: Vec<Option<TileSurface>>) -> RenderPass {
        let mut surfaces: Vec<_> = surfaces
            .into_iter()
            .zip(attachments)
            .map(|(tiles, attachment)| Some((tiles?, attachment.as_ref()?.format)))
            .collect();
        let depth = surfaces.pop().flatten().map(|(tiles, _)| tiles);
        RenderPass::begin(self.width, self.height, self.samples, surfaces, depth)
    }
}

impl Landed {
    /// Sums of all kinds of work, in the order of [`Ledger::meters`], with what the pass came to.
    fn added_to(&self, mut sums: [u64; 7]) -> [u64; 7] {
        for (at, more) in [(2, self.quads), (4, self.steps), (5, self.bytes)] {
            sums[at] = sums[at].saturating_add(more);
        }
        sums
    }

    fn add(&mut self, funnel: Funnel, overwritten: u64) {
        *self.counted.get_or_insert_default() += funnel;
        self.overwritten += overwritten;
    }
}

/// A thread that waits and helps meanwhile.
struct Helper<'a> {
    halved: &'a AtomicUsize,
    /// The number of times that it has looked for something to do in vain.
    looked: u32,
}

impl Helper<'_> {
    /// Runs one task of the pool, or lets other threads have the processor; whether to look again at once.
    fn help(&mut self) -> bool {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            self.looked = 0;
            return true;
        }
        // The geometry of some draws is there to be computed every few ten microseconds: who sleeps misses it.
        self.looked += 1;
        if self.halved.load(Relaxed) > 0 && self.looked < LOOKS {
            std::thread::yield_now();
            return true;
        }
        self.looked = 0;
        false
    }
}
