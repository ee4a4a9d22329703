//! The oracle itself, on programs whose results were found by hand.

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{AddressMode, Aspect, BorderColor, FilterMode, SamplerDesc, TextureDimension, ViewDimension};
use gfx::texture::ViewRange;
use naga::BuiltIn;
use naga::valid::{Capabilities, ModuleInfo, ValidationFlags, Validator};

use crate::oracle::{Batch, BatchResult, Bindings, Fault, Io, Resource, Texture, run_batch, run_compute};

const STEPS: u64 = 1 << 20;

/// Parses and validates.
pub fn module(source: &str) -> (naga::Module, ModuleInfo) {
    let options = naga::front::wgsl::Options { parse_doc_comments: false, capabilities: Capabilities::all() };
    let parsed = naga::front::wgsl::Frontend::new_with_options(options).parse(source);
    let module = parsed.unwrap_or_else(|e| panic!("{}", e.emit_to_string(source)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
    (module, info.unwrap_or_else(|e| panic!("{e:?}\n{source}")))
}

/// The bytes of little-endian words.
pub fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|w| w.to_le_bytes()).collect()
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Runs `main` for one workgroup with these buffers as bindings 0, 1, ... of group 0.
fn run(source: &str, buffers: &[&[u32]]) -> Result<Vec<Vec<u32>>, Fault> {
    let (module, info) = module(source);
    let mut bindings = Bindings::default();
    for (binding, words) in (0..).zip(buffers) {
        bindings.set_buffer(0, binding, bytes(words));
    }
    run_compute(&module, &info, "main", [1, 1, 1], &mut bindings, STEPS)?;
    Ok((0..buffers.len()).map(|b| words(bindings.buffer(0, b as u32).unwrap())).collect())
}

/// The same with one buffer of zeros.
#[track_caller]
fn leaves(source: &str, count: usize) -> Vec<u32> {
    run(source, &[&vec![0; count]]).unwrap_or_else(|fault| panic!("{fault:?}")).remove(0)
}

const B: &str = "@group(0) @binding(0) var<storage, read_write> b: array<u32>;";

/// What a body leaves in `b`.
#[track_caller]
fn body(body: &str, count: usize) -> Vec<u32> {
    leaves(&format!("{B} @compute @workgroup_size(1) fn main() {{ {body} }}"), count)
}

fn f(x: f32) -> u32 {
    x.to_bits()
}

#[test]
fn continue_goes_on_with_the_next_turn() {
    let got = body(
        "var i = 1u; var s = 0u;
         for (i = 1u; i < 7u; i++) { s += i; b[8u+i] = s; if (b[1] == 0u) { continue; } b[5] = 1u; }",
        16,
    );
    assert_eq!(got, [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 3, 6, 10, 15, 21, 0]);
    let got = body(
        "var m = 0u;
         loop { m += 1u; if (m > 6u) { break; } b[8u+m] = m; if (b[1] == 0u) { continue; } continuing { b[3] = b[6]; } }",
        16,
    );
    assert_eq!(got, [0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 2, 3, 4, 5, 6, 0]);
}

#[test]
fn loops_switches_and_calls() {
    let source = format!(
        "{B}
         fn fib(n: u32) -> u32 {{
             var x = vec2u(0u, 1u);
             for (var i = 0u; i < n; i++) {{ x = vec2u(x.y, x.x + x.y); if i == 40u {{ return 7u; }} }}
             return x.x;
         }}
         fn add(p: ptr<function, u32>, k: u32) {{ *p += k; b[k] = *p; }}
         @compute @workgroup_size(1) fn main() {{
             b[0] = fib(10u); b[1] = fib(50u);
             for (var i = 0u; i < 6u; i++) {{
                 switch i {{
                     case 0u, 3u: {{ b[8u + i] = 1u; }}
                     case 1u: {{ continue; }}
                     case 4u: {{ if b[8] == 1u {{ break; }} b[8u + i] = 9u; }}
                     default: {{ b[8u + i] = 2u; }}
                 }}
                 b[2] += 1u;
             }}
             var total = 100u;
             for (var k = 3u; k < 6u; k++) {{ add(&total, k); }}
             var n = 0u;
             loop {{
                 if n == 9u {{ break; }}
                 let old = n;
                 n += 2u;
                 continuing {{ b[6] += old; break if n > 6u; }}
             }}
             b[7] = n;
         }}"
    );
    // fib(10) = 55; turns 0, 2, 3, 4, 5 reach the count; 0 + 2 + 4 + 6 = 12.
    assert_eq!(leaves(&source, 14), [55, 7, 5, 103, 107, 112, 12, 8, 1, 0, 2, 1, 0, 2]);
}

#[test]
fn integers_where_other_languages_are_undefined() {
    let got = body(
        "let zero = b[0]; let least = bitcast<i32>(0x80000000u + zero); let m = -1 - i32(zero);
         b[1] = 7u / zero; b[2] = 7u % zero; b[3] = u32(least / m); b[4] = u32(least % m); b[5] = 1u << (33u + zero);
         b[6] = u32(-8 - i32(zero) >> 1u); b[7] = u32(-7 / (2 + i32(zero))); b[8] = u32(-7 % (2 + i32(zero)));
         b[9] = u32(abs(least)); b[10] = insertBits(0u, 0xffu + zero, 28u, 8u); b[11] = extractBits(0x80u + zero, 7u, 40u);
         b[12] = u32(extractBits(0xf0 + i32(zero), 4u, 4u)); b[13] = firstLeadingBit(zero); b[14] = countTrailingZeros(zero);
         b[15] = u32(firstLeadingBit(m));",
        16,
    );
    let least = 1 << 31;
    assert_eq!(
        got,
        [0, 7, 0, least, 0, 2, -4i32 as u32, -3i32 as u32, u32::MAX, least, 0xf000_0000, 1, u32::MAX, u32::MAX, 32, u32::MAX]
    );
}

#[test]
fn floats_and_their_conversions() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> b: array<u32>;
        @group(0) @binding(1) var<storage, read> x: array<f32>;
        @compute @workgroup_size(1) fn main() {
            let nan = x[0] / x[0]; let huge = x[1]; let half = x[2];
            b[0] = u32(nan); b[1] = u32(i32(huge)); b[2] = u32(-huge); b[3] = u32(huge); b[4] = bitcast<u32>(min(nan, half));
            b[5] = bitcast<u32>(max(half, nan)); b[6] = bitcast<u32>(round(half + 2.0)); b[7] = bitcast<u32>(-5.5 % (half * 4.0));
            b[8] = bitcast<u32>(ldexp(half, -148)); b[9] = bitcast<u32>(frexp(half * 24.0).fract);
            b[10] = u32(frexp(half * 24.0).exp); b[11] = bitcast<u32>(modf(-half * 5.0).whole);
            b[12] = bitcast<u32>(quantizeToF16(half + 0.0001)); b[13] = pack4x8snorm(vec4f(-2.0, half, 0.0, 1.0));
            b[14] = bitcast<u32>(unpack2x16float(0x3c00b800u).x); b[15] = pack2x16float(vec2f(65520.0 + half, half * 1e-7));
        }";
    let got = run(source, &[&[0; 16], &[0, f(1e20), f(0.5)]]).unwrap().remove(0);
    let want = [
        0,
        2_147_483_520, // the last i32 that is an f32
        0,
        4_294_967_040, // the last u32
        f(0.5),
        f(0.5),
        f(2.0),
        f(-1.5),
        1, // 2^-149, the least number
        f(0.75),
        4,
        f(-2.0),
        f(0.5), // neighbours of 0.5 are 2^-12 and more away
        0x7f00_4081,
        f(-0.5),
        0x0001_7c00, // 5e-8 is nearer to 2^-24 than to 0
    ];
    assert_eq!(got, want);
}

