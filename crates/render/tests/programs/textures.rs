//! Textures through a trace: levels of detail, comparisons, gathers, atomics, arrays of bindings, storage formats, queries.

use crate::common::*;
use gfx::format::Format;
use gfx::state::*;
use num::{BufferId, SamplerId, ViewId};
use trace::command::*;
use trace::record;

fn sampler(filter: FilterMode, mipmap: FilterMode) -> SamplerDesc {
    SamplerDesc { mag: filter, min: filter, mipmap, ..SamplerDesc::default() }
}

/// A texture of 64x64 with 7 levels, each texel of which is the number of its level.
fn levels(lab: &mut Lab) -> ViewId {
    let texture = lab.card.create_texture("levels", record::texture_mipped(64, 64, 7, Format::R32Float));
    for level in 0..7u32 {
        let side = 64 >> level;
        lab.card.write_level(texture, level, "level", &bytes(&bits(&vec![level as f32; side * side])));
    }
    lab.card.create_view(texture)
}

/// The level that a sample takes is the texture's value: what gradients, biases and given levels come to.
#[test]
fn levels_of_detail() {
    let mut lab = Lab::new();
    let view = levels(&mut lab);
    let linear = lab.card.create_sampler(sampler(FilterMode::Linear, FilterMode::Linear));
    let clamped =
        lab.card.create_sampler(SamplerDesc { lod_min: 1.5, lod_max: 3.25, ..sampler(FilterMode::Linear, FilterMode::Linear) });
    let nearest = lab.card.create_sampler(sampler(FilterMode::Nearest, FilterMode::Nearest));
    let source = "
        @group(0) @binding(0) var t: texture_2d<f32>;
        @group(0) @binding(1) var linear: sampler;
        @group(0) @binding(2) var clamped: sampler;
        @group(0) @binding(3) var nearest: sampler;
        @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {
            // Along x and y, a step of one pixel is 4 texels: level 2.
            let uv = p.xy * 4.0 / 64.0;
            let k = floor(p.x);
            let grad = vec2f(exp2(k) / 64.0, 0.0);
            switch u32(p.y) {
                case 0u: { return vec4f(textureSampleGrad(t, linear, uv, grad, grad.yx).x,
                    textureSampleGrad(t, linear, uv, vec2f(0.0), grad * 1.5).x,
                    textureSampleGrad(t, clamped, uv, grad, vec2f(0.0)).x,
                    textureSampleGrad(t, nearest, uv, grad * 1.2, vec2f(0.0)).x); }
                case 1u: { return vec4f(textureSampleLevel(t, linear, uv, k * 0.7).x,
                    textureSampleLevel(t, nearest, uv, k * 0.7).x, textureSampleLevel(t, clamped, uv, k * 0.7).x,
                    textureLoad(t, vec2u(0u), u32(k)).x); }
                default: { return vec4f(0.0); }
            }
        }
        @fragment fn implicit(@builtin(position) p: vec4f) -> @location(0) vec4f {
            let uv = p.xy * 4.0 / 64.0;
            return vec4f(textureSample(t, linear, uv).x, textureSampleBias(t, linear, uv, -1.25).x,
                textureSampleBias(t, linear, uv * 0.1, p.x * 0.0 + 5.0).x, textureSample(t, nearest, uv * 1.5).x);
        }";
    let resources = vec![
        BoundResource::View(view),
        BoundResource::Sampler(linear),
        BoundResource::Sampler(clamped),
        BoundResource::Sampler(nearest),
    ];
    let explicit = source.split("@fragment fn implicit").next().unwrap();
    let got = floats(&paint(lab, explicit, [8, 2], Format::Rgba32Float, resources));
    for k in 0..8 {
        let l = k as f64;
        let row = &got[4 * k..4 * k + 4];
        assert_near(row[0], l.min(6.0), 0.0, 0.02, "a gradient of whole powers of two");
        assert_near(row[1], (l + 1.5f64.log2()).min(6.0), 0.0, 0.02, "a gradient along y");
        assert_near(row[2], l.clamp(1.5, 3.25), 0.0, 0.02, "levels clamped by the sampler");
        assert_near(row[3], (l + 1.2f64.log2()).round().min(6.0), 0.0, 0.0, "the nearest level");
        let row = &got[4 * (8 + k)..4 * (8 + k) + 4];
        assert_near(row[0], (l * 0.7).min(6.0), 0.0, 0.02, "a given level");
        assert_near(row[1], (l * 0.7).round().min(6.0), 0.0, 0.0, "the nearest given level");
        assert_near(row[2], (l * 0.7).clamp(1.5, 3.25), 0.0, 0.02, "a given level, clamped");
        // A level that is not there gives zeros.
        assert_near(row[3], if k < 7 { l } else { 0.0 }, 0.0, 0.0, "a level loaded");
    }
    let mut lab = Lab::new();
    let view = levels(&mut lab);
    let linear = lab.card.create_sampler(sampler(FilterMode::Linear, FilterMode::Linear));
    let nearest = lab.card.create_sampler(sampler(FilterMode::Nearest, FilterMode::Nearest));
    let (head, tail) = (source.split("@fragment fn fs").next().unwrap(), source.split("@fragment fn implicit").nth(1).unwrap());
    let head = head.replace("@group(0) @binding(2) var clamped: sampler;", "").replace("@binding(3)", "@binding(2)");
    let resources = vec![BoundResource::View(view), BoundResource::Sampler(linear), BoundResource::Sampler(nearest)];
    let got = floats(&paint(lab, &format!("{head}@fragment fn implicit{tail}"), [16, 16], Format::Rgba32Float, resources));
    for row in got.chunks(4) {
        assert_near(row[0], 2.0, 0.0, 0.02, "an implicit level");
        assert_near(row[1], 0.75, 0.0, 0.02, "an implicit level and a bias");
        assert_near(row[2], 0.4f64.log2() + 5.0, 0.0, 0.02, "a large bias");
        assert_near(row[3], 3.0, 0.0, 0.0, "the level next to log2 of 6");
    }
}

