//! `fillrate inspect`

use std::path::PathBuf;

use anyhow::{Result, bail};

use super::Verdict;
use crate::import;
use crate::report::summary::{bytes, grouped};
use crate::trace::check;
use crate::trace::command::{Command, ShaderSource};

/// Show what is in a trace, and check it
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate inspect traces/cube\n  fillrate inspect recorded/trace --commands | less")]
pub struct Arguments {
    /// The trace: a file, or its folder
    trace: PathBuf,
    #[command(flatten)]
    reading: super::reading::Reading,
    /// List every command with its number
    #[arg(long)]
    commands: bool,
    /// Print the WGSL that the fixed functions and programs of an OpenGL recording became, each once
    #[arg(long)]
    shaders: bool,
    /// Print the counts as JSON
    #[arg(long)]
    json: bool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let (trace, report) = arguments.reading.open_reported(&arguments.trace)?;
    let summary = check(&trace)?;
    if arguments.json {
        super::say_json(&summary)?;
        return Ok(Verdict::Done);
    }
    println!(
        "{}: {} trace",
        arguments.trace.display(),
        import::detect(&arguments.trace).map_or("unknown".into(), |f| f.kind.to_string())
    );
    let row = |name: &str, value: String| println!("  {name:<26}{value:>16}");
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
    Ok(Verdict::Done)
}

/// A command on one line, cut where it gets long.
fn line(command: &Command) -> String {
    const WIDTH: usize = 160;
    let text = match command {
        Command::CreateShader { id, source: ShaderSource::Wgsl(name), .. } => format!("CreateShader {} from {name}", id.0),
        command => format!("{command:?}"),
    };
    match text.char_indices().nth(WIDTH) {
        Some((at, _)) => format!("{}...", &text[..at]),
        None => text,
    }
}
