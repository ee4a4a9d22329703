//! The language through a trace: layouts, pointers, control flow, conversions, arithmetic at its edges; against plain Rust.

use crate::common::*;
use trace::command::*;
use trace::record;

/// The head of a program whose results go to binding 0.
const RESULT: &str = "@group(0) @binding(0) var<storage, read_write> result: array<u32>;\n";

/// Runs the body of an entry point, with declarations before it, for 64 invocations numbered `i`; 64 words of result.
fn each(declarations: &str, body: &str) -> Vec<u32> {
    let source = format!(
        "{RESULT}{declarations}
         @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {{ {body} }}"
    );
    run(&source, [1, 1, 1], 64, &[])
}

#[track_caller]
fn check_each(declarations: &str, body: &str, expected: impl Fn(u32) -> u32) {
    let got = each(declarations, body);
    let want: Vec<u32> = (0..64).map(expected).collect();
    assert_eq!(got, want);
}

/// Every member of a uniform block lies where WGSL says: strides of matrices and arrays, alignment, explicit sizes.
#[test]
fn uniform_blocks_have_wgsl_layout() {
    // Byte offset and value of each word that is read, in the order in which the program reads.
    let mut words = vec![0xdead_beefu32; 128];
    let mut expected = Vec::new();
    let mut put = |offsets: &[usize]| {
        for &offset in offsets {
            let value = (offset as f32 + 0.5).to_bits();
            words[offset / 4] = value;
            expected.push(value);
        }
    };
    put(&[0]); // a: f32
    put(&[16, 20, 24, 28]); // b: vec3f, c: f32 in its last word
    put(&[32, 36, 40, 44]); // d: mat2x2f, columns of 8 bytes
    put(&[48, 52, 56, 64, 68, 72, 80, 84, 88]); // e: mat3x3f, columns of 16
    put(&[96, 100, 104, 112, 116, 120]); // f: mat2x3f
    put(&[128, 136]); // g: vec2f at 128; h: f32 with @align(8)
    put(&[144, 160, 176]); // k: array<vec4f, 3>, one component each
    put(&[192, 208]); // l: @size(16) f32; m: f32 after it
    put(&[224, 240, 256]); // n: array<Inner, 2>: x, then y of the next, then what follows
    let source = format!(
        "{RESULT}
        struct Inner {{ x: f32, @align(16) y: f32 }}
        struct Block {{
            a: f32, b: vec3f, c: f32, d: mat2x2f, e: mat3x3f, f: mat2x3f, g: vec2f, @align(8) h: f32,
            k: array<vec4f, 3>, @size(16) l: f32, m: f32, @align(16) n: array<Inner, 1>, o: f32,
        }}
        @group(0) @binding(1) var<uniform> u: Block;
        var<private> at = 0u;
        fn put(x: f32) {{ result[at] = bitcast<u32>(x); at++; }}
        @compute @workgroup_size(1) fn main() {{
            put(u.a); put(u.b.x); put(u.b.y); put(u.b.z); put(u.c);
            for (var c = 0; c < 2; c++) {{ for (var r = 0; r < 2; r++) {{ put(u.d[c][r]); }} }}
            for (var c = 0; c < 3; c++) {{ for (var r = 0; r < 3; r++) {{ put(u.e[c][r]); }} }}
            for (var c = 0; c < 2; c++) {{ for (var r = 0; r < 3; r++) {{ put(u.f[c][r]); }} }}
            put(u.g.x); put(u.h);
            for (var k = 0; k < 3; k++) {{ put(u.k[k].x); }}
            put(u.l); put(u.m); put(u.n[0].x); put(u.n[0].y); put(u.o);
        }}"
    );
    assert_eq!(run(&source, [1, 1, 1], expected.len() as u64, &[&words]), expected);
}

