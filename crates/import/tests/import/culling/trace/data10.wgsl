
struct Camera { view_proj: mat4x4f, planes: array<vec4f, 6>, count: u32 }
struct Tile { offset: vec2f, size: f32, shade: f32 }
@group(0) @binding(0) var<uniform> camera: Camera;
@group(1) @binding(0) var<uniform> tile: Tile;
struct V { @builtin(position) position: vec4f, @location(0) at: vec2f }
@vertex fn vs(@builtin(vertex_index) i: u32) -> V {
    let corner = vec2f(f32(i & 1u), f32(i >> 1u));
    var v: V;
    v.at = corner * 8.0;
    let xz = tile.offset + corner * tile.size;
    v.position = camera.view_proj * vec4f(xz.x, -1.5, xz.y, 1.0);
    return v;
}
@fragment fn fs(v: V) -> @location(0) vec4f {
    let odd = (i32(floor(v.at.x)) ^ i32(floor(v.at.y))) & 1;
    return vec4f(vec3f(tile.shade * select(0.5, 1.0, odd == 1)), 1.0);
}
