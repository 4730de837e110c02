// Path `query`: inline ray queries in a compute shader.
#version 460
#extension GL_EXT_ray_query : require
#extension GL_GOOGLE_include_directive : require
#include "common.glsl"
#include "query.glsl"
#include "procedural.glsl"

layout(local_size_x = 64) in;

// Looks along the ray in [tmin, tmax]. With `collects` nothing is committed, so nothing is culled, and `best` becomes
// the first of all candidates in (t, prim) order; else it becomes what the driver has found.
void Look(RayQuery q, uint flags, float tmin, float tmax, bool collects, inout Hit best) {
  rayQueryEXT look;
  rayQueryInitializeEXT(look, accelerationStructureEXT(push.tlas), flags, 0xFF, q.ray.org, tmin, q.ray.dir, tmax);
  while (rayQueryProceedEXT(look)) {
    const uint prim = PrimOf(rayQueryGetIntersectionInstanceCustomIndexEXT(look, false),
                             rayQueryGetIntersectionPrimitiveIndexEXT(look, false));
    if (rayQueryGetIntersectionTypeEXT(look, false) == gl_RayQueryCandidateIntersectionTriangleEXT) {
      const float t = rayQueryGetIntersectionTEXT(look, false);
      if (!Counts(q, t, prim)) continue;
      if (!collects) {
        rayQueryConfirmIntersectionEXT(look);
      } else if (ComesBefore(t, prim, best)) {
        const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(look, false);
        best = Hit(t, uv.x, uv.y, prim);
      }
    } else if (kProcedural) {
      float t;
      if (!HitProcedural(prim, q, t) || t > tmax) continue;
      if (collects) {
        if (ComesBefore(t, prim, best)) best = Hit(t, 0, 0, prim);
        continue;
      }
      const bool is_first = rayQueryGetIntersectionTypeEXT(look, true) == gl_RayQueryCommittedIntersectionNoneEXT ||
                            t < rayQueryGetIntersectionTEXT(look, true);
      if (is_first) rayQueryGenerateIntersectionEXT(look, t);
    }
    if (kAnyHit && rayQueryGetIntersectionTypeEXT(look, true) != gl_RayQueryCommittedIntersectionNoneEXT)
      rayQueryTerminateEXT(look);
  }
  const uint type = rayQueryGetIntersectionTypeEXT(look, true);
  if (collects || type == gl_RayQueryCommittedIntersectionNoneEXT) return;
  best.t = rayQueryGetIntersectionTEXT(look, true);
  best.prim = PrimOf(rayQueryGetIntersectionInstanceCustomIndexEXT(look, true),
                     rayQueryGetIntersectionPrimitiveIndexEXT(look, true));
  best.u = 0, best.v = 0;
  if (type == gl_RayQueryCommittedIntersectionTriangleEXT) {
    const vec2 uv = rayQueryGetIntersectionBarycentricsEXT(look, true);
    best.u = uv.x, best.v = uv.y;
  }
}

void main() {
  const uint i = gl_GlobalInvocationID.x;
  if (i >= push.count) return;
  CountCall(kRayGeneration);
  const RayQuery q = QueryOf(i);
  Hit best = Hit(q.ray.tfar, 0, 0, kNone);
  if (!IsEmpty(q)) {
    float tmin, tmax;
    IntervalOf(q, false, tmin, tmax);
    const uint flags = kFiltered ? gl_RayFlagsNoOpaqueEXT : gl_RayFlagsOpaqueEXT,
               first = kAnyHit ? flags | gl_RayFlagsTerminateOnFirstHitEXT : flags;
    Look(q, first, tmin, tmax, false, best);
    if (!kFiltered && best.prim != kNone && !Counts(q, best.t, best.prim)) {
      best = Hit(q.ray.tfar, 0, 0, kNone);
      IntervalOf(q, true, tmin, tmax);
      if (tmin <= tmax) Look(q, first, tmin, tmax, false, best);
    }
    // Of hits at the same t the lowest id wins: another look, at what is there.
    if (kFiltered && !kAnyHit && best.prim != kNone) {
      const float t = best.t;
      Look(q, flags, t * (1 - 9.5367431640625e-7), min(t * (1 + 9.5367431640625e-7), kMaxFloat), true, best);
    }
  }
  if (kAnyHit) {
    Occluded(push.answers).at[i] = best.prim != kNone ? 1 : 0;
  } else {
    Hits(push.answers).at[i] = best;
  }
}
