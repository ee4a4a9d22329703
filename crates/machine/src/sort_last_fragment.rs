//! The sort-last machine that sorts fragments: primitives are dealt to pipelines, each of which transforms, rasterises and shades its
//! own, wherever on the screen they lie; shaded quads go through a network to the ROPs that own the pixels. What is certainly hidden there
//! can be thrown away before it is shaded, if a knob says so.

use super::blocks::{Builder, Built, Shape};
use super::class::{BuildError, Class, Sorted, no_runs};
use super::config::Config;
use unit::assembly::Mode;
use unit::class_state::ClassState;
use unit::dispatch::Dispatch;
use unit::fetch::FetchInput;
use unit::frame::FrameBuffers;
use unit::sorting::EarlyTest;
use work::Shade;

/// What it is.
pub(super) const CLASS: Class = Class {
    sorted: Sorted::Fragments,
    in_place: true,
    one_place: false,
    shade: Shade::Covered,
    signatures: |_| false,
    refusals: &[no_runs],
    state,
    build,
    sorting: |parts| parts.dispatch.iter().map(|unit| unit.sorting()).sum(),
    senders: |parts| parts.dispatch.iter().map(Dispatch::waits).collect(),
    order: |parts| parts.order.iter().map(|unit| unit.counts().order_waiting_cycles).collect(),
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
        order: pipelines,
        early: if config.order.early == EarlyTest::None { 0 } else { pipelines },
        ..Shape::of(config)
    };
    let mut machine = Builder::new(config, shape, (pipelines, pipelines))?;
    let segments = machine.command();
    let batches = machine.deal(segments);
    let runs = batches.all().into_iter().map(FetchInput::Runs).collect();
    let primitives = machine.vertices(runs, Mode::Runs { marks: true, counts: true });
    let triangles = machine.clip_in_place(primitives);
    let set_up = machine.setup(triangles, true);
    machine.pipelines_sorting_fragments(set_up);
    machine.finish()
}

/// A pipeline that tests against what it has drawn itself keeps that.
fn state(config: &Config) -> ClassState {
    let local = config.order.early == EarlyTest::Local;
    let seen = if local { vec![FrameBuffers::default(); config.card.pipelines as usize] } else { Vec::new() };
    ClassState { seen, ..ClassState::default() }
}