#[test]
fn matrices_and_layouts() {
    let source = "
        struct S { a: u32, v: vec3f, w: f32, m: mat3x2f, l: array<vec3u, 2>, t: u32 }
        @group(0) @binding(0) var<storage, read_write> s: S;
        @group(0) @binding(1) var<storage, read_write> out: array<f32>;
        @compute @workgroup_size(1) fn main() {
            s.a = 1u; s.v = vec3f(2.0, 3.0, 4.0); s.w = 5.0;
            s.m = mat3x2f(1.0, 2.0, 3.0, 4.0, 5.0, 6.0);
            s.l[1] = vec3u(7u, 8u, 9u); s.l[s.a + 1u].y = 10u; s.t = 11u;
            let p = s.m * s.v; let q = vec2f(1.0, 10.0) * s.m;
            out[0] = p.x; out[1] = p.y; out[2] = q.x; out[3] = q.y; out[4] = q.z;
            let t = transpose(s.m); let r = s.m * t;
            out[5] = r[0].x; out[6] = r[1].x; out[7] = r[1].y; out[8] = determinant(r); out[9] = (s.m * 2.0 + s.m)[2][1];
            out[10] = f32(arrayLength(&out)); out[s.a + 1000u] = 3.0; out[11] = out[s.a + 1000u];
        }";
    let got = run(source, &[&[0; 28], &[0; 12]]).unwrap();
    let mut s = [0; 28];
    s[0] = 1;
    s[4..8].copy_from_slice(&[2.0, 3.0, 4.0, 5.0].map(f));
    s[8..14].copy_from_slice(&[1.0, 2.0, 3.0, 4.0, 5.0, 6.0].map(f));
    s[20..23].copy_from_slice(&[7, 10, 9]);
    s[24] = 11;
    assert_eq!(got[0], s, "an index beyond the end is the last element");
    // p = (1 2 + 3 3 + 5 4, 2 2 + 4 3 + 6 4); r = ((35, 44), (44, 56)).
    let want = [31.0, 40.0, 21.0, 43.0, 65.0, 35.0, 44.0, 56.0, 24.0, 18.0, 12.0, 0.0].map(f);
    assert_eq!(got[1], want);
}

