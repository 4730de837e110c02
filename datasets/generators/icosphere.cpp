// A closed sphere mesh with nothing special about any coordinate: the subject of edge- and vertex-aimed rays.

#include <cstddef>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t level;
};

const rb_param kParams[] = {
    IntParam("level", "20 * 4^level triangles: 81,920 at 6, 1,310,720 at 8", offsetof(Config, level), 0, 11,
             6),
};

uint64_t Count(const void* config) { return uint64_t{20} << (2 * static_cast<const Config*>(config)->level); }

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  Scene scene;
  scene.provenance.source = "icosphere";
  Mesh mesh = GeodesicSphere(1u << c.level);
  // A random rotation takes the vertices off the coordinate planes.
  Random random(options.seed);
  const Frame frame = RandomFrame(random);
  for (Vec3d& p : mesh.positions) p = frame * p;

  Material shiny;
  shiny.name = "sphere";
  shiny.diffuse = {0.6f, 0.65f, 0.75f};
  shiny.specular = {0.4f, 0.4f, 0.4f};
  Append(scene, mesh, AddMaterial(scene, shiny));
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kIcosphereGenerator = {
    "icosphere",
    "closed unit sphere of 20 * 4^level triangles, rotated off the axes by the seed",
    "geodesic sphere (Fuller)",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
