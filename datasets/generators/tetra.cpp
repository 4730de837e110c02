// A tetrahedron of tetrahedra, in four quarters again and again (Glassner 1984, Kay and Kajiya 1986).

#include "datasets/generators/spd.h"

namespace raybench {
namespace {

const rb_param kParams[] = {SpdSize("levels: 4^size triangles", 1, 13, 6)};

uint64_t Count(const void* config) { return uint64_t{1} << (2 * SpdSizeOf(config)); }

/// The corners of a cube that make a tetrahedron.
constexpr Vec3d kCorners[4] = {{-1, -1, 1}, {-1, 1, -1}, {1, -1, -1}, {1, 1, 1}};

/// `half`: of the side of the cube around the tetrahedron.
void Add(Scene& scene, Vec3d center, double half, int64_t levels, uint32_t material) {
  if (levels > 1) {
    for (Vec3d corner : kCorners) Add(scene, center + corner * (half / 2), half / 2, levels - 1, material);
    return;
  }
  uint32_t v[4];
  for (int i = 0; i < 4; ++i) v[i] = AddVertex(scene, center + kCorners[i] * half);
  for (auto [a, b, c] : {std::array{0, 1, 2}, {3, 2, 1}, {2, 3, 0}, {1, 0, 3}})
    AddTriangle(scene, {v[a], v[b], v[c]}, material);
}

Scene Generate(const void* config, const LoadOptions&) {
  Scene scene = SpdScene({1.022846, -3.177154, -2.174512}, {-0.004103, -0.004103, 0.216539},
                         {-0.816497, -0.816497, 0.816497}, 45, {{2, -18, -5}});
  scene.positions.reserve(Count(config));
  scene.triangles.reserve(Count(config));
  scene.triangle_material.reserve(Count(config));
  Add(scene, {0, 0, 0}, 1, SpdSizeOf(config), AddSurface(scene, {"tetrahedron", {1, 0.2, 0.2}}));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kTetraGenerator = SpdGenerator(
    "tetra", "SPD: a tetrahedron of tetrahedra; the seed changes nothing", kParams, Count, Generate);

}  // namespace raybench
