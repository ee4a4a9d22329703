@group(0) @binding(0) var atlas: texture_2d<f32>;
@group(0) @binding(1) var atlas_sampler: sampler;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) uv: vec2<f32>,
    @location(1) color: vec4<f32>,
}

@vertex
fn vertex(
    @builtin(vertex_index) index: u32,
    @location(0) center: vec2<f32>,
    @location(1) half_axis: vec2<f32>,
    @location(2) color: vec4<f32>,
    @location(3) cell: vec4<u32>,
) -> Varying {
    let corner = vec2<f32>(f32(index & 1u), f32(index >> 1u));
    let side = corner * 2.0 - 1.0;
    let axis = half_axis * 512.0;
    let pixel = center + side.x * axis + side.y * vec2<f32>(-axis.y, axis.x);
    let position = vec4<f32>(pixel.x / 320.0 - 1.0, 1.0 - pixel.y / 240.0, 0.0, 1.0);
    // Half a texel stays free on all sides, so that cells do not run into each other.
    let inset = 0.5 / 64.0 + corner * (1.0 - 1.0 / 64.0);
    let origin = vec2<f32>(f32(cell.x & 1u), f32(cell.x >> 1u));
    return Varying(position, (origin + inset) * 0.5, color);
}

// Premultiplied alpha.
@fragment
fn over(in: Varying) -> @location(0) vec4<f32> {
    return textureSample(atlas, atlas_sampler, in.uv) * vec4<f32>(in.color.rgb * in.color.a, in.color.a);
}

@fragment
fn add(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(in.color.rgb, textureSample(atlas, atlas_sampler, in.uv).a * in.color.a);
}
