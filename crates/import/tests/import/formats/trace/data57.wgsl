
@group(0) @binding(0) var t: texture_2d<i32>;
@group(0) @binding(1) var s: sampler;
struct Cell { rect: vec4f, scale: vec4f, bias: vec4f }
@group(1) @binding(0) var<uniform> cell: Cell;
struct V { @builtin(position) p: vec4f, @location(0) uv: vec2f }
@vertex fn vs(@builtin(vertex_index) i: u32) -> V {
    let corner = vec2f(f32(i & 1u), f32(i >> 1u));
    let p = cell.rect.xy + corner * cell.rect.zw;
    return V(vec4f(p.x / 128.0 - 1.0, 1.0 - p.y / 128.0, 0.0, 1.0), corner);
}
@fragment fn fs(v: V) -> @location(0) vec4f {
    let uv = v.uv * 0.9713 + 0.0137;
    var c = vec4f(0.0);
    c = vec4f(textureLoad(t, vec2i(uv * 8.0), 0)) + f32(textureNumLevels(t)) * 0.0 + vec4f(textureGather(1, t, s, uv)) * 0.0;
    return saturate(c * cell.scale + cell.bias);
}
