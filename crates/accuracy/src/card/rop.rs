//! Pixels by format, blending, samples, depth and compression.

use anyhow::Result;

use super::bench::{Bench, Phase};
use super::recipes::Layers;
use super::{Because, Benchmark, Class, Family, count, seen, unconfirmed};
use crate::scenes::kit::OVER;
use gfx::format::Format;
use gfx::state::*;
use machine::Config;

/// A benchmark of this family on the GeForce GTX 980.
const ROP: Benchmark = Benchmark::of(Family::Rop, Class::B);

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "rop-rgba8",
        what: "opaque layers of RGBA8 that the second level holds",
        unit: "pixels/cycle",
        published: &[64.0],
        class: Class::A,
        source: seen("GeForce GTX 980 white paper, p. 7: 64 ROPs, 72 Gpixel/s"),
        formula: Some(pixels),
        fault: &["color.quads_per_cycle=2", "color.blends_per_cycle=2"],
        quick: true,
        measure: |bench| Ok(vec![rate(bench, &Layers::plain(SMALL, Format::Rgba8Unorm))?]),
        ..ROP
    },
    Benchmark {
        name: "rop-format",
        what: "opaque RG16F, RGBA16F, RG32F, RGBA32F, RG11B10F, RGB10A2, R32F, sRGB",
        unit: "of RGBA8's rate",
        published: &[1.0, 0.5, 0.5, 0.25, 1.0, 1.0, 1.0, 1.0],
        source: seen("Mavridis and Papaioannou 2012, fig. 4.6 (GTX 460: 0.97, 0.56, 0.55, 0.29); hardware.fr 948 for 32 bits"),
        fault: &["color.write_64=1"],
        measure: |bench| formats(bench, &OPAQUE, None),
        ..ROP
    },
    Benchmark {
        name: "rop-blend",
        what: "blended RGBA8, RG16F, RGBA16F, RG32F, RGBA32F, RG11B10F, R32F",
        unit: "of RGBA8's rate, opaque",
        published: &[1.0, 0.5, 0.5, 0.25, 0.125, 0.5, 0.5],
        source: seen("Mavridis and Papaioannou 2012, fig. 4.6 (GTX 460: 1, 0.55, 0.55, 0.24, 0.13); Beyond3D 55/13"),
        fault: &["color.blends_per_cycle=1"],
        measure: |bench| formats(bench, &BLENDED, Some(OVER)),
        ..ROP
    },
    Benchmark {
        name: "rop-mrt",
        what: "1, 2, 4 targets of RGBA8",
        unit: "times one target's time",
        published: &[1.0, 2.0, 4.0],
        class: Class::A,
        source: seen("each pixel of each target is one of the ROPs' pixels"),
        fault: &["dispatch.output_quads=2"],
        measure: targets,
        ..ROP
    },
    Benchmark {
        name: "rop-msaa",
        what: "4 samples, colour and depth, inside of triangles",
        unit: "of one sample's rate",
        published: &[1.0],
        source: unconfirmed("four samples cost no rate of pixels while they are compressed; seen for GCN (white paper, p. 13)"),
        fault: &["color.compression=false", "depth.compression=false"],
        measure: |bench| Ok(vec![samples(bench, 4)? / samples(bench, 1)?]),
        ..ROP
    },
    Benchmark {
        name: "fill-write",
        what: "opaque layers of noise, four times as large as the second level",
        unit: "of the pins",
        published: &[0.855],
        source: seen(
            "clpeak reads 78 % (GTX 980); Beyond3D 8/9 writes 82 % (X700 XT); gpu-benches: writes up to 1.05 of reads",
        ),
        fault: &["memory.dram.channels=4"],
        measure: |bench| Ok(vec![4.0 * rate(bench, &noise())? / SHEET_PINS]),
        ..ROP
    },
    Benchmark {
        name: "fill-blend",
        what: "the same, blended: bytes read and written",
        unit: "of the pins",
        published: &[0.78 * 0.94],
        source: seen("clpeak, GTX 980: 78 % of the pins; reads and writes together 0.88 to 1.0 of that"),
        fault: &["memory.dram.channels=4"],
        measure: |bench| Ok(vec![8.0 * rate(bench, &noise().blended(OVER))? / SHEET_PINS]),
        ..ROP
    },
    Benchmark {
        name: "fill-solid",
        what: "opaque layers of one colour, twice as large as the second level",
        unit: "pixels/cycle",
        published: &[64.0],
        class: Class::A,
        source: seen("GeForce GTX 980 white paper, pp. 7, 10: 8:1 compression leaves the ROPs as the limit"),
        fault: &["color.compression=false"],
        measure: |bench| Ok(vec![rate(bench, &Layers::plain(BIG, Format::Rgba8Unorm))?]),
        ..ROP
    },
    Benchmark {
        name: "fill-overdraw",
        what: "opaque layers of noise: bytes moved per byte written",
        unit: "bytes/byte",
        published: &[1.0],
        class: Class::A,
        source: seen("Beyond3D 8/9 (X700 XT): colour fill moves 4 bytes a pixel at 82 % of the pins"),
        fault: &["color.skip_reads=false"],
        measure: overdraw,
        ..ROP
    },
    Benchmark {
        name: "resolve",
        what: "4 samples of noise, 16 MB: a pass with resolve less one without",
        unit: "pixels/cycle",
        published: &[0.78 * SHEET_PINS / 20.0],
        source: seen("5 x 4 bytes a pixel at the rate that clpeak reads (GTX 980: 78 % of the pins)"),
        fault: &["memory.dram.channels=4"],
        measure: resolve,
        ..ROP
    },
    Benchmark {
        name: "codec",
        what: "noise that is constant in 1x1, 2x2, 4x2, 4x4, 8x8 pixels, a gradient, one colour: bytes written",
        unit: "of 4 bytes a pixel",
        published: &[1.0, 0.25, 0.125, 0.125, 0.125, 0.5, 0.125],
        class: Class::A,
        source: seen("GeForce GTX 980 white paper, pp. 10-11; GTX 1080 white paper for 2:1"),
        fault: &["color.compression=false"],
        because: Some(Because { what: "blocks are compressed as planes, not by regions", off: 5.000 }),
        measure: codec,
        ..ROP
    },
    Benchmark {
        name: "rop-rgba8",
        card: "gtx-titan",
        what: "opaque layers of RGBA8 that the second level holds",
        unit: "pixels/cycle",
        published: &[40.0],
        class: Class::A,
        source: seen("hardware.fr 928-3: five rasterisers of 8 pixels are the limit, not 48 ROPs"),
        formula: Some(pixels),
        fault: &["traverse.quads_per_cycle=1"],
        quick: true,
        measure: |bench| Ok(vec![rate(bench, &Layers::plain(320, Format::Rgba8Unorm))?]),
        ..ROP
    },
    Benchmark {
        name: "fill-16",
        card: "geforce2-ultra",
        what: "layers of 16 bits with a depth test of 16 bits that writes",
        unit: "Mpixel/s",
        published: &[790.0],
        source: seen("Tom's Hardware 2000, \"NVIDIA Strikes Back\", p. 3"),
        fault: &["memory.dram.burst_cycles=8"],
        measure: |bench| Ok(vec![old_fill(bench, Format::Rg8Unorm, Format::Depth16Unorm, 0)?]),
        ..ROP
    },
    Benchmark {
        name: "fill-32",
        card: "geforce2-ultra",
        what: "layers of 32 bits with a depth test of 32 bits that writes",
        unit: "Mpixel/s",
        published: &[395.0],
        class: Class::C,
        source: seen("Tom's Hardware 2000, p. 3: 32 bits are \"usually halving\" the fill rate"),
        fault: &["memory.dram.burst_cycles=8"],
        measure: |bench| Ok(vec![old_fill(bench, Format::Rgba8Unorm, Format::Depth24Plus, 0)?]),
        ..ROP
    },
    Benchmark {
        name: "texels-16",
        card: "geforce2-ultra",
        what: "the layers of 16 bits with two textures",
        unit: "Mtexel/s",
        published: &[1600.0],
        source: seen("Tom's Hardware 2000, p. 3"),
        fault: &["memory.dram.burst_cycles=8"],
        measure: |bench| Ok(vec![2.0 * old_fill(bench, Format::Rg8Unorm, Format::Depth16Unorm, 2)?]),
        ..ROP
    },
    Benchmark {
        name: "rop-rgba8",
        card: "rx-5700-xt",
        what: "opaque layers of RGBA8 that the second level holds",
        unit: "pixels/cycle",
        published: &[64.0],
        class: Class::A,
        source: seen("AMD, RDNA architecture white paper: 16 render backends of 4 pixels"),
        formula: Some(pixels),
        fault: &["color.quads_per_cycle=2", "color.blends_per_cycle=2"],
        measure: |bench| Ok(vec![rate(bench, &Layers::plain(SMALL, Format::Rgba8Unorm))?]),
        ..ROP
    },
    Benchmark {
        name: "hiz",
        card: "rx-5700-xt",
        what: "layers behind another, which fail a depth test",
        unit: "pixels/cycle",
        published: &[256.0],
        class: Class::C,
        source: seen(
            "AMD GCN white paper (2012), p. 12, of the architecture before: a block of 8x8 pixels per cycle in each of four pipelines",
        ),
        fault: &["traverse.hierarchical_z=false"],
        measure: hidden,
        ..ROP
    },
    Benchmark {
        name: "rop-rgba8",
        card: "mali-g57-mc2",
        what: "opaque layers of RGBA8",
        unit: "pixels/cycle",
        published: &[4.0],
        class: Class::A,
        source: seen("Arm GPU datasheet v7, p. 2, and libGPUInfo: two pixels a core and cycle"),
        fault: &["pipelines=1"],
        measure: |bench| Ok(vec![rate(bench, &Layers::plain(SMALL, Format::Rgba8Unorm))?]),
        ..ROP
    },
    Benchmark {
        name: "tile-writes",
        card: "mali-g57-mc2",
        what: "1 and 16 layers of noise: bytes of colour written",
        unit: "of the frame",
        published: &[1.0, 1.0],
        class: Class::A,
        source: seen("Arm GPU datasheet v7: tiles stay on the chip until they are done"),
        fault: &["sort=sort-middle"],
        measure: tile_writes,
        ..ROP
    },
    Benchmark {
        name: "color-32",
        what: "layers of one colour, 32 bits a pixel",
        published: &[3440.2],
        fault: &["memory.dram.burst_cycles=8"],
        because: Some(Because { what: "the controller of DRAM loses too little between bursts", off: 0.105 }),
        measure: |bench| Ok(vec![x700(bench, Fill::Color, 32)?]),
        ..X700
    },
    Benchmark {
        name: "depth-32",
        what: "layers of depth alone, 32 bits a pixel",
        published: &[3689.3],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        measure: |bench| Ok(vec![x700(bench, Fill::Depth, 32)?]),
        ..X700
    },
    Benchmark {
        name: "texture-32",
        what: "layers with one texture, 32 bits a pixel",
        published: &[2871.4],
        fault: &["memory.dram.burst_cycles=8"],
        measure: |bench| Ok(vec![x700(bench, Fill::Texture, 32)?]),
        ..X700
    },
    Benchmark {
        name: "blend-32",
        what: "blended layers with one texture, 32 bits a pixel",
        published: &[1713.8],
        fault: &["memory.dram.burst_cycles=8"],
        measure: |bench| Ok(vec![x700(bench, Fill::Blend, 32)?]),
        ..X700
    },
    Benchmark {
        name: "float-32",
        what: "layers with one texture of RGBA16F, 32 bits a pixel",
        published: &[1814.5],
        fault: &["texture.filters_per_cycle=1"],
        because: Some(Because { what: "what its filters take for 64 bits is not published apart from this", off: 0.538 }),
        measure: |bench| Ok(vec![x700(bench, Fill::Float, 32)?]),
        ..X700
    },
    Benchmark {
        name: "color-16",
        what: "layers of one colour, 16 bits a pixel",
        published: &[3701.9],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        measure: |bench| Ok(vec![x700(bench, Fill::Color, 16)?]),
        ..X700
    },
    Benchmark {
        name: "depth-16",
        what: "layers of depth alone, 16 bits a pixel",
        published: &[3701.9],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        quick: true,
        measure: |bench| Ok(vec![x700(bench, Fill::Depth, 16)?]),
        ..X700
    },
    Benchmark {
        name: "texture-16",
        what: "layers with one texture, 16 bits a pixel",
        published: &[3573.5],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        measure: |bench| Ok(vec![x700(bench, Fill::Texture, 16)?]),
        ..X700
    },
    Benchmark {
        name: "blend-16",
        what: "blended layers with one texture, 16 bits a pixel",
        published: &[2441.1],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        because: Some(Because { what: "the controller of DRAM loses too little between bursts", off: 0.359 }),
        measure: |bench| Ok(vec![x700(bench, Fill::Blend, 16)?]),
        ..X700
    },
    Benchmark {
        name: "float-16",
        what: "layers with one texture of RGBA16F, 16 bits a pixel",
        published: &[1814.5],
        fault: &["color.quads_per_cycle=1", "depth.quads_per_cycle=1", "memory.dram.burst_cycles=16"],
        because: Some(Because { what: "what its filters take for 64 bits is not published apart from this", off: 1.095 }),
        measure: |bench| Ok(vec![x700(bench, Fill::Float, 16)?]),
        ..X700
    },
];

