//! Turns: what a task does for a pass before it lets others have the thread.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::Ordering::*;

use super::super::draw::{DrawCall, DrawError, Drawn};
use super::super::queued::QueuedDraw;
use super::{CHAIN, Close, Flight, KEPT, Landed, Painter, Start, lock};

/// The largest number of lists of draws that one turn takes while a thread is idle. The idle thread computes the geometry of some draws
/// while this one draws the fragments of others.
const LONG_TURN: usize = 8;

impl Flight {
    /// Does some draws; the last turn ends the pass.
    pub(super) fn turn(self: Arc<Flight>) {
        let mut queue = lock(&self.queue);
        // Two halves of draws are as much work as two passes.
        let ahead = !queue.draws.is_empty() && self.running.load(Relaxed) < rayon::current_num_threads();
        let n = queue.draws.len().min(if ahead { LONG_TURN } else { 1 });
        match (ahead, queue.ahead) {
            (true, false) => drop(self.halved.fetch_add(1, Relaxed)),
            (false, true) => drop(self.halved.fetch_sub(1, Relaxed)),
            _ => {}
        }
        queue.ahead = ahead;
        if n == 0 && queue.closed.is_none() {
            queue.running = false;
            self.running.fetch_sub(1, Relaxed);
            return;
        }
        let (draws, closed): (Vec<Vec<QueuedDraw>>, _) = (queue.draws.drain(..n).collect(), queue.closed);
        drop(queue);
        self.waiting.fetch_sub(draws.iter().map(Vec::len).sum(), Relaxed);
        let mut painter = lock(&self.painter);
        let work = || {
            self.begin(&mut painter);
            match closed {
                Some(how) if draws.is_empty() => self.end(&mut painter, how),
                _ => self.draw(&mut painter, draws, ahead),
            }
        };
        let stopped = catch_unwind(AssertUnwindSafe(work));
        if let Err(panic) = stopped {
            self.failed.store(true, Relaxed);
            painter.panic = Some(panic);
        }
        drop(painter);
        if n > 0 {
            return self.spawn();
        }
        self.running.fetch_sub(1, Relaxed);
        let asleep = lock(&self.sleepers.0);
        self.over.store(true, Release);
        self.sleepers.1.notify_all();
        drop(asleep);
        let behind = std::mem::take(&mut *lock(&self.behind));
        behind.iter().for_each(Flight::go_on);
    }

    /// Takes over the images that the passes before it have left.
    fn begin(&self, painter: &mut Painter) {
        if std::mem::replace(&mut painter.begun, true) {
            return;
        }
        let mut surfaces = std::mem::take(&mut painter.tiles);
        painter.tiles = surfaces.iter().map(|_| None).collect();
        for (surface, start) in surfaces.iter_mut().zip(&mut painter.starts) {
            let Some(Start::Behind(away, clearing)) = start else { continue };
            // Where that pass has failed, all is drawn again, in order; it may be under way, so that its lock is taken.
            let source = away.flight();
            let whole = !source.failed.load(Acquire);
            let taken = if whole { lock(&source.painter).tiles[away.slot].take() } else { None };
            let Some(mut tiles) = taken else { return self.failed.store(true, Relaxed) };
            tiles.clear_masked(clearing.value, clearing.mask);
            if self.kept.0 > KEPT || self.kept.1 > CHAIN {
                *start = Some(Start::Copy(tiles.clone()));
            }
            *surface = Some(tiles);
        }
        painter.pass = Some(self.begin.pass(&self.attachments, surfaces));
    }

    fn draw(&self, painter: &mut Painter, draws: Vec<Vec<QueuedDraw>>, ahead: bool) {
        let Painter { pass, done, landed, .. } = painter;
        let (shared, ledger) = (&self.begin.shared, &self.ledger);
        let goes_on = || !self.failed.load(Relaxed) && !self.cancelled.load(Relaxed);
        let mut came_to = |drawn: Result<Drawn, DrawError>| match drawn {
            Ok(drawn) => landed.add(drawn.funnel, drawn.overwritten),
            Err(_) => self.failed.store(true, Relaxed),
        };
        // A pass that has failed before its first draw has no images.
        let Some(pass) = pass.as_mut().filter(|_| goes_on()) else { return done.extend(draws) };
        if ahead {
            // Set the largest amount alive of all draws, since the order of their turns is not known: a limit that allows the most allows less.
            let draws: Vec<&QueuedDraw> = draws.iter().flatten().collect();
            ledger.set_alive(draws.iter().map(|draw| draw.alive).max().unwrap_or(0));
            let calls = |number: usize, work: &mut dyn FnMut(&DrawCall<'_>)| draws[number].lend(shared, ledger, work);
            pass.draw_all(draws.len(), &calls, &mut |_, drawn| {
                came_to(drawn);
                goes_on()
            });
        } else {
            for draw in draws.iter().flatten() {
                if goes_on() {
                    ledger.set_alive(draw.alive);
                    came_to(draw.draw(pass, shared, ledger, &mut |_| ()));
                }
            }
        }
        done.extend(draws);
    }

    /// Ends the pass, if no draw has failed.
    fn end(&self, painter: &mut Painter, how: Close) {
        if self.failed.load(Relaxed) {
            return;
        }
        let [_, _, quads, _, steps, bytes, _] = self.ledger.sums();
        painter.landed = Landed { steps, quads, bytes, ..painter.landed };
        if how == Close::End {
            let ended = painter.pass.take().map(|pass| self.ended(pass));
            painter.tiles = ended.unwrap_or_default();
        }
    }
}