/// Arrays without a stated size: their length follows from what is bound, also behind other members and from an offset on.
#[test]
fn runtime_sized_arrays() {
    let source = format!(
        "{RESULT}
        struct Item {{ position: vec3f, id: u32 }}
        struct List {{ count: u32, scale: vec2f, items: array<Item> }}
        @group(0) @binding(1) var<storage, read> list: List;
        @group(0) @binding(2) var<storage, read_write> plain: array<vec3u>;
        fn ids(i: u32) -> u32 {{ return list.items[i].id + u32(list.items[i].position.y); }}
        @compute @workgroup_size(1) fn main() {{
            result[0] = arrayLength(&list.items);
            result[1] = arrayLength(&plain);
            for (var i = 0u; i < arrayLength(&list.items); i++) {{ result[2u + i] = ids(i); }}
            let p = &plain[1];
            (*p).y = 77u;
            plain[2] = vec3u(1u, 2u, 3u);
            result[20] = plain[1].y + list.count + u32(list.scale.y);
        }}"
    );
    let mut lab = Lab::new();
    let result = lab.words(64);
    // A header of 16 bytes and three items of 16 bytes, and eight bytes more that are no whole item; from byte 256 on.
    let mut words = vec![0u32; 64 + 4 + 12 + 2];
    words[64] = 5;
    words[66] = 0x4000_0000;
    words[67] = 3.0f32.to_bits();
    for i in 0..3 {
        words[64 + 4 + 4 * i + 1] = (10.0 * i as f32).to_bits();
        words[64 + 4 + 4 * i + 3] = 100 + i as u32;
    }
    let list = lab.card.create_buffer_init("list", bytes(&words));
    let plain = lab.card.create_buffer("plain", 16 * 5 + 12);
    let pipeline = lab.compute(&source);
    lab.dispatch(
        pipeline,
        [1, 1, 1],
        [
            record::whole(result),
            BoundResource::Buffer { buffer: list, offset: 256, size: None },
            BoundResource::Buffer { buffer: plain, offset: 0, size: Some(16 * 4 + 12) },
        ],
    );
    let got = lab.read(result, 21);
    assert_eq!(got[..5], [3, 4, 100, 111, 122]);
    assert_eq!(got[20], 77 + 5 + 3);
}

/// Pointers to variables of functions and of the module, to elements and members, handed to functions and kept in names.
#[test]
fn pointers() {
    check_each(
        "struct Pair { a: u32, b: array<vec2u, 3> }
         var<private> shared_pair: Pair;
         fn swap(p: ptr<function, u32>, q: ptr<function, u32>) { let t = *p; *p = *q; *q = t; }
         fn bump(p: ptr<private, Pair>, k: u32) -> u32 { (*p).b[k].y += 3u; p.a++; return p.b[k].y; }
         fn fill(p: ptr<function, array<u32, 4>>, from_value: u32) {
             for (var k = 0u; k < 4u; k++) { p[k] = from_value + k * k; }
         }
         fn grow(v: ptr<function, vec3u>) { (*v).z = (*v).x + (*v).y; v.x *= 2u; }",
        "var x = i; var y = 100u + i;
         swap(&x, &y);
         var a: array<u32, 4>;
         fill(&a, y);
         var m = array<vec3u, 2>(vec3u(1u, i, 0u), vec3u(2u, 3u, 4u));
         let row = &m[i & 1u];
         (*row).y += 5u;
         var v = m[0];
         grow(&v);
         shared_pair.b[i % 3u] = vec2u(i, i + 1u);
         let r = bump(&shared_pair, i % 3u) + bump(&shared_pair, 0u);
         let last = &shared_pair.b[2];
         result[i] = x + 7u * y + a[i & 3u] + v.x + v.z + m[1].y + r + shared_pair.a * 1000u + (*last).y;",
        |i| {
            let (x, y) = (100 + i, i);
            let a = y + (i & 3) * (i & 3);
            let mut m = [[1, i, 0], [2, 3, 4]];
            m[(i & 1) as usize][1] += 5;
            let v = [m[0][0] * 2, m[0][1], m[0][0] + m[0][1]];
            let mut b = [[0u32; 2]; 3];
            b[(i % 3) as usize] = [i, i + 1];
            b[(i % 3) as usize][1] += 3;
            let mut r = b[(i % 3) as usize][1];
            b[0][1] += 3;
            r += b[0][1];
            x + 7 * y + a + v[0] + v[2] + m[1][1] + r + 2 * 1000 + b[2][1]
        },
    );
}

