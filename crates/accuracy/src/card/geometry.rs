//! Vertices, triangles and draws.

use anyhow::Result;

use super::bench::Bench;
use super::recipes::{Grid, Mesh};
use super::{Because, Benchmark, Class, Family, seen, unconfirmed};
use crate::scenes::kit::{Draw, Kit, Pass};
use gfx::format::Format;
use gfx::state::*;

/// A benchmark of this family on the GeForce GTX 980.
const GEOMETRY: Benchmark = Benchmark::of(Family::Geometry, Class::B);

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "tri-cull",
        what: "an indexed grid that faces away",
        unit: "triangles/cycle",
        published: &[8.0],
        source: unconfirmed("16 PolyMorph engines, half a primitive each; zeux 2023: two culled for one drawn is typical"),
        fault: &["assembly.primitives_per_cycle=2"],
        quick: true,
        measure: |bench| Ok(vec![triangles(bench, CULLED, IndexFormat::Uint16)?]),
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-draw",
        what: "an indexed grid of cells of 2x2 pixels",
        unit: "triangles/cycle",
        published: &[4.0],
        source: unconfirmed(
            "four raster engines; measured one each on an RTX 3090 (flanks devlog 0173: 70 to 76 ps, 7 engines)",
        ),
        fault: &["setup.interval=2"],
        quick: true,
        measure: |bench| Ok(vec![triangles(bench, DRAWN, IndexFormat::Uint16)?]),
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-size",
        what: "cells of 2, 4, 8, 16, 32 pixels",
        unit: "triangles/cycle",
        published: &[4.0, 4.0, 64.0 / 40.0, 64.0 / 144.0, 64.0 / 544.0],
        class: Class::Shape,
        source: seen("min(4 triangles, 64 pixels of the quads that they touch): GeForce GTX 980 white paper, p. 7"),
        fault: &["traverse.quads_per_cycle=1"],
        measure: sizes,
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-reuse",
        what: "indices 0, 1, 2 repeated to 96, 99, 384 indices",
        unit: "vertex invocations",
        published: &[3.0, 6.0, 12.0],
        class: Class::Exact,
        source: seen("Kerbl et al. 2018 (GTX 1080 Ti): batches of at most 96 indices share nothing"),
        fault: &["fetch.reuse=1"],
        measure: reused,
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-index",
        what: "the grid of tri-cull with indices of 32 bits",
        unit: "of the rate with 16 bits",
        published: &[1.0],
        class: Class::A,
        source: seen("12 bytes of indices per triangle are 96 of 199 bytes per cycle"),
        fault: &["fetch.index_lines=4"],
        because: Some(Because { what: "the fetch unit has one port of 64 bytes per cycle", off: -0.328 }),
        measure: |bench| {
            Ok(vec![triangles(bench, CULLED, IndexFormat::Uint32)? / triangles(bench, CULLED, IndexFormat::Uint16)?])
        },
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-attributes",
        what: "layers with 1, 2, 3, 4 interpolated vectors of four words",
        unit: "of the time with 4 vectors",
        published: &[0.5, 0.5, 0.75, 1.0],
        class: Class::Shape,
        source: unconfirmed(
            "special function units interpolate: 32 words per cycle in each of 16 multiprocessors, for 64 pixels of the ROPs",
        ),
        fault: &["interpolate.words_per_cycle=4"],
        because: Some(Because { what: "a quad takes whole cycles of interpolation, of 8 words each", off: 0.25 }),
        measure: attributes,
        ..GEOMETRY
    },
    Benchmark {
        name: "draws",
        what: "draws of 1, 16, 256 culled triangles of one mesh, same state",
        unit: "cycles/draw",
        published: &[8.0, 8.0, 32.0],
        class: Class::C,
        source: unconfirmed(
            "no drain between draws of one state: commands (command.command_cycles, assumed 8) or triangles (8 a cycle)",
        ),
        fault: &["command.command_cycles=64", "memory.port_latency=300"],
        measure: draws,
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-cull",
        card: "rx-5700-xt",
        what: "an indexed grid that faces away",
        unit: "triangles/cycle",
        published: &[8.0],
        source: seen("AMD, RDNA architecture white paper: four primitive units cull two each; quoted by zeux 2023"),
        fault: &["assembly.primitives_per_cycle=2"],
        measure: |bench| Ok(vec![triangles(bench, CULLED, IndexFormat::Uint16)?]),
        ..GEOMETRY
    },
    Benchmark {
        name: "tri-draw",
        card: "rx-5700-xt",
        what: "an indexed grid of cells of 2x2 pixels",
        unit: "triangles/cycle",
        published: &[4.0],
        source: seen("AMD, RDNA architecture white paper: four primitive units send one each"),
        fault: &["setup.interval=2"],
        quick: true,
        measure: |bench| Ok(vec![triangles(bench, DRAWN, IndexFormat::Uint16)?]),
        ..GEOMETRY
    },
];

