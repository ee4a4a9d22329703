//! Rasterisation from clip space to attributes. Figures are a triangle, a quad, a block or a lane; see `docs/performance.md`.

use std::hint::black_box;

use criterion::{Criterion, Throughput, criterion_group, criterion_main};
use fillrate::gfx::clip::ClipVolume;
use fillrate::gfx::interpolate::{self, PixelPoint, Site, Weights};
use fillrate::gfx::setup::{self, Bounds, DepthBias, Screen, ScreenVertex, SetupState, Triangle};
use fillrate::gfx::state::{CullMode, FrontFace, Rect, VertexFormat, Viewport};
use fillrate::gfx::traverse::Blocks;
use fillrate::gfx::vertex::VertexSource;
use fillrate::num::{LANES, Lanes, QUADS, Words, hash};

const WIDTH: u32 = 1920;
const HEIGHT: u32 = 1080;

fn unit(i: u32) -> f32 {
    (hash(i) >> 8) as f32 / 16_777_216.0
}

fn viewport() -> Viewport {
    Viewport { x: 0.0, y: 0.0, width: WIDTH as f32, height: HEIGHT as f32, min_depth: 0.0, max_depth: 1.0 }
}

fn state(samples: u32) -> SetupState {
    let scissor = Rect { x: 0, y: 0, width: WIDTH, height: HEIGHT };
    SetupState::new((WIDTH, HEIGHT), &viewport(), scissor, FrontFace::Ccw, CullMode::None, samples, DepthBias::NONE)
}

/// Right triangles with legs of `size` pixels at random places and angles.
fn triangles(n: usize, size: f32) -> Vec<[ScreenVertex; 3]> {
    (0..n as u32)
        .map(|i| {
            let [cx, cy] = [unit(7 * i) * (WIDTH as f32 - size), unit(7 * i + 1) * (HEIGHT as f32 - size)];
            let at = |x: f32, y: f32, k: u32| ScreenVertex {
                x: ((cx + x * size) * 256.0) as i32,
                y: ((cy + y * size) * 256.0) as i32,
                z: unit(7 * i + 2 + k),
                inv_w: 0.5 + 0.5 * unit(7 * i + 2 + k),
            };
            let j = unit(7 * i + 5) * 0.3;
            [at(j, 0.0, 0), at(1.0, 0.2, 1), at(0.1, 1.0 - j, 2)]
        })
        .collect()
}

fn set_up(samples: u32, vertices: &[[ScreenVertex; 3]]) -> Vec<Triangle> {
    let state = state(samples);
    vertices.iter().filter_map(|v| setup::triangle(&state, v).ok()).collect()
}

/// Traverses all screen tiles that a triangle's bounds touch; returns quads visited.
fn traverse_all<const S: usize>(t: &Triangle, blocks: &mut Blocks<S>) -> u32 {
    let mut quads = 0;
    let b = t.bounds;
    for ty in b.y0 / 64..=(b.y1 - 1) / 64 {
        for tx in b.x0 / 64..=(b.x1 - 1) / 64 {
            let tile = Bounds { x0: tx * 64, y0: ty * 64, x1: tx * 64 + 64, y1: ty * 64 + 64 };
            blocks.find(t, tile);
            for quad in blocks.iter().flat_map(|block| block.quads()) {
                quads += u32::from(black_box(quad.mask) != 0);
            }
        }
    }
    quads
}

fn vertices(c: &mut Criterion) {
    let mut group = c.benchmark_group("vertex");
    group.throughput(Throughput::Elements(LANES as u64));
    let words = Words::new(40 * 4096);
    let source = VertexSource { words: &words, offset: 0, size: words.len(), stride: 40 };
    let index: [u32; LANES] = std::array::from_fn(|i| hash(i as u32) % 4096);
    let mut out = [Lanes::ZERO; 4];
    for (name, format) in
        [("float32x3", VertexFormat::Float32x3), ("unorm8x4", VertexFormat::Unorm8x4), ("float16x4", VertexFormat::Float16x4)]
    {
        group.bench_function(format!("fetch/{name}"), |b| {
            b.iter(|| source.fetch(format, 0, black_box(&index), LANES, &mut out))
        });
    }
    let screen = Screen::new(&viewport());
    let volume = ClipVolume::new(&viewport(), false);
    let position: [Lanes; 4] = std::array::from_fn(|c| {
        let mut lanes = Lanes::ZERO;
        for (i, v) in lanes.f32_mut().iter_mut().enumerate() {
            *v = if c == 3 { 1.0 + unit(i as u32) } else { unit((97 * c + i) as u32) };
        }
        lanes
    });
    let mut screens = [ScreenVertex::default(); LANES];
    let mut codes = [0; LANES];
    group.bench_function("screen", |b| b.iter(|| screen.vertices(black_box(position.each_ref()), &mut screens)));
    group.bench_function("outcodes", |b| b.iter(|| volume.outcodes(black_box(position.each_ref()), &mut codes)));
    group.finish();
}