#[test]
fn halves_are_rounded_at_each_operation() {
    let source = "
        enable f16;
        @group(0) @binding(0) var<storage, read_write> b: array<vec2h, 3>;
        @compute @workgroup_size(1) fn main() {
            b[1] = b[0] + vec2h(1.0h, 2048.0h);
            b[2] = vec2h(b[0].x * b[0].x, f16(100000.0 * f32(b[0].x)));
        }";
    // 1/2048 + 1 is a tie and goes to the even 1; 1 + 2048 is a tie and goes to 2048. 2^-22 is subnormal; 100000/2048 is a tie.
    let got = run(source, &[&[0x3c00_1000, 0, 0]]).unwrap().remove(0);
    assert_eq!(got, [0x3c00_1000, 0x6800_3c00, 0x521a_0004]);
}

#[test]
fn atomics_barriers_and_workgroup_memory() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> b: array<atomic<u32>, 8>;
        var<workgroup> w: array<u32, 96>;
        var<workgroup> best: atomic<i32>;
        @compute @workgroup_size(96) fn main(@builtin(local_invocation_index) i: u32) {
            if i == 0u { atomicStore(&b[7], w[5]); }
            w[i] = i * i;
            atomicMax(&best, i32(i) - 50);
            workgroupBarrier();
            atomicAdd(&b[0], w[95u - i]);
            atomicOr(&b[1], 1u << (i % 32u));
            let c = atomicCompareExchangeWeak(&b[2], 0u, i + 1u);
            if c.exchanged { atomicStore(&b[3], c.old_value + 5u); }
            let t = workgroupUniformLoad(&w[3]);
            w[3] = 0u;
            atomicAdd(&b[4], t);
            atomicStore(&b[5], u32(atomicLoad(&best)));
        }";
    let sum: u32 = (0..96).map(|i| i * i).sum();
    let got = run(source, &[&[0, 0, 0, 0, 0, 0, 0, 77]]).unwrap().remove(0);
    assert_eq!(got, [sum, u32::MAX, 1, 5, 9 * 96, 45, 0, 0]);
}

#[test]
fn those_who_part_meet_again() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> b: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(subgroup_invocation_id) i: u32) {
            var s = 0u;
            for (var k = 0u; k < i % 4u; k++) { s += subgroupAdd(1u); if k == 1u && i < 32u { continue; } s += 100u; }
            if i % 2u == 0u { s += 10000u * subgroupExclusiveAdd(1u); }
            let all = subgroupBallot(s > 200u);
            b[i] = s; b[64] = all.x; b[65] = all.y; b[66u + i % 4u] = subgroupShuffleXor(i, 1u);
        }";
    let mut want = vec![0; 70];
    for i in 0..64u32 {
        // In turn k of the loop are those with more than k turns: 48, 32, 16.
        let mut s = (0..i % 4).map(|k| [48, 32, 16][k as usize] + if k == 1 && i < 32 { 0 } else { 100 }).sum::<u32>();
        if i % 2 == 0 {
            s += 10000 * (i / 2);
        }
        want[i as usize] = s;
        want[64 + (i / 32) as usize] |= u32::from(s > 200) << (i % 32);
        want[66 + (i % 4) as usize] = i ^ 1;
    }
    assert_eq!(leaves(source, 70), want);
}

