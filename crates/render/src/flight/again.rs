//! A pass that was stopped is drawn again by the renderer's thread, with the sums of one thread.

use std::sync::Arc;
use std::sync::atomic::Ordering::Release;

use super::super::draw::RenderPass;
use super::super::queued::{Charges, QueuedDraw};
use super::super::surface::TileSurface;
use super::{Failure, Flight, Start, lock};

impl Flight {
    /// The sums of one thread when it begins.
    fn sums_behind(&self, ahead: &[Arc<Flight>]) -> [u64; 7] {
        ahead.iter().fold(self.sums, |sums, flight| lock(&flight.painter).landed.added_to(sums))
    }

    /// Whether the work of its draws, none of which has failed, exceeds what the passes ahead leave of the limits. If so, a pass had more than its
    /// share.
    pub(super) fn passes_limits(&self, ahead: &[Arc<Flight>]) -> bool {
        let before = self.sums_behind(ahead);
        let painter = lock(&self.painter);
        let mut sums = painter.landed.added_to(before);
        for Charges { vertices, prepared, steps, bindings } in painter.done.iter().flatten().map(|draw| &draw.charges) {
            for (at, more) in [(1, *vertices), (4, *steps), (5, bindings + prepared.iter().sum::<u64>())] {
                sums[at] = sums[at].saturating_add(more);
            }
        }
        self.whole.with_sums(sums).verify().is_err()
    }

    /// Draws it again, as the only pass. No lock is held: while this thread waits for others it may run tasks that need it.
    pub(super) fn again(&self, ahead: &[Arc<Flight>]) {
        let sums = self.sums_behind(ahead);
        let ledger = self.whole.with_sums(sums);
        let mut landed = self.begin.landed();
        let (starts, done) = self.kept_draws();
        let mut pass = self.first(&starts);
        let (mut steps, mut bytes) = (0, 0);
        for draw in done.iter().flatten() {
            ledger.set_alive(draw.alive);
            let charges = &draw.charges;
            (steps, bytes) = (steps + charges.steps, bytes + charges.bindings + charges.prepared.iter().sum::<u64>());
            let drawn = charges.charge(&ledger).map_err(|error| error.to_string()).and_then(|()| {
                draw.draw(&mut pass, &self.begin.shared, &ledger, &mut |_| ()).map_err(|error| error.to_string())
            });
            match drawn {
                Ok(drawn) => landed.add(drawn.funnel, drawn.overwritten),
                Err(reason) => {
                    lock(&self.painter).failure = Some(Failure { command: draw.command, reason });
                    return;
                }
            }
        }
        let now = ledger.sums();
        (landed.quads, landed.steps, landed.bytes) = (now[2] - sums[2], now[4] - sums[4] - steps, now[5] - sums[5] - bytes);
        let (pass, tiles) = if self.is_home() { (Some(pass), Vec::new()) } else { (None, self.ended(pass)) };
        let mut painter = lock(&self.painter);
        (painter.landed, painter.pass, painter.tiles) = (landed, pass, tiles);
        (painter.starts, painter.done) = (starts, done);
        self.failed.store(false, Release);
    }

    /// The initial contents and the draws that are needed to draw it again.
    pub(super) fn kept_draws(&self) -> (Vec<Option<Start>>, Vec<Vec<QueuedDraw>>) {
        let mut painter = lock(&self.painter);
        (std::mem::take(&mut painter.starts), std::mem::take(&mut painter.done))
    }

    /// The pass as it began, once more.
    fn first(&self, starts: &[Option<Start>]) -> RenderPass {
        let mut again: Vec<(&Arc<Flight>, Vec<Option<TileSurface>>)> = Vec::new();
        let mut surfaces = Vec::new();
        for (start, attached) in starts.iter().zip(&self.attachments) {
            surfaces.push(match (start, attached) {
                (Some(Start::Copy(tiles)), _) => Some(tiles.clone()),
                (&Some(Start::Cleared(value)), Some(attached)) => {
                    let mut tiles = TileSurface::new(attached.shape);
                    tiles.clear(value);
                    Some(tiles)
                }
                (Some(Start::Behind(away, clearing)), _) => {
                    let known = again.iter().position(|(flight, _)| Arc::ptr_eq(flight, away.flight()));
                    let at = known.unwrap_or_else(|| {
                        again.push((away.flight(), away.flight().images()));
                        again.len() - 1
                    });
                    let tiles = again[at].1[away.slot].take();
                    tiles.map(|mut tiles| {
                        tiles.clear_masked(clearing.value, clearing.mask);
                        tiles
                    })
                }
                _ => None,
            });
        }
        self.begin.pass(&self.attachments, surfaces)
    }

    /// The images that it has left, drawn once more. It has come to its end before.
    fn images(&self) -> Vec<Option<TileSurface>> {
        let (starts, done) = self.kept_draws();
        let mut pass = self.first(&starts);
        // These sums were allowed before.
        let ledger = self.whole.with_sums([0; 7]);
        for draw in done.iter().flatten() {
            ledger.set_alive(draw.alive);
            let _ = draw.draw(&mut pass, &self.begin.shared, &ledger, &mut |_| ());
        }
        let mut painter = lock(&self.painter);
        (painter.starts, painter.done) = (starts, done);
        drop(painter);
        self.ended(pass)
    }
}