const CULLED: CullMode = CullMode::Back;
const DRAWN: CullMode = CullMode::Front;

/// Triangles per cycle of a grid of cells of 2x2 pixels.
fn triangles(bench: &Bench, cull: CullMode, indices: IndexFormat) -> Result<f64> {
    let grid = Grid { cull, indices, ..Grid::plain(128, 256) };
    Ok(f64::from(2 * 128 * 128) / bench.slope(&|draws| grid.trace(draws), [1, 3])?)
}

fn sizes(bench: &Bench) -> Result<Vec<f64>> {
    let of = |size: u32| {
        let cells = 256 / size;
        let draws = if size > 4 { [4, 12] } else { [1, 3] };
        let grid = Grid { cull: DRAWN, ..Grid::plain(cells, 256) };
        Ok(f64::from(2 * cells * cells) / bench.slope(&|draws| grid.trace(draws), draws)?)
    };
    [2, 4, 8, 16, 32].into_iter().map(of).collect()
}

fn reused(bench: &Bench) -> Result<Vec<f64>> {
    let of = |indices: u32| {
        let mesh = Mesh {
            positions: vec![[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0]],
            indices: (0..indices).map(|n| n % 3).collect(),
            format: IndexFormat::Uint16,
        };
        let phase = bench.last(&mesh.trace(16, CullMode::None, "return vec4f(1.0);", &[[0, indices / 3]]))?;
        Ok(phase.counts.funnel.vertices_shaded as f64)
    };
    [96, 99, 384].into_iter().map(of).collect()
}

/// The time of layers with 1, 2, 3, 4 interpolated vectors, divided by that of the last.
fn attributes(bench: &Bench) -> Result<Vec<f64>> {
    let of = |vectors: usize| {
        let each = |of: &dyn Fn(usize) -> String| (0..vectors).map(of).collect::<String>();
        let fields = each(&|n| format!("@location({n}) v{n}: vec4f, "));
        let values = each(&|n| format!(", c * {}.0", n + 1));
        let sum = (0..vectors).map(|n| format!("v.v{n}")).collect::<Vec<_>>().join(" + ");
        let source = format!(
            "struct V {{ @builtin(position) at: vec4f, {fields} }}
             @vertex fn vs(@builtin(vertex_index) i: u32) -> V {{
                 let c = vec4f(f32(i & 1u), f32(i >> 1u), 0.5, 1.0);
                 return V(vec4f(c.xy * 4.0 - 1.0, 0.5, 1.0){values});
             }}
             @fragment fn fs(v: V) -> @location(0) vec4f {{ return {sum}; }}"
        );
        bench.slope(
            &|layers| {
                let mut kit = Kit::new("attributes");
                let target = kit.target("target", [256, 256], Format::Rgba8Unorm);
                let mut draw = Draw::list(source.clone(), 0, Vec::new()).count(3);
                draw.instances = layers;
                kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[draw]);
                kit.finish()
            },
            [8, 24],
        )
    };
    let times = [1, 2, 3, 4].into_iter().map(of).collect::<Result<Vec<f64>>>()?;
    Ok(times.iter().map(|time| time / times[3]).collect())
}

fn draws(bench: &Bench) -> Result<Vec<f64>> {
    let of = |triangles: u32| {
        let grid = Grid { cull: CULLED, ..Grid::plain(64, 128) };
        bench.slope(&|draws| grid.parts(draws, triangles), [64, 320])
    };
    [1, 16, 256].into_iter().map(of).collect()
}
