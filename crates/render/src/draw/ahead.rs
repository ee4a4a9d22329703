//! Draws in a row, each small: the geometry of some is computed beside the fragments of those before them, so that a pass of many such draws
//! has two threads. Geometry reads nothing that draws of the same pass write, so what comes out is what comes out of one draw after the other.

use std::sync::atomic::Ordering::{Acquire, Relaxed, Release};
use std::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use shader::Uniforms;

use super::fragments::Images;
use super::frame::{PreparedDraw, Workers};
use super::geometry::{Geometry, Segments, Stages, plan};
use super::pass::{Memory, Scratch, draw, resolve};
use super::settings::{Attachments, Settings};
use super::{DrawCall, DrawError, Drawn, RenderPass};

/// The largest number of draws whose geometry is computed before their fragments are drawn. It is large enough that one draw of much geometry
/// makes no thread wait, and small enough that the geometry stays in caches.
const AHEAD: usize = u32::BITS as usize;

/// Vertices, or indices, times instances of a draw whose geometry is computed ahead, at most: a larger one has all threads for itself.
const LARGE: u64 = 4096;

/// The number of times that a thread checks for the other thread's progress before it yields to the scheduler.
const SPINS: u32 = 100;

/// Lends a draw by its number.
pub type Calls<'a> = dyn Fn(usize, &mut dyn FnMut(&DrawCall<'_>)) + Sync + 'a;

/// A draw between its halves.
#[derive(Default)]
struct Slot {
    stages: Stages,
    uniforms: [Uniforms; 2],
    half: Half,
}

#[derive(Default)]
enum Half {
    /// Nothing of it is done.
    #[default]
    Whole,
    /// Its geometry, if it draws anything.
    Made(Arc<Settings>, Option<Geometry>),
    Failed(DrawError),
}

/// Memory of draws whose geometry is computed ahead.
pub struct Ahead {
    /// The workers of the thread that computes geometry alone. Two threads that use the same workers would wait for each other when work is
    /// counted. The fragments' thread may wait for a draw of this thread, which therefore must end. So this thread shares no work: while it
    /// waited for its share, it could take up a row of draws that waits, through others, for the first thread.
    workers: Workers,
    slots: Vec<Mutex<Slot>>,
}

impl Ahead {
    /// Memory for the current pool; slots come with the first draws.
    pub fn new() -> Ahead {
        Ahead { workers: Workers::alone(), slots: Vec::new() }
    }
}

/// Draws in a row that two threads do: the geometry of each is computed by the one that comes to it first, the fragments by one of them, in
/// order.
struct Row<'a> {
    draws: usize,
    calls: &'a Calls<'a>,
    attachments: &'a Attachments,
    tiles: [u32; 2],
    ahead: &'a Ahead,
    /// The first draw whose geometry nobody computes yet.
    next: AtomicUsize,
    /// Draws whose fragments are drawn.
    finished: AtomicUsize,
    /// Slots that have no draw, a bit each. The first is taken, so that few are in use, and in caches, where draws wait for no other thread.
    free: AtomicU32,
    /// The slots of draws whose geometry is ready. Entry `number % AHEAD` holds the draw's number and its slot.
    ready: [AtomicUsize; AHEAD],
    /// A thread computes geometry alone, or is to do so.
    helped: AtomicBool,
    /// It has panicked.
    broken: AtomicBool,
}

/// The next task for a thread that computes geometry.
enum Task {
    Draw(usize),
    /// Slots have to be free.
    Wait,
    /// Nothing more.
    End,
}

/// Ends a row where its fragments end, with a panic too: nothing more is to be computed for it.
struct Ending<'a>(&'a Row<'a>);

impl Drop for Ending<'_> {
    fn drop(&mut self) {
        self.0.next.store(self.0.draws, Relaxed);
    }
}

/// Says that a thread that has computed geometry leaves.
struct Leaving<'a>(&'a Row<'a>);

impl Drop for Leaving<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            self.0.broken.store(true, Release);
        }
        self.0.helped.store(false, Release);
    }
}

