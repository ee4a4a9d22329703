//! Anti-aliasing: passes that are moved by fractions of a pixel and summed, beside the card's own samples.

use std::f64::consts::{FRAC_1_SQRT_2, TAU};

use anyhow::Result;

use super::kit::{ADD, Draw, Kit, Pass};
use super::{Image, Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use trace::Trace;
use trace::record;

pub(super) const EDGES: Scene = Scene {
    name: "edges",
    group: "Sampling",
    what: "4,096 edges of all directions within sqrt(1/2) pixel of a centre, drawn in passes that are moved and summed (1, 2x2, 4x4, 16 jittered, Quincunx) and with the \
           card's four rotated samples: the RMS error of their coverage is the constant of each, +-2 %, and a nearly horizontal edge has 2, 3 and 5 greys with 1, 2x2 \
           and rotated samples.",
    fault: "edges are half as far apart from the centre",
    play,
};

const CELLS: u32 = 64;
const SIZE: [u32; 2] = [4 * CELLS; 2];

/// The place of an edge by its number: its direction, and its distance from the centre of its pixel.
fn edge(column: u32, row: u32) -> [f64; 2] {
    [
        TAU * (f64::from(column) + 0.5) / f64::from(CELLS),
        FRAC_1_SQRT_2 * (2.0 * (f64::from(row) + 0.5) / f64::from(CELLS) - 1.0),
    ]
}

/// The area of the unit square around 0 on the side n.p < d, n at an angle: a polygon clipped by a line.
fn coverage([angle, d]: [f64; 2]) -> f64 {
    let n = [libm::cos(angle), libm::sin(angle)];
    let square = [[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]];
    let side = |p: [f64; 2]| d - n[0] * p[0] - n[1] * p[1];
    let mut kept: Vec<[f64; 2]> = Vec::new();
    for k in 0..4 {
        let (from, to) = (square[k], square[(k + 1) % 4]);
        let (a, b) = (side(from), side(to));
        if a >= 0.0 {
            kept.push(from);
        }
        if (a < 0.0) != (b < 0.0) {
            kept.push([0, 1].map(|c| from[c] + a / (a - b) * (to[c] - from[c])));
        }
    }
    let cross = |k: usize| kept[k][0] * kept[(k + 1) % kept.len()][1] - kept[(k + 1) % kept.len()][0] * kept[k][1];
    (0..kept.len()).map(cross).sum::<f64>() / 2.0
}

/// An edge in each cell of 4 by 4 pixels, as a rectangle that reaches one pixel and a half to the other side. `shift.xy` is the sample's place, `shift.z` is how far a jitter
/// moves it, `shift.w` the seed; `shape.x` is 1 for nearly horizontal edges, `shape.y` the weight.
const SOURCE: &str = "
@group(0) @binding(0) var<uniform> u: array<vec4f, 2>;
fn hash(seed: u32) -> f32 {
    var x = seed;
    x ^= x >> 16u; x *= 0x7feb352du; x ^= x >> 15u; x *= 0x846ca68bu; x ^= x >> 16u;
    return f32(x >> 8u) / 16777216.0 - 0.5;
}
@vertex fn vs(@builtin(vertex_index) i: u32, @builtin(instance_index) cell: u32) -> @builtin(position) vec4f {
    let column = cell % 64u;
    let row = cell / 64u;
    var angle = 6.2831853 * (f32(column) + 0.5) / 64.0;
    if u[1].x > 0.5 { angle = 1.5707963 + 0.001; }
    let d = SPREAD * (2.0 * (f32(row) + 0.5) / 64.0 - 1.0);
    let n = vec2f(cos(angle), sin(angle));
    let t = vec2f(-n.y, n.x);
    let a = f32(i & 1u) * 2.4 - 1.2;
    let b = select(d, -1.2, i == 1u || i == 2u || i == 4u);
    let along = array(-1.2, -1.2, 1.2, -1.2, 1.2, 1.2);
    let across = array(d, -1.2, -1.2, d, -1.2, d);
    let p = n * across[i] + t * along[i];
    let seed = cell * 32u + u32(u[0].w) * 2u;
    let jitter = u[0].z * vec2f(hash(seed), hash(seed + 1u));
    let at = vec2f(f32(column), f32(row)) * 4.0 + 1.5 + p - u[0].xy - jitter;
    return vec4f(at / 128.0 - 1.0, 0.5, 1.0) * vec4f(1.0, -1.0, 1.0, 1.0);
}
@fragment fn fs() -> @location(0) vec4f { return vec4f(u[1].y); }";

fn source(fault: bool) -> String {
    let unused = "    let a = f32(i & 1u) * 2.4 - 1.2;\n    let b = select(d, -1.2, i == 1u || i == 2u || i == 4u);\n";
    SOURCE.replace(unused, "").replace("SPREAD", if fault { "0.35355339" } else { "0.70710678" })
}

/// Samples: place, how far they are jittered, weight.
type Samples = Vec<([f32; 2], f32, f32)>;

fn grid(n: u32, jitter: f32) -> Samples {
    let place = |k: u32| (k as f32 + 0.5) / n as f32 - 0.5;
    (0..n * n).map(|k| ([place(k % n), place(k / n)], jitter, 1.0 / (n * n) as f32)).collect()
}

fn quincunx() -> Samples {
    let corners = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]].map(|corner| (corner, 0.0, 0.125));
    [vec![([0.0, 0.0], 0.0, 0.5)], corners.to_vec()].concat()
}

