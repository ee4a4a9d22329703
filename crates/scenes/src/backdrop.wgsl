// A dusk sky on one triangle that covers the screen.

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) height: f32,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32) -> Varying {
    let at = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 4.0 - 1.0;
    return Varying(vec4<f32>(at, 0.0, 1.0), at.y * 0.5 + 0.5);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let low = mix(vec3<f32>(0.20, 0.12, 0.22), vec3<f32>(0.93, 0.55, 0.38), smoothstep(0.0, 0.45, in.height));
    return vec4<f32>(mix(low, vec3<f32>(0.16, 0.20, 0.42), smoothstep(0.35, 1.0, in.height)), 1.0);
}
