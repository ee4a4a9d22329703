struct Scene {
    camera: mat4x4<f32>,
    sun: vec3<f32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(1) @binding(0) var image: texture_2d<f32>;
@group(1) @binding(1) var image_sampler: sampler;

struct Vertex {
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
    @location(2) tangent: vec4<f32>,
    @location(3) uv: vec2<f32>,
    @location(4) color: vec4<f32>,
    // Place and size.
    @location(5) object: vec4<f32>,
}

struct Varying {
    @builtin(position) @invariant clip: vec4<f32>,
    @location(0) world: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) tangent: vec3<f32>,
    @location(3) bitangent: vec3<f32>,
    @location(4) uv: vec2<f32>,
    @location(5) color: vec3<f32>,
    @location(6) rim: f32,
}

@vertex
fn position_only(
    @location(0) position: vec3<f32>,
    @location(5) object: vec4<f32>
) -> @builtin(position) @invariant vec4<f32> {
    return scene.camera * vec4<f32>(object.xyz + object.w * position, 1.0);
}

// All that any pass may want of a model.
@vertex
fn model(in: Vertex) -> Varying {
    let world = in.object.xyz + in.object.w * in.position;
    let normal = normalize(in.normal.xyz);
    let tangent = normalize(in.tangent.xyz);
    let view = normalize(vec3<f32>(0.0, 1.5, 9.5) - world);
    let rim = pow(1.0 - max(dot(view, normal), 0.0), 3.0);
    let clip = scene.camera * vec4<f32>(world, 1.0);
    return Varying(clip, world, normal, tangent, cross(normal, tangent), in.uv, in.color.rgb, rim);
}

@fragment
fn shaded(in: Varying) -> @location(0) vec4<f32> {
    let texel = textureSample(image, image_sampler, in.uv).rgb;
    let bend = 0.6 * (texel.r - 0.6);
    let normal = normalize(in.normal + bend * in.tangent + 0.5 * bend * in.bitangent);
    let light = 0.25 + 0.75 * max(dot(normal, scene.sun), 0.0);
    let mist = clamp(-0.04 * in.world.z, 0.0, 0.5);
    return vec4<f32>(mix(texel * in.color * light + 0.4 * in.rim, vec3<f32>(0.5, 0.55, 0.6), mist), 1.0);
}

@fragment
fn plain(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(0.6 * in.color, 1.0);
}

@fragment
fn picture(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(textureSample(image, image_sampler, in.uv).rgb, 1.0);
}
