struct Scene {
    camera: mat4x4<f32>,
    models: array<mat4x4<f32>, 9>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var image_sampler: sampler;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
}

@vertex
fn vertex(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
) -> Varying {
    let model = scene.models[instance];
    let world = model * vec4<f32>(position, 1.0);
    return Varying(scene.camera * world, world.xyz, (model * vec4<f32>(normal.xyz, 0.0)).xyz, uv);
}

const sky = vec3<f32>(0.16, 0.21, 0.29);

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let albedo = textureSample(image, image_sampler, in.uv).rgb;
    let n = normalize(in.normal);
    let sun = max(dot(n, normalize(vec3<f32>(0.45, 0.8, 0.6))), 0.0);
    let ambient = mix(vec3<f32>(0.12, 0.10, 0.09), vec3<f32>(0.30, 0.36, 0.45), n.y * 0.5 + 0.5);
    let lit = albedo * (ambient + vec3<f32>(1.9, 1.75, 1.5) * sun);
    // Far crates fade into the background.
    let haze = 1.0 - exp2(-0.035 * max(6.0 - in.position.z - 5.0, 0.0));
    return vec4<f32>(mix(lit, sky, haze), 1.0);
}
