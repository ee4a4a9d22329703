//! Interpolation of batches, lines and clipped triangles; depth bias, and the bounds that hierarchical Z relies on. (`fillrate
//! accuracy interpolation depth` has the errors against f64.)

use crate::common::*;
use gfx::clip::{ClipVolume, Clipped, Polygon};
use gfx::interpolate::{self, PixelPoint, Site, Weights};
use gfx::setup::{self, BiasUnit, Bounds, DepthBias, SAMPLES_4, Screen, ScreenVertex, SetupState, Triangle};
use gfx::state::Viewport;
use gfx::traverse;
use num::Random;
use num::{LANES, Lanes, QUADS};

/// Covered quads of a triangle, as sites with their masks.
fn sites(t: &Triangle) -> Vec<(Site, u16)> {
    let mut out = Vec::new();
    let b = t.bounds;
    for ty in (b.y0 / 64..=(b.y1 - 1) / 64).map(|t| t * 64) {
        for tx in (b.x0 / 64..=(b.x1 - 1) / 64).map(|t| t * 64) {
            traverse::blocks::<1>(t, Bounds { x0: tx, y0: ty, x1: tx + 64, y1: ty + 64 }, |block| {
                out.extend(block.quads().map(|q| (Site { triangle: 0, x: q.x, y: q.y }, q.mask)));
            });
        }
    }
    out
}

fn random_triangle(random: &mut Random, extent: i32, w: bool) -> [ScreenVertex; 3] {
    std::array::from_fn(|_| ScreenVertex {
        x: random.between(0, extent * 256),
        y: random.between(0, extent * 256),
        z: random.unit(),
        inv_w: if w { 1.0 / random.range(0.1, 4.0) } else { 1.0 },
    })
}

/// Runs `check(lane weights, covered, pixel)` for all lanes of a triangle's quads.
fn each_lane(t: &Triangle, mut check: impl FnMut(f32, f32, f32, bool, [i64; 2], usize, &Weights)) {
    let triangles = [*t];
    for chunk in sites(t).chunks(QUADS) {
        let batch: Vec<Site> = chunk.iter().map(|c| c.0).collect();
        let (mut weights, mut inv_w) = (Weights::default(), Lanes::ZERO);
        interpolate::perspective(&triangles, &batch, PixelPoint::Center, &mut weights, &mut inv_w);
        for (q, (site, mask)) in chunk.iter().enumerate() {
            for p in 0..4 {
                let lane = 4 * q + p;
                let at = [i64::from(site.x) + (p as i64 & 1), i64::from(site.y) + (p as i64 >> 1)].map(|v| v * 256 + 128);
                let (one, two) = (weights.one.f32()[lane], weights.two.f32()[lane]);
                check(one, two, inv_w.f32()[lane], mask >> p & 1 == 1, at, lane, &weights);
            }
        }
    }
}

/// Attributes of a run of quads are those of all quads there, and what is before and behind them stays.
fn runs_of_quads(weights: &Weights, values: [f32; 3], random: &mut Random) {
    let (a, b) = (random.between(0, QUADS as i32 + 1) as usize, random.between(0, QUADS as i32 + 1) as usize);
    let quads = a.min(b)..a.max(b);
    let mut all = Lanes::ZERO;
    interpolate::attribute_uniform(weights, values, &mut all);
    let before = Lanes(std::array::from_fn(|_| random.bits()));
    let inside = |lane: usize| quads.contains(&(lane / 4));
    let expected = Lanes(std::array::from_fn(|lane| if inside(lane) { all.0[lane] } else { before.0[lane] }));
    let mut out = before;
    gfx::simd::dispatch!(simd => interpolate::attribute_run(simd, weights, quads.clone(), values, &mut out));
    assert_eq!(out, expected, "{quads:?}");
    let mut out = before;
    interpolate::attribute_run(gfx::simd::base(), weights, quads.clone(), values, &mut out);
    assert_eq!(out, expected, "{quads:?}");
}

