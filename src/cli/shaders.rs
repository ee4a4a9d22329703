//! `fillrate shaders`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use super::threads::MOST;
use crate::report::shaders;
use crate::run::shader_cost::shader_costs;

/// Show the shaders of a frame with the instructions that each line of their source executes
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate shaders traces/shadow\n  fillrate shaders traces/flight.zip --frame 100 --json\n\n\
Instructions are summed over all invocations of the frame. They are those of a machine whose instructions work on one component."
)]
pub struct Arguments {
    /// The trace: a file, or its folder; native or foreign
    trace: PathBuf,
    /// The frame
    #[arg(long, value_name = "N", default_value = "0", value_parser = clap::value_parser!(u32).range(..i64::from(u32::MAX)))]
    frame: u32,
    /// Print one JSON document
    #[arg(help_heading = "Output", long)]
    json: bool,
    /// Threads; no result depends on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let frame = arguments.frame;
    let trace = arguments.reading.open_frames(&arguments.trace, u64::from(frame)..u64::from(frame) + 1)?;
    let opened = trace.origin();
    let costs = shader_costs(&trace, frame).with_context(|| arguments.trace.display().to_string())?;
    let listings = shaders::listings(&trace, &costs)?;
    arguments.reading.say_at_end(&arguments.trace, &trace, &opened);
    if arguments.json {
        super::say_json(&shaders::json(&listings, frame))?;
    } else {
        print!("{}", shaders::text(&listings, frame));
    }
    Ok(super::reading::verdict(&trace))
}
