//! Control flow under divergence.

use super::*;

#[track_caller]
fn check(body: &str, expected: impl Fn(u32) -> u32) {
    let got = each_u32(body, |i| i);
    for i in 0..64 {
        assert_eq!(got[i as usize], expected(i), "invocation {i} of {body}");
    }
}

#[test]
fn ifs_merge_variables() {
    check("if (x % 2u == 0u) { r = x * 3u; } else { r = x + 100u; }", |x| if x % 2 == 0 { x * 3 } else { x + 100 });
    check("r = 7u; if (x > 20u) { if (x > 40u) { r = 1u; } r += 10u; } else if (x == 3u) { r = 99u; }", |x| match x {
        41.. => 11,
        21.. => 17,
        3 => 99,
        _ => 7,
    });
}

#[test]
fn loops_diverge() {
    check("for (var k = 0u; k < x; k++) { r += k; }", |x| (0..x).sum());
    check("loop { if (r * r > x) { break; } r++; }", |x| (0..).find(|r| r * r > x).unwrap_or(0));
    check("var k = x; while (k != 0u) { r = r * 2u + (k & 1u); k >>= 1u; }", |x| {
        let (mut k, mut r) = (x, 0);
        while k != 0 {
            r = r * 2 + (k & 1);
            k >>= 1;
        }
        r
    });
    check("for (var k = 0u; k < x; k++) { if (k % 3u == 0u) { continue; } if (k > 30u) { break; } r += k; }", |x| {
        (0..x).filter(|k| k % 3 != 0).take_while(|k| *k <= 30).sum()
    });
}

#[test]
fn nested_loops_leave_the_right_one() {
    check(
        "for (var a = 0u; a < x; a++) { for (var b = 0u; b < 10u; b++) { if (a + b > 20u) { break; } if (b == a) { continue; } r += 1u; } if (a == 13u) { break; } }",
        |x| {
            let mut r = 0;
            for a in 0..x {
                for b in 0..10 {
                    if a + b > 20 {
                        break;
                    }
                    if b == a {
                        continue;
                    }
                    r += 1;
                }
                if a == 13 {
                    break;
                }
            }
            r
        },
    );
}

#[test]
fn variables_swap_in_loops() {
    check("var a = 0u; var b = 1u; for (var k = 0u; k < x % 20u; k++) { let t = a; a = b; b = t + b; } r = a;", |x| {
        let (mut a, mut b) = (0u32, 1u32);
        for _ in 0..x % 20 {
            (a, b) = (b, a + b);
        }
        a
    });
    check(
        "var a = x; var b = 63u - x; var k = 0u; loop { if (k >= x % 5u) { break; } let t = a; a = b; b = t; continuing { k++; } } r = a * 100u + b;",
        |x| if x % 5 % 2 == 0 { x * 100 + 63 - x } else { (63 - x) * 100 + x },
    );
}

#[test]
fn continuing_sees_values_of_the_body() {
    check(
        "var k = 0u; loop { let old = k; if (x % 4u == 1u) { continue; } r += 10u; continuing { k = old + 1u; r += old; break if k > x % 7u; } }",
        |x| {
            let (mut k, mut r) = (0, 0);
            loop {
                let old = k;
                if x % 4 != 1 {
                    r += 10;
                }
                k = old + 1;
                r += old;
                if k > x % 7 {
                    break;
                }
            }
            r
        },
    );
}

#[test]
fn switches() {
    check(
        "switch (x % 6u) { case 0u: { r = 5u; } case 1u, 2u: { r = 6u; if (x > 30u) { break; } r += 100u; } case 4u: { r = x; } default: { r = 77u; } }",
        |x| match x % 6 {
            0 => 5,
            1 | 2 => {
                if x > 30 {
                    6
                } else {
                    106
                }
            }
            4 => x,
            _ => 77,
        },
    );
    check(
        "for (var k = 0u; k < 8u; k++) { switch (k) { case 2u: { if (x > 10u) { continue; } r += 1u; } case 5u: { break; } default: { r += k; } } if (k == x) { break; } }",
        |x| {
            let mut r = 0;
            for k in 0..8 {
                match k {
                    2 => {
                        if x > 10 {
                            continue;
                        }
                        r += 1;
                    }
                    5 => {}
                    _ => r += k,
                }
                if k == x {
                    break;
                }
            }
            r
        },
    );
    check("switch (x) { default: { r = 3u; if (x < 5u) { break; } r = 4u; } }", |x| if x < 5 { 3 } else { 4 });
}

#[test]
fn functions_return_from_anywhere() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        var<private> count: u32;
        fn find(x: u32) -> u32 {
            for (var a = 2u; a < 50u; a++) {
                count++;
                if (x < 4u) { return 1000u; }
                for (var b = a; b < 50u; b++) {
                    if (a * b == x) { return a * 100u + b; }
                    if (a * b > x) { break; }
                }
            }
            count += 1000u;
            return 0u;
        }
        fn bump(p: ptr<function, u32>, x: u32) { if (x % 2u == 0u) { *p += 1u; return; } *p += 2u; }
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let x = input[id.x];
            var r = find(x);
            bump(&r, x);
            result[id.x] = r * 10000u + count;
        }";
    let got = each(source, |i| i);
    for x in 0..64u32 {
        let mut count = 0;
        let mut r = (|| {
            for a in 2..50 {
                count += 1;
                if x < 4 {
                    return 1000;
                }
                for b in a..50 {
                    if a * b == x {
                        return a * 100 + b;
                    }
                    if a * b > x {
                        break;
                    }
                }
            }
            count += 1000;
            0
        })();
        r += if x % 2 == 0 { 1 } else { 2 };
        assert_eq!(got[x as usize], r * 10000 + count, "x = {x}");
    }
}

#[test]
fn endless_loops_stop_with_their_place() {
    let source = "@group(0) @binding(0) var<storage, read_write> result: array<u32>;
@compute @workgroup_size(1) fn main() {
    var k = result[0];
    loop { k += 2u; if (k == 1u) { break; } }
    result[0] = k;
}";
    let p = program(source);
    let out = Words::new(4);
    let bindings = vec![vec![Resource::Buffer(BufferRange { words: &out, offset: 0, size: 4, address: 0 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let fault = executor.bind(&p, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect_err("it never ends");
    assert_eq!(fault.entry, "main");
    assert_eq!(fault.place.and_then(ShaderLocation::line), Some(4));
}

#[test]
fn workgroup_memory_and_barriers() {
    // Prefix sums over 200 invocations: four batches, the last one partly filled.
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        var<workgroup> sums: array<u32, 200>;
        @compute @workgroup_size(200) fn main(@builtin(local_invocation_index) i: u32, @builtin(workgroup_id) g: vec3u) {
            sums[i] = i + g.x;
            workgroupBarrier();
            for (var step = 1u; step < 200u; step *= 2u) {
                var add = 0u;
                if (i >= step) { add = sums[i - step]; }
                workgroupBarrier();
                sums[i] += add;
                workgroupBarrier();
            }
            result[g.x * 200u + i] = sums[i];
        }";
    let out = Words::new(4 * 600);
    run_with(&program(source), [3, 1, 1], &[(0, &out)]);
    for g in 0..3u32 {
        for i in 0..200u32 {
            assert_eq!(out.load((g * 200 + i) as usize), (0..=i).map(|k| k + g).sum::<u32>());
        }
    }
}
