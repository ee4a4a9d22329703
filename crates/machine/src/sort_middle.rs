//! The sort-middle machine: primitives are transformed and clipped by any geometry unit, then sorted, as screen-space triangles, to
//! the pipelines that own the pixels.

use super::blocks::{Builder, Built, Shape};
use super::class::{BuildError, Class, Sorted, no_early_tests, no_order_where_needed, no_runs};
use super::config::Config;
use unit::assembly::Mode;
use unit::class_state::ClassState;
use unit::distribute::Distribute;
use unit::fetch::FetchInput;
use unit::traverse::Territory;
use work::Shade;

/// What it is.
pub(super) const CLASS: Class = Class {
    sorted: Sorted::Triangles,
    in_place: true,
    one_place: false,
    shade: Shade::Visible,
    signatures: |_| false,
    refusals: &[no_runs, no_order_where_needed, no_early_tests],
    state: |_| ClassState::default(),
    build,
    sorting: |parts| parts.distribute.iter().map(|unit| unit.counts()).sum(),
    senders: |parts| parts.distribute.iter().map(Distribute::waits).collect(),
    order: |parts| parts.setup.iter().map(|unit| unit.counts().order_waiting_cycles).collect(),
};

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
fn build(config: &Config) -> Result<Built, BuildError> {
    let geometry = config.card.geometry_units as usize;
    let pipelines = config.card.pipelines as usize;
    let shape = Shape { fetch: 1, assembly: 1, clip: geometry, distribute: geometry, ..Shape::of(config) };
    let mut machine = Builder::new(config, shape, (geometry, pipelines))?;
    let segments = machine.command();
    let primitives = machine.vertices(vec![FetchInput::Segments(segments)], Mode::Segments);
    let triangles = machine.clip_and_distribute(primitives);
    let set_up = machine.setup(triangles, false);
    machine.pipelines_with_early_tests(set_up, Territory::Tiles);
    machine.finish()
}
