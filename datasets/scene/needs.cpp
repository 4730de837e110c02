#include "datasets/scene/needs.h"

#include <fmt/format.h>

#include <algorithm>
#include <functional>
#include <set>

#include "accel/base/parallel.h"

namespace raybench {
namespace {

/// Shading normals that lie this close to the geometric one (the sine of the angle between them) are taken
/// for it: six digits, as text files have them, cannot tell them apart.
constexpr double kSameNormal = 0x1p-20;

bool IsSameNormal(Vec3f shading, Vec3d geometric) {
  const Vec3d n = ToDouble(shading), across = Cross(n, geometric);
  if (n == Vec3d{0, 0, 0}) return true;  // 0 says that there is none
  return Dot(n, geometric) > 0 &&
         Dot(across, across) <= kSameNormal * kSameNormal * Dot(n, n) * Dot(geometric, geometric);
}

/// Whether some corner of a triangle or polygon has a shading normal of its own.
bool HasSmoothNormals(const Scene& scene) {
  if (scene.normals.empty()) return false;
  const auto any = [](size_t n, const auto& is_smooth) {
    return ParallelReduce(
        Range<size_t>(0, n, 1 << 14), false,
        [&](const Range<size_t>& range, bool found) {
          for (size_t i = range.begin(); i < range.end() && !found; ++i) found = is_smooth(i);
          return found;
        },
        std::logical_or<>());
  };
  const auto differs = [&](const auto& corners, Vec3d geometric) {
    return std::any_of(corners.begin(), corners.end(),
                       [&](uint32_t v) { return !IsSameNormal(scene.normals[v], geometric); });
  };
  return any(scene.triangles.size(),
             [&](size_t i) {
               return differs(scene.triangles[i], scene.GeometricNormal(uint32_t(i), Vec3d{0, 0, 0}));
             }) ||
         any(scene.polygons.size(), [&](size_t i) {
           return differs(scene.CornersOf(scene.polygons[i]), scene.PlaneOfPolygon(uint32_t(i)).normal);
         });
}

/// The materials that primitives use.
class UsedMaterials {
 public:
  explicit UsedMaterials(const Scene& scene)
      : scene_(scene), used_(scene.materials.size()), by_triangle_(scene.materials.size()) {
    for (uint32_t m : scene.triangle_material) by_triangle_[m] = used_[m] = 1;
    for (const auto* more : {&scene.sphere_material, &scene.cone_material, &scene.polygon_material})
      for (uint32_t m : *more) used_[m] = 1;
  }

  template <class Is>
  std::vector<uint32_t> Those(const Is& is) const {
    std::vector<uint32_t> those;
    for (uint32_t i = 0; i < used_.size(); ++i)
      if (used_[i] != 0 && is(scene_.materials[i], i)) those.push_back(i);
    return those;
  }
  template <class Is>
  size_t Count(const Is& is) const {
    return Those(is).size();
  }
  size_t Count() const { return size_t(std::count(used_.begin(), used_.end(), 1)); }

  /// Whether coordinates to look up a texture at are there: triangles alone have them.
  bool HasCoordinates(size_t material) const { return by_triangle_[material] != 0 && !scene_.uvs.empty(); }

  /// Those whose textures are read.
  std::vector<uint32_t> Textured() const {
    return Those([&](const Material& m, size_t i) {
      return (m.base_color_texture >= 0 || m.emission_texture >= 0) && HasCoordinates(i);
    });
  }

  /// "no material in use transmits", "1 of 5 materials in use transmits"; `do_` and `does` are the verb.
  std::string Text(size_t count, const char* does, const char* do_) const {
    if (count == 0) return fmt::format("no material in use {}", does);
    return fmt::format("{} of {} materials in use {}", count, Count(), count == 1 ? does : do_);
  }

