//! Compute programs as engines have them, through a trace: sorting, scanning, culling, transforms; against plain Rust.

use crate::common::*;
use gfx::state::Aspect;
use trace::command::*;
use trace::record;

/// Exclusive prefix sums of 8 blocks of 512, then of the blocks' sums, then their sum: three passes as in a culling pipeline.
#[test]
fn prefix_sums_of_many_blocks() {
    const N: usize = 4096;
    let mut next = noise(1);
    let input: Vec<u32> = (0..N).map(|_| next() % 1000).collect();
    let scan = "
        @group(0) @binding(0) var<storage, read_write> data: array<u32>;
        @group(0) @binding(1) var<storage, read_write> sums: array<u32>;
        const BLOCK = 512u;
        var<workgroup> part: array<u32, BLOCK>;
        @compute @workgroup_size(BLOCK / 2) fn main(
            @builtin(local_invocation_index) i: u32, @builtin(workgroup_id) group: vec3u,
        ) {
            let first = group.x * BLOCK;
            part[2u * i] = data[first + 2u * i];
            part[2u * i + 1u] = data[first + 2u * i + 1u];
            var offset = 1u;
            for (var d = BLOCK >> 1u; d > 0u; d >>= 1u) {
                workgroupBarrier();
                if i < d {
                    let a = offset * (2u * i + 1u) - 1u;
                    part[offset * (2u * i + 2u) - 1u] += part[a];
                }
                offset *= 2u;
            }
            if i == 0u {
                sums[group.x] = part[BLOCK - 1u];
                part[BLOCK - 1u] = 0u;
            }
            for (var d = 1u; d < BLOCK; d *= 2u) {
                offset >>= 1u;
                workgroupBarrier();
                if i < d {
                    let a = offset * (2u * i + 1u) - 1u;
                    let b = offset * (2u * i + 2u) - 1u;
                    let t = part[a];
                    part[a] = part[b];
                    part[b] += t;
                }
            }
            workgroupBarrier();
            data[first + 2u * i] = part[2u * i];
            data[first + 2u * i + 1u] = part[2u * i + 1u];
        }";
    let add = "
        @group(0) @binding(0) var<storage, read_write> data: array<u32>;
        @group(0) @binding(1) var<storage, read> sums: array<u32>;
        @compute @workgroup_size(256) fn main(@builtin(global_invocation_id) id: vec3u) {
            data[id.x] += sums[id.x / 512u];
        }";
    let mut lab = Lab::new();
    let (data, sums, total) = (lab.buffer(&input), lab.words(512), lab.words(1));
    let (scan, add) = (lab.compute(scan), lab.compute(add));
    lab.dispatch(scan, [(N / 512) as u32, 1, 1], [record::whole(data), record::whole(sums)]);
    lab.dispatch(scan, [1, 1, 1], [record::whole(sums), record::whole(total)]);
    lab.dispatch(add, [(N / 256) as u32, 1, 1], [record::whole(data), record::whole(sums)]);
    let mut sum = 0;
    let expected: Vec<u32> = input
        .iter()
        .map(|&x| {
            sum += x;
            sum - x
        })
        .collect();
    assert_eq!(lab.read(data, N as u64), expected);
}

