//! Latencies by pointer chase, and of dependent instructions.

use anyhow::Result;

use super::bench::Bench;
use super::recipes::{CHAIN, Chains, Data, chase, dispatch, ring};
use super::{Because, Benchmark, Class, Family, count, seen, unconfirmed};

/// A benchmark of this family on the GeForce GTX 980.
const LATENCY: Benchmark = Benchmark { unit: "cycles", ..Benchmark::of(Family::Latency, Class::B) };

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "lat-l1",
        what: "one invocation follows a ring of 4 KB",
        published: &[82.0],
        source: seen("Jia et al. 2019 (arXiv 1903.07486), table 3.1, M60 (GM204)"),
        fault: &["texture.latency=40"],
        quick: true,
        measure: first_level,
        ..LATENCY
    },
    Benchmark {
        name: "lat-l2",
        what: "a ring of 512 KB in random order, 128 bytes apart",
        published: &[207.0],
        source: seen("Jia et al. 2019, table 3.1, M60: about 207"),
        fault: &["memory.l2.latency=10"],
        quick: true,
        measure: second_level,
        ..LATENCY
    },
    Benchmark {
        name: "lat-dram",
        what: "a ring of 16 MB in random order, one access a row",
        published: &[368.0],
        source: seen("PPT-GPU hardware/ISA/Maxwell.py: 379, by texture 357; their mean"),
        fault: &["memory.dram.t_rcd=200"],
        measure: dram,
        ..LATENCY
    },
    Benchmark {
        name: "lat-dram-gap",
        what: "lat-dram less lat-l2",
        published: &[110.0],
        class: Class::C,
        source: seen(
            "differences on four generations, 89 to 129: Jia et al. 2019, PPT-GPU, Abdelkhalik et al. 2022 (arXiv 2208.11174)",
        ),
        fault: &["memory.dram.t_rcd=200"],
        because: Some(Because {
            what: "hits of 207 and accesses of 357 cycles are from two groups; where one group gives both, they are nearer",
            off: 0.477,
        }),
        measure: gap,
        ..LATENCY
    },
    Benchmark {
        name: "lat-tlb",
        what: "steps of 2 MB through 256 MB, less the same through 64 MB",
        published: &[616.0 - 296.0],
        class: Class::C,
        source: seen(
            "Jia et al. 2019, fig. 3.5, T4: 296 cycles where a TLB has the page, 616 where none has; table 3.1, M60: TLBs cover 2 and 128 MB",
        ),
        fault: &["memory.tlb.second_entries=256"],
        measure: |bench| Ok(vec![stepped(bench, 256)? - stepped(bench, 64)?]),
        ..LATENCY
    },
    Benchmark {
        name: "lat-shared",
        what: "a ring of 1 KB in workgroup memory",
        published: &[23.0],
        source: seen("Jia et al. 2019, table 3.1, M60"),
        fault: &["core.integer_latency=40"],
        because: Some(Because {
            what: "an index costs two integer instructions before the access, its scale and its bound",
            off: 0.522,
        }),
        measure: shared,
        ..LATENCY
    },
    Benchmark {
        name: "lat-constant",
        what: "rings of 1, 16 and 64 KB in a uniform buffer",
        published: &[25.0, 81.0, 221.0],
        source: seen("Jia et al. 2019, table 3.1, M60: constant caches L1, L1.5, L2"),
        fault: &["constant.latency=40"],
        quick: true,
        measure: constant,
        ..LATENCY
    },
    Benchmark {
        name: "lat-special",
        what: "a chain of inverseSqrt",
        published: &[14.0],
        source: seen("Jia et al. 2019, table 4.1, Maxwell: MUFU about 14"),
        formula: Some(|config| vec![count(config.core.special_latency)]),
        fault: &["core.special_latency=20"],
        quick: true,
        measure: |bench| dependent(bench, Chains { step: "X = inverseSqrt(X);", ..CHAIN }),
        ..LATENCY
    },
    Benchmark {
        name: "lat-fma",
        what: "a chain of multiply-adds",
        published: &[6.0],
        class: Class::A,
        source: seen("Jia et al. 2019, table 4.1, Maxwell: FFMA 6"),
        formula: Some(|config| vec![count(config.core.float_latency)]),
        fault: &["core.float_latency=9"],
        measure: |bench| dependent(bench, CHAIN),
        ..LATENCY
    },
    Benchmark {
        name: "lat-iadd",
        what: "a chain of integer additions",
        published: &[6.0],
        class: Class::A,
        source: seen("Jia et al. 2019, table 4.1, Maxwell: IADD 6"),
        formula: Some(|config| vec![count(config.core.integer_latency)]),
        fault: &["core.integer_latency=9"],
        quick: true,
        measure: |bench| dependent(bench, Chains { of: "u32", step: "X = X + y;", ..CHAIN }),
        ..LATENCY
    },
    Benchmark {
        name: "lat-imul",
        what: "a chain of integer multiplications",
        published: &[86.0],
        source: seen("Jia et al. 2019, table 4.1, Maxwell: IMUL and IMAD about 86, made of XMADs"),
        fault: &["core.multiply_latency=43"],
        measure: |bench| dependent(bench, Chains { of: "u32", step: "X = X * y;", ..CHAIN }),
        ..LATENCY
    },
    Benchmark {
        name: "lat-l1",
        card: "gtx-titan",
        what: "one invocation follows a ring of 4 KB",
        published: &[35.0],
        source: seen("Jia et al. 2019, table 3.1, K80 (GK210)"),
        fault: &["texture.latency=60"],
        quick: true,
        measure: first_level,
        ..LATENCY
    },
    Benchmark {
        name: "lat-l2",
        card: "gtx-titan",
        what: "a ring of 512 KB in random order, 128 bytes apart",
        published: &[200.0],
        source: seen("Jia et al. 2019, table 3.1, K80: about 200"),
        fault: &["memory.l2.latency=10"],
        quick: true,
        measure: second_level,
        ..LATENCY
    },
    Benchmark {
        name: "lat-shared",
        card: "gtx-titan",
        what: "a ring of 1 KB in workgroup memory",
        published: &[26.0],
        source: seen("Jia et al. 2019, table 3.1, K80"),
        fault: &["core.integer_latency=40"],
        because: Some(Because {
            what: "an index costs two integer instructions before the access, its scale and its bound",
            off: 0.577,
        }),
        measure: shared,
        ..LATENCY
    },
    Benchmark {
        name: "lat-constant",
        card: "gtx-titan",
        what: "rings of 1, 16 and 64 KB in a uniform buffer",
        published: &[30.0, 92.0, 220.0],
        source: seen("Jia et al. 2019, table 3.1, K80: constant caches L1, L1.5, L2"),
        fault: &["constant.second_latency=40"],
        measure: constant,
        ..LATENCY
    },
    Benchmark {
        name: "lat-fma",
        card: "gtx-titan",
        what: "a chain of multiply-adds",
        published: &[9.0],
        class: Class::A,
        source: unconfirmed("Kepler's dependent issue, 9 cycles"),
        formula: Some(|config| vec![count(config.core.float_latency)]),
        fault: &["core.float_latency=12"],
        measure: |bench| dependent(bench, CHAIN),
        ..LATENCY
    },
];