/// Switches with lists of values and the default anywhere, loops with a continuing block and `break if`, loops in loops.
#[test]
fn control_flow() {
    check_each(
        "const LIMIT: u32 = 4 + 3 * 2;
         fn kind(x: i32) -> u32 {
             switch x {
                 case -1, 5, 6: { return 10u; }
                 default: { return 1u; }
                 case 0: { if x == 0 { break; } return 99u; }
                 case 7, { return 30u; }
             }
             return 20u;
         }
         fn digits(x: u32) -> u32 {
             var rest = x; var n = 0u;
             loop { n++; continuing { rest /= 10u; break if rest == 0u; } }
             return n;
         }",
        "var sum = kind(i32(i) - 1);
         var k = 0u;
         while k < LIMIT {
             k++;
             if (k + i) % 3u == 0u { continue; }
             for (var j = k; ; j += 2u) {
                 if j > 12u { break; }
                 switch j & 3u {
                     case 0u: { continue; }
                     case 1u: { sum += j; }
                     default: { if j == 7u { break; } sum += 1u; }
                 }
                 sum += 100u;
             }
             if sum > 4000u + i { break; }
         }
         { let sum = 5u; _ = sum; }
         result[i] = sum * 10u + digits(i * i * 3u);",
        |i| {
            let mut sum = match i as i32 - 1 {
                -1 | 5 | 6 => 10,
                0 => 20,
                7 => 30,
                _ => 1u32,
            };
            let mut k = 0;
            while k < 10 {
                k += 1;
                if (k + i) % 3 == 0 {
                    continue;
                }
                let mut j = k;
                while j <= 12 {
                    let mut add = true;
                    match j & 3 {
                        0 => add = false,
                        1 => sum += j,
                        _ if j == 7 => {}
                        _ => sum += 1,
                    }
                    if add {
                        sum += 100;
                    }
                    j += 2;
                }
                if sum > 4000 + i {
                    break;
                }
            }
            sum * 10 + (i * i * 3).to_string().len() as u32
        },
    );
}

/// `&&` and `||` evaluate their right side only where its value matters; arguments are evaluated once and in order.
#[test]
fn short_circuits_and_order_of_evaluation() {
    check_each(
        "var<private> calls: u32;
         fn note(k: u32, r: bool) -> bool { calls = calls * 10u + k; return r; }
         fn next() -> u32 { calls += 1u; return calls; }",
        "let a = note(1u, i % 2u == 0u) && note(2u, i % 3u == 0u);
         let b = note(3u, a) || note(4u, i % 5u == 0u);
         var v = vec3u(next(), next(), next());
         v[v.x % 3u] += select(0u, 1000000u, a) + select(0u, 2000000u, b);
         result[i] = calls + v.x + v.y * 3u + v.z * 7u;",
        |i| {
            let mut calls = 1;
            let a = i % 2 == 0 && {
                calls = calls * 10 + 2;
                i % 3 == 0
            };
            calls = calls * 10 + 3;
            let b = a || {
                calls = calls * 10 + 4;
                i % 5 == 0
            };
            let mut v = [calls + 1, calls + 2, calls + 3];
            calls += 3;
            v[(v[0] % 3) as usize] += u32::from(a) * 1_000_000 + u32::from(b) * 2_000_000;
            calls + v[0] + v[1] * 3 + v[2] * 7
        },
    );
}

