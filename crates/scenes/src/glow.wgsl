struct Particle {
    place: vec2<f32>,
    velocity: vec2<f32>,
}

@group(0) @binding(0) var<storage, read> particles: array<Particle>;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) color: vec3<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    let particle = particles[instance];
    let at = vec2<f32>(f32(index & 1u), f32(index >> 1u)) * 2.0 - 1.0;
    let size = 0.010 + 0.012 * f32(instance % 13u == 0u);
    // The picture is a disc seen at a slant.
    let place = particle.place * vec2<f32>(1.15, 0.62) + at * size;
    let radius = length(particle.place);
    let warm = mix(vec3<f32>(1.0, 0.74, 0.42), vec3<f32>(0.32, 0.46, 1.0), smoothstep(0.1, 0.75, radius));
    let bright = 0.35 + 0.65 * f32(instance % 7u == 0u);
    return Varying(vec4<f32>(place.x * 0.75, place.y, 0.0, 1.0), at, warm * bright);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    let falloff = max(1.0 - dot(in.at, in.at), 0.0);
    return vec4<f32>(in.color * (falloff * falloff), 1.0);
}
