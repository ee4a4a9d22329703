//! Shared edges: no holes and no double hits; and images that move by whole pixels.

use anyhow::{Result, ensure};

use super::draw::{Image, position, state, vertex, viewport};
use crate::{Row, Section, Setting, Target};
use gfx::clip::ClipVolume;
use gfx::interpolate::{self, PixelPoint, Site, Weights};
use gfx::reference::{self, Position};
use gfx::setup::{self, Screen, ScreenVertex};
use num::{Lanes, QUADS, Random, snap};

pub const FILL_RULES: Target = Target {
    id: "fill-rules",
    section: Section::Raster,
    what: "Two triangles that share a diagonal fill a rotated square without holes and without double hits (the conformance suite's \
           generator, and random squares)",
    bound: "no sample",
    fault: "the rule for samples on one edge of every other triangle is turned around",
    check: fill_rules,
};

pub const WATERTIGHT: Target = Target {
    id: "watertight",
    section: Section::Raster,
    what: "Meshes with shared vertices: every sample inside the outline is covered once; of a closed mesh by as many faces from the \
           front as from the back",
    bound: "no sample",
    fault: "the rule for samples on one edge of every other triangle is turned around",
    check: watertight,
};

pub const INTEGER_SHIFT: Target = Target {
    id: "integer-shift",
    section: Section::Raster,
    what: "What is moved by whole pixels in the window covers the same samples, moved by as many pixels, with the same weights of its \
           vertices bit for bit; moved by whole blocks of 8x8 pixels, with the same depths",
    bound: "no sample",
    fault: "the moved triangles lie 1/256 pixel farther to the right",
    check: integer_shift,
};

/// What is wrong with an image.
#[derive(Clone, Copy, Debug, Default)]
struct Wrong {
    holes: u64,
    doubles: u64,
    /// Hits where nothing is.
    stray: u64,
    /// Samples looked at that are inside.
    inside: u64,
}

impl Wrong {
    fn sum(all: impl IntoIterator<Item = Wrong>) -> Wrong {
        all.into_iter().fold(Wrong::default(), |sum, one| Wrong {
            holes: sum.holes + one.holes,
            doubles: sum.doubles + one.doubles,
            stray: sum.stray + one.stray,
            inside: sum.inside + one.inside,
        })
    }

    /// Compares an image with outlines that do not meet.
    fn of(image: &Image, samples: u32, outlines: &[Vec<Position>]) -> Wrong {
        let [x0, y0, x1, y1] = image.window();
        let places = reference::samples(samples);
        let mut wrong = Wrong { stray: image.wrong, ..Wrong::default() };
        // What is inside is taken out of the image; what is left has no business there.
        let mut left = image.all().iter().map(|&hits| i64::from(hits)).sum::<i64>();
        for outline in outlines {
            let low = |k: usize| outline.iter().map(|p| p[k]).min().unwrap_or(0).div_euclid(256);
            let high = |k: usize| outline.iter().map(|p| p[k]).max().unwrap_or(0).div_euclid(256) + 1;
            for y in low(1).max(y0.into())..high(1).min(y1.into()) {
                for x in low(0).max(x0.into())..high(0).min(x1.into()) {
                    for (s, [dx, dy]) in places.iter().enumerate() {
                        if reference::polygon_covers(outline, [x * 256 + dx, y * 256 + dy]) {
                            let hits = image.hits(x as i32, y as i32, s);
                            wrong.inside += 1;
                            wrong.holes += u64::from(hits == 0);
                            wrong.doubles += u64::from(hits > 1);
                            left -= i64::from(hits);
                        }
                    }
                }
            }
        }
        wrong.stray += left.unsigned_abs();
        wrong
    }

    fn rows(self, case: &str) -> Result<[Row; 2]> {
        ensure!(self.inside > 100, "{case}: only {} samples were inside", self.inside);
        Ok([
            Row::none(format!("{case}: holes"), self.holes),
            Row::none(format!("{case}: hit twice or outside"), self.doubles + self.stray),
        ])
    }
}

/// A square of half-side `half` about a centre, rotated, with a w for each corner; corners in order around it.
fn square(center: [f32; 2], half: f32, angle: f32, w: [f32; 4]) -> [[f32; 4]; 4] {
    let (s, c) = (libm::sinf(angle), libm::cosf(angle));
    std::array::from_fn(|i| {
        let (x, y) = [(-half, -half), (half, -half), (half, half), (-half, half)][i];
        [(center[0] + c * x - s * y) * w[i], (center[1] + s * x + c * y) * w[i], 0.5 * w[i], w[i]]
    })
}