/// Comparison with a reference before filtering: one texel, four texels, a cube, an array, in stages with and without derivatives.
#[test]
fn depth_comparisons() {
    let mut lab = Lab::new();
    let depth: Vec<f32> = (0..32).map(|k| [0.1, 0.9, 0.4, 0.6][k % 4] + (k / 4) as f32 * 0.001).collect();
    let texture =
        lab.card.create_texture("depth", TextureDesc { size: [4, 4, 2], ..record::texture_2d(4, 4, Format::Depth32Float) });
    // Depth can be copied to from a buffer, not written.
    let words: Vec<u32> = (0..8)
        .flat_map(|row| {
            let mut words = bits(&depth[4 * row..4 * row + 4]);
            words.resize(64, 0);
            words
        })
        .collect();
    let buffer = lab.buffer(&words);
    let layout = LinearLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: Some(4) };
    lab.card.copy_buffer_to_texture(buffer, layout, whole(texture), [4, 4, 2]);
    let view = lab.card.create_view(texture);
    let compare = |filter| SamplerDesc { compare: Some(Compare::LessEqual), ..sampler(filter, FilterMode::Nearest) };
    let (linear, nearest) =
        (lab.card.create_sampler(compare(FilterMode::Linear)), lab.card.create_sampler(compare(FilterMode::Nearest)));
    let plain = lab.card.create_sampler(sampler(FilterMode::Nearest, FilterMode::Nearest));
    let result = lab.words(256);
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<vec4f>;
        @group(0) @binding(1) var t: texture_depth_2d_array;
        @group(0) @binding(2) var linear: sampler_comparison;
        @group(0) @binding(3) var nearest: sampler_comparison;
        @group(0) @binding(4) var plain: sampler;
        @compute @workgroup_size(16) fn main(@builtin(local_invocation_index) i: u32) {
            let at = vec2f(f32(i % 4u), f32(i / 4u));
            let layer = i % 2u;
            // The middle of texel `at`, and the corner it shares with its three followers.
            let middle = (at + 0.5) / 4.0;
            let corner = (at + 1.0) / 4.0;
            result[3u * i] = vec4f(
                textureSampleCompareLevel(t, nearest, middle, layer, 0.5),
                textureSampleCompareLevel(t, linear, corner, layer, 0.5),
                textureSampleLevel(t, plain, middle, layer, 0),
                textureLoad(t, vec2u(at), layer, 0));
            result[3u * i + 1u] = textureGatherCompare(t, linear, corner, layer, 0.5);
            result[3u * i + 2u] = textureGather(t, plain, corner, layer);
        }";
    let pipeline = lab.compute(source);
    lab.dispatch(
        pipeline,
        [1, 1, 1],
        [
            record::whole(result),
            BoundResource::View(view),
            BoundResource::Sampler(linear),
            BoundResource::Sampler(nearest),
            BoundResource::Sampler(plain),
        ],
    );
    let got = floats(&lab.read(result, 192));
    for i in 0..16usize {
        let layer = i % 2;
        let at = |dx: usize, dy: usize| depth[16 * layer + 4 * (i / 4 + dy).min(3) + (i % 4 + dx).min(3)];
        // The reference is less than or equal to what is stored.
        let passes = |dx, dy| f32::from(u8::from(0.5 <= at(dx, dy)));
        let four = [(0, 1), (1, 1), (1, 0), (0, 0)];
        let mean = four.iter().map(|&(x, y)| passes(x, y)).sum::<f32>() / 4.0;
        let row = &got[12 * i..12 * i + 12];
        assert_eq!(row[..4], [passes(0, 0), mean, at(0, 0), at(0, 0)], "texel {i}");
        assert_eq!(row[4..8], four.map(|(x, y)| passes(x, y)), "texel {i}, gathered comparisons");
        assert_eq!(row[8..], four.map(|(x, y)| at(x, y)), "texel {i}, gathered depths");
    }
}