/// Survivors of a test are appended through an atomic, which then says how many groups work on them.
#[test]
fn append_and_dispatch_indirectly() {
    const N: usize = 3000;
    let mut next = noise(7);
    let input: Vec<u32> = (0..N).map(|_| next()).collect();
    let keep = "
        struct Args { groups: vec3u, count: atomic<u32> }
        @group(0) @binding(0) var<storage, read_write> args: Args;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        @group(0) @binding(2) var<storage, read_write> kept: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            if id.x >= arrayLength(&input) { return; }
            let v = input[id.x];
            if v % 3u == 0u { kept[atomicAdd(&args.count, 1u)] = v; }
        }";
    let finish = "
        struct Args { groups: vec3u, count: u32 }
        @group(0) @binding(0) var<storage, read_write> args: Args;
        @compute @workgroup_size(1) fn main() { args.groups = vec3u((args.count + 31u) / 32u, 1u, 1u); }";
    let work = "
        struct Args { groups: vec3u, count: u32 }
        @group(0) @binding(0) var<storage, read> args: Args;
        @group(0) @binding(1) var<storage, read> kept: array<u32>;
        @group(0) @binding(2) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(32) fn main(
            @builtin(global_invocation_id) id: vec3u, @builtin(num_workgroups) groups: vec3u,
        ) {
            if id.x < args.count { result[id.x + 1u] = kept[id.x] / 3u; }
            if id.x == 0u { result[0] = groups.x * 10000u + args.count; }
        }";
    let mut lab = Lab::new();
    let (args, kept, result) = (lab.words(4), lab.words(N as u64), lab.words(N as u64));
    // The array's length is asked: exactly its bytes are bound.
    let source = lab.card.create_buffer_init("input", bytes(&input));
    let (keep, finish, work) = (lab.compute(keep), lab.compute(finish), lab.compute(work));
    lab.dispatch(keep, [N.div_ceil(64) as u32, 1, 1], [args, source, kept].map(record::whole));
    lab.dispatch(finish, [1, 1, 1], [record::whole(args)]);
    let copy = lab.words(4);
    lab.card.copy_buffer_to_buffer((args, 0), (copy, 0), 16);
    let group = lab.group(AnyPipeline::Compute(work), 0, [args, kept, result].map(record::whole));
    {
        let mut pass = lab.card.begin_compute_pass();
        pass.set_pipeline(work);
        pass.set_bind_group(0, group);
        pass.dispatch_indirect(copy, 0);
    }
    let expected: Vec<u32> = input.iter().filter(|&&v| v % 3 == 0).map(|v| v / 3).collect();
    let n = expected.len();
    assert!((900..1100).contains(&n));
    let got = lab.read(result, n as u64 + 2);
    assert_eq!(got[0], n.div_ceil(32) as u32 * 10000 + n as u32);
    // The order of appending is this implementation's: invocations in their own order.
    assert_eq!(got[1..=n], expected);
    assert_eq!(got[n + 1], 0);
}

/// A bitonic network over 1024 keys with their values in workgroup memory.
#[test]
fn bitonic_sort() {
    let mut next = noise(3);
    let input: Vec<u32> = (0..1024).flat_map(|i| [next() % 100_000, i]).collect();
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<vec2u>;
        @group(0) @binding(1) var<storage, read> input: array<vec2u>;
        var<workgroup> pairs: array<vec2u, 1024>;
        fn exchange(i: u32, j: u32, up: bool) {
            let a = &pairs[i];
            let b = &pairs[j];
            let x = *a;
            let y = *b;
            let wrong = x.x > y.x || (x.x == y.x && x.y > y.y);
            if wrong == up { *a = y; *b = x; }
        }
        @compute @workgroup_size(512) fn main(@builtin(local_invocation_index) t: u32) {
            pairs[t] = input[t];
            pairs[t + 512u] = input[t + 512u];
            for (var k = 2u; k <= 1024u; k <<= 1u) {
                for (var j = k >> 1u; j > 0u; j >>= 1u) {
                    workgroupBarrier();
                    let i = 2u * t - (t & (j - 1u));
                    exchange(i, i + j, (i & k) == 0u);
                }
            }
            workgroupBarrier();
            result[t] = pairs[t];
            result[t + 512u] = pairs[t + 512u];
        }";
    let mut expected: Vec<(u32, u32)> = input.chunks(2).map(|p| (p[0], p[1])).collect();
    expected.sort_unstable();
    let expected: Vec<u32> = expected.iter().flat_map(|p| [p.0, p.1]).collect();
    assert_eq!(run(source, [1, 1, 1], 2048, &[&input]), expected);
}

