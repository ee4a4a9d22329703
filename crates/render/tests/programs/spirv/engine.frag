#version 450
#extension GL_EXT_samplerless_texture_functions : require
layout(set = 0, binding = 1) uniform texture2D albedo;
layout(set = 0, binding = 2) uniform sampler wrap;
struct Lamp { vec3 at; float reach; vec4 color; };
layout(set = 0, binding = 3, std430) readonly buffer Lamps { uint count; Lamp lamps[]; };
layout(location = 0) in vec4 tinted;
layout(location = 1) flat in uint number;
layout(location = 2) in vec2 uv;
layout(location = 0) out vec4 color;
layout(location = 1) out uvec4 ids;
vec3 shade(vec3 base, vec2 at) {
    vec3 sum = base * 0.1;
    for (uint i = 0u; i < count; ++i) {
        Lamp lamp = lamps[i];
        float d = distance(lamp.at.xy, at);
        if (d > lamp.reach) continue;
        if (lamp.color.a == 0.0) break;
        switch (int(i) % 3) {
            case 0: sum += base * lamp.color.rgb * (1.0 - d / lamp.reach); break;
            case 1: sum.r += 0.25;
            case 2: sum.g += 0.125; break;
        }
    }
    return sum;
}
void main() {
    vec4 texel = texture(sampler2D(albedo, wrap), uv * 2.0);
    if (texel.a < 0.5 && gl_FragCoord.x < 8.0) discard;
    vec3 c = shade(texel.rgb * tinted.rgb, gl_FragCoord.xy);
    if (gl_FragCoord.y < 3.0) c = textureLod(sampler2D(albedo, wrap), uv, 0.0).bgr;
    else if (gl_FragCoord.y < 5.0) c = texelFetch(albedo, ivec2(gl_FragCoord.xy) & 3, 0).rgb;
    color = vec4(c, gl_FrontFacing ? 1.0 : 0.5);
    ids = uvec4(number, uint(textureSize(albedo, 0).x), floatBitsToUint(dFdx(gl_FragCoord.x)) >> 23, bitfieldReverse(number));
}
