//! Shared edges: no holes and no double hits, through the whole way from clip space to samples.

mod raster_common;

use fillrate::gfx::clip::{ClipVolume, Clipped, Polygon};
use fillrate::gfx::setup::{self, Screen, ScreenVertex};
use fillrate::gfx::state::Viewport;
use raster_common::*;

fn viewport(size: i32) -> Viewport {
    Viewport { x: 0.0, y: 0.0, width: size as f32, height: size as f32, min_depth: 0.0, max_depth: 1.0 }
}

/// Draws a triangle given in clip space; panics if clipping leaves anything that is not finite.
fn draw<const S: usize>(image: &mut Image, size: i32, unclipped: bool, position: [[f32; 4]; 3]) -> Clipped {
    let volume = ClipVolume::new(&viewport(size), unclipped);
    let screen = Screen::new(&viewport(size));
    let state = state(S as u32, [0, 0, size, size]);
    let mut polygon = Polygon::EMPTY;
    let one = |image: &mut Image, v: [ScreenVertex; 3]| {
        if let Ok(t) = setup::triangle(&state, &v) {
            assert!(v.iter().all(|v| v.z.is_finite() && v.inv_w.is_normal() && v.inv_w > 0.0), "{v:?}");
            assert!([t.depth.z0, t.depth.dzdx, t.depth.dzdy, t.depth.min, t.depth.max].iter().all(|v| v.is_finite()), "{t:?}");
            image.draw::<S>(&t);
        }
    };
    let clipped = volume.triangle(&position, position.map(|p| volume.outcode(p)), &mut polygon);
    match clipped {
        Clipped::Rejected => {}
        Clipped::Whole => one(image, position.map(|p| screen.vertex(p))),
        Clipped::Cut => {
            for v in polygon.vertices() {
                assert!(v.position.iter().chain(&v.weights).all(|x| x.is_finite()), "{position:?} {v:?}");
                assert!(v.position[3] > 0.0);
                let snapped = screen.vertex(v.position);
                assert!(snapped.x.abs() <= 32768 * 256 && snapped.y.abs() <= 32768 * 256);
            }
            let vertices: Vec<ScreenVertex> = polygon.vertices().iter().map(|v| screen.vertex(v.position)).collect();
            for t in setup::fan(&vertices) {
                one(image, t.map(|i| vertices[i]));
            }
        }
    }
    clipped
}

/// A square of half-side `half` about a centre, rotated, with a w for each corner; corners in order around it.
fn square(center: [f32; 2], half: f32, angle: f32, w: [f32; 4]) -> [[f32; 4]; 4] {
    let (s, c) = angle.sin_cos();
    std::array::from_fn(|i| {
        let (x, y) = [(-half, -half), (half, -half), (half, half), (-half, half)][i];
        [(center[0] + c * x - s * y) * w[i], (center[1] + s * x + c * y) * w[i], 0.5 * w[i], w[i]]
    })
}

/// Draws a square as two triangles that share a diagonal, in either order of indices.
fn draw_square<const S: usize>(image: &mut Image, size: i32, corners: [[f32; 4]; 4], order: bool) {
    let [a, b, c, d] = corners;
    let pair = if order { [[a, b, c], [c, d, a]] } else { [[a, b, c], [a, c, d]] };
    for t in pair {
        draw::<S>(image, size, false, t);
    }
}

#[test]
fn the_conformance_squares_have_no_holes_and_no_double_hits() {
    let mut random = Random::new(1);
    for (w_range, orders) in [(false, [false, true]), (true, [true, false])] {
        for rotation in 0..32 {
            let angle = rotation as f32 / 31.0 * std::f32::consts::FRAC_PI_2;
            let mut image = Image::new([0, 0, 256, 256]);
            for j in 0..4 {
                for i in 0..4 {
                    let center = [-0.75 + 0.5 * i as f32, -0.75 + 0.5 * j as f32];
                    let w = std::array::from_fn(|_| if w_range { random.range(0.1, 4.0) } else { 1.0 });
                    draw_square::<1>(&mut image, 256, square(center, 0.15, angle, w), orders[(i + j) % 2]);
                }
            }
            let once = image.all().iter().filter(|&&h| h == 1).count();
            assert!(image.all().iter().all(|&h| h <= 1), "double hit at rotation {rotation}");
            // Each square's area is 0.3 * 0.3 of NDC, 38.4^2 pixels; its outline may claim or leave a few.
            let area = 16.0 * 38.4f64 * 38.4;
            assert!((once as f64 - area).abs() < 16.0 * 45.0, "{once} of {area}");
            // Holes: inside an outline of hits every row is one run in each square's cell.
            for cell in 0..16 {
                let (cx, cy) = (cell % 4 * 64, cell / 4 * 64);
                for y in cy..cy + 64 {
                    let row: Vec<u32> = (cx..cx + 64).map(|x| image.hits(x, y, 0)).collect();
                    let runs = row.windows(2).filter(|p| p[0] != p[1]).count();
                    assert!(runs <= 2, "a hole in row {y} at rotation {rotation}: {row:?}");
                }
            }
        }
    }
}

