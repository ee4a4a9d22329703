//! Valid WGSL that naga 30 refuses or lays out wrongly, and what it must leave.

use shader::{Module, ModuleSource, Options, Stage, compile};

use crate::trees::run;

/// Runs 64 invocations of a program that has `results` and `inputs`.
#[track_caller]
fn results(globals: &str, body: &str) -> Vec<u32> {
    let text = text(globals, body);
    let inputs: Vec<u32> = (0..64).collect();
    run(ModuleSource::Wgsl(&text), &inputs).unwrap_or_else(|error| panic!("{error}\n{text}"))
}

fn text(globals: &str, body: &str) -> String {
    // Directives come first.
    let (directives, globals) = globals.split_once("###").unwrap_or(("", globals));
    format!(
        "{directives} @group(0) @binding(0) var<storage, read_write> results: array<u32, 64>;
@group(0) @binding(1) var<storage, read> inputs: array<u32, 64>;
{globals}
@compute @workgroup_size(64) fn main(@builtin(local_invocation_index) id: u32) {{
let x = inputs[id]; var r = 0u;
{body}
results[id] = r;
}}"
    )
}

#[track_caller]
fn each(globals: &str, body: &str, expected: impl Fn(u32) -> u32) {
    let got = results(globals, body);
    for (x, got) in (0..64).zip(got) {
        assert_eq!(got, expected(x), "of {x}: {globals} {body}");
    }
}

#[track_caller]
fn all(globals: &str, body: &str, expected: u32) {
    each(globals, body, |_| expected);
}

/// What is said of a program that is refused.
#[track_caller]
fn refused(globals: &str, body: &str) -> String {
    let text = text(globals, body);
    let module = match Module::new("refused", ModuleSource::Wgsl(&text)) {
        Err(error) => return error.to_string(),
        Ok(module) => module,
    };
    compile(&module, Stage::Compute, None, &Options::default()).expect_err("it is refused").to_string()
}

#[test]
fn functions_may_end_with_a_loop_that_returns() {
    let next = |x: u32| x.next_multiple_of(7);
    each("fn f(n: u32) -> u32 { var k = n; loop { if k % 7u == 0u { return k; } k += 1u; } }", "r = f(x);", next);
    each("fn f(n: u32) -> u32 { for (var k = n;; k++) { if k % 7u == 0u { return k; } } }", "r = f(x);", next);
    each(
        "fn f(n: u32) -> u32 { var k = n; if n > 9u { loop { switch k % 7u { case 0u: { return k; } default: { k++; continue; } } } } \
         else { loop { loop { if k % 7u == 0u { break; } k++; } return k; } } }",
        "r = f(x);",
        next,
    );
    each("fn f(n: u32) -> u32 { switch n { case 3u: { loop { return 1u; } } default: { return 2u; } } }", "r = f(x);", |x| {
        if x == 3 { 1 } else { 2 }
    });
    for body in [
        "",
        "if n == 1u { return 2u; }",
        "loop { if n == 3u { break; } return 2u; }",
        "while true { return 2u; }",
        "loop { continuing { break if n == 1u; } }",
    ] {
        let message = refused(&format!("fn f(n: u32) -> u32 {{ {body} }}"), "r = f(x);");
        assert!(message.contains("function `f`") && message.contains("without `return`"), "{body}: {message}");
        assert!(body.is_empty() || message.contains(", 3:"), "{message}");
    }
    let message = refused("fn f(n: u32) -> u32 { if n == 1u { return; } return 2u; }", "r = f(x);");
    assert!(message.contains("return"), "{message}");
}

