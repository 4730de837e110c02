// A leafless tree by the rules of Aono and Kunii (1984) on a wide field: each branch, a cone with a sphere at
// its end, carries two.

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {
    SpdSize("generations above the trunk: 2^(size+1) - 1 each of cones and spheres on a square", 1, 24, 11)};

uint64_t Count(const void* config) { return (uint64_t{4} << SpdSizeOf(config)) - 1; }

struct Branch {
  Vec3d base;
  Frame frame;  ///< z along the branch
  double length, radius;
};

/// What a branch does to its parent's frame: leans around x, turns around z, becomes shorter.
struct Growth {
  double lean, turn;  ///< degrees
  double length;
};
constexpr Growth kGrowth[2] = {{40, 90, 0.65}, {25, 230, 0.7}};
constexpr double kTaper = 0.67;

Vec3d Grown(const Growth& growth, Vec3d v) {
  return Turn(Turn(v, kXAxis, Degrees(growth.lean)), kZAxis, Degrees(growth.turn));
}

class Tree {
 public:
  Tree(Scene& scene, uint32_t material) : scene_(scene), material_(material) {
    for (int i = 0; i < 2; ++i)
      child_[i] = {Grown(kGrowth[i], kXAxis), Grown(kGrowth[i], {0, 1, 0}), Grown(kGrowth[i], kZAxis)};
  }

  void Grow(const Branch& branch, int64_t generations) {
    const Vec3d apex = branch.base + branch.frame.z * branch.length;
    const double radius = branch.radius * kTaper;
    AddCone(scene_, branch.base, branch.radius, apex, radius, material_);
    AddSphere(scene_, apex, radius, material_);
    if (generations == 0) return;
    const Frame& f = branch.frame;
    for (int i = 0; i < 2; ++i)
      Grow({apex,
            {f * child_[i].x, f * child_[i].y, f * child_[i].z},
            branch.length * kGrowth[i].length,
            radius},
           generations - 1);
  }

 private:
  Scene& scene_;
  uint32_t material_;
  Frame child_[2];  ///< in the parent's
};

Scene Generate(const void* config, const LoadOptions&) {
  Scene scene = SpdScene({4.5, 0.4, 2}, {0, 0, 1.5}, kZAxis, 45,
                         {{-5, 5, 50},
                          {30, -30, 30},
                          {-40, -30, 20},
                          {10, 30, 40},
                          {-30, 40, 10},
                          {50, 25, 20},
                          {-10, -60, 30}});
  const size_t branches = Count(config) / 2;
  scene.spheres.reserve(branches);
  scene.sphere_material.reserve(branches);
  scene.cones.reserve(branches);
  scene.cone_material.reserve(branches);
  AddGround(scene, 50, 0, AddSurface(scene, {"field", {0.2, 0.7, 0.2}}));
  const uint32_t bark = AddSurface(scene, {"tree", {0.55, 0.4, 0.2}});
  Tree(scene, bark).Grow({{0, 0, 0}, {kXAxis, {0, 1, 0}, kZAxis}, 1, 0.15}, SpdSizeOf(config));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kTreeGenerator =
    SpdGenerator("tree", "SPD: a leafless tree of cones and spheres on a field; the seed changes nothing",
                 kParams, Count, Generate);

}  // namespace raybench
