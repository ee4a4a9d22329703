//! The sort-middle machine: primitives are transformed and clipped by any geometry unit, then sorted, as screen-space triangles, to
//! the pipelines that own the pixels.

use super::build::{Builder, Clients, Shape};
use super::config::Config;
use super::parts::Parts;

/// The machine of a configuration, and the names of its memory clients.
///
/// # Errors
/// If the memory's values do not make one.
pub fn build(config: &Config) -> Result<(Parts, Clients), String> {
    let geometry = config.card.geometry_units as usize;
    let mut machine = Builder::new(config, Shape { fronts: 1, clippers: geometry, distributors: geometry })?;
    let segments = machine.command();
    let primitives = machine.vertices(vec![segments]);
    let triangles = machine.clip_and_distribute(primitives);
    let set_up = machine.setup(triangles);
    machine.pipelines_with_early_tests(set_up);
    Ok(machine.finish())
}
