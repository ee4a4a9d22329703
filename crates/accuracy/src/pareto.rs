//! Run time against error: the fidelities side by side on traces.

use std::time::Duration;

use anyhow::Result;
use serde_json::{Value, json};

use num::Random;
use run::bound::frames::{Estimated, estimate};
use run::cycle::{Simulated, simulate};
use run::frame_sink::{Frame, FrameSink};
use run::replay::{Fidelity, Options, ReplayOutcome, replay_to};
use run::sample::survey::{Count, MISSES, Observers, Survey};
use run::sample::{Quantity, Sampler, Sampling};
use stats::Tree;
use trace::Trace;

use crate::classes::REPORTED_BYTES;

/// Draws of frames over which it is counted how often an interval holds the truth.
pub const RESAMPLINGS: u64 = 1000;

/// What is compared, with its name.
pub const QUANTITIES: [&str; 4] = ["cycles", "DRAM bytes", "L2 misses", "texture misses"];

/// The counts that these are.
fn counts() -> [Count; QUANTITIES.len()] {
    let misses = |cache: &str| Count::Cache(cache.to_owned(), MISSES);
    [Count::Cycles, Count::DramBytes, misses("l2"), misses("texture")]
}

/// Values of what is compared; none where a fidelity does not tell.
type Values = [Option<f64>; QUANTITIES.len()];

/// Published marks: name, times as fast, relative error in cycles.
pub const MARKS: [(&str, f64, f64); 2] = [("MEGsim (2022)", 126.0, 0.0084), ("SMARTS (2003)", 47.0, 0.0064)];

/// A fidelity on a trace.
#[derive(Clone, Debug)]
pub struct Point {
    /// Its name.
    pub fidelity: String,
    /// Host time spent on cycles: in the machine, or for estimates. Rendering, which all share, is left out.
    pub time: Duration,
    /// Host time in all, on the clock.
    pub whole: Duration,
    /// Relative errors, by [`QUANTITIES`]; none where the fidelity has no such quantity, or the trace has too little of it.
    pub errors: [Option<f64>; QUANTITIES.len()],
    /// Half the intervals, relative.
    pub margins: [Option<f64>; QUANTITIES.len()],
    /// How other draws of as many clusters do.
    pub resampled: Resampled,
}

/// What [`RESAMPLINGS`] draws of frames come to, of a sequence that is known whole.
#[derive(Clone, Copy, Debug, Default)]
pub struct Resampled {
    /// How often the intervals hold the truth.
    pub covered: [Option<f64>; QUANTITIES.len()],
    /// The relative error's absolute value on average.
    pub errors: [Option<f64>; QUANTITIES.len()],
}

/// The fidelities on a trace.
#[derive(Clone, Debug)]
pub struct Front {
    /// The trace, as it was named.
    pub trace: String,
    /// Its frames.
    pub frames: usize,
    /// Cycles of all of them.
    pub cycles: f64,
    /// The fidelities, the slowest first.
    pub points: Vec<Point>,
}

/// What is compared, of the statistics of a machine.
fn values(tree: &Tree) -> Values {
    counts().map(|count| count.is_in(tree).then(|| count.of(tree)))
}

/// What is compared, of estimates.
fn estimates(sum: &Estimated) -> Values {
    let dram = sum.memory.read.round() + sum.memory.written.round();
    [sum.cycles.round(), dram, sum.memory.misses.round(), sum.textures[1].round()].map(Some)
}

/// Whether errors in a quantity are reported where it comes to this much: some of it, and of the bytes of DRAM as many as classes report.
fn reported(at: usize, truth: f64) -> bool {
    truth > 0.0 && (counts()[at] != Count::DramBytes || truth >= REPORTED_BYTES)
}

fn point(fidelity: String, [time, whole]: [Duration; 2], measured: &Values, truth: &Values) -> Point {
    let errors = std::array::from_fn(|i| {
        let (measured, truth) = measured[i].zip(truth[i])?;
        reported(i, truth).then(|| (measured / truth - 1.0).abs())
    });
    Point { fidelity, time, whole, errors, margins: Values::default(), resampled: Resampled::default() }
}

/// Half the intervals, relative to what was measured, of the quantities whose errors are reported.
fn margins(run: &ReplayOutcome, measured: &Values, truth: &Values) -> Values {
    let counts = counts();
    std::array::from_fn(|i| {
        truth[i].filter(|&truth| reported(i, truth))?;
        let value = measured[i].filter(|&value| value > 0.0)?;
        let of = |quantity: &Quantity| matches!(quantity, Quantity::Count(count) if *count == counts[i]);
        let found = run.sampled.as_ref()?.margins.iter().find(|margin| of(&margin.of))?;
        Some(found.margin / value)
    })
}

