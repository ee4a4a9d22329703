//! The sort-middle machine that bins: the triangles of a whole pass are sorted into lists in memory, one for each tile of the screen;
//! then tile after tile is drawn, with its colours and depths on the chip.

use super::build::{Builder, Built, Shape};
use super::config::Config;
use unit::assembly::Mode;
use unit::fetch::FetchInput;
use unit::traverse::Territory;
use work::BLOCK;

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
pub(super) fn build(config: &Config) -> Result<Built, String> {
    let (geometry, pipelines) = (config.card.geometry_units as usize, config.card.pipelines as usize);
    let shape = Shape {
        fetch: 1,
        assembly: 1,
        clip: geometry,
        distribute: geometry,
        bin: 1,
        tile_fetch: pipelines,
        hide: if config.bin.hide { pipelines } else { 0 },
        ..Shape::of(config)
    };
    let mut machine = Builder::new(config, shape, (geometry, 1))?;
    let segments = machine.command();
    let primitives = machine.vertices(vec![FetchInput::Segments(segments)], Mode::Segments);
    let triangles = machine.clip_and_distribute(primitives);
    let tiles = triangles.into_iter().flat_map(|triangles| machine.bin(triangles)).collect();
    let set_up = machine.setup(tiles, true);
    machine.pipelines_with_early_tests(set_up, Territory::Bins(config.bin.tile / BLOCK));
    Ok(machine.finish())
}
