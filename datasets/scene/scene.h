// The scene model: what readers and generators produce, and what tracer and harness work on.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "accel/base/error.h"
#include "accel/base/vec3.h"
#include "accel/contract/raybench.h"
#include "datasets/scene/procedural.h"
#include "datasets/scene/texture.h"

namespace raybench {

/// Whether no channel has anything of it: no light, no weight.
inline bool IsBlack(Vec3f color) { return color == Vec3f{0, 0, 0}; }

/// How `Material::alpha` acts (glTF 2.0, 3.9.4): not at all; as a hole below `alpha_cutoff`; as a blend.
enum class AlphaMode : uint8_t { kOpaque, kMask, kBlend };

/// Whitted material, linear RGB in [0,1]; emission may exceed 1. MATERIALS.md: what each format becomes.
struct Material {
  std::string name;
  Vec3f diffuse{0.7f, 0.7f, 0.7f};
  Vec3f specular{0, 0, 0};  ///< Phong lobe
  float shininess = 32;     ///< Phong exponent
  Vec3f emission{0, 0, 0};
  Vec3f reflect{0, 0, 0};     ///< k_r: weight of the ideal mirror ray
  Vec3f transmit{0, 0, 0};    ///< k_t: weight of the refracted ray
  float ior = 1.5f;           ///< index of refraction
  Vec3f dispersion{0, 0, 0};  ///< added to `ior` for each channel; not 0: channels are refracted apart
  /// Fresnel's equations for a dielectric of index `ior` share `transmit` between the refracted and the
  /// mirror ray; otherwise the weights are constant.
  bool fresnel = false;
  /// Transmits straight on, like a pane too thin to bend a ray.
  bool thin = false;
  /// Index into Scene::textures, looked up at Scene::uvs; -1: none. Its colour, from sRGB to linear,
  /// multiplies diffuse, reflect and transmit.
  int32_t base_color_texture = -1;
  int32_t emission_texture = -1;  ///< likewise; multiplies emission
  float alpha = 1;                ///< times the texture's alpha
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;  ///< for AlphaMode::kMask
};

enum class LightKind : uint8_t { kPoint, kDirectional, kSpot };

/// A light without size. Where `falloff` is set, `intensity` is divided by the squared distance; no 4 pi.
struct Light {
  Vec3f position{0, 0, 0};  ///< not of a directional light
  Vec3f intensity{1, 1, 1};
  bool falloff = false;  ///< never of a directional light
  LightKind kind = LightKind::kPoint;
  Vec3f direction{0, 0, -1};  ///< unit; the way light travels; not of a point light
  /// Spot: full within the cone of half angle acos(cos_inner), none outside that of cos_outer, and between
  /// them the square of a linear ramp of the cosine, as glTF's KHR_lights_punctual recommends.
  float cos_inner = 1, cos_outer = 0.70710678f;
  /// Where light has faded to nothing (KHR_lights_punctual's window (1 - (d/range)^4)); infinite: never.
  float range = std::numeric_limits<float>::infinity();
};

/// Pinhole camera; the image plane is spanned at distance 1. `tan_half_fov` belongs to the vertical angle.
struct Camera {
  Vec3f eye{0, 0, 0}, at{0, 0, -1}, up{0, 1, 0};
  float tan_half_fov = 0.5f;
};

/// Where a scene came from, for run.json and `raybench list`.
struct Provenance {
  std::string source;   ///< file path, package and member, or generator with its parameters
  std::string licence;  ///< as stated by the source; empty: unknown
  std::string package, version, sha256;
};

/// What loading noticed; every figure is reported.
struct LoadStats {
  uint64_t faces = 0;  ///< polygons in the file, before triangulation
  /// Exactly collinear triangles (exact predicate) and polygons without area, left out.
  uint64_t degenerate_triangles = 0;
  /// Primitives that are not finite, refer to no vertex or have no size, left out because the caller
  /// asked to.
  uint64_t dropped_triangles = 0;
  uint64_t crossed_faces = 0;      ///< polygons that cross themselves: fans, which need not cover them
  uint64_t instances = 0;          ///< mesh nodes flattened
  uint64_t shared_triangles = 0;   ///< triangles that instancing would have shared
  uint64_t saved_bytes = 0;        ///< of attributes and textures that nothing reads, left out
  std::vector<std::string> notes;  ///< what the file has and the scene has not, a line each, for the user
};

enum class PrimKind : uint8_t { kTriangle, kSphere, kCone, kPolygon };

/// Immutable once Finish() has run. Positions are the file's float32 values times 2^scale_exponent.
class Scene {
 public:
  std::string name;
  Provenance provenance;
  LoadStats stats;

  std::vector<Vec3f> positions;
  std::vector<Vec3f> normals;  ///< shading normals of any length, one per position or empty; 0: none there
  std::vector<Vec2f> uvs;      ///< texture coordinates, one per position or empty
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<uint32_t> triangle_material;  ///< one per triangle
  std::vector<uint32_t> triangle_face;      ///< the file's face id of each triangle (0-based, in file order)
  std::vector<Sphere> spheres;
  std::vector<uint32_t> sphere_material;
  std::vector<Cone> cones;
  std::vector<uint32_t> cone_material;
  std::vector<Polygon> polygons;
  std::vector<uint32_t> polygon_material;
  std::vector<uint32_t> polygon_vertices;  ///< indices of positions, in runs that the polygons name
  std::vector<Material> materials;         ///< at least one after Finish()
  std::vector<Texture> textures;
  std::vector<Light> lights;    ///< at least one after Finish()
  std::vector<Camera> cameras;  ///< at least one after Finish(); the first is used
  Vec3f ambient{0.1f, 0.1f, 0.1f};
  Vec3f background{0.6f, 0.7f, 0.8f};
  /// Index into `textures` of a latitude-longitude map that takes the place of `background`; -1: none.
  int32_t environment = -1;
  int scale_exponent = 0;
  bool automatic_camera = false, automatic_lights = false;  ///< set by Finish() when it had to invent them