/// What is filled in without interpolation is what interpolation gives.
#[test]
fn an_attribute_that_is_the_same_at_all_vertices_is_constant() {
    let mut random = Random::new(5);
    let mut weights = Weights::default();
    let (mut constant, mut other) = (0, 0);
    for round in 0..2000 {
        for lane in 0..LANES {
            // Any bits of a finite number.
            let mut bits = || Some(random.bits()).filter(|bits| f32::from_bits(*bits).is_finite()).unwrap_or(0);
            (weights.one.0[lane], weights.two.0[lane]) = (bits(), bits());
        }
        assert!(weights.are_finite());
        let value = match round % 4 {
            0 => [0, 1 << 31, 1, 0x3f80_0000, 0xff7f_ffff, 0x7f80_0000, 0x7fc0_0000][round / 4 % 7],
            _ => random.bits(),
        };
        let values = if round % 8 == 7 { [value, value, value ^ 1] } else { [value; 3] };
        if !interpolate::is_constant(values) {
            other += 1;
            continue;
        }
        constant += 1;
        let mut out = Lanes::ZERO;
        interpolate::attribute_uniform(&weights, values.map(f32::from_bits), &mut out);
        assert_eq!(out, Lanes::splat(value), "{values:x?}");
    }
    assert!(constant > 1000 && other > 200, "{constant}, {other}");
    weights.two.f32_mut()[7] = f32::NEG_INFINITY;
    assert!(!weights.are_finite());
    weights.two.f32_mut()[7] = f32::NAN;
    assert!(!weights.are_finite());
}

/// Where all 1/w are 1 nothing is divided: the weights are those of any other 1/w that is the same at all vertices.
#[test]
fn orthographic_weights_are_those_of_one_distance() {
    let mut random = Random::new(6);
    let mut counted = 0;
    for _ in 0..100 {
        let near = random_triangle(&mut random, 200, false);
        let far = near.map(|vertex| ScreenVertex { inv_w: 0.5, ..vertex });
        let [Ok(near), Ok(far)] = [near, far].map(|v| setup::triangle(&state(1, [0, 0, 200, 200]), &v)) else { continue };
        for chunk in sites(&near).chunks(QUADS) {
            let batch: Vec<Site> = chunk.iter().map(|c| c.0).collect();
            let [(near, near_w), (far, far_w)] = [near, far].map(|triangle| {
                let (mut weights, mut inv_w) = (Weights::default(), Lanes::ZERO);
                interpolate::perspective(&[triangle], &batch, PixelPoint::Center, &mut weights, &mut inv_w);
                (weights, inv_w)
            });
            assert_eq!(near, far);
            for lane in 0..4 * batch.len() {
                assert_eq!(near_w.f32()[lane], 2.0 * far_w.f32()[lane]);
                counted += 1;
            }
        }
    }
    assert!(counted > 100_000, "{counted}");
}

