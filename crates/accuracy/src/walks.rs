//! Walks of the rasteriser: what is tested for coverage, by closed form.

use std::sync::Arc;

use anyhow::Result;

use crate::harness::{config, counts, run, wrong_pixels};
use crate::{Row, Section, Setting, Target};
use machine::config::SortClass;
use synthetic::{Scene, events};
use unit::traverse::{TRAVERSAL, TraverseCounts};
use work::{Event, Shade};

pub const WALKS: Target = Target {
    id: "walks",
    section: Section::Raster,
    what: "Tests for coverage of right isosceles triangles with legs of L pixels at the corner of a target of W x W: by blocks those of \
           8x8 pixels of the 64x64 tiles that are met; by rows min(L, W) and the pixels covered, L(L-1)/2 of them if L <= W; by boxes \
           min(L, W)^2; with rejection L^2, 2^28 for L = 16384. On all sort classes, with one picture; \
           lists of tiles take boxes apart, and rejection once per tile; at 4096 tests per cycle L^2 tests \
           take L^2/4096 cycles",
    bound: "exact",
    fault: "the box of each triangle is a row higher and wider on its way to the machine",
    check,
};

/// One triangle with legs of `legs` pixels at the corner of a square target.
fn scene(edge: u32, legs: u32) -> Scene {
    let l = legs as f32;
    Scene::plain(edge, edge, vec![[[0.0, 0.0], [l, 0.0], [0.0, l]]], 512)
}

/// Tests, pixels that are not those of API order, and cycles.
fn walked(class: SortClass, tile: u32, walk: &str, scene: &Scene, fault: bool) -> Result<[f64; 3]> {
    let changes = [
        "pipelines=1",
        "geometry_units=1",
        "scanout.enabled=false",
        "memory.kind=ideal",
        "traverse.pixel_tests_per_cycle=4096",
        &format!("bin.tile={tile}"),
        &format!("traverse.walk={walk}"),
    ];
    let config = config(class.name(), &changes)?;
    let covered = config.render_key().shade == Shade::Covered;
    let mut events = events(&Scene { covered, ..scene.clone() });
    for event in events.iter_mut().filter(|_| fault) {
        if let Event::Segment(segment) = event {
            for triangle in &mut Arc::make_mut(segment).triangles {
                let [.., right, bottom] = &mut triangle.pixels;
                (*right, *bottom) = (*right + 1, *bottom + 1);
                triangle.bounds[3] += 1;
                triangle.unclipped += 1;
            }
        }
    }
    let report = run(&config, events)?;
    let TraverseCounts { tested, .. } = counts(&report.total, TRAVERSAL)?;
    Ok([tested, wrong_pixels(&report)?, report.cycles].map(|count| count as f64))
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let fault = setting.inject_fault;
    let mut rows = Vec::new();
    // In one tile, on all classes.
    for &class in SortClass::ALL {
        for legs in [40_u32, 64] {
            let blocks = legs.div_ceil(8).pow(2);
            let closed =
                [("blocks", blocks), ("rows", legs + legs * (legs - 1) / 2), ("box", legs * legs), ("reject", legs * legs)];
            for (walk, tests) in closed {
                let [measured, wrong, _] = walked(class, 64, walk, &scene(64, legs), fault)?;
                let case = format!("{}, legs of {legs}, {walk}", class.name());
                rows.push(Row::exact(format!("{case}: tests"), tests.into(), measured));
                rows.push(Row::exact(format!("{case}: pixels off API order"), 0.0, wrong));
            }
        }
    }
    // Who reads lists of tiles walks a triangle once for each of them: of four tiles of 32 three are met.
    for (walk, tests) in [("box", 3 * 32 * 32), ("reject", 3 * 64 * 64)] {
        let [measured, ..] = walked(SortClass::MiddleBinned, 32, walk, &scene(64, 64), fault)?;
        rows.push(Row::exact(format!("sort-middle-binned, three tiles of 32, {walk}: tests"), tests.into(), measured));
    }
    // Over many tiles, of which the upper left half is met; and cut by the target, all of whose pixels are covered.
    let class = SortClass::Middle;
    for (edge, legs) in [(256_u32, 256_u32), (64, 16_384)] {
        let met = legs.min(edge);
        let tiles = if legs <= edge { legs / 64 * (legs / 64 + 1) / 2 } else { (edge / 64).pow(2) };
        let covered = if legs <= edge { legs * (legs - 1) / 2 } else { edge * edge };
        let closed = [("blocks", 64 * tiles), ("rows", met + covered), ("box", met * met), ("reject", legs * legs)];
        for (walk, tests) in closed {
            let [measured, ..] = walked(class, 64, walk, &scene(edge, legs), fault)?;
            rows.push(Row::exact(format!("{edge} x {edge} pixels, legs of {legs}, {walk}: tests"), tests.into(), measured));
        }
    }
    let cycles = |legs: u32| Ok::<_, anyhow::Error>(walked(class, 64, "reject", &scene(64, legs), fault)?[2]);
    let more = cycles(16_384)? - cycles(8_192)?;
    rows.push(Row::exact("2^28 tests take longer than 2^26, in cycles", f64::from((1 << 28) - (1 << 26)) / 4096.0, more));
    Ok(rows)
}
