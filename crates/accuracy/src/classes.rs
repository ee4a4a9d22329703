//! How far estimates are off in each sort class.

use anyhow::Result;

use machine::Config;
use machine::config::SortClass;
use run::bound::frames::{Estimated, estimate};
use run::cycle::{Simulated, simulate};
use run::frame_sink::FrameSink;
use run::replay::Options;
use run::sample::survey::Count;
use trace::Trace;

/// Bytes of DRAM from which on their error is reported. Smaller amounts stay mostly in the second level, and the rest is chance.
pub(crate) const REPORTED_BYTES: f64 = (1 << 20) as f64;

/// The errors of `bound` on a trace.
#[derive(Clone, Debug)]
pub struct Errors {
    /// The trace, as it was named.
    pub trace: String,
    /// Relative errors in cycles and in bytes of DRAM, by the names of classes; none where there are few bytes.
    pub classes: Vec<(&'static str, [Option<f64>; 2])>,
}

/// The errors of `bound` against `cycle` on a trace, with the configuration's knobs and every sort class.
///
/// # Errors
/// If the trace cannot be rendered, a class does not take the knobs, or a machine stops.
pub fn errors(name: &str, trace: &Trace, options: &Options) -> Result<Errors> {
    let configs = SortClass::NAMES.iter().map(|class| {
        let mut config = options.config.clone();
        config.set(&format!("sort={class}"))?;
        config.check()?;
        Ok(config)
    });
    let configs: Vec<Config> = configs.collect::<Result<_>>()?;
    let mut results = vec![(Simulated::default(), Estimated::default()); configs.len()];
    let mut rendering = options.rendering(trace);
    for (config, (simulated, estimated)) in configs.iter().zip(&mut results) {
        simulate(&mut rendering, (config, options.clock), FrameSink::new(|_| Ok(())), simulated)?;
        estimate(&mut rendering, config, FrameSink::new(|_| Ok(())), estimated)?;
    }
    rendering.run()?;
    let own = |(&class, (simulated, estimated)): (&&'static str, &(Simulated, Estimated))| {
        let bytes = Count::DramBytes.of(&simulated.total);
        let told = (estimated.memory.read + estimated.memory.written) / bytes - 1.0;
        let cycles = estimated.cycles / simulated.cycles as f64 - 1.0;
        (class, [Some(cycles), (bytes >= REPORTED_BYTES).then_some(told)])
    };
    Ok(Errors { trace: name.to_owned(), classes: SortClass::NAMES.iter().zip(&results).map(own).collect() })
}

/// The errors of several traces as a table in Markdown, with the median and the largest of each class.
pub fn table(found: &[Errors]) -> String {
    let Some(first) = found.first() else { return String::new() };
    let heads: Vec<&str> = first.classes.iter().map(|class| class.0).collect();
    let mut out = format!("| error in cycles, in DRAM bytes | {} |\n|---|{}\n", heads.join(" | "), "--:|".repeat(heads.len()));
    let signed = |error: Option<f64>| error.map_or("-".into(), |error| format!("{:+.1} %", 100.0 * error));
    for Errors { trace, classes } in found {
        let cells: Vec<String> = classes.iter().map(|(_, errors)| errors.map(signed).join(", ")).collect();
        out.push_str(&format!("| `{trace}` | {} |\n", cells.join(" | ")));
    }
    let sides = |at: usize, side: usize| {
        let mut errors: Vec<f64> = found.iter().filter_map(|trace| trace.classes[at].1[side]).map(f64::abs).collect();
        errors.sort_by(f64::total_cmp);
        errors
    };
    for name in ["median", "largest"] {
        let of = |errors: &[f64]| match errors.len() {
            0 => None,
            n if name == "median" => Some(0.5 * (errors[(n - 1) / 2] + errors[n / 2])),
            n => Some(errors[n - 1]),
        };
        let size = |error: Option<f64>| error.map_or("-".into(), |error| format!("{:.1} %", 100.0 * error));
        let cell = |at: usize| [0, 1].map(|side| size(of(&sides(at, side)))).join(", ");
        let cells: Vec<String> = (0..heads.len()).map(cell).collect();
        out.push_str(&format!("| {name} | {} |\n", cells.join(" | ")));
    }
    out
}