#[test]
fn mixed_batches_and_uniform_ones_give_the_same_bits() {
    let mut random = Random::new(3);
    // Every other one is orthographic.
    let triangles: Vec<Triangle> = (0..)
        .map(|i| random_triangle(&mut random, 60, i % 2 == 0))
        .filter_map(|v| setup::triangle(&state(4, [0, 0, 60, 60]), &v).ok())
        .take(40)
        .collect();
    let mut random = Random::new(4);
    for round in 0..200 {
        // A register of one triangle, or up to one of any.
        let sole = (round % 3 == 0).then(|| random.between(0, 40) as u32);
        let quads = if sole.is_some() { QUADS as i32 } else { 1 + random.between(0, QUADS as i32) };
        let batch: Vec<Site> = (0..quads)
            .map(|_| Site {
                triangle: sole.unwrap_or(random.between(0, 40) as u32),
                x: 2 * random.between(0, 30) as u16,
                y: 2 * random.between(0, 30) as u16,
            })
            .collect();
        let codes: [u8; LANES] = std::array::from_fn(|_| random.between(0, 5) as u8);
        let sample = random.between(0, 4) as usize;
        for place in [PixelPoint::Center, PixelPoint::Sample(sample), PixelPoint::PerLane(&codes)] {
            let (mut all, mut all_w, mut all_z) = (Weights::default(), Lanes::ZERO, Lanes::ZERO);
            interpolate::perspective(&triangles, &batch, place, &mut all, &mut all_w);
            interpolate::depth(&triangles, &batch, place, &mut all_z);
            let (mut x, mut y) = (Lanes::ZERO, Lanes::ZERO);
            interpolate::window(&batch, place, &mut x, &mut y);
            let values: [[f32; QUADS]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| random.range(-2.0, 2.0)));
            let mut out = Lanes::ZERO;
            interpolate::attribute(&all, &values, &mut out);
            runs_of_quads(&all, values.map(|values| values[0]), &mut random);
            for (q, site) in batch.iter().enumerate() {
                let own: [u8; LANES] = std::array::from_fn(|i| if i < 4 { codes[4 * q + i] } else { 0 });
                let place = if let PixelPoint::PerLane(_) = place { PixelPoint::PerLane(&own) } else { place };
                let (mut one, mut one_w, mut one_out) = (Weights::default(), Lanes::ZERO, Lanes::ZERO);
                interpolate::perspective(&triangles, &[*site], place, &mut one, &mut one_w);
                interpolate::attribute_uniform(&one, [0, 1, 2].map(|i| values[i][q]), &mut one_out);
                let t = &triangles[site.triangle as usize];
                for p in 0..4 {
                    let lane = 4 * q + p;
                    assert_eq!(one.one.0[p], all.one.0[lane]);
                    assert_eq!(one.two.0[p], all.two.0[lane]);
                    assert_eq!(one_w.0[p], all_w.0[lane]);
                    assert_eq!(one_out.0[p], out.0[lane]);
                    // Extrapolation stays finite and depth is the plane's.
                    assert!(one_out.f32()[p].is_finite());
                    let code = match place {
                        PixelPoint::Center => 0,
                        PixelPoint::Sample(s) => s + 1,
                        PixelPoint::PerLane(_) => usize::from(codes[lane]),
                    };
                    let offset = if code == 0 { [0; 2] } else { SAMPLES_4[code - 1] };
                    let at = [f32::from(site.x) + (p & 1) as f32, f32::from(site.y) + (p >> 1) as f32];
                    let at: [f32; 2] = std::array::from_fn(|k| at[k] + 0.5 + offset[k] as f32 / 256.0);
                    assert_eq!([x.f32()[lane], y.f32()[lane]], at);
                    assert_eq!(all_z.f32()[lane].to_bits(), t.depth.at(at[0], at[1]).to_bits());
                }
            }
        }
    }
}

#[test]
fn centroids_are_covered_samples() {
    let mut random = Random::new(5);
    let coverage: [u16; QUADS] = std::array::from_fn(|_| random.bits() as u16);
    let mut codes = [9; LANES];
    interpolate::centroids(&coverage, &mut codes);
    for lane in 0..LANES {
        let mask = coverage[lane / 4] >> (lane % 4) & 0x1111;
        match codes[lane] {
            0 => assert!(mask == 0 || mask == 0x1111),
            s => assert!(mask >> (4 * (s - 1)) & 1 == 1 && mask != 0x1111),
        }
    }
}