/// Draws frames again and again, of a sequence that is known whole: `frames` has what was counted in each.
///
/// # Errors
/// If what is kept of the survey cannot be read.
pub fn resample(survey: &Survey, frames: &[[f64; QUANTITIES.len()]], samples: usize) -> Result<Resampled> {
    let strata = survey.strata(samples)?;
    let mut resampled = Resampled::default();
    for (at, count) in counts().iter().enumerate() {
        let truth: f64 = frames.iter().map(|counted| counted[at]).sum();
        if !reported(at, truth) {
            continue;
        }
        let (mut held, mut errors) = (0, 0.0);
        for seed in 0..RESAMPLINGS {
            let drawn = strata.draw(&mut Random::new(seed))?;
            let own: Vec<f64> = drawn.frames.iter().map(|&frame| frames[frame][at]).collect();
            let told = drawn.total_of(count, &own);
            held += u64::from(told.covers(truth));
            errors += (told.value / truth - 1.0).abs();
        }
        resampled.covered[at] = Some(held as f64 / RESAMPLINGS as f64);
        resampled.errors[at] = Some(errors / RESAMPLINGS as f64);
    }
    Ok(resampled)
}

/// Runs all fidelities on a trace. `sampled` runs once for each number of samples for which the trace has enough frames.
///
/// The trace is rendered once for `cycle` and `bound`; their time in all is that of rendering and of their own, one after the other. It is
/// surveyed once for all numbers of samples, whose times in all include the survey. `functional` is run as a replay runs it.
///
/// # Errors
/// If the trace cannot be rendered, a fidelity does not know the configuration, or the machine stops.
pub fn front(name: &str, trace: &Trace, options: &Options, samples: &[u32], seed: u64) -> Result<Front> {
    let config = &options.config;
    let (mut simulated, mut bound) = (Simulated::default(), Estimated::default());
    let mut frames: Vec<[f64; QUANTITIES.len()]> = Vec::new();
    let count = |frame: Frame| {
        frames.push(counts().map(|count| count.of(&frame.tree)));
        Ok(())
    };
    let mut rendering = options.rendering(trace);
    simulate(&mut rendering, (config, options.clock), FrameSink::new(count), &mut simulated)?;
    estimate(&mut rendering, config, FrameSink::new(|_| Ok(())), &mut bound)?;
    let rendered = rendering.run()?;
    let recorded = rendered.time + rendered.profiling;

    let truth = values(&simulated.total);
    let times = [simulated.machine_time, rendered.time + simulated.machine_time];
    let mut points = vec![point("cycle".into(), times, &truth, &truth)];
    let numbers: Vec<u32> = samples.iter().rev().copied().filter(|&samples| (samples as usize) + 1 < frames.len()).collect();
    if !numbers.is_empty() {
        let sampler = Sampler::new(trace, options, Observers::default())?;
        for samples in numbers {
            let run = sampler.run(&Sampling { samples, seed, ..Sampling::default() }, FrameSink::new(|_| Ok(())))?;
            let measured = values(&run.total);
            let times = [run.machine_time, run.clock_time];
            points.push(Point {
                margins: margins(&run, &measured, &truth),
                resampled: resample(sampler.survey(), &frames, samples as usize)?,
                ..point(format!("sampled, {samples} frames"), times, &measured, &truth)
            });
        }
    }
    points.push(point("bound".into(), [bound.time, recorded + bound.time], &estimates(&bound), &truth));
    let functional =
        replay_to(trace, &Options { fidelity: Fidelity::Functional, ..options.clone() }, &|_| (), &mut |_| Ok(()))?;
    points.push(point("functional".into(), [Duration::ZERO, functional.clock_time], &Values::default(), &truth));
    Ok(Front { trace: name.to_owned(), frames: frames.len(), cycles: truth[0].unwrap_or(0.0), points })
}

impl Front {
    /// How many times as fast as `cycle` a fidelity is, in host time spent on cycles; none for one that spends none.
    pub fn speed(&self, point: &Point) -> Option<f64> {
        let own = point.time.as_secs_f64();
        (own > 0.0).then(|| self.points[0].time.as_secs_f64() / own)
    }

    /// The same in host time in all.
    pub fn whole_speed(&self, point: &Point) -> f64 {
        self.points[0].whole.as_secs_f64() / point.whole.as_secs_f64().max(1e-9)
    }