/// Integers wrap; divisions that have no result, and shifts, give what WGSL says.
#[test]
fn integers_at_their_edges() {
    type Reference = fn(i32, i32) -> u32;
    let cases: [(&str, Reference); 9] = [
        ("a / b", |a, b| if b == 0 || (a == i32::MIN && b == -1) { a as u32 } else { (a / b) as u32 }),
        ("a % b", |a, b| if b == 0 || (a == i32::MIN && b == -1) { 0 } else { (a % b) as u32 }),
        ("bitcast<i32>(bitcast<u32>(a) / bitcast<u32>(b))", |a, b| (a as u32).checked_div(b as u32).unwrap_or(a as u32)),
        ("bitcast<i32>(bitcast<u32>(a) % bitcast<u32>(b))", |a, b| (a as u32).checked_rem(b as u32).unwrap_or(0)),
        ("a * b + a - b", |a, b| a.wrapping_mul(b).wrapping_add(a).wrapping_sub(b) as u32),
        ("a << (bitcast<u32>(b) & 31u)", |a, b| (a as u32) << (b & 31)),
        ("a >> (bitcast<u32>(b) & 31u)", |a, b| (a >> (b & 31)) as u32),
        ("select(~a, -a, b > 0) ^ (a & b) | abs(b)", |a, b| {
            ((if b > 0 { a.wrapping_neg() } else { !a }) ^ (a & b) | b.wrapping_abs()) as u32
        }),
        ("sign(a) * 3 + min(a, b) - max(a, 7) + clamp(b, -5, 5)", |a, b| {
            let s = a.signum() * 3;
            s.wrapping_add(a.min(b)).wrapping_sub(a.max(7)).wrapping_add(b.clamp(-5, 5)) as u32
        }),
    ];
    let edges = [0, 1, -1, 2, 31, 32, i32::MIN, i32::MAX];
    for (expression, expected) in cases {
        check_each(
            "const EDGES = array<i32, 8>(0, 1, -1, 2, 31, 32, -2147483648, 2147483647);",
            &format!("let a = EDGES[i / 8u]; let b = EDGES[i % 8u]; result[i] = bitcast<u32>({expression});"),
            |i| expected(edges[i as usize / 8], edges[i as usize % 8]),
        );
    }
}

/// Built-in functions with structs as results, and conversions between numbers of all kinds.
#[test]
fn parts_of_numbers_and_conversions() {
    let values =
        [0.0f32, -0.0, 1.0, -1.5, 3.75, -1e-20, 123456.7, 1e10, -1e10, 0.49999997, 2.5, 3.5, -2.5, 8388609.0, 1e-40, 65504.0];
    let source = format!(
        "{RESULT}
        @group(0) @binding(1) var<storage, read> input: array<f32>;
        @compute @workgroup_size(16) fn main(@builtin(local_invocation_index) i: u32) {{
            let x = input[i];
            let m = modf(x);
            let f = frexp(x);
            let v = modf(vec2f(x, 1.25));
            let p = 12u * i;
            result[p] = bitcast<u32>(m.fract);
            result[p + 1u] = bitcast<u32>(m.whole);
            result[p + 2u] = bitcast<u32>(f.fract);
            result[p + 3u] = bitcast<u32>(f.exp);
            result[p + 4u] = bitcast<u32>(ldexp(f.fract, f.exp));
            result[p + 5u] = bitcast<u32>(v.fract.y + v.whole.x);
            result[p + 6u] = bitcast<u32>(i32(x));
            result[p + 7u] = u32(x);
            result[p + 8u] = bitcast<u32>(round(x));
            result[p + 9u] = bitcast<u32>(fract(x) + floor(x) * 0.5 + ceil(x) * 0.25 + trunc(x) * 0.125);
            result[p + 10u] = select(0u, 1u, bool(x)) + u32(bool(i)) * 2u + u32(f32(true)) * 4u;
            result[p + 11u] = bitcast<u32>(f32(bitcast<i32>(x)) + f32(bitcast<u32>(x)));
        }}"
    );
    let got = run(&source, [1, 1, 1], 16 * 12, &[&bits(&values)]);
    for (i, &x) in values.iter().enumerate() {
        let g = &got[12 * i..12 * i + 12];
        let f = |k: usize| f32::from_bits(g[k]);
        assert_eq!((f(0), f(1)), (x - x.trunc(), x.trunc()), "modf of {x}");
        assert!(x == 0.0 && f(2) == 0.0 || (0.5..1.0).contains(&f(2).abs()), "frexp of {x}");
        assert_eq!(f64::from(f(2)) * 2f64.powi(g[3] as i32), f64::from(x), "frexp of {x}");
        assert_eq!(f(4), x, "ldexp of frexp of {x}");
        assert_eq!(f(5), 0.25 + x.trunc());
        assert_eq!(g[6] as i32, (x as i32).min(2_147_483_520), "i32({x})");
        assert_eq!(g[7], (x as u32).min(4_294_967_040), "u32({x})");
        assert_eq!(f(8), x.round_ties_even(), "round({x})");
        let (fl, ce, tr) = (x.floor(), x.ceil(), x.trunc());
        assert_eq!(f(9), (((x - fl) + fl * 0.5) + ce * 0.25) + tr * 0.125, "parts of {x}");
        assert_eq!(g[10], u32::from(x != 0.0) + u32::from(i != 0) * 2 + 4);
        assert_eq!(f(11), (x.to_bits() as i32) as f32 + x.to_bits() as f32);
    }
}

