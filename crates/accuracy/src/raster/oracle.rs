//! Coverage against exact arithmetic: no sample may differ.

use anyhow::{Result, ensure};

use super::draw::{Image, flip_rule, state, vertex};
use crate::{Row, Section, Setting, Target};
use gfx::reference::{self, Position};
use gfx::setup::{self, Bounds, ScreenVertex, Triangle};
use gfx::traverse::Blocks;
use num::Random;

pub const ORACLE: Target = Target {
    id: "oracle",
    section: Section::Raster,
    what: "Samples that triangles, lines and points cover, against their definitions in whole numbers of any size, on either \
           instruction set",
    bound: "no sample",
    fault: "the rule for samples on one edge of each triangle is turned around; lines and points are moved by 1/256 pixel",
    check,
};

/// Ends of the guard band.
const GUARD: i32 = 32767 << 8;

/// Edge of the windows in which samples are compared, in pixels.
const WINDOW: i32 = 12;

type Point = [i32; 2];

/// A triangle and a pixel near which it is looked at.
type Case = ([Point; 3], Point);

/// A way to make triangles.
struct TriangleGenerator {
    name: &'static str,
    make: fn(&mut Random) -> Case,
}

/// A random position in a square of `pixels` by `pixels` pixels about the middle of a 64x64 image.
fn near_middle(random: &mut Random, pixels: i32) -> Point {
    [0, 1].map(|_| 32 * 256 + random.between(-pixels * 128, pixels * 128))
}

/// The position of some sample of some pixel, of one or of four.
fn some_sample(random: &mut Random) -> Point {
    let pixel = [0, 1].map(|_| 26 + random.between(0, WINDOW));
    let places = reference::samples(if random.below(2) == 0 { 1 } else { 4 });
    let place = places[random.below(places.len() as u32) as usize];
    [0, 1].map(|k| pixel[k] * 256 + place[k] as i32)
}

fn pixel_of(point: Point) -> Point {
    point.map(|v| v >> 8)
}

const KINDS: [TriangleGenerator; 9] = [
    TriangleGenerator {
        name: "random, a fraction of a pixel to 16 pixels",
        make: |random| {
            let size = 1 << random.below(5);
            let center = near_middle(random, 8);
            (std::array::from_fn(|_| center.map(|v| v + random.between(-size * 128, size * 128))), pixel_of(center))
        },
    },
    TriangleGenerator {
        name: "vertices on samples",
        make: |random| {
            let v = std::array::from_fn(|_| some_sample(random));
            (v, pixel_of(v[0]))
        },
    },
    TriangleGenerator {
        name: "vertices on multiples of 1/8 pixel",
        make: |random| {
            let v = std::array::from_fn(|_| near_middle(random, 12).map(|v| v & !31));
            (v, pixel_of(v[0]))
        },
    },
    TriangleGenerator {
        name: "an edge through a sample",
        make: |random| {
            let at = some_sample(random);
            let step = [0, 1].map(|_| random.between(-60, 61));
            let (m, n) = (random.between(1, 30), random.between(1, 30));
            let along = |k: i32| [at[0] + k * step[0], at[1] + k * step[1]];
            ([along(-m), near_middle(random, 30), along(n)], pixel_of(at))
        },
    },
    TriangleGenerator {
        name: "slivers of 1/65536 square pixel and a few",
        make: |random| {
            let p = near_middle(random, 8);
            let d = [0, 1].map(|_| random.between(-2048, 2048));
            let r = [0, 1].map(|k| p[k] + d[k] / 2 + random.between(-1, 2));
            ([p, [p[0] + d[0], p[1] + d[1]], r], pixel_of(r))
        },
    },
    TriangleGenerator {
        name: "collinear and repeated vertices",
        make: |random| {
            let p = near_middle(random, 8);
            let d = [0, 1].map(|_| random.between(-1000, 1000));
            let at = |k: i32| [p[0] + k * d[0], p[1] + k * d[1]];
            let v = [[p, p, at(1)], [p, at(1), at(2)], [at(1), p, at(1)], [p, p, p]][random.below(4) as usize];
            (v, pixel_of(p))
        },
    },
    TriangleGenerator {
        name: "extents of 16 to 32767 pixels",
        make: |random| {
            let size = 16 << random.below(12);
            let center = [0, 1].map(|_| random.between(0, 8000 * 256));
            let mut some = || center.map(|v| (v + random.between(-size * 128, size * 128)).clamp(-GUARD, GUARD));
            let v = [some(), some(), some()];
            // Near a place on an edge, where there is something to see.
            let part = i64::from(random.below(1025));
            let on_edge = [0, 1].map(|k| (i64::from(v[0][k]) + (i64::from(v[1][k]) - i64::from(v[0][k])) * part / 1024) as i32);
            (v, pixel_of(on_edge))
        },
    },
    TriangleGenerator {
        name: "an edge through a sample, 100 to 32767 pixels long",
        make: |random| {
            let at = [0, 1].map(|_| random.between(10, 8000) * 256 + 128);
            let step = [0, 1].map(|_| random.between(-10_000, 10_001));
            let along = |k: i32| [0, 1].map(|i| (at[i] + k * step[i]).clamp(-GUARD, GUARD));
            let (m, n) = (random.between(10, 200), random.between(10, 200));
            let third = [0, 1].map(|_| random.between(-GUARD, GUARD));
            ([along(-m), third, along(n)], pixel_of(at))
        },
    },
    TriangleGenerator {
        name: "corners of the guard band",
        make: |random| {
            const CORNERS: [Point; 11] = [
                [-GUARD, -GUARD],
                [GUARD, -GUARD],
                [GUARD, GUARD],
                [-GUARD, GUARD],
                [-GUARD, 0],
                [0, -GUARD],
                [GUARD, 128],
                [128, GUARD],
                [0, 0],
                [-GUARD, -GUARD + 1],
                [GUARD, GUARD - 1],
            ];
            // The diagonals of the band pass near these pixels.
            let at = [[0, 0], [16_376, 16_376], [32_740, 32_740], [16_376, 0], [0, 32_740]][random.below(5) as usize];
            (std::array::from_fn(|_| CORNERS[random.below(11) as usize]), at)
        },
    },
];

