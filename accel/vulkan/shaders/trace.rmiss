// Path `pipeline`: miss.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "query.glsl"
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;

void main() {
  CountCall(kMiss);
  if (!payload.collects) payload.hit.prim = kNone;
}
