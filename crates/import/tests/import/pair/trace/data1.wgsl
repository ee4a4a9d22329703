struct Object { place: vec4f, turn: vec4f }
@group(0) @binding(0) var<uniform> object: Object;
@group(0) @binding(1) var image: texture_2d<f32>;
@group(0) @binding(2) var bilinear: sampler;

struct Corner { @builtin(position) position: vec4f, @location(0) uv: vec2f, @location(1) normal: vec3f }

fn turned(own: vec3f) -> vec3f {
    let a = vec3f(own.x * object.turn.x - own.z * object.turn.y, own.y, own.x * object.turn.y + own.z * object.turn.x);
    return vec3f(a.x, a.y * object.turn.z - a.z * object.turn.w, a.y * object.turn.w + a.z * object.turn.z);
}

@vertex fn corner(@location(0) position: vec3f, @location(1) normal: vec3f, @location(2) uv: vec2f) -> Corner {
    let seen = turned(position) + object.place.xyz;
    let clip = vec4f(seen.x * 0.75, seen.y, (seen.z - 0.5) * 1.1, seen.z);
    return Corner(clip, uv, turned(normal));
}

@fragment fn shade(in: Corner) -> @location(0) vec4f {
    let light = 0.25 + 0.75 * max(dot(normalize(in.normal), vec3f(-0.48, 0.6, -0.64)), 0.0);
    return vec4f(textureSample(image, bilinear, in.uv).rgb * light, 1.0);
}
