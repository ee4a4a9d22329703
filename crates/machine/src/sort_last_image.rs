//! The sort-last machine that sorts images: primitives are dealt to pipelines, each of which draws its own into a frame buffer of its
//! own; when the pass is drawn, the frame buffers are composed into one.

use super::blocks::{Builder, Built, Shape};
use super::class::{BuildError, Class, Sorted, no_early_tests, no_order_where_needed};
use super::config::Config;
use unit::assembly::{Deal, Mode};
use unit::class_state::ClassState;
use unit::fetch::FetchInput;
use unit::frame::FrameBuffers;
use unit::network::SenderCounts;
use unit::sorting::Keep;
use unit::traverse::Territory;
use work::Shade;

/// What it is.
pub(super) const CLASS: Class = Class {
    sorted: Sorted::Images,
    in_place: false,
    one_place: false,
    shade: Shade::Covered,
    signatures: |_| false,
    refusals: &[no_order_where_needed, no_early_tests],
    state,
    build,
    sorting: |parts| parts.compose.iter().map(|unit| unit.sorting()).sum(),
    // Composition is accounted for as a whole.
    senders: |_| vec![SenderCounts::default()],
    order: |_| Vec::new(),
};

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
fn build(config: &Config) -> Result<Built, BuildError> {
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
    let runs = batches.all().into_iter().map(FetchInput::Runs).collect();
    let primitives = machine.vertices(runs, Mode::Runs { marks: false, counts: true });
    let triangles = machine.clip_in_place(primitives);
    let set_up = machine.setup(triangles, false);
    machine.pipelines_with_early_tests(set_up, Territory::Copy);
    machine.compose();
    machine.finish()
}

/// Each pipeline has copies of its own.
fn state(config: &Config) -> ClassState {
    let pipelines = config.card.pipelines as usize;
    ClassState {
        copies: vec![FrameBuffers::default(); pipelines],
        unnumbered: config.order.keep == Keep::Never,
        chunks: pipelines > 1 && config.assembly.deal == Deal::Contiguous,
        ..ClassState::default()
    }
}
