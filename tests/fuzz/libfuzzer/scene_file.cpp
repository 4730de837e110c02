// A reader of scene files on bytes: RAYBENCH_FUZZED_FORMAT is the file's ending. It gives a sound scene, or one line.
#include <cmath>
#include <optional>

#include "accel/contract/valid_ray.h"
#include "accel/host/registry.h"
#include "datasets/scene/scene.h"
#include "tests/fuzz/libfuzzer/target.h"

namespace raybench::fuzz {
namespace {

/// Materials come with an OBJ file that uses some.
constexpr bool kIsMaterials = std::string_view(RAYBENCH_FUZZED_FORMAT) == "mtl";
constexpr char kUser[] =
    "mtllib input.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nusemtl a\nf 1 2 3\nusemtl b\nf 1 3 4\n";

void DemandSound(const Scene& scene) {
  for (const Vec3f& p : scene.positions)
    for (int k = 0; k < 3; ++k) Demand(std::fabs(p[k]) <= 0x1p30f, "a position out of range");
  for (const auto& t : scene.triangles)
    for (const uint32_t v : t) Demand(v < scene.positions.size(), "a triangle's index out of range");
  for (const Polygon& polygon : scene.polygons)
    for (const uint32_t v : scene.CornersOf(polygon))
      Demand(v < scene.positions.size(), "a polygon's index out of range");
  Demand(scene.triangle_material.size() == scene.triangles.size(), "triangles and their materials");
  for (uint32_t i = 0; i < scene.primitive_count(); ++i)
    Demand(scene.MaterialOf(i) < scene.materials.size(), "a material's index out of range");
  Demand(scene.normals.empty() || scene.normals.size() == scene.positions.size(), "number of normals");
  Demand(scene.uvs.empty() || scene.uvs.size() == scene.positions.size(), "number of texture coordinates");
  Demand(!scene.cameras.empty() && !scene.lights.empty() && !scene.materials.empty(),
         "camera, light, material");
  for (const Material& m : scene.materials)
    for (const int32_t texture : {m.base_color_texture, m.emission_texture})
      Demand(texture >= -1 && texture < int32_t(scene.textures.size()), "a texture's index out of range");
  for (const std::string& note : scene.stats.notes) DemandOneLine(note, "");
}

/// The tree takes it, and can be asked.
void DemandTraceable(const Scene& scene) {
  static const Registry registry;
  static const Contestant contestant = ParseContestant(registry, "bvh_sah");
  if (scene.primitive_count() == 0 || scene.primitive_count() > 20000) return;
  const rb_geometry geometry = scene.Geometry();
  const Tree tree(contestant, geometry, DefaultBuildOptions());
  const Camera& camera = scene.cameras.front();
  const Vec3f dir = camera.at - camera.eye;
  const rb_ray ray{{camera.eye.x, camera.eye.y, camera.eye.z}, 0, {dir.x, dir.y, dir.z}, 0x1p60f};
  if (!IsValidRay(ray)) Broken("the camera looks nowhere");
  rb_hit hit;
  rb_query query{};
  query.struct_size = sizeof query, query.kind = RB_CLOSEST, query.n = 1, query.rays = &ray,
  query.hits = &hit;
  tree.Query(query);
  Demand(hit.prim == RAYBENCH_NONE || hit.prim < scene.primitive_count(), "the primitive of a hit");
}

std::optional<Scene> Load(const std::filesystem::path& path, bool drop_bad) {
  try {
    LoadOptions options;
    options.drop_bad = drop_bad;
    return LoadScene(path.string(), options);
  } catch (const InputError& error) {
    const std::string where = kIsMaterials ? path.parent_path().string() : path.string();
    DemandOneLine(error.what(), where);
    Demand(!std::string_view(error.what()).starts_with(path.string() + ": cannot be read: "),
           fmt::format("an exception of a library came through: {}", error.what()));
    return std::nullopt;
  }
}

}  // namespace
}  // namespace raybench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace raybench::fuzz;
  auto path = Written("input." RAYBENCH_FUZZED_FORMAT, Bytes(data, size));
  if (kIsMaterials) path = Written("input.obj", kUser);
  const auto strict = Load(path, false), tolerant = Load(path, true);
  if (strict) DemandSound(*strict), DemandTraceable(*strict);
  if (tolerant) DemandSound(*tolerant);
  if (strict) Demand(tolerant && strict->hash() == tolerant->hash(), "--drop-bad changes a sound file");
  return 0;
}
