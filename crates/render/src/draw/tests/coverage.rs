//! Clipped triangles: every sample inside is drawn once, by one triangle or by one of two that share an edge.

use super::*;

/// Additive: a target's texel counts the fragments that it got.
fn counting(samples: u32) -> Scene {
    let mut scene = Scene::new(vec![[0.0; 8]; 3]).samples(samples);
    scene.extent = (24, 24);
    let sum = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    scene.target().blend = Some(Blend { color: sum, alpha: sum });
    scene.source = "
        @vertex fn vs(@location(0) p: vec4<f32>) -> @builtin(position) vec4<f32> { return p; }
        @fragment fn fs() -> @location(0) vec4<f32> { return vec4<f32>(1.0 / 255.0); }
    "
    .into();
    scene
}

fn random(seed: u32) -> impl FnMut() -> u32 {
    let mut random = num::Random::new(seed.into());
    move || random.bits()
}

/// In [-1, 1).
fn unit(bits: u32) -> f32 {
    (bits & 0xff_ffff) as f32 / (1 << 23) as f32 - 1.0
}

#[test]
fn a_cut_triangle_covers_no_sample_twice() {
    let mut next = random(1);
    for samples in [1, 4] {
        let mut scene = counting(samples);
        let pipeline = scene.pipeline().unwrap();
        let (mut cut, mut covered) = (0, 0);
        for case in 0..4_000 {
            for vertex in &mut scene.vertices {
                for (k, value) in vertex[..4].iter_mut().enumerate() {
                    let tame = if k == 3 { unit(next()).abs() + 0.1 } else { 1.5 * unit(next()) };
                    *value = match next() % 9 {
                        0 => tame * 1.0e4,
                        1 => tame * 1.0e9,
                        2 => tame * 1.0e-6,
                        3 => -tame,
                        4 => tame * (f32::MAX / 16.0),
                        _ => tame,
                    };
                }
            }
            if case % 2 == 0 {
                // An edge along the near plane: where it is cut the outline is as good as straight, and snapping bends it.
                for vertex in &mut scene.vertices {
                    let w = 1.25 + 0.75 * unit(next());
                    *vertex = [1.5 * w * unit(next()), 1.5 * w * unit(next()), 0.3 * w, w, 0.0, 0.0, 0.0, 0.0];
                }
                let first = next() as usize % 3;
                let small = |bits: u32| 1.0e-4 * (unit(bits).abs() + 1.0e-3);
                scene.vertices[first][2] = small(next());
                scene.vertices[(first + 1) % 3][2] = -small(next());
            }
            let image = scene.draw_with(&pipeline, How { threads: 1, ..USUAL }).unwrap();
            cut += image.drawn.funnel.clipped;
            covered += image.drawn.funnel.fragments_covered;
            for (x, y) in (0..24).flat_map(|y| (0..24).map(move |x| (x, y))) {
                for s in 0..samples {
                    let hits = image.color.texel(x, y, s)[0] & 0xff;
                    assert!(hits <= 1, "{hits} hits at {x} {y}: {:?}", scene.vertices);
                }
            }
        }
        assert!(cut > 1_000 && covered > 50_000, "{cut} {covered}");
    }
}

#[test]
fn clipped_neighbours_cover_every_sample_of_a_mesh_once() {
    // A plane in clip space, most of it behind the eye or outside of the view volume, in triangles that share their vertices.
    // A front face counts up and a back face down, so that slivers which snapping turns over cancel out, as they must.
    const CELLS: u32 = 5;
    let mut next = random(2);
    let count = |pass_op| StencilFace { pass_op, ..StencilFace::default() };
    for samples in [1, 4] {
        let mut scene = Scene::new(Vec::new()).with_depth(Format::Depth24PlusStencil8, Compare::Always, false, 0.0);
        scene.state.multisample.count = samples;
        scene.source = PLAIN.into();
        scene.extent = (40, 33);
        let state = scene.state.depth_stencil.as_mut().unwrap();
        state.stencil_front = count(StencilOp::IncrementWrap);
        state.stencil_back = count(StencilOp::DecrementWrap);
        let mut list = Vec::new();
        for (i, j) in (0..CELLS).flat_map(|j| (0..CELLS).map(move |i| (i, j))) {
            let [a, b, c, d] = [(0, 0), (1, 0), (0, 1), (1, 1)].map(|(x, y)| (j + y) * (CELLS + 1) + i + x);
            list.extend(if (i + j) % 2 == 0 { [a, b, c, c, b, d] } else { [a, b, d, d, c, a] });
        }
        let all = 0..list.len() as u32;
        scene.draws = vec![all];
        scene.indices = Some(list);
        let pipeline = scene.pipeline().unwrap();
        let (mut inside, mut cut) = (0, 0);
        for case in 0..600 {
            let mut vector = |size: f32| -> [f32; 4] { std::array::from_fn(|_| size * unit(next())) };
            let (mut origin, across, down) = (vector(1.0), vector(3.0), vector(3.0));
            origin[3] += 0.5;
            let at = |s: f32, t: f32| -> [f32; 4] { std::array::from_fn(|k| origin[k] + s * across[k] + t * down[k]) };
            scene.vertices.clear();
            for k in 0..(CELLS + 1) * (CELLS + 1) {
                let place = |i: u32| {
                    if i == CELLS {
                        30.0
                    } else if i == 0 {
                        -30.0
                    } else {
                        i as f32 - 2.5
                    }
                };
                let [x, y, z, w] = at(place(k % (CELLS + 1)), place(k / (CELLS + 1)));
                scene.vertices.push([x, y, z, w, 0.0, 0.0, 0.0, 0.0]);
            }
            let image = scene.draw_with(&pipeline, How { threads: 1, ..USUAL }).unwrap();
            cut += image.drawn.funnel.clipped;
            let depth = image.depth.as_ref().unwrap();
            // The side that the plane shows is the same everywhere.
            let mut sides = 0;
            for (x, y) in (0..33).flat_map(|y| (0..40).map(move |x| (x, y))) {
                let visible = visible(origin, across, down, [x, y], scene.extent);
                for s in 0..samples {
                    let hits = depth.texel(x, y, s)[0] >> 24;
                    assert!([0, 1, 255].contains(&hits), "case {case}: {hits} at {x} {y} {s}");
                    assert!(hits != 0 || !visible, "case {case}: a hole at {x} {y} {s}");
                    sides |= hits;
                    inside += u32::from(visible);
                }
            }
            assert!([0, 1, 255].contains(&sides), "case {case}");
        }
        assert!(inside > 90_000 && cut > 4_000, "{inside} {cut}");
    }
}