impl Row<'_> {
    /// Takes the next draw.
    fn take(&self) -> Task {
        loop {
            let next = self.next.load(Relaxed);
            if next >= self.draws {
                return Task::End;
            }
            if next >= self.finished.load(Acquire) + AHEAD {
                return Task::Wait;
            }
            if self.next.compare_exchange_weak(next, next + 1, Relaxed, Relaxed).is_ok() {
                return Task::Draw(next);
            }
        }
    }

    /// Takes the first free slot: there are as many as draws between their halves.
    fn take_slot(&self) -> usize {
        let first = self.free.fetch_update(Acquire, Relaxed, |free| Some(free & free.wrapping_sub(1)));
        first.unwrap_or_default().trailing_zeros() as usize
    }

    /// Computes the geometry of a draw, with the settings of the last one on this thread.
    fn prepare(&self, number: usize, last: &mut Option<Arc<Settings>>, workers: &Workers) {
        let at = self.take_slot();
        let mut slot = lock(&self.ahead.slots[at]);
        (self.calls)(number, &mut |call| {
            let half = slot.prepare(call, self.attachments, self.tiles, last, workers);
            slot.half = half.unwrap_or_else(Half::Failed);
        });
        drop(slot);
        self.ready[number % AHEAD].store(number * AHEAD + at, Release);
    }

    /// Computes geometry until no draw is left, or until enough of it waits that other work may be more urgent.
    fn geometry(&self) {
        let _leaving = Leaving(self);
        let mut last = None;
        while let Task::Draw(number) = self.take() {
            self.prepare(number, &mut last, &self.ahead.workers);
        }
    }

    /// Whether the caller has to ask another thread for geometry. Notes that it was asked.
    fn asks(&self) -> bool {
        let (next, finished) = (self.next.load(Relaxed), self.finished.load(Relaxed));
        next < self.draws && next <= finished + AHEAD / 2 && !self.helped.swap(true, Acquire)
    }

    /// The slot of a draw with its geometry. Waits for it, and computes some meanwhile; none where it does not come.
    fn slot_of(&self, number: usize, last: &mut Option<Arc<Settings>>, workers: &Workers) -> Option<usize> {
        let mut waited = 0;
        loop {
            let ready = self.ready[number % AHEAD].load(Acquire);
            if ready / AHEAD == number {
                return Some(ready % AHEAD);
            }
            match self.take() {
                Task::Draw(number) => self.prepare(number, last, workers),
                _ if self.broken.load(Acquire) => return None,
                Task::Wait | Task::End if waited < SPINS => {
                    waited += 1;
                    std::hint::spin_loop();
                }
                Task::Wait | Task::End => std::thread::yield_now(),
            }
        }
    }
}

fn lock(slot: &Mutex<Slot>) -> MutexGuard<'_, Slot> {
    // After a panic of a task, its data are made anew.
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Slot {
    /// The geometry half of a draw.
    fn prepare(
        &mut self,
        call: &DrawCall<'_>,
        attachments: &Attachments,
        tiles: [u32; 2],
        last: &mut Option<Arc<Settings>>,
        workers: &Workers,
    ) -> Result<Half, DrawError> {
        if call.record || u64::from(call.range.count) * u64::from(call.range.instances) > LARGE {
            return Ok(Half::Whole);
        }
        let settings = resolve(last.take(), call, attachments)?;
        let frame = PreparedDraw::new(call, &settings, &mut self.uniforms);
        plan(call, &frame, &mut self.stages.planner)?;
        let made = Segments::new(call, &frame, tiles).next(call, &frame, workers, &mut self.stages)?;
        *last = Some(settings.clone());
        Ok(Half::Made(settings, made))
    }

    /// Draws the fragments of a draw, after its geometry if that is not done yet.
    fn finish(
        &mut self,
        call: &DrawCall<'_>,
        attachments: &Attachments,
        images: &mut Images,
        last: &mut Option<Arc<Settings>>,
        workers: &Workers,
    ) -> Result<Drawn, DrawError> {
        let Slot { stages, uniforms, half } = self;
        let (settings, mut made) = match std::mem::take(half) {
            Half::Whole => return draw(call, attachments, images, last, Memory { workers, stages, uniforms }, &mut |_| ()),
            Half::Failed(error) => return Err(error),
            Half::Made(settings, made) => (settings, made),
        };
        let frame = PreparedDraw::again(call, &settings, uniforms);
        let mut segments = Segments::new(call, &frame, images.tiles);
        let mut drawn = Drawn::default();
        while let Some(first) = made {
            drawn += images.fragments(call, &frame, workers, stages, first, &mut |_| ())?;
            made = segments.next(call, &frame, workers, stages)?;
        }
        Ok(drawn)
    }
}

impl RenderPass {
    /// Does some draws, none of which is recorded, in the order of their numbers, and says what each came to, until that is answered with no.
    pub fn draw_all(&mut self, draws: usize, calls: &Calls<'_>, each: &mut dyn FnMut(usize, Result<Drawn, DrawError>) -> bool) {
        let mut scratch = self.scratch.take().unwrap_or_else(Scratch::take);
        let Scratch { workers, ahead, .. } = &mut *scratch;
        ahead.slots.resize_with(AHEAD, Mutex::default);
        let row = Row {
            draws,
            calls,
            attachments: &self.attachments,
            tiles: self.images.tiles,
            ahead,
            next: AtomicUsize::new(0),
            finished: AtomicUsize::new(0),
            free: AtomicU32::new(u32::MAX),
            ready: std::array::from_fn(|_| AtomicUsize::new(usize::MAX)),
            helped: AtomicBool::new(false),
            broken: AtomicBool::new(false),
        };
        let (images, settings, workers, row) = (&mut self.images, &mut self.settings, &*workers, &row);
        rayon::in_place_scope(|scope| {
            let (_ending, mut last, mut on) = (Ending(row), None, true);
            for number in 0..draws {
                if row.asks() {
                    scope.spawn(|_| row.geometry());
                }
                let Some(at) = row.slot_of(number, settings, workers).filter(|_| on) else { break };
                let mut slot = lock(&row.ahead.slots[at]);
                calls(number, &mut |call| {
                    on = each(number, slot.finish(call, row.attachments, images, &mut last, workers));
                });
                drop(slot);
                row.free.fetch_or(1 << at, Release);
                row.finished.store(number + 1, Release);
            }
        });
        self.scratch = Some(scratch);
    }
}
