//! The activity of units and channels over time: a machine is read at intervals while it runs.

use anyhow::{Result, bail};

use machine::{Config, DrawReport, FrameReport, Machine, PhaseReport, Watcher};
use num::{Cycle, NEVER};
use sim::Reading;
use stats::Cycles;
use unit::phase::PhaseKind;

/// Samples that are kept where no interval is given: twice as many are joined two by two, and the interval doubles.
pub const SAMPLES: usize = 2000;

/// Samples that are kept where an interval is given.
const MOST: usize = 200_000;

/// The first interval where none is given.
const FIRST: Cycle = 16;

/// The activity between two readings.
#[derive(Clone, Debug, PartialEq)]
pub struct Sample {
    /// The first cycle.
    pub begin: Cycle,
    /// The cycle behind the last.
    pub end: Cycle,
    /// Cycles of the units of each bank.
    pub units: Vec<Cycles>,
    /// Items that the units of each bank held, summed over the cycles.
    pub held: Vec<u64>,
    /// Items in the channels of each name, summed over the cycles.
    pub occupancy: Vec<u64>,
}

/// Equal things: their name, and how many there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Bank {
    /// Their name.
    pub name: &'static str,
    /// How many.
    pub count: usize,
}

/// A phase of a frame, or a draw of a pass, on the clock of its timeline.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Span {
    /// The phase as the terminal names it; of a draw its label, or empty.
    pub name: String,
    /// Of a draw its number in the trace. None of a phase, and of the end of a pass.
    pub number: Option<u32>,
    /// Whether something is drawn or computed in it.
    pub draws: bool,
    /// The first cycle.
    pub begin: Cycle,
    /// The cycle behind the last.
    pub end: Cycle,
    /// Of a phase its draws in the order in which they retire, each from the retirement before it. Those that retire together have the span of
    /// their pass.
    pub parts: Vec<Span>,
}

impl Span {
    /// Whether draws of this phase retire together, so that each has the span of the phase.
    pub fn is_shared(&self) -> bool {
        self.parts.len() > 1 && self.parts.iter().all(|part| (part.begin, part.end) == (self.begin, self.end))
    }

    /// The phases of a frame that began at cycle 0.
    pub fn of(frame: &FrameReport) -> Vec<Span> {
        let mut at = 0;
        let phase = |report: &PhaseReport| {
            let (begin, end) = (at, at + report.cycles);
            at = end;
            let draws = matches!(report.phase.kind, PhaseKind::Pass | PhaseKind::Dispatch);
            let mut retired = begin;
            let draw = |draw: &DrawReport| {
                let [from, to] = if draw.halves.is_some() { [begin, end] } else { [retired, retired + draw.cycles] };
                retired = to;
                Span { name: draw.label.clone(), number: draw.number, draws: true, begin: from, end: to, parts: Vec::new() }
            };
            let parts = report.draws.iter().map(draw).collect();
            Span { name: report.phase.to_string(), number: None, draws, begin, end, parts }
        };
        frame.phases.iter().map(phase).collect()
    }
}

/// Takes the samples of a run.
#[derive(Clone, Debug)]
pub struct Timeline {
    /// Banks of units, in data-flow order.
    pub units: Vec<Bank>,
    /// Warps that a core holds at most.
    pub warps: u32,
    /// Names of channels, in the order of declaration.
    pub channels: Vec<Bank>,
    /// Samples in order, without gaps.
    pub samples: Vec<Sample>,
    /// The phases of the frame, where the timeline is of one frame that began at cycle 0.
    pub phases: Vec<Span>,
    unit_bank: Vec<usize>,
    channel_bank: Vec<usize>,
    interval: Cycle,
    /// Whether the user gave the interval. If so, it does not change.
    fixed: bool,
    due: Cycle,
    last: Option<Reading>,
    /// There were more samples than are kept.
    overflowed: bool,
}

fn banks(names: impl Iterator<Item = &'static str>) -> (Vec<Bank>, Vec<usize>) {
    let (mut banks, mut of): (Vec<Bank>, Vec<usize>) = (Vec::new(), Vec::new());
    for name in names {
        let at = banks.iter().position(|bank| bank.name == name).unwrap_or_else(|| {
            banks.push(Bank { name, count: 0 });
            banks.len() - 1
        });
        banks[at].count += 1;
        of.push(at);
    }
    (banks, of)
}

impl Timeline {
    /// A timeline of a machine. `interval` is in cycles; none: as short as [`SAMPLES`] samples allow.
    ///
    /// # Errors
    /// If knobs do not fit each other.
    pub fn new(config: &Config, interval: Option<Cycle>) -> Result<Timeline> {
        let machine = Machine::new(config)?;
        let (units, unit_bank) = banks(machine.units().map(|(name, _)| name));
        let (channels, channel_bank) = banks(machine.wires().map(|wire| wire.name));
        let (fixed, interval) = (interval.is_some(), interval.unwrap_or(FIRST).max(1));
        Ok(Timeline {
            units,
            warps: config.core.warps,
            channels,
            samples: Vec::new(),
            phases: Vec::new(),
            unit_bank,
            channel_bank,
            interval,
            fixed,
            due: interval,
            last: None,
            overflowed: false,
        })
    }