fn setup_and_traversal(c: &mut Criterion) {
    for (name, size) in [("2px", 2.2f32), ("50px_area", 10.0), ("100px", 100.0), ("1000px", 1000.0)] {
        let n = if size > 50.0 { 64 } else { 4096 };
        let vertices = triangles(n, size);
        let mut group = c.benchmark_group(format!("triangle/{name}"));
        group.throughput(Throughput::Elements(n as u64));
        let state1 = state(1);
        group.bench_function("setup", |b| {
            b.iter(|| {
                let mut kept = 0u64;
                for v in &vertices {
                    if let Ok(t) = setup::triangle(&state1, black_box(v)) {
                        black_box(&t);
                        kept += 1;
                    }
                }
                kept
            })
        });
        let (one, four) = (set_up(1, &vertices), set_up(4, &vertices));
        let (mut in_one, mut in_four) = (Blocks::<1>::new(), Blocks::<4>::new());
        let quads: u32 = one.iter().map(|t| traverse_all(t, &mut in_one)).sum();
        eprintln!("{name}: {} triangles, {quads} quads", one.len());
        group.throughput(Throughput::Elements(if size > 50.0 { u64::from(quads) } else { one.len() as u64 }));
        group.bench_function("traverse", |b| {
            b.iter(|| one.iter().map(|t| traverse_all(black_box(t), &mut in_one)).sum::<u32>())
        });
        group.bench_function("traverse4x", |b| {
            b.iter(|| four.iter().map(|t| traverse_all(black_box(t), &mut in_four)).sum::<u32>())
        });
        group.finish();
    }
}

fn blocks(c: &mut Criterion) {
    let big = set_up(
        1,
        &[[(-30000, -30000), (30000, -30000), (-30000, 30000)].map(|(x, y)| ScreenVertex {
            x: x * 256,
            y: y * 256,
            z: 0.5,
            inv_w: 1.0,
        })],
    );
    let tile = Bounds { x0: 64, y0: 64, x1: 128, y1: 128 };
    let mut group = c.benchmark_group("tile");
    group.throughput(Throughput::Elements(64 * 16));
    group.bench_function("full_blocks_as_quads", |b| {
        let mut blocks = Blocks::<1>::new();
        b.iter(|| {
            blocks.find(black_box(&big[0]), tile);
            blocks.iter().map(|block| black_box(block.samples[0]).count_ones()).sum::<u32>()
        })
    });
    group.finish();
}

fn interpolation(c: &mut Criterion) {
    let all = set_up(1, &triangles(4096, 10.0));
    let mixed: Vec<Site> = (0..QUADS as u32)
        .map(|q| {
            let b = all[q as usize * 7].bounds;
            Site { triangle: q * 7, x: b.x0 & !1, y: b.y0 & !1 }
        })
        .collect();
    let codes: [u8; LANES] = std::array::from_fn(|i| (i % 5) as u8);
    let mut group = c.benchmark_group("interpolate");
    group.throughput(Throughput::Elements(LANES as u64));
    let mut weights = Weights::default();
    let mut out = Lanes::ZERO;
    group.bench_function("perspective", |b| {
        b.iter(|| interpolate::perspective(&all, black_box(&mixed), PixelPoint::Center, &mut weights, &mut out))
    });
    group.bench_function("perspective_centroid", |b| {
        b.iter(|| interpolate::perspective(&all, black_box(&mixed), PixelPoint::PerLane(&codes), &mut weights, &mut out))
    });
    group.bench_function("linear", |b| {
        b.iter(|| interpolate::linear(&all, black_box(&mixed), PixelPoint::Center, &mut weights))
    });
    group.bench_function("depth", |b| b.iter(|| interpolate::depth(&all, black_box(&mixed), PixelPoint::Center, &mut out)));
    let values: [[f32; QUADS]; 3] = std::array::from_fn(|i| std::array::from_fn(|q| unit((i * 16 + q) as u32)));
    group.bench_function("attribute", |b| b.iter(|| interpolate::attribute(&weights, black_box(&values), &mut out)));
    group.bench_function("attribute_uniform", |b| {
        b.iter(|| interpolate::attribute_uniform(&weights, black_box([0.25, 0.5, 0.125]), &mut out))
    });
    group.finish();
}

criterion_group!(benches, vertices, setup_and_traversal, blocks, interpolation);
criterion_main!(benches);