/// Four texels at once, of each component and with an offset, in the order of WGSL.
#[test]
fn gathers() {
    let texels: Vec<u32> = (0..64u32).map(|k| k | (k + 64) << 8 | (k + 128) << 16 | (255 - k) << 24).collect();
    let mut lab = Lab::new();
    let texture = lab.card.create_texture("", record::texture_2d(8, 8, Format::Rgba8Uint));
    lab.card.write_level(texture, 0, "texels", &bytes(&texels));
    let (view, result) = (lab.card.create_view(texture), lab.words(256));
    let repeat = lab.card.create_sampler(SamplerDesc { address: [AddressMode::Repeat; 3], ..SamplerDesc::default() });
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<vec4u>;
        @group(0) @binding(1) var t: texture_2d<u32>;
        @group(0) @binding(2) var s: sampler;
        @compute @workgroup_size(8) fn main(@builtin(local_invocation_index) i: u32) {
            let uv = vec2f(f32(i) + 1.25, 2.75) / 8.0;
            result[5u * i] = textureGather(0, t, s, uv);
            result[5u * i + 1u] = textureGather(1, t, s, uv);
            result[5u * i + 2u] = textureGather(2, t, s, uv, vec2i(3, -2));
            result[5u * i + 3u] = textureGather(3, t, s, uv);
            result[5u * i + 4u] = textureLoad(t, vec2u(i, 1u), 0) + textureLoad(t, vec2i(-1, 0), 0);
        }";
    let pipeline = lab.compute(source);
    lab.dispatch(pipeline, [1, 1, 1], [record::whole(result), BoundResource::View(view), BoundResource::Sampler(repeat)]);
    let got = lab.read(result, 160);
    for i in 0..8u32 {
        // uv * 8 - 0.5 is (i + 0.75, 2.25): texels i and i + 1, 2 and 3.
        let texel =
            |dx: u32, dy: u32, component: u32| texels[((2 + dy) % 8 * 8 + (i + dx) % 8) as usize] >> (8 * component) & 255;
        let gather = |c, ox: u32, oy: u32| [(0, 1), (1, 1), (1, 0), (0, 0)].map(|(x, y)| texel(x + ox, y + oy, c));
        let row = &got[20 * i as usize..20 * i as usize + 20];
        assert_eq!(row[..4], gather(0, 0, 0));
        assert_eq!(row[4..8], gather(1, 0, 0));
        assert_eq!(row[8..12], gather(2, 3, 6));
        assert_eq!(row[12..16], gather(3, 0, 0));
        // Outside there are zeros.
        let plain = texels[8 + i as usize].to_le_bytes().map(u32::from);
        assert_eq!(row[16..], plain);
    }
}

