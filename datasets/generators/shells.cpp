// Closed shells inside one another. The boxes of the inner shells lie wholly within those of the outer ones,
// so no split of space parts them, and a ray that goes through the glass meets every shell twice: what a
// first hit saves elsewhere is lost here. The kernel of the matter in CAD assemblies and in the layers of
// anatomical models. Each shell is cut finely enough to stay clear of its neighbours, and turned at random,
// so that nothing lines up.

#include <fmt/format.h>

#include <cstddef>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t size, count;
};

const rb_param kParams[] = {
    IntParam("size",
             "triangles, about; never fewer than keep the shells apart (140 for 4 shells, 16,780 for 64)",
             offsetof(Config, size), 20, 1e9, 100000, RB_PARAM_LOG),
    IntParam("count", "shells; their radii are 1/count, 2/count, ... 1", offsetof(Config, count), 1, 256, 4,
             RB_PARAM_LOG),
};

/// How finely each shell is cut, from the innermost: 20 n^2 triangles. As alike as the size allows.
std::vector<uint64_t> Steps(const Config& c) {
  const double wanted = double(c.size) / 20;
  const uint64_t even = uint64_t(std::sqrt(wanted / double(c.count)));
  std::vector<uint64_t> steps(size_t(c.count), std::max<uint64_t>(even, 1));
  // A geodesic sphere of n steps dips to 1 - 0.3 / n^2 at most; the next shell is at (i - 1) / i.
  double total = 0;
  for (size_t i = 0; i < steps.size(); ++i) {
    while (double(steps[i] * steps[i]) < 0.3 * double(i + 1)) ++steps[i];
    total += double(steps[i] * steps[i]);
  }
  for (size_t i = steps.size(); i-- > 0;) {
    const double more = double(2 * steps[i] + 1);
    if (total + more / 2 <= wanted) {
      ++steps[i];
      total += more;
    }
  }
  return steps;
}

uint64_t Count(const void* config) {
  uint64_t count = 0;
  for (uint64_t n : Steps(*static_cast<const Config*>(config))) count += 20 * n * n;
  return count;
}

Scene Generate(const void* config, const LoadOptions& options) {
  const std::vector<uint64_t> steps = Steps(*static_cast<const Config*>(config));
  const uint64_t count = Count(config);
  Scene scene;
  scene.provenance.source = "shells";
  scene.positions.reserve(count / 2 + 2 * steps.size());
  scene.triangles.reserve(count);
  scene.triangle_material.reserve(count);
  Mesh sphere, turned;
  for (size_t i = 0; i < steps.size(); ++i) {
    if (i == 0 || steps[i] != steps[i - 1]) sphere = turned = GeodesicSphere(uint32_t(steps[i]));
    Random random(options.seed, i);
    const Frame frame = RandomFrame(random);
    const double radius = double(i + 1) / double(steps.size());
    ForEachItem(sphere.positions.size(), {}, 0,
                [&](size_t k) { turned.positions[k] = (frame * sphere.positions[k]) * radius; });
    Material material;
    material.name = fmt::format("shell {}", i + 1);
    const Vec3f tints[] = {
        {0.8f, 0.35f, 0.25f}, {0.85f, 0.7f, 0.3f}, {0.35f, 0.65f, 0.45f}, {0.3f, 0.5f, 0.8f}};
    const Vec3f tint = tints[i % 4];
    material.specular = {0.5f, 0.5f, 0.5f};
    material.shininess = 60;
    if (i == 0) {
      material.diffuse = tint * 0.5f;
      material.emission = tint * 0.8f;  // the shells around it keep light away
    } else {                            // thin glass: what is behind it does not shift much
      material.diffuse = tint * 0.2f;
      material.emission = tint * 0.12f;
      material.transmit = Vec3f{0.5f, 0.5f, 0.5f} + tint * 0.35f;
      material.reflect = {0.08f, 0.08f, 0.08f};
      material.ior = 1.03f;
    }
    Append(scene, turned, AddMaterial(scene, material));
    if (options.progress) options.progress(0.7 * double(i + 1) / double(steps.size()));
  }
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kShellsGenerator = {"shells",
                                    "closed concentric spheres of glass, each turned at random by the seed",
                                    "geodesic spheres (Fuller)",
                                    kParams,
                                    std::size(kParams),
                                    sizeof(Config),
                                    Count,
                                    Generate};

}  // namespace raybench