/// Draws squares as two triangles each, with the indices of the second in either order, and compares with their outlines.
fn squares(size: i32, samples: usize, inject_fault: bool, squares: &[([[f32; 4]; 4], bool)]) -> Wrong {
    let (volume, screen) = (ClipVolume::new(&viewport(size), false), Screen::new(&viewport(size)));
    let mut image = Image::new([0, 0, size, size], samples, inject_fault);
    for &([a, b, c, d], order) in squares {
        for t in if order { [[a, b, c], [c, d, a]] } else { [[a, b, c], [a, c, d]] } {
            image.clip_space(&volume, &screen, t, |_| ());
        }
    }
    let outline = |corners: &[[f32; 4]; 4]| corners.iter().map(|&p| position(&screen.vertex(p))).collect();
    let outlines: Vec<Vec<Position>> = squares.iter().map(|(corners, _)| outline(corners)).collect();
    Wrong::of(&image, samples as u32, &outlines)
}

fn fill_rules(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let some_w = |random: &mut Random| std::array::from_fn(|_| random.range(0.1, 4.0));
    let quarter = std::f32::consts::FRAC_PI_2;
    for (case, any_w) in [("256x256, 4x4 squares, 32 rotations", false), ("256x256, 4x4 squares, w from 0.1 to 4", true)] {
        let rotations = setting.pick(32, 32, 256);
        let step = setting.pick(8, 1, 1);
        let wrong = setting.pieces(rotations / step, |piece, random| {
            let angle = (piece * step) as f32 / (rotations - 1) as f32 * quarter;
            let all: Vec<_> = (0..16)
                .map(|i| {
                    let center = [-0.75 + 0.5 * (i % 4) as f32, -0.75 + 0.5 * (i / 4) as f32];
                    let w = if any_w { some_w(random) } else { [1.0; 4] };
                    (square(center, 0.15, angle, w), (i % 4 + i / 4) % 2 == 1)
                })
                .collect();
            squares(256, 1, setting.inject_fault, &all)
        });
        rows.extend(Wrong::sum(wrong).rows(case)?);
    }
    // Half-side 2.0 stays in the guard band; the others leave it by far and are cut.
    for (case, halves) in [
        ("64x64, squares larger than the view, 15 rotations", &[2.0][..]),
        ("64x64, squares larger than the guard band", &[600.0, 3.0e4, 1.0e9]),
    ] {
        let wrong = setting.pieces(15 * halves.len() as u64, |piece, random| {
            let (half, rotation) = (halves[piece as usize / 15], piece % 15);
            let angle = rotation as f32 / 15.0 * quarter;
            let w = if rotation % 2 == 0 { [1.0; 4] } else { some_w(random) };
            let (volume, screen) = (ClipVolume::new(&viewport(64), false), Screen::new(&viewport(64)));
            let mut image = Image::new([0, 0, 64, 64], 4, setting.inject_fault);
            let [a, b, c, d] = square([0.01, -0.02], half, angle, w);
            for t in if rotation % 3 == 0 { [[a, b, c], [c, d, a]] } else { [[a, b, c], [a, c, d]] } {
                image.clip_space(&volume, &screen, t, |_| ());
            }
            let view = vec![[0, 0], [64 * 256, 0], [64 * 256, 64 * 256], [0, 64 * 256]];
            Wrong::of(&image, 4, &[view])
        });
        rows.extend(Wrong::sum(wrong).rows(case)?);
    }
    let (n, each) = (setting.pick(20, 1_000, 20_000), 100);
    let wrong = setting.pieces(n, |_, random| {
        Wrong::sum((0..each).map(|i| {
            let center = [random.range(-0.6, 0.6), random.range(-0.6, 0.6)];
            // Sides of a fraction of a pixel to half of the image.
            let half = 0.02 * libm::exp2f(random.range(0.0, 3.5));
            let w = if i % 3 == 0 { some_w(random) } else { [1.0; 4] };
            let all = [(square(center, half, random.range(0.0, 4.0 * quarter), w), random.below(2) == 1)];
            squares(32, if i % 4 == 0 { 4 } else { 1 }, setting.inject_fault, &all)
        }))
    });
    rows.extend(Wrong::sum(wrong).rows("squares at random, rotated at random, 1 and 4 samples")?);
    Ok(rows)
}

/// A grid over part of the image, vertices moved so little that no cell turns over: vertices row by row, n per row.
fn sheet(cells: usize, size: i32, random: &mut Random) -> Vec<ScreenVertex> {
    let n = cells + 1;
    let pitch = (size - 6) as f32 / cells as f32;
    let mut at = |i: usize| snap(3.0 + (i as f32 + random.range(-0.2, 0.2)) * pitch);
    (0..n * n).map(|k| vertex([at(k % n), at(k / n)])).collect()
}

