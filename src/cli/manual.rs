//! `fillrate completions` and `fillrate manual`, made from the declarations of all options.

use std::io::Write;
use std::path::PathBuf;

use anyhow::{Context, Result};
use clap::{Command, CommandFactory};
use clap_complete::Shell;
use clap_mangen::Man;

use super::Verdict;
use crate::host;

/// Print completions for a shell
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate completions bash > ~/.local/share/bash-completion/completions/fillrate")]
pub struct Completions {
    /// The shell
    shell: Shell,
}

/// Leave manual pages in a folder, one for each subcommand
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate manual ~/.local/share/man/man1 && man fillrate-replay")]
pub struct Manual {
    /// The folder, which is made where it is missing. Pages of these names are replaced
    dir: PathBuf,
}

pub fn completions(arguments: &Completions) -> Result<Verdict> {
    let mut text = Vec::new();
    clap_complete::generate(arguments.shell, &mut super::Arguments::command(), "fillrate", &mut text);
    // Ours alone, with tabs that a terminal may obey.
    super::said(std::io::stdout().write_all(&text));
    Ok(Verdict::Done)
}

pub fn manual(arguments: &Manual) -> Result<Verdict> {
    let dir = &arguments.dir;
    std::fs::create_dir_all(dir).with_context(|| format!("cannot create {}", dir.display()))?;
    let mut command = super::Arguments::command().disable_help_subcommand(true);
    command.build();
    let mut pages = Vec::new();
    collect(&command, &mut pages);
    for page in &pages {
        let path = dir.join(page.get_filename());
        let mut text = Vec::new();
        page.render(&mut text)?;
        host::write_file(&path, &text).with_context(|| format!("cannot write {}", path.display()))?;
    }
    tell!("{} pages written to {}", pages.len(), dir.display());
    Ok(Verdict::Done)
}

/// Adds the pages of a command and of all below it.
fn collect(command: &Command, pages: &mut Vec<Man>) {
    pages.push(Man::new(command.clone()));
    command.get_subcommands().for_each(|sub| collect(sub, pages));
}