#[test]
fn built_in_functions_of_literals_have_values() {
    let f = |x: f32| x.to_bits();
    for (call, bits) in [
        ("mix(1.0, 3.0, 0.5)", f(2.0)),
        ("mix(1, 3, 0.25)", f(1.5)),
        ("smoothstep(0.0, 1.0, 0.25)", f(0.15625)),
        ("determinant(mat2x2(1.0, 2.0, 3.0, 4.5))", f(-1.5)),
        ("transpose(mat2x3(1.0, 2.0, 3.0, 4.0, 5.0, 6.0))[2][1]", f(6.0)),
        ("mix(vec2(1.0, 2.0), vec2(3.0), 0.5).y", f(2.5)),
        ("2.0 * mix(mix(1.0, 3.0, 0.5), 4.0, 0.5)", f(6.0)),
        ("faceForward(vec2(1.0, 2.0), vec2(1.0, 0.0), vec2(1.0, 0.0)).y", f(-2.0)),
        ("reflect(vec2(1.0, -1.0), vec2(0.0, 1.0)).y", f(1.0)),
        ("ldexp(1.5, 3)", f(12.0)),
        ("frexp(6.0).fract", f(0.75)),
        ("modf(2.75).fract", f(0.75)),
        ("quantizeToF16(1.0009)", f(1.000_976_562_5)),
        ("unpack2x16float(0x3c004000u).x", f(2.0)),
        ("bitcast<f32>(0x40490fdbu)", 0x4049_0fdb),
        ("refract(vec2(0.0, -1.0), vec2(0.0, 1.0), 0.5).y", f(-1.0)),
    ] {
        all("", &format!("let v = {call}; r = bitcast<u32>(v);"), bits);
        all("", &format!("var v = {call}; r = bitcast<u32>(v);"), bits);
        all("", &format!("const v = {call}; r = bitcast<u32>(f32(v));"), bits);
        all(&format!("const v = {call};"), "r = bitcast<u32>(f32(v));", bits);
    }
    for (call, value) in [
        ("pack4x8unorm(vec4(1.0, 0.0, 0.5, 0.2))", 0x3380_00ff),
        ("pack4xI8Clamp(vec4(200, -200, 1, -1))", 0xff01_807f),
        ("pack2x16float(vec2(1.0, 2.0))", 0x4000_3c00),
        ("extractBits(0xabcdu, 4u, 8u)", 0xbc),
        ("bitcast<u32>(1.0f)", 0x3f80_0000),
        ("u32(frexp(6.0).exp)", 3),
        ("vec2(bitcast<u32>(-1i), 2u).x", u32::MAX),
    ] {
        all("", &format!("const v = {call}; r = v;"), value);
        all(&format!("const v = {call}; const w = v;"), "r = w;", value);
    }
    // Constants that others need, of types that the text has; a length.
    all(
        "struct S { a: f32, b: vec2f } const s = S(2.0, vec2f(4.0, 8.0)); alias F = f32; const k = F(s.a);",
        "const half = 0.5; const v = mix(k, s.b.y, half); r = u32(v);",
        5,
    );
    // The last element is the one that an index outside leads to.
    all("const n = pack4xU8(vec4(3u, 0u, 0u, 0u)); var<private> a: array<u32, n>;", "a[2] = 7u; r = a[min(x + 9u, 100u)];", 7);
    // What is no constant stays none, and the place is that of the text.
    let message = refused("override o: f32 = 1.0;", "\nconst v = mix(1.0, 2.0, o);");
    assert!(message.contains(", 7:"), "{message}");
    let message = refused("", "const v = unpack2x16float(0x7c00u).x;");
    assert!(message.contains("inf"), "{message}");
}

#[test]
fn directives_and_diagnostics_that_change_nothing_are_taken() {
    each("enable subgroups; ###", "r = subgroupAdd(x);", |_| 63 * 32);
    each("enable f16, subgroups; ###", "r = u32(f16(x)) + u32(subgroupElect());", |x| x + u32::from(x == 0));
    each("enable subgroups; ###", "if x > 5u { r = select(1u, 2u, subgroupElect()); }", |x| match x {
        0..=5 => 0,
        6 => 2,
        _ => 1,
    });
    each("requires unrestricted_pointer_parameters, pointer_composite_access; ###", "r = x;", |x| x);
    each(
        "@diagnostic(off, derivative_uniformity) fn f(x: u32) -> u32 @diagnostic(warning, derivative_uniformity) { return x; }",
        "@diagnostic(off, derivative_uniformity) if x > 3u @diagnostic(off, derivative_uniformity) { r = 1u; } \
         @diagnostic(off, derivative_uniformity) for (var i = 0u; i < 2u; i++) { r += f(2u); } \
         @diagnostic(info, derivative_uniformity) { r += 1u; } \
         @diagnostic(off, derivative_uniformity) loop @diagnostic(off, derivative_uniformity) { break; } \
         @diagnostic(off, derivative_uniformity) while false { } \
         @diagnostic(off, derivative_uniformity) switch x @diagnostic(off, derivative_uniformity) { default { r += 1u; } }",
        |x| 6 + u32::from(x > 3),
    );
    for (globals, body) in
        [("enable nonsense; ###", ""), ("requires nonsense; ###", ""), ("", "@diagnostic(loud, x) if x > 1u { }")]
    {
        assert!(refused(globals, body).contains("refused"), "{globals} {body}");
    }
    // Errors after what was taken out keep their places.
    let message = refused("enable subgroups;\nenable f16;###", "r = nothing;");
    assert!(message.contains("7:5") && message.contains("nothing"), "{message}");
}