/// Atomic operations on texels.
#[test]
fn texture_atomics() {
    let mut lab = Lab::new();
    let make = |lab: &mut Lab, format, texels: [u32; 4]| {
        let texture = lab.card.create_texture("", record::texture_2d(4, 1, format));
        lab.card.write_level(texture, 0, "texels", &bytes(&texels));
        (texture, lab.card.create_view(texture))
    };
    let (unsigned, a) = make(&mut lab, Format::R32Uint, [5, 0, 0xff, 1000]);
    let (signed, b) = make(&mut lab, Format::R32Sint, [-5i32 as u32, 3, 0, 7]);
    let source = "
        @group(0) @binding(0) var a: texture_storage_2d<r32uint, atomic>;
        @group(0) @binding(1) var b: texture_storage_2d<r32sint, atomic>;
        @compute @workgroup_size(100) fn main(@builtin(local_invocation_index) i: u32) {
            textureAtomicAdd(a, vec2u(0u, 0u), i);
            textureAtomicOr(a, vec2u(1u, 0u), 1u << (i % 20u));
            textureAtomicAnd(a, vec2u(2u, 0u), ~(1u << (i % 3u)));
            textureAtomicMin(a, vec2u(3u, 0u), 900u - i);
            textureAtomicAdd(a, vec2u(4u, 0u), 1u); // outside
            textureAtomicMin(b, vec2u(0u, 0u), i32(i) - 50);
            textureAtomicMax(b, vec2u(1u, 0u), i32(i) - 50);
            textureAtomicXor(b, vec2u(2u, 0u), i32(i));
            textureAtomicAdd(b, vec2u(3u, 0u), -1);
        }";
    let pipeline = lab.compute(source);
    lab.dispatch(pipeline, [1, 1, 1], [BoundResource::View(a), BoundResource::View(b)]);
    let result = lab.words(64);
    for (texture, offset) in [(unsigned, 0), (signed, 16)] {
        let layout = LinearLayout { offset, bytes_per_row: None, rows_per_image: None };
        lab.card.copy_texture_to_buffer(whole(texture), result, layout, [4, 1, 1]);
    }
    let xor = (0..100u32).fold(0, |x, i| x ^ i);
    let expected = [5 + 4950, 0xfffff, 0xf8, 801, -50i32 as u32, 49, xor, -93i32 as u32];
    assert_eq!(lab.read(result, 8), expected);
}

/// Arrays of textures, samplers, buffers and storage textures, indexed by numbers that differ between invocations.
#[test]
fn binding_arrays() {
    let mut lab = Lab::new();
    let views: Vec<ViewId> = (0..4u32)
        .map(|k| {
            let texture = lab.card.create_texture("", record::texture_2d(2 + k, 2, Format::R32Float));
            let texels: Vec<f32> = (0..2 * (2 + k)).map(|t| (100 * k + t) as f32).collect();
            lab.card.write_level(texture, 0, "texels", &bytes(&bits(&texels)));
            lab.card.create_view(texture)
        })
        .collect();
    let samplers: Vec<SamplerId> = [AddressMode::ClampToEdge, AddressMode::Repeat]
        .map(|mode| lab.card.create_sampler(SamplerDesc { address: [mode; 3], ..SamplerDesc::default() }))
        .to_vec();
    let buffers: Vec<BufferId> = (0..3u32).map(|k| lab.buffer(&[k, 10 * k, 1000 + k])).collect();
    let stored: Vec<_> = (0..2)
        .map(|_| {
            let texture = lab.card.create_texture("", record::texture_2d(64, 1, Format::R32Uint));
            (texture, lab.card.create_view(texture))
        })
        .collect();
    let result = lab.words(256);
    let source = "
        enable wgpu_binding_array;
        struct Item { a: u32, b: u32, rest: array<u32> }
        @group(0) @binding(0) var<storage, read_write> result: array<vec4f>;
        @group(0) @binding(1) var textures: binding_array<texture_2d<f32>, 4>;
        @group(0) @binding(2) var samplers: binding_array<sampler>;
        @group(0) @binding(3) var<storage, read_write> items: binding_array<Item, 3>;
        @group(0) @binding(4) var stored: binding_array<texture_storage_2d<r32uint, write>, 2>;
        @compute @workgroup_size(24) fn main(@builtin(local_invocation_index) i: u32) {
            let k = i % 4u;
            let size = textureDimensions(textures[k]);
            result[i] = vec4f(
                textureLoad(textures[k], vec2u(1u, 1u), 0).x,
                textureSampleLevel(textures[3u - k], samplers[i % 2u], vec2f(1.25, 0.25), 0.0).x,
                f32(size.x) + f32(items[i % 3u].b) * 10.0,
                f32(arrayLength(&items[i % 3u].rest)));
            items[i % 3u].a += 0u;
            if i < 3u { items[i].rest[0] += i + 1u; }
            textureStore(stored[i & 1u], vec2u(i, 0u), vec4u(i * i + 1u));
        }";
    // Arrays of bindings are not part of derived layouts in WebGPU; here they are what the shader says.
    let pipeline = lab.compute(source);
    let bound = vec![
        record::whole(result),
        BoundResource::Views(views),
        BoundResource::Samplers(samplers),
        BoundResource::Buffers(buffers.iter().map(|&b| (b, 0, None)).collect()),
        BoundResource::Views(stored.iter().map(|s| s.1).collect()),
    ];
    lab.dispatch(pipeline, [1, 1, 1], bound);
    let words = lab.words(256);
    for (k, &(texture, _)) in stored.iter().enumerate() {
        let layout = LinearLayout { offset: 256 * k as u64, bytes_per_row: None, rows_per_image: None };
        lab.card.copy_texture_to_buffer(whole(texture), words, layout, [24, 1, 1]);
    }
    for (k, &buffer) in buffers.iter().enumerate() {
        lab.card.copy_buffer_to_buffer((buffer, 8), (words, 512 + 4 * k as u64), 4);
    }
    lab.show_buffer(result, 96);
    lab.show_buffer(words, 192);
    let frames = lab.frames().unwrap_or_else(|error| panic!("{error}"));
    let read =
        |frame: &[u8]| -> Vec<u32> { frame.chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect() };
    let (numbers, words) = (floats(&read(&frames[0])), read(&frames[1]));
    for i in 0..24u32 {
        let k = i % 4;
        let other = 3 - k;
        let width = 2 + other;
        // At u = 1.25: the last texel where the edge is repeated, else the texel at 0.25.
        let x = if i % 2 == 0 { width - 1 } else { (0.25 * width as f32) as u32 };
        let expected = [100 * k + 2 + k + 1, 100 * other + x, 2 + k + i % 3 * 100, 62].map(|x| x as f32);
        assert_eq!(numbers[4 * i as usize..4 * i as usize + 4], expected, "invocation {i}");
        assert_eq!(words[(64 * (i & 1) + i) as usize], i * i + 1);
        assert_eq!(words[(64 * (1 - (i & 1)) + i) as usize], 0);
    }
    assert_eq!(words[128..131], [1001, 1003, 1005]);
}