/// A benchmark of Beyond3D's fill rates of the Radeon X700 XT.
const X700: Benchmark =
    Benchmark { card: "radeon-x700-xt", unit: "Mpixel/s", source: seen("Beyond3D 8/9, fill rates of the X700 XT"), ..ROP };

/// Edge of a target that the second level holds in every format, in pixels.
const SMALL: u32 = 256;

/// Edge of a target that it does not hold.
const BIG: u32 = 1024;

/// Bytes that the pins of a GeForce GTX 980 move in a cycle: 224.4 GB/s at 1,126 MHz.
const SHEET_PINS: f64 = 32.0 * 1753.0 * 4.0 / 1126.0;

const OPAQUE: [Format; 8] = [
    Format::Rg16Float,
    Format::Rgba16Float,
    Format::Rg32Float,
    Format::Rgba32Float,
    Format::Rg11b10Ufloat,
    Format::Rgb10a2Unorm,
    Format::R32Float,
    Format::Rgba8UnormSrgb,
];

const BLENDED: [Format; 7] = [
    Format::Rgba8Unorm,
    Format::Rg16Float,
    Format::Rgba16Float,
    Format::Rg32Float,
    Format::Rgba32Float,
    Format::Rg11b10Ufloat,
    Format::R32Float,
];

fn pixels(config: &Config) -> Vec<f64> {
    let quads = config.color.quads_per_cycle.min(config.traverse.quads_per_cycle);
    vec![4.0 * count(config.card.pipelines) * count(quads)]
}

