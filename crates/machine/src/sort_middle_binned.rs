//! The sort-middle machine that bins: the triangles of a whole pass are sorted into lists in memory, one for each tile of the screen;
//! then tile after tile is drawn, with its colours and depths on the chip.

use super::blocks::{Builder, Built, Shape};
use super::class::{BuildError, Class, Sorted, no_early_tests, no_order_where_needed, no_runs};
use super::config::{Config, Rule};
use unit::assembly::Mode;
use unit::class_state::ClassState;
use unit::distribute::Distribute;
use unit::fetch::FetchInput;
use unit::traverse::Territory;
use work::{BLOCK, Shade};

/// What it is.
pub(super) const CLASS: Class = Class {
    sorted: Sorted::Triangles,
    in_place: false,
    one_place: true,
    shade: Shade::Visible,
    signatures: |config| config.bin.skip_same_tiles,
    refusals: &[no_runs, no_order_where_needed, no_early_tests, tile_too_large],
    state: |config| ClassState { same_tiles: config.bin.skip_same_tiles, ..ClassState::default() },
    build,
    sorting: |parts| parts.bin.iter().map(|unit| unit.sorting()).sum(),
    senders: |parts| parts.distribute.iter().map(Distribute::waits).collect(),
    order: |parts| parts.bin.iter().map(|unit| unit.order().order_waiting_cycles).collect(),
};

/// The machine of a configuration.
///
/// # Errors
/// If the memory's values do not make one.
fn build(config: &Config) -> Result<Built, BuildError> {
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
    machine.finish()
}

/// The caches on the chip must hold a tile.
fn tile_too_large(config: &Config) -> Result<(), Rule> {
    let blocks = (config.bin.tile / BLOCK).pow(2);
    for (key, has) in [("depth.cache_blocks", config.depth.cache_blocks), ("color.cache_blocks", config.color.cache_blocks)] {
        if has < blocks {
            let must = format!("at least {blocks} to hold a tile of bin.tile = {}", config.bin.tile);
            return Err(Rule::must(key, has, must));
        }
    }
    Ok(())
}