/// Products of matrices and vectors of every shape, columns chosen at run time, transposed and written one component at a time.
#[test]
fn matrices() {
    let mut next = unit_noise(21);
    let input: Vec<f32> = (0..64).map(|_| 4.0 * next() - 2.0).collect();
    let source = format!(
        "{RESULT}
        @group(0) @binding(1) var<storage, read> input: array<f32, 64>;
        fn m34(at: u32) -> mat3x4f {{
            var m: mat3x4f;
            for (var k = 0u; k < 12u; k++) {{ m[k / 4u][k % 4u] = input[at + k]; }}
            return m;
        }}
        fn m42(at: u32) -> mat4x2f {{
            return mat4x2f(input[at], input[at + 1u], input[at + 2u], input[at + 3u], input[at + 4u], input[at + 5u],
                input[at + 6u], input[at + 7u]);
        }}
        @compute @workgroup_size(1) fn main() {{
            let a = m34(0u);
            let b = m42(12u);
            let p = b * a; // mat3x2
            for (var c = 0u; c < 3u; c++) {{ for (var r = 0u; r < 2u; r++) {{ result[c * 2u + r] = bitcast<u32>(p[c][r]); }} }}
            let v = a * vec3f(input[20], input[21], input[22]);
            let w = vec2f(input[23], input[24]) * b;
            for (var k = 0u; k < 4u; k++) {{ result[6u + k] = bitcast<u32>(v[k]); result[10u + k] = bitcast<u32>(w[k]); }}
            let t = transpose(a); // mat4x3
            for (var k = 0u; k < 12u; k++) {{ result[14u + k] = bitcast<u32>(t[k / 3u][k % 3u]); }}
            let s = mat3x3f(a[0].xyz, a[1].xyz, a[2].xyz);
            result[26] = bitcast<u32>(determinant(s));
            var sum = (a + a * 2.0) - m34(12u);
            sum[1] *= 3.0;
            result[27] = bitcast<u32>(sum[1].z);
            result[28] = bitcast<u32>(sum[2].w);
        }}"
    );
    let got = floats(&run(&source, [1, 1, 1], 29, &[&bits(&input)]));
    let at = |k: usize| f64::from(input[k]);
    let a = |c: usize, r: usize| at(4 * c + r);
    let b = |c: usize, r: usize| at(12 + 2 * c + r);
    let near = |k: usize, want: f64| assert_near(got[k], want, 1e-5, 1e-5, &format!("result {k}"));
    for c in 0..3 {
        for r in 0..2 {
            near(c * 2 + r, (0..4).map(|k| b(k, r) * a(c, k)).sum());
        }
    }
    for k in 0..4 {
        near(6 + k, (0..3).map(|c| a(c, k) * at(20 + c)).sum());
        near(10 + k, (0..2).map(|r| at(23 + r) * b(k, r)).sum());
    }
    for k in 0..12 {
        near(14 + k, a(k % 3, k / 3));
    }
    let det = a(0, 0) * (a(1, 1) * a(2, 2) - a(2, 1) * a(1, 2)) - a(1, 0) * (a(0, 1) * a(2, 2) - a(2, 1) * a(0, 2))
        + a(2, 0) * (a(0, 1) * a(1, 2) - a(1, 1) * a(0, 2));
    near(26, det);
    near(27, 3.0 * (3.0 * a(1, 2) - at(12 + 6)));
    near(28, 3.0 * a(2, 3) - at(12 + 11));
}

