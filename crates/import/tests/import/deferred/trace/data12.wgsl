
@group(0) @binding(0) var src: texture_2d<f32>;
@group(0) @binding(1) var smp: sampler;
@group(0) @binding(2) var dst: texture_storage_2d<rgba16float, write>;
@compute @workgroup_size(8, 8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let size = textureDimensions(dst);
    if any(id.xy >= size) { return; }
    let uv = (vec2f(id.xy) + 0.5) / vec2f(size);
    var sum = vec3f();
    for (var y = -1; y <= 1; y++) { for (var x = -1; x <= 1; x++) {
        sum += max(textureSampleLevel(src, smp, uv + vec2f(f32(x), f32(y)) / vec2f(size), 0.0).rgb - 0.35, vec3f());
    } }
    textureStore(dst, id.xy, vec4f(sum / 9.0, 1.0));
}
