//! Variables, pointers, buffers, atomics.

use super::*;

#[test]
fn arrays_are_indexed_at_run_time() {
    let got = each_u32(
        "var a = array<u32, 10>(5u, 4u, 3u, 2u, 1u, 0u, 9u, 8u, 7u, 6u);
         for (var k = 0u; k < 10u; k++) { if (a[k] < x) { a[k] += x; } }
         r = a[x % 10u] * 1000u + a[a[x % 3u] % 10u];",
        |i| i,
    );
    for x in 0..64u32 {
        let mut a = [5, 4, 3, 2, 1, 0, 9, 8, 7, 6u32];
        for v in &mut a {
            if *v < x {
                *v += x;
            }
        }
        let want = a[(x % 10) as usize] * 1000 + a[(a[(x % 3) as usize] % 10) as usize];
        assert_eq!(got[x as usize], want, "x = {x}");
    }
}

#[test]
fn structs_of_arrays_and_vectors_are_indexed() {
    let source = "
        struct Inner { v: vec3u, m: mat2x2f, list: array<vec2u, 3> }
        struct Outer { items: array<Inner, 4>, tail: u32 }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        fn put(p: ptr<function, Inner>, k: u32, v: u32) { (*p).list[k][v % 2u] = v; (*p).v[v % 3u] += v; }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let x = input[id.x];
            var o: Outer;
            o.tail = 5u;
            for (var k = 0u; k < 4u; k++) { o.items[k].v = vec3u(k, x, k + x); o.items[k].m[k % 2u][x % 2u] = f32(x); }
            put(&o.items[x % 4u], x % 3u, x);
            let copy = o.items[x % 4u];
            result[id.x] = copy.list[x % 3u][x % 2u] + copy.v[x % 3u] * 100u + o.tail * 100000u
                + u32(copy.m[x % 4u % 2u][x % 2u]) * 1000000u;
        }";
    let got = each(source, |i| i);
    for x in 0..64u32 {
        let mut v = [x % 4, x, x % 4 + x];
        v[(x % 3) as usize] += x;
        let want = x + v[(x % 3) as usize] * 100 + 500_000 + x * 1_000_000;
        assert_eq!(got[x as usize], want, "x = {x}");
    }
}

#[test]
fn indices_out_of_range_take_the_last_element() {
    let got = each_u32("var a = array<u32, 3>(7u, 8u, 9u); let v = vec2u(3u, 4u); r = a[x] * 10u + v[x];", |i| i);
    assert_eq!(&got[..4], &[73, 84, 94, 94]);
    let got = each_u32("const c = array<u32, 6>(7u, 8u, 9u, 1u, 2u, 3u); r = c[x] + input[x + 1000u];", |i| i);
    assert_eq!(&got[..7], &[7, 8, 9, 1, 2, 3, 3]);
}

#[test]
fn constant_tables_of_vectors() {
    let got = each_u32(
        "const c = array<vec2u, 6>(vec2u(1u, 2u), vec2u(3u, 4u), vec2u(5u, 6u), vec2u(7u, 8u), vec2u(9u, 10u), vec2u(11u, 12u));
         let p = c[x % 6u]; r = p.x * 100u + p.y;",
        |i| i,
    );
    for x in 0..64 {
        assert_eq!(got[x as usize], (x % 6 * 2 + 1) * 100 + x % 6 * 2 + 2);
    }
}

#[test]
fn atomics_of_all_kinds() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read_write> a: array<atomic<u32>, 8>;
        @group(0) @binding(2) var<storage, read_write> s: atomic<i32>;
        var<workgroup> w: atomic<u32>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            let order = atomicAdd(&a[0], 1u);
            atomicSub(&a[1], i);
            atomicMax(&a[2], i * 3u);
            atomicMin(&a[3], i + 5u);
            atomicAnd(&a[4], ~(1u << (i % 8u)));
            atomicOr(&a[5], 1u << (i % 32u));
            atomicXor(&a[6], i);
            atomicMin(&s, -i32(i));
            let e = atomicCompareExchangeWeak(&a[7], 3u, i + 100u);
            let w0 = atomicAdd(&w, 2u);
            workgroupBarrier();
            let total = atomicLoad(&w);
            if (i == 0u) { atomicStore(&w, 9u); }
            result[i] = order + 1000u * w0 + 1000000u * u32(e.exchanged) + 10000000u * u32(total == 128u);
            if (i == 5u) { result[64] = atomicExchange(&a[7], 77u); result[65] = e.old_value; }
        }";
    let p = program(source);
    let out = Words::new(4 * 66);
    let a = words_of(&[0, 10_000, 0, 999, 255, 0, 0, 3]);
    let s = words_of(&[0]);
    run_with(&p, [1, 1, 1], &[(0, &out), (1, &a), (2, &s)]);
    for i in 0..64 {
        let want = i + 2000 * i + if i == 0 { 1_000_000 } else { 0 } + 10_000_000;
        assert_eq!(out.load(i as usize), want, "invocation {i}");
    }
    let sum: u32 = (0..64).sum();
    let got: Vec<u32> = (0..8).map(|i| a.load(i)).collect();
    assert_eq!(got, [64, 10_000 - sum, 63 * 3, 5, 0, u32::MAX, (0..64).fold(0, |x, i| x ^ i), 77]);
    assert_eq!(s.load(0) as i32, -63);
    assert_eq!((out.load(64), out.load(65)), (100, 100));
}

