// What happens at a hit: its colour, and the rays that it sends on.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "accel/contract/raybench.h"
#include "datasets/scene/needs.h"
#include "datasets/scene/scene.h"
#include "tracer/self_intersection.h"
#include "tracer/texture_map.h"
#include "tracer/tracer.h"

namespace raybench {

struct Batch {
  std::vector<rb_ray> rays;
  std::vector<uint32_t> skip;  ///< one per ray with SelfIntersection::kSkip, else empty

  void Clear() {
    rays.clear();
    skip.clear();
  }
};

/// The batch a path's ray stands in. At depth 0 camera rays take the place of reflected ones.
enum RayKind : uint32_t { kReflection, kRefraction, kRayKinds };

struct Path {
  Vec3f weight;
  uint32_t sample;              ///< within its band
  uint32_t kind : 1, ray : 31;  ///< RayKind, and place in that batch
};

/// All paths of one depth.
struct Level {
  std::vector<Path> paths;
  std::array<Batch, kRayKinds> batches;

  void Clear() {
    paths.clear();
    for (Batch& batch : batches) batch.Clear();
  }
};

/// What a path gains if nothing stands between its hit and a light.
struct Lit {
  Vec3f color;
  uint32_t path;
};

/// What a chunk of hits sends on.
struct ShadeOutput {
  Level next;
  Batch shadow;
  std::vector<Lit> lit;  ///< one per shadow ray
  std::vector<uint8_t> occluded;
  std::vector<rb_hit> blockers;  ///< ShadowQuery::kClosest
  uint64_t blocked;
  std::array<uint64_t, kRayKinds> hits;

  void Clear() {
    next.Clear();
    shadow.Clear();
    lit.clear();
    blocked = 0;
    hits = {};
  }
};

class Shader {
 public:
  Shader(const Scene& scene, const TraceOptions& options);

  /// Whether some hits are passed, for their alpha is below the cutoff.
  bool has_holes() const { return has_holes_; }
  /// Whether shadow rays gather what they pass; otherwise they stop at the first blocker.
  bool gathers() const { return gathers_; }
  /// tnear of camera rays.
  float tnear() const { return tnear_; }

  /// Returns the weighted colour of a path's hit without lights; adds shadow rays and, unless the hit is at
  /// the `last` depth, the next paths to `out`.
  Vec3f Shade(const Path& path, uint32_t path_index, const rb_ray& ray, const rb_hit& hit, bool last,
              ShadeOutput& out) const;
  /// The colour of a ray that misses.
  Vec3f Background(const rb_ray& ray) const {
    return scene_.environment < 0 ? scene_.background : textures_.Environment(ToDouble(LoadVec3(ray.dir)));
  }
  /// Whether the hit is to be passed as if nothing were there.
  bool IsHole(const rb_hit& hit) const;
  /// What is left of light that comes through the hit, straight on; black: it is blocked.
  Vec3f Transmittance(const rb_hit& hit) const;

 private:
  struct Look {
    Vec3f diffuse, reflect, transmit, emission;
  };
  struct Turn;

  const Material& MaterialOf(const rb_hit& hit) const {
    const bool triangle = hit.prim < scene_.triangles.size();  // without a call
    return scene_.materials[triangle ? scene_.triangle_material[hit.prim] : scene_.MaterialOf(hit.prim)];
  }
  Look LookOf(const Material& material, const rb_hit& hit) const;
  void SendToLights(const Turn& turn, const Look& look, ShadeOutput& out) const;
  void SendOn(const Turn& turn, const Look& look, ShadeOutput& out) const;
  /// Next path, on the eye's side or the far one. By kSpd the direction alone decides about sides.
  void SendPath(RayKind kind, const Turn& turn, Vec3f weight, Vec3d dir, bool far_side,
                ShadeOutput& out) const;
  Departure Leave(const Turn& turn, double side) const;
  rb_ray RayFrom(const Departure& departure, Vec3f dir, float tfar) const;
  void AddTo(Batch& batch, const Departure& departure, const rb_ray& ray) const {
    batch.rays.push_back(ray);
    if (options_.self_intersection == SelfIntersection::kSkip) batch.skip.push_back(departure.skip);
  }

  const Scene& scene_;
  const TraceOptions& options_;
  const bool spd_;
  const SceneNeeds needs_;
  const bool has_holes_, gathers_;
  const TextureMaps textures_;
  const float tnear_;
  const double cure_size_;
};

}  // namespace raybench
