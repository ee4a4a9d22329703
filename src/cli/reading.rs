//! Options of all subcommands that read a trace: limits, and which of its files are read.

use std::fs::Metadata;
use std::ops::Range;
use std::path::Path;

use anyhow::{Result, anyhow};

use super::Verdict;
use super::built_in;
use crate::import::{self, Report, TraceKind};
use crate::num::Limits;
use crate::scenes;
use crate::trace::{self, Origin, Trace, TraceError};

/// Limits on what files that are read may ask for.
#[derive(clap::Args)]
pub struct Limiting {
    /// Raise a limit on what a trace or a picture may ask for (docs/data/limits.md lists them); may be repeated
    #[arg(long = "limit", value_name = "NAME=VALUE")]
    limits: Vec<String>,
}

impl Limiting {
    /// The limits.
    ///
    /// # Errors
    /// If an option is no limit.
    pub fn limits(&self) -> Result<Limits> {
        self.set(Limits::default())
    }

    fn set(&self, mut limits: Limits) -> Result<Limits> {
        for assignment in &self.limits {
            limits.set(assignment).map_err(|reason| anyhow!("--limit {reason}"))?;
        }
        Ok(limits)
    }
}

/// How far a trace is trusted.
#[derive(clap::Args)]
pub struct Reading {
    #[command(flatten)]
    limiting: Limiting,
    /// Read files of the trace that symbolic links lead to
    #[arg(long)]
    follow_links: bool,
    /// Take a recorded OpenGL program that asks for what is not supported, and leave that out: the pictures lack it, so the exit status
    /// is 1 as without this option
    #[arg(long)]
    lenient: bool,
    /// Keep the draws of a recorded OpenGL program as it called them, with all that they read; else draws of one state are joined, and only
    /// attributes that differ between vertices and levels of textures that are read are uploaded
    #[arg(long)]
    keep_draws: bool,
    /// Show one window of a recorded OpenGL program that has several: its swaps end frames, those of others do not. `fillrate inspect` lists them
    #[arg(long, value_name = "N")]
    window: Option<u32>,
}

impl Reading {
    /// The options as they were given, for another process.
    pub fn options(&self) -> Vec<String> {
        let limits = self.limiting.limits.iter().flat_map(|limit| ["--limit".to_owned(), limit.clone()]);
        let flags = [(self.follow_links, "--follow-links"), (self.lenient, "--lenient"), (self.keep_draws, "--keep-draws")];
        let window = self.window.iter().flat_map(|window| ["--window".to_owned(), window.to_string()]);
        limits.chain(flags.into_iter().filter(|(on, _)| *on).map(|(_, flag)| flag.to_owned())).chain(window).collect()
    }

    /// The limits on files beside the trace.
    ///
    /// # Errors
    /// If an option is no limit.
    pub fn limits(&self) -> Result<Limits> {
        self.limiting.limits()
    }

    /// Opens a trace of any kind. What is left out of a recorded program, and what it did without an effect, is said.
    pub fn open(&self, path: &Path) -> Result<Trace> {
        self.supported(path, self.open_reported(path)?)
    }

    /// As [`Reading::open`]; of a recorded program only these frames, and what they need. What there is to say of a long one is known at its
    /// end: see [`Reading::say_at_end`].
    pub fn open_frames(&self, path: &Path, frames: Range<u64>) -> Result<Trace> {
        self.warn_ignored(path);
        self.supported(path, self.read(path, self.reading(path)?, |reading| import::open_frames(path, reading, frames))?)
    }

    /// As [`Reading::open`], with all commands and payload in memory, as writing the trace needs.
    pub fn open_whole(&self, path: &Path) -> Result<Trace> {
        self.warn_ignored(path);
        let reading = trace::Reading { in_memory: Some(u64::MAX), ..self.reading(path)? };
        self.supported(path, self.read(path, reading, |reading| import::open_reported(path, reading))?)
    }

    /// Opens a built-in scene by its name, and another trace by `open`.
    fn read(
        &self,
        path: &Path,
        reading: trace::Reading,
        open: impl FnOnce(&trace::Reading) -> Result<(Trace, Option<Report>), TraceError>,
    ) -> Result<(Trace, Option<Report>)> {
        match built_in::scene(path)? {
            Some(scene) => Ok((scene.open(&reading.limits)?, None)),
            None => Ok(open(&reading).map_err(|error| hinted(path, error))?),
        }
    }

