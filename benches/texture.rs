//! Nanoseconds per lane of texture sampling.

use criterion::{BenchmarkId, Criterion, Throughput, criterion_group, criterion_main};
use fillrate::gfx::format::Format;
use fillrate::gfx::image::ImageDesc;
use fillrate::gfx::state::{AddressMode, Aspect, Compare, FilterMode, SamplerDesc, TextureDimension, ViewDimension};
use fillrate::gfx::texture::{Footprint, Lod, Sample, Sampler, View, ViewRange};
use fillrate::num::{LANES, Lanes, Random, Words};
use std::hint::black_box;

/// A square texture of pseudo-random bytes.
fn view(format: Format, dimension: ViewDimension, edge: u32, levels: u32) -> View {
    let layers = if dimension == ViewDimension::Cube { 6 } else { 1 };
    let image = ImageDesc { dimension: TextureDimension::D2, size: [edge, edge, layers], levels, samples: 1, format };
    let words = Words::new(image.bytes());
    let mut random = Random::new(7);
    for i in 0..words.words().len() {
        let bits = random.bits();
        words.store(i, if format == Format::Depth32Float { 0x3f00_0000 | bits >> 9 } else { bits });
    }
    let range = ViewRange { dimension, format, aspect: Aspect::All, base_level: 0, levels, base_layer: 0, layers };
    View::new(&words, &image, &range, 0).expect("a valid view")
}

/// Coordinates of batches that walk over the texture, `scale` texels per pixel.
fn batches(edge: u32, scale: f32) -> Vec<[Lanes; 2]> {
    (0..256)
        .map(|batch| {
            let mut coords = [Lanes::ZERO; 2];
            for i in 0..LANES {
                let (q, p) = (i / 4, i % 4);
                let x = (batch % 16 * 8 + q % 4 * 2 + p % 2) as f32;
                let y = (batch / 16 * 8 + q / 4 * 2 + p / 2) as f32;
                coords[0].f32_mut()[i] = (x * scale + y * 0.3) / edge as f32 + 0.1;
                coords[1].f32_mut()[i] = (y * scale) / edge as f32 + 0.7;
            }
            coords
        })
        .collect()
}

/// The operands of an implicit sample.
fn args(c: &[Lanes; 2]) -> Sample<'_> {
    Sample { coords: [&c[0], &c[1], &c[1]], layer: None, offset: [0; 3], lod: Lod::Auto, compare: None }
}

fn sampling(c: &mut Criterion) {
    let linear = SamplerDesc { mag: FilterMode::Linear, min: FilterMode::Linear, ..SamplerDesc::default() };
    let repeat = SamplerDesc { address: [AddressMode::Repeat; 3], ..linear };
    let trilinear = SamplerDesc { mipmap: FilterMode::Linear, ..repeat };
    let aniso = SamplerDesc { anisotropy: 8, ..trilinear };
    let shadow = SamplerDesc { compare: Some(Compare::LessEqual), ..linear };
    let unorm = view(Format::Rgba8Unorm, ViewDimension::D2, 1024, 11);
    let srgb = view(Format::Rgba8UnormSrgb, ViewDimension::D2, 1024, 11);
    let half = view(Format::Rgba16Unorm, ViewDimension::D2, 512, 10);
    let depth = view(Format::Depth32Float, ViewDimension::D2, 1024, 1);
    let cube = view(Format::Rgba8Unorm, ViewDimension::Cube, 256, 9);
    let cases: &[(&str, &View, SamplerDesc, f32)] = &[
        ("bilinear clamp", &unorm, linear, 0.7),
        ("bilinear repeat", &unorm, repeat, 0.7),
        ("trilinear repeat", &unorm, trilinear, 1.7),
        ("trilinear repeat srgb", &srgb, trilinear, 1.7),
        ("trilinear repeat rgba16", &half, trilinear, 1.7),
        ("anisotropic 8", &unorm, aniso, 1.7),
        ("nearest", &unorm, SamplerDesc::default(), 1.0),
        ("compare linear", &depth, shadow, 1.0),
        ("cube trilinear", &cube, trilinear, 1.0),
    ];
    let mut group = c.benchmark_group("texture");
    for (name, view, desc, scale) in cases {
        let sampler = Sampler::new(desc);
        let coords = batches(view.size(0)[0], *scale);
        let third = Lanes::splat_f32(0.6);
        let mut out = [Lanes::ZERO; 4];
        group.throughput(Throughput::Elements((coords.len() * LANES) as u64));
        group.bench_function(BenchmarkId::new("sample", name), |b| {
            b.iter(|| {
                for c in &coords {
                    let mut args = args(c);
                    if desc.compare.is_some() {
                        args.compare = Some(&third);
                    }
                    view.sample(&sampler, &args, !0, &mut out);
                    black_box(&out);
                }
            });
        });
        if name.starts_with("trilinear repeat") {
            let mut footprint = Footprint::new();
            group.bench_function(BenchmarkId::new("record", name), |b| {
                b.iter(|| {
                    for c in &coords {
                        view.record_sample(&sampler, &args(c), !0, &mut footprint);
                        black_box(&footprint);
                    }
                });
            });
        }
    }
    group.finish();
}

criterion_group!(benches, sampling);
criterion_main!(benches);