/// Pixels of a layer in a cycle.
fn rate(bench: &Bench, layers: &Layers) -> Result<f64> {
    let pixels = f64::from(layers.edge * layers.edge);
    let lengths = if layers.edge > 512 { [2, 4] } else { [8, 24] };
    Ok(pixels / bench.slope(&|count| layers.trace(count), lengths)?)
}

/// Rates of formats, divided by that of opaque RGBA8.
fn formats(bench: &Bench, formats: &[Format], blend: Option<Blend>) -> Result<Vec<f64>> {
    let plain = rate(bench, &Layers::plain(SMALL, Format::Rgba8Unorm))?;
    let of = |&format: &Format| Ok(rate(bench, &Layers { blend, ..Layers::plain(SMALL, format) })? / plain);
    formats.iter().map(of).collect()
}

fn targets(bench: &Bench) -> Result<Vec<f64>> {
    let of = |targets: u32| {
        let colors: String = (0..targets).map(|_| "vec4f(0.25, 0.5, 0.75, 0.5), ").collect();
        let fragment =
            if targets == 1 { "return vec4f(0.25, 0.5, 0.75, 0.5);".into() } else { format!("return Out({colors});") };
        let formats = vec![Format::Rgba8Unorm; targets as usize];
        rate(bench, &Layers { formats, ..Layers::plain(SMALL, Format::Rgba8Unorm) }.shaded(fragment))
    };
    let one = of(1)?;
    [1, 2, 4].into_iter().map(|targets| Ok(one / of(targets)?)).collect()
}

