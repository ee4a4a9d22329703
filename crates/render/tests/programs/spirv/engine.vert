#version 450
// A vertex stage as translators of HLSL and GLSL leave it: a block of built-ins, std140, push constants.
layout(set = 0, binding = 0, std140) uniform Scene { mat4 transform; mat3 turn; vec3 offsets[4]; float scale; } scene;
layout(push_constant) uniform Push { layout(offset = 0) uint first; layout(offset = 16) vec4 tint; } push;
layout(location = 0) in vec2 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 tinted;
layout(location = 1) flat out uint number;
layout(location = 2) out vec2 uv;
void displace(inout vec3 p, in uint i, out float w) { p = scene.turn * p * scene.scale + scene.offsets[(i + push.first) & 3u]; w = 1.0; }
void main() {
    vec3 p = vec3(position, 0.25);
    float w;
    displace(p, gl_InstanceIndex, w);
    gl_Position = scene.transform * vec4(p, w);
    gl_PointSize = 1.0;
    tinted = color * push.tint;
    number = gl_InstanceIndex * 100u + gl_VertexIndex;
    uv = position * 0.5 + 0.5;
}