/// Draws a sheet with each cell cut along either diagonal, and compares with its outline.
fn draw_sheet(cells: usize, samples: usize, inject_fault: bool, random: &mut Random) -> Wrong {
    let size = 70;
    let vertices = sheet(cells, size, random);
    let n = cells + 1;
    let mut image = Image::new([0, 0, size, size], samples, inject_fault);
    for j in 0..cells {
        for i in 0..cells {
            let v = |dx: usize, dy: usize| vertices[(j + dy) * n + i + dx];
            let pair = if random.below(2) == 0 {
                [[v(0, 0), v(1, 0), v(0, 1)], [v(1, 0), v(1, 1), v(0, 1)]]
            } else {
                [[v(0, 0), v(1, 1), v(1, 0)], [v(1, 1), v(0, 0), v(0, 1)]]
            };
            pair.iter().for_each(|t| image.triangle(t, |_| 1));
        }
    }
    let last = n - 1;
    let ring = (0..last)
        .chain((0..last).map(|j| j * n + last))
        .chain((0..last).map(|i| last * n + last - i))
        .chain((0..last).map(|j| (last - j) * n));
    let outline: Vec<Position> = ring.map(|k| position(&vertices[k])).collect();
    Wrong::of(&image, samples as u32, &[outline])
}

/// A star-shaped body of random radii, turned and seen in perspective: samples that as many faces cover from the front as from the
/// back are as they should be. Returns those that are not, and those covered at all.
fn draw_body(samples: usize, inject_fault: bool, random: &mut Random) -> (u64, u64) {
    let size = 64;
    let (rings, sectors) = (3 + random.below(9) as usize, 3 + random.below(12) as usize);
    let roughness = random.range(0.0, 0.8);
    let (turn, tilt) = (random.range(0.0, 6.3), random.range(0.0, 3.2));
    let distance = random.range(1.2, 4.0);
    let screen = Screen::new(&viewport(size));
    let mut point = |latitude: f32, longitude: f32| {
        let radius = 1.0 - roughness * random.unit();
        let (sl, cl) = (libm::sinf(latitude), libm::cosf(latitude));
        let (x, y, z) = (cl * libm::cosf(longitude), cl * libm::sinf(longitude), sl);
        let (st, ct) = (libm::sinf(tilt), libm::cosf(tilt));
        let (y, z) = (ct * y - st * z, st * y + ct * z);
        let w = distance + radius * z * 0.9;
        screen.vertex([radius * x, radius * y, 0.5 * w, w])
    };
    let pole = std::f32::consts::FRAC_PI_2;
    let (top, bottom) = (point(pole, 0.0), point(-pole, 0.0));
    let grid: Vec<ScreenVertex> = (1..rings)
        .flat_map(|r| (0..sectors).map(move |s| (r, s)))
        .map(|(r, s)| point(pole - r as f32 / rings as f32 * 2.0 * pole, turn + s as f32 / sectors as f32 * 4.0 * pole))
        .collect();
    let at = |r: usize, s: usize| match r {
        0 => top,
        r if r == rings => bottom,
        r => grid[(r - 1) * sectors + s % sectors],
    };
    let mut image = Image::new([0, 0, size, size], samples, inject_fault);
    let mut covered = 0;
    for r in 0..rings {
        for s in 0..sectors {
            for t in [[at(r, s), at(r + 1, s), at(r + 1, s + 1)], [at(r, s), at(r + 1, s + 1), at(r, s + 1)]] {
                image.triangle(&t, |t| if t.front { 1 } else { -1 });
                covered += 1;
            }
        }
    }
    (image.all().iter().filter(|&&sum| sum != 0).count() as u64 + image.wrong, covered)
}