#[test]
fn lines_and_points_interpolate_by_the_same_road() {
    let mut random = Random::new(6);
    for _ in 0..200 {
        let v: [ScreenVertex; 2] = std::array::from_fn(|_| ScreenVertex {
            x: random.between(1, 60 * 256),
            y: random.between(1, 60 * 256),
            z: random.unit(),
            inv_w: 1.0 / random.range(0.5, 2.0),
        });
        let Ok(line) = setup::line(&state(1, [0, 0, 64, 64]), &v, true) else { continue };
        let d = [0, 1].map(|k| [v[1].x - v[0].x, v[1].y - v[0].y][k] as f64);
        each_lane(&line, |one, two, _, covered, at, _, _| {
            if !covered {
                return;
            }
            let s = [at[0] as f64 - f64::from(v[0].x), at[1] as f64 - f64::from(v[0].y)];
            let t = (d[0] * s[0] + d[1] * s[1]) / (d[0] * d[0] + d[1] * d[1]);
            let (k0, k1) = ((1.0 - t) * f64::from(v[0].inv_w), t * f64::from(v[1].inv_w));
            let ideal = k1 / (k0 + k1);
            if (0.0..=1.0).contains(&t) {
                assert!((f64::from(one) - ideal).abs() <= 1.0e-6, "{one} {ideal}");
            }
            assert_eq!(two, 0.0);
            let z = line.depth.at(at[0] as f32 / 256.0, at[1] as f32 / 256.0);
            let ideal = f64::from(v[0].z) + t.clamp(0.0, 1.0) * (f64::from(v[1].z) - f64::from(v[0].z));
            assert!((f64::from(z) - ideal).abs() <= 1.0e-6, "{z} {ideal}");
        });
        let point = setup::point(&state(1, [0, 0, 64, 64]), &v[0], true).expect("inside");
        each_lane(&point, |one, two, inv_w, _, _, _, _| assert_eq!((one, two, inv_w), (0.0, 0.0, v[0].inv_w)));
        assert_eq!(point.depth.at(3.0, 4.0), v[0].z);
    }
}

#[test]
fn constant_depth_is_exact_and_bounds_hold_for_every_sample() {
    let mut random = Random::new(8);
    for case in 0..1000 {
        let mut v = random_triangle(&mut random, [8, 64, 1500][case % 3], false);
        if case % 4 == 0 {
            v[1].z = v[0].z;
            v[2].z = v[0].z;
        }
        let Ok(t) = setup::triangle(&state(4, [0, 0, 100, 100]), &v) else { continue };
        let least = v[0].z.min(v[1].z).min(v[2].z);
        let most = v[0].z.max(v[1].z).max(v[2].z);
        for size in [2, 8] {
            let (x, y) = (random.between(0, 100) & !(size - 1), random.between(0, 100) & !(size - 1));
            let (low, high) = t.depth.block_range(x, y, size);
            assert!(least <= low && low <= high && high <= most);
            for j in 0..size {
                for i in 0..size {
                    for [dx, dy] in SAMPLES_4.into_iter().chain([[0, 0]]) {
                        let at = |v: i32, d: i32| v as f32 + 0.5 + d as f32 / 256.0;
                        let z = t.depth.at(at(x + i, dx), at(y + j, dy));
                        assert!(low <= z && z <= high, "{z} not in {low}..{high}");
                        if case % 4 == 0 {
                            assert_eq!(z, v[0].z);
                        }
                    }
                }
            }
            let quad = t.depth.quad(x, y);
            assert_eq!(quad[3].to_bits(), t.depth.at(x as f32 + 1.5, y as f32 + 1.5).to_bits());
        }
    }
}