#[test]
fn components_in_any_order_are_assigned() {
    each("", "var v = vec4u(1u, 2u, 3u, x); v.zx = v.xw; r = v.x * 100u + v.y * 10u + v.z;", |x| 100 * x + 20 + 1);
    each("", "var v = vec3f(1, 2, 3); v.yz += vec2f(1.0, f32(x)); v.xy *= 2; r = u32(v.x * 100.0 + v.y * 10.0 + v.z);", |x| {
        200 + 60 + 3 + x
    });
    each("", "var v = vec3i(1, 2, 3); v.rgb = v.bgr; r = u32(v.r * 100 + v.g * 10 + v.b) + x;", |x| 321 + x);
    each("", "var v = vec2u(7u); v.yx <<= vec2(1u, 2u); r = v.x * 100u + v.y;", |_| 2814);
    each(
        "struct S { v: array<vec3u, 3> } var<private> s: S; var<private> i: u32; fn next() -> u32 { i += 1u; return i; }",
        "s.v[next()].zy = vec2u(next(), x); r = s.v[1].y * 100u + s.v[1].z * 10u + i;",
        |x| 100 * x + 20 + 2,
    );
    each(
        "fn f(p: ptr<function, vec3u>) { (*p).xz = (*p).zx; p.zy = p.yz; }",
        "var v = vec3u(1u, 2u, x); f(&v); r = v.x * 10u + v.y * 10u + v.z;",
        |x| 10 * x + 10 + 2,
    );
    for body in ["var v = vec2u(); v.xx = vec2u();", "let v = vec2u(); v.yx = vec2u();", "var v = vec2u(); v.xz = vec2u();"] {
        let message = refused("", body);
        assert!(message.contains("refused"), "{message}");
    }
}

#[test]
fn words_are_cast_to_halves_and_back() {
    let half = "enable f16; ###";
    each(half, "let h = bitcast<vec2<f16>>(0x3c004000u + x * 0u); r = u32(h.x * 10.0h + h.y);", |_| 21);
    each(half, "let h = bitcast<vec2h>(i32(0x3c004000u)); r = bitcast<u32>(-h);", |_| 0xbc00_c000);
    each(half, "let h = vec2h(1.0h, f16(x)); let w: u32 = bitcast<u32>(h); r = w & 0xffffu;", |_| 0x3c00);
    each(half, "let h = vec2h(2.0h, 1.0h); r = u32(bitcast<i32>(h)) + bitcast<u32>(bitcast<f32>(h));", |_| 0x7800_8000);
    each(
        half,
        "let h = bitcast<vec4h>(vec2u(0x3c004000u, 0x42000000u)); let w = bitcast<vec2u>(h * 1.0h); r = w.x ^ w.y;",
        |_| 0x3c00_4000 ^ 0x4200_0000,
    );
}

#[test]
fn a_cast_of_halves_to_their_own_type_changes_nothing() {
    let half = "enable f16; ### alias Pair = vec2<f16>; alias Twin = Pair; alias Four = vec4h;";
    each(half, "r = u32(bitcast<f16>(f16(x) + 0.5h) * 2.0h);", |x| 2 * x + 1);
    each(half, "let h = vec3h(f16(x), 1.0h, 2.0h); let k = bitcast<vec3<f16>>(h); r = u32(k.x * 4.0h + k.y + k.z);", |x| {
        4 * x + 3
    });
    for ty in ["vec2<f16>", "vec2h", "Pair", "Twin"] {
        let body = format!("let h = {ty}(f16(x), 3.0h); let k = bitcast<{ty}>(h); r = u32(k.x * 4.0h + k.y);");
        each(half, &body, |x| 4 * x + 3);
        let body = format!("let h = bitcast<{ty}>(0x3c004000u + x * 0u); r = u32(h.x * 10.0h + h.y) + bitcast<u32>(h);");
        each(half, &body, |_| 21 + 0x3c00_4000);
    }
    for ty in ["vec4<f16>", "vec4h", "Four"] {
        let body = format!(
            "let h = {ty}(f16(x), 3.0h, 1.0h, 2.0h); let k = bitcast<{ty}>(h); r = u32(dot(k, {ty}(4.0h, 1.0h, 10.0h, 20.0h)));"
        );
        each(half, &body, |x| 4 * x + 53);
    }
    // Aliases in a circle are an error of naga's.
    let message = refused("enable f16; ### alias A = B; alias B = A;", "let h = bitcast<A>(f16(1.0h)); r = u32(h);");
    assert!(message.contains("cycl") || message.contains("recursive"), "{message}");
}

