
struct Camera { view_proj: mat4x4f, inverse: mat4x4f, eye: vec4f }
struct Light { at: vec3f, radius: f32, color: vec3f, kind: u32 }
struct Tile { count: u32, lights: array<u32, 31> }
@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(2) var depth: texture_depth_2d;
@group(0) @binding(3) var<storage, read_write> tiles: array<Tile>;
var<workgroup> low: atomic<u32>;
var<workgroup> high: atomic<u32>;
var<workgroup> near: atomic<u32>;
var<workgroup> list: array<u32, 31>;
const TILE = 16u;

fn unproject(p: vec2f, z: f32, size: vec2f) -> vec3f {
    let ndc = vec3f(p / size * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0), z);
    let h = camera.inverse * vec4f(ndc, 1.0);
    return h.xyz / h.w;
}

@compute @workgroup_size(16, 16)
fn main(@builtin(global_invocation_id) id: vec3u, @builtin(workgroup_id) tile: vec3u, @builtin(local_invocation_index) local: u32, @builtin(num_workgroups) groups: vec3u) {
    if local == 0u { atomicStore(&low, 0x7f800000u); }
    workgroupBarrier();
    let size = textureDimensions(depth);
    if all(id.xy < size) {
        let z = textureLoad(depth, id.xy, 0);
        if z < 1.0 {
            atomicMin(&low, bitcast<u32>(z));
            atomicMax(&high, bitcast<u32>(z));
        }
    }
    workgroupBarrier();
    let zl = bitcast<f32>(atomicLoad(&low)); let zh = bitcast<f32>(atomicLoad(&high));
    // A bounding box of the tile's surface in the world.
    var lo = vec3f(1e9); var hi = vec3f(-1e9);
    for (var corner = 0u; corner < 8u; corner++) {
        let xy = (vec2f(tile.xy) + vec2f(f32(corner & 1u), f32((corner >> 1u) & 1u))) * f32(TILE);
        let p = unproject(xy, select(zl, zh, (corner & 4u) != 0u), vec2f(size));
        lo = min(lo, p); hi = max(hi, p);
    }
    var i = local;
    loop {
        if i >= arrayLength(&lights) { break; }
        let light = lights[i];
        let d = max(max(lo - light.at, light.at - hi), vec3f(0.0));
        if zh > 0.0 && dot(d, d) < light.radius * light.radius {
            let slot = atomicAdd(&near, 1u);
            if slot < 31u { list[slot] = i; }
        }
        continuing { i += 256u; }
    }
    workgroupBarrier();
    let index = tile.y * groups.x + tile.x;
    let count = min(atomicLoad(&near), 31u);
    if local == 0u {
        // In order, so that sums do not depend on who came first.
        for (var a = 1u; a < count; a++) {
            let v = list[a];
            var b = a;
            while b > 0u && list[b - 1u] > v { list[b] = list[b - 1u]; b--; }
            list[b] = v;
        }
        tiles[index].count = count;
    }
    workgroupBarrier();
    if local < count { tiles[index].lights[local] = list[local]; }
}