    /// As a table in Markdown, the slowest in all first.
    pub fn table(&self) -> String {
        let percent = |value: Option<f64>| value.map_or("-".into(), |v| format!("{:.2} %", 100.0 * v));
        let mut out = format!(
            "{}: {} frames, {:.0} cycles\n\n| fidelity | in all | times as fast | host time on cycles | times as fast | error in {} | mean error of {RESAMPLINGS} draws | half intervals | coverage |\n|---|---|---|---|---|{}---|---|---|\n",
            self.trace,
            self.frames,
            self.cycles,
            QUANTITIES.join(" | "),
            "---|".repeat(QUANTITIES.len())
        );
        let mut points: Vec<&Point> = self.points.iter().collect();
        points.sort_by_key(|point| std::cmp::Reverse(point.whole));
        for point in points {
            let errors: Vec<String> = point.errors.iter().map(|&error| percent(error)).collect();
            out.push_str(&format!(
                "| {} | {:.2} s | {:.1} | {:.3} ms | {} | {} | {} | {} | {} |\n",
                point.fidelity,
                point.whole.as_secs_f64(),
                self.whole_speed(point),
                1e3 * point.time.as_secs_f64(),
                self.speed(point).map_or("-".into(), |speed| format!("{speed:.1}")),
                errors.join(" | "),
                together(&point.resampled.errors, 2),
                together(&point.margins, 1),
                together(&point.resampled.covered, 1)
            ));
        }
        out
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        let points: Vec<Value> = self
            .points
            .iter()
            .map(|point| {
                json!({
                    "fidelity": point.fidelity,
                    "seconds": point.time.as_secs_f64(),
                    "seconds_in_all": point.whole.as_secs_f64(),
                    "times_as_fast": self.speed(point),
                    "times_as_fast_in_all": self.whole_speed(point),
                    "errors": named(&point.errors),
                    "margins": named(&point.margins),
                    "errors_of_draws": named(&point.resampled.errors),
                    "covered": named(&point.resampled.covered),
                })
            })
            .collect();
        json!({ "trace": self.trace, "frames": self.frames, "cycles": self.cycles, "fidelities": points })
    }
}

/// The errors of all fidelities but `cycle` that tell cycles, as one table in Markdown: what no host time is in.
pub fn errors(fronts: &[Front]) -> String {
    let percent = |value: Option<f64>| value.map_or("-".into(), |v| format!("{:.2} %", 100.0 * v));
    let mut out = format!(
        "| trace | frames | cycles | fidelity | error in {} | mean error of {RESAMPLINGS} draws | half intervals | coverage |\n|---|--:|--:|---|{}---|---|---|\n",
        QUANTITIES.join(" | in "),
        "--:|".repeat(QUANTITIES.len())
    );
    for front in fronts {
        for point in front.points[1..].iter().filter(|point| point.errors[0].is_some()) {
            out.push_str(&format!(
                "| `{}` | {} | {:.0} | {} | {} | {} | {} | {} |\n",
                front.trace,
                front.frames,
                front.cycles,
                point.fidelity,
                point.errors.map(percent).join(" | "),
                together(&point.resampled.errors, 2),
                together(&point.margins, 1),
                together(&point.resampled.covered, 1)
            ));
        }
    }
    out
}

/// Shares in one field of a table.
fn together(shares: &[Option<f64>; QUANTITIES.len()], digits: usize) -> String {
    if shares.iter().all(Option::is_none) {
        return "-".into();
    }
    let texts: Vec<String> =
        shares.iter().map(|share| share.map_or("-".into(), |share| format!("{:.digits$}", 100.0 * share))).collect();
    format!("{} %", texts.join(", "))
}

/// Shares by what they are of.
fn named(shares: &[Option<f64>; QUANTITIES.len()]) -> Value {
    Value::Object(QUANTITIES.iter().zip(shares).map(|(name, share)| ((*name).to_owned(), json!(share))).collect())
}

/// Colours of traces in the plot.
const COLORS: [&str; 8] = ["#1f5fa8", "#c4511d", "#2d7d46", "#7b4fa3", "#8a6d1a", "#b03060", "#2a7f8e", "#5d5d5d"];