    fn supported(&self, path: &Path, (trace, _): (Trace, Option<Report>)) -> Result<Trace> {
        let origin = trace.origin();
        match &origin.left_out {
            Some(refusal) if !self.lenient => Err(import::unsupported(path, refusal).into()),
            _ => {
                say(path, &origin);
                Ok(trace)
            }
        }
    }

    /// Says what there is to say of a recorded program whose commands have been read to their end, if that was not known when it was opened.
    pub fn say_at_end(&self, path: &Path, trace: &Trace, opened: &Origin) {
        let origin = trace.origin();
        if origin != *opened {
            say(path, &origin);
        }
    }

    /// Opens a trace of any kind to show what is in it. What is not supported is no error.
    pub fn open_to_inspect(&self, path: &Path) -> Result<(Trace, Option<Report>)> {
        self.warn_ignored(path);
        let reading = trace::Reading { lenient: true, ..self.reading(path)? };
        let (trace, report) = self.read(path, reading, |reading| import::open_reported(path, reading))?;
        if let Some(cut) = trace.origin().cut {
            eprintln!("warning: {}: {cut}", path.display());
        }
        Ok((trace, report))
    }

    /// Opens a trace of any kind, with what is known of a recorded program.
    pub fn open_reported(&self, path: &Path) -> Result<(Trace, Option<Report>)> {
        self.warn_ignored(path);
        self.read(path, self.reading(path)?, |reading| import::open_reported(path, reading))
    }

    /// Warns of options that a trace of its kind ignores. They are not refused: where a command reads several traces, its options may be
    /// meant for others of them.
    fn warn_ignored(&self, path: &Path) {
        let Some(kind @ (TraceKind::Native | TraceKind::Wgpu)) = built_in::kind(path) else { return };
        for (option, given) in
            [("--lenient", self.lenient), ("--keep-draws", self.keep_draws), ("--window", self.window.is_some())]
        {
            if given {
                eprintln!("warning: {option} has no effect: {} is a {kind} trace, no recorded OpenGL program", path.display());
            }
        }
    }

    /// How the files of a trace are read.
    ///
    /// # Errors
    /// If an option is no limit.
    pub fn reading(&self, path: &Path) -> Result<trace::Reading> {
        Ok(trace::Reading {
            limits: self.limiting.set(Limits::default().for_files(bytes_of(path)))?,
            follow_links: self.follow_links,
            lenient: self.lenient,
            keep_draws: self.keep_draws,
            upward: false,
            window_alpha: false,
            window: self.window,
            in_memory: None,
        })
    }
}

/// The error, with the name of a scene if the file is not there and has its name.
fn hinted(path: &Path, mut error: TraceError) -> TraceError {
    let scene = path.file_stem().and_then(|name| scenes::named(name.to_str()?));
    if let (false, Some(scene)) = (path.exists(), scene) {
        error.reason.push_str(&format!("; @{} is built in", scene.name));
    }
    error
}

/// Bytes of the files of a trace: of a file, or of those in a folder and in its folder `trace`.
fn bytes_of(path: &Path) -> u64 {
    let below = |folder: &Path| -> u64 {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.filter_map(|entry| entry.metadata().ok()).filter(Metadata::is_file).map(|file| file.len()).sum()
    };
    match std::fs::metadata(path) {
        Ok(file) if file.is_file() => file.len(),
        _ => below(path) + below(&path.join("trace")),
    }
}

/// Says what there is to say of a recording: what it lacks, what is left out of it, and what else a person who sees the pictures needs.
fn say(path: &Path, origin: &Origin) {
    let path = path.display();
    if let (count, [first, ..]) = origin.skipped() {
        let actions = if count == 1 { "1 action is".to_owned() } else { format!("{count} actions are, the first of them") };
        eprintln!(
            "warning: {path}: left out, since it failed when it was recorded, or since it is not supported and nothing uses what it makes: \
             {actions} {first}"
        );
    }
    for note in &origin.notes {
        eprintln!("note: {path}: {note}");
    }
    if let Some(cut) = &origin.cut {
        eprintln!("warning: {path}: {cut}");
    }
    if let Some(refusal) = &origin.left_out {
        eprintln!("warning: {path}: left out, not supported: {refusal}");
    }
}

/// How a command ends that has used this trace to its end: it fails if the pictures lack something that is not supported.
pub fn verdict(trace: &Trace) -> Verdict {
    if trace.origin().left_out.is_some() { Verdict::Failed } else { Verdict::Done }
}

/// Whether a command failed since a recording asks for what is not supported: it is not damaged.
pub fn is_unsupported(error: &anyhow::Error) -> bool {
    error.chain().any(|cause| cause.downcast_ref::<TraceError>().is_some_and(|error| error.unsupported))
}
