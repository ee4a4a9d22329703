//! Bytes that loads and stores move: DRAM, the second level, coalescing, banks.

use anyhow::Result;

use super::bench::Bench;
use super::recipes::{Data, dispatch};
use super::{Because, Benchmark, Class, Family, seen, unconfirmed};

/// A benchmark of this family on the GeForce GTX 980.
const MEMORY: Benchmark = Benchmark::of(Family::Memory, Class::B);

pub(super) const BENCHMARKS: &[Benchmark] = &[
    Benchmark {
        name: "bw-dram-read",
        what: "a stream of loads of 16 bytes",
        unit: "of the pins",
        published: &[0.91],
        // 78 % of the data sheet's 224 and 112 GB/s would be of a clock that the cards do not have in these measurements.
        source: seen(
            "clpeak, GTX 980: 174.8 GB/s of 192, GTX 960: 87.2 of 96: drivers lower the memory of both to 6.01 Gbit/s for compute \
             (github.com/ihaque/memtestG80 issue 2); GTX 750, which is not lowered: 72.3 of 80.2",
        ),
        fault: &["memory.dram.t_rfc=600"],
        measure: |bench| Ok(vec![streamed(bench, Stream::Read)? / bench.pins()]),
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-copy",
        what: "a stream of loads and stores of 16 bytes",
        unit: "of bw-dram-read",
        published: &[0.88],
        source: seen("gpu-benches: V100 788 of 890 GB/s, H100 1,704 of 1,942"),
        fault: &["memory.dram.t_wtr=200"],
        measure: |bench| Ok(vec![streamed(bench, Stream::Copy)? / streamed(bench, Stream::Read)?]),
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-write",
        what: "a stream of stores of 16 bytes",
        unit: "of bw-dram-read",
        published: &[0.99],
        class: Class::C,
        source: seen("gpu-benches, H100: reads 95 %, writes 99 % of the pins; others 0.93 to 1.05"),
        fault: &["memory.dram.banks=1", "memory.dram.t_wr=400"],
        measure: |bench| Ok(vec![streamed(bench, Stream::Write)? / streamed(bench, Stream::Read)?]),
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-occupancy",
        what: "loads of 8 bytes, one under way per thread, 4, 8, 16, 32, 64 warps a core",
        unit: "of 64 warps",
        published: &[228.0 / 879.0, 419.0 / 879.0, 681.0 / 879.0, 834.0 / 879.0, 1.0],
        class: Class::Shape,
        source: seen("gpu-benches, V100: 228, 419, 681, 834, 879 GB/s; both cards fill their pins with a quarter of the warps"),
        fault: &["memory.dram.cl=400"],
        measure: |bench| hidden(bench, 1),
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-unrolled",
        what: "the same, eight loads under way per thread",
        unit: "of 64 warps",
        published: &[800.0 / 886.0, 875.0 / 886.0, 1.0, 1.0, 1.0],
        class: Class::Shape,
        source: seen("gpu-benches, V100: 800, 875, 886 GB/s with 4, 8, 16 warps"),
        fault: &["memory.dram.cl=800"],
        measure: |bench| hidden(bench, 8),
        ..MEMORY
    },
    Benchmark {
        name: "bw-random",
        what: "loads of 4 bytes at random places of 64 MB",
        unit: "loads/cycle",
        published: &[8.0 / 11.0 * 1753.0 / 1126.0 * (1.0 - 114.0 / 3330.0)],
        source: seen("JESD212: an activation per channel in t_RRD (6 ns), less refresh"),
        fault: &["memory.dram.t_rrd=22"],
        measure: |bench| random(bench),
        ..MEMORY
    },
    Benchmark {
        name: "bw-stride",
        what: "loads of 4 bytes, 4, 8, 16, 32, 64, 128 bytes apart",
        unit: "useful bytes per byte of DRAM",
        published: &[1.0, 0.5, 0.25, 0.125, 0.125, 0.125],
        class: Class::A,
        source: seen("Jia et al. 2019, table 3.1: 32 bytes are loaded at least"),
        fault: &["texture.sector_bytes=64"],
        measure: strided,
        ..MEMORY
    },
    Benchmark {
        name: "bw-l2",
        what: "half of the second level read by all cores, each part by another core in each round",
        unit: "bytes/cycle",
        published: &[446.0 / 1.177],
        source: seen("Jia et al. 2019, table 3.4, M60: 446 GB/s at 1,177 MHz"),
        fault: &["memory.l2.width=16"],
        because: Some(Because { what: "the network between cores and slices loses nothing", off: 0.354 }),
        measure: second_level,
        ..MEMORY
    },
    Benchmark {
        name: "load-coalescing",
        what: "loads of a warp from the first level, 1, 2, 4, 8, 16, 32 words apart",
        unit: "times as long as 1 word apart",
        published: &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0],
        source: unconfirmed(
            "CUDA C++ best practices: a warp's load takes a transaction for each line of 128 bytes that it touches",
        ),
        fault: &["texture.accesses_per_cycle=4"],
        measure: coalesced,
        ..MEMORY
    },
    Benchmark {
        name: "shared-banks",
        what: "loads of a warp from workgroup memory, 1, 2, 4, 8, 16, 32 words apart",
        unit: "times as long as 1 word apart",
        published: &[1.0, 2.0, 4.0, 8.0, 16.0, 32.0],
        source: unconfirmed(
            "CUDA C++ programming guide, 5.x: 32 banks of 4 bytes, an access for each word in the fullest bank",
        ),
        fault: &["core.shared_banks=8"],
        measure: banked,
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-read",
        card: "gtx-titan",
        what: "a stream of loads of 16 bytes",
        unit: "of the pins",
        published: &[0.76],
        source: seen("clpeak, K40c (GK110): 218.5 of 288 GB/s"),
        fault: &["memory.dram.t_refi=0"],
        because: Some(Because { what: "the controller of DRAM loses too little between bursts", off: 0.237 }),
        measure: |bench| Ok(vec![streamed(bench, Stream::Read)? / bench.pins()]),
        ..MEMORY
    },
    Benchmark {
        name: "bw-dram-read",
        card: "mali-g57-mc2",
        what: "a stream of loads of 16 bytes",
        unit: "of the pins",
        published: &[14.2 / 17.07],
        source: seen("azhirnov, GPU_Benchmarks.md: 14.2 of 17.07 GB/s"),
        fault: &["memory.dram.t_rfc=4000"],
        measure: |bench| Ok(vec![streamed(bench, Stream::Read)? / bench.pins()]),
        ..MEMORY
    },
    Benchmark {
        name: "bw-l2",
        card: "mali-g57-mc2",
        what: "half of the second level read by all cores, each part by another core in each round",
        unit: "bytes/cycle",
        published: &[47.0 / 0.95],
        source: seen("azhirnov, GPU_Benchmarks.md: 45 to 49 GB/s of L2 at 950 MHz"),
        fault: &["memory.l2.width=8"],
        because: Some(Because { what: "the network between cores and slices loses nothing", off: 0.294 }),
        measure: second_level,
        ..MEMORY
    },
];

