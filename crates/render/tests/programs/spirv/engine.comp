#version 450
layout(local_size_x = 8, local_size_y = 2) in;
layout(constant_id = 5) const uint ROUNDS = 3;
layout(set = 0, binding = 0, std430) buffer Data { uint total; int lowest; uint values[]; };
layout(set = 0, binding = 1, rgba8) uniform writeonly image2D picture;
layout(set = 0, binding = 2, r32ui) uniform uimage2D counts;
shared uint part[64];
shared uint most;
uint mixed(uint x) { x ^= x >> 16; x *= 0x7feb352du; x ^= x >> 15; return x; }
void main() {
    uint i = gl_LocalInvocationIndex, n = gl_WorkGroupSize.x * gl_WorkGroupSize.y;
    uint at = gl_WorkGroupID.x * n + i;
    if (i == 0u) most = 0u;
    uint x = values[at];
    for (uint r = 0u; r < ROUNDS; ++r) x = mixed(x + r);
    part[i] = x & 1023u;
    barrier();
    for (uint middle = n / 2u; middle > 0u; middle >>= 1) {
        if (i < middle) part[i] += part[i + middle];
        memoryBarrierShared(); barrier();
    }
    atomicMax(most, x & 255u);
    barrier();
    values[at] = part[0] * 1000u + most;
    if (i == 0u) { atomicAdd(total, part[0]); atomicMin(lowest, int(part[0]) - 5000); }
    uvec2 id = gl_GlobalInvocationID.xy;
    imageStore(picture, ivec2(id), unpackUnorm4x8(x));
    imageStore(counts, ivec2(id), uvec4(x % 7u));
    values[at] += uint(findMSB(x)) + uint(bitCount(x));
}