/// Structs and arrays as values: nested, copied, returned, indexed at run time by several indices at once.
#[test]
fn composites_as_values() {
    check_each(
        "struct Leaf { w: array<u32, 3>, m: mat2x2f }
         struct Tree { leaves: array<array<Leaf, 2>, 3>, tag: u32 }
         const POWERS = array<vec2u, 5>(vec2u(1u), vec2u(2u, 4u), vec2u(3u, 9u), vec2u(4u, 16u), vec2u(5u, 25u));
         fn make(seed: u32) -> Tree {
             var t: Tree;
             for (var a = 0u; a < 3u; a++) {
                 for (var b = 0u; b < 2u; b++) {
                     for (var c = 0u; c < 3u; c++) { t.leaves[a][b].w[c] = seed + a * 100u + b * 10u + c; }
                     t.leaves[a][b].m[b][1u - b] = f32(a);
                 }
             }
             t.tag = seed;
             return t;
         }
         fn flip(t: Tree) -> Tree { var r = t; r.leaves[0] = t.leaves[2]; r.leaves[2][1] = t.leaves[0][0]; return r; }",
        "var t = make(i);
         let kept = t;
         t = flip(t);
         t.leaves[i % 3u][i % 2u].w[(i / 2u) % 3u] += 5000u;
         var sum = 0u;
         for (var a = 0u; a < 3u; a++) { for (var b = 0u; b < 2u; b++) { for (var c = 0u; c < 3u; c++) {
             sum = sum * 3u + t.leaves[a][b].w[c];
         } } }
         let leaf = t.leaves[2][i & 1u];
         result[i] = sum + kept.leaves[i % 3u][1].w[2] + u32(leaf.m[i & 1u].x * 7.0) + POWERS[i % 5u].y + t.tag;",
        |i| {
            let mut t = [[[0u32; 3]; 2]; 3];
            for a in 0..3u32 {
                for b in 0..2 {
                    for c in 0..3 {
                        t[a as usize][b as usize][c as usize] = i + a * 100 + b * 10 + c;
                    }
                }
            }
            // Column `b` of a leaf's matrix has `a` in its other row; only that number of leaf (a, b) is not zero.
            let mut m = [[(0, 0), (0, 1)], [(1, 0), (1, 1)], [(2, 0), (2, 1)]];
            let kept = t;
            t[0] = kept[2];
            m[0] = [(2, 0), (2, 1)];
            t[2][1] = kept[0][0];
            m[2][1] = (0, 0);
            t[(i % 3) as usize][(i % 2) as usize][(i / 2 % 3) as usize] += 5000;
            let sum = t.iter().flatten().flatten().fold(0u32, |s, &w| s.wrapping_mul(3).wrapping_add(w));
            let (a, b) = m[2][(i & 1) as usize];
            // m[b][1 - b] = a; its x is read from column i & 1.
            let x = if b == (i & 1) && 1 - b == 0 { a } else { 0 };
            let power = [1, 4, 9, 16, 25][(i % 5) as usize];
            sum.wrapping_add(kept[(i % 3) as usize][1][2] + x * 7 + power + i)
        },
    );
}

