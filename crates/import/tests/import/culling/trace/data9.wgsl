
struct Object { sphere: vec4f, color: vec3f, mesh: u32 }
struct Camera { view_proj: mat4x4f, planes: array<vec4f, 6>, count: u32 }
struct Light { direction: vec3f, power: f32, tint: vec3f }
@group(0) @binding(0) var<uniform> camera: Camera;
@group(0) @binding(1) var<storage, read> objects: array<Object>;
@group(0) @binding(2) var<storage, read> visible: array<u32>;
var<immediate> light: Light;
@id(7) override ambient: f32 = 0.0;
struct V { @builtin(position) position: vec4f, @location(0) normal: vec3f, @location(1) @interpolate(flat) color: vec3f }
@vertex fn vs(@location(0) p: vec3f, @location(1) n: vec3f, @builtin(instance_index) instance: u32) -> V {
    let object = objects[visible[instance]];
    let turn = f32(visible[instance]) * 0.37;
    let c = cos(turn); let s = sin(turn);
    let r = mat3x3f(vec3f(c, 0.0, -s), vec3f(0.0, 1.0, 0.0), vec3f(s, 0.0, c));
    var v: V;
    v.position = camera.view_proj * vec4f(r * p * object.sphere.w * 0.577 + object.sphere.xyz, 1.0);
    v.normal = r * n;
    v.color = object.color;
    return v;
}
@fragment fn fs(v: V) -> @location(0) vec4f {
    let d = max(dot(normalize(v.normal), light.direction), 0.0) * light.power + ambient;
    return vec4f(v.color * light.tint * d, 1.0);
}