/// Whether the plane `o + s a + t b` is certain to show at all samples of a pixel: in `f64`, and with a margin.
fn visible(o: [f32; 4], a: [f32; 4], b: [f32; 4], [px, py]: [u32; 2], (width, height): (u32, u32)) -> bool {
    let [o, a, b] = [o, a, b].map(|v| v.map(f64::from));
    [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0), (1.0, 1.0)].iter().all(|(dx, dy)| {
        let x = (f64::from(px) + dx) / f64::from(width) * 2.0 - 1.0;
        let y = 1.0 - (f64::from(py) + dy) / f64::from(height) * 2.0;
        // (o + s a + t b).x = x (o + s a + t b).w, and the same for y.
        let row = |k: usize, n: f64| [o[k] - n * o[3], a[k] - n * a[3], b[k] - n * b[3]];
        let ([c0, a0, b0], [c1, a1, b1]) = (row(0, x), row(1, y));
        let det = a0 * b1 - a1 * b0;
        let (s, t) = ((c1 * b0 - c0 * b1) / det, (c0 * a1 - c1 * a0) / det);
        let [z, w] = [2, 3].map(|k| o[k] + s * a[k] + t * b[k]);
        s.abs() < 29.9 && t.abs() < 29.9 && w > 0.01 && z > 0.01 * w && z < 0.99 * w
    })
}

/// Triangles of about a size, in pixels, anywhere in and around a window.
fn scattered(size: f32, seed: u32) -> Scene {
    let mut next = random(seed);
    let mut scene = Scene::new(Vec::new());
    scene.extent = (256, 256);
    let pixels = |v: f32| v / 128.0;
    for _ in 0..4_000 {
        let middle = [0; 2].map(|_: i32| unit(next()) * (1.0 + pixels(size)));
        for _ in 0..3 {
            let [x, y] = middle.map(|v| v + pixels(size) * unit(next()));
            scene.vertices.push([x, y, 0.5, 1.0, 0.0, 0.0, 0.0, 0.0]);
        }
    }
    let n = scene.vertices.len() as u32;
    scene.draws = std::iter::once(0..n).collect();
    scene
}

#[test]
fn areas_tell_what_triangles_cover() {
    for (size, seed) in [(0.5, 3), (1.0, 4), (2.0, 5), (8.0, 6), (40.0, 7), (200.0, 8), (1000.0, 9)] {
        let scene = scattered(size, seed);
        let Drawn { funnel, areas, .. } = scene.draw_as(How { areas: true, ..USUAL }).drawn;
        let ratio = |expected: u64, counted: u64| expected as f64 / 256.0 / counted as f64;
        let ratios = [
            ratio(areas.fragments, funnel.fragments_covered),
            ratio(areas.quads, funnel.quads_rasterized),
            ratio(areas.blocks, funnel.tiles_visited),
        ];
        // Fragments are exact on average; what meets quads and blocks between their outer centres need not hold one.
        let random = 3.0 / (funnel.fragments_covered as f64).sqrt();
        assert!((ratios[0] - 1.0).abs() < 0.005 + random, "size {size}: {ratios:?}");
        assert!(ratios[1..].iter().all(|ratio| (0.97..1.16).contains(ratio)), "size {size}: {ratios:?}");
        // Recorded or not, with or without fragments, the areas are the same.
        for how in [How { record: true, areas: true, ..USUAL }, How { need: Need::Survey, ..USUAL }] {
            let other = scene.draw_as(how).drawn;
            assert_eq!(other.areas, areas);
            assert_eq!(other.funnel.triangles_setup, funnel.triangles_setup);
            let none = how.need == Need::Survey;
            assert_eq!(other.funnel.fragments_covered, if none { 0 } else { funnel.fragments_covered });
        }
    }
}