/// What a stream does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Stream {
    Read,
    Write,
    Copy,
}

/// Bytes of a workgroup's part of a stream.
const PART: u32 = 256 * 16;

/// Bytes per cycle of a stream that is far larger than the second level: what lies in that at its end, lies there at both lengths.
fn streamed(bench: &Bench, stream: Stream) -> Result<f64> {
    let body = match stream {
        Stream::Read => "let v = a[i]; if (v.x == 12345u) { out[0] = v; }",
        Stream::Write => "out[i] = vec4u(i);",
        Stream::Copy => "out[i] = a[i];",
    };
    let input = "@group(0) @binding(1) var<storage, read> a: array<vec4u>;";
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> out: array<vec4u>;
         {}
         @compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3u) {{ let i = id.x; {body} }}",
        if stream == Stream::Write { "" } else { input }
    );
    let trace = |groups: u32| {
        let whole = Data::Zeroed(u64::from(PART * groups));
        let buffers = match stream {
            Stream::Read => vec![Data::Zeroed(256), whole],
            Stream::Write => vec![whole],
            Stream::Copy => vec![whole.clone(), whole],
        };
        dispatch(&source, &buffers, groups)
    };
    let moved = if stream == Stream::Copy { 2.0 } else { 1.0 };
    Ok(moved * f64::from(PART) / bench.slope(&trace, [1280, 3328])?)
}

/// Rates with `loads` loads of each thread in flight, as shares of the rate with all warps.
fn hidden(bench: &Bench, loads: u32) -> Result<Vec<f64>> {
    let card = bench.config();
    let cores = card.card.pipelines * card.core.per_pipeline;
    let rate = |warps: u32| -> Result<f64> {
        let threads = 128 * (warps / 4) * cores;
        let each = |of: &dyn Fn(u32) -> String| (0..loads).map(of).collect::<String>();
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @group(0) @binding(1) var<storage, read> a: array<vec2u>;
             @compute @workgroup_size(128) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 var s = 0u;
                 for (var i = id.x; i < arrayLength(&a); i += {}) {{
                     {} s += 0{};
                 }}
                 if (s == 12345u) {{ out[0] = s; }}
             }}",
            threads * loads,
            each(&|n| format!("let v{n} = a[i + {}];\n", n * threads)),
            each(&|n| format!(" + v{n}.x")),
        );
        let trace = |rounds: u32| {
            let bytes = u64::from(8 * threads * loads * rounds);
            dispatch(&source, &[Data::Zeroed(256), Data::Zeroed(bytes)], threads / 128)
        };
        // Rounds of the same bytes in all: some 3 and 9 MB.
        let rounds = (3 << 20) / (8 * threads * loads);
        let rounds = rounds.max(1);
        Ok(f64::from(8 * threads * loads) / bench.slope(&trace, [rounds, 3 * rounds])?)
    };
    let rates = [4, 8, 16, 32, 64].map(rate).into_iter().collect::<Result<Vec<f64>>>()?;
    Ok(rates.iter().map(|rate| rate / rates[4]).collect())
}

