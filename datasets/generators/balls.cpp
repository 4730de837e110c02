// The sphereflake: each sphere carries nine of a third of its radius, six around its equator and three
// above them.

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {
    SpdSize("generations below the first sphere: (9^(size+1) - 1) / 8 spheres on a square", 1, 9, 4)};

uint64_t Count(const void* config) {
  uint64_t spheres = 1;
  for (int64_t i = SpdSizeOf(config); i > 0; --i) spheres = 9 * spheres + 1;
  return spheres + 1;
}

class Balls {
 public:
  Balls(Scene& scene, uint32_t material) : scene_(scene), material_(material) {
    // Three neighbours in a closest packing of spheres, turned so that the upper faces z; then the three
    // again, by thirds around z.
    const double d = 1 / std::sqrt(2.0);
    const Vec3d trio[3] = {{d, d, 0}, {d, 0, -d}, {0, d, -d}};
    for (int third = 0; third < 3; ++third)
      for (int k = 0; k < 3; ++k)
        around_[3 * third + k] = Turn(Turn(trio[k], {d, -d, 0}, {std::sqrt(2.0 / 3), std::sqrt(1.0 / 3)}),
                                      kZAxis, Degrees(120 * third));
  }

  /// `outward`: unit vector away from the parent; `path`: 1, then a digit for each step from the
  /// first sphere.
  void Add(Vec3d center, double radius, Vec3d outward, int64_t generations, uint64_t path = 1) {
    AddSphere(scene_, center, radius, material_);
    if (generations == 0) return;
    // The shortest way from z to `outward`; around y where there is none.
    const Vec3d side = Cross(kZAxis, outward);
    const double length = Length(side);
    const bool along_z = length < 1e-9;
    const Angle angle = along_z ? Angle{0, outward.z > 0 ? 1.0 : -1.0} : Angle{length, outward.z};
    Vec3d axis = along_z ? Vec3d{0, 1, 0} : side * (1 / length);
    // Here rounding left the programs an axis of no length, and their formula reflected what it should have
    // turned. So it stands in their files.
    if (path == 155) axis = {0, 0, 0};
    for (uint64_t k = 0; k < 9; ++k) {
      const Vec3d away = Turn(around_[k], axis, angle);
      Add(center + away * (radius * 4 / 3), radius / 3, away, generations - 1, 10 * path + k);
    }
  }

 private:
  Scene& scene_;
  uint32_t material_;
  Vec3d around_[9];
};

Scene Generate(const void* config, const LoadOptions&) {
  Scene scene = SpdScene({2.1, 1.3, 1.7}, {0, 0, 0}, kZAxis, 45, {{4, 3, 2}, {1, -4, 4}, {-3, 1, 5}});
  scene.spheres.reserve(Count(config) - 1);
  scene.sphere_material.reserve(Count(config) - 1);
  AddGround(scene, 12, -0.5, AddSurface(scene, {"ground", {1, 0.75, 0.33}, 0.8, 0, 0, 0, 1}));
  const uint32_t mirror = AddSurface(scene, {"balls", {1, 0.9, 0.7}, 0.5, 0.5, 37, 0, 1});
  Balls(scene, mirror).Add({0, 0, 0}, 0.5, kZAxis, SpdSizeOf(config));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kBallsGenerator =
    SpdGenerator("balls", "SPD: the sphereflake, mirroring spheres on a square; the seed changes nothing",
                 kParams, Count, Generate);

}  // namespace raybench
