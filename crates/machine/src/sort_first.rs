//! The sort-first machine: primitives are sent, before geometry, to the pipelines that own what they touch on the screen; each
//! pipeline transforms, rasterises and shades for its part of the screen alone.

use super::build::{Builder, Built, Shape};
use super::config::Config;
use unit::assembly::Mode;
use unit::traverse::Territory;

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
pub(super) fn build(config: &Config) -> Result<Built, String> {
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
    Ok(machine.finish())
}