#[test]
fn depth_bias_follows_the_formula() {
    // z = 0.25 + x / 128: a slope of 1/128 per pixel.
    let vertex = |x: i32, y: i32| ScreenVertex { x: x * 256, y: y * 256, z: 0.25 + x as f32 / 128.0, inv_w: 1.0 };
    let v = [vertex(0, 0), vertex(32, 0), vertex(0, 32)];
    let depth = |bias: DepthBias| {
        let state = SetupState { bias, ..state(1, [0, 0, 64, 64]) };
        setup::triangle(&state, &v).expect("drawn").depth.at(8.0, 8.0)
    };
    let plain = 0.25 + 8.0 / 128.0;
    assert_eq!(depth(DepthBias::NONE), plain);
    let unit = BiasUnit::Fixed(1.0 / 65536.0);
    assert_eq!(depth(DepthBias { constant: 4.0, slope: 0.0, clamp: 0.0, unit }), plain + 4.0 / 65536.0);
    assert_eq!(depth(DepthBias { constant: 1.25, slope: 0.0, clamp: 0.0, unit }), plain + 1.25 / 65536.0);
    assert_eq!(depth(DepthBias { constant: 0.0, slope: 2.0, clamp: 0.0, unit }), plain + 2.0 / 128.0);
    assert_eq!(depth(DepthBias { constant: 0.0, slope: 2.0, clamp: 0.01, unit }), plain + 0.01);
    assert_eq!(depth(DepthBias { constant: -4096.0, slope: 0.0, clamp: -0.03125, unit }), plain - 0.03125);
    // The greatest depth of the primitive is 0.5: its exponent is -1, the unit 2^-24.
    let float = DepthBias { constant: 1024.0, slope: 0.0, clamp: 0.0, unit: BiasUnit::Float };
    assert_eq!(depth(float), plain + 1024.0 / 16_777_216.0);
    // Depth stays in the viewport's range.
    assert_eq!(depth(DepthBias { constant: 65536.0, slope: 0.0, clamp: 0.0, unit }), 1.0);
    assert_eq!(depth(DepthBias { constant: -65536.0, slope: 0.0, clamp: 0.0, unit }), 0.0);
}

#[test]
fn clipped_triangles_keep_their_attributes_and_depth() {
    // A triangle that reaches behind the eye: at every pixel of its clipped parts, attributes and depth are those of the
    // original's plane in clip space, found in f64 by solving for the weights directly.
    let viewport = Viewport { x: 0.0, y: 0.0, width: 64.0, height: 64.0, min_depth: 0.0, max_depth: 1.0 };
    let (volume, screen) = (ClipVolume::new(&viewport, false), Screen::new(&viewport));
    let state = state(1, [0, 0, 64, 64]);
    let mut random = Random::new(9);
    let mut checked = 0;
    for _ in 0..400 {
        let position: [[f32; 4]; 3] = std::array::from_fn(|_| {
            let w = random.range(-1.0, 2.0);
            [random.range(-2.0, 2.0), random.range(-2.0, 2.0), w * 0.5 + random.range(-0.3, 0.3), w]
        });
        let mut polygon = Polygon::EMPTY;
        if volume.triangle(&position, position.map(|p| volume.outcode(p)), &mut polygon) != Clipped::Cut {
            continue;
        }
        let vertices = polygon.vertices();
        let snapped: Vec<_> = vertices.iter().map(|v| screen.clipped(v)).collect();
        for [a, b, c] in setup::fan(&snapped) {
            let v = [a, b, c].map(|i| snapped[i]);
            let Ok(t) = setup::triangle(&state, &v) else { continue };
            if t.area() < 65536 * 40 {
                continue;
            }
            each_lane(&t, |one, two, _, covered, at, _, _| {
                let (x, y) = (at[0] as f64 / 256.0 / 32.0 - 1.0, 1.0 - at[1] as f64 / 256.0 / 32.0);
                // Weights g with sum(g (x_i - x w_i)) = 0, sum(g (y_i - y w_i)) = 0, sum(g) = 1.
                let p = position.map(|p| p.map(f64::from));
                let r: [[f64; 2]; 3] = std::array::from_fn(|i| [p[i][0] - x * p[i][3], p[i][1] - y * p[i][3]]);
                let minor = |i: usize, j: usize| r[i][0] * r[j][1] - r[i][1] * r[j][0];
                let g = [minor(1, 2), minor(2, 0), minor(0, 1)];
                let sum: f64 = g.iter().sum();
                let g = g.map(|g| g / sum);
                let w: f64 = (0..3).map(|i| g[i] * p[i][3]).sum();
                // Near the edges of the snapped triangle and near the horizon a 1/512 pixel matters too much to compare.
                if !covered || w < 0.2 {
                    return;
                }
                for k in 0..3 {
                    let value = |i: usize| vertices[i].combine(std::array::from_fn(|v| if v == k { 1.0 } else { 0.0 }));
                    let (va, vb, vc) = (f64::from(value(a)), f64::from(value(b)), f64::from(value(c)));
                    let got = va + f64::from(one) * (vb - va) + f64::from(two) * (vc - va);
                    assert!((got - g[k]).abs() < 0.01, "{got} {} at {x} {y} of {position:?}", g[k]);
                }
                let ideal = (0..3).map(|i| g[i] * p[i][2]).sum::<f64>() / w;
                let z = f64::from(t.depth.at(at[0] as f32 / 256.0, at[1] as f32 / 256.0));
                assert!((z - ideal).abs() < 0.01, "{z} {ideal}");
                checked += 1;
            });
        }
    }
    assert!(checked > 20_000, "{checked}");
}