/// A radix-2 transform of 256 complex numbers in workgroup memory, against the sum that defines it.
#[test]
fn fast_fourier_transform() {
    const N: usize = 256;
    let mut next = unit_noise(5);
    let input: Vec<f32> = (0..2 * N).map(|_| 2.0 * next() - 1.0).collect();
    let source = "
        const N = 256u;
        const LOG = 8u;
        const TAU = 6.283185307179586;
        @group(0) @binding(0) var<storage, read_write> result: array<vec2f>;
        @group(0) @binding(1) var<storage, read> input: array<vec2f>;
        var<workgroup> a: array<vec2f, N>;
        fn times(p: vec2f, q: vec2f) -> vec2f { return mat2x2f(q, vec2f(-q.y, q.x)) * p; }
        @compute @workgroup_size(N / 2u) fn main(@builtin(local_invocation_index) t: u32) {
            for (var h = 0u; h < 2u; h++) {
                let i = t + h * (N / 2u);
                a[reverseBits(i) >> (32u - LOG)] = input[i];
            }
            for (var s = 0u; s < LOG; s++) {
                workgroupBarrier();
                let half = 1u << s;
                let k = t & (half - 1u);
                let i = ((t >> s) << (s + 1u)) | k;
                let angle = -TAU * f32(k) / f32(2u * half);
                let w = times(a[i + half], vec2f(cos(angle), sin(angle)));
                let u = a[i];
                a[i] = u + w;
                a[i + half] = u - w;
            }
            workgroupBarrier();
            result[t] = a[t];
            result[t + N / 2u] = a[t + N / 2u];
        }";
    let got = floats(&run(source, [1, 1, 1], 2 * N as u64, &[&bits(&input)]));
    for k in 0..N {
        let (mut re, mut im) = (0.0f64, 0.0f64);
        for n in 0..N {
            let angle = -std::f64::consts::TAU * (k * n % N) as f64 / N as f64;
            let (x, y) = (f64::from(input[2 * n]), f64::from(input[2 * n + 1]));
            re += x * angle.cos() - y * angle.sin();
            im += x * angle.sin() + y * angle.cos();
        }
        assert_near(got[2 * k], re, 1e-5, 2e-5, &format!("real part {k}"));
        assert_near(got[2 * k + 1], im, 1e-5, 2e-5, &format!("imaginary part {k}"));
    }
}

/// Counts in workgroup memory, added to those in a buffer once per group.
#[test]
fn histogram_by_atomics() {
    let mut next = noise(9);
    let input: Vec<u32> = (0..10_000).map(|_| next() % 77 * (next() % 3)).collect();
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<atomic<u32>, 256>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        var<workgroup> counts: array<atomic<u32>, 256>;
        var<workgroup> largest: atomic<u32>;
        @compute @workgroup_size(16, 16) fn main(
            @builtin(local_invocation_index) t: u32, @builtin(workgroup_id) g: vec3u, @builtin(num_workgroups) n: vec3u,
        ) {
            // Workgroup memory begins as zeros: nothing to clear.
            for (var i = g.x * 256u + t; i < 10000u; i += n.x * 256u) {
                atomicAdd(&counts[min(input[i], 255u)], 1u);
                atomicMax(&largest, input[i]);
            }
            workgroupBarrier();
            let c = atomicLoad(&counts[t]);
            if c != 0u { atomicAdd(&result[t], c); }
            if t == 0u { atomicMax(&result[255], atomicLoad(&largest)); }
        }";
    let mut expected = vec![0u32; 256];
    input.iter().for_each(|&x| expected[x as usize] += 1);
    assert_eq!(expected[255], 0);
    expected[255] = *input.iter().max().unwrap();
    assert_eq!(run(source, [7, 1, 1], 256, &[&input]), expected);
}

/// A lock made of compare and exchange, and what a whole workgroup reads from one of its invocations.
#[test]
fn exchanges_and_uniform_loads() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        var<workgroup> ticket: atomic<u32>;
        var<workgroup> chosen: u32;
        var<workgroup> leaders: atomic<u32>;
        @compute @workgroup_size(100) fn main(@builtin(local_invocation_index) t: u32) {
            let r = atomicCompareExchangeWeak(&ticket, 0u, t + 1u);
            if r.exchanged { chosen = t * 3u + 7u; atomicAdd(&leaders, 1u); }
            let all = workgroupUniformLoad(&chosen);
            result[t] = all * 2u + select(0u, 1u, r.exchanged);
            workgroupBarrier();
            if t == 99u { result[100] = atomicLoad(&leaders); result[101] = atomicExchange(&ticket, 5u); }
        }";
    let got = run(source, [1, 1, 1], 102, &[]);
    let leader = got[..100].iter().position(|v| v & 1 == 1).expect("a leader") as u32;
    for (t, &v) in got[..100].iter().enumerate() {
        assert_eq!(v, (leader * 3 + 7) * 2 + u32::from(t as u32 == leader), "invocation {t}");
    }
    assert_eq!(got[100..], [1, leader + 1]);
}

