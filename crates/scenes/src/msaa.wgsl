// Instances 0 to 71 are spokes, thinner and thinner; the next 144 are segments of two rings.

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) @interpolate(flat) color: vec3<f32>,
}

const turn = 6.2831853;

fn place(radius: f32, angle: f32) -> vec4<f32> {
    return vec4<f32>(0.75 * radius * cos(angle), radius * sin(angle), 0.0, 1.0);
}

@vertex
fn vertex(@builtin(vertex_index) index: u32, @builtin(instance_index) instance: u32) -> Varying {
    // Corners 0 1 2 and 2 1 3 of a quadrilateral.
    let corner = (0x012213u >> (4u * (5u - index))) & 3u;
    let outer = corner & 1u;
    let left = corner >> 1u;
    if instance < 72u {
        let n = f32(instance);
        let angle = turn * (n + 0.25) / 72.0;
        // From 3 pixels down to a third of one.
        let half_width = 0.0062 * exp2(-n / 22.0);
        let radius = select(0.08, 0.80, outer == 1u);
        let side = select(-half_width, half_width, left == 1u);
        let across = vec2<f32>(-sin(angle), cos(angle)) * side;
        let at = place(radius, angle) + vec4<f32>(0.75 * across.x, across.y, 0.0, 0.0);
        let hue = vec3<f32>(0.10, 0.16, 0.30) + vec3<f32>(0.10, 0.03, 0.14) * cos(angle + vec3<f32>(0.0, 2.1, 4.2));
        return Varying(at, hue);
    }
    let segment = (instance - 72u) % 72u;
    let ring = (instance - 72u) / 72u;
    let angle = turn * (f32(segment) + f32(left)) / 72.0;
    let inner_radius = select(0.84, 0.055, ring == 1u);
    let outer_radius = select(0.90, 0.075, ring == 1u);
    let shade = select(vec3<f32>(0.55, 0.12, 0.07), vec3<f32>(0.12, 0.12, 0.14), ring == 1u || segment % 6u == 0u);
    return Varying(place(select(inner_radius, outer_radius, outer == 1u), angle), shade);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    return vec4<f32>(in.color, 1.0);
}
