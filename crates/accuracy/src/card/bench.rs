//! A card under test: traces are replayed on it, and cycles and counters are read.

use anyhow::{Context, Result, ensure};

use super::ByLength;
use machine::{Config, Tally};
use run::replay::{Fidelity, Options, replay};
use trace::Trace;
use unit::phase::PhaseKind;

/// A card under test.
pub(super) struct Bench {
    config: Config,
}

/// What the last pass or dispatch of a trace took.
#[derive(Clone, Debug)]
pub(super) struct Phase {
    /// Cycles, from the command to the end of all that it started.
    pub cycles: f64,
    /// What was counted in them.
    pub counts: Tally,
}

impl Bench {
    /// A card.
    pub fn new(config: Config) -> Bench {
        Bench { config }
    }

    /// Its configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The last pass or dispatch of a trace.
    ///
    /// # Errors
    /// If the trace cannot be replayed, or has neither.
    pub fn last(&self, trace: &Trace) -> Result<Phase> {
        let options = Options { pictures: false, ..Options::new(self.config.clone(), Fidelity::Cycle) };
        let replayed = replay(trace, &options, &|_| ())?;
        let phases = replayed.frames.into_iter().flat_map(|frame| frame.phases);
        let phase = phases
            .filter(|phase| matches!(phase.phase.kind, PhaseKind::Pass | PhaseKind::Dispatch))
            .last()
            .context("the trace has no pass and no dispatch")?;
        let counts = phase.counts.context("nothing was counted")?;
        Ok(Phase { cycles: phase.cycles as f64, counts: *counts })
    }

    /// The cycles that a trace takes longer for each unit of its length: beginnings and ends are the same in both.
    ///
    /// # Errors
    /// As [`Bench::last`]; if the longer trace does not take longer.
    pub fn slope(&self, trace: ByLength<'_>, [short, long]: [u32; 2]) -> Result<f64> {
        let [before, after] = [self.last(&trace(short))?.cycles, self.last(&trace(long))?.cycles];
        ensure!(after > before, "length {long} takes {after} cycles, and length {short} {before}");
        Ok((after - before) / f64::from(long - short))
    }

    /// What a counter of the longer trace has more than that of the shorter, for each unit of length.
    ///
    /// # Errors
    /// As [`Bench::last`].
    pub fn more(&self, trace: ByLength<'_>, [short, long]: [u32; 2], count: impl Fn(&Phase) -> f64) -> Result<f64> {
        let [before, after] = [count(&self.last(&trace(short))?), count(&self.last(&trace(long))?)];
        Ok((after - before) / f64::from(long - short))
    }

    /// Bytes of the DRAM's pins in a cycle of the card.
    pub fn pins(&self) -> f64 {
        pins(&self.config)
    }
}

/// Bytes of the DRAM's pins in a cycle of the card.
pub(super) fn pins(config: &Config) -> f64 {
    let dram = &config.dram;
    let [channels, bytes, cycles] = [dram.channels, dram.burst_bytes, dram.burst_cycles].map(f64::from);
    channels * bytes / cycles * f64::from(dram.clock) / f64::from(dram.card_cycles)
}
