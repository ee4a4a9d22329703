//! Overlap of triangles and tiles: entries in the lists of a machine that bins, by triangle.

use anyhow::{Result, ensure};

use super::{right_triangle, scene_of};
use crate::harness::{config, counts, replay};
use crate::{Row, Section, Setting, Target};
use machine::SORTING;
use machine::config::SortClass;
use synthetic::Scene;
use unit::sorting::SortCounts;

pub(super) const OVERLAP_BBOX: Target = Target {
    id: "overlap-bbox",
    section: Section::Sorting,
    what: "Tiles that a binner by bounding boxes lists a triangle in: (1 + w/W)(1 + h/H) (Molnar et al. 1994). A tile has a triangle \
           where it has the centre of a pixel of it: w and h count from centre to centre",
    bound: "exact over all whole offsets; 4 standard deviations at random ones",
    fault: "tiles that the box meets and the triangle does not are left out of the lists",
    check: boxes,
};

pub(super) const OVERLAP_EXACT: Target = Target {
    id: "overlap-exact",
    section: Section::Sorting,
    what: "Tiles that an exact binner lists a triangle in: 1 + w/W + h/H + A/(WH), so that the boxes' excess is (wh - A)/(WH); in \
           pixels, with legs that span m of them, ((m + W)^2 - m(m + 1)/2)/W^2",
    bound: "exact over all whole offsets; 4 standard errors at random ones, and between the formulas for a triangle with and \
            without a pixel at each end where the legs differ",
    fault: "the lists are those of the bounding boxes",
    check: exactly,
};

/// Entries in lists of a machine that bins with tiles of this edge.
fn binned(tile: u32, exact: bool, scene: &Scene) -> Result<f64> {
    let changes = [
        "pipelines=1",
        "geometry_units=1",
        "memory.kind=ideal",
        "color.cache_blocks=64",
        &format!("bin.tile={tile}"),
        &format!("bin.overlap={}", if exact { "exact" } else { "bounding-box" }),
    ];
    let total = replay(&config(SortClass::MiddleBinned.name(), &changes)?, scene)?.total;
    let SortCounts { sent, redistributed_items: entries, .. } = counts(&total, SORTING)?;
    ensure!(sent == scene.shapes.len() as u64, "{sent} of {} triangles are in a list", scene.shapes.len());
    Ok(entries as f64)
}

/// Edges of tiles, and legs of triangles without the half pixel that is added. With it, the sum of tiles over all whole offsets is known exactly.
const EVERY: [(u32, u32); 2] = [(16, 21), (32, 9)];

/// Tiles, and legs of triangles at random offsets.
const RANDOM: [(u32, [u32; 2]); 3] = [(16, [40, 24]), (32, [20, 50]), (64, [70, 70])];

/// Lists' entries over all whole offsets. The centres of pixels in a triangle span m = legs - 1 of them, or one less under a hypotenuse
/// that passes through centres.
fn at_every_offset(exact: bool, [tile, legs]: [u32; 2]) -> Result<f64> {
    let offsets = (0..tile).flat_map(|y| (0..tile).map(move |x| (x, y)));
    let legs = legs as f32 + 0.5;
    let shapes = offsets.map(|(x, y)| right_triangle(x as f32, y as f32, legs, legs)).collect();
    binned(tile, exact, &scene_of(80, 80, shapes))
}

/// The mean number of tiles of triangles at random offsets, the error of it, and how many triangles there were.
fn at_random(setting: &Setting, exact: bool, tile: u32, [w, h]: [u32; 2]) -> Result<(f64, f64, f64)> {
    let (batches, each) = (setting.pick(24, 64, 1024), setting.pick(32, 128, 128));
    let means = setting.pieces(batches, |_, random| -> Result<f64> {
        let shapes: Vec<_> = (0..each)
            .map(|_| {
                let [x, y] = [random.unit(), random.unit()].map(|at| tile as f32 * at);
                right_triangle(x, y, w as f32, h as f32)
            })
            .collect();
        Ok(binned(tile, exact, &scene_of(144, 144, shapes))? / each as f64)
    });
    let means = means.into_iter().collect::<Result<Vec<f64>>>()?;
    let n = means.len() as f64;
    let mean = means.iter().sum::<f64>() / n;
    let variance = means.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / (n - 1.0);
    Ok((mean, (variance / n).sqrt(), n * each as f64))
}

fn boxes(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (tile, legs) in EVERY {
        let case = format!("tiles of {tile}, legs of {legs}: entries over all whole offsets");
        let expected = f64::from(legs - 1 + tile).powi(2);
        rows.push(Row::exact(case, expected, at_every_offset(setting.inject_fault, [tile, legs])?));
    }
    for (tile, legs) in RANDOM {
        let (measured, _, n) = at_random(setting, setting.inject_fault, tile, legs)?;
        // Along each axis one of two neighbouring numbers, whose shares say the mean and the mean square.
        let [x, y] = legs.map(|leg| {
            let mean = 1.0 + f64::from(leg - 1) / f64::from(tile);
            (mean, mean.powi(2) + mean.fract() * (1.0 - mean.fract()))
        });
        let expected = x.0 * y.0;
        let deviation = ((x.1 * y.1 - expected.powi(2)) / n).sqrt();
        let case = format!("tiles of {tile}, {} x {} pixels: tiles at random offsets", legs[0], legs[1]);
        rows.push(Row::within(case, expected, measured, 4.0 * deviation));
    }
    Ok(rows)
}

fn exactly(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    // Tiles over all whole offsets of a triangle whose legs span m pixels.
    let tiles = |tile: u32, m: u32| f64::from((m + tile).pow(2)) - f64::from(m * (m + 1)) / 2.0;
    for (tile, legs) in EVERY {
        let case = format!("tiles of {tile}, legs of {legs}: entries over all whole offsets");
        rows.push(Row::exact(case, tiles(tile, legs - 1), at_every_offset(!setting.inject_fault, [tile, legs])?));
    }
    for (tile, legs) in RANDOM {
        let (measured, error, _) = at_random(setting, !setting.inject_fault, tile, legs)?;
        let [w, h] = legs;
        let case = format!("tiles of {tile}, {w} x {h} pixels: tiles at random offsets");
        let area = f64::from(tile * tile);
        rows.push(if w == h {
            // The corner lies as often nearer to the hypotenuse than the centre of its pixel as it does not: a pixel less or more.
            Row::within(case, (tiles(tile, w - 2) + tiles(tile, w - 1)) / 2.0 / area, measured, 4.0 * error)
        } else {
            // The formula itself is for tiles that meet any point: a bound from above. A triangle that has the centre of a pixel
            // wherever a tile reaches it by more than a pixel is the bound from below.
            let formula = |w: u32, h: u32| 1.0 + f64::from(w + h) / f64::from(tile) + f64::from(w * h) / 2.0 / area;
            let (low, high) = (formula(w - 3, h - 3), formula(w, h));
            Row::within(case, (low + high) / 2.0, measured, (high - low) / 2.0 + 4.0 * error)
        });
    }
    Ok(rows)
}