/// The window about a pixel, on the screen.
fn window_at(pixel: Point) -> [i32; 4] {
    let [x, y] = pixel.map(|v| (v - WINDOW / 2).clamp(0, 32_767 - WINDOW));
    [x, y, x + WINDOW, y + WINDOW]
}

/// Samples that the plain instruction set covers otherwise than the host's.
fn instruction_sets<const S: usize>(primitive: &Triangle) -> u64 {
    let (x, y) = (primitive.bounds.x0 & !63, primitive.bounds.y0 & !63);
    let area = Bounds { x0: x, y0: y, x1: x + 64, y1: y + 64 };
    let (mut one, mut other) = (Blocks::<S>::new(), Blocks::<S>::new());
    one.find(primitive, area);
    other.find_with(gfx::simd::base(), primitive, area);
    u64::from(one[..] != other[..])
}

/// Samples of a window in which an image differs from the definition, and samples that are covered.
fn compare(image: &Image, samples: u32, covers: impl Fn(Position) -> bool) -> (u64, u64) {
    let [x0, y0, x1, y1] = image.window();
    let places = reference::samples(samples);
    let (mut differ, mut covered) = (image.wrong, 0);
    for y in y0..y1 {
        for x in x0..x1 {
            for (s, place) in places.iter().enumerate() {
                let expected = covers([i64::from(x) * 256 + place[0], i64::from(y) * 256 + place[1]]);
                differ += u64::from(image.hits(x, y, s) != i32::from(expected));
                covered += u64::from(expected);
            }
        }
    }
    (differ, covered)
}

/// Compares a triangle with its definition in a window.
fn triangle(v: [Point; 3], window: [i32; 4], samples: u32, inject_fault: bool) -> (u64, u64) {
    let mut image = Image::new(window, samples as usize, false);
    let mut differ = 0;
    if let Ok(mut t) = setup::triangle(&state(samples, window), &v.map(vertex)) {
        if inject_fault {
            flip_rule(&mut t, 1);
        }
        image.draw(&t, 1);
        differ += if samples == 1 { instruction_sets::<1>(&t) } else { instruction_sets::<4>(&t) };
    }
    let wide = v.map(|p| p.map(i64::from));
    let (found, covered) = compare(&image, samples, |sample| reference::triangle_covers(wide, sample));
    (differ + found, covered)
}

