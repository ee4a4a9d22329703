//! Coverage of triangles, lines and points against exact arithmetic: no sample may differ.

mod raster_common;

use fillrate::gfx::reference;
use fillrate::gfx::setup::{self, Culled, SAMPLES_1, SAMPLES_4, ScreenVertex};
use raster_common::*;

/// Compares a triangle's coverage with the oracle in a rectangle of pixels; returns how many samples are covered.
fn check_triangle<const S: usize>(v: [[i32; 2]; 3], window: [i32; 4]) -> usize {
    let state = state(S as u32, window);
    let vertices = v.map(|[x, y]| ScreenVertex { x, y, z: 0.5, inv_w: 1.0 });
    let mut image = Image::new(window);
    let set_up = setup::triangle(&state, &vertices);
    match &set_up {
        Ok(t) => image.draw::<S>(t),
        Err(Culled::Degenerate | Culled::NoSample | Culled::Scissor) => {}
        Err(Culled::Face) => panic!("culling is off"),
    }
    let offsets: &[[i32; 2]] = if S == 1 { &SAMPLES_1 } else { &SAMPLES_4 };
    let wide = v.map(|p| p.map(i64::from));
    let mut covered = 0;
    for y in window[1]..window[3] {
        for x in window[0]..window[2] {
            for (s, [dx, dy]) in offsets.iter().enumerate() {
                let sample = [x * 256 + 128 + dx, y * 256 + 128 + dy].map(i64::from);
                let expected = reference::triangle_covers(wide, sample);
                assert_eq!(image.hits(x, y, s), u32::from(expected), "{v:?} pixel {x} {y} sample {s} {set_up:?}");
                covered += usize::from(expected);
            }
        }
    }
    covered
}

fn check_both(v: [[i32; 2]; 3], window: [i32; 4]) -> usize {
    let one = check_triangle::<1>(v, window);
    // Every winding and order of vertices covers the same.
    assert_eq!(one, check_triangle::<1>([v[2], v[1], v[0]], window));
    one + check_triangle::<4>(v, window) + check_triangle::<4>([v[1], v[0], v[2]], window)
}

#[test]
fn random_triangles_of_every_size() {
    let mut random = Random::new(1);
    let mut covered = 0;
    for case in 0..3000 {
        // Extents from a fraction of a pixel to the whole guard band; most vertices near a window of 40x40 pixels.
        let bits = 6 + case % 18;
        let center = [random.below(8000 * 256), random.below(8000 * 256)];
        let v = std::array::from_fn(|_| {
            [0, 1].map(|k| (center[k] + random.below(1 << bits) - (1 << (bits - 1))).clamp(-(32767 << 8), 32767 << 8))
        });
        let at = [0, 1].map(|k| ((center[k] >> 8) - 10 - random.below(20)).max(0));
        covered += check_both(v, [at[0], at[1], at[0] + 1 + random.below(40), at[1] + 1 + random.below(40)]);
    }
    assert!(covered > 100_000, "{covered}");
}

#[test]
fn vertices_and_edges_on_samples() {
    let mut random = Random::new(2);
    let mut covered = 0;
    for case in 0..3000 {
        // Multiples of half, an eighth or a sixteenth pixel: ties everywhere, for one and for four samples.
        let step = [128, 32, 16][case % 3];
        let v = std::array::from_fn(|_| [0, 1].map(|_| 8 * 256 + random.below(12 * 256 / step) * step));
        covered += check_both(v, [6, 6, 22, 22]);
    }
    assert!(covered > 100_000, "{covered}");
}

#[test]
fn slivers_duplicates_and_collinear_vertices() {
    let mut random = Random::new(3);
    for _ in 0..2000 {
        let p = [0, 1].map(|_| 4096 + random.below(4096));
        // Area 1/65536 pixel^2 (twice: 1), and other multiples of it, as long as 16 pixels.
        let d = [0, 1].map(|_| random.below(4096) - 2048);
        let q = [p[0] + d[0], p[1] + d[1]];
        let r = [0, 1].map(|k| p[k] + d[k] / 2 + random.below(3) - 1);
        check_both([p, q, r], [4, 4, 44, 44]);
        check_both([p, p, q], [4, 4, 44, 44]);
        check_both([p, q, [p[0] + 2 * d[0], p[1] + 2 * d[1]]], [4, 4, 44, 44]);
    }
}