/// Pixels per cycle with `samples` samples each.
fn samples(bench: &Bench, samples: u32) -> Result<f64> {
    let depth = Some((Format::Depth32Float, Compare::LessEqual));
    rate(bench, &Layers { samples, depth, ..Layers::plain(SMALL, Format::Rgba8Unorm) })
}

/// Pixels per cycle of layers that are as far as the first, and have to be nearer.
fn hidden(bench: &Bench) -> Result<Vec<f64>> {
    let depth = Some((Format::Depth32Float, Compare::Less));
    Ok(vec![rate(bench, &Layers { depth, ..Layers::plain(BIG, Format::Rgba8Unorm) })?])
}

/// A fragment stage whose colours differ without a pattern between cells of `x` by `y` pixels.
fn noise_of([x, y]: [f32; 2]) -> String {
    format!(
        "let cell = floor(at.xy / vec2f({x:?}, {y:?}));
         let v = fract(dot(cell, vec2f(0.0671105, 0.00583715)) * vec4f(52.98292, 97.13371, 31.71907, 71.55213));
         return fract(v * vec4f(917.131, 513.377, 731.557, 311.939));"
    )
}

fn noise() -> Layers {
    Layers::plain(BIG, Format::Rgba8Unorm).shaded(noise_of([1.0, 1.0]))
}

/// Bytes of DRAM in a pass.
fn moved(phase: &Phase) -> [f64; 2] {
    [phase.counts.dram.read_bytes, phase.counts.dram.write_bytes].map(|bytes| bytes as f64)
}

fn overdraw(bench: &Bench) -> Result<Vec<f64>> {
    let [read, written] = moved(&bench.last(&noise().trace(3))?);
    Ok(vec![(read + written) / written])
}

