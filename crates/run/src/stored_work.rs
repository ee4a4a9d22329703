//! Work that is kept: a trace is rendered once per render key, and any number of machines are timed or estimated from what it left.

use anyhow::{Context, Result};
use rayon::prelude::*;

use super::bound::{Bound, FrameEstimate};
use super::host::Stopwatch;
use super::machines::{Ran, Shown};
use super::profiles::{Profiled, Reader};
use super::rendering::{Consumer, Rendering};
use machine::{Config, FrameReport, Machine};
use num::Limits;
use render::{self, ConsumerMemory};
use sim::Clock;
use trace::Trace;
use work::profile::FrameProfile;
use work::{Event, RenderKey, Surface};

/// The whole work of some frames.
pub struct StoredWork {
    events: Vec<Event>,
    bytes: u64,
    limits: Limits,
}

impl StoredWork {
    /// Renders frames and keeps their work. None: it takes more than `most` bytes.
    ///
    /// `machines` is how many machines will run at one time; their images count as memory in use.
    ///
    /// # Errors
    /// If the trace cannot be rendered.
    pub fn render(
        trace: &Trace,
        options: &render::Options,
        key: RenderKey,
        machines: u64,
        most: u64,
    ) -> Result<Option<StoredWork>> {
        let (mut events, mut bytes) = (Vec::new(), 0_u64);
        let mut rendering = Rendering::new(trace, options.clone());
        let run = |work: super::rendering::Work| {
            for event in work {
                bytes = bytes.saturating_add(event.bytes() + size_of::<Event>() as u64);
                if bytes > most {
                    events = Vec::new();
                    break;
                }
                events.push(event);
            }
            Ok(())
        };
        let memory = ConsumerMemory { images: machines, ..ConsumerMemory::default() };
        rendering.consume(key, Consumer { memory, recorded: true, stored: false, run: Box::new(run) });
        rendering.run()?;
        Ok((bytes <= most).then_some(StoredWork { events, bytes, limits: *trace.limits() }))
    }

    /// Bytes of the work.
    pub fn bytes(&self) -> u64 {
        self.bytes
    }

    /// The renderer's pictures of the frames.
    pub fn pictures(&self) -> impl Iterator<Item = Option<(Surface, &[u8])>> {
        self.events.iter().filter_map(|event| match event {
            Event::EndFrame(end) => Some(end.shown.map(|surface| (surface, &end.reference[..]))),
            _ => None,
        })
    }

    /// Runs a machine on the work, and keeps what it comes to over all frames.
    ///
    /// # Errors
    /// If knobs do not fit each other, or the machine stops.
    pub fn run(&self, config: &Config) -> Result<Ran> {
        let (mut shown, watch) = (Vec::new(), Stopwatch::start());
        let each = |frame: FrameReport| {
            let picture = frame.picture.as_ref().map(|picture| (picture.surface, &picture.bytes[..]));
            shown.push(Shown::new(frame.number, picture));
        };
        let run = Machine::new(config)?.within(&self.limits).run_each(self.events.iter().cloned(), Clock::SkipIdle, each)?;
        Ok(Ran { shown, cycles: run.cycles, total: run.total, machine_time: watch.elapsed() })
    }

    /// Runs a machine on the work. `read` takes from the report of each frame what is wanted of it.
    ///
    /// # Errors
    /// If knobs do not fit each other, or the machine stops.
    pub fn time<R>(&self, config: &Config, read: impl FnMut(FrameReport) -> R) -> Result<Vec<R>> {
        time(Timing { config, per_draw: false }, &self.limits, self.events.iter().cloned(), read)
    }
}

/// A machine that is to be timed.
#[derive(Clone, Copy, Debug)]
pub struct Timing<'c> {
    /// The machine.
    pub config: &'c Config,
    /// Each draw is reported. That takes time, and no result depends on it.
    pub per_draw: bool,
}

fn time<R>(
    of: Timing<'_>,
    limits: &Limits,
    events: impl Iterator<Item = Event>,
    mut read: impl FnMut(FrameReport) -> R,
) -> Result<Vec<R>> {
    let mut frames = Vec::new();
    let mut machine = Machine::new(of.config)?.within(limits);
    if of.per_draw {
        machine.watch_draws();
    }
    machine.run_each(events, Clock::SkipIdle, |frame| frames.push(read(frame)))?;
    Ok(frames)
}