#[test]
fn functions_take_pointers_to_memory() {
    let globals = "
        struct Item { a: u32, v: vec3u, list: array<u32, 4> }
        var<workgroup> pool: array<Item, 64>;
        var<workgroup> total: atomic<u32>;
        fn add(p: ptr<storage, u32, read_write>, n: u32) -> u32 { let old = *p; *p += n; return old; }
        fn put(item: ptr<workgroup, Item>, n: u32) { (*item).a = n; item.v.y = n + 1u; fill(&(*item).list, n); fill(&item.list, n + 1u); }
        fn fill(list: ptr<workgroup, array<u32, 4>>, n: u32) { store(&(*list)[n & 3u], n); }
        fn store(p: ptr<workgroup, u32>, n: u32) { *p = n; }
        fn sum(list: ptr<workgroup, array<u32, 4>>) -> u32 { var s = 0u; for (var i = 0; i < 4; i++) { s += list[i]; } return s; }
        fn count(p: ptr<workgroup, atomic<u32>>) { atomicAdd(p, 1u); }
        fn fetch(p: ptr<storage, array<u32, 64>>, n: u32) -> u32 { if n > 60u { return 5u; } return (*p)[n + 3u]; }
        fn swap(p: ptr<function, u32>, q: ptr<workgroup, Item>) { let t = *p; *p = q.a; q.a = t; }
        fn unused(p: ptr<workgroup, Item>) { put(p, 1u); }
    ";
    let body = "
        put(&pool[id], x); count(&total); workgroupBarrier();
        let other = &pool[63u - id];
        var local = 1000u;
        r = sum(&(*other).list) + fetch(&inputs, x) + atomicLoad(&total);
        swap(&local, &pool[id]);
        r += local * 1000u + add(&results[id], 7u) + results[id] + pool[id].v.y;
    ";
    each(globals, body, |x| {
        let other = 63 - x;
        let read = if x > 60 { 5 } else { x + 3 };
        (2 * other + 1) + read + 64 + x * 1000 + 7 + x + 1
    });
    let message = refused(
        "fn f(p: ptr<storage, u32, read_write>) { g(p); } fn g(p: ptr<workgroup, u32>) { *p = 1u; }",
        "f(&results[id]);",
    );
    assert!(message.contains("refused"), "{message}");
}

#[test]
fn structures_keep_the_alignments_of_their_members() {
    // Written by words, read by name: `b` is at byte 16 of `Outer`, whose size is a multiple of 16.
    let globals = "
        const N = 16;
        struct Inner { @align(N) a: u32, b: u32 } alias Also = Inner;
        struct Outer { x: u32, i: Also, @size(20) y: u32 }
        struct Deep { x: u32, o: array<Outer, 2>, z: u32 }
        @group(0) @binding(1) var<storage, read> deep: Deep;";
    let text = text(globals, "r = 0u;").replace("@group(0) @binding(1) var<storage, read> inputs: array<u32, 64>;", "");
    let text = text.replace("let x = inputs[id];", "").replace("r = 0u;\nresults", "results");
    let text = text.replace(
        "results[id] = r;",
        "results[0] = deep.x; results[1] = deep.o[0].x; results[2] = deep.o[0].i.a; results[3] = deep.o[0].i.b; \
         results[4] = deep.o[0].y; results[5] = deep.o[1].i.b; let i = id / 64u; results[6] = deep.o[1 - i].y; results[7] = deep.z; \
         let copy = deep.o[1]; results[8] = copy.i.a;",
    );
    let inputs: Vec<u32> = (0..64).collect();
    let got = run(ModuleSource::Wgsl(&text), &inputs).unwrap_or_else(|error| panic!("{error}\n{text}"));
    // Outer: x at 0, i at 16 (16 bytes), y at 32 (20 bytes): 64 bytes. Deep: x at 0, o at 16, z at 144.
    assert_eq!(got[..9], [0, 4, 8, 9, 12, 25, 28, 36, 24]);

    let uniform = |inner: &str| {
        let text = format!(
            "struct I {{ {inner} }} struct O {{ a: f32, i: I }} @group(0) @binding(0) var<uniform> u: O;
             @fragment fn main() -> @location(0) vec4f {{ return vec4f(u.i.b); }}"
        );
        Module::new("uniform", ModuleSource::Wgsl(&text)).map(|_| ())
    };
    assert_eq!(uniform("@align(16) b: f32"), Ok(()));
    assert_eq!(uniform("@align(32) b: f32"), Ok(()));
    assert!(uniform("b: f32").is_err_and(|error| error.to_string().contains("lignment")));
    let low = "struct I { @align(16) b: f32 }\nstruct O { a: f32, @align(8) i: I }\n@fragment fn main() { }";
    let error = Module::new("low", ModuleSource::Wgsl(low)).expect_err("too low").to_string();
    assert!(error.contains("2:30") && error.contains("less than the alignment"), "{error}");
}