/// Constants of the pipeline: by number and by name, in expressions, as the size of a workgroup and of an array.
#[test]
fn pipeline_constants_shape_a_program() {
    let source = format!(
        "{RESULT}
        @id(7) override size: u32 = 4;
        override factor: f32;
        override twice: f32 = factor * 2.0;
        override enabled = false;
        override shift: i32 = -3;
        var<workgroup> part: array<u32, size * 2u>;
        @compute @workgroup_size(size, 2) fn main(@builtin(local_invocation_index) i: u32) {{
            part[i] = i * i;
            workgroupBarrier();
            result[i] = part[size * 2u - 1u - i];
            if i == 0u {{
                result[60] = u32(twice * 4.0);
                result[61] = select(5u, 6u, enabled);
                result[62] = bitcast<u32>(shift);
                result[63] = arrayLength(&result);
            }}
        }}"
    );
    let mut lab = Lab::new();
    let result = lab.words(64);
    let shader = lab.card.create_shader("program", &source);
    let constants = [("7", 16.0), ("factor", 1.375), ("enabled", 1.0)].map(|(name, value)| (name.to_owned(), value));
    let stage = StageDesc { constants: constants.to_vec(), ..record::stage(shader) };
    let pipeline = lab.card.create_compute_pipeline("", None, stage);
    lab.dispatch(pipeline, [1, 1, 1], [record::whole(result)]);
    let got = lab.read(result, 64);
    for i in 0..32u32 {
        assert_eq!(got[i as usize], (31 - i) * (31 - i));
    }
    assert_eq!(got[60..], [11, 6, -3i32 as u32, 64]);
}

/// 16-bit numbers: stored in two bytes, rounded after every operation.
#[test]
fn half_precision_numbers() {
    let source = "
        enable f16;
        struct Data { a: f16, b: vec3<f16>, m: mat2x3<f16>, c: array<f16> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read_write> data: Data;
        @compute @workgroup_size(1) fn main() {
            result[0] = arrayLength(&data.c);
            result[1] = bitcast<u32>(f32(data.a));
            result[2] = bitcast<u32>(f32(data.b.z));
            result[3] = bitcast<u32>(f32(data.m[1].y));
            result[4] = bitcast<u32>(f32(data.a + 1.0h));
            data.c[3] = data.c[2] * 3.0h;
            result[5] = bitcast<u32>(f32(f16(f32(data.c[3]) / 3.0)));
        }";
    // a at 0; b at 8, 10, 12; m: columns at 16 and 24; c from 32 on.
    let mut halves = [0u16; 40];
    let half = |x: f32| {
        // Numbers that are exact in 16 bits.
        let bits = x.to_bits();
        ((bits >> 16 & 0x8000) | (((bits >> 23 & 0xff) as i32 - 112) as u32) << 10 | (bits >> 13 & 0x3ff)) as u16
    };
    halves[0] = half(2048.0);
    halves[6] = half(0.5);
    halves[13] = half(-7.25);
    halves[18] = half(333.0);
    let words: Vec<u32> = halves.chunks(2).map(|h| u32::from(h[0]) | u32::from(h[1]) << 16).collect();
    let mut lab = Lab::new();
    let (result, data) = (lab.words(64), lab.card.create_buffer_init("data", bytes(&words[..12])));
    let pipeline = lab.compute(source);
    lab.dispatch(pipeline, [1, 1, 1], [record::whole(result), record::whole(data)]);
    let copy = lab.words(64);
    lab.card.copy_buffer_to_buffer((data, 36), (result, 40), 4);
    lab.card.copy_buffer_to_buffer((result, 0), (copy, 0), 256);
    let got = lab.read(copy, 11);
    // 2048 + 1 is no 16-bit number: ties to even.
    assert_eq!(got[..6], [8, 2048f32.to_bits(), 0.5f32.to_bits(), (-7.25f32).to_bits(), 2048f32.to_bits(), 333f32.to_bits()]);
    assert_eq!(got[10], u32::from(half(333.0)) | u32::from(half(999.0)) << 16);
}

/// Operations over a subgroup, which is 64 invocations: reductions, scans, votes, shuffles, and in a divergent branch.
#[test]
fn subgroups() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<vec4u>;
        @compute @workgroup_size(128) fn main(
            @builtin(local_invocation_index) i: u32, @builtin(subgroup_size) size: u32,
            @builtin(subgroup_invocation_id) lane: u32, @builtin(subgroup_id) id: u32, @builtin(num_subgroups) n: u32,
        ) {
            let sum = subgroupAdd(i);
            let before = subgroupExclusiveAdd(1u);
            let most = subgroupMax(i * 7u % 64u);
            let ballot = subgroupBallot(lane % 3u == 0u);
            let first = subgroupBroadcastFirst(i);
            let swapped = subgroupShuffleXor(i, 1u);
            let up = subgroupShuffleUp(i, 2u);
            var odd = 0u;
            if i % 2u == 1u { odd = subgroupAdd(1u) + subgroupInclusiveMul(1u) * 100u + select(0u, 1000u, subgroupAll(i % 2u == 1u)); }
            result[2u * i] = vec4u(sum, before, most, countOneBits(ballot.x) + countOneBits(ballot.y));
            result[2u * i + 1u] = vec4u(first, swapped, select(up, 0u, lane < 2u), odd + size + 10000u * id + 100000u * n);
        }";
    let got = run(source, [1, 1, 1], 128 * 8, &[]);
    for i in 0..128u32 {
        let (lane, group) = (i % 64, i / 64);
        let sum = (0..64).map(|k| group * 64 + k).sum::<u32>();
        let odd = if i % 2 == 1 { 32 + 100 + 1000 } else { 0 };
        let expected =
            [sum, lane, 63, 22, group * 64, i ^ 1, if lane < 2 { 0 } else { i - 2 }, odd + 64 + 10_000 * group + 200_000];
        assert_eq!(got[8 * i as usize..8 * i as usize + 8], expected, "invocation {i}");
    }
}