  /// Brings a freshly filled scene into the state the contract promises: checks vertices (finite) and
  /// indices, leaves out exactly degenerate triangles and polygons without area, makes the directions of
  /// lights unit, rescales by a power of two if max |coordinate| lies outside [2^-30, 2^30] (so that the
  /// light that arrives stays the same), adds a camera and lights where there are none, computes bounds and
  /// hash. With `drop_bad` bad primitives, and those too small beside the largest to be rescaled without
  /// loss, are left out and counted instead of throwing. Shading normals that are not finite become (0, 0,
  /// 0), such texture coordinates (0, 0), with a note. Throws InputError naming `provenance.source` and the
  /// vertex, face, material or light.
  void Finish(bool drop_bad = false);

  /// Takes hash() of the geometry as it is now, for a reader that changes it before Finish(), which else does
  /// this first.
  void TakeHash();

  /// View for structures; valid while the scene lives and is not moved.
  rb_geometry Geometry() const;
  /// Primitive ids: triangles, then spheres, cones, polygons.
  uint64_t primitive_count() const { return triangles.size() + procedural_count(); }
  uint64_t procedural_count() const { return spheres.size() + cones.size() + polygons.size(); }
  struct Place {
    PrimKind kind;
    uint32_t index;  ///< in the array of that kind
  };
  Place Locate(uint32_t prim) const;
  const Bounds3& bounds() const { return bounds_; }
  /// Names the geometry, 16 hex digits: Hash64 over the numbers of positions, triangles and spheres (uint64
  /// each), then the three arrays; where there are cones or polygons, over the numbers of cones, polygons and
  /// polygon_vertices and these arrays too. All as the file has them: with what is left out or welded and
  /// without the scale. tracer/rays/RAYS.md has the algorithm for programs outside.
  const std::string& hash() const { return hash_; }
  /// Index into `materials`.
  uint32_t MaterialOf(uint32_t prim) const;
  /// Geometric normal of a primitive at a point of it, not normalised, in double. Spheres and cones: outward,
  /// whatever the sign of the radius; zero at a cone's apex.
  Vec3d GeometricNormal(uint32_t prim, Vec3d point) const;
  /// The indices of a polygon's corners.
  std::span<const uint32_t> CornersOf(const Polygon& polygon) const {
    return std::span(polygon_vertices).subspan(polygon.first, polygon.count);
  }
  const PolygonPlane& PlaneOfPolygon(uint32_t index) const { return polygon_planes_[index]; }

 private:
  void FinishProcedurals(bool drop_bad);
  Bounds3 ProceduralBounds(uint64_t i) const;
  bool IntersectProcedural(uint64_t i, const rb_ray& ray, float& t) const;

  std::vector<PolygonPlane> polygon_planes_;
  Bounds3 bounds_;
  std::string hash_;
  bool has_hash_ = false;  ///< of what Finish() will be given
};

struct LoadOptions {
  uint64_t seed = 1;         ///< for generators
  bool drop_bad = false;     ///< leave out bad triangles instead of refusing the file
  bool keep_unread = false;  ///< keep attributes that nothing reads, where the reader knows them
  std::function<void(double fraction)> progress;  ///< may be empty
};

/// A procedural scene: a seeded generator with described parameters.
struct Generator {
  const char *name, *doc, *source;
  const rb_param* params;
  uint32_t param_count, config_size;
  /// Exactly how many primitives generate() will make; at most 2^60.
  uint64_t (*count)(const void* config);
  /// Takes seed and progress from the options; returns a scene on which Finish() has run.
  Scene (*generate)(const void* config, const LoadOptions& options);
};
std::vector<const Generator*> Generators();

/// Makes a scene from a scene, with described parameters: "subdivide(bunny,levels=2)".
struct Modifier {
  const char *name, *doc, *source;
  const rb_param* params;
  uint32_t param_count, config_size;
  /// Takes a scene on which Finish() has run and returns one on which it has run again.
  Scene (*apply)(Scene scene, const void* config, const LoadOptions& options);
};
std::vector<const Modifier*> Modifiers();

/// Loads what a user named: a path to a file that ends in one of SceneFileEndings(), a generator
/// ("sphereflake(depth=5)"), a model of the manifest ("engine"; it must have been fetched), or a modifier
/// around any of these, also nested ("subdivide(bunny,levels=2)"). `Scene::name` is its canonical spelling.
/// Throws InputError: missing, unknown format, broken, not fetched.
Scene LoadScene(const std::string& name, const LoadOptions& options = {});
/// Throws as LoadScene() does where it can be told without loading anything: unknown names and formats, a generator's
/// parameters. Whether a file is there, and what is inside a modifier's parentheses, only loading tells.
void CheckSceneName(const std::string& name);

/// ".obj", ".off", ...: what the readers take.
std::vector<std::string> SceneFileEndings();

}  // namespace raybench
