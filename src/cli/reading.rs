//! Options of all subcommands that read a trace: limits, and which of its files are read.

use std::path::Path;

use anyhow::{Result, anyhow};

use crate::import;
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
}

impl Reading {
    /// The options as they were given, for another process.
    pub fn options(&self) -> Vec<String> {
        let limits = self.limits.iter().flat_map(|limit| ["--limit".to_owned(), limit.clone()]);
        limits.chain(self.follow_links.then(|| "--follow-links".to_owned())).collect()
    }

    /// Opens a trace of any kind.
    pub fn open(&self, path: &Path) -> Result<Trace> {
        let mut limits = Limits::default();
        for assignment in &self.limits {
            limits.set(assignment).map_err(|reason| anyhow!("--limit {reason}"))?;
        }
        Ok(import::open_with(path, &trace::Reading { limits, follow_links: self.follow_links })?)
    }
}
