#include "harness/render/device_waves.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include "accel/contract/picture.h"
#include "datasets/scene/needs.h"

namespace raybench {
namespace {

rb_picture_entry EntryOf(const Registry& registry, const rb_structure& structure) {
  std::string plugin = registry.OriginOf(structure);
  if (!plugin.empty() && plugin.find('/') == plugin.npos) plugin = "./" + plugin;  // as it was loaded
  void* const library = plugin.empty() ? nullptr : dlopen(plugin.c_str(), RTLD_NOW | RTLD_NOLOAD);
  void* const entry = library != nullptr ? dlsym(library, RAYBENCH_PICTURE_ENTRY) : nullptr;
  if (entry == nullptr)
    throw InputError(
        fmt::format("--waves device: structure '{}' does not draw; vulkan_rt does", structure.name));
  return reinterpret_cast<rb_picture_entry>(entry);
}

void Set(float (&to)[3], Vec3f from) { to[0] = from.x, to[1] = from.y, to[2] = from.z; }

std::vector<rb_material> MaterialsOf(const Scene& scene) {
  std::vector<rb_material> all;
  for (const Material& m : scene.materials) {
    rb_material& to = all.emplace_back();
    Set(to.diffuse, m.diffuse), Set(to.specular, m.specular), Set(to.emission, m.emission);
    Set(to.reflect, m.reflect), Set(to.transmit, m.transmit), Set(to.dispersion, m.dispersion);
    to.shininess = m.shininess, to.ior = m.ior, to.fresnel = m.fresnel, to.thin = m.thin;
  }
  return all;
}

std::vector<rb_light> LightsOf(const Scene& scene) {
  std::vector<rb_light> all;
  for (const Light& l : scene.lights) {
    rb_light& to = all.emplace_back();
    Set(to.position, l.position), Set(to.intensity, l.intensity), Set(to.direction, l.direction);
    to.cos_inner = l.cos_inner, to.cos_outer = l.cos_outer, to.range = l.range, to.falloff = l.falloff;
    to.kind = l.kind == LightKind::kPoint         ? RB_LIGHT_POINT
              : l.kind == LightKind::kDirectional ? RB_LIGHT_DIRECTIONAL
                                                  : RB_LIGHT_SPOT;
  }
  return all;
}

}  // namespace

void RequireDeviceWaves(const Registry& registry, const Contestant& contestant, const Scene& scene,
                        const TraceOptions& options) {
  EntryOf(registry, *contestant.structure);
  const SceneNeeds needs = NeedsOf(scene);
  const TraceOptions standard;
  const auto refuse = [&](bool has, const char* what) {
    if (has) throw InputError(fmt::format("--waves device: {}; the host's waves do that", what));
  };
  refuse(needs.textures, "the scene has textures");
  refuse(needs.alpha, "the scene has materials that are cut out by alpha");
  refuse(needs.environment, "the scene has an environment map");
  refuse(options.sampling.PixelSamples() != 1 || options.sampling.pattern != standard.sampling.pattern ||
             options.sampling.filter != standard.sampling.filter,
         "one ray through the middle of each pixel is all it does");
  refuse(options.rules != TraceRules::kWhitted, "it knows the rules whitted only");
  refuse(options.self_intersection != SelfIntersection::kErrorBound,
         "it knows --self-intersection error-bound only");
  refuse(options.shadows != ShadowQuery::kAny, "it knows --shadows any only");
  refuse(options.all_needs, "it does what the scene needs, not --needs all");
}

DevicePicture TraceOnDevice(const Registry& registry, const Scene& scene, const Tree& tree,
                            const TraceOptions& options) {
  const SceneNeeds needs = NeedsOf(scene);
  const rb_geometry geometry = scene.Geometry();
  const std::vector<rb_material> materials = MaterialsOf(scene);
  const std::vector<rb_light> lights = LightsOf(scene);
  std::vector<uint32_t> material_of(scene.primitive_count());
  for (uint32_t i = 0; i < material_of.size(); ++i) material_of[i] = scene.MaterialOf(i);
  std::vector<rb_ray> rays(size_t{options.width} * options.height);
  PixelRays(scene, options.width, options.height, 0, rays, options.threads);
  std::vector<rb_wave> waves(options.max_depth + size_t{1});

  DevicePicture drawn;
  Image& image = drawn.result.image;
  image.width = options.width, image.height = options.height;
  image.pixels.resize(rays.size());
  rb_picture picture{};
  picture.struct_size = sizeof picture;
  picture.max_depth = options.max_depth;
  picture.geometry = &geometry;
  if (needs.smooth_normals) picture.normals = reinterpret_cast<const float(*)[3]>(scene.normals.data());
  picture.materials = materials.data(), picture.material_count = uint32_t(materials.size());
  picture.material_of = material_of.data();
  picture.lights = lights.data(), picture.light_count = uint32_t(lights.size());
  picture.fresnel = options.fresnel == FresnelMode::kMaterial ? RB_FRESNEL_MATERIAL
                    : options.fresnel == FresnelMode::kOff    ? RB_FRESNEL_OFF
                                                              : RB_FRESNEL_ON;
  picture.shadow_rays = needs.shadow_rays, picture.transmittance = needs.transmittance;
  picture.min_contribution = options.min_contribution;
  Set(picture.ambient, scene.ambient), Set(picture.background, scene.background);
  picture.camera_rays = rays.data(), picture.ray_count = rays.size();
  picture.pixels = reinterpret_cast<float(*)[3]>(image.pixels.data());
  picture.waves = waves.data();
  char error[512] = "";
  if (EntryOf(registry, tree.structure())(tree.get(), &picture, error, sizeof error) != 0)
    throw BuildError(fmt::format("{}: {}", tree.structure().name, error));

  TraceResult& result = drawn.result;
  for (size_t w = 0; w < waves.size() && waves[w].rays > 0; ++w) {
    const rb_wave& wave = waves[w];
    result.waves.push_back({wave.rays, wave.hits, wave.shadow, wave.blocked});
    (w == 0 ? result.camera_rays : result.reflection_rays) += w == 0 ? wave.rays : wave.reflections;
    (w == 0 ? result.camera_hits : result.reflection_hits) += wave.hits;  // refracted ones among them
    result.refraction_rays += wave.refractions;
    result.shadow_rays += wave.shadow, result.shadow_blocked += wave.blocked;
  }
  drawn.seconds = picture.seconds, drawn.copies = picture.copies;
  return drawn;
}

}  // namespace raybench
