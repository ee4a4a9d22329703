struct Camera {
    clip: mat4x4<f32>,
    eye: vec3<f32>,
    extent: f32,
}

@group(0) @binding(0) var<uniform> camera: Camera;

struct Varying {
    @builtin(position) clip: vec4<f32>,
    @location(0) position: vec3<f32>,
    @location(1) normal: vec3<f32>,
    @location(2) hue: f32,
}

@vertex
fn vertex(@location(0) code: vec4<f32>, @location(1) normal: vec4<f32>) -> Varying {
    let position = (code.xyz * 2.0 - 1.0) * camera.extent;
    return Varying(camera.clip * vec4<f32>(position, 1.0), position, normal.xyz, code.w);
}

const key_light = vec3<f32>(5.0, 6.0, 7.0);
const key_color = vec3<f32>(1.0, 0.93, 0.82);
const fill_direction = vec3<f32>(-0.74, -0.33, 0.58);
const fill_color = vec3<f32>(0.10, 0.16, 0.30);

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let n = normalize(in.normal);
    let l = normalize(key_light - in.position);
    let v = normalize(camera.eye - in.position);
    let h = normalize(l + v);
    // Most of a turn of hues along the knot.
    let turn = 5.0 * in.hue;
    let albedo = vec3<f32>(0.42, 0.30, 0.34) + vec3<f32>(0.34, 0.22, 0.30) * cos(vec3<f32>(turn) + vec3<f32>(0.0, 4.4, 2.2));
    let diffuse = key_color * max(dot(n, l), 0.0) + fill_color * max(dot(n, fill_direction), 0.0) + vec3<f32>(0.02);
    let specular = key_color * (0.55 * pow(max(dot(n, h), 0.0), 64.0));
    let rim = vec3<f32>(0.10, 0.14, 0.22) * pow(1.0 - max(dot(n, v), 0.0), 3.0);
    return vec4<f32>(albedo * diffuse + specular + rim, 1.0);
}
