struct Scene {
    camera: mat4x4<f32>,
    eye: vec3<f32>,
    sun: vec3<f32>,
}

struct Object {
    model: mat4x4<f32>,
    tint: vec3<f32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(1) @binding(0) var image: texture_2d<f32>;
@group(1) @binding(1) var image_sampler: sampler;
@group(2) @binding(0) var<uniform> object: Object;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) tint: vec3<f32>,
}

// An object with a matrix of its own.
@vertex
fn one(@location(0) position: vec3<f32>, @location(1) normal: vec4<f32>, @location(2) uv: vec2<f32>) -> Varying {
    let place = (object.model * vec4<f32>(position, 1.0)).xyz;
    let turned = (object.model * vec4<f32>(normal.xyz, 0.0)).xyz;
    return Varying(scene.camera * vec4<f32>(place, 1.0), place, turned, uv, object.tint);
}

// One of many: where it stands and how large it is, how it is turned (sine, cosine) and how light it is.
@vertex
fn many(
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) uv: vec2<f32>,
    @location(3) stands: vec4<f32>,
    @location(4) looks: vec4<f32>,
) -> Varying {
    let axis = vec2<f32>(looks.y, looks.x);
    let across = vec2<f32>(-looks.x, looks.y);
    let at = position * stands.w;
    let place = stands.xyz + vec3<f32>(dot(axis, at.xz), at.y, dot(across, at.xz));
    let turned = vec3<f32>(dot(axis, normal.xz), normal.y, dot(across, normal.xz));
    return Varying(scene.camera * vec4<f32>(place, 1.0), place, turned, uv, object.tint * looks.z);
}

const haze = vec3<f32>(0.52, 0.58, 0.64);

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let albedo = textureSample(image, image_sampler, in.uv).rgb * in.tint;
    let n = normalize(in.normal);
    let sun = max(dot(n, scene.sun), 0.0);
    let ambient = mix(vec3<f32>(0.30, 0.25, 0.20), vec3<f32>(0.38, 0.45, 0.56), 0.5 + 0.5 * n.y);
    let lit = albedo * (ambient + sun * vec3<f32>(1.55, 1.30, 0.95));
    let away = distance(in.position, scene.eye);
    return vec4<f32>(mix(haze, lit, exp2(-0.014 * away)), 1.0);
}