fn watertight(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for samples in [1, 4] {
        let n = setting.pick(6, 400, 8_000);
        let sheets = setting.pieces(n, |piece, random| {
            draw_sheet([1, 2, 5, 17, 40][piece as usize % 5], samples, setting.inject_fault, random)
        });
        let per_pixel = if samples == 1 { "1 sample" } else { "4 samples" };
        rows.extend(Wrong::sum(sheets).rows(&format!("sheets, {per_pixel}"))?);
        let bodies =
            setting.pieces(setting.pick(40, 4_000, 100_000), |_, random| draw_body(samples, setting.inject_fault, random));
        let (wrong, triangles) = bodies.into_iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
        ensure!(triangles > 1_000, "only {triangles} triangles of bodies");
        rows.push(Row::none(format!("closed bodies, {per_pixel}: front and back differ"), wrong));
    }
    let edges = setting.pieces(setting.pick(300, 30_000, 1_000_000), |_, random| behind_the_eye(setting.inject_fault, random));
    let (wrong, covered) = edges.into_iter().fold((0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    ensure!(covered > 10_000, "only {covered} samples beside edges that pass behind the eye");
    rows.push(Row::none("edges that pass behind the eye, 4 samples: hit twice", wrong));
    Ok(rows)
}

/// Two triangles share an edge one end of which is behind the eye: what is seen of the edge parts the screen. Samples that both cover.
fn behind_the_eye(inject_fault: bool, random: &mut Random) -> (u64, u64) {
    let size = 48;
    let (volume, screen) = (ClipVolume::new(&viewport(size), true), Screen::new(&viewport(size)));
    let a = [random.range(-0.5, 0.5), random.range(-0.5, 0.5), 0.25, 1.0];
    let b = [random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(-1.0, 0.5), -random.range(0.01, 2.0)];
    // The third vertices are far away, on both sides of the edge's plane through the eye.
    let side = [(b[1] - a[1]) * 50.0, (a[0] - b[0]) * 50.0];
    let third = |sign: f32| [a[0] + sign * side[0], a[1] + sign * side[1], 0.25, 1.0];
    let mut image = Image::new([0, 0, size, size], 4, inject_fault);
    for t in [[a, b, third(1.0)], [b, a, third(-1.0)]] {
        image.clip_space(&volume, &screen, t, |_| ());
    }
    (image.all().iter().filter(|&&hits| hits > 1).count() as u64 + image.wrong, image.all().iter().map(|&h| h as u64).sum())
}

/// What becomes of a triangle in 40x40 pixels: hits, and in the order of its quads the weights of its vertices and its depths.
struct Placed {
    image: Image,
    weights: Vec<[u32; 2]>,
    depths: Vec<u32>,
}

fn place(v: [ScreenVertex; 3], [dx, dy]: [i32; 2], samples: usize, fault: i32) -> Placed {
    let moved = v.map(|v| ScreenVertex { x: v.x + dx * 256 + fault, y: v.y + dy * 256, ..v });
    let window = [dx, dy, dx + 40, dy + 40];
    let mut placed = Placed { image: Image::new(window, samples, false), weights: Vec::new(), depths: Vec::new() };
    let Ok(t) = setup::triangle(&state(samples as u32, window), &moved) else { return placed };
    placed.image.draw(&t, 1);
    // All quads of the window, in the order of the window: those of a triangle come in the order of blocks, which move.
    let quads = (0..400).map(|q| (q % 20 * 2, q / 20 * 2));
    let sites: Vec<Site> = quads.map(|(x, y)| Site { triangle: 0, x: (x + dx) as u16, y: (y + dy) as u16 }).collect();
    for batch in sites.chunks(QUADS) {
        let (mut weights, mut inv_w) = (Weights::default(), Lanes::ZERO);
        interpolate::perspective(&[t], batch, PixelPoint::Center, &mut weights, &mut inv_w);
        for lane in 0..4 * batch.len() {
            placed.weights.push([weights.one.0[lane], weights.two.0[lane]]);
        }
        for site in batch {
            placed.depths.extend(t.depth.quad(site.x.into(), site.y.into()).map(f32::to_bits));
        }
    }
    placed
}

fn integer_shift(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for samples in [1, 4] {
        let moved = setting.pieces(setting.pick(100, 20_000, 500_000), |piece, random| {
            let v: [ScreenVertex; 3] = std::array::from_fn(|_| ScreenVertex {
                x: 256 * 8 + random.between(0, 256 * 24),
                y: 256 * 8 + random.between(0, 256 * 24),
                z: random.unit(),
                inv_w: 1.0 / random.range(0.1, 4.0),
            });
            let blocks = piece.is_multiple_of(2);
            let shift = [0, 1].map(|_| if blocks { 8 * random.between(0, 13) } else { random.between(0, 100) });
            let (still, moved) = (place(v, [0, 0], samples, 0), place(v, shift, samples, i32::from(setting.inject_fault)));
            let differ = still.image.all().iter().zip(moved.image.all()).filter(|(a, b)| a != b).count() as u64;
            let weights = still.weights.iter().zip(&moved.weights).filter(|(a, b)| a != b).count() as u64;
            let depths = still.depths.iter().zip(&moved.depths).filter(|(a, b)| blocks && a != b).count() as u64;
            let covered = still.image.all().iter().map(|&hits| hits as u64).sum::<u64>();
            [differ + moved.image.wrong, weights, depths, covered]
        });
        let sum = |k: usize| moved.iter().map(|counts| counts[k]).sum::<u64>();
        ensure!(sum(3) > 1_000, "only {} samples were covered", sum(3));
        let per_pixel = if samples == 1 { "1 sample" } else { "4 samples" };
        rows.push(Row::none(format!("triangles at random, {per_pixel}: samples that differ"), sum(0)));
        rows.push(Row::none(format!("triangles at random, {per_pixel}: weights that differ"), sum(1)));
        rows.push(Row::none(format!("moved by whole blocks, {per_pixel}: depths that differ"), sum(2)));
    }
    Ok(rows)
}