fn moved(samples: &Samples, fault: bool, horizontal: bool) -> Trace {
    let mut kit = Kit::new("edges");
    let target = kit.target("sum", SIZE, Format::R16Float);
    let draws: Vec<Draw> = (0..)
        .zip(samples)
        .map(|(number, &([x, y], jitter, weight))| {
            let numbers =
                kit.numbers("sample", &[x, y, jitter, number as f32, f32::from(u8::from(horizontal)), weight, 0.0, 0.0]);
            let draw = Draw::list(source(fault), 0, Vec::new()).count(6).with([numbers]).blend(ADD);
            Draw { instances: CELLS * CELLS, ..draw }
        })
        .collect();
    kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &draws);
    kit.present(target);
    kit.finish()
}

fn rotated(fault: bool, horizontal: bool) -> Trace {
    let mut kit = Kit::new("edges");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let samples = kit.texture("samples", record::texture_multisampled(SIZE[0], SIZE[1], 4, Format::Rgba8Unorm));
    let numbers = kit.numbers("sample", &[0.0, 0.0, 0.0, 0.0, f32::from(u8::from(horizontal)), 1.0, 0.0, 0.0]);
    let draw = Draw::list(source(fault), 0, Vec::new()).count(6).with([numbers]);
    let pass = Pass { color: vec![(samples, Some([0.0; 4]))], resolve: Some(target), ..Pass::default() };
    kit.pass(&pass, &[Draw { instances: CELLS * CELLS, ..draw }]);
    kit.present(target);
    kit.finish()
}

/// A half float of at least 2^-14 or 0.
fn half(code: u16) -> f64 {
    let [exponent, fraction] = [code >> 10 & 31, code & 1023].map(f64::from);
    if code == 0 { 0.0 } else { libm::ldexp(1.0 + fraction / 1024.0, exponent as i32 - 15) }
}

fn value(image: &Image, column: u32, row: u32) -> f64 {
    let pixel = ((4 * row + 1) * SIZE[0] + 4 * column + 1) as usize;
    match image.surface.format {
        Format::R16Float => half(u16::from_le_bytes([image.bytes[2 * pixel], image.bytes[2 * pixel + 1]])),
        _ => f64::from(image.bytes[4 * pixel]) / 255.0,
    }
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let fault = stage.fault();
    let four = rotated(fault, false);
    let picture = stage.show(&four)?;
    let rms = |image: &Image| {
        let cells = (0..CELLS).flat_map(|row| (0..CELLS).map(move |column| (column, row)));
        let sum: f64 = cells.map(|(column, row)| (value(image, column, row) - coverage(edge(column, row))).powi(2)).sum();
        (sum / f64::from(CELLS * CELLS)).sqrt()
    };
    let greys = |image: &Image| {
        let mut seen: Vec<u64> = (0..CELLS).map(|row| (value(image, 0, row) * 1e4) as u64).collect();
        seen.sort_unstable();
        seen.dedup();
        seen.len() as f64
    };
    let methods = [
        ("1", grid(1, 0.0), 0.234, Some(2.0)),
        ("2x2", grid(2, 0.0), 0.082, Some(3.0)),
        ("4x4", grid(4, 0.0), 0.029, None),
        ("16 jittered", grid(4, 0.25), 0.043, None),
        ("Quincunx", quincunx(), 0.116, None),
    ];
    for (name, samples, constant, levels) in &methods {
        let image = stage.frames(&moved(samples, fault, false))?;
        stage.row(Row::within(format!("RMS error of coverage, {name}"), *constant, rms(&image[0]), 0.02 * constant));
        if let Some(levels) = levels {
            let image = stage.frames(&moved(samples, fault, true))?;
            stage.row(Row::exact(format!("greys of a nearly horizontal edge, {name}"), *levels, greys(&image[0])));
        }
    }
    stage.row(Row::within("RMS error of coverage, rotated four", 0.087, rms(&picture[0]), 0.02 * 0.087));
    let image = stage.frames(&rotated(fault, true))?;
    stage.row(Row::exact("greys of a nearly horizontal edge, rotated four", 5.0, greys(&image[0])));
    if !fault {
        let passes = stage.time(&moved(&methods[1].1, false, false), &[])?.0;
        let samples = stage.time(&four, &[])?.0;
        stage.row(Row::at_least("cycles of four moved passes over those of four samples", 1.0, passes / samples));
        stage.answer(
            "Moved passes or multisampling?",
            format!("Four moved passes take {passes} cycles, four samples {samples}."),
        );
    }
    Ok(())
}
