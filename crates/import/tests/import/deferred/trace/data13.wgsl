
@group(0) @binding(0) var hdr: texture_2d<f32>;
@group(0) @binding(1) var bloom: texture_2d<f32>;
@group(0) @binding(2) var ids: texture_2d<u32>;
@group(0) @binding(3) var smp: sampler;
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32((i << 1u) & 2u) * 2.0 - 1.0, f32(i & 2u) * 2.0 - 1.0, 0.0, 1.0);
}
@fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {
    let at = vec2i(p.xy);
    let size = vec2f(textureDimensions(hdr));
    var c = textureLoad(hdr, at, 0).rgb + textureSampleLevel(bloom, smp, p.xy / size, 0.0).rgb;
    c = c * (2.51 * c + 0.03) / (c * (2.43 * c + 0.59) + 0.14);
    let id = textureLoad(ids, at, 0).x;
    let limit = vec2i(textureDimensions(ids)) - 1;
    let right = textureLoad(ids, min(at + vec2i(1, 0), limit), 0).x;
    let below = textureLoad(ids, min(at + vec2i(0, 1), limit), 0).x;
    if id != right || id != below { c *= 0.25; }
    return vec4f(pow(saturate(c), vec3f(1.0 / 2.2)), 1.0);
}