 private:
  const Scene& scene_;
  std::vector<uint8_t> used_, by_triangle_;
};

bool Transmits(const Material& m) { return !IsBlack(m.transmit); }
/// With an index of 1 nothing is bent, and nothing reflected totally.
bool Bends(const Material& m) { return Transmits(m) && !m.thin && (m.ior != 1 || !IsBlack(m.dispersion)); }

}  // namespace

SceneNeeds NeedsOf(const Scene& scene) {
  const UsedMaterials materials(scene);
  const size_t scattering =
      materials.Count([](const Material& m, size_t) { return !IsBlack(m.diffuse) || !IsBlack(m.specular); });
  const size_t mirrors = materials.Count([](const Material& m, size_t) {
    return !IsBlack(m.reflect) || Bends(m) || (Transmits(m) && m.fresnel);
  });
  const size_t transmitting = materials.Count([](const Material& m, size_t) { return Transmits(m); });
  SceneNeeds needs;
  needs.textured = materials.Textured();
  const size_t textured = needs.textured.size();
  const size_t cut_out = materials.Count([&](const Material& m, size_t i) {
    return m.alpha_mode == AlphaMode::kMask &&
           (m.alpha < m.alpha_cutoff ||
            (m.alpha_cutoff > 0 && m.base_color_texture >= 0 && materials.HasCoordinates(i)));
  });
  const size_t dispersing =
      materials.Count([](const Material& m, size_t) { return Bends(m) && !IsBlack(m.dispersion); });
  const auto lights = size_t(std::count_if(scene.lights.begin(), scene.lights.end(),
                                           [](const Light& l) { return !IsBlack(l.intensity); }));

  const auto add = [&](const char* name, bool& need, bool is_needed, const std::string& why) {
    need = is_needed;
    needs.list.push_back({name, is_needed, why});
  };
  add("shadow_rays", needs.shadow_rays, lights > 0 && scattering > 0,
      lights == 0       ? "no light shines"
      : scattering == 0 ? materials.Text(0, "scatters light", "")
                        : fmt::format("{} light{}; {}", lights, lights == 1 ? "" : "s",
                                      materials.Text(scattering, "scatters light", "scatter light")));
  add("reflection_rays", needs.reflection_rays, mirrors > 0,
      transmitting == 0
          ? materials.Text(mirrors, "reflects", "reflect")
          : materials.Text(mirrors, "reflects or may reflect totally", "reflect or may reflect totally"));
  add("refraction_rays", needs.refraction_rays, transmitting > 0,
      materials.Text(transmitting, "transmits", "transmit"));
  add("transmittance", needs.transmittance, needs.shadow_rays && transmitting + cut_out > 0,
      !needs.shadow_rays           ? "there are no shadow rays"
      : transmitting + cut_out > 0 ? "shadow rays go on through what transmits or is cut out"
                                   : "what blocks light blocks all of it: shadow rays stop at the first hit");
  add("uv", needs.uv, !scene.triangles.empty(),
      scene.triangles.empty() ? "no primitive is a triangle" : "hit points on triangles come from them");
  add("textures", needs.textures, textured > 0,
      textured == 0 && scene.uvs.empty() ? "there are no texture coordinates"
                                         : materials.Text(textured, "reads a texture", "read a texture"));
  const bool smooth = HasSmoothNormals(scene);
  add("smooth_normals", needs.smooth_normals, smooth,
      scene.normals.empty() ? "there are no shading normals"
      : smooth              ? "some shading normals are not the geometric ones"
                            : "all shading normals are the geometric ones");
  add("alpha", needs.alpha, cut_out > 0,
      materials.Text(cut_out, "is cut out by its alpha", "are cut out by their alpha"));
  add("dispersion", needs.dispersion, dispersing > 0,
      materials.Text(dispersing, "refracts channels apart", "refract channels apart"));
  add("environment", needs.environment, scene.environment >= 0,
      scene.environment >= 0 ? "rays that miss look up a map" : "the background has one colour");
  return needs;
}

SceneNeeds AllNeedsOf(const Scene& scene) {
  SceneNeeds needs;
  needs.shadow_rays = needs.reflection_rays = needs.refraction_rays = needs.transmittance = needs.uv = true;
  needs.alpha = needs.dispersion = true;
  needs.textures = !scene.uvs.empty();
  needs.smooth_normals = !scene.normals.empty();
  needs.environment = scene.environment >= 0;
  const UsedMaterials materials(scene);
  needs.textured = materials.Textured();
  return needs;
}

uint64_t SceneNeeds::BuildNeeds() const {
  uint64_t needs = 0;
  if (uv) needs |= RB_NEED_UV;
  if (shadow_rays && !transmittance) needs |= RB_NEED_ANY;
  if (transmittance || alpha) needs |= RB_NEED_AFTER;
  return needs;
}

void DropUnread(Scene& scene) {
  const SceneNeeds needs = NeedsOf(scene);
  const auto drop = [&](auto& items) {
    scene.stats.saved_bytes += items.size() * sizeof items[0];
    items = {};
  };
  if (!needs.smooth_normals) drop(scene.normals);
  if (needs.textures) return;
  drop(scene.uvs);
  // Without coordinates no material reads one; the environment may.
  for (Material& m : scene.materials) {
    if (m.emission_texture >= 0) m.emission = {0, 0, 0};  // without its picture all of it would glow
    m.base_color_texture = m.emission_texture = -1;
  }
  std::vector<Texture> kept;
  if (scene.environment >= 0) {
    kept.push_back(scene.textures[size_t(scene.environment)]);
    scene.environment = 0;
  }
  std::set<const std::string*> images;  // textures share them
  for (const Texture& t : kept) images.insert(t.bytes.get());
  for (const Texture& t : scene.textures)
    if (images.insert(t.bytes.get()).second) scene.stats.saved_bytes += t.bytes->size();
  scene.textures = std::move(kept);
}

}  // namespace raybench
