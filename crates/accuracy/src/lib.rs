//! What a correct model must reproduce, measured on the model itself.
//!
//! A [`Target`] is a yardstick: an identity, a closed form or a rule of a specification. Its check makes its own input, runs the code
//! that a replay runs, and leaves [`Row`]s of what was expected and what came out. With [`Setting::inject_fault`] a check spoils what it hands
//! from one stage to the next, as its target says: then it must fail, which shows that it can.
//!
//! A new target is a constant beside its check, and a place in its section's list; `docs/data/accuracy.md` is then written anew, as
//! `docs/README.md` says.
//!
//! ```
//! use accuracy::{Setting, Size};
//!
//! let target = accuracy::find("walks")?;
//! let rows = (target.check)(&Setting { seed: 1, size: Size::Small, inject_fault: false })?;
//! assert!(!rows.is_empty() && rows.iter().all(|row| row.holds()));
//! # Ok::<(), anyhow::Error>(())
//! ```

pub mod attila;
pub mod card;
pub mod classes;
mod depth;
mod draws;
pub mod estimates;
pub(crate) mod exact;
pub mod gl;
mod harness;
pub mod knobs;
mod measure;
mod memory;
mod page;
pub mod pareto;
mod raster;
mod rates;
pub mod runs;
pub mod scenes;
pub mod sequences;
pub mod shortcuts;
pub mod skips;
mod sorting;
mod target;
mod texture;
mod walks;

use anyhow::Result;

pub use page::{header, json, lines, markdown, size_name};
pub use target::{Row, Section, Setting, Size, Target, TargetResult};

/// All targets, in order.
pub fn targets() -> impl Iterator<Item = &'static Target> {
    [
        exact::TARGETS,
        raster::TARGETS,
        &[walks::WALKS],
        sorting::TARGETS,
        depth::TARGETS,
        texture::TARGETS,
        memory::TARGETS,
        rates::TARGETS,
        gl::TARGETS,
    ]
    .into_iter()
    .flatten()
}

/// The target of that name.
///
/// # Errors
/// If there is none: the message names one that is near.
pub fn find(id: &str) -> Result<&'static Target> {
    targets()
        .find(|target| target.id == id)
        .ok_or_else(|| anyhow::anyhow!("there is no target {id}{}", hint(targets().map(|target| target.id), id)))
}

/// What a message about a name that there is not ends with: a name that is near, and where all are.
fn hint(names: impl Iterator<Item = &'static str>, given: &str) -> String {
    match num::nearest(names, given) {
        Some(name) => format!("; {name} is the nearest, and --list names all"),
        None => "; --list names all".to_owned(),
    }
}

/// The target of that name, or all whose names begin with it and a dash: `gl` means those of OpenGL's fixed functions.
///
/// # Errors
/// As [`find`].
pub fn find_all(id: &str) -> Result<Vec<&'static Target>> {
    let group: Vec<_> =
        targets().filter(|target| target.id.strip_prefix(id).is_some_and(|rest| rest.starts_with('-'))).collect();
    if targets().any(|target| target.id == id) || group.is_empty() { Ok(vec![find(id)?]) } else { Ok(group) }
}
