//! `fillrate accuracy runs`

use std::num::NonZeroU32;
use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::runs::{compare, head_of_one_run, one_run, row_of_one_run, shares, table, times};
use crate::accuracy::sequences::SEQUENCES;
use crate::run::replay::{Fidelity, Options};
use crate::trace::{Packing, Trace};

/// Sequences in runs of frames against one machine that simulates all frames
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy runs traces/flight.zip --times\n  \
fillrate accuracy runs --one-run --frames 0 traces/*\n\n\
Beside the traces, three kinds of sequences are generated: an interface, particles, and a shadow map that is drawn once.")]
pub struct Arguments {
    /// Traces, beside the generated sequences
    traces: Vec<PathBuf>,
    #[command(flatten)]
    reading: super::reading::Reading,
    #[command(flatten)]
    machine: super::configs::Choice,
    /// Frames of each generated sequence; 0: none is generated
    #[arg(long, value_name = "N", default_value_t = 120)]
    frames: u32,
    /// Frames in a run
    #[arg(long, value_name = "N", default_value_t = super::replay::FRAMES_PER_RUN)]
    frames_per_run: NonZeroU32,
    /// Take all frames as one run, which must make the same statistics and pictures of each; exit code 1 where it does not
    #[arg(long, conflicts_with_all = ["frames_per_run", "times"])]
    one_run: bool,
    /// Only write the generated sequences into this folder, as traces
    #[arg(long, value_name = "DIR", conflicts_with_all = ["traces", "times", "one_run"])]
    record: Option<PathBuf>,
    /// Print host times too, as medians of this number of pairs, and in which parts processors spent them
    #[arg(long, value_name = "PAIRS", num_args = 0..=1, default_missing_value = "3")]
    times: Option<NonZeroU32>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    if let Some(folder) = &arguments.record {
        std::fs::create_dir_all(folder).with_context(|| format!("cannot create {}", folder.display()))?;
        for sequence in SEQUENCES {
            let path = folder.join(format!("{}.zip", sequence.name));
            (sequence.record)(arguments.frames).save_zip(&path, Packing::Deflated)?;
            println!("written to {}", path.display());
        }
        return Ok(Verdict::Done);
    }
    let options = Options::new(arguments.machine.load()?, Fidelity::Cycle);
    if arguments.one_run {
        return equal(arguments, &options);
    }
    let pairs = arguments.times.map_or(1, NonZeroU32::get);
    let (mut compared, mut verdict) = (Vec::new(), Verdict::Done);
    for path in &arguments.traces {
        let (name, trace) = (format!("`{}`", path.display()), arguments.reading.open(path)?);
        compared.push(compare(&name, &trace, &options, arguments.frames_per_run, pairs).with_context(|| name.clone())?);
        verdict = verdict.and(super::reading::verdict(&trace));
    }
    for sequence in SEQUENCES.iter().filter(|_| arguments.frames > 0) {
        let (name, trace) = (format!("{}: {}", sequence.name, sequence.what), (sequence.record)(arguments.frames).finish());
        compared.push(compare(&name, &trace, &options, arguments.frames_per_run, pairs).context(sequence.name)?);
    }
    print!("{}", table(&compared));
    if arguments.times.is_some() {
        print!("\n{}\n{}", times(&compared), shares(&compared));
    }
    Ok(verdict)
}

/// Prints whether one run of all frames is one machine.
fn equal(arguments: &Arguments, options: &Options) -> Result<Verdict> {
    print!("{}", head_of_one_run());
    let mut verdict = Verdict::Done;
    let mut one = |name: &str, trace: &Trace| -> Result<()> {
        let compared = one_run(name, trace, options).with_context(|| name.to_owned())?;
        print!("{}", row_of_one_run(&compared));
        super::flush();
        verdict = verdict.and(super::reading::verdict(trace));
        if !compared.equal() {
            verdict = Verdict::Failed;
        }
        Ok(())
    };
    for path in &arguments.traces {
        one(&format!("`{}`", path.display()), &arguments.reading.open(path)?)?;
    }
    for sequence in SEQUENCES.iter().filter(|_| arguments.frames > 0) {
        one(&format!("{}: {}", sequence.name, sequence.what), &(sequence.record)(arguments.frames).finish())?;
    }
    Ok(verdict)
}
