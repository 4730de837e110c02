// A closed box whose top is a fractal height field: many small triangles in a layer, large slivers
// around them.

#include <cstddef>

#include "accel/base/parallel.h"
#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t n;
};

const rb_param kParams[] = {
    IntParam("n", "cells along one side: 2 n^2 + 12 n triangles: 66,960 at 180, 1,008,182 at 707",
             offsetof(Config, n), 1, 8000, 180, RB_PARAM_LOG),
};

uint64_t Count(const void* config) {
  const uint64_t n = uint64_t(static_cast<const Config*>(config)->n);
  return 2 * n * n + 12 * n;
}

Scene Generate(const void* config, const LoadOptions& options) {
  const uint32_t n = uint32_t(static_cast<const Config*>(config)->n), row = n + 1;
  const ValueNoise noise(options.seed);
  Mesh mesh;
  mesh.positions.resize(size_t{row} * row);
  ParallelFor(uint32_t{0}, row, [&](uint32_t z) {
    for (uint32_t x = 0; x < row; ++x) {
      Vec3d p{2.0 * x / n - 1, 0, 2.0 * z / n - 1};
      p.y = 0.2 * noise.Fractal({p.x * 1.7, 0.5, p.z * 1.7}, 8);
      mesh.positions[size_t{z} * row + x] = p;
    }
  });
  mesh.triangles.reserve(size_t{2} * n * n + 12 * n);
  for (uint32_t z = 0; z < n; ++z)
    for (uint32_t x = 0; x < n; ++x) {
      uint32_t a = z * row + x;
      mesh.AddQuad(a, a + row, a + row + 1, a + 1);
    }
  // The rim, counter-clockwise seen from above, and the same below it.
  std::vector<uint32_t> rim;
  for (uint32_t i = 0; i < n; ++i) rim.push_back(i * row);
  for (uint32_t i = 0; i < n; ++i) rim.push_back(n * row + i);
  for (uint32_t i = 0; i < n; ++i) rim.push_back((n - i) * row + n);
  for (uint32_t i = 0; i < n; ++i) rim.push_back(n - i);
  std::vector<uint32_t> foot;
  for (uint32_t top : rim) {
    Vec3d p = mesh.positions[top];
    foot.push_back(mesh.Add({p.x, -0.8, p.z}));
  }
  uint32_t center = mesh.Add({0, -0.8, 0});
  for (size_t i = 0; i < rim.size(); ++i) {
    size_t k = (i + 1) % rim.size();
    mesh.AddQuad(rim[i], foot[i], foot[k], rim[k]);
    mesh.triangles.push_back({center, foot[k], foot[i]});
  }

  Scene scene;
  scene.provenance.source = "terrain_box";
  Material rock;
  rock.name = "terrain";
  rock.diffuse = {0.5f, 0.55f, 0.4f};
  Append(scene, mesh, AddMaterial(scene, rock));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kTerrainBoxGenerator = {
    "terrain_box",
    "closed box with a fractal height field, chosen by the seed, as its top",
    "value noise (Perlin, An image synthesizer, 1985)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
