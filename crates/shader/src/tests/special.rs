//! Subgroups, binding arrays, storage textures, immediates, packed workgroups, recorded dispatches.

use super::*;
use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::TextureDimension;
use work::{RequestKind, Service};

#[test]
fn subgroup_operations() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> input: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32, @builtin(subgroup_size) n: u32, @builtin(subgroup_invocation_id) lane: u32) {
            let x = input[i];
            var r = 0u;
            if (x % 3u != 0u) {
                r = subgroupAdd(x) + subgroupExclusiveAdd(1u) * 10000u;
                r += subgroupBroadcastFirst(x) * 1000000u;
                r += select(0u, 10000000u, subgroupAny(x == 62u)) + select(0u, 20000000u, subgroupAll(x > 1u));
            } else {
                let b = subgroupBallot(x > 30u);
                r = countOneBits(b.x) + countOneBits(b.y) * 100u + subgroupMax(x) * 10000u + subgroupMin(x + 5u) * 1000000u;
                r += subgroupShuffleXor(x, 3u) * 0u + n / 64u * 100000000u + (lane - i);
            }
            result[i] = r;
        }";
    let got = each(source, |i| i);
    let some: Vec<u32> = (0..64).filter(|x| x % 3 != 0).collect();
    for x in 0..64u32 {
        let want = if x % 3 != 0 {
            let before = some.iter().filter(|&&y| y < x).count() as u32;
            some.iter().sum::<u32>() + before * 10_000 + 1_000_000 + 10_000_000
        } else {
            let high = (0..64).filter(|y| y % 3 == 0 && *y > 30);
            let (a, b): (Vec<u32>, Vec<u32>) = high.partition(|y| *y < 32);
            a.len() as u32 + b.len() as u32 * 100 + 63 * 10_000 + 5_000_000 + 100_000_000
        };
        assert_eq!(got[x as usize], want, "lane {x}");
    }
}

#[test]
fn binding_arrays_of_buffers() {
    let source = "enable wgpu_binding_array;
        struct B { v: array<u32, 4> }
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @group(0) @binding(1) var<storage, read> list: binding_array<B, 3>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            result[i] = list[i % 3u].v[i % 4u] + list[2].v[1] * 1000u;
        }";
    let p = program(source);
    assert_eq!(p.interface().bindings[1].count, Some(3));
    let out = Words::new(256);
    let parts: Vec<Words> = (0..3).map(|k| words_of(&[k * 10, k * 10 + 1, k * 10 + 2, k * 10 + 3])).collect();
    let buffer = |w| Resource::Buffer(BufferRange { words: w, offset: 0, size: 256, address: 0 });
    let bindings = vec![vec![buffer(&out)], parts.iter().map(buffer).collect()];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&p, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect("it ends");
    for i in 0..64u32 {
        assert_eq!(out.load(i as usize), i % 3 * 10 + i % 4 + 21_000);
    }
}

#[test]
fn storage_textures_are_stored_and_loaded() {
    let source = "
        @group(0) @binding(0) var dst: texture_storage_2d_array<rgba8unorm, write>;
        @group(0) @binding(1) var src: texture_storage_2d<r32uint, read_write>;
        @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
            let v = textureLoad(src, id.xy).x;
            textureStore(src, id.xy, vec4u(v + 1u, 0u, 0u, 0u));
            textureStore(dst, id.xy, 1, vec4f(f32(v) / 255.0, 0.5, 2.0, -1.0));
            textureStore(dst, id.xy, 9, vec4f(1.0));
        }";
    let p = program(source);
    let image =
        |format, layers| ImageDesc { dimension: TextureDimension::D2, size: [8, 6, layers], levels: 1, samples: 1, format };
    let (color, number) = (image(Format::Rgba8Unorm, 2), image(Format::R32Uint, 1));
    let (a, b) = (Words::new(color.bytes()), Words::new(number.bytes()));
    for i in 0..48 {
        b.store(i, i as u32 * 5);
    }
    let storage = |words, desc, layers| {
        vec![Resource::Storage(StorageImage { words, desc, level: 0, base_layer: 0, layers, address: 0 })]
    };
    let bindings = vec![storage(&a, color, 2), storage(&b, number, 1)];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&p, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect("it ends");
    for i in 0..48u32 {
        assert_eq!(b.load(i as usize), i * 5 + 1);
        assert_eq!(a.load(i as usize), 0, "layer 0 is not written");
        assert_eq!(a.load(48 + i as usize), (i * 5) | (128 << 8) | (255 << 16));
    }
}

