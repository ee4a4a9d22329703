
struct Camera { view_proj: mat4x4f, inverse: mat4x4f, eye: vec4f }
struct Light { at: vec3f, radius: f32, color: vec3f, kind: u32 }
struct Tile { count: u32, lights: array<u32, 31> }
@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> lights: array<Light>;
@group(0) @binding(2) var depth: texture_depth_2d;
@group(0) @binding(3) var<storage, read> tiles: array<Tile>;
@group(1) @binding(0) var albedo: texture_2d<f32>;
@group(1) @binding(1) var normals: texture_2d<f32>;
@group(1) @binding(2) var out: texture_storage_2d<rgba16float, write>;
struct Params { sun: vec3f, strength: f32 }
var<immediate> params: Params;
fn falloff(d2: f32, r: f32) -> f32 { let x = saturate(1.0 - d2 / (r * r)); return x * x; }
@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(depth);
    if any(id.xy >= size) { return; }
    let z = textureLoad(depth, vec2i(id.xy), 0);
    if z == 1.0 {
        let t = f32(id.y) / f32(size.y);
        textureStore(out, id.xy, vec4f(mix(vec3f(0.1, 0.15, 0.4), vec3f(0.9, 0.5, 0.3), smoothstep(0.0, 0.6, t)), 1.0));
        return;
    }
    let ndc = vec2f(id.xy) + 0.5;
    let h = camera.inverse * vec4f(ndc / vec2f(size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0), z, 1.0);
    let p = h.xyz / h.w;
    let n = textureLoad(normals, id.xy, 0).xyz;
    let a = textureLoad(albedo, id.xy, 0);
    var sum = a.rgb * (0.05 + max(dot(n, params.sun), 0.0) * params.strength);
    let columns = (size.x + 15u) / 16u;
    let tile = &tiles[(id.y / 16u) * columns + id.x / 16u];
    for (var i = 0u; i < (*tile).count; i++) {
        let light = lights[(*tile).lights[i]];
        let to = light.at - p;
        let d2 = dot(to, to);
        if d2 > light.radius * light.radius { continue; }
        let l = to * inverseSqrt(d2);
        let v = normalize(camera.eye.xyz - p);
        let hv = normalize(l + v);
        var shine = 0.0;
        switch light.kind {
            case 0u: { shine = pow(max(dot(n, hv), 0.0), 24.0); }
            case 1u, 2u: { shine = pow(max(dot(n, hv), 0.0), 80.0) * 2.0; }
            default: {}
        }
        sum += light.color * falloff(d2, light.radius) * (a.rgb * max(dot(n, l), 0.0) + shine * 0.5);
    }
    textureStore(out, id.xy, vec4f(sum, 1.0));
}