/// A plot of run time in all against error in cycles as SVG: both axes logarithmic, faster to the right, nearer below.
pub fn plot(fronts: &[Front]) -> String {
    const SIZE: [f64; 2] = [760.0, 470.0];
    const LEFT: f64 = 70.0;
    const TOP: f64 = 24.0;
    let (width, height) = (SIZE[0] - LEFT - 190.0, SIZE[1] - TOP - 60.0);
    let speeds = fronts.iter().flat_map(|front| front.points.iter().map(|point| front.whole_speed(point)));
    let fastest = speeds.chain(MARKS.map(|(_, speed, _)| speed)).fold(10.0, f64::max);
    // The axis ends a little behind the fastest.
    let decades = (1.2 * fastest).log10();
    // From 0.01 % to 100 %.
    let place = |speed: f64, error: f64| {
        let x = LEFT + width * speed.max(1.0).log10() / decades;
        let y = TOP + height * (1.0 - ((error.max(1e-4).log10() + 4.0) / 4.0).min(1.0));
        [x, y]
    };
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {} {}\" font-family=\"sans-serif\" font-size=\"12\">\n<rect width=\"100%\" height=\"100%\" fill=\"white\"/>\n",
        SIZE[0], SIZE[1]
    );
    let mut line = |[x0, y0]: [f64; 2], [x1, y1]: [f64; 2]| {
        out.push_str(&format!("<line x1=\"{x0:.1}\" y1=\"{y0:.1}\" x2=\"{x1:.1}\" y2=\"{y1:.1}\" stroke=\"#ddd\"/>\n"));
    };
    for decade in 0..=decades as i32 {
        let speed = 10f64.powi(decade);
        line(place(speed, 1e-4), place(speed, 1.0));
    }
    for error in [1e-4, 1e-3, 1e-2, 1e-1, 1.0] {
        line(place(1.0, error), place(10f64.powf(decades), error));
    }
    let text = |out: &mut String, [x, y]: [f64; 2], anchor: &str, color: &str, text: &str| {
        out.push_str(&format!("<text x=\"{x:.1}\" y=\"{y:.1}\" text-anchor=\"{anchor}\" fill=\"{color}\">{text}</text>\n"));
    };
    for decade in 0..=decades as i32 {
        let [x, y] = place(10f64.powi(decade), 1e-4);
        text(&mut out, [x, y + 18.0], "middle", "black", &format!("{}", 10i64.pow(decade as u32)));
    }
    for (error, label) in [(1e-4, "0.01 %"), (1e-3, "0.1 %"), (1e-2, "1 %"), (1e-1, "10 %"), (1.0, "100 %")] {
        let [x, y] = place(1.0, error);
        text(&mut out, [x - 6.0, y + 4.0], "end", "black", label);
    }
    text(
        &mut out,
        [LEFT + width / 2.0, SIZE[1] - 16.0],
        "middle",
        "black",
        "times as fast as cycle, in host time of the whole command",
    );
    text(&mut out, [8.0, 14.0], "start", "black", "error in cycles");
    for (name, speed, error) in MARKS {
        let [x, y] = place(speed, error);
        out.push_str(&format!(
            "<path d=\"M{:.1} {:.1}h12M{x:.1} {:.1}v12\" stroke=\"black\" stroke-width=\"2\"/>\n",
            x - 6.0,
            y,
            y - 6.0
        ));
        text(&mut out, [x + 9.0, y + 14.0], "start", "black", name);
    }
    for (front, color) in fronts.iter().zip(COLORS.iter().cycle()) {
        for point in &front.points[1..] {
            let (speed, Some(error)) = (front.whole_speed(point), point.errors[0]) else { continue };
            let [x, y] = place(speed, error);
            let shape = if point.margins[0].is_some() {
                format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"5\" fill=\"{color}\"/>\n")
            } else {
                format!("<rect x=\"{:.1}\" y=\"{:.1}\" width=\"9\" height=\"9\" fill=\"{color}\"/>\n", x - 4.5, y - 4.5)
            };
            out.push_str(&shape);
        }
    }
    let legend = LEFT + width + 16.0;
    for (at, (front, color)) in fronts.iter().zip(COLORS.iter().cycle()).enumerate() {
        let name = front.trace.rsplit('/').next().unwrap_or(&front.trace).replace('&', "&amp;").replace('<', "&lt;");
        text(&mut out, [legend, TOP + 14.0 + 18.0 * at as f64], "start", color, &name);
    }
    let below = TOP + 32.0 + 18.0 * fronts.len() as f64;
    for (at, entry) in ["\u{25cf} sampled", "\u{25a0} bound", "+ published"].into_iter().enumerate() {
        text(&mut out, [legend, below + 18.0 * at as f64], "start", "black", entry);
    }
    out.push_str("</svg>\n");
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_results_are_drawn_where_they_are() {
        let drawn = plot(&[]);
        let places: Vec<f64> = drawn
            .lines()
            .filter_map(|line| line.strip_prefix("<path d=\"M")?.split(' ').next())
            .map(|left| left.parse::<f64>().expect("a number") + 6.0)
            .collect();
        // From 1 at x = 70, logarithmic.
        let [megsim, smarts] = places[..] else { panic!("{places:?}") };
        let decade = (megsim - 70.0) / 126f64.log10();
        assert!((70.0 + decade * 47f64.log10() - smarts).abs() < 0.2, "{places:?}");
        // Lines of the grid at 1, 10 and 100.
        assert_eq!(drawn.matches("text-anchor=\"middle\" fill=\"black\">1").count(), 3);
    }
}
