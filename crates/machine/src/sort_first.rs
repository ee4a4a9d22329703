//! The sort-first machine: primitives are sent, before geometry, to the pipelines that own what they touch on the screen; each
//! pipeline transforms, rasterises and shades for its part of the screen alone.

use super::blocks::{Builder, Built, Shape};
use super::class::{BuildError, Class, Sorted, no_early_tests, no_order_where_needed, no_runs};
use super::config::Config;
use unit::assembly::Mode;
use unit::class_state::ClassState;
use unit::route::Route;
use unit::traverse::Territory;
use work::Shade;

/// What it is.
pub(super) const CLASS: Class = Class {
    sorted: Sorted::Primitives,
    in_place: true,
    one_place: false,
    shade: Shade::Visible,
    signatures: |_| false,
    refusals: &[no_runs, no_order_where_needed, no_early_tests],
    state: |_| ClassState::default(),
    build,
    sorting: |parts| parts.route.iter().map(|unit| unit.sorting()).sum(),
    senders: |parts| parts.route.iter().map(Route::waits).collect(),
    order: |parts| parts.gather.iter().map(|unit| unit.counts().order_waiting_cycles).collect(),
};

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
fn build(config: &Config) -> Result<Built, BuildError> {
    let pipelines = config.card.pipelines as usize;
    let shape = Shape {
        deal: 1,
        route: pipelines,
        gather: pipelines,
        fetch: pipelines,
        assembly: pipelines,
        clip: pipelines,
        distribute: pipelines,
        ..Shape::of(config)
    };
    let mut machine = Builder::new(config, shape, (pipelines, pipelines))?;
    let segments = machine.command();
    let batches = machine.deal(segments);
    let primitives = machine.route(batches);
    let primitives = machine.vertices(primitives, Mode::Runs { marks: false, counts: false });
    let triangles = machine.clip_in_place(primitives);
    let set_up = machine.setup(triangles, false);
    machine.pipelines_with_early_tests(set_up, Territory::Tiles);
    machine.finish()
}