/// Pixels per cycle of a resolve, whose samples differ.
fn resolve(bench: &Bench) -> Result<Vec<f64>> {
    let fragment = noise_of([1.0, 1.0]).replace("at.xy", "(at.xy + f32(sample) * vec2f(17.0, 31.0))");
    let layers = Layers { samples: 4, ..Layers::plain(BIG, Format::Rgba8Unorm) }.shaded(fragment);
    let without = bench.last(&layers.trace(1))?.cycles;
    let with = bench.last(&Layers { resolve: true, ..layers }.trace(1))?.cycles;
    Ok(vec![f64::from(BIG * BIG) / (with - without)])
}

fn codec(bench: &Bench) -> Result<Vec<f64>> {
    let cells = [[1.0, 1.0], [2.0, 2.0], [4.0, 2.0], [4.0, 4.0], [8.0, 8.0]].map(noise_of);
    let gradient = "return vec4f(at.x / 512.0, at.y / 512.0, (at.x + at.y) / 1024.0, 1.0);".to_owned();
    let solid = "return vec4f(0.25, 0.5, 0.75, 0.5);".to_owned();
    let of = |fragment: String| {
        let phase = bench.last(&Layers::plain(512, Format::Rgba8Unorm).shaded(fragment).trace(1))?;
        Ok(color_bytes(&phase) / f64::from(4 * 512 * 512))
    };
    cells.into_iter().chain([gradient, solid]).map(of).collect()
}

/// Bytes of the colours of 1 and of 16 layers, divided by those of a frame.
fn tile_writes(bench: &Bench) -> Result<Vec<f64>> {
    let of = |layers: u32| {
        let phase = bench.last(&Layers::plain(512, Format::Rgba8Unorm).shaded(noise_of([1.0, 1.0])).trace(layers))?;
        Ok(color_bytes(&phase) / f64::from(4 * 512 * 512))
    };
    [1, 16].into_iter().map(of).collect()
}

/// Bytes that ROPs have written.
fn color_bytes(phase: &Phase) -> f64 {
    let color = phase.counts.clients.iter().filter(|client| client.0 == "color");
    color.map(|client| client.1.write_bytes).sum::<u64>() as f64
}

/// What Beyond3D's fill rates draw.
#[derive(Clone, Copy)]
enum Fill {
    Color,
    Depth,
    Texture,
    Blend,
    Float,
}

/// Millions of pixels per second.
fn x700(bench: &Bench, fill: Fill, bits: u32) -> Result<f64> {
    // Two bytes stand for R5G6B5.
    let color = if bits == 16 { Format::Rg8Unorm } else { Format::Rgba8Unorm };
    let depth = if bits == 16 { Format::Depth16Unorm } else { Format::Depth24Plus };
    let plain = Layers::plain(512, color);
    // A texture of 128x128 texels stretched over the target.
    let texture = |format| Layers {
        textures: vec![(format, 128, 1)],
        sampler: linear(),
        ..plain.clone().shaded("return textureSample(t0, s0, at.xy / 512.0);")
    };
    let layers = match fill {
        Fill::Color => plain,
        Fill::Depth => Layers { formats: Vec::new(), depth: Some((depth, Compare::LessEqual)), ..plain },
        Fill::Texture => texture(color),
        Fill::Blend => texture(color).blended(OVER),
        Fill::Float => texture(Format::Rgba16Float),
    };
    let cycles = bench.slope(&|count| layers.trace(count), [2, 6])?;
    Ok(f64::from(512 * 512) / cycles * f64::from(bench.config().card.clock_mhz))
}

/// A bilinear sampler that repeats.
fn linear() -> SamplerDesc {
    SamplerDesc {
        address: [AddressMode::Repeat; 3],
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        ..SamplerDesc::default()
    }
}

/// Millions of pixels per second of layers with a depth test that all pass and write.
fn old_fill(bench: &Bench, color: Format, depth: Format, textures: usize) -> Result<f64> {
    let sample = |n: usize| format!("c += textureSample(t{n}, s{n}, at.xy / 32.0);");
    let samples: String = (0..textures).map(sample).collect();
    let layers = Layers {
        depth: Some((depth, Compare::LessEqual)),
        textures: vec![(Format::Rgba8Unorm, 32, 1); textures],
        sampler: linear(),
        ..Layers::plain(512, color).shaded(format!("var c = vec4f(0.25, 0.5, 0.75, 0.5); {samples} return c;"))
    };
    let cycles = bench.slope(&|count| layers.trace(count), [1, 3])?;
    Ok(f64::from(512 * 512) / cycles * f64::from(bench.config().card.clock_mhz))
}