#[test]
fn immediates_are_read() {
    let source = "
        struct I { a: vec2u, list: array<u32, 4> }
        var<immediate> now: I;
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(local_invocation_index) i: u32) {
            result[i] = now.a.y * 100u + now.list[i % 4u];
        }";
    let p = program(source);
    assert_eq!(p.interface().immediate_bytes, 24);
    let out = Words::new(256);
    let bindings = vec![vec![Resource::Buffer(BufferRange { words: &out, offset: 0, size: 256, address: 0 })]];
    let resources = Resources { bindings: &bindings, immediates: &[1, 2, 10, 11, 12, 13], ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    executor.bind(&p, &resources, &uniforms).run_groups(0..1, [1, 1, 1], None).expect("it ends");
    for i in 0..64u32 {
        assert_eq!(out.load(i as usize), 210 + i % 4);
    }
}

#[test]
fn small_groups_share_a_batch_and_are_recorded_apart() {
    let source = "
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(3, 2) fn main(@builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) g: vec3u,
            @builtin(num_workgroups) n: vec3u, @builtin(local_invocation_index) l: u32) {
            let at = (g.x + n.x * (g.y + n.y * g.z)) * 6u + l;
            var r = id.x + 100u * id.y + 10000u * id.z;
            if (g.y == 1u) { r += 1000000u; }
            result[at] = r;
        }";
    let p = program(source);
    let out = Words::new(4 * 6 * 5 * 2 * 3);
    let bindings = vec![vec![Resource::Buffer(BufferRange { words: &out, offset: 0, size: out.len(), address: 640 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    let (mut recorder, mut packets) = (Recorder::new(), Vec::new());
    bound.run_groups(0..30, [5, 2, 3], Some((&mut recorder, &mut packets))).expect("it ends");
    for g in 0..30u32 {
        let (gx, gy, gz) = (g % 5, g / 5 % 2, g / 10);
        for l in 0..6 {
            let (x, y) = (gx * 3 + l % 3, gy * 2 + l / 3);
            let want = x + 100 * y + 10_000 * gz + if gy == 1 { 1_000_000 } else { 0 };
            assert_eq!(out.load((g * 6 + l) as usize), want, "group {g} invocation {l}");
        }
    }
    assert_eq!(packets.len(), 60, "two packets a group");
    for packet in &packets {
        let cost = &recorder.costs[packet.cost];
        assert_eq!(cost.steps.iter().map(|s| s.then).collect::<Vec<_>>(), [RequestKind::Store, RequestKind::End]);
    }
    let lines = |k: usize| {
        let r = recorder.requests[packets[k].first_request as usize];
        assert_eq!(usize::from(r.lines), 1);
        recorder.lines[r.first_line as usize]
    };
    assert_eq!((lines(0), lines(6), lines(59)), (10, 11, (640 + 4 * 178) / 64));
}

#[test]
fn barriers_end_steps() {
    let source = "
        var<workgroup> w: array<u32, 70>;
        @group(0) @binding(0) var<storage, read_write> result: array<u32>;
        @compute @workgroup_size(70) fn main(@builtin(local_invocation_index) l: u32) {
            w[l] = l * 2u;
            workgroupBarrier();
            let u = workgroupUniformLoad(&w[69]);
            result[l] = w[69u - l] + u;
        }";
    let p = program(source);
    assert!(p.interface().barriers && p.interface().workgroup_bytes == 280);
    let out = Words::new(280);
    let bindings = vec![vec![Resource::Buffer(BufferRange { words: &out, offset: 0, size: 280, address: 0 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    let (mut recorder, mut packets) = (Recorder::new(), Vec::new());
    bound.run_groups(0..1, [1, 1, 1], Some((&mut recorder, &mut packets))).expect("it ends");
    for l in 0..70 {
        assert_eq!(out.load(l), (69 - l as u32) * 2 + 138);
    }
    assert_eq!(packets.len(), 18);
    let kinds: Vec<_> = recorder.costs[packets[17].cost].steps.iter().map(|s| s.then).collect();
    use RequestKind::{Barrier, End, Shared, Store};
    assert_eq!(kinds, [Shared, Barrier, Barrier, Shared, Barrier, Shared, Store, End]);
    // The words that its two invocations have.
    let accesses = &recorder.shared[packets[17].first_shared as usize..];
    let words: Vec<_> = accesses.iter().map(|r| &recorder.words[r.first_line as usize..][..usize::from(r.lines)]).collect();
    assert_eq!(words, [&[68, 69][..], &[69], &[1, 0]]);
}

#[test]
fn a_warp_loads_and_computes_what_all_invocations_share() {
    let source = "
        @group(0) @binding(0) var<storage, read> a: array<f32, 64>;
        @group(0) @binding(1) var<uniform> u: vec4f;
        @group(0) @binding(2) var<storage, read_write> o: array<f32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            var s = u.x;
            for (var i = 0u; i < 4u; i++) { s += a[16u * i]; }
            o[id.x] = s * f32(id.x);
        }";
    let p = program(source);
    let [a, u, o] = [256, 16, 256].map(Words::new);
    let buffer = |words, address, size| Resource::Buffer(BufferRange { words, offset: 0, size, address });
    let bindings = vec![vec![buffer(&a, 4096, 256)], vec![buffer(&u, 8192, 16)], vec![buffer(&o, 12288, 256)]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    let mut record = |extra: Extra| {
        let (mut recorder, mut packets) = (Recorder::with(extra), Vec::new());
        bound.run_groups(0..1, [1, 1, 1], Some((&mut recorder, &mut packets))).expect("it ends");
        (recorder.costs[packets[3].cost].clone(), recorder, packets)
    };
    for paths in [false, true] {
        let (cost, recorder, packets) = record(Extra { paths, ..Extra::default() });
        use RequestKind::{End, Load, Store};
        assert_eq!(cost.steps.iter().map(|step| step.then).collect::<Vec<_>>(), [Load, Load, Load, Load, Store, End]);
        // The loads wait for nothing; the four sums wait for them, and the product comes after. A uniform buffer is an operand.
        assert!(
            cost.steps[..4]
                .iter()
                .all(|step| step.instructions == [0, 1, 0, 0, 0] && step.in_flight[Service::Texture] == u8::MAX)
        );
        assert_eq!((cost.steps[4].instructions[0], cost.steps[4].in_flight[Service::Texture]), (4 + 1, 0));
        let requests = &recorder.requests[packets[3].first_request as usize..][..4];
        let lines: Vec<_> = requests.iter().map(|r| &recorder.lines[r.first_line as usize..][..usize::from(r.lines)]).collect();
        assert_eq!(lines, [[64], [65], [66], [67]]);
    }
    // Instructions on four components are counted with what is shared, and their machine has constants in registers.
    assert_eq!(record(Extra { vectors: true, ..Extra::default() }).0.steps.len(), 2);
}

#[test]
fn loads_from_uniform_buffers_name_their_words_behind_other_requests() {
    let source = "
        struct Table { at: vec4u, values: array<vec4f, 64> }
        @group(0) @binding(0) var<uniform> u: Table;
        @group(0) @binding(1) var<storage, read_write> o: array<vec4f>;
        @group(0) @binding(2) var<storage, read> a: array<vec4f>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let mine = u.values[id.x / 2];
            o[id.x] = mine + a[id.x] + u.values[u.at.x];
        }";
    let p = program(source);
    let [u, o, a] = [1040, 1024, 1024].map(Words::new);
    u.words()[0].store(5, std::sync::atomic::Ordering::Relaxed);
    let buffer = |words, address, size| Resource::Buffer(BufferRange { words, offset: 0, size, address });
    let bindings = vec![vec![buffer(&u, 4096, 1040)], vec![buffer(&o, 8192, 1024)], vec![buffer(&a, 12288, 1024)]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    for paths in [false, true] {
        let (mut recorder, mut packets) = (Recorder::with(Extra { paths, ..Extra::default() }), Vec::new());
        let mut bound = executor.bind(&p, &resources, &uniforms);
        bound.run_groups(0..1, [1, 1, 1], Some((&mut recorder, &mut packets))).expect("it ends");
        let cost = &recorder.costs[packets[3].cost];
        use RequestKind::{Constant, End, Load, Store};
        assert_eq!(
            cost.steps.iter().map(|step| step.then).collect::<Vec<_>>(),
            [Constant, Constant, Constant, Constant, Constant, Load, Store, End]
        );
        // Invocations 12 to 15 load from storage at 12288 + 12 x 16, and store; then the shared loads of value 5, and their own of 6 and 7.
        let requests = &recorder.requests[packets[3].first_request as usize..][..7];
        let lines = |k: usize| &recorder.lines[requests[k].first_line as usize..][..usize::from(requests[k].lines)];
        assert_eq!([lines(0), lines(1)], [[(12288 + 192) / 64], [(8192 + 192) / 64]]);
        let words = |k: usize| requests[k].words(&recorder.lines).collect::<Vec<_>>();
        assert_eq!([2, 3, 4, 5].map(|k| words(k)[0]), [8, 9, 10, 11].map(|word| ((4096 + 96) / 64, 1 << word)));
        assert_eq!(words(6), [((4096 + 112) / 64, 1 << 12), ((4096 + 128) / 64, 1)]);
    }
}

#[test]
fn programs_of_an_engine() {
    // Culling in compute: bit tricks, an append list with an atomic counter, structs behind pointers, early outs.
    let source = "
        struct Bounds { center: vec3f, radius: f32 }
        struct Instance { model: mat4x4f, bounds: Bounds, mesh: u32, flags: u32 }
        struct Draw { index_count: u32, instance_count: atomic<u32>, first_index: u32, base: i32, first_instance: u32 }
        struct View { planes: array<vec4f, 6>, eye: vec3f, count: u32 }
        @group(0) @binding(0) var<storage, read_write> visible: array<u32>;
        @group(0) @binding(1) var<storage, read> instances: array<Instance>;
        @group(0) @binding(2) var<storage, read_write> draws: array<Draw, 2>;
        @group(0) @binding(3) var<uniform> view: View;
        fn distance_to(p: ptr<function, Bounds>, plane: vec4f) -> f32 { return dot((*p).center, plane.xyz) + plane.w; }
        fn inside(b: Bounds) -> bool {
            var bounds = b;
            for (var i = 0u; i < 6u; i++) { if (distance_to(&bounds, view.planes[i]) < -bounds.radius) { return false; } }
            return true;
        }
        fn hash(x: u32) -> u32 { var h = x; h ^= h >> 16u; h *= 0x7feb352du; h ^= h >> 15u; h *= 0x846ca68bu; h ^= h >> 16u; return h; }
        @compute @workgroup_size(64) fn cull(@builtin(global_invocation_id) id: vec3u) {
            if (id.x >= view.count) { return; }
            let mesh = instances[id.x].mesh;
            if ((instances[id.x].flags & 1u) == 0u) { return; }
            var b = instances[id.x].bounds;
            b.center = (instances[id.x].model * vec4f(b.center, 1.0)).xyz;
            if (!inside(b)) { return; }
            let slot = atomicAdd(&draws[mesh].instance_count, 1u);
            visible[draws[mesh].first_instance + slot] = id.x | (hash(id.x) & 0xffff0000u);
        }";
    let p = program(source);
    let n = 50u32;
    let mut data = Vec::new();
    for i in 0..n {
        let mut m = [0f32; 16];
        (m[0], m[5], m[10], m[15]) = (1.0, 1.0, 1.0, 1.0);
        m[12] = i as f32;
        data.extend(m.map(f32::to_bits));
        data.extend([0f32, 0.0, 0.0, 0.75].map(f32::to_bits));
        data.extend([i % 2, u32::from(i % 7 != 3), 0, 0]);
    }
    let instances = words_of(&data);
    let draws = words_of(&[36, 0, 0, 0, 0, 36, 0, 0, 0, 100]);
    let mut view: Vec<u32> = Vec::new();
    let planes = [
        [1f32, 0.0, 0.0, -10.0],
        [-1.0, 0.0, 0.0, 40.0],
        [0.0, 1.0, 0.0, 1.0],
        [0.0, -1.0, 0.0, 1.0],
        [0.0, 0.0, 1.0, 1.0],
        [0.0, 0.0, -1.0, 1.0],
    ];
    planes.iter().for_each(|p| view.extend(p.map(f32::to_bits)));
    view.extend([0, 0, 0, n - 2]);
    let view = words_of(&view);
    let visible = Words::new(4 * 200);
    run_with(&p, [1, 1, 1], &[(0, &visible), (1, &instances), (2, &draws), (3, &view)]);
    let seen = |mesh: u32| (0..n - 2).filter(move |i| i % 2 == mesh && i % 7 != 3 && (10..=40).contains(i)).collect::<Vec<_>>();
    for mesh in 0..2 {
        let want = seen(mesh);
        assert_eq!(draws.load(5 * mesh as usize + 1) as usize, want.len());
        for (k, i) in want.iter().enumerate() {
            assert_eq!(visible.load(100 * mesh as usize + k) & 0xffff, *i);
        }
    }
}