    /// Joins samples until there are at most `most`.
    pub fn reduce(&mut self, most: usize) {
        while self.samples.len() > most.max(1) {
            self.halve();
        }
    }

    /// The interval at the end, in cycles.
    pub fn interval(&self) -> Cycle {
        self.interval
    }

    /// The samples are complete.
    ///
    /// # Errors
    /// If there were too many for the interval that was given.
    pub fn check(&self) -> Result<()> {
        if self.overflowed {
            bail!("an interval of {} cycles gives more than {MOST} samples: take a longer one, or fewer frames", self.interval);
        }
        Ok(())
    }

    /// Joins samples two by two.
    fn halve(&mut self) {
        let mut joined = Vec::with_capacity(self.samples.len().div_ceil(2));
        let mut samples = std::mem::take(&mut self.samples).into_iter();
        while let Some(mut one) = samples.next() {
            if let Some(other) = samples.next() {
                one.end = other.end;
                one.units.iter_mut().zip(other.units).for_each(|(sum, own)| *sum += own);
                one.held.iter_mut().zip(other.held).for_each(|(sum, own)| *sum += own);
                one.occupancy.iter_mut().zip(other.occupancy).for_each(|(sum, own)| *sum += own);
            }
            joined.push(one);
        }
        self.samples = joined;
        self.interval *= 2;
    }

    fn take(&mut self, reading: &Reading) {
        // A machine begins with empty channels at cycle 0.
        let last = self.last.take();
        let begin = last.as_ref().map_or(0, |last| last.cycle);
        if reading.cycle <= begin {
            self.last = last;
            return;
        }
        let mut sample = Sample {
            begin,
            end: reading.cycle,
            units: vec![Cycles::default(); self.units.len()],
            held: vec![0; self.units.len()],
            occupancy: vec![0; self.channels.len()],
        };
        for (at, unit) in reading.units.iter().enumerate() {
            let own = last.as_ref().map_or(*unit, |last| unit.since(&last.units[at]));
            sample.units[self.unit_bank[at]] += own;
            let before = last.as_ref().map_or(0, |last| last.held[at]);
            sample.held[self.unit_bank[at]] += reading.held[at] - before;
        }
        for (at, channel) in reading.channels.iter().enumerate() {
            let before = last.as_ref().map_or(0, |last| last.channels[at].occupancy);
            sample.occupancy[self.channel_bank[at]] += channel.occupancy.wrapping_sub(before);
        }
        self.samples.push(sample);
        if !self.fixed && self.samples.len() >= 2 * SAMPLES {
            self.halve();
        } else if self.samples.len() > MOST {
            self.samples.clear();
            self.overflowed = true;
        }
    }
}

impl Watcher for Timeline {
    fn due(&self) -> Cycle {
        if self.overflowed { NEVER } else { self.due }
    }

    fn read(&mut self, reading: Reading) {
        if self.overflowed {
            return;
        }
        self.take(&reading);
        self.due = (reading.cycle / self.interval + 1) * self.interval;
        self.last = Some(reading);
    }

    fn settled(&mut self, reading: Reading) {
        self.last = Some(reading);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sim::ChannelCounts;

    fn timeline(interval: Option<Cycle>) -> Timeline {
        let config = Config::built_in("tiny").expect("it is built in");
        Timeline::new(&config, interval).expect("a machine")
    }

    fn reading(of: &Timeline, cycle: Cycle) -> Reading {
        let units = vec![Cycles { busy: cycle, ..Cycles::default() }; of.unit_bank.len()];
        let channels = vec![ChannelCounts { occupancy: 3 * cycle, ..ChannelCounts::default() }; of.channel_bank.len()];
        let held = vec![2 * cycle; of.unit_bank.len()];
        Reading { cycle, channels, units, held }
    }

    #[test]
    fn samples_have_no_gaps_and_are_bounded() {
        let mut own = timeline(None);
        let mut cycle = 0;
        while cycle < 1_000_000 {
            cycle = own.due();
            let reading = reading(&own, cycle);
            own.read(reading);
        }
        assert!((SAMPLES..2 * SAMPLES).contains(&own.samples.len()), "{}", own.samples.len());
        assert!(own.samples.windows(2).all(|pair| pair[0].end == pair[1].begin) && own.samples[0].begin == 0);
        for sample in &own.samples {
            let cycles = sample.end - sample.begin;
            assert!(own.units.iter().zip(&sample.units).all(|(bank, sum)| sum.busy == cycles * bank.count as u64));
            assert!(own.units.iter().zip(&sample.held).all(|(bank, sum)| *sum == 2 * cycles * bank.count as u64));
            assert!(own.channels.iter().zip(&sample.occupancy).all(|(bank, sum)| *sum == 3 * cycles * bank.count as u64));
        }
        own.check().expect("complete");
    }

    #[test]
    fn an_interval_that_is_too_short_is_told() {
        let mut own = timeline(Some(1));
        for cycle in 1..=MOST as Cycle + 1 {
            let reading = reading(&own, cycle);
            own.read(reading);
        }
        assert_eq!(own.due(), NEVER);
        assert!(own.check().expect_err("too many").to_string().contains("longer"));
    }
}
