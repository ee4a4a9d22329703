//! Coverage against its definition, with examples made small where it fails; where the rules for lines and points meet. (`fillrate
//! accuracy oracle` has the adversarial cases.)

use crate::common::*;
use gfx::reference;
use gfx::setup::{self, Bounds, SAMPLES_1, SAMPLES_4, ScreenVertex};
use gfx::traverse::Blocks;
use num::Random;
use proptest::prelude::*;

fn line_pixels(samples: u32, from: [i32; 2], to: [i32; 2], window: [i32; 4]) -> Image {
    let state = state(samples, window);
    let vertex = |[x, y]: [i32; 2]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 };
    let mut image = Image::new(window);
    match setup::line(&state, &[vertex(from), vertex(to)], true) {
        Ok(line) if samples == 1 => image.draw::<1>(&line),
        Ok(line) => image.draw::<4>(&line),
        Err(_) => {}
    }
    image
}

#[test]
fn a_line_strip_draws_each_joint_once() {
    // What diamond exit is for: the end of one line is the start of the next, and no pixel is lost or drawn twice.
    for (from, middle, to) in [([0, 3], [10, 3], [20, 3]), ([2, 2], [9, 9], [20, 20]), ([20, 1], [11, 4], [2, 7])] {
        let window = [0, 0, 32, 32];
        let center = |p: [i32; 2]| p.map(|v| v * 256 + 128);
        let (a, b) = (line_pixels(1, center(from), center(middle), window), line_pixels(1, center(middle), center(to), window));
        let whole = line_pixels(1, center(from), center(to), window);
        for y in 0..32 {
            for x in 0..32 {
                assert_eq!(a.hits(x, y, 0) + b.hits(x, y, 0), whole.hits(x, y, 0), "{x} {y}");
            }
        }
    }
}

#[test]
fn wide_lines_are_rectangles_of_their_width() {
    let window = [0, 0, 40, 40];
    let mut random = Random::new(3);
    let (mut covered, mut ties) = (0, 0);
    for case in 0..600 {
        // Whole pixels and right angles have ties at borders.
        let step = if case % 3 == 0 { 128 } else { 1 };
        let mut position = || [(); 2].map(|()| (random.below(40 * 256 / step) * step) as i32);
        let (from, mut to) = (position(), position());
        if case % 6 == 0 {
            to[case % 12 / 6] = from[case % 12 / 6];
        }
        let half = if case % 3 == 0 { 64 * (1 + case as u16 % 9) } else { 1 + random.below(2000) as u16 };
        for samples in [1, 4] {
            let state = setup::SetupState { half_width: Some(half), ..state(samples, window) };
            let vertex = |[x, y]: [i32; 2]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 };
            let mut image = Image::new(window);
            match setup::line(&state, &[vertex(from), vertex(to)], true) {
                Ok(line) if samples == 1 => image.draw::<1>(&line),
                Ok(line) => image.draw::<4>(&line),
                Err(_) => {}
            }
            let offsets: &[[i32; 2]] = if samples == 1 { &SAMPLES_1 } else { &SAMPLES_4 };
            let [dx, dy] = [0, 1].map(|k| i128::from(to[k] - from[k]));
            let length = dx * dx + dy * dy;
            for y in 0..40 {
                for x in 0..40 {
                    for (s, offset) in offsets.iter().enumerate() {
                        let [px, py] = [0, 1].map(|k| i128::from([x, y][k] * 256 + 128 + offset[k] - from[k]));
                        let (along, across) = (px * dx + py * dy, dx * py - dy * px);
                        // The distance from the line in units of half the width, squared: across^2 / (half^2 length).
                        let (square, limit) = (across * across, i128::from(half) * i128::from(half) * length);
                        let beside = if across < 0 { square <= limit } else { square < limit };
                        let inside = (0..length).contains(&along) && beside;
                        ties += u32::from(square == limit && (0..length).contains(&along));
                        covered += u32::from(inside);
                        assert_eq!(image.hits(x, y, s), u32::from(inside), "{from:?} {to:?} {half} {samples}: {x} {y} {s}");
                    }
                }
            }
        }
    }
    assert!(covered > 100_000 && ties > 100, "{covered} {ties}");
}

#[test]
fn a_point_is_one_pixel() {
    let window = [0, 0, 16, 16];
    for x in 0..16 * 256 {
        let y = (x * 7) % (16 * 256);
        let mut image = Image::new(window);
        let point = setup::point(&state(1, window), &ScreenVertex { x, y, z: 0.0, inv_w: 1.0 }, true);
        // A position on the border of two pixels belongs to the left or upper one.
        let (column, row) = ((x - 1) >> 8, (y - 1) >> 8);
        let Ok(point) = point else {
            assert!(column < 0 || row < 0, "{x} {y}");
            continue;
        };
        image.draw::<1>(&point);
        assert_eq!(image.total(), 1);
        assert_eq!(image.hits(column, row, 0), 1);
    }
}