#[test]
fn squares_larger_than_the_view_fill_it_once() {
    let mut random = Random::new(2);
    // Half-side 2.0 stays in the guard band; the others leave it by far and are cut.
    for half in [2.0, 600.0, 3.0e4, 1.0e9] {
        for rotation in 0..15 {
            let angle = rotation as f32 / 15.0 * std::f32::consts::FRAC_PI_2;
            let w = std::array::from_fn(|_| if rotation % 2 == 0 { 1.0 } else { random.range(0.1, 4.0) });
            let mut image = Image::new([0, 0, 64, 64]);
            draw_square::<4>(&mut image, 64, square([0.01, -0.02], half, angle, w), rotation % 3 == 0);
            assert!(image.all().iter().all(|&h| h == 1), "half-side {half}, rotation {rotation}: {w:?}");
        }
    }
}

#[test]
fn random_rotations_and_offsets_hit_once() {
    // ACCURACY asks for 100,000; the coverage of each shows as a sum, so that many fit in little time.
    let mut random = Random::new(3);
    let mut image = Image::new([0, 0, 16, 16]);
    for case in 0..20_000u32 {
        let angle = random.range(0.0, 1.6);
        let center = [random.range(-0.2, 0.2), random.range(-0.2, 0.2)];
        let w = std::array::from_fn(|_| if case % 2 == 0 { 1.0 } else { random.range(0.1, 4.0) });
        draw_square::<1>(&mut image, 16, square(center, 3.0, angle, w), case % 3 == 0);
        if case % 500 == 499 {
            assert!(image.all().iter().step_by(4).all(|&h| h == case + 1), "by case {case}");
        }
    }
}

#[test]
fn a_shared_edge_through_the_eye_plane_is_cut_alike() {
    // Two triangles share an edge whose one end is behind the eye: the plane of the edge splits the screen, and each pixel
    // that either covers is covered once. The outer edges are far outside.
    let mut random = Random::new(4);
    let mut cut = 0;
    for _ in 0..300 {
        let a = [random.range(-0.5, 0.5), random.range(-0.5, 0.5), 0.25, 1.0];
        let w = -random.range(0.01, 2.0);
        let b = [random.range(-1.0, 1.0), random.range(-1.0, 1.0), random.range(-1.0, 0.5), w];
        // Third vertices on both sides of the edge's plane through the eye, far away.
        let side: [f32; 4] = std::array::from_fn(|k| [-(a[1] - b[1]), a[0] - b[0], 0.0, 0.0][k] * 50.0);
        let third = |sign: f32| [a[0] + sign * side[0], a[1] + sign * side[1], 0.25, 1.0];
        let mut image = Image::new([0, 0, 48, 48]);
        for t in [[a, b, third(1.0)], [b, a, third(-1.0)]] {
            cut += u32::from(draw::<4>(&mut image, 48, true, t) == Clipped::Cut);
        }
        assert!(image.all().iter().all(|&h| h <= 1), "{a:?} {b:?}");
    }
    assert!(cut > 100, "{cut}");
}

