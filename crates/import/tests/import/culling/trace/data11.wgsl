
@vertex fn vs(@builtin(vertex_index) i: u32, @builtin(instance_index) instance: u32) -> @builtin(position) vec4f {
    let row = f32(instance / 100u); let n = f32(instance % 100u);
    let corner = vec2f(f32(i & 1u), f32(i >> 1u));
    let p = vec2f(4.0 + n * 8.0, 4.0 + row * 10.0) + corner * vec2f(6.0, 6.0);
    return vec4f(p.x / 160.0 - 1.0, 1.0 - p.y / 120.0, 0.0, 1.0);
}
@fragment fn fs() -> @location(0) vec4f { return vec4f(1.0, 0.8, 0.1, 0.75); }