fn sum(all: Vec<(u64, u64)>) -> (u64, u64) {
    all.into_iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

/// Triangles in a piece of work.
const PIECE: u64 = 50;

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let n = setting.pick(2, 220, 4_500);
    for (number, kind) in KINDS.iter().enumerate() {
        for samples in [1, 4] {
            let inject_fault = setting.inject_fault;
            let of_kind = Setting { seed: setting.seed.wrapping_mul(16).wrapping_add(number as u64), ..*setting };
            let (differ, covered) = sum(of_kind.pieces(n, |_, random| {
                sum((0..PIECE)
                    .map(|_| {
                        let (mut v, pixel) = (kind.make)(random);
                        // Either winding, any vertex first.
                        v.rotate_left(random.below(3) as usize);
                        if random.below(2) == 0 {
                            v.swap(0, 2);
                        }
                        triangle(v, window_at(pixel), samples, inject_fault)
                    })
                    .collect())
            }));
            let empty = kind.name.starts_with("collinear") || kind.name.starts_with("slivers");
            ensure!(empty || covered > n * PIECE, "{}: only {covered} samples were covered", kind.name);
            rows.push(Row::none(format!("{}, {samples}x", kind.name), differ));
        }
    }
    rows.push(Row::none("lines, diamond exit", lines(setting, 1)?));
    rows.push(Row::none("lines as rectangles, 4x", lines(setting, 4)?));
    rows.push(Row::none("points, 4x", points(setting)?));
    Ok(rows)
}

/// Samples in which lines differ from their definition.
fn lines(setting: &Setting, samples: u32) -> Result<u64> {
    let (differ, covered) = sum(setting.pieces(setting.pick(60, 6_000, 100_000), |piece, random| {
        // Ends anywhere, and on multiples of a half, a quarter and an eighth pixel.
        let step = [1, 128, 64, 32][piece as usize % 4];
        let size = [30 * 256, 2 * 256, 10 * 256][piece as usize % 3];
        let at = [0, 1].map(|_| random.between(4 * 256, 34 * 256) / step * step);
        let [from, to]: [Point; 2] = std::array::from_fn(|_| at.map(|v| v + random.between(0, size) / step * step));
        let [x, y] = pixel_of(from).map(|v| (v - random.between(0, WINDOW)).max(0));
        let window = [x, y, x + WINDOW, y + WINDOW];
        let moved = |[x, y]: Point| vertex([x + i32::from(setting.inject_fault), y]);
        let mut image = Image::new(window, samples as usize, false);
        if let Ok(line) = setup::line(&state(samples, window), &[moved(from), moved(to)], true) {
            image.draw(&line, 1);
        }
        let (p, q) = (from.map(i64::from), to.map(i64::from));
        match samples {
            1 => compare(&image, 1, |sample| reference::line_draws(p, q, sample.map(|v| v.div_euclid(256)))),
            _ => compare(&image, 4, |sample| reference::wide_line_covers(p, q, sample)),
        }
    }));
    ensure!(covered > 50, "only {covered} samples of lines");
    Ok(differ)
}

/// Samples in which points differ from their definition.
fn points(setting: &Setting) -> Result<u64> {
    let (differ, covered) = sum(setting.pieces(setting.pick(100, 10_000, 100_000), |piece, random| {
        let step = [1, 128, 32][piece as usize % 3];
        let at = [0, 1].map(|_| random.between(4 * 256, 8 * 256) / step * step);
        let window = [0, 0, WINDOW, WINDOW];
        let mut image = Image::new(window, 4, false);
        let moved: ScreenVertex = vertex([at[0] + i32::from(setting.inject_fault), at[1]]);
        if let Ok(point) = setup::point(&state(4, window), &moved, true) {
            image.draw(&point, 1);
        }
        compare(&image, 4, |sample| reference::wide_point_covers(at.map(i64::from), sample))
    }));
    ensure!(covered > 50, "only {covered} samples of points");
    Ok(differ)
}