/// Views of every dimension: loads, samples and what can be asked of them.
#[test]
fn dimensions() {
    let mut lab = Lab::new();
    let mut make = |dimension, size: [u32; 3], levels, view: ViewDimension| {
        let desc = TextureDesc { dimension, size, levels, samples: 1, format: Format::R32Uint, opaque: false };
        let texture = lab.card.create_texture("", desc.clone());
        for level in 0..levels {
            let [w, h, d] = desc.level_size(level);
            let texels: Vec<u32> = (0..w * h * d).map(|k| 1000 * level + k).collect();
            lab.card.write_level(texture, level, "texels", &bytes(&texels));
        }
        lab.card.create_view_of(texture, ViewDesc { dimension: Some(view), ..ViewDesc::default() })
    };
    let views = [
        make(TextureDimension::D1, [16, 1, 1], 1, ViewDimension::D1),
        make(TextureDimension::D2, [8, 4, 3], 2, ViewDimension::D2Array),
        make(TextureDimension::D3, [4, 8, 6], 3, ViewDimension::D3),
        make(TextureDimension::D2, [4, 4, 6], 3, ViewDimension::Cube),
        make(TextureDimension::D2, [2, 2, 12], 1, ViewDimension::CubeArray),
    ];
    let result = lab.words(64);
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var a: texture_1d<u32>;
        @group(0) @binding(2) var b: texture_2d_array<u32>;
        @group(0) @binding(3) var c: texture_3d<u32>;
        @group(0) @binding(4) var d: texture_cube<u32>;
        @group(0) @binding(5) var e: texture_cube_array<u32>;
        var<private> at = 0u;
        fn put(x: u32) { result[at] = x; at++; }
        @compute @workgroup_size(1) fn main() {
            put(textureDimensions(a)); put(textureLoad(a, 5, 0).x); put(textureLoad(a, 16, 0).x); put(textureNumLevels(a));
            let size = textureDimensions(b, 1); put(size.x * 10u + size.y); put(textureNumLayers(b)); put(textureNumLevels(b));
            put(textureLoad(b, vec2i(2, 1), 2, 1).x); put(textureLoad(b, vec2i(2, 1), 3, 1).x);
            let volume = textureDimensions(c, 1); put(volume.x * 100u + volume.y * 10u + volume.z);
            put(textureLoad(c, vec3u(1u, 2u, 3u), 0).x); put(textureLoad(c, vec3u(0u, 1u, 0u), 2).x); put(textureLoad(c, vec3u(0u), 3).x);
            let cube = textureDimensions(d, 1u); put(cube.x * 10u + cube.y); put(textureNumLevels(d));
            let many = textureDimensions(e); put(many.x); put(textureNumLayers(e));
        }";
    let pipeline = lab.compute(source);
    let mut resources = vec![record::whole(result)];
    resources.extend(views.map(BoundResource::View));
    lab.dispatch(pipeline, [1, 1, 1], resources);
    let expected = [
        16,
        5,
        0,
        1, // 1D
        42,
        3,
        2,
        1000 + 8 * 2 + 4 + 2,
        0, // 2D array
        243,
        3 * 32 + 2 * 4 + 1,
        2001,
        0, // 3D
        22,
        3, // cube
        2,
        2, // cube array
    ];
    assert_eq!(lab.read(result, expected.len() as u64), expected);
}

