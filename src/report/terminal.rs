//! What a replay says on the terminal.

use std::fmt::Write;

use serde_json::{Value, json};

use super::compare::KnobDifference;
use super::files::{About, head};
use super::peak::MemoryPeak;
use super::summary::{self, Phases, Pictures};
use crate::num::Cycle;
use crate::run::bound::STATED_ERRORS;
use crate::run::replay::{Fidelity, Frame, Options, ReplayOutcome};
use crate::run::sample::Margin;
use crate::work::{FUNNEL, Funnel, Surface};

/// Draws that are listed.
const DRAWS: usize = 10;

/// What is kept of frames that have left.
#[derive(Default)]
pub struct ReportedFrames {
    /// How many there were.
    pub frames: usize,
    phases: Phases,
    pictures: Option<Pictures>,
    /// The draws that took most cycles, those first.
    draws: Vec<Slowest>,
}

/// One of the draws that took most cycles.
struct Slowest {
    cycles: Cycle,
    line: String,
    json: Value,
}

impl ReportedFrames {
    /// A frame leaves.
    pub fn add(&mut self, frame: &Frame) {
        self.frames += 1;
        self.phases.add(&frame.phases);
        if let Some((Surface { width, height, .. }, _)) = frame.shown {
            let first = Pictures { width, height, frames: 0, same: true };
            let seen = self.pictures.get_or_insert(first);
            seen.frames += 1;
            seen.same &= (seen.width, seen.height) == (width, height);
        }
        for phase in &frame.phases {
            for draw in &phase.draws {
                let place = self.draws.partition_point(|other| other.cycles >= draw.cycles);
                if place < DRAWS && draw.cycles > 0 {
                    let line = summary::draw(frame.number, &phase.phase, draw);
                    let json = summary::draw_json(frame.number, &phase.phase, draw);
                    self.draws.insert(place, Slowest { cycles: draw.cycles, line, json });
                    self.draws.truncate(DRAWS);
                }
            }
        }
    }

    /// Takes over what limits each phase.
    fn limit(&mut self, done: &ReplayOutcome) {
        let mut estimated = Phases::default();
        done.limits.iter().for_each(|phases| estimated.add(phases));
        self.phases.limit(&estimated);
    }

    /// Whether a frame that has left shows a picture.
    pub fn has_picture(&self) -> bool {
        self.pictures.is_some()
    }

    /// The pictures that the counts of a replay are of. Where frames were sampled these are all frames of the sequence, and those that were
    /// reported are taken to show as many pictures as the others.
    fn pictures_counted(&self, done: &ReplayOutcome) -> Option<Pictures> {
        let seen = self.pictures?;
        let Some(sampled) = &done.sampled else { return Some(seen) };
        Some(Pictures { frames: seen.frames * sampled.frames / self.frames.max(1) as u64, ..seen })
    }
}

/// The sections of a report: the name of each, and the beginning of its title. That with the cycles has none: its first line ends with the clock.
pub const SECTIONS: [(&str, &str); 11] = [
    ("knobs", "Knobs that differ from "),
    ("funnel", "What was drawn"),
    ("shares", "In shares"),
    ("phases", "Where the cycles went"),
    ("causes", "What holds it back"),
    ("draws", "The draws that took most"),
    ("units", "What the units did"),
    ("memory", "What moved through memory"),
    ("sorting", "What sorting cost"),
    ("estimates", "What is estimated"),
    ("cycles", ""),
];

/// The name of the section that begins with this line. None if it is no section.
pub fn section_of(first: &str) -> Option<&'static str> {
    let named = SECTIONS.iter().find(|(_, title)| !title.is_empty() && first.starts_with(title)).map(|(name, _)| *name);
    named.or(first.ends_with(" MHz").then_some("cycles"))
}

/// The lines of a report that do not depend on the host.
pub fn without_host(report: &str) -> String {
    report.lines().filter(|line| !line.starts_with("host: ")).map(|line| format!("{line}\n")).collect()
}

/// What a replay came to: how many frames, the knobs that differ from the named configuration, where the work went and where the cycles,
/// and the host's time.
pub fn report(done: &ReplayOutcome, seen: &mut ReportedFrames, options: &Options, changed: &[KnobDifference]) -> String {
    let mut out = format!("{} frame{}\n", seen.frames, if seen.frames == 1 { "" } else { "s" });
    if let Some(sampled) = &done.sampled {
        out = format!("{} frames, {} of them reported\n", sampled.frames, seen.frames);
    }
    out.push_str(&knobs(changed, &options.config.name));
    let mut section = |title: &str, text: &str| {
        // A text takes all that is written to it.
        let _ = write!(out, "\n{title}\n{text}");
    };
    let funnel: Funnel = FUNNEL.sum(&done.total);
    section("What was drawn, and what was thrown away where", &summary::funnel(&funnel));
    section("In shares", &summary::shares(&done.total, &funnel, seen.pictures_counted(done).as_ref()));
    let Some(cycles) = done.cycles else {
        let all = done.clock_time.as_secs_f64();
        out.push_str("\ncounted, not timed: as on a card that reuses every shaded vertex (docs/fidelity.md)\n");
        return out + &format!("host: {all:.3} s in all");
    };
    if !seen.phases.is_empty() {
        seen.limit(done);
        let mut text = seen.phases.text(12);
        if seen.phases.limited() {
            text.push_str("  limit: the unit that takes longest by estimate; `fillrate why` proves what holds a frame back\n");
            if seen.phases.waits() {
                text.push_str(
                    "  waits: no unit works nearly all the time; the unit that waits in most of its cycles, and for what\n",
                );
            }
        }
        section("Where the cycles went, one phase after another", &text);
        if options.fidelity.name() != Fidelity::Bound.name() && done.sampled.is_none() {
            let said: String = seen.phases.counted(&funnel).iter().map(|line| format!("  {line}\n")).collect();
            if !said.is_empty() {
                section("What holds it back, as counted", &said);
            }
        }
    }
    if !seen.draws.is_empty() {
        let lines: Vec<&str> = seen.draws.iter().map(|draw| draw.line.as_str()).collect();
        let title = if options.config.card.sort.class().one_place {
            "The draws that took most, by their share of the work of all that retired with them"
        } else {
            "The draws that took most, from one retirement to the next"
        };
        section(title, &lines.concat());
    }
    if options.fidelity.name() != Fidelity::Bound.name() {
        section("What the units did, in shares of the cycles", &summary::units(&done.total));
        section("What moved through memory", &summary::memory(&done.total, &MemoryPeak::new(&options.config)));
        section("What sorting cost", &summary::sorting(&done.total, options.config.card.sort, options.config.card.pipelines));
    }
    if let Some(sampled) = &done.sampled {
        section("What is estimated", &summary::sampled(sampled));
    }
    out + &times(done, cycles, seen, options)
}

