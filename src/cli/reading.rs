//! Options of all subcommands that read a trace: limits, and which of its files are read.

use std::path::Path;

use anyhow::{Result, anyhow, bail};

use crate::import;
use crate::import::gl::Report;
use crate::num::Limits;
use crate::trace::{self, Trace};

/// How far a trace is trusted.
#[derive(clap::Args)]
pub struct Reading {
    /// Raise a limit on what a trace may ask for (docs/data/limits.md lists them); may be repeated
    #[arg(long = "limit", value_name = "NAME=VALUE")]
    limits: Vec<String>,
    /// Read files of the trace that symbolic links lead to
    #[arg(long)]
    follow_links: bool,
    /// Take a recorded OpenGL program that asks for what is not supported, and leave that out
    #[arg(long)]
    lenient: bool,
}

impl Reading {
    /// The options as they were given, for another process.
    pub fn options(&self) -> Vec<String> {
        let limits = self.limits.iter().flat_map(|limit| ["--limit".to_owned(), limit.clone()]);
        let flags = [(self.follow_links, "--follow-links"), (self.lenient, "--lenient")];
        limits.chain(flags.into_iter().filter(|(on, _)| *on).map(|(_, flag)| flag.to_owned())).collect()
    }

    /// Opens a trace of any kind. What is left out of a recorded program is said.
    pub fn open(&self, path: &Path) -> Result<Trace> {
        let (trace, report) = self.open_reported(path)?;
        if let Some(refusal) = report.and_then(|report| report.refusal()) {
            let path = path.display();
            if !self.lenient {
                bail!("{path}: not supported: {refusal}; --lenient leaves it out");
            }
            eprintln!("warning: {path}: left out, not supported: {refusal}");
        }
        Ok(trace)
    }

    /// Opens a trace of any kind, with what is known of a recorded program.
    pub fn open_reported(&self, path: &Path) -> Result<(Trace, Option<Report>)> {
        let mut limits = Limits::default();
        for assignment in &self.limits {
            limits.set(assignment).map_err(|reason| anyhow!("--limit {reason}"))?;
        }
        let reading = trace::Reading { limits, follow_links: self.follow_links, lenient: self.lenient };
        Ok(import::open_reported(path, &reading)?)
    }
}