/// Faces of a cube are chosen by direction; the texels of each hold its number.
#[test]
fn cube_faces() {
    let mut lab = Lab::new();
    let texture = lab.card.create_texture("", TextureDesc { size: [2, 2, 12], ..record::texture_2d(2, 2, Format::R32Float) });
    let texels: Vec<f32> = (0..48).map(|k| k as f32).collect();
    lab.card.write_level(texture, 0, "texels", &bytes(&bits(&texels)));
    let view = lab.card.create_view_of(texture, ViewDesc { dimension: Some(ViewDimension::CubeArray), ..ViewDesc::default() });
    let (nearest, result) = (lab.card.create_sampler(SamplerDesc::default()), lab.words(64));
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<f32>;
        @group(0) @binding(1) var t: texture_cube_array<f32>;
        @group(0) @binding(2) var s: sampler;
        @compute @workgroup_size(48) fn main(@builtin(local_invocation_index) i: u32) {
            // WebGPU's table: the main axis, then where s and t of the face point.
            const MAIN = array<vec3f, 6>(vec3f(1, 0, 0), vec3f(-1, 0, 0), vec3f(0, 1, 0), vec3f(0, -1, 0), vec3f(0, 0, 1), vec3f(0, 0, -1));
            const RIGHT = array<vec3f, 6>(vec3f(0, 0, -1), vec3f(0, 0, 1), vec3f(1, 0, 0), vec3f(1, 0, 0), vec3f(1, 0, 0), vec3f(-1, 0, 0));
            const DOWN = array<vec3f, 6>(vec3f(0, -1, 0), vec3f(0, -1, 0), vec3f(0, 0, 1), vec3f(0, 0, -1), vec3f(0, -1, 0), vec3f(0, -1, 0));
            let face = i / 4u % 6u;
            let x = f32(i & 1u) - 0.5;
            let y = f32(i >> 1u & 1u) - 0.5;
            result[i] = textureSampleLevel(t, s, 3.0 * (MAIN[face] + x * RIGHT[face] + y * DOWN[face]), i / 24u, 0.0).x;
        }";
    let pipeline = lab.compute(source);
    lab.dispatch(pipeline, [1, 1, 1], [record::whole(result), BoundResource::View(view), BoundResource::Sampler(nearest)]);
    assert_eq!(floats(&lab.read(result, 48)), texels);
}

