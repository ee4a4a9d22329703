//! `fillrate accuracy scenes`

use std::path::PathBuf;

use anyhow::{Context, Result, bail};

use super::Verdict;
use crate::accuracy::scenes::{self, SCENES, Scene};
use crate::accuracy::{Setting, Size};
use crate::host;

/// Techniques of a graphics course: each scene's picture proven, and its price on every sort class
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate accuracy scenes\n  fillrate accuracy scenes abuffer pcf\n  \
fillrate accuracy scenes --page docs/data\n\nExit code 1 where a scene does not hold.")]
pub struct Arguments {
    /// Scenes by name [default: all]
    #[arg(value_name = "NAME")]
    scenes: Vec<String>,
    /// Name the scenes, and what each proves
    #[arg(long)]
    list: bool,
    /// Inject the fault that --list names for each scene, whose proof must then fail
    #[arg(long)]
    inject_fault: bool,
    /// Write each scene's picture into this folder, as NAME.png
    #[arg(long, value_name = "DIR")]
    pictures: Option<PathBuf>,
    /// Write the page of all scenes into this folder, as techniques.md, with its pictures in techniques/
    #[arg(long, value_name = "DIR", conflicts_with_all = ["inject_fault", "scenes"])]
    page: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let chosen: Vec<&'static Scene> = if arguments.scenes.is_empty() {
        SCENES.to_vec()
    } else {
        arguments.scenes.iter().map(|name| scenes::find(name)).collect::<Result<_>>()?
    };
    if arguments.list {
        for scene in chosen {
            println!("{:<12} {}\n{:<12} fault: {}", scene.name, scene.what, "", scene.fault);
        }
        return Ok(Verdict::Done);
    }
    let setting = Setting { seed: 1, size: Size::Standard, inject_fault: arguments.inject_fault };
    let outcomes = scenes::run(&chosen, &setting)?;
    for outcome in &outcomes {
        print!("{}", scenes::text(outcome));
    }
    if let Some(folder) = &arguments.pictures {
        scenes::pictures(&outcomes, folder)?;
    }
    let failed = outcomes.iter().filter(|outcome| !outcome.holds()).count();
    println!("{} of {} hold", outcomes.len() - failed, outcomes.len());
    if let Some(folder) = &arguments.page {
        if failed > 0 {
            bail!("the page is not written: not all scenes hold");
        }
        scenes::pictures(&outcomes, &folder.join("techniques"))?;
        let path = folder.join("techniques.md");
        host::write_file(&path, scenes::markdown(&outcomes, "techniques").as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(if failed > 0 { Verdict::Failed } else { Verdict::Done })
}