/// Compares the samples that a triangle covers in 10x10 pixels with the definition.
fn is_as_defined<const S: usize>(v: [[i32; 2]; 3]) -> Result<(), TestCaseError> {
    let window = [0, 0, 10, 10];
    let mut image = Image::new(window);
    if let Ok(t) = setup::triangle(&state(S as u32, window), &v.map(|[x, y]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 })) {
        image.draw::<S>(&t);
    }
    for y in 0..10 {
        for x in 0..10 {
            for (s, place) in reference::samples(S as u32).iter().enumerate() {
                let sample = [i64::from(x) * 256 + place[0], i64::from(y) * 256 + place[1]];
                let expected = reference::triangle_covers(v.map(|p| p.map(i64::from)), sample);
                prop_assert_eq!(image.hits(x, y, s), u32::from(expected), "pixel {} {} sample {}", x, y, s);
            }
        }
    }
    Ok(())
}

/// A coordinate in and about the window, often on a grid of samples, now and then far away.
fn coordinate() -> impl Strategy<Value = i32> {
    prop_oneof![-200..2800, (-2..22).prop_map(|v| v * 128), (-4..90).prop_map(|v| v * 32), -(32767 << 8)..(32767 << 8)]
}

proptest! {
    #[test]
    fn triangles_cover_what_their_definition_says(v in prop::array::uniform3(prop::array::uniform2(coordinate()))) {
        is_as_defined::<1>(v)?;
        is_as_defined::<4>(v)?;
    }

    #[test]
    fn outlines_cover_what_their_triangles_do(v in prop::array::uniform3(prop::array::uniform2(-20i64..120)), at in prop::array::uniform2(-20i64..120)) {
        // Two definitions, written apart.
        prop_assert_eq!(reference::polygon_covers(&v, at), reference::triangle_covers(v, at));
    }
}

#[test]
fn samples_are_where_the_specification_has_them() {
    let offsets = |count| reference::samples(count).iter().map(|p| p.map(|v| v as i32 - 128)).collect::<Vec<_>>();
    assert_eq!((offsets(1), offsets(4)), (SAMPLES_1.to_vec(), SAMPLES_4.to_vec()));
}

/// The blocks of an area with whole blocks taken as such or tested sample by sample, and how many are full.
fn both_ways<const S: usize>(triangle: &setup::Triangle, area: Bounds) -> usize {
    let (mut whole, mut tested) = (Blocks::<S>::new(), Blocks::<S>::new());
    tested.takes_whole = false;
    whole.find(triangle, area);
    tested.find(triangle, area);
    assert_eq!(whole[..], tested[..]);
    whole.iter().filter(|block| block.full).count()
}

#[test]
fn what_is_taken_whole_is_what_tests_find_full() {
    let mut random = Random::new(11);
    let mut full = 0;
    for _ in 0..3000 {
        let mut vertex = || {
            let [x, y] = [0; 2].map(|_: i32| random.below(200 * 256) as i32 - 64 * 256);
            ScreenVertex { x, y, z: 0.5, inv_w: 1.0 }
        };
        let corners = [vertex(), vertex(), vertex()];
        // An odd window: blocks at its right and lower edge are never full.
        for samples in [1, 4] {
            let Ok(triangle) = setup::triangle(&state(samples, [0, 0, 64, 61]), &corners) else { continue };
            let area = Bounds { x0: 0, y0: 0, x1: 64, y1: 64 };
            full += if samples == 1 { both_ways::<1>(&triangle, area) } else { both_ways::<4>(&triangle, area) };
        }
    }
    assert!(full > 10_000, "{full}");
}

#[test]
fn the_rule_for_lower_edges_is_the_other_rule_upside_down() {
    let (window, mut random) = ([0, 0, 32, 32], Random::new(17));
    let (mut ties, lower) = (0, setup::SetupState { lower_edges: true, ..state(1, window) });
    for case in 0..3000 {
        // Quarters of pixels, so that many samples lie on edges.
        let corners: [[i32; 2]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| 64 * random.below(128) as i32));
        let drawn = |state: &setup::SetupState, mirrored: bool| {
            let v = corners.map(|[x, y]| ScreenVertex { x, y: if mirrored { 8192 - y } else { y }, z: 0.5, inv_w: 1.0 });
            let mut image = Image::new(window);
            let primitive = if case % 2 == 0 { setup::triangle(state, &v) } else { setup::line(state, &[v[0], v[1]], true) };
            if let Ok(primitive) = primitive {
                image.draw::<1>(&primitive);
            }
            image
        };
        let (plain, turned, other) = (drawn(&state(1, window), false), drawn(&lower, true), drawn(&lower, false));
        for (x, y) in (0..32).flat_map(|y| (0..32).map(move |x| (x, y))) {
            assert_eq!(plain.hits(x, y, 0), turned.hits(x, 31 - y, 0), "{corners:?}: {x} {y}");
            ties += u32::from(plain.hits(x, y, 0) != other.hits(x, y, 0));
        }
    }
    assert!(ties > 100, "{ties} samples that the rules settle differently");
}
