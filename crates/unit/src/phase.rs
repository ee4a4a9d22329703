//! Phases of a frame: what the command processor begins one after another. One ends when the next begins. Where passes overlap
//! (`command.overlap`), what is still under way of the one before then counts to the next.

use std::fmt;
use std::sync::Arc;

use num::Cycle;
use work::{Draw, Funnel};

/// The kind of work of a phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum PhaseKind {
    /// Uploads, copies and clears outside passes, as far as they follow each other.
    Transfers,
    /// A render pass, its clears, composition and resolves included.
    Pass,
    /// A compute dispatch.
    Dispatch,
    /// The picture is read.
    ScanOut,
}

impl PhaseKind {
    /// The name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            PhaseKind::Transfers => "transfers",
            PhaseKind::Pass => "pass",
            PhaseKind::Dispatch => "dispatch",
            PhaseKind::ScanOut => "scan-out",
        }
    }
}

/// The beginning of a phase.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Phase {
    /// The kind of work.
    pub kind: PhaseKind,
    /// Number of the pass or dispatch in its frame; 0 elsewhere.
    pub number: u32,
    /// Label of the pass or of the dispatch's pipeline, or empty.
    pub label: String,
    /// When the command processor began it.
    pub begin: Cycle,
    /// The unit that bounds it, or two that do in turn, where it was estimated; empty where it was simulated.
    pub limit: String,
}

impl fmt::Display for Phase {
    /// Its kind, the number of a pass or dispatch, and its label.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.kind.name())?;
        if matches!(self.kind, PhaseKind::Pass | PhaseKind::Dispatch) {
            write!(f, " {}", self.number)?;
        }
        if self.label.is_empty() { Ok(()) } else { write!(f, " {}", self.label) }
    }
}

/// A draw on its way through a machine.
#[derive(Clone, Debug)]
pub struct DrawRecord {
    /// The draw.
    pub draw: Arc<Draw>,
    /// Number of the draw on this machine.
    number: u32,
    /// The counts of its retired segments.
    pub funnel: Funnel,
    /// The cycle in which its last segment retired. None if no segment has.
    pub retired: Option<Cycle>,
}

/// A phase that has begun.
#[derive(Clone, Debug)]
pub struct PhaseRecord {
    /// The phase.
    pub phase: Phase,
    /// Its draws, where they are recorded.
    pub draws: Vec<DrawRecord>,
    /// The cycles from which on tiles were drawn whose triangles had been binned, where draws are recorded.
    pub flushes: Vec<Cycle>,
    /// The counts of its draws' retired segments, in whatever phase they retired.
    pub funnel: Funnel,
    /// The number of its last draw on this machine.
    last: Option<u32>,
}

/// The event that has just ended, so that counters are to be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mark {
    /// The phase before the one that begins here.
    Phase,
    /// A segment of a draw, by the place of its phase in the frame and its own in the phase.
    Draw(usize, usize),
}

/// The phases of a frame so far.
#[derive(Clone, Debug, Default)]
pub struct Phases {
    list: Vec<PhaseRecord>,
    /// Whether draws are recorded.
    per_draw: bool,
    marks: Vec<Mark>,
}

impl Phases {
    /// No phase.
    pub fn new(per_draw: bool) -> Phases {
        Phases { per_draw, ..Phases::default() }
    }

    /// A phase begins behind cycle `now`; transfers join transfers.
    pub fn begin(&mut self, kind: PhaseKind, number: u32, label: &str, now: Cycle) {
        let joins = kind == PhaseKind::Transfers && self.list.last().is_some_and(|last| last.phase.kind == kind);
        if !joins {
            self.marks.push(Mark::Phase);
            let phase = Phase { kind, number, label: label.to_owned(), begin: now + 1, limit: String::new() };
            self.list.push(PhaseRecord {
                phase,
                draws: Vec::new(),
                flushes: Vec::new(),
                funnel: Funnel::default(),
                last: None,
            });
        }
    }

    /// A draw begins, with its number on this machine.
    pub fn draw(&mut self, draw: &Arc<Draw>, number: u32) {
        let Some(PhaseRecord { draws, last, .. }) = self.list.last_mut() else { return };
        *last = Some(number);
        if self.per_draw {
            draws.push(DrawRecord { draw: draw.clone(), number, funnel: Funnel::default(), retired: None });
        }
    }

    /// What is binned begins to be drawn, tile by tile, behind cycle `now`.
    pub fn flush(&mut self, now: Cycle) {
        if let Some(record) = self.list.last_mut().filter(|_| self.per_draw) {
            record.flushes.push(now + 1);
        }
    }

    /// A segment of a draw has retired in cycle `now`, with what it has counted.
    pub fn retire(&mut self, number: u32, funnel: Funnel, now: Cycle) {
        // Where passes overlap, it may be of a phase before the last. Numbers of draws only grow.
        let before = |record: &PhaseRecord| record.last.is_some_and(|last| (last.wrapping_sub(number) as i32) < 0);
        let first = self.list.iter().rposition(before).map_or(0, |at| at + 1);
        let Some(at) = self.list[first..].iter().position(|record| record.last.is_some()) else { return };
        let phase = first + at;
        let record = &mut self.list[phase];
        record.funnel += funnel;
        if let Some(at) = record.draws.iter().rposition(|draw| draw.number == number) {
            record.draws[at].funnel += funnel;
            record.draws[at].retired = Some(now + 1);
            self.marks.push(Mark::Draw(phase, at));
        }
    }

    /// Whether counters are to be read.
    #[inline(always)]
    pub fn marked(&self) -> bool {
        !self.marks.is_empty()
    }

    /// The events for which counters are to be read, in order.
    pub fn marks(&mut self) -> std::vec::Drain<'_, Mark> {
        self.marks.drain(..)
    }

    /// Drops what was begun and is not read.
    pub fn forget(&mut self) {
        self.marks.clear();
        self.list.clear();
    }

    /// The phases of the frame from `begin` to `end`, each with its cycles, which add up to the frame's: what comes before the
    /// first is the first's. Empties the list.
    pub fn take(&mut self, begin: Cycle, end: Cycle) -> Vec<(PhaseRecord, Cycle)> {
        let mut list = std::mem::take(&mut self.list);
        if let Some(first) = list.first_mut() {
            first.phase.begin = begin;
        }
        let ends: Vec<Cycle> = list.iter().skip(1).map(|record| record.phase.begin).chain([end]).collect();
        list.into_iter()
            .zip(ends)
            .map(|(record, end)| {
                let cycles = end - record.phase.begin;
                (record, cycles)
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_fill_the_frame() {
        let mut phases = Phases::default();
        for (kind, at) in
            [(PhaseKind::Transfers, 12), (PhaseKind::Transfers, 14), (PhaseKind::Pass, 20), (PhaseKind::ScanOut, 90)]
        {
            phases.begin(kind, 0, "", at);
        }
        let cycles: Vec<_> =
            phases.take(10, 100).into_iter().map(|(record, cycles)| (record.phase.kind.name(), cycles)).collect();
        assert_eq!(cycles, [("transfers", 11), ("pass", 70), ("scan-out", 9)]);
        assert!(phases.marks().eq([Mark::Phase; 3]));
        assert!(phases.take(100, 110).is_empty());
    }
}