/// Storage textures of every format: what is stored comes back rounded as the format says.
#[test]
fn storage_formats() {
    // Format, its kind of numbers, what is stored, what is loaded.
    type Case = (&'static str, Format, &'static str, [f64; 4], [f64; 4]);
    let cases: &[Case] = &[
        ("rgba8unorm", Format::Rgba8Unorm, "f32", [0.5, -1.0, 2.0, 0.2], [128.0 / 255.0, 0.0, 1.0, 51.0 / 255.0]),
        ("rgba8snorm", Format::Rgba8Snorm, "f32", [-0.5, -3.0, 1.0, 0.25], [-64.0 / 127.0, -1.0, 1.0, 32.0 / 127.0]),
        ("rgba8uint", Format::Rgba8Uint, "u32", [1.0, 255.0, 7.0, 0.0], [1.0, 255.0, 7.0, 0.0]),
        ("rgba8sint", Format::Rgba8Sint, "i32", [-1.0, 127.0, -128.0, 5.0], [-1.0, 127.0, -128.0, 5.0]),
        ("rgba16uint", Format::Rgba16Uint, "u32", [1.0, 65535.0, 300.0, 9.0], [1.0, 65535.0, 300.0, 9.0]),
        ("rgba16sint", Format::Rgba16Sint, "i32", [-1.0, 32767.0, -300.0, 9.0], [-1.0, 32767.0, -300.0, 9.0]),
        ("rgba16float", Format::Rgba16Float, "f32", [0.1, -2.0, 65504.0, 3.0], [0.0999755859375, -2.0, 65504.0, 3.0]),
        ("rg32float", Format::Rg32Float, "f32", [0.5, -7.25, 9.0, 9.0], [0.5, -7.25, 0.0, 1.0]),
        ("rg32uint", Format::Rg32Uint, "u32", [4294967295.0, 2.0, 9.0, 9.0], [4294967295.0, 2.0, 0.0, 1.0]),
        ("rg32sint", Format::Rg32Sint, "i32", [-2147483648.0, 2.0, 9.0, 9.0], [-2147483648.0, 2.0, 0.0, 1.0]),
        ("rgba32float", Format::Rgba32Float, "f32", [0.75, -7.25, 1e10, 0.0], [0.75, -7.25, 1e10, 0.0]),
        ("rgba32uint", Format::Rgba32Uint, "u32", [1.0, 2.0, 3.0, 4294967295.0], [1.0, 2.0, 3.0, 4294967295.0]),
        ("rgba32sint", Format::Rgba32Sint, "i32", [1.0, -2.0, 3.0, -4.0], [1.0, -2.0, 3.0, -4.0]),
        ("r32float", Format::R32Float, "f32", [0.75, 5.0, 5.0, 5.0], [0.75, 0.0, 0.0, 1.0]),
        ("r32uint", Format::R32Uint, "u32", [4000000000.0, 5.0, 5.0, 5.0], [4000000000.0, 0.0, 0.0, 1.0]),
        ("r32sint", Format::R32Sint, "i32", [-4.0, 5.0, 5.0, 5.0], [-4.0, 0.0, 0.0, 1.0]),
        ("bgra8unorm", Format::Bgra8Unorm, "f32", [1.0, 0.2, 0.4, 0.6], [1.0, 0.2, 0.4, 0.6]),
        ("r8unorm", Format::R8Unorm, "f32", [0.6, 9.0, 9.0, 9.0], [0.6, 0.0, 0.0, 1.0]),
        ("rg16float", Format::Rg16Float, "f32", [0.5, -2.0, 9.0, 9.0], [0.5, -2.0, 0.0, 1.0]),
        ("rgb10a2unorm", Format::Rgb10a2Unorm, "f32", [1.0, 0.0, 5.0, 0.6], [1.0, 0.0, 1.0, 2.0 / 3.0]),
        ("rgb10a2uint", Format::Rgb10a2Uint, "u32", [1023.0, 5.0, 17.0, 3.0], [1023.0, 5.0, 17.0, 3.0]),
        ("rg11b10ufloat", Format::Rg11b10Ufloat, "f32", [0.5, 2.0, 1.5, 9.0], [0.5, 2.0, 1.5, 1.0]),
        ("rgba16unorm", Format::Rgba16Unorm, "f32", [1.0, 0.2, -1.0, 0.6], [1.0, 0.2, 0.0, 0.6]),
    ];
    for &(name, format, kind, stored, loaded) in cases {
        let literal = |x: f64| match kind {
            "f32" => format!("f32({x:?})"),
            "u32" => format!("{}u", x as u32),
            _ => format!("i32({})", x as i64),
        };
        let vector: Vec<String> = stored.iter().map(|&x| literal(x)).collect();
        let store = format!(
            "@group(0) @binding(0) var t: texture_storage_2d<{name}, write>;
             @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {{
                 if i != 2u {{ textureStore(t, vec2u(i, 1u), vec4<{kind}>({})); }}
             }}",
            vector.join(", ")
        );
        let load = format!(
            "@group(0) @binding(0) var<storage, read_write> result: array<vec4<{kind}>>;
             @group(0) @binding(1) var t: texture_2d<{kind}>;
             @compute @workgroup_size(4) fn main(@builtin(local_invocation_index) i: u32) {{ result[i] = textureLoad(t, vec2u(i, 1u), 0); }}"
        );
        let mut lab = Lab::new();
        let texture = lab.card.create_texture("", record::texture_2d(3, 2, format));
        let (view, result) = (lab.card.create_view(texture), lab.words(64));
        let (store, load) = (lab.compute(&store), lab.compute(&load));
        lab.dispatch(store, [1, 1, 1], [BoundResource::View(view)]);
        lab.dispatch(load, [1, 1, 1], [record::whole(result), BoundResource::View(view)]);
        let got = lab.read(result, 16);
        let number = |w: u32| match kind {
            "f32" => f64::from(f32::from_bits(w)),
            "u32" => f64::from(w),
            _ => f64::from(w as i32),
        };
        for (c, want) in loaded.into_iter().enumerate() {
            for i in [0, 1] {
                let x = number(got[4 * i + c]);
                assert!((x - want).abs() <= 1e-6 * want.abs(), "{name}, component {c}: {x} is not {want}");
            }
            // Nothing was stored here: zeros, and one where the format has no alpha.
            let missing = c == 3 && format.components() < 4;
            assert_eq!(number(got[8 + c]), f64::from(u8::from(missing)), "{name}: a texel that nobody wrote");
        }
        assert_eq!(got[12..16].iter().map(|&w| number(w)).collect::<Vec<_>>()[..3], [0.0; 3], "{name}: outside");
    }
}