/// Runs a fragment stage on one quad at (x, y) = (0, 0) to (1, 1), all four active.
fn quad(source: &str, bindings: &mut Bindings) -> BatchResult {
    let (module, info) = module(source);
    let mut position = vec![[0; 64]; 4];
    for lane in 0..4 {
        position[0][lane] = f((lane % 2) as f32 + 0.5);
        position[1][lane] = f((lane / 2) as f32 + 0.5);
    }
    let mut batch = Batch { active: 0b0111, helpers: 0b1000, ..Batch::default() };
    batch.inputs.insert(Io::BuiltIn(BuiltIn::Position { invariant: false }), position);
    run_batch(&module, &info, naga::ShaderStage::Fragment, "main", &batch, bindings, STEPS).unwrap_or_else(|e| panic!("{e:?}"))
}

#[test]
fn quads_derive_and_helpers_leave_nothing() {
    let mut bindings = Bindings::default();
    bindings.set_buffer(0, 0, bytes(&[0; 5]));
    let outcome = quad(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
         @fragment fn main(@builtin(position) p: vec4f) -> @location(0) vec4f {
             let n = p.x * p.y;
             if p.x < 1.0 && p.y > 1.0 { discard; }
             let i = u32(p.x) + 2u * u32(p.y);
             b[i] = 1u;
             return vec4f(dpdx(n), dpdyCoarse(n), fwidth(n), 0.0);
         }",
        &mut bindings,
    );
    assert_eq!(outcome.live, 0b0011);
    assert_eq!(words(bindings.buffer(0, 0).unwrap()), [1, 1, 0, 0, 0]);
    // n is 0.25, 0.75, 0.75, 2.25.
    let out = &outcome.outputs[&Io::location(0)];
    assert_eq!(out[0][..4], [0.5, 0.5, 1.5, 1.5].map(f));
    assert_eq!(out[1][..4], [0.5; 4].map(f));
    assert_eq!(out[2][..4], [1.0, 2.0, 2.0, 3.0].map(f));
}

/// A texture of four by two texels of `r32float`, numbered from 0, with a second level of 50 and 60.
fn numbered() -> Texture {
    let desc = ImageDesc { dimension: TextureDimension::D2, size: [4, 2, 1], levels: 2, samples: 1, format: Format::R32Float };
    let range = ViewRange {
        dimension: ViewDimension::D2,
        format: Format::R32Float,
        aspect: Aspect::All,
        base_level: 0,
        levels: 2,
        base_layer: 0,
        layers: 1,
    };
    let mut texels: Vec<u32> = (0..8).map(|i| f(i as f32)).collect();
    texels.extend([50.0, 60.0, 0.0, 0.0].map(f));
    Texture { desc, range, bytes: bytes(&texels) }
}

#[test]
fn textures_are_loaded_sampled_and_asked() {
    let mut bindings = Bindings::default();
    bindings.resources.insert((0, 0), vec![Resource::Texture(numbered())]);
    let sampler = SamplerDesc {
        address: [AddressMode::ClampToEdge; 3],
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        mipmap: FilterMode::Nearest,
        lod_min: 0.0,
        lod_max: 32.0,
        compare: None,
        anisotropy: 1,
        border: BorderColor::TransparentBlack,
    };
    bindings.resources.insert((0, 1), vec![Resource::Sampler(sampler)]);
    let outcome = quad(
        "@group(0) @binding(0) var t: texture_2d<f32>;
         @group(0) @binding(1) var s: sampler;
         struct Out { @location(0) a: vec4f, @location(1) b: vec4f, @location(2) c: vec4u, @location(3) d: vec2f }
         @fragment fn main(@builtin(position) p: vec4f) -> Out {
             let at = vec2u(p.xy);
             return Out(
                 vec4f(textureLoad(t, at, 0).x, textureLoad(t, vec2u(1u, 0u), 1).x, textureLoad(t, vec2u(4u, 0u), 0).x,
                       textureSample(t, s, p.xy / vec2f(4.0, 2.0)).x),
                 textureGather(0, t, s, vec2f(0.5, 0.5)),
                 vec4u(textureDimensions(t), textureDimensions(t, 1).x, textureNumLevels(t)),
                 vec2f(textureSampleLevel(t, s, vec2f(0.25, 0.5), 0.0, vec2i(1, 0)).x, textureSample(t, s, p.xy).x),
             );
         }",
        &mut bindings,
    );
    let of = |location| &outcome.outputs[&Io::location(location)];
    assert_eq!(of(0)[0][..4], [0.0, 1.0, 4.0, 5.0].map(f));
    assert_eq!(of(0)[1][0], f(60.0));
    assert_eq!(of(0)[2][0], 0, "outside of the texture");
    assert_eq!(of(0)[3][..4], [0.0, 1.0, 4.0, 5.0].map(f), "the level is 0, at texels' centres");
    assert_eq!(of(1).iter().map(|c| c[0]).collect::<Vec<_>>(), [5.0, 6.0, 2.0, 1.0].map(f));
    assert_eq!(of(2).iter().map(|c| c[0]).collect::<Vec<_>>(), [4, 2, 2, 2]);
    assert_eq!(of(3)[0][0], f(3.5), "one texel to the right of 0, 1, 4, 5, whose mean is 2.5");
    // A pixel is four texels wide: the second level, whose middle is between 50 and 60.
    assert_eq!(of(3)[1][0], f(55.0));
}

