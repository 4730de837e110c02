// What the shaders of a query are given, and the ray that one of them is called for.
layout(push_constant, scalar) uniform Push {  // Push of queries.h
  uvec2 tlas;
  SceneData scene;
  Rays rays;
  Numbers skip, after;  // null: none
  uvec2 answers;        // Hits or Occluded
  Calls calls;
  uint count;
  bool has_skip, has_after;
} push;

// Kinds of shaders, in the order of Calls.
const uint kRayGeneration = 0, kIntersection = 1, kAny = 2, kClosest = 3, kMiss = 4;
void CountCall(uint kind) {
  if (kCountsCalls) atomicAdd(push.calls.at[kind], 1);
}

RayQuery QueryOf(uint i) {
  RayQuery q;
  q.ray = push.rays.at[i];
  q.skip = kNone, q.after = kNone;
  if (kFiltered && push.has_skip) q.skip = push.skip.at[i];
  if (kFiltered && push.has_after) q.after = push.after.at[i];
  return q;
}
uint PrimOf(uint instance, uint index) { return push.scene.first_prims.at[instance] + index; }
