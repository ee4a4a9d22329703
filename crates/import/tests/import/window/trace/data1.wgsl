
struct Frame { turn: f32, aspect: f32, count: u32 }
@group(0) @binding(0) var<uniform> frame: Frame;
struct V { @builtin(position) p: vec4f, @location(0) c: vec3f }
@vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> V {
    let a = frame.turn + f32(v % 3u) * 2.0943951 + f32(i) * 0.4;
    let p = vec2f(cos(a), sin(a)) * (0.9 - 0.2 * f32(i));
    return V(vec4f(p.x / frame.aspect, p.y, f32(i) / f32(frame.count), 1.0), vec3f(f32(v % 3u == 0u), f32(v % 3u == 1u), f32(v % 3u == 2u)) * (1.0 - 0.2 * f32(i)));
}
@fragment fn fs(v: V) -> @location(0) vec4f { return vec4f(v.c, 1.0); }