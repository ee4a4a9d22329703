//! The sort-last machine that sorts images: primitives are dealt to pipelines, each of which draws its own into a frame buffer of its
//! own; when the pass is drawn, the frame buffers are composed into one.

use super::build::{Builder, Built, Shape};
use super::config::Config;
use unit::assembly::Mode;
use unit::fetch::FetchInput;
use unit::traverse::Territory;

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
pub(super) fn build(config: &Config) -> Result<Built, String> {
    let pipelines = config.card.pipelines as usize;
    let shape = Shape {
        deal: 1,
        fetch: pipelines,
        assembly: pipelines,
        clip: pipelines,
        distribute: pipelines,
        compose: pipelines,
        ..Shape::of(config)
    };
    let mut machine = Builder::new(config, shape, (pipelines, pipelines))?;
    let segments = machine.command();
    let batches = machine.deal(segments);
    let runs = batches.into_iter().map(FetchInput::Runs).collect();
    let primitives = machine.vertices(runs, Mode::Runs { marks: false, counts: true });
    let triangles = machine.clip_in_place(primitives);
    let set_up = machine.setup(triangles, false);
    machine.pipelines_with_early_tests(set_up, Territory::Copy);
    machine.compose();
    Ok(machine.finish())
}
