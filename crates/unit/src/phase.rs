//! Phases of a frame: what the command processor does one after another, and what nothing overlaps.

use std::fmt;

use num::Cycle;

/// What a phase is about.
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
    /// What it is about.
    pub kind: PhaseKind,
    /// Number of the pass or dispatch in the trace; 0 elsewhere.
    pub number: u32,
    /// Label of the pass or of the dispatch's pipeline, or empty.
    pub label: String,
    /// When the command processor began it; it lasts until the next begins.
    pub begin: Cycle,
    /// The unit that bounds it, where it was estimated; empty where it was simulated.
    pub limit: &'static str,
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

/// The phases of a frame so far.
#[derive(Clone, Debug, Default)]
pub struct Phases {
    list: Vec<Phase>,
}

impl Phases {
    /// A phase begins; transfers join transfers.
    pub fn begin(&mut self, kind: PhaseKind, number: u32, label: &str, begin: Cycle) {
        let joins = kind == PhaseKind::Transfers && self.list.last().is_some_and(|last| last.kind == kind);
        if !joins {
            self.list.push(Phase { kind, number, label: label.to_owned(), begin, limit: "" });
        }
    }

    /// The phases of the frame from `begin` to `end`, each with its cycles, which add up to the frame's: what comes before the
    /// first is the first's. Empties the list.
    pub fn take(&mut self, begin: Cycle, end: Cycle) -> Vec<(Phase, Cycle)> {
        let mut list = std::mem::take(&mut self.list);
        if let Some(first) = list.first_mut() {
            first.begin = begin;
        }
        let ends: Vec<Cycle> = list.iter().skip(1).map(|phase| phase.begin).chain([end]).collect();
        list.into_iter()
            .zip(ends)
            .map(|(phase, end)| {
                let cycles = end - phase.begin;
                (phase, cycles)
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
        let cycles: Vec<_> = phases.take(10, 100).into_iter().map(|(phase, cycles)| (phase.kind.name(), cycles)).collect();
        assert_eq!(cycles, [("transfers", 10), ("pass", 70), ("scan-out", 10)]);
        assert!(phases.take(100, 110).is_empty());
    }
}