/// A texture that is read and written by the same program, and the samples of a multisampled one.
#[test]
fn read_write_textures_and_samples() {
    let mut lab = Lab::new();
    let texture = lab.card.create_texture("", record::texture_2d(8, 8, Format::R32Float));
    let view = lab.card.create_view(texture);
    let many = lab.card.create_texture("", record::texture_multisampled(4, 4, 4, Format::Rgba8Unorm));
    let target = lab.card.create_view(many);
    // Each sample gets its own colour.
    let colours = lab.card.create_shader(
        "colours",
        &format!(
            "@fragment fn fs(@builtin(sample_index) s: u32, @builtin(position) p: vec4f) -> @location(0) vec4f {{
                 return vec4f(f32(s + 1u) * 0.2, floor(p.x) / 5.0, floor(p.y) / 5.0, 1.0);
             }} {COVER}"
        ),
    );
    let mut desc = record::render_pipeline(colours, Format::Rgba8Unorm);
    desc.multisample.count = 4;
    let pipeline = lab.card.create_render_pipeline("", desc);
    {
        let mut pass = lab.card.begin_render_pass([record::clear(target, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
    }
    let blur = lab.compute(
        "@group(0) @binding(0) var t: texture_storage_2d<r32float, read_write>;
         @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
             let old = textureLoad(t, id.xy).x;
             textureStore(t, id.xy, vec4f(old * 2.0 + f32(id.x + 10u * id.y)));
         }",
    );
    for _ in 0..3 {
        lab.dispatch(blur, [1, 1, 1], [BoundResource::View(view)]);
    }
    let result = lab.words(256);
    let read = lab.compute(
        "@group(0) @binding(0) var<storage, read_write> result: array<f32>;
         @group(0) @binding(1) var t: texture_storage_2d<r32float, read>;
         @group(0) @binding(2) var m: texture_multisampled_2d<f32>;
         @compute @workgroup_size(8, 8) fn main(@builtin(local_invocation_index) i: u32, @builtin(local_invocation_id) id: vec3u) {
             result[i] = textureLoad(t, id.xy).x;
             let texel = textureLoad(m, id.xy / 2u, i % 4u);
             result[64u + i] = texel.x * 5.0 + texel.y * 50.0 + texel.z * 500.0;
             if i == 0u { result[128] = f32(textureNumSamples(m) * 100u + textureDimensions(m).x); }
         }",
    );
    lab.dispatch(read, [1, 1, 1], [record::whole(result), BoundResource::View(view), BoundResource::View(target)]);
    let got = floats(&lab.read(result, 129));
    for i in 0..64usize {
        let (x, y) = (i % 8, i / 8);
        assert_eq!(got[i], 7.0 * (x + 10 * y) as f32, "texel {x}, {y}");
        let want = (i % 4 + 1 + 10 * (x / 2) + 100 * (y / 2)) as f64;
        assert_near(got[64 + i], want, 1e-5, 0.0, "a sample");
    }
    assert_eq!(got[128], 404.0);
}

/// Sampling that stays half a texel from the edge, whatever the sampler says.
#[test]
fn clamping_to_the_edge_of_the_base_level() {
    let mut lab = Lab::new();
    let texture = lab.card.create_texture("", record::texture_2d(4, 1, Format::R32Float));
    lab.card.write_level(texture, 0, "texels", &bytes(&bits(&[1.0, 2.0, 3.0, 4.0])));
    let view = lab.card.create_view(texture);
    let repeat = SamplerDesc { address: [AddressMode::Repeat; 3], ..sampler(FilterMode::Linear, FilterMode::Nearest) };
    let (repeat, result) = (lab.card.create_sampler(repeat), lab.words(64));
    let pipeline = lab.compute(
        "@group(0) @binding(0) var<storage, read_write> result: array<f32>;
         @group(0) @binding(1) var t: texture_2d<f32>;
         @group(0) @binding(2) var s: sampler;
         @compute @workgroup_size(5) fn main(@builtin(local_invocation_index) i: u32) {
             let u = f32(i) * 0.5 - 0.5;
             result[i] = textureSampleBaseClampToEdge(t, s, vec2f(u, 0.5)).x;
             result[8u + i] = textureSampleLevel(t, s, vec2f(u, 0.5), 0.0).x;
         }",
    );
    lab.dispatch(pipeline, [1, 1, 1], [record::whole(result), BoundResource::View(view), BoundResource::Sampler(repeat)]);
    let got = floats(&lab.read(result, 13));
    assert_eq!(got[..5], [1.0, 1.0, 2.5, 4.0, 4.0]);
    assert_eq!(got[8..], [2.5; 5]);
}
