// A particle: place and velocity, in half screen heights.
struct Particle {
    place: vec2<f32>,
    velocity: vec2<f32>,
}

struct DrawArguments {
    vertices: u32,
    instances: atomic<u32>,
    first_vertex: u32,
    first_instance: u32,
}

@group(0) @binding(0) var<storage, read_write> particles: array<Particle>;
@group(0) @binding(1) var<storage, read_write> centers: array<vec2<f32>>;
@group(0) @binding(2) var<storage, read_write> arguments: DrawArguments;

var<immediate> frame: u32;

fn hash(seed: u32) -> u32 {
    var x = seed;
    x ^= x >> 16u;
    x *= 0x7feb352du;
    x ^= x >> 15u;
    x *= 0x846ca68bu;
    return x ^ (x >> 16u);
}

fn uniform01(seed: u32) -> f32 {
    return f32(hash(seed) >> 8u) / 16777216.0;
}

// Two spiral arms that turn.
@compute @workgroup_size(64)
fn scatter(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    let radius = 0.06 + 0.86 * sqrt(uniform01(i * 4u));
    let spread = (uniform01(i * 4u + 1u) + uniform01(i * 4u + 2u) - 1.0) * 0.9;
    let angle = 3.14159265 * f32(i & 1u) + 4.2 * radius + spread;
    let out = vec2<f32>(cos(angle), sin(angle));
    let place = out * radius;
    let speed = 0.9 / sqrt(radius + 0.05);
    particles[i] = Particle(place, vec2<f32>(-out.y, out.x) * speed);
}

var<workgroup> shared_place: array<vec2<f32>, 64>;

@compute @workgroup_size(64)
fn advance(
    @builtin(global_invocation_id) id: vec3<u32>,
    @builtin(local_invocation_index) local: u32,
    @builtin(workgroup_id) group: vec3<u32>,
) {
    // The centre of the workgroup's particles, by halves.
    shared_place[local] = particles[id.x].place;
    workgroupBarrier();
    for (var half = 32u; half > 0u; half /= 2u) {
        if local < half {
            shared_place[local] += shared_place[local + half];
        }
        workgroupBarrier();
    }
    let center = shared_place[0] / 64.0;
    if local == 0u {
        centers[group.x] = center;
    }

    // Towards the middle of the screen, and a little towards the group's centre; a later frame takes a longer step.
    var particle = particles[id.x];
    let step = 0.012 * f32(1u + (frame & 1u));
    let distance = dot(particle.place, particle.place) + 0.02;
    let pull = -particle.place / (distance * sqrt(distance)) * 0.35 + (center - particle.place) * 0.15;
    particle.velocity += pull * step;
    particle.place += particle.velocity * step;
    particles[id.x] = particle;
    atomicAdd(&arguments.instances, 1u);
}
