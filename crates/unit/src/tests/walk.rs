//! Walks: how many tests each takes, by closed form, and the cycles that follow.

use std::sync::Arc;

use super::scenery::{card_of_tiles, draw, row_of_tiles};
use super::traverse::{config, cycles, traversed, triangles};
use crate::Card;
use crate::traverse::{TraverseConfig, Walk};
use work::{End, Segment};

fn by(walk: Walk, rate: u32) -> TraverseConfig {
    TraverseConfig { walk, pixel_tests_per_cycle: rate, ..config() }
}

fn tested(config: &TraverseConfig, segment: &Segment) -> u64 {
    traversed(config, segment, &[], |_| ()).2.tested
}

#[test]
fn each_walk_tests_what_its_closed_form_says() {
    // One covered block of 4 quads and seven empty ones: a box of 64 x 8 pixels, 16 of which are covered. Uncut it is 1000 pixels.
    let mut one = triangles(1, 1, 4, 7);
    one.triangles[0].unclipped = 1000;
    for (walk, tests) in [(Walk::Blocks, 8), (Walk::Rows, 8 + 16), (Walk::Box, 64 * 8), (Walk::Reject, 1000)] {
        assert_eq!(tested(&by(walk, 1), &one), tests, "{walk:?}");
        if walk != Walk::Blocks {
            for rate in [1, 3, 4] {
                assert_eq!(cycles(&by(walk, rate), &one), tests.div_ceil(rate.into()), "{walk:?} at {rate} a cycle");
            }
        }
    }
    // A box that ends inside of blocks.
    one.triangles[0].pixels = [3, 1, 60, 7];
    assert_eq!([Walk::Rows, Walk::Box].map(|walk| tested(&by(walk, 1), &one)), [6 + 16, 57 * 6]);
}

#[test]
fn a_block_goes_on_when_its_own_tests_are_made() {
    // Two blocks of 8 x 8 pixels, of which 16 are covered, at 4 tests per cycle: 16 cycles each by the box, 4 by rows; the first group is
    // sent in the last of them, which is cycle 16 or 4, and comes in the next.
    let two = triangles(1, 2, 4, 0);
    let times = |walk| -> Vec<_> { traversed(&by(walk, 4), &two, &[], |_| ()).0.iter().map(|&(at, _)| at).collect() };
    assert_eq!(times(Walk::Box), [17, 33, 33]);
    // The 8 rows are two cycles more.
    assert_eq!(times(Walk::Rows), [5, 9, 11]);
}

#[test]
fn tests_that_a_triangle_leaves_are_the_next_ones_and_quads_hide_tests() {
    // 24 tests each, 16 per cycle.
    assert_eq!(cycles(&by(Walk::Rows, 16), &triangles(3, 1, 4, 7)), 5);
    // 8 blocks of 16 quads, 4 per cycle, take 32 cycles; the 512 pixels of their box two.
    assert_eq!(cycles(&by(Walk::Box, 256), &triangles(1, 8, 16, 0)), 32);
    // At 8 tests per cycle they take 64; the last block's four groups are sent in the last of these and the three cycles behind it.
    assert_eq!(cycles(&by(Walk::Box, 8), &triangles(1, 8, 16, 0)), 64 + 3);
}

#[test]
fn an_uncut_box_of_16384_pixels_each_way_is_2_to_the_28_tests() {
    let mut huge = triangles(1, 1, 4, 7);
    huge.triangles[0].unclipped = 1 << 28;
    assert_eq!(tested(&by(Walk::Reject, 4096), &huge), 1 << 28);
    assert_eq!(cycles(&by(Walk::Reject, 4096), &huge), 1 << 16);
    // What covers nothing is walked all the same.
    (huge.triangles[0].visits, huge.triangles[0].end) = (0, End::Traversal);
    assert_eq!(cycles(&by(Walk::Reject, 4096), &huge), 1 << 16);
    assert_eq!([Walk::Rows, Walk::Box].map(|walk| tested(&by(walk, 1), &huge)), [8, 512]);
}

#[test]
fn of_several_pipelines_each_walks_the_box_in_its_own_tiles() {
    // Tiles of one block, dealt to two pipelines in turn: of the 64 blocks of the box half are pipeline 0's, some in every row. Uncut the
    // box is everybody's: who rejects pixels does not know whose they are.
    let segment = row_of_tiles(1, 8, 4, 7);
    let share = |card: &mut Card| {
        *card = card_of_tiles(2, 8);
        card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
    };
    let tests = |walk| traversed(&by(walk, 64), &segment, &[], share).2.tested;
    assert_eq!([Walk::Rows, Walk::Box, Walk::Reject].map(tests), [64 + 4 * 16, 32 * 64, 64 * 64]);
}

#[test]
fn samples_of_a_pixel_are_one_pixel() {
    // Where shaders run once per sample a quad comes four times.
    let mut segment = triangles(1, 1, 8, 0);
    for (n, quad) in segment.tiles[0].quads.iter_mut().enumerate() {
        (quad.position, quad.coverage) = (n as u8 / 4, 0b1011 << (4 * (n % 4)));
    }
    assert_eq!(tested(&by(Walk::Rows, 64), &segment), 8 + 2 * 3);
}