/// What [`report`] says, as one JSON document: all statistics, phases and draws.
pub fn json(done: &ReplayOutcome, seen: &mut ReportedFrames, options: &Options, about: &About) -> Value {
    seen.limit(done);
    let mut document = head(about, &done.total);
    let Some(fields) = document.as_object_mut() else { return document };
    let total = fields.shift_remove("total");
    let frames = done.sampled.as_ref().map_or(seen.frames as u64, |sampled| sampled.frames);
    let seconds = done.cycles.map(|cycles| options.config.seconds(cycles));
    let said = json!({
        "frame_count": frames,
        "frames_reported": seen.frames,
        "cycles": done.cycles,
        "seconds": seconds,
        "frames_per_second": seconds.filter(|&seconds| seconds > 0.0).map(|seconds| frames as f64 / seconds),
        "cycles_of_drawing": done.cycles.map(|_| seen.phases.drawing()),
        "frames_per_run": done.frames_per_run,
        "phases": seen.phases.json(),
        "slowest_draws": seen.draws.iter().map(|draw| draw.json.clone()).collect::<Value>(),
        "estimates": done.sampled.as_ref().map(|sampled| {
            let estimate = |m: &Margin| json!({ "of": m.of.to_string(), "value": m.value, "margin": m.margin });
            sampled.margins.iter().map(estimate).collect::<Value>()
        }),
        "host_seconds": done.clock_time.as_secs_f64(),
        "host_seconds_of_machine": done.machine_time.as_secs_f64(),
    });
    fields.extend(said.as_object().into_iter().flatten().map(|(name, value)| (name.clone(), value.clone())));
    fields.extend(total.map(|total| ("total".to_owned(), total)));
    document
}

/// The knobs that differ from the named configuration, a line each.
fn knobs(changed: &[KnobDifference], config: &str) -> String {
    if changed.is_empty() {
        return String::new();
    }
    let width = changed.iter().map(|d| d.path.len()).max().unwrap_or(0);
    let lines: String = changed.iter().map(|d| format!("  {:<width$}  {} -> {}\n", d.path, d.a, d.b)).collect();
    format!("\nKnobs that differ from {config}\n{lines}")
}

/// Cycles, frames per second, and the host's time.
fn times(done: &ReplayOutcome, cycles: f64, seen: &ReportedFrames, options: &Options) -> String {
    let mhz = options.config.card.clock_mhz;
    let time = options.config.seconds(cycles);
    let frames = done.sampled.as_ref().map_or(seen.frames as f64, |sampled| sampled.frames as f64);
    let rate = if time > 0.0 { frames / time } else { 0.0 };
    let (host, all) = (done.machine_time.as_secs_f64(), done.clock_time.as_secs_f64());
    let cost = match options.fidelity {
        Fidelity::Bound | Fidelity::BoundSampled(_) => {
            let [median, most] = STATED_ERRORS;
            format!(
                "estimated from counts and rates: median error {median} %, nine of ten within {most} % on generated scenes, larger on \
                 machines with short queues (docs/fidelity.md)\nhost: {:.3} ms for the estimates, {all:.3} s in all",
                1e3 * host
            )
        }
        Fidelity::Sampled(_) => format!("host: {host:.2} s in the machine, {all:.2} s in all"),
        _ => {
            let shaded = FUNNEL.sum::<Funnel>(&done.total).fragments_shaded as f64;
            let [cycles, shaded] = [cycles, shaded].map(|count| count / host.max(1e-9) / 1e6);
            let runs = done.frames_per_run.map_or(String::new(), |frames| {
                format!(
                    "\nruns of {frames} frames, each on a machine behind functional warming: cycles of 120 frames and more are within \
                     0.1 % of those of one machine (docs/data/fidelity.md); --frames-per-run all is exact"
                )
            });
            format!(
                "every cycle of every unit, nothing estimated{runs}\nhost: {host:.2} s in the machine ({cycles:.2} million cycles and \
                 {shaded:.2} million shaded fragments per second), {all:.2} s in all"
            )
        }
    };
    let all = format!("{} cycles, {rate:.1} frames per second at {mhz} MHz", summary::grouped(cycles.round() as u64));
    // Of a sample it is not known what the other frames drew.
    let drawing = seen.phases.drawing();
    let apart = if done.sampled.is_none() && drawing > 0 && (drawing as f64) < cycles {
        let rate = frames / options.config.seconds(drawing as f64);
        let drawing = summary::grouped(drawing);
        format!("\ndrawing alone, without transfers and scan-out: {drawing} cycles, {rate:.1} per second")
    } else {
        String::new()
    };
    format!("\n{all}{apart}\n{cost}")
}