/// Looking back along earlier workgroups, which publish their sums: a scan in one pass.
#[test]
fn scan_with_decoupled_look_back() {
    const N: usize = 64 * 40;
    let mut next = noise(11);
    let input: Vec<u32> = (0..N).map(|_| next() % 50).collect();
    let source = "
        struct State { ticket: atomic<u32>, flags: array<atomic<u32>, 64>, sums: array<atomic<u32>, 64> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        @group(0) @binding(2) var<storage, read_write> state: State;
        var<workgroup> part: u32;
        var<workgroup> before: u32;
        var<workgroup> values: array<u32, 64>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) t: u32) {
            if t == 0u { part = atomicAdd(&state.ticket, 1u); }
            let p = workgroupUniformLoad(&part);
            values[t] = input[p * 64u + t];
            for (var d = 1u; d < 64u; d *= 2u) {
                workgroupBarrier();
                let v = values[max(t, d) - d];
                workgroupBarrier();
                if t >= d { values[t] += v; }
            }
            workgroupBarrier();
            if t == 63u {
                atomicStore(&state.sums[p], values[63]);
                storageBarrier();
                atomicStore(&state.flags[p], 1u);
                var sum = 0u;
                var q = p;
                loop {
                    if q == 0u { break; }
                    if atomicLoad(&state.flags[q - 1u]) == 1u {
                        sum += atomicLoad(&state.sums[q - 1u]);
                        q -= 1u;
                    }
                }
                before = sum;
            }
            workgroupBarrier();
            result[p * 64u + t] = before + values[t];
        }";
    let got = run(source, [(N / 64) as u32, 1, 1], N as u64, &[&input, &[0; 129]]);
    let mut sum = 0;
    for (i, &x) in input.iter().enumerate() {
        sum += x;
        assert_eq!(got[i], sum, "{i}");
    }
}

/// A chain of halved images in the levels of one texture, each written as a storage texture from the one before.
#[test]
fn mip_levels_by_storage_textures() {
    use gfx::format::Format;
    const N: u32 = 16;
    let mut next = unit_noise(13);
    let base: Vec<f32> = (0..N * N * 4).map(|_| next()).collect();
    let source = "
        @group(0) @binding(0) var big: texture_2d<f32>;
        @group(0) @binding(1) var small: texture_storage_2d<rgba32float, write>;
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
            if any(id.xy >= textureDimensions(small)) { return; }
            var sum = vec4f();
            for (var k = 0u; k < 4u; k++) {
                sum += textureLoad(big, 2u * id.xy + vec2u(k & 1u, k >> 1u), 0);
            }
            textureStore(small, id.xy, sum / 4.0);
        }";
    let mut lab = Lab::new();
    let texture = lab.card.create_texture("", record::texture_mipped(N, N, 5, Format::Rgba32Float));
    lab.card.write_level(texture, 0, "base", &bytes(&bits(&base)));
    let pipeline = lab.compute(source);
    for level in 1..5 {
        let view = |lab: &mut Lab, base_level| {
            lab.card.create_view_of(texture, ViewDesc { base_level, levels: Some(1), ..ViewDesc::default() })
        };
        let (from, to) = (view(&mut lab, level - 1), view(&mut lab, level));
        lab.dispatch(
            pipeline,
            [(N >> level).div_ceil(8), (N >> level).div_ceil(8), 1],
            [BoundResource::View(from), BoundResource::View(to)],
        );
    }
    let (two, one) = (lab.words(64 * 2), lab.words(64));
    for (level, buffer) in [(3, two), (4, one)] {
        let from = TextureEnd { texture, level, origin: [0; 3], aspect: Aspect::All };
        let layout = LinearLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: None };
        lab.card.copy_texture_to_buffer(from, buffer, layout, [N >> level, N >> level, 1]);
    }
    lab.card.copy_buffer_to_buffer((one, 0), (two, 128), 16);
    let got = floats(&lab.read(two, 128));
    // Sums in the same order: the same bits.
    let mut image = base;
    let mut width = N as usize;
    let mut levels = vec![image.clone()];
    while width > 1 {
        let w = width / 2;
        let mut next = vec![0.0; w * w * 4];
        for y in 0..w {
            for x in 0..w {
                for c in 0..4 {
                    let at = |dx, dy| image[((2 * y + dy) * width + 2 * x + dx) * 4 + c];
                    next[(y * w + x) * 4 + c] = (((at(0, 0) + at(1, 0)) + at(0, 1)) + at(1, 1)) / 4.0;
                }
            }
        }
        (image, width) = (next, w);
        levels.push(image.clone());
    }
    assert_eq!(got[..8], levels[3][..8]);
    assert_eq!(got[64..72], levels[3][8..]);
    assert_eq!(got[32..36], levels[4][..]);
}
