// What all shaders share: the contract's structs as they lie in device memory, and which hit counts.
#extension GL_EXT_buffer_reference : require
#extension GL_EXT_buffer_reference_uvec2 : require
#extension GL_EXT_scalar_block_layout : require

layout(constant_id = 0) const bool kAnyHit = false;      // a query of the kind RB_ANY
layout(constant_id = 1) const bool kFiltered = false;    // every candidate is looked at: skip, after, ties
layout(constant_id = 2) const bool kProcedural = false;  // the scene has procedural primitives
layout(constant_id = 3) const bool kCountsCalls = false; // for tests: how often each kind of shader ran

const uint kNone = 0xFFFFFFFFu;
const float kMaxFloat = 3.402823466e38;
const float kMinNormal = 1.17549435e-38;

struct Ray {  // rb_ray
  vec3 org;
  float tnear;
  vec3 dir;
  float tfar;
};
struct Hit {  // rb_hit
  float t, u, v;
  uint prim;
};
struct Sphere {  // rb_sphere
  vec3 center;
  float radius;
};
struct Cone {  // rb_cone
  vec3 base;
  float base_radius;
  vec3 apex;
  float apex_radius;
};
struct Polygon {  // and the plane that stands for it, as accel/vulkan/scene.cpp works it out
  dvec3 normal, center;
  vec3 lo, hi;
  uint first, count;
};

layout(buffer_reference, scalar) readonly buffer Rays { Ray at[]; };
layout(buffer_reference, scalar) readonly buffer Numbers { uint at[]; };
layout(buffer_reference, scalar) readonly buffer Spheres { Sphere at[]; };
layout(buffer_reference, scalar) readonly buffer Cones { Cone at[]; };
layout(buffer_reference, scalar) readonly buffer Polygons { Polygon at[]; };
layout(buffer_reference, scalar) readonly buffer Positions { vec3 at[]; };
layout(buffer_reference, scalar) writeonly buffer Hits { Hit at[]; };
layout(buffer_reference, scalar) writeonly buffer Occluded { uint at[]; };
layout(buffer_reference, scalar) buffer Calls { uint at[]; };
layout(buffer_reference, scalar) readonly buffer SceneData {  // SceneData of scene.h
  Spheres spheres;
  Cones cones;
  Polygons polygons;
  Numbers corners;
  Positions positions;
  Numbers first_prims;  // of each instance
  uint triangle_count, sphere_count, cone_count;
};

// A ray with what it skips and behind which hit it resumes.
struct RayQuery {
  Ray ray;
  uint skip, after;
};

// RayQuery::Accepts of accel/contract/structure.h without the order: a pure function of the candidate, so it does not
// matter in which order candidates come, nor whether one comes twice.
bool Counts(RayQuery q, float t, uint prim) {
  return (t > q.ray.tnear || (t == q.ray.tnear && q.after != kNone && prim > q.after)) && prim != q.skip &&
         t <= q.ray.tfar && t <= kMaxFloat;
}
bool ComesBefore(float t, uint prim, Hit best) { return t < best.t || (t == best.t && prim < best.prim); }

float NextAbove(float x) { return min(uintBitsToFloat(floatBitsToUint(x) + 1), kMaxFloat); }  // x >= 0

// The interval that the driver is given. Whether it counts hits at its ends is not relied on (lavapipe does not). Where
// candidates are looked at it is wider by 2^-20 at either end. Else the ends are such that a hit at tfar is found if the
// driver counts none at its ends; if it does, and so comes upon one outside of (tnear, tfar], the ray is traced
// again with the ends `inside`.
void IntervalOf(RayQuery q, bool inside, out float tmin, out float tmax) {
  const float tfar = min(q.ray.tfar, kMaxFloat);
  if (kFiltered) {
    tmin = q.ray.tnear * (1 - 9.5367431640625e-7);
    tmax = min(tfar * (1 + 9.5367431640625e-7), kMaxFloat);
  } else {
    tmin = inside ? max(NextAbove(q.ray.tnear), kMinNormal) : q.ray.tnear;
    tmax = inside ? tfar : NextAbove(tfar);
  }
}
bool IsEmpty(RayQuery q) { return !(q.ray.tnear <= q.ray.tfar); }
