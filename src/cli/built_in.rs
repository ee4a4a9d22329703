//! Scenes and experiments that are built in: `@NAME` stands for them wherever a command takes a trace or an experiment.

use std::path::Path;

use anyhow::{Result, bail};

use crate::import::{TraceKind, detect};
use crate::num::nearest;
use crate::scenes::{self, Scene};
use crate::sweep::experiment::{self, BuiltIn};

/// What a name that begins with `@` stands for.
pub enum Found {
    /// A scene.
    Scene(&'static Scene),
    /// An experiment.
    Experiment(&'static BuiltIn),
}

/// The scene or experiment that `@NAME` stands for. None for the path of a file or folder.
///
/// # Errors
/// If nothing has this name; the message has the nearest name and all names.
pub fn named(path: &Path) -> Result<Option<Found>> {
    let Some(name) = path.to_str().and_then(|path| path.strip_prefix('@')) else { return Ok(None) };
    if let Some(scene) = scenes::named(name) {
        return Ok(Some(Found::Scene(scene)));
    }
    if let Some(experiment) = experiment::BUILT_IN.iter().find(|experiment| experiment.name == name) {
        return Ok(Some(Found::Experiment(experiment)));
    }
    let scenes: Vec<&str> = scenes::ALL.iter().map(|scene| scene.name).collect();
    let experiments: Vec<&str> = experiment::BUILT_IN.iter().map(|experiment| experiment.name).collect();
    let near = nearest(scenes.iter().chain(&experiments).copied(), name);
    let near = near.map_or(String::new(), |name| format!("; @{name} is the nearest"));
    bail!(
        "there is no scene or experiment @{name}{near}; scenes are @{}; experiments are @{}; ./@{name} is a file",
        scenes.join(", @"),
        experiments.join(", @")
    );
}

/// The scene that `@NAME` stands for. None for the path of a file or folder.
///
/// # Errors
/// If nothing has this name, or if an experiment has it.
pub fn scene(path: &Path) -> Result<Option<&'static Scene>> {
    match named(path)? {
        None => Ok(None),
        Some(Found::Scene(scene)) => Ok(Some(scene)),
        Some(Found::Experiment(experiment)) => {
            let name = experiment.name;
            bail!("@{name} is an experiment, not a trace: `fillrate sweep @{name} --out DIR` runs it")
        }
    }
}

/// Whether there is something to open by this path or name.
pub fn is_there(path: &Path) -> bool {
    matches!(named(path), Ok(Some(Found::Scene(_)))) || path.exists()
}

/// The kind of the trace that a path or name stands for. None if there is no trace.
pub fn kind(path: &Path) -> Option<TraceKind> {
    match named(path) {
        Ok(Some(Found::Scene(_))) => Some(TraceKind::Native),
        _ => detect(path).map(|found| found.kind),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_name_stands_for_one_thing() {
        for experiment in experiment::BUILT_IN {
            assert!(scenes::named(experiment.name).is_none(), "{}", experiment.name);
            let path = format!("@{}", experiment.name);
            assert!(matches!(named(Path::new(&path)), Ok(Some(Found::Experiment(_)))), "{path}");
        }
        assert!(matches!(scene(Path::new("@cube")), Ok(Some(scene)) if scene.name == "cube"));
        assert!(matches!(scene(Path::new("cube")), Ok(None)));
        assert!(matches!(scene(Path::new("./@cube")), Ok(None)));
    }
}
