struct Scene {
    camera: mat4x4<f32>,
    light: mat4x4<f32>,
    sun: vec3<f32>,
    texel: f32,
    eye: vec3<f32>,
}

struct Object {
    model: mat4x4<f32>,
    color: vec4<f32>,
}

@group(0) @binding(0) var<uniform> scene: Scene;
@group(0) @binding(1) var<storage, read> objects: array<Object>;
@group(1) @binding(0) var shadow_map: texture_depth_2d;
@group(1) @binding(1) var shadow_sampler: sampler_comparison;

@vertex
fn from_light(@builtin(instance_index) instance: u32, @location(0) position: vec3<f32>) -> @builtin(position) vec4<f32> {
    return scene.light * (objects[instance].model * vec4<f32>(position, 1.0));
}

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) shadow: vec3<f32>,
    @location(3) @interpolate(flat) color: vec3<f32>,
}

@vertex
fn place(
    @builtin(instance_index) instance: u32,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec4<f32>,
) -> Varying {
    let object = objects[instance];
    let world = object.model * vec4<f32>(position, 1.0);
    let light = scene.light * world;
    let shadow = vec3<f32>(light.x * 0.5 + 0.5, 0.5 - light.y * 0.5, light.z);
    // Boxes are scaled unevenly: their normals are divided by the squares of the scales, each a column's length.
    let m = object.model;
    let squares = vec3<f32>(dot(m[0], m[0]), dot(m[1], m[1]), dot(m[2], m[2]));
    let turned = (m * vec4<f32>(normal.xyz / squares, 0.0)).xyz;
    return Varying(scene.camera * world, world.xyz, turned, shadow, object.color.rgb);
}

@fragment
fn shade(in: Varying) -> @location(0) vec4<f32> {
    var lit = 0.0;
    for (var y = -1; y <= 1; y++) {
        for (var x = -1; x <= 1; x++) {
            let offset = vec2<f32>(f32(x), f32(y)) * scene.texel;
            lit += textureSampleCompareLevel(shadow_map, shadow_sampler, in.shadow.xy + offset, in.shadow.z);
        }
    }
    lit /= 9.0;
    let n = normalize(in.normal);
    let v = normalize(scene.eye - in.position);
    let h = normalize(scene.sun + v);
    let direct = max(dot(n, scene.sun), 0.0) * lit;
    let shine = 0.25 * pow(max(dot(n, h), 0.0), 48.0) * lit;
    let sky = mix(vec3<f32>(0.10, 0.085, 0.07), vec3<f32>(0.20, 0.25, 0.34), n.y * 0.5 + 0.5);
    let color = in.color * (sky + vec3<f32>(1.7, 1.5, 1.2) * direct) + shine;
    // The ground fades into the sky.
    let away = length(in.position.xz);
    return vec4<f32>(mix(color, vec3<f32>(0.30, 0.44, 0.62), smoothstep(9.0, 13.5, away)), 1.0);
}
