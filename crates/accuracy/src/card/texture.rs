//! Texels by format and filter.

use anyhow::Result;

use super::bench::Bench;
use super::recipes::Layers;
use super::{Because, Benchmark, Class, Family, cores, count, seen, unconfirmed};
use gfx::format::Format;
use gfx::state::*;
use machine::Config;

/// A benchmark of this family on the GeForce GTX 980.
const TEXTURE: Benchmark = Benchmark::of(Family::Texture, Class::A);

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "tex-bilinear",
        what: "eight bilinear samples of RGBA8 a fragment",
        unit: "texels/cycle",
        published: &[128.0],
        source: seen("GeForce GTX 980 white paper, p. 7: 128 texture units, 144.1 Gtexel/s"),
        formula: Some(texels),
        fault: &["texture.filters_per_cycle=4"],
        quick: true,
        measure: |bench| Ok(vec![rate(bench, &sampled(Format::Rgba8Unorm, FilterMode::Linear))?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-format",
        what: "bilinear RGBA8, RG16F, RGBA16F, R32F, RGBA32F, D32F, sRGB, BC1",
        unit: "times RGBA8's time",
        published: &[1.0, 1.0, 1.0, 1.0, 4.0, 1.0, 1.0, 1.0],
        source: seen("hardware.fr 928-3 (GTX 980), 910-6, 948: FP16 at full rate; perftest, RTX 3090: RGBA32F 4"),
        fault: &["texture.lookups_per_cycle=2"],
        measure: |bench| costs(bench, &BILINEAR, FilterMode::Linear),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-load",
        what: "textureLoad of R8, RGBA8, RGBA16F, RGBA32F, neighbours side by side",
        unit: "times RGBA8's time",
        published: &[1.0, 1.0, 1.0, 2.0],
        class: Class::B,
        source: seen("perftest, GTX 980 Ti: 1.0 up to 64 bits, 128 bits 2.0"),
        fault: &["texture.lookups_per_cycle=2"],
        measure: |bench| loads(bench, &[Format::R8Unorm, Format::Rgba8Unorm, Format::Rgba16Float, Format::Rgba32Float]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-trilinear",
        what: "between two levels",
        unit: "times bilinear's time",
        published: &[2.0],
        source: unconfirmed("two bilinear samples; seen for Mali-G57 (Arm GPU datasheet v7)"),
        fault: &["texture.filters_per_cycle=16"],
        measure: |bench| Ok(vec![stretched(bench, 1.5, 1.5, 1)? / stretched(bench, 1.0, 1.0, 1)?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-aniso",
        what: "footprints of 1:2, 1:4, 1:8, 1:16, 16 samples at most",
        unit: "times bilinear's time",
        published: &[2.0, 4.0, 8.0, 16.0],
        source: unconfirmed("a bilinear sample for each step along the footprint; seen for Mali-G57 (Arm GPU datasheet v7)"),
        fault: &["texture.filters_per_cycle=16"],
        measure: |bench| {
            let one = stretched(bench, 1.0, 1.0, 1)?;
            [2.0, 4.0, 8.0, 16.0].into_iter().map(|ratio| Ok(stretched(bench, 1.0, ratio, 16)? / one)).collect()
        },
        ..TEXTURE
    },
    Benchmark {
        name: "tex-cliff",
        what: "texels at random places of 256 KB: time divided by that of 16 KB",
        unit: "times",
        published: &[2.5],
        class: Class::C,
        source: seen("azhirnov, GPU_Benchmarks.md: RTX 2080 1,228 to 491 GB/s, M1 300 to 120, behind the first level"),
        fault: &["memory.l2.width=8"],
        because: Some(Because {
            what: "a texture unit filters eight texels a cycle and the second level sends its core 32 bytes, where an RTX 2080 has four and 64; \
                   samples ask for 64 bytes",
            off: 4.352,
        }),
        measure: |bench| Ok(vec![scattered(bench, 64)? / scattered(bench, 256)?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-bilinear",
        card: "gtx-titan",
        what: "eight bilinear samples of RGBA8 a fragment",
        unit: "texels/cycle",
        published: &[224.0],
        source: seen("data sheet: 14 multiprocessors of 16 texture units, 187.5 Gtexel/s at 837 MHz"),
        formula: Some(texels),
        fault: &["texture.filters_per_cycle=4"],
        measure: |bench| Ok(vec![rate(bench, &sampled(Format::Rgba8Unorm, FilterMode::Linear))?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-bilinear",
        card: "rx-5700-xt",
        what: "eight bilinear samples of RGBA8 a fragment",
        unit: "texels/cycle",
        published: &[160.0],
        source: seen("AMD, RDNA architecture white paper: four texels each of 40 compute units"),
        formula: Some(texels),
        fault: &["texture.filters_per_cycle=4"],
        measure: |bench| Ok(vec![rate(bench, &sampled(Format::Rgba8Unorm, FilterMode::Linear))?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-load",
        card: "rx-5700-xt",
        what: "textureLoad of R8, RG16F, RGBA8, RGBA32F, neighbours side by side",
        unit: "times RGBA8's time",
        published: &[0.5, 0.5, 1.0, 1.0],
        class: Class::B,
        source: seen(
            "perftest, RX 5700 XT: formats of one and two channels up to 32 bits at twice the rate of RGBA8, RGBA32F at its rate",
        ),
        fault: &["texture.load_full=2"],
        because: Some(Because { what: "loads of narrow formats are no faster than those of RGBA8", off: 1.012 }),
        measure: |bench| loads(bench, &[Format::R8Unorm, Format::Rg16Float, Format::Rgba8Unorm, Format::Rgba32Float]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-bilinear",
        card: "mali-g57-mc2",
        what: "eight bilinear samples of RGBA8 a fragment",
        unit: "texels/cycle",
        published: &[8.0],
        source: seen("Arm GPU datasheet v7, p. 2: four texels a core and cycle"),
        formula: Some(texels),
        fault: &["texture.filters_per_cycle=2"],
        measure: |bench| Ok(vec![rate(bench, &sampled(Format::Rgba8Unorm, FilterMode::Linear))?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-format",
        card: "mali-g57-mc2",
        what: "bilinear RGBA8, RGBA16F, RG32F, RGBA32F",
        unit: "times RGBA8's time",
        published: &[1.0, 2.0, 4.0, 8.0],
        source: seen("Arm GPU datasheet v7, p. 2: 2 above 32 bits a texel, 2N for N channels of 32 bits"),
        fault: &["texture.lookups_per_cycle=1"],
        measure: |bench| {
            costs(bench, &[Format::Rgba8Unorm, Format::Rgba16Float, Format::Rg32Float, Format::Rgba32Float], FilterMode::Linear)
        },
        ..TEXTURE
    },
    Benchmark {
        name: "tex-trilinear",
        card: "mali-g57-mc2",
        what: "between two levels",
        unit: "times bilinear's time",
        published: &[2.0],
        source: seen("Arm GPU datasheet v7, p. 2; Mali-G78 counter reference"),
        fault: &["texture.filters_per_cycle=8"],
        measure: |bench| Ok(vec![stretched(bench, 1.5, 1.5, 1)? / stretched(bench, 1.0, 1.0, 1)?]),
        ..TEXTURE
    },
    Benchmark {
        name: "tex-aniso",
        card: "mali-g57-mc2",
        what: "footprints of 1:2, 1:4, 1:8, 16 samples at most",
        unit: "times bilinear's time",
        published: &[2.0, 4.0, 8.0],
        source: seen("Arm GPU datasheet v7, p. 2: N for N samples"),
        fault: &["texture.filters_per_cycle=8"],
        measure: |bench| {
            let one = stretched(bench, 1.0, 1.0, 1)?;
            [2.0, 4.0, 8.0].into_iter().map(|ratio| Ok(stretched(bench, 1.0, ratio, 16)? / one)).collect()
        },
        ..TEXTURE
    },
];

/// The formats of `tex-format`, the first of which is what the others are compared with.
const BILINEAR: [Format; 8] = [
    Format::Rgba8Unorm,
    Format::Rg16Float,
    Format::Rgba16Float,
    Format::R32Float,
    Format::Rgba32Float,
    Format::Depth32Float,
    Format::Rgba8UnormSrgb,
    Format::Bc1RgbaUnorm,
];

/// Edge of a target whose tiles are as many for each pipeline.
fn edge(bench: &Bench) -> u32 {
    64 * bench.config().card.pipelines.max(4)
}

/// Samples of a fragment: more than texture units take while the ROPs take a pixel.
const SAMPLES: u32 = 8;

fn texels(config: &Config) -> Vec<f64> {
    vec![cores(config) * count(config.texture.filters_per_cycle)]
}

/// A repeating sampler.
fn sampler(filter: FilterMode, mipmap: FilterMode, anisotropy: u16) -> SamplerDesc {
    SamplerDesc { address: [AddressMode::Repeat; 3], mag: filter, min: filter, mipmap, anisotropy, ..SamplerDesc::default() }
}

/// Layers with eight samples per fragment of a texture of 32x32 texels, a texel per pixel.
fn sampled(format: Format, filter: FilterMode) -> Layers {
    let sample = |n: u32| {
        let sample = format!("textureSample(t0, s0, at.xy / 32.0 + vec2f({n}.25 / 32.0, 0.25 / 32.0))");
        if format.has_depth() { format!("c += vec4f({sample});") } else { format!("c += {sample};") }
    };
    let samples: String = (0..SAMPLES).map(sample).collect();
    Layers {
        textures: vec![(format, 32, 1)],
        sampler: sampler(filter, FilterMode::Nearest, 1),
        ..Layers::plain(256, Format::Rgba8Unorm).shaded(format!("var c = vec4f(); {samples} return c;"))
    }
}

/// Samples per cycle.
fn rate(bench: &Bench, layers: &Layers) -> Result<f64> {
    let layers = Layers { edge: edge(bench), ..layers.clone() };
    Ok(f64::from(SAMPLES * layers.edge * layers.edge) / bench.slope(&|count| layers.trace(count), [1, 3])?)
}

/// Times of formats, divided by RGBA8's.
fn costs(bench: &Bench, formats: &[Format], filter: FilterMode) -> Result<Vec<f64>> {
    let rate = |format: Format| rate(bench, &sampled(format, filter));
    let plain = rate(Format::Rgba8Unorm)?;
    formats.iter().map(|&format| Ok(plain / rate(format)?)).collect()
}

/// Times of loads of formats, divided by RGBA8's.
fn loads(bench: &Bench, formats: &[Format]) -> Result<Vec<f64>> {
    let rate = |format: Format| {
        let load = |n: u32| format!("c += textureLoad(t0, (vec2u(at.xy) + vec2u({n}, 0)) & vec2u(31), 0);");
        let loads: String = (0..SAMPLES).map(load).collect();
        let layers = sampled(format, FilterMode::Nearest).shaded(format!("var c = vec4f(); {loads} return c;"));
        rate(bench, &layers)
    };
    let plain = rate(Format::Rgba8Unorm)?;
    formats.iter().map(|&format| Ok(plain / rate(format)?)).collect()
}

/// Samples per cycle at random places of a texture.
fn scattered(bench: &Bench, edge: u32) -> Result<f64> {
    let sample =
        |n: u32| format!("c += textureSample(t0, s0, fract(h * {}.37)); h = fract(h.yx * 37.1 + at.xy * 0.17);", 211 + n);
    let samples: String = (0..SAMPLES).map(sample).collect();
    let layers = Layers {
        textures: vec![(Format::Rgba8Unorm, edge, 1)],
        sampler: sampler(FilterMode::Nearest, FilterMode::Nearest, 1),
        ..Layers::plain(256, Format::Rgba8Unorm)
            .shaded(format!("var h = fract(at.xy * vec2f(0.7548, 0.5698)); var c = vec4f(); {samples} return c;"))
    };
    rate(bench, &layers)
}

/// Cycles of a layer whose pixels each cover `x` by `y` texels.
fn stretched(bench: &Bench, x: f32, y: f32, anisotropy: u16) -> Result<f64> {
    let sample =
        |n: u32| format!("c += textureSample(t0, s0, at.xy * vec2f({x:?}, {y:?}) / 64.0 + vec2f({n}.25 / 64.0, 0.25 / 64.0));");
    let samples: String = (0..SAMPLES).map(sample).collect();
    let layers = Layers {
        textures: vec![(Format::Rgba8Unorm, 64, 7)],
        sampler: sampler(FilterMode::Linear, FilterMode::Linear, anisotropy),
        ..Layers::plain(256, Format::Rgba8Unorm).shaded(format!("var c = vec4f(); {samples} return c;"))
    };
    bench.slope(&|count| layers.trace(count), [1, 2])
}