/// Runs machines side by side behind one rendering that is not kept, all of one render key: for work that does not fit in memory. What one
/// machine stops on is its own result.
///
/// # Errors
/// If the trace cannot be rendered.
fn stream<R: Send>(
    trace: &Trace,
    options: &render::Options,
    machines: &[Timing<'_>],
    read: &(dyn Fn(FrameReport) -> R + Sync),
) -> Result<Vec<Result<Vec<R>>>> {
    let mut results: Vec<Result<Vec<R>>> = machines.iter().map(|_| Ok(Vec::new())).collect();
    let mut rendering = Rendering::new(trace, options.clone());
    for (&machine, result) in machines.iter().zip(&mut results) {
        let config = machine.config;
        let memory = ConsumerMemory { images: Machine::images(config), pieces: Machine::pieces(config), frames: false };
        let run = move |work: super::rendering::Work| {
            *result = time(machine, trace.limits(), work, read);
            Ok(())
        };
        rendering.consume(config.render_key(), Consumer { memory, recorded: true, stored: false, run: Box::new(run) });
    }
    rendering.run()?;
    Ok(results)
}

/// Machines behind one rendering where its work does not fit in memory, for each thread.
const STREAMED: usize = 8;

/// The effort of timing machines: renderings, and bytes of stored work.
#[derive(Clone, Copy, Debug, Default)]
pub struct Took {
    /// Renderings.
    pub renderings: u64,
    /// Bytes of the work that was stored.
    pub kept_bytes: u64,
}

/// Times machines of one render key, several at one time. The work is rendered once and kept, where it takes at most a quarter of the memory
/// that the trace may have alive; else it is rendered again for every eight machines per thread. `done` gets the place of each machine in
/// `machines` with its frames, or what it stopped on, as soon as they are there.
///
/// # Errors
/// If the trace cannot be rendered, or `done` fails.
pub fn time_each<R: Send>(
    trace: &Trace,
    options: &render::Options,
    machines: &[Timing<'_>],
    read: &(dyn Fn(FrameReport) -> R + Sync),
    done: &(dyn Fn(usize, Result<Vec<R>>) -> Result<()> + Sync),
) -> Result<Took> {
    let Some(first) = machines.first() else { return Ok(Took::default()) };
    let threads = rayon::current_num_threads();
    let images = machines.iter().map(|machine| Machine::images(machine.config)).max().unwrap_or(1) * threads as u64;
    let most = trace.limits().memory_bytes.get() / 4;
    let mut took = Took { renderings: 1, kept_bytes: 0 };
    if let Some(stored) = StoredWork::render(trace, options, first.config.render_key(), images, most)? {
        took.kept_bytes = stored.bytes();
        let events = || stored.events.iter().cloned();
        machines
            .par_iter()
            .enumerate()
            .try_for_each(|(at, &machine)| done(at, time(machine, &stored.limits, events(), read)))?;
        return Ok(took);
    }
    let size = STREAMED * threads;
    for (wave, own) in machines.chunks(size).enumerate() {
        took.renderings += 1;
        for (at, frames) in stream(trace, options, own, read)?.into_iter().enumerate() {
            done(wave * size + at, frames)?;
        }
    }
    Ok(took)
}

/// The profiles of some frames, from which machines are estimated.
pub struct Profiles {
    frames: Vec<FrameProfile>,
}

impl Profiles {
    /// Renders frames and keeps their profiles.
    ///
    /// # Errors
    /// If the trace cannot be rendered.
    pub fn render(trace: &Trace, options: &render::Options, key: RenderKey) -> Result<Profiles> {
        let mut frames = Vec::new();
        let mut rendering = Rendering::new(trace, options.clone());
        let read = |profiled: &[Profiled]| {
            frames.extend(profiled.iter().map(|frame| frame.profile.clone()));
            Ok(())
        };
        rendering.profile(key, Reader { keeps: false, read: Box::new(read) });
        rendering.run()?;
        Ok(Profiles { frames })
    }

    /// Estimates a machine, frame by frame.
    ///
    /// # Errors
    /// If a knob has an effect that is not estimated.
    pub fn estimate(&self, config: &Config) -> Result<Vec<FrameEstimate>> {
        let mut bound = Bound::new(config)?;
        Ok(self.frames.iter().map(|frame| bound.frame(frame)).collect())
    }
}

/// The number of the frame that takes most cycles by estimate, whatever the knobs.
///
/// # Errors
/// If the trace cannot be rendered, or has no such frame.
pub fn slowest(trace: &Trace, options: &render::Options, config: &Config) -> Result<u32> {
    let (mut bound, mut most) = (Bound::proxy(config), None);
    let mut rendering = Rendering::new(trace, options.clone());
    let read = |profiled: &[Profiled]| {
        for frame in profiled {
            let cycles: f64 = bound.frame(&frame.profile).phases.iter().map(|phase| phase.cycles).sum();
            if most.is_none_or(|(_, known)| cycles > known) {
                most = Some((frame.end.number, cycles));
            }
        }
        Ok(())
    };
    rendering.profile(config.render_key(), Reader { keeps: false, read: Box::new(read) });
    rendering.run()?;
    most.map(|(number, _)| number).context("the trace has no frame in this range")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machines::run;
    use gfx::format::Format;
    use trace::record::{Recorder, texture_2d};

    fn frames() -> Trace {
        let mut card = Recorder::new("frames");
        let texture = card.create_texture("shown", texture_2d(64, 64, Format::Rgba8Unorm));
        (0..5).for_each(|_| card.present(texture));
        card.finish()
    }

    #[test]
    fn kept_work_streamed_work_and_a_replay_give_the_same_cycles() {
        let trace = frames();
        let options = render::Options::default();
        let config = Config::built_in("tiny").expect("it is built in");
        let cycles = |frame: FrameReport| frame.cycles;
        let stored =
            StoredWork::render(&trace, &options, config.render_key(), 1, u64::MAX).expect("it renders").expect("it fits");
        let timed = stored.time(&config, cycles).expect("it runs");
        assert_eq!(timed.len(), 5);
        let machine = Timing { config: &config, per_draw: true };
        let streamed = stream(&trace, &options, &[machine, machine], &cycles).expect("it renders");
        for machine in streamed {
            assert_eq!(machine.expect("it runs"), timed);
        }
        let replayed = run(&trace, &[(&config, Clock::SkipIdle)]).expect("it runs");
        assert_eq!(replayed[0].cycles, timed.iter().sum::<u64>());
    }

    #[test]
    fn machines_are_timed_alike_whether_the_work_is_kept_or_not() {
        let config = Config::built_in("tiny").expect("it is built in");
        let machines = vec![Timing { config: &config, per_draw: false }; STREAMED * rayon::current_num_threads() + 1];
        let time = |trace: &Trace| {
            let cycles = std::sync::Mutex::new(vec![0; machines.len()]);
            let done = |at: usize, frames: Result<Vec<u64>>| {
                cycles.lock().expect("no panic")[at] = frames?.iter().sum();
                Ok(())
            };
            let took = time_each(trace, &render::Options::default(), &machines, &|frame| frame.cycles, &done).expect("it runs");
            (took.renderings, took.kept_bytes > 0, cycles.into_inner().expect("no panic"))
        };
        let trace = frames();
        let mut limits = *trace.limits();
        let whole = time(&trace);
        // Five pictures of 16 KiB do not fit into a quarter of this.
        limits.memory_bytes = limits.memory_bytes.with(300 << 10);
        let streamed = time(&trace.with_limits(limits));
        assert_eq!((whole.0, whole.1, streamed.0, streamed.1), (1, true, 3, false));
        assert!(whole.2[0] > 0 && whole.2 == streamed.2, "{whole:?} {streamed:?}");
    }

    #[test]
    fn work_that_does_not_fit_is_not_kept() {
        let options = render::Options::default();
        let stored = StoredWork::render(&frames(), &options, RenderKey::default(), 1, 100).expect("it renders");
        assert!(stored.is_none());
    }
}