#[test]
fn storage_textures_keep_what_their_format_holds() {
    let mut texture = numbered();
    texture.desc.format = Format::Rgba8Unorm;
    texture.range.format = Format::Rgba8Unorm;
    texture.range.base_level = 1;
    texture.range.levels = 1;
    texture.bytes.fill(0);
    let mut bindings = Bindings::default();
    bindings.resources.insert((0, 0), vec![Resource::Texture(texture)]);
    let (module, info) = module(
        "@group(0) @binding(0) var t: texture_storage_2d<rgba8unorm, write>;
         @compute @workgroup_size(3) fn main(@builtin(local_invocation_index) i: u32) {
             textureStore(t, vec2u(i, 0u), vec4f(2.0, 0.5, f32(i), f32(textureDimensions(t).x) / 255.0));
         }",
    );
    run_compute(&module, &info, "main", [1, 1, 1], &mut bindings, STEPS).unwrap();
    let Some(Resource::Texture(texture)) = bindings.resources[&(0, 0)].first() else { panic!("the texture is gone") };
    let mut want = vec![0; 12];
    want[8..10].copy_from_slice(&[0x0200_80ff, 0x02ff_80ff]);
    assert_eq!(words(&texture.bytes), want);
}

#[test]
fn arrays_of_bindings_and_immediates() {
    let (module, info) = module(
        "enable wgpu_binding_array;
         struct N { n: u32, m: vec2u }
         @group(1) @binding(2) var<storage, read_write> a: binding_array<N>;
         var<immediate> k: N;
         @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {
             a[i].m = vec2u(i, k.m.y + a[0].n);
         }",
    );
    let mut bindings = Bindings { immediates: vec![1, 0, 5, 6], ..Bindings::default() };
    let buffer = |n: u32| Resource::Buffer(bytes(&[n, 0, 0, 0]));
    bindings.resources.insert((1, 2), vec![buffer(10), buffer(20)]);
    run_compute(&module, &info, "main", [1, 1, 1], &mut bindings, STEPS).unwrap();
    let left: Vec<Vec<u32>> = bindings.resources[&(1, 2)]
        .iter()
        .map(|r| if let Resource::Buffer(bytes) = r { words(bytes) } else { panic!("no buffer") })
        .collect();
    assert_eq!(left, [vec![10, 0, 0, 16], vec![20, 0, 3, 16]], "elements 2 and 3 are the last");
}

#[test]
fn programs_without_an_end_or_a_meaning_are_told() {
    let endless = format!("{B} @compute @workgroup_size(1) fn main() {{ loop {{ b[0] += 1u; if b[1] == 1u {{ break; }} }} }}");
    assert_eq!(run(&endless, &[&[0, 0]]), Err(Fault::Steps));
    // The compiler of WGSL would refuse a barrier in a branch that it sees to be divergent; a storage buffer's word it does not.
    let source = "
        @group(0) @binding(0) var<storage, read> b: array<u32>;
        @compute @workgroup_size(2) fn main(@builtin(local_invocation_index) i: u32) {
            for (var k = 0u; k < b[0]; k++) { if b[1u + i] == k { return; } }
            workgroupBarrier();
        }";
    let (mut module, _) = module(&source.replace("workgroupBarrier();", ""));
    let body = &mut module.entry_points[0].function.body;
    let mut barrier = naga::Block::new();
    barrier.push(naga::Statement::ControlBarrier(naga::Barrier::WORK_GROUP), naga::Span::default());
    body.splice(body.len() - 1..body.len() - 1, barrier);
    let info = Validator::new(ValidationFlags::empty(), Capabilities::all()).validate(&module).unwrap();
    let mut bindings = Bindings::default();
    bindings.set_buffer(0, 0, bytes(&[2, 0, 9]));
    let result = run_compute(&module, &info, "main", [1, 1, 1], &mut bindings, STEPS);
    assert!(matches!(result, Err(Fault::Undefined(_))), "{result:?}");
}
