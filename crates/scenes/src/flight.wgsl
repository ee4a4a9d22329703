var<immediate> camera: mat4x4<f32>;

// Centre and size.
@group(0) @binding(0) var<storage, read> places: array<vec4<f32>>;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var image_sampler: sampler;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) normal: vec3<f32>,
    @location(1) uv: vec2<f32>,
    @location(2) away: f32,
}

@vertex
fn vertex(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
) -> Varying {
    let place = places[instance];
    let clip = camera * vec4<f32>(place.xyz + place.w * position, 1.0);
    return Varying(clip, normal.xyz, uv, clip.w);
}

const sky = vec3<f32>(0.30, 0.42, 0.60);

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let albedo = textureSample(image, image_sampler, in.uv).rgb;
    let n = normalize(in.normal);
    let sun = max(dot(n, normalize(vec3<f32>(0.5, 0.8, 0.3))), 0.0);
    let lit = albedo * (0.35 + 0.2 * n.y + 1.7 * sun);
    return vec4<f32>(mix(lit, sky, 1.0 - exp2(-0.04 * in.away)), 1.0);
}