/// Cycles of a step of a chase.
fn followed(bench: &Bench, ring: &Data, steps: [u32; 2]) -> Result<f64> {
    bench.slope(&|steps| chase(ring, steps), steps)
}

/// The first round misses: both lengths have it.
fn first_level(bench: &Bench) -> Result<Vec<f64>> {
    Ok(vec![followed(bench, &ring(4096, 64, false), [128, 384])?])
}

/// The upload of the ring has left it in the second level. The first level has none of it, and a chase visits no line twice.
fn second_level(bench: &Bench) -> Result<Vec<f64>> {
    Ok(vec![followed(bench, &ring(512 << 10, 128, true), [64, 320])?])
}

/// Of the uploaded ring the second level has the end, and the chase is at its beginning nearly always.
fn dram(bench: &Bench) -> Result<Vec<f64>> {
    Ok(vec![followed(bench, &ring(16 << 20, 8192 + 256, false), [64, 320])?])
}

/// Cycles of a dependent load of one invocation that goes through a buffer of zeros in steps of 2 MB and two rows, by the buffer's MB. No line is
/// visited twice.
fn stepped(bench: &Bench, megabytes: u32) -> Result<f64> {
    let (words, step) = (megabytes << 18, (2 << 18) + 1056);
    let trace = |steps: u32| {
        let source = format!(
            "@group(0) @binding(0) var<storage, read> a: array<u32>;
             @group(0) @binding(1) var<storage, read_write> out: array<u32>;
             @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 var p = id.x;
                 {} out[id.x] = p;
             }}",
            format!("p = (p + a[p] + {step}) & {};\n", words - 1).repeat(steps as usize)
        );
        dispatch(&source, &[Data::Zeroed(u64::from(words) * 4), Data::Zeroed(256)], 1)
    };
    bench.slope(&trace, [64, 320])
}

fn gap(bench: &Bench) -> Result<Vec<f64>> {
    Ok(vec![dram(bench)?[0] - second_level(bench)?[0]])
}

/// Cycles of a step of a chain in one warp.
fn dependent(bench: &Bench, chains: Chains<'_>) -> Result<Vec<f64>> {
    Ok(vec![bench.slope(&|steps| chains.trace(steps), [64, 320])?])
}

/// The lanes of a warp follow neighbours, which lie in different banks.
fn shared(bench: &Bench) -> Result<Vec<f64>> {
    let trace = |steps: u32| {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             var<workgroup> a: array<u32, 256>;
             @compute @workgroup_size(32) fn main(@builtin(local_invocation_index) l: u32) {{
                 for (var i = l; i < 256; i += 32) {{ a[i] = (i + 32) & 255; }}
                 workgroupBarrier();
                 var p = l;
                 {} out[l] = p;
             }}",
            "p = a[p];\n".repeat(steps as usize)
        );
        dispatch(&source, &[Data::Zeroed(256)], 1)
    };
    Ok(vec![bench.slope(&trace, [64, 320])?])
}

/// Rings that the first constant cache holds, that the second holds, and that neither holds.
fn constant(bench: &Bench) -> Result<Vec<f64>> {
    let of = |bytes: u32, steps: [u32; 2]| {
        // Indices of vectors.
        let Data::Words(words) = ring(bytes, 256, false) else { unreachable!("a ring has words") };
        let ring = Data::Words(words.into_iter().map(|index| index / 4).collect());
        let trace = |steps: u32| {
            let source = format!(
                "@group(0) @binding(0) var<uniform> a: array<vec4u, {}>;
                 @group(0) @binding(1) var<storage, read_write> out: array<u32>;
                 @compute @workgroup_size(1) fn main(@builtin(global_invocation_id) id: vec3u) {{
                     var p = id.x;
                     {} out[id.x] = p;
                 }}",
                bytes / 16,
                "p = a[p].x;\n".repeat(steps as usize)
            );
            dispatch(&source, &[ring.clone(), Data::Zeroed(256)], 1)
        };
        bench.slope(&trace, steps)
    };
    Ok(vec![of(1 << 10, [64, 256])?, of(16 << 10, [128, 384])?, of(64 << 10, [16, 240])?])
}
