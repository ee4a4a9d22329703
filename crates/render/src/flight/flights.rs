//! All passes in flight, and the one whose commands are still read.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::atomic::AtomicUsize;
use std::sync::atomic::Ordering::Relaxed;

use work::Funnel;

use super::super::attachments::{kept, lost};
use super::super::draw::RenderPass;
use super::super::ledger::{FLIGHTS, Ledger};
use super::super::queued::QueuedDraw;
use super::super::surface::{ALL, Shape, TileSurface};
use super::images::{Away, Ticket};
use super::{Attached, Begin, Boarding, Close, DRAWS, Failure, Flight, Helper, Landed, NAP, TURN, WAITING, lock};

/// Images of passes that have been replaced, kept for the memory that they have.
const SPARE: usize = 3 * FLIGHTS;

/// All passes in flight.
#[derive(Default)]
pub(in super::super) struct Flights {
    /// In order; of the last ones it is not known how they end.
    pub(super) air: VecDeque<Arc<Flight>>,
    /// Images that were replaced.
    spare: VecDeque<(Arc<Flight>, usize)>,
    pub(super) waiting: Arc<AtomicUsize>,
    pub(super) running: Arc<AtomicUsize>,
    pub(super) halved: Arc<AtomicUsize>,
}

impl Flights {
    /// Whether passes may be in flight on this thread's pool.
    pub fn are_possible() -> bool {
        rayon::current_thread_index().is_some() && rayon::current_num_threads() > 1
    }

    /// Whether the first pass in flight is over.
    pub fn is_over(&self) -> bool {
        self.air.front().is_some_and(|flight| flight.is_over())
    }

    /// Memory for an image that replaces another, whatever it holds.
    pub fn surface(&mut self, shape: Shape, replaced: Away) -> TileSurface {
        self.spare.push_back((replaced.flight().clone(), replaced.slot));
        let fits = |(flight, slot): &(Arc<Flight>, usize)| {
            // Only an image that is there already: this must not wait. Nothing else reads it, since there is one `Away` of an image; draws of its
            // pass that are done again have memory of their own.
            let painter = flight.is_over().then(|| lock(&flight.painter));
            painter
                .is_some_and(|painter| painter.tiles.get(*slot).is_some_and(|t| t.as_ref().is_some_and(|t| t.shape() == shape)))
        };
        let found = self.spare.iter().position(fits).and_then(|at| self.spare.remove(at));
        let tiles = found.and_then(|(flight, slot)| lock(&flight.painter).tiles[slot].take());
        while self.spare.len() > SPARE {
            self.spare.pop_front();
        }
        tiles.unwrap_or_else(|| TileSurface::new(shape))
    }

    /// Whether no other pass can be in flight: there is one per thread, and one that is being looked up.
    pub fn is_full(&self) -> bool {
        self.air.len() >= FLIGHTS.min(rayon::current_num_threads() + 1)
    }

    /// A pass takes off.
    pub fn depart(&mut self, begin: Begin, boarding: Vec<Option<Boarding>>, ledger: &Arc<Ledger>) -> Departure {
        let flight = Flight::new(begin, boarding, ledger, self);
        self.air.push_back(flight.clone());
        let depth = flight.attachments.last().and_then(Option::as_ref).map_or([0; 4], |depth| depth.known);
        Departure { flight, draws: Vec::with_capacity(TURN), depth }
    }

    /// The outcome of the first pass in flight. Waits for its end. The caller adds it to the sums.
    ///
    /// # Errors
    /// If a draw could not be done.
    pub fn land(&mut self) -> Option<Result<(Landed, Arc<Flight>), Failure>> {
        let flight = self.air.front()?.clone();
        let landed = flight.settle();
        self.air.pop_front();
        Some(landed.map(|landed| (landed, flight)))
    }
}

impl Drop for Flights {
    fn drop(&mut self) {
        self.air.iter().for_each(|flight| flight.cancelled.store(true, Relaxed));
    }
}

/// The renderer's handle of a pass in flight whose commands it still reads.
pub(in super::super) struct Departure {
    flight: Arc<Flight>,
    /// Draws that were not handed on yet.
    draws: Vec<QueuedDraw>,
    /// Bits of depth and stencil that are known of all texels.
    depth: [u32; 4],
}

impl Departure {
    /// Whether it has as many draws as it can have.
    pub fn is_full(&self) -> bool {
        self.flight.draws.load(Relaxed) >= DRAWS
    }

    /// Hands on a draw.
    pub fn push(&mut self, draw: QueuedDraw) {
        self.flight.draws.fetch_add(1, Relaxed);
        if let Some(attached) = self.flight.attachments.last().and_then(Option::as_ref) {
            let written = draw.pipeline.may_write(attached.format);
            self.depth = std::array::from_fn(|w| self.depth[w] & !written[w]);
        }
        self.draws.push(draw);
        if self.draws.len() == TURN {
            self.flight.push(&mut self.draws);
            let mut helper = Helper { halved: &self.flight.halved, looked: 0 };
            while self.flight.waiting.load(Relaxed) > WAITING {
                if !helper.help() {
                    std::thread::sleep(NAP);
                }
            }
        }
    }

    /// Ends the pass; what its attachments will hold.
    pub fn end(mut self) -> Vec<Option<Away>> {
        self.flight.push(&mut self.draws);
        self.flight.close(Close::End);
        let ticket = Arc::new(Ticket(self.flight.clone()));
        let away = |(slot, attached): (usize, &Option<Attached>)| {
            let attached = attached.as_ref()?;
            let depth = slot + 1 == self.flight.attachments.len();
            let lost = lost(attached.keeps, attached.shape.format);
            let (value, known) = match (kept(attached.keeps, attached.shape.format).any(), depth) {
                (false, _) => ([0; 4], ALL),
                // For colours, it is not checked which draws write them.
                (true, false) => ([0; 4], [0; 4]),
                (true, true) => {
                    (std::array::from_fn(|w| attached.value[w] & !lost[w]), std::array::from_fn(|w| self.depth[w] | lost[w]))
                }
            };
            Some(Away { ticket: ticket.clone(), slot, value, known })
        };
        self.flight.attachments.iter().enumerate().map(away).collect()
    }

    /// Hands on what is left, so that the pass can be waited for; whatever it has done so far is final.
    pub fn close(&mut self) {
        self.flight.push(&mut self.draws);
        self.flight.close(Close::Home);
    }

    /// The pass after [`Departure::close`], and what was counted in it; it has been waited for, and no draw has failed.
    pub fn home(self) -> (RenderPass, Option<Funnel>) {
        let mut painter = lock(&self.flight.painter);
        (painter.pass.take().expect("the pass has not ended"), painter.landed.counted)
    }
}
