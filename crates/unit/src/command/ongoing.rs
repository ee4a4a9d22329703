//! Passes, dispatches and copies under way, and which of them the next one has to wait for.
//!
//! One begins while another is under way if the card runs their kinds beside each other (`command.overlap`, `command.async_compute`) and
//! neither may write what the other may touch. What a pass or dispatch may touch is known by its attachments and by what is bound to its
//! draws, as a driver knows it. A draw waits by itself: its pass may have begun before.

use super::Command;
use work::Reach;

/// The kind of work that is under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Doing {
    /// A pass.
    Pass,
    /// A dispatch.
    Dispatch,
    /// A copy, an upload or a clear of memory.
    Copy,
}

/// A pass, dispatch or copy under way.
#[derive(Clone, Debug)]
pub(super) struct Ongoing {
    /// Its number.
    number: u32,
    doing: Doing,
    /// The memory that it may touch. For a pass: up to its last draw.
    reach: Reach,
    /// For a dispatch, the runs of workgroups in flight.
    runs: u32,
}

/// All that is under way, in the order in which it began.
#[derive(Clone, Debug, Default)]
pub(super) struct AllOngoing {
    list: Vec<Ongoing>,
    begun: u32,
    /// The number of the pass whose draws are being read, and of the dispatch whose runs are.
    pass: Option<u32>,
    dispatch: Option<u32>,
    /// For each slot of a run the number of its dispatch.
    of_run: Vec<u32>,
}

impl AllOngoing {
    /// Nothing is under way. The machine may have `runs` runs of workgroups in flight.
    pub fn new(runs: usize) -> AllOngoing {
        AllOngoing { of_run: vec![0; runs], ..AllOngoing::default() }
    }

    pub fn is_empty(&self) -> bool {
        self.list.is_empty()
    }

    /// Begins something.
    pub fn begin(&mut self, doing: Doing, reach: Reach) -> u32 {
        let number = self.begun;
        self.begun = number.wrapping_add(1);
        self.list.push(Ongoing { number, doing, reach, runs: 0 });
        match doing {
            Doing::Pass => self.pass = Some(number),
            Doing::Dispatch => self.dispatch = Some(number),
            Doing::Copy => {}
        }
        number
    }

    /// The pass whose draws are being read may touch more.
    pub fn widen(&mut self, reach: &Reach) {
        if let Some(pass) = self.list.iter_mut().find(|ongoing| Some(ongoing.number) == self.pass) {
            pass.reach.add(reach);
        }
    }

    /// No further draw of the pass that is being read follows; gives its number.
    pub fn close_pass(&mut self) -> Option<u32> {
        self.pass.take()
    }

    /// A run of the dispatch that is being read begins in a slot.
    pub fn begin_run(&mut self, slot: u16) {
        let Some(number) = self.dispatch else { return };
        self.of_run[usize::from(slot)] = number;
        self.list.iter_mut().filter(|ongoing| ongoing.number == number).for_each(|ongoing| ongoing.runs += 1);
    }

    /// The run in a slot is done.
    pub fn end_run(&mut self, slot: u16) {
        let number = self.of_run[usize::from(slot)];
        self.list.iter_mut().filter(|ongoing| ongoing.number == number).for_each(|ongoing| ongoing.runs -= 1);
        self.end_dispatches();
    }

    /// No further run of the dispatch that is being read follows.
    pub fn close_dispatch(&mut self) {
        if self.dispatch.take().is_some() {
            self.end_dispatches();
        }
    }

    fn end_dispatches(&mut self) {
        let read = self.dispatch;
        self.list.retain(|ongoing| ongoing.doing != Doing::Dispatch || ongoing.runs > 0 || Some(ongoing.number) == read);
    }

    /// Something is done.
    pub fn end(&mut self, number: u32) {
        self.list.retain(|ongoing| ongoing.number != number);
    }

    /// Whether something else than the pass that is being read is under way.
    pub fn others(&self) -> bool {
        self.list.iter().any(|ongoing| Some(ongoing.number) != self.pass)
    }
}

impl Command {
    /// Whether work of one kind runs beside work of another kind.
    fn runs_beside(&self, one: Doing, other: Doing) -> bool {
        if one == Doing::Dispatch || other == Doing::Dispatch { self.config.async_compute } else { self.config.overlap }
    }

    /// Whether work that may touch `reach` must wait for work under way. A draw belongs to the pass that is being read, and does not wait for
    /// that pass.
    pub(super) fn must_wait(&mut self, doing: Doing, reach: &Reach) -> bool {
        let waits = self.ongoing.list.iter().any(|ongoing| {
            Some(ongoing.number) != self.ongoing.pass
                && (!self.runs_beside(doing, ongoing.doing) || ongoing.reach.conflicts(reach))
        });
        self.held |= waits;
        waits
    }

    /// Whether all work under way must end first.
    pub(super) fn must_drain(&mut self) -> bool {
        let waits = self.ongoing.others();
        self.held |= waits;
        waits
    }
}
