//! `fillrate inspect`

#[cfg(feature = "vulkan")]
mod vulkan;

use std::path::PathBuf;

use anyhow::{Result, bail};

use super::Verdict;
#[cfg(feature = "vulkan")]
use crate::import;
use crate::import::Report;
use crate::render::{Frames, Image, Inspection, inspect};
use crate::report::summary::{bytes, grouped};
use crate::trace::command::{Command, ShaderSource};
use crate::trace::{Summary, Trace, check};

/// Show what is in a trace, and check it
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate inspect traces/cube\n  fillrate inspect recorded/trace --commands | less")]
pub struct Arguments {
    /// The trace: a file, or its folder
    trace: PathBuf,
    /// List every command with its number
    #[arg(help_heading = "Output", long)]
    commands: bool,
    /// Print the WGSL that the fixed functions and programs of an OpenGL recording became, each once
    #[arg(help_heading = "Output", long)]
    shaders: bool,
    /// List the limits that a recorded wgpu program asked of its device
    #[arg(help_heading = "Output", long)]
    device_limits: bool,
    /// Print the counts as JSON
    #[arg(help_heading = "Output", long)]
    json: bool,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    #[cfg(feature = "vulkan")]
    if let Some(import::FoundTrace { kind: import::TraceKind::Gfxr, path }) = import::detect(&arguments.trace) {
        return vulkan::run(arguments, &path);
    }
    let (trace, report) = arguments.reading.open_to_inspect(&arguments.trace)?;
    let inspection = inspected(&trace)?;
    let summary = &inspection.summary;
    let verdict = if inspection.refused.is_empty() { Verdict::Done } else { Verdict::Failed };
    let origin = trace.origin();
    if arguments.json {
        super::say_json(summary)?;
        inspection.refused.iter().for_each(|error| eprintln!("will be refused: {error}"));
        return Ok(verdict);
    }
    println!(
        "{}: {} trace",
        arguments.trace.display(),
        super::built_in::kind(&arguments.trace).map_or("unknown".into(), |kind| kind.to_string())
    );
    let row = |name: &str, value: String| println!("  {name:<26}{value:>16}");
    if let Some(report) = &report {
        recorded(report);
    }
    row("frames", grouped(summary.frames));
    row("render passes", grouped(summary.render_passes));
    row("compute passes", grouped(summary.compute_passes));
    row("draws", grouped(summary.draws));
    row("dispatches", grouped(summary.dispatches));
    row("vertices of direct draws", grouped(summary.vertices));
    row("buffers", bytes(summary.buffer_bytes as f64));
    row("textures", bytes(summary.texture_bytes as f64));
    row("most alive at once", bytes(summary.peak_bytes as f64));
    row("payload", bytes(summary.blob_bytes as f64));
    println!("{} commands:", grouped(summary.commands));
    for (name, count) in &summary.by_name {
        row(name, grouped(*count));
    }
    if let Some(report) = &report {
        println!(
            "{} calls, {} shaders of fixed functions and programs:",
            grouped(report.calls.iter().map(|(_, count)| count).sum()),
            report.shaders.len()
        );
        for (name, count) in report.calls.iter() {
            row(name, grouped(*count));
        }
        for (number, context) in report.contexts.iter().enumerate() {
            let shares = context.shares.map_or(String::new(), |other| format!(", shares objects with context {other}"));
            println!("context {number}: made in call {}{shares}", context.call);
        }
        for (number, window) in report.windows.iter().enumerate() {
            println!("window {number}: {window}");
        }
        if report.queries > 0 {
            println!("occlusion queries: {}", grouped(report.queries));
        }
        for (heading, counts) in [("not supported", &report.unsupported), ("ignored for an error", &report.errors)] {
            for (what, count) in counts.iter() {
                println!("{heading}: {what}: {} times, first in call {}", grouped(count.times), count.first);
            }
        }
    }
    println!("{}", what_frames_are(&inspection, summary));
    for (name, value) in &origin.facts {
        println!("{name}: {value}");
    }
    for (heading, errors) in [("will be refused", &inspection.refused), ("cannot be made, and is not used", &inspection.unused)]
    {
        errors.iter().for_each(|error| println!("{heading}: {error}"));
    }
    let (skips, skipped) = origin.skipped();
    skipped.iter().for_each(|line| println!("left out (failed when it was recorded, or not supported and not used): {line}"));
    if skips > skipped.len() as u64 {
        println!("left out: {} more", grouped(skips - skipped.len() as u64));
    }
    if arguments.device_limits && !origin.details.is_empty() {
        println!("limits asked for:");
        origin.details.iter().for_each(|(name, value)| println!("  {name:<56}{value:>12}"));
    }
    if arguments.shaders {
        let Some(report) = &report else { bail!("--shaders: {} is no OpenGL recording", arguments.trace.display()) };
        for (label, text) in &report.shaders {
            println!("\n// {label}\n{text}");
        }
    }
    if arguments.commands {
        trace.for_each_command(|index, command| {
            println!("{index:>6}  {}", line(command));
            anyhow::Ok(())
        })?;
    }
    Ok(verdict)
}

/// What is in a trace. Where its commands are made while they are read, they are checked, and nothing is compiled: what such a recording asks
/// for and is not supported is in its report.
fn inspected(trace: &Trace) -> Result<Inspection> {
    if !trace.is_stream() {
        return Ok(inspect(trace)?);
    }
    let summary = check(trace)?;
    let frames = if summary.presented.is_some() { Frames::Presents } else { Frames::None };
    Ok(Inspection { summary, frames, refused: Vec::new(), unused: Vec::new() })
}

/// A line about what frames show.
fn what_frames_are(inspection: &Inspection, summary: &Summary) -> String {
    let image = |image: &Image| {
        let label = image.label.as_ref().map_or(String::new(), |label| format!(" {label:?}"));
        let (level, layer) = image.part;
        let part = if image.part == (0, 0) { String::new() } else { format!(", level {level}, layer {layer}") };
        let [width, height] = image.size;
        format!("texture {}{label}{part}: {width}x{height}, {}", image.texture, image.format)
    };
    match &inspection.frames {
        Frames::Presents => "a frame is what is drawn until a present, and shows what is presented".into(),
        Frames::Copied(from) => format!(
            "nothing is presented: the trace is one frame, which shows what the last copy from a texture to a buffer reads, {}",
            image(from)
        ),
        Frames::Drawn(target) => {
            format!("nothing is presented: the trace is one frame, which shows the last colour target, {}", image(target))
        }
        Frames::None if summary.draws_nothing() => "nothing is drawn: there is no pass and no picture".into(),
        Frames::None => "nothing is presented, and no colour target is drawn: the trace is one frame without a picture".into(),
    }
}

/// Says what a recorded OpenGL program ran on.
fn recorded(report: &Report) {
    let systems = report.systems();
    if !systems.is_empty() {
        println!("  window system: {}", systems.join(", "));
    }
    for version in &report.versions {
        // That of OpenGL begins with the number alone.
        let api = if version.starts_with("OpenGL") { "" } else { "OpenGL " };
        println!("  version: {api}{version}");
    }
    if report.frames == 0 {
        println!("  no call swaps buffers: the whole recording is one frame");
    }
}

/// A command on one line.
fn line(command: &Command) -> String {
    cut_line(match command {
        Command::CreateShader { id, source: ShaderSource::Wgsl(name), .. } => format!("CreateShader {} from {name}", id.0),
        command => format!("{command:?}"),
    })
}

/// A line, cut where it gets long.
fn cut_line(text: String) -> String {
    const WIDTH: usize = 160;
    match text.char_indices().nth(WIDTH) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}