/// What is asked of a program and cannot be had is refused when the trace names it, with the module and the place in it.
#[test]
fn what_is_not_supported_is_refused_by_name() {
    let main = "@compute @workgroup_size(1) fn main() {";
    for size in ["65535, 65535, 1", "none, 1, 1"] {
        let mut lab = Lab::new();
        let text = format!("override none = 0u; @compute @workgroup_size({size}) fn main() {{}}");
        let shader = lab.card.create_shader("program", &text);
        let message = lab.refusal_of(shader);
        assert!(message.to_lowercase().contains("workgroup") && message.contains("main"), "{message}");
    }
    let cases = [
        ("@group(0) @binding(0) var t: texture_external;", "{ _ = textureDimensions(t); }", "external"),
        ("@group(0) @binding(0) var<storage, read_write> a: array<f64>;", "{ a[0] = 1.0lf; }", "SHADER_F64"),
        ("@group(0) @binding(0) var<storage, read_write> a: array<i64>;", "{ a[0] = 1li; }", "SHADER_INT64"),
        ("@group(0) @binding(0) var<storage, read_write> a: atomic<u64>;", "{ atomicAdd(&a, 1lu); }", "SHADER_INT64"),
        (
            "enable wgpu_ray_query; @group(0) @binding(0) var s: acceleration_structure;",
            "{ var q: ray_query; rayQueryInitialize(&q, s, RayDesc(0u, 255u, 0.1, 9.0, vec3f(), vec3f(1.0))); }",
            "RAY_QUERY",
        ),
    ];
    for (declarations, body, named) in cases {
        let mut lab = Lab::new();
        let shader = lab.card.create_shader("program", &format!("{declarations}\n{main}\n{body}\n}}"));
        let message = lab.refusal_of(shader);
        assert!(message.to_lowercase().contains(&named.to_lowercase()), "`{message}` does not name {named}");
        assert!(message.contains("program.wgsl") && message.contains("command"), "{message}");
    }
}
