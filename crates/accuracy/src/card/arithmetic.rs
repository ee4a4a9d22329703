//! Rates of instructions, and how warps and independent instructions hide latency.

use anyhow::Result;

use super::bench::Bench;
use super::recipes::{CHAIN, Chains};
use super::{Because, Benchmark, Class, Family, cores, count, seen, unconfirmed};
use machine::Config;

/// A benchmark of this family on the GeForce GTX 980.
const ARITHMETIC: Benchmark = Benchmark::of(Family::Arithmetic, Class::A);

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "alu-peak-fma",
        what: "64 warps a core, 8 chains of multiply-adds each",
        unit: "multiply-adds/cycle",
        published: &[2048.0],
        source: seen("NVIDIA, GeForce GTX 980 white paper, p. 7: 2,048 lanes"),
        formula: Some(peak),
        fault: &["core.float_lanes=64"],
        measure: |bench| Ok(vec![rate(bench, FULL, "f32", FMA)?]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-ilp",
        what: "a warp a scheduler, 1, 2, 4, 6 chains each",
        unit: "cycles/multiply-add",
        published: &[6.0, 3.0, 1.5, 1.0],
        class: Class::B,
        source: seen(
            "Jia et al. 2019: dependent issue 6; independent instructions of a warp overlap, as gpu-benches measures (V100)",
        ),
        formula: Some(|config| [1.0, 2.0, 4.0, 6.0].map(|k| (count(config.core.float_latency) / k).max(1.0)).to_vec()),
        fault: &["core.float_latency=12"],
        measure: |bench| independent(bench, &[1, 2, 4, 6]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-tlp",
        what: "4, 8, 16, 24, 32, 64 warps a core, one chain each",
        unit: "instructions/cycle and core",
        published: &[4.0 / 6.0, 8.0 / 6.0, 16.0 / 6.0, 4.0, 4.0, 4.0],
        source: seen("min(4, warps / 6): Volkov 2016 with the latency of Jia et al. 2019"),
        formula: Some(|config| {
            WARPS.map(|warps| (f64::from(warps) / count(config.core.float_latency)).min(count(config.core.issue))).to_vec()
        }),
        fault: &["core.issue=2"],
        measure: parallel,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-registers",
        what: "64 warps a core, one chain each, with 20, 52, 115, 235 further values alive",
        unit: "instructions/cycle and core",
        published: &[4.0, 4.0, 16.0 / 6.0, 8.0 / 6.0],
        class: Class::B,
        source: unconfirmed("CUDA occupancy, 5.2: 65,536 registers hold 64, 32, 16, 8 warps of 32, 64, 128, 255 registers"),
        fault: &["core.registers=32768"],
        measure: pressed,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-mad",
        what: "a product, product and sum, fma: time as a share of that of an instruction on 2,048 lanes",
        unit: "of an instruction",
        published: &[1.0, 1.0, 1.0],
        source: seen("azhirnov, GPU_Benchmarks.md: a multiply-add takes as long as a product on nine GPUs"),
        fault: &["core.issue=1"],
        measure: products,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-imad",
        what: "integer multiply-adds: rate as a share of fma's",
        unit: "of fma",
        published: &[0.29],
        class: Class::B,
        source: seen("clpeak, GTX 980 and GTX 960: 1,446 GIOPS of 4,921 GFLOPS, 816 of 2,793"),
        fault: &["core.float_lanes=64"],
        measure: |bench| Ok(vec![rate(bench, FULL, "u32", "X = X * y + 7u;")? / rate(bench, FULL, "f32", FMA)?]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-special",
        what: "exp2, log2, inverseSqrt",
        unit: "results/cycle",
        published: &[512.0, 512.0, 512.0],
        source: seen("CUDA C++ programming guide, arithmetic throughput: 32 a core of 5.2, a quarter of its multiply-adds"),
        formula: Some(special),
        fault: &["core.special_lanes=16"],
        measure: transcendental,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-mix",
        what: "four multiply-adds and an exp2; a multiply-add and an integer addition",
        unit: "cycles/warp and core",
        published: &[1.25, 0.5],
        class: Class::B,
        source: seen("Jia et al. 2019: four schedulers, one instruction each; all classes share their slots on Maxwell"),
        fault: &["core.issue=2"],
        because: Some(Because { what: "an exp2 costs two instructions beside its special function", off: 0.400 }),
        measure: mixed,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-peak-fma",
        card: "rx-5700-xt",
        what: "64 warps a core, 8 chains of multiply-adds each",
        unit: "multiply-adds/cycle",
        published: &[2560.0],
        source: seen("AMD, RDNA architecture white paper: 40 compute units of 64 lanes"),
        formula: Some(peak),
        fault: &["core.float_lanes=64"],
        measure: |bench| Ok(vec![rate(bench, FULL, "f32", FMA)?]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-special",
        card: "rx-5700-xt",
        what: "exp2, log2, inverseSqrt",
        unit: "results/cycle",
        published: &[640.0, 640.0, 640.0],
        source: seen("AMD, RDNA architecture white paper: a quarter of the rate of multiply-adds"),
        formula: Some(special),
        fault: &["core.special_lanes=16"],
        measure: transcendental,
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-ilp",
        card: "rx-5700-xt",
        what: "a warp a SIMD, 1 and 4 chains each",
        unit: "cycles/multiply-add",
        published: &[4.0, 1.0],
        source: seen(
            "Optimizing for RDNA (GPUOpen 2020): one multiply-add takes 4 cycles, four independent ones 7: one a cycle",
        ),
        formula: Some(|config| [1.0, 4.0].map(|k| (count(config.core.float_latency) / k).max(1.0)).to_vec()),
        fault: &["core.float_latency=6"],
        measure: |bench| independent(bench, &[1, 4]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-peak-fma",
        card: "mali-g57-mc2",
        what: "64 warps a core, 8 chains of multiply-adds each",
        unit: "multiply-adds/cycle",
        published: &[60.7 / 0.95],
        source: seen("azhirnov, GPU_Benchmarks.md: 60.7 G/s at 950 MHz"),
        formula: Some(peak),
        fault: &["core.float_lanes=16"],
        measure: |bench| Ok(vec![rate(bench, FULL, "f32", FMA)?]),
        ..ARITHMETIC
    },
    Benchmark {
        name: "alu-peak-fma",
        card: "gtx-titan",
        what: "64 warps a core, 8 chains of multiply-adds each",
        unit: "multiply-adds/cycle",
        published: &[0.81 * 2688.0],
        class: Class::B,
        source: seen("clpeak, K40c (GK110): 3,495 of 4,291 GFLOPS, 81 % of the lanes"),
        formula: Some(peak),
        fault: &["core.float_lanes=64"],
        because: Some(Because {
            what: "20 cores of 128 lanes, which four schedulers keep busy, stand for 14 of 192, which need dual issue",
            off: 0.176,
        }),
        measure: |bench| Ok(vec![rate(bench, FULL, "f32", FMA)?]),
        ..ARITHMETIC
    },
];

/// A multiply-add.
const FMA: &str = "X = fma(X, y, 1.5);";

/// Eight workgroups of eight warps for each core, with eight chains each.
const FULL: [u32; 3] = [8, 8, 8];

/// Warps of a core.
const WARPS: [u32; 6] = [4, 8, 16, 24, 32, 64];

fn peak(config: &Config) -> Vec<f64> {
    vec![cores(config) * count(config.core.float_lanes)]
}

fn special(config: &Config) -> Vec<f64> {
    vec![cores(config) * count(config.core.special_lanes); 3]
}

fn transcendental(bench: &Bench) -> Result<Vec<f64>> {
    ["X = exp2(X);", "X = log2(X);", "X = inverseSqrt(X);"].map(|step| rate(bench, FULL, "f32", step)).into_iter().collect()
}

/// Cycles that a step takes. Each core gets `groups` workgroups of `warps` warps, and each warp has `chains` chains.
fn step(bench: &Bench, [warps, groups, chains]: [u32; 3], of: &str, step: &str) -> Result<f64> {
    let core = &bench.config().core;
    let groups = groups * bench.config().card.pipelines * core.per_pipeline;
    let kernel = Chains { of, step, chains, held: 0, width: warps * core.warp_width, groups };
    // Long enough for the launch of all warps to be over before the first ends.
    let lengths = if chains > 1 { [64, 128] } else { [128, 384] };
    bench.slope(&|steps| kernel.trace(steps), lengths)
}

/// Steps of all lanes in a cycle.
fn rate(bench: &Bench, [warps, groups, chains]: [u32; 3], of: &str, what: &str) -> Result<f64> {
    let cycles = step(bench, [warps, groups, chains], of, what)?;
    Ok(f64::from(warps * groups * chains) * cores(bench.config()) * count(bench.config().core.warp_width) / cycles)
}

/// Cycles per operation with one warp on each scheduler of a core, for each number of chains in a warp.
fn independent(bench: &Bench, chains: &[u32]) -> Result<Vec<f64>> {
    let width = bench.config().core.issue * bench.config().core.warp_width;
    let of = |&chains: &u32| {
        let kernel = Chains { chains, width, ..CHAIN };
        Ok(bench.slope(&|steps| kernel.trace(steps), [32, 96])? / f64::from(chains))
    };
    chains.iter().map(of).collect()
}

fn parallel(bench: &Bench) -> Result<Vec<f64>> {
    let of = |warps: u32| Ok(f64::from(warps) / step(bench, [4, warps / 4, 1], "f32", FMA)?);
    WARPS.into_iter().map(of).collect()
}

/// Workgroups of four warps: as many at a time as registers allow.
fn pressed(bench: &Bench) -> Result<Vec<f64>> {
    let of = |held: u32| {
        let card = bench.config();
        let groups = 16 * card.card.pipelines * card.core.per_pipeline;
        let kernel = Chains { held, width: 4 * card.core.warp_width, groups, ..CHAIN };
        Ok(64.0 / bench.slope(&|steps| kernel.trace(steps), [64, 192])?)
    };
    [20, 52, 115, 235].into_iter().map(of).collect()
}

fn products(bench: &Bench) -> Result<Vec<f64>> {
    let of = |what| Ok(2048.0 / rate(bench, FULL, "f32", what)?);
    ["X = X * y;", "X = X * y + 1.5;", FMA].into_iter().map(of).collect()
}

fn mixed(bench: &Bench) -> Result<Vec<f64>> {
    let of = |what: &str| Ok(step(bench, FULL, "f32", what)? / 512.0);
    let special = format!("{}X = exp2(X);", FMA.repeat(4));
    let integer = format!("{FMA}X = bitcast<f32>(bitcast<u32>(X) + l);");
    [special, integer].iter().map(|what| of(what)).collect()
}