fn random(bench: &Bench) -> Result<Vec<f64>> {
    let source = "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
         @group(0) @binding(1) var<storage, read> a: array<u32>;
         @compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3u) {
             var h = id.x * 747796405u + 2891336453u;
             h = ((h >> ((h >> 28u) + 4u)) ^ h) * 277803737u;
             let v = a[((h >> 22u) ^ h) & 0xffffffu];
             if (v == 12345u) { out[0] = v; }
         }";
    let trace = |groups: u32| dispatch(source, &[Data::Zeroed(256), Data::Zeroed(64 << 20)], groups);
    Ok(vec![256.0 / bench.slope(&trace, [128, 384])?])
}

fn strided(bench: &Bench) -> Result<Vec<f64>> {
    let of = |words: u32| -> Result<f64> {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @group(0) @binding(1) var<storage, read> a: array<u32>;
             @compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 let v = a[id.x * {words}];
                 if (v == 12345u) {{ out[0] = v; }}
             }}"
        );
        let trace =
            |groups: u32| dispatch(&source, &[Data::Zeroed(256), Data::Zeroed(u64::from(1024 * groups * words))], groups);
        let read = bench.more(&trace, [64, 192], |phase| phase.counts.dram.read_bytes as f64)?;
        Ok(1024.0 / read)
    };
    [1, 2, 4, 8, 16, 32].into_iter().map(of).collect()
}

fn second_level(bench: &Bench) -> Result<Vec<f64>> {
    let card = bench.config();
    // All warps of all cores, and half of the second level.
    let groups = card.card.pipelines * card.core.per_pipeline * card.core.warps * card.core.warp_width / 256;
    let vectors = card.l2.slices * card.l2.lines * card.l2.line_bytes / 32;
    let step = 9 * vectors / 32 + 256;
    // In each round the workgroups of a core read what those of another have read: no first level has it.
    let trace = |rounds: u32| {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @group(0) @binding(1) var<storage, read> a: array<vec4u>;
             @compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 var s = 0u;
                 for (var r = 0u; r < {rounds}; r++) {{ s += a[(id.x + r * {step}) & {}].x; }}
                 if (s == 12345u) {{ out[0] = s; }}
             }}",
            vectors - 1
        );
        dispatch(&source, &[Data::Zeroed(256), Data::Words(vec![1; 4 * vectors as usize])], groups)
    };
    Ok(vec![f64::from(groups * PART) / bench.slope(&trace, [4, 12])?])
}

/// Times of loads that many words apart, divided by that of loads one word apart.
fn by_stride(bench: &Bench, source: impl Fn(u32, u32) -> String) -> Result<Vec<f64>> {
    // All warps of all cores, in workgroups of eight.
    let card = bench.config();
    let groups = card.card.pipelines * card.core.per_pipeline * card.core.warps / 8;
    let of = |words: u32| {
        let trace = |loads: u32| dispatch(&source(words, loads), &[Data::Zeroed(4096), Data::Words(vec![0; 8192])], groups);
        bench.slope(&trace, [32, 96])
    };
    let times = [1, 2, 4, 8, 16, 32].map(of).into_iter().collect::<Result<Vec<f64>>>()?;
    Ok(times.iter().map(|time| time / times[0]).collect())
}

/// Loads and their sum `s`; eight at a time do not wait for each other.
fn together(loads: u32, of: impl Fn(u32) -> String) -> String {
    let mut text = "var s = 0u;\n".to_owned();
    for first in (0..loads).step_by(8) {
        let each = |of: &dyn Fn(u32) -> String| (first..first + 8).map(of).collect::<String>();
        text += &each(&|load| format!("let v{load} = {};\n", of(load)));
        text += &format!("s += 0u{};\n", each(&|load| format!(" + v{load}")));
    }
    text
}

/// All warps load from at most 32 KB. Loads of one warp differ in the first index alone, which is part of their
/// addresses: the other one is computed once. The buffer may be written, so that no load is that of another.
fn coalesced(bench: &Bench) -> Result<Vec<f64>> {
    let source = |words: u32, loads: u32| {
        let loads = together(loads, |load| format!("a[{}][l & 31][0]", load % 8));
        format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @group(0) @binding(1) var<storage, read_write> a: array<array<array<u32, {words}>, 32>, 8>;
             @compute @workgroup_size(256) fn main(@builtin(local_invocation_index) l: u32) {{ {loads} out[l] = s; }}"
        )
    };
    by_stride(bench, source)
}

fn banked(bench: &Bench) -> Result<Vec<f64>> {
    let source = |words: u32, loads: u32| {
        let loads = together(loads, |_| "w[l & 31][0]".to_owned());
        format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<u32>;
             @group(0) @binding(1) var<storage, read> a: array<u32>;
             var<workgroup> w: array<array<u32, {words}>, 32>;
             @compute @workgroup_size(256) fn main(@builtin(local_invocation_index) l: u32) {{
                 w[l & 31][0] = a[l];
                 workgroupBarrier();
                 {loads} out[l] = s;
             }}"
        )
    };
    by_stride(bench, source)
}
