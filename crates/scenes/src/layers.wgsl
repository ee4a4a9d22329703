// One instance is one layer of one cell: column, row, layer (0 is nearest), tint.

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) layer: u32,
    @location(2) @interpolate(flat) tint: f32,
    @location(3) @interpolate(flat) cell: vec2<f32>,
}

const columns = 40.0;
const rows = 30.0;

@vertex
fn vertex(@builtin(vertex_index) index: u32, @location(0) instance: vec4<u32>) -> Varying {
    // Two triangles: corners 0 2 1 and 1 2 3.
    let corner = (0x021123u >> (4u * (5u - index))) & 3u;
    let at = vec2<f32>(f32(corner & 1u), f32(corner >> 1u));
    let cell = vec2<f32>(instance.xy);
    let screen = (cell + at) / vec2<f32>(columns, rows);
    let depth = (f32(instance.z) + 0.5) / 10.0;
    let position = vec4<f32>(screen.x * 2.0 - 1.0, 1.0 - screen.y * 2.0, depth, 1.0);
    return Varying(position, at * 2.0 - 1.0, instance.z, f32(instance.w) / 255.0, cell);
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    // The nearest layers together show rings around the centre, with a bevel to each cell; a layer that shows through by
    // mistake stands out in another colour.
    let from_centre = (in.cell + 0.5 - vec2<f32>(columns, rows) * 0.5) / rows;
    let turn = 14.0 * length(from_centre) + 1.6 * in.tint + f32(in.layer) * 2.1;
    let hue = vec3<f32>(0.40, 0.36, 0.42) + vec3<f32>(0.36, 0.30, 0.34) * cos(vec3<f32>(turn) + vec3<f32>(0.0, 1.9, 3.7));
    let rim = max(abs(in.at.x), abs(in.at.y));
    let bevel = 1.0 - 0.55 * smoothstep(0.72, 1.0, rim) + 0.12 * (in.at.y + in.at.x) * -0.5;
    return vec4<f32>(hue * bevel, 1.0);
}
