//! Fragments that are shaded for the sake of whole quads.

use anyhow::{Result, ensure};

use super::draw::{state, vertex, walk};
use crate::{Row, Section, Setting, Target};
use gfx::setup;
use num::Random;

pub const QUAD_OVERSHADE: Target = Target {
    id: "quad-overshade",
    section: Section::Raster,
    what: "Shaded by covered fragments: 1 + 4/L for right isosceles triangles with legs of L >= 2 pixels anywhere, 4 for L <= 1; \
           rectangles of w x h pixels take (w+1)(h+1)/4 quads over all places",
    bound: "4 standard errors; exact for L <= 1 and for rectangles",
    fault: "quads with one pixel covered are not counted",
    check,
};

/// Quads of a triangle (of those with fewer than `least` pixels none) and its pixels.
fn count(t: &setup::Triangle, least: u32) -> [f64; 2] {
    let mut counts = [0.0; 2];
    walk::<1>(t, |block| {
        for quad in block.quads() {
            counts[0] += f64::from(u8::from(quad.mask.count_ones() >= least));
            counts[1] += f64::from(quad.mask.count_ones());
        }
    });
    counts
}

/// A right isosceles triangle with legs of `legs` 1/256 pixels, at any place in a quad, its right angle in any corner: rules for
/// samples on edges then add or take nothing on average.
fn triangle(random: &mut Random, legs: i32, least: u32) -> [f64; 2] {
    let [x, y] = [0, 1].map(|_| 8 * 256 + random.between(0, 512));
    let (dx, dy) = ([legs, -legs][random.below(2) as usize], [legs, -legs][random.below(2) as usize]);
    let (x, y) = (x - dx.min(0), y - dy.min(0));
    let size = 16 + legs / 256;
    let v = [[x, y], [x + dx, y], [x, y + dy]].map(vertex);
    setup::triangle(&state(1, [0, 0, size, size]), &v).map_or([0.0; 2], |t| count(&t, least))
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let least = if setting.inject_fault { 2 } else { 1 };
    let mut rows = Vec::new();
    for legs in [0.5, 1.0, 2.0, 3.0, 4.0, 7.5, 16.0, 40.0] {
        let of_legs = Setting { seed: setting.seed.wrapping_mul(101).wrapping_add((legs * 2.0) as u64), ..*setting };
        let each = setting.pick(100, 1_000, 10_000);
        let batches = of_legs.pieces(setting.pick(40, 100, 400), |_, random| {
            (0..each).fold([0.0; 2], |sum, _| {
                let [quads, pixels] = triangle(random, (legs * 256.0) as i32, least);
                [sum[0] + 4.0 * quads, sum[1] + pixels]
            })
        });
        let (shaded, covered) = batches.iter().fold((0.0, 0.0), |sum, b| (sum.0 + b[0], sum.1 + b[1]));
        ensure!(covered > 0.0, "legs of {legs} pixels cover nothing");
        let measured = shaded / covered;
        let case = format!("legs of {legs} pixels");
        if legs <= 1.0 {
            rows.push(Row::exact(case, 4.0, measured));
            continue;
        }
        // The standard error of a quotient of sums, from how batches scatter.
        let n = batches.len() as f64;
        let scatter: f64 = batches.iter().map(|b| (b[0] - measured * b[1]).powi(2)).sum::<f64>() * n / (n - 1.0);
        rows.push(Row::within(case, 1.0 + 4.0 / legs, measured, 4.0 * scatter.sqrt() / covered));
    }
    // A triangle far larger than what is let through of it, at each of the four places in a quad.
    let rectangles = setting.pieces(setting.pick(50, 2_000, 20_000), |_, random| {
        let (w, h) = (random.between(1, 60), random.between(1, 60));
        let mut quads = 0.0;
        for place in 0..4 {
            let (x, y) = (10 + (place & 1), 10 + (place >> 1));
            let v = [[-256, -256], [1_000_000, -256], [-256, 1_000_000]].map(vertex);
            if let Ok(t) = setup::triangle(&state(1, [x, y, x + w, y + h]), &v) {
                quads += count(&t, least)[0];
            }
        }
        (f64::from((w + 1) * (h + 1)), quads)
    });
    let (expected, measured) = rectangles.into_iter().fold((0.0, 0.0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    rows.push(Row::exact("rectangles of 1 to 59 pixels: quads over expected quads", 1.0, measured / expected));
    Ok(rows)
}