#[test]
fn meshes_cover_each_sample_inside_once() {
    let mut random = Random::new(5);
    for cells in [1, 3, 17, 60] {
        for jitter in [0.0, 0.3, 0.49] {
            // A grid over the image and beyond, inner vertices moved so little that no triangle turns over.
            let n = cells + 1;
            let size = 70;
            let pitch = (size as f32 + 4.0) / cells as f32;
            let vertices: Vec<ScreenVertex> = (0..n * n)
                .map(|k| {
                    let mut at = |i: i32| {
                        let moved = if i == 0 || i == cells { 0.0 } else { random.range(-jitter, jitter) };
                        ((i as f32 + moved * 0.98) * pitch - 2.0) * 256.0
                    };
                    let (x, y) = (at(k % n), at(k / n));
                    ScreenVertex { x: x.round() as i32, y: y.round() as i32, z: 0.5, inv_w: 1.0 }
                })
                .collect();
            let mut image = Image::new([0, 0, size, size]);
            let state = state(4, [0, 0, size, size]);
            for j in 0..cells {
                for i in 0..cells {
                    let v = |dx: i32, dy: i32| vertices[((j + dy) * n + i + dx) as usize];
                    let pair = if random.below(2) == 0 {
                        [[v(0, 0), v(1, 0), v(0, 1)], [v(1, 0), v(1, 1), v(0, 1)]]
                    } else {
                        [[v(0, 0), v(1, 1), v(1, 0)], [v(1, 1), v(0, 0), v(0, 1)]]
                    };
                    for t in pair {
                        if let Ok(t) = setup::triangle(&state, &t) {
                            image.draw::<4>(&t);
                        }
                    }
                }
            }
            // A quadrilateral that a large jitter made concave may fold one way: then sums, not single hits, are kept.
            if jitter < 0.3 {
                assert!(image.all().iter().all(|&h| h == 1), "{cells} cells, jitter {jitter}");
            } else {
                assert!(image.all().iter().all(|&h| h >= 1), "a hole: {cells} cells, jitter {jitter}");
            }
        }
    }
}

#[test]
fn moving_by_whole_pixels_moves_the_image() {
    let mut random = Random::new(6);
    for case in 0..300 {
        let v: [[i32; 2]; 3] = std::array::from_fn(|_| [0, 1].map(|_| 256 * 64 + random.below(256 * 40)));
        let shift = [random.below(60), random.below(60)];
        let place = |dx: i32, dy: i32| {
            let mut image = Image::new([0, 0, 180, 180]);
            let at = v.map(|[x, y]| ScreenVertex { x: x + dx * 256, y: y + dy * 256, z: 0.5, inv_w: 1.0 });
            if let Ok(t) = setup::triangle(&state(4, [0, 0, 180, 180]), &at) {
                image.draw::<4>(&t);
            }
            image
        };
        let (still, moved) = (place(0, 0), place(shift[0], shift[1]));
        assert_eq!(still.total(), moved.total(), "case {case}");
        for y in 60..110 {
            for x in 60..110 {
                for s in 0..4 {
                    assert_eq!(still.hits(x, y, s), moved.hits(x + shift[0], y + shift[1], s), "case {case}");
                }
            }
        }
    }
}

#[test]
fn extreme_positions_are_ordinary() {
    let mut random = Random::new(7);
    let huge = f32::MAX / 16.0;
    let pick = |random: &mut Random| -> f32 {
        let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
        sign * match random.below(14) {
            0 => huge,
            1 => f32::MAX,
            2 => 0.0,
            3 => f32::MIN_POSITIVE,
            4 => 1.0e-40,
            5 => 1.0e-6,
            6 => f32::NAN,
            7 => f32::INFINITY,
            8 => 1.0e19,
            9 => huge * random.unit(),
            10 => 2.0f32.powi(random.below(250) - 125),
            _ => random.range(0.0, 3.0),
        }
    };
    let [mut cut, mut whole, mut covered] = [0; 3];
    for case in 0..60_000 {
        // Some wild components among tame ones.
        let wild = random.below(13);
        let position: [[f32; 4]; 3] = std::array::from_fn(|_| {
            std::array::from_fn(|k| {
                if random.below(12) < wild {
                    pick(&mut random)
                } else if k == 3 {
                    random.range(0.1, 2.0)
                } else {
                    random.range(-1.0, 1.5)
                }
            })
        });
        let unclipped = case % 3 == 0;
        let run = || {
            let mut image = Image::new([0, 0, 24, 24]);
            let clipped = draw::<1>(&mut image, 24, unclipped, position);
            (clipped, image.all().to_vec())
        };
        let (clipped, hits) = run();
        if position.iter().flatten().any(|v| !v.is_finite()) {
            assert_eq!(clipped, Clipped::Rejected, "{position:?}");
        }
        assert!(hits.iter().all(|&h| h <= 1), "a double hit: {position:?}");
        cut += u32::from(clipped == Clipped::Cut);
        whole += u32::from(clipped == Clipped::Whole);
        covered += hits.iter().sum::<u32>();
        if case % 16 == 0 {
            assert_eq!((clipped, hits), run());
        }
    }
    assert!(cut > 5000 && whole > 1000 && covered > 100_000, "{cut} {whole} {covered}");
}