#[test]
fn buffers_of_structs_have_their_layout() {
    let source = "
        struct Item { a: vec3f, b: f32, m: mat3x3f, h: array<vec2f, 2> }
        struct Head { count: u32, items: array<Item> }
        @group(0) @binding(0) var<storage, read_write> out: Head;
        @group(0) @binding(1) var<storage, read> in: Head;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            if (i < arrayLength(&in.items)) {
                var x = in.items[i];
                x.m[1].z += 1.0;
                out.items[arrayLength(&in.items) - 1u - i] = x;
            }
            if (i == 0u) { out.count = arrayLength(&in.items) * 10u + in.count; }
        }";
    // Item: a 0, b 12, m 16 (columns of 16), h 64, size 80; items begin at 16.
    let n = 5;
    let words = 4 + 20 * n;
    let data: Vec<u32> = (0..words as u32).map(|i| (i as f32).to_bits()).collect();
    let input = words_of(&data);
    input.store(0, 3);
    let out = Words::new(4 * words as u64);
    run_with(&program(source), [1, 1, 1], &[(0, &out), (1, &input)]);
    assert_eq!(out.load(0), 53);
    for i in 0..n {
        for k in 0..20 {
            let padding = matches!(k, 7 | 11 | 15);
            let want = if padding { 0 } else { (4 + 20 * i + k) as f32 as u32 + u32::from(k == 10) };
            let have = f32::from_bits(out.load(4 + 20 * (n - 1 - i) + k)) as u32;
            assert_eq!(have, want, "item {i} word {k}");
        }
    }
}

#[test]
fn uniform_values_are_computed_once_a_draw() {
    let source = "
        struct U { k: u32, f: f32, list: array<vec4u, 3> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        @group(0) @binding(2) var<uniform> u: U;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var sum = 0u;
            for (var k = 0u; k < 3u; k++) { sum += u.list[k].y * u.k; }
            result[id.x] = sum + u32(sqrt(u.f)) + input[id.x] + u.list[input[id.x] % 3u].x;
        }";
    let p = program(source);
    let uniform = words_of(&[2, 81f32.to_bits(), 0, 0, 10, 11, 0, 0, 20, 21, 0, 0, 30, 31, 0, 0]);
    let out = Words::new(256);
    let input = words_of(&(0..64).collect::<Vec<_>>());
    run_with(&p, [1, 1, 1], &[(0, &out), (1, &input), (2, &uniform)]);
    for x in 0..64 {
        assert_eq!(out.load(x as usize), (11 + 21 + 31) * 2 + 9 + x + [10, 20, 30][(x % 3) as usize]);
    }
    let (batch, prologue) = p.operations();
    assert!(prologue >= 8, "the sum is uniform: {prologue} operations");
    assert!(batch <= 14, "{batch} operations are left for each batch");
}

#[test]
fn half_precision_numbers() {
    let source = "enable f16;
        struct H { a: f16, b: vec3<f16>, c: f32 }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read_write> h: array<H>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let i = id.x;
            let x = f16(i) * 0.1h + 1.0h;
            h[i].a = x;
            h[i].b = vec3<f16>(x, x * x, 1.0h / x);
            result[i] = bitcast<u32>(f32(h[i].b.y) + f32(h[i].a));
        }";
    use crate::code::eval::{from_half, to_half};
    let round = |x: f32| from_half(to_half(x));
    let p = program(source);
    let out = Words::new(256);
    let h = Words::new(64 * 24);
    run_with(&p, [1, 1, 1], &[(0, &out), (1, &h)]);
    for i in 0..64u32 {
        let x = round(round(round(i as f32) * round(0.1)) + 1.0);
        assert_eq!(f32::from_bits(out.load(i as usize)), round(x * x) + x);
        assert_eq!(u32::from(h.u16_at(24 * i as usize)), to_half(x));
        assert_eq!(u32::from(h.u16_at(24 * i as usize + 12)), to_half(round(1.0 / x)));
    }
}

#[test]
fn pipeline_constants_replace_overrides() {
    let source = "
        override size = 4u; @id(7) override scale: f32; override twice = scale * 2.0;
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(size, 2) fn main(@builtin(local_invocation_index) i: u32) { result[i] = u32(twice) + size; }";
    let module = Module::new("test", ModuleSource::Wgsl(source)).expect("valid");
    let options =
        |c: &[(String, f64)]| compile(&module, Stage::Compute, Some("main"), &Options { constants: c, ..Options::default() });
    let p = options(&[("size".into(), 8.0), ("7".into(), 10.0)]).expect("compiles");
    assert_eq!(p.interface().workgroup_size, [8, 2, 1]);
    let out = Words::new(256);
    run_with(&p, [1, 1, 1], &[(0, &out)]);
    assert_eq!((out.load(0), out.load(15), out.load(16)), (28, 28, 0));
    let missing = options(&[]).expect_err("scale has no value").to_string();
    assert!(missing.contains("7"), "{missing}");
    let unknown = options(&[("7".into(), 1.0), ("nobody".into(), 1.0)]).expect_err("unknown").to_string();
    assert!(unknown.contains("nobody"), "{unknown}");
}

#[test]
fn arrays_that_are_values_are_indexed_again_and_again() {
    // A hundred vectors at once would need more registers than a program may have; one after the other they need few.
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        fn three(x: u32, k: u32) -> array<vec4u, 100> {
            var a: array<vec4u, 100>;
            a[0] = vec4u(x); a[1] = vec4u(k); a[2] = vec4u(x + k);
            return a;
        }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let x = input[id.x];
            var r = 0u;
            for (var k = 0u; k < 60u; k += 1u) {
                let a = three(x, k);
                r += a[(x + k) % 100u].z;
            }
            result[id.x] = r;
        }";
    let expected = |x: u32| (0..60).map(|k| [x, k, x + k].get(((x + k) % 100) as usize).copied().unwrap_or(0)).sum::<u32>();
    assert_eq!(each(source, |i| i), (0..64).map(expected).collect::<Vec<_>>());
}
