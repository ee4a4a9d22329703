@group(0) @binding(0) var grain: texture_2d<f32>;
@group(0) @binding(1) var grain_sampler: sampler;

struct Varying {
    @builtin(position) position: vec4<f32>,
    // From -1 to 1 over the rectangle.
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) color: vec4<f32>,
    @location(2) uv: vec2<f32>,
}

@vertex
fn vertex(
    @builtin(vertex_index) index: u32,
    @location(0) center: vec2<f32>,
    @location(1) right: vec2<f32>,
    @location(2) down: vec2<f32>,
    @location(3) color: vec4<f32>,
) -> Varying {
    let at = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    let pixel = center + at.x * right + at.y * down;
    let position = vec4<f32>(pixel.x / 128.0 - 1.0, 1.0 - pixel.y / 96.0, 0.0, 1.0);
    return Varying(position, at, color, pixel / 32.0);
}

// The plate that the dials sit on: brushed metal.
@fragment
fn plate(in: Varying) -> @location(0) vec4<f32> {
    let fine = textureSample(grain, grain_sampler, vec2<f32>(in.uv.x * 0.25, in.uv.y * 4.0)).r;
    let coarse = textureSample(grain, grain_sampler, in.uv * 0.5).r;
    let edge = smoothstep(1.0, 0.94, max(abs(in.at.x), abs(in.at.y)));
    return vec4<f32>(in.color.rgb * (0.55 + 0.3 * fine + 0.15 * coarse) * (0.4 + 0.6 * edge), 1.0);
}

// A dial: a rim, a face, and twelve marks; premultiplied alpha.
@fragment
fn dial(in: Varying) -> @location(0) vec4<f32> {
    let radius = length(in.at);
    let rim = smoothstep(0.86, 0.88, radius);
    let turn = atan2(in.at.y, in.at.x) * (12.0 / 6.2831853);
    let mark = smoothstep(0.12, 0.08, abs(turn - round(turn))) * smoothstep(0.68, 0.70, radius) * (1.0 - rim);
    let face = in.color.rgb * (0.8 + 0.2 * textureSample(grain, grain_sampler, in.at * 0.5).r);
    let shade = mix(mix(face, vec3<f32>(0.06), mark), vec3<f32>(0.65 - 0.4 * in.at.y), rim);
    let alpha = smoothstep(1.0, 0.98, radius);
    return vec4<f32>(shade * alpha, alpha);
}

// A needle, pointed at its end.
@fragment
fn needle(in: Varying) -> @location(0) vec4<f32> {
    let alpha = smoothstep(1.0, 0.7, abs(in.at.y) + 0.5 * (in.at.x + 1.0));
    return vec4<f32>(in.color.rgb * alpha, alpha);
}