#[test]
fn clipped_lines_end_at_the_planes() {
    let viewport = Viewport { x: 0.0, y: 0.0, width: 64.0, height: 64.0, min_depth: 0.0, max_depth: 1.0 };
    let volume = ClipVolume::new(&viewport, false);
    let line = |a: [f32; 4], b: [f32; 4]| {
        let mut polygon = Polygon::EMPTY;
        let clipped = volume.line(&[a, b], [volume.outcode(a), volume.outcode(b)], &mut polygon);
        (clipped, polygon)
    };
    let (clipped, out) = line([0.0, 0.0, 0.5, 1.0], [0.0, 0.0, 1.5, 1.0]);
    assert_eq!(clipped, Clipped::Cut);
    let v = out.vertices();
    assert_eq!(v.len(), 2);
    assert_eq!(v[1].position, [0.0, 0.0, 1.0, 1.0]);
    assert_eq!(v[1].combine([2.0, 4.0, 2.0]), 3.0);
    assert_eq!((v[0].combine([2.0, 4.0, 2.0]), v[0].combine([7.0, 7.0, 7.0])), (2.0, 7.0));
    assert_eq!(line([0.0, 0.0, 1.1, 1.0], [0.5, 0.0, 1.5, 1.0]).0, Clipped::Rejected);
    assert_eq!(line([0.0, 0.0, 0.1, 1.0], [0.5, 0.0, 0.5, 1.0]).0, Clipped::Whole);
    let (clipped, out) = line([0.0, 0.0, 0.5, 1.0], [0.0, 0.0, -0.5, -1.0]);
    assert_eq!((clipped, out.vertices().len()), (Clipped::Cut, 2));
    assert!(out.vertices().iter().all(|v| v.position[3] > 0.0));
}

/// Weights of triangles that promise finite ones, in quads that are as far away as a screen is wide.
#[test]
fn weights_are_finite_where_they_are_said_to_be() {
    let mut random = Random::new(21);
    let (mut promised, mut wild) = (0, 0);
    for _ in 0..4000 {
        let spread = [1, 40, 90, 250][random.between(0, 4) as usize];
        let inv_w = |random: &mut Random| {
            f32::from_bits((random.between(127 - spread / 2, 127 + spread / 2).clamp(1, 254) as u32) << 23)
        };
        let corners = random_triangle(&mut random, 64, false).map(|v| ScreenVertex { inv_w: inv_w(&mut random), ..v });
        let Ok(triangle) = setup::triangle(&state(1, [0, 0, 64, 64]), &corners) else { continue };
        let sites: Vec<Site> = (0..QUADS)
            .map(|_| Site { triangle: 0, x: 2 * random.between(0, 8192) as u16, y: 2 * random.between(0, 8192) as u16 })
            .collect();
        let (mut weights, mut inv_w) = (Weights::default(), Lanes::ZERO);
        interpolate::perspective(&[triangle], &sites, PixelPoint::Center, &mut weights, &mut inv_w);
        if interpolate::has_finite_weights(&triangle) {
            promised += 1;
            assert!(weights.are_finite(), "{corners:?}");
        } else {
            wild += 1;
        }
    }
    assert!(promised > 500 && wild > 500, "{promised} {wild}");
}