#[test]
fn guard_band_corners() {
    const G: i32 = 32767 << 8;
    let corners = [[-G, -G], [G, -G], [G, G], [-G, G], [-G, 0], [0, -G], [G, 128], [128, G], [0, 0], [-G, -G + 1], [G, G - 1]];
    let mut random = Random::new(4);
    for a in corners {
        for b in corners {
            for c in corners {
                // The diagonals of the band pass near these windows.
                for at in [[0, 0], [16370, 16370], [32740, 32740]] {
                    check_triangle::<1>([a, b, c], [at[0], at[1], at[0] + 9, at[1] + 9]);
                }
                if random.below(16) == 0 {
                    check_triangle::<4>([a, b, c], [0, 0, 70, 20]);
                }
            }
        }
    }
}

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
fn lines_exit_diamonds() {
    let mut random = Random::new(5);
    let window = [0, 0, 72, 72];
    let mut drawn = 0;
    for case in 0..1500 {
        let step = [1, 128, 64, 32, 1][case % 5];
        let size = [72 * 256, 2 * 256, 10 * 256][case % 3];
        let at = [0, 1].map(|_| random.below(72 * 256 - size + 1) / step * step);
        let [from, to] = std::array::from_fn(|_| at.map(|v| v + random.below(size) / step * step));
        let image = line_pixels(1, from, to, window);
        let (p, q) = (from.map(i64::from), to.map(i64::from));
        let (lo, hi) = ([0, 1].map(|k| from[k].min(to[k]) / 256 - 3), [0, 1].map(|k| from[k].max(to[k]) / 256 + 4));
        for y in 0..72 {
            for x in 0..72 {
                let near = x >= lo[0] && y >= lo[1] && x < hi[0] && y < hi[1];
                let expected = near && reference::line_draws(p, q, [i64::from(x), i64::from(y)]);
                assert_eq!(image.hits(x, y, 0), u32::from(expected), "{from:?} {to:?} at {x} {y}");
                drawn += usize::from(expected);
            }
        }
    }
    assert!(drawn > 10_000, "{drawn}");
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
fn wide_lines_and_points_cover_their_rectangles() {
    let mut random = Random::new(6);
    let window = [0, 0, 40, 40];
    let mut covered = 0;
    for case in 0..400 {
        let step = [1, 128, 32][case % 3];
        let [from, to] = std::array::from_fn(|_| [0, 1].map(|_| random.below(40 * 256) / step * step));
        let image = line_pixels(4, from, to, window);
        let mut points = Image::new(window);
        if let Ok(point) = setup::point(&state(4, window), &ScreenVertex { x: from[0], y: from[1], z: 0.0, inv_w: 1.0 }, true) {
            points.draw::<4>(&point);
        }
        for y in 0..40 {
            for x in 0..40 {
                for (s, [dx, dy]) in SAMPLES_4.iter().enumerate() {
                    let sample = [x * 256 + 128 + dx, y * 256 + 128 + dy].map(i64::from);
                    let (p, q) = (from.map(i64::from), to.map(i64::from));
                    let expected = reference::wide_line_covers(p, q, sample);
                    assert_eq!(image.hits(x, y, s), u32::from(expected), "{from:?} {to:?} at {x} {y} sample {s}");
                    let expected_point = reference::wide_point_covers(p, sample);
                    assert_eq!(points.hits(x, y, s), u32::from(expected_point), "{from:?} at {x} {y} sample {s}");
                    covered += usize::from(expected) + usize::from(expected_point);
                }
            }
        }
    }
    assert!(covered > 10_000, "{covered}");
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
