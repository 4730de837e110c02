// Path `pipeline`: closest hit, of triangles and procedural primitives.
#version 460
#extension GL_EXT_ray_tracing : require
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "query.glsl"
#include "payload.glsl"

layout(location = 0) rayPayloadInEXT Payload payload;
hitAttributeEXT vec2 barycentrics;

void main() {
  CountCall(kClosest);
  const vec2 uv = AttributesOf(gl_HitKindEXT, barycentrics);
  payload.hit = Hit(gl_HitTEXT, uv.x, uv.y, PrimOf(gl_InstanceCustomIndexEXT, gl_PrimitiveID));
}
