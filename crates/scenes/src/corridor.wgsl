const lamps = 8u;

struct Scene {
    camera: mat4x4<f32>,
    // Place, and warmth of the light.
    lamps: array<vec4<f32>, lamps>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var surfaces: texture_2d_array<f32>;
@group(0) @binding(2) var surface_sampler: sampler;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) @interpolate(flat) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
}

@vertex
fn vertex(@location(0) position: vec3<f32>, @location(1) normal: vec4<f32>, @location(2) uv: vec2<f32>) -> Varying {
    return Varying(scene.camera * vec4<f32>(position, 1.0), position, normal.xyz, uv);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    // Bricks on the walls, tiles on floor and ceiling.
    let layer = select(0u, 1u, abs(in.normal.y) > 0.5);
    let albedo = textureSample(surfaces, surface_sampler, in.uv, layer).rgb;
    var light = vec3<f32>(0.012, 0.014, 0.02);
    for (var i = 0u; i < lamps; i++) {
        let way = scene.lamps[i].xyz - in.position;
        let near = 1.0 / (0.35 + dot(way, way));
        let facing = max(dot(in.normal, way), 0.0) * sqrt(near);
        light += vec3<f32>(1.0, 0.72 * scene.lamps[i].w, 0.42 * scene.lamps[i].w) * (facing * near * 4.5);
    }
    return vec4<f32>(albedo * light, 1.0);
}
