// Materials and textures of a glTF file, as raybench's scene has them.
#pragma once

#include <tiny_gltf.h>

#include <cstdint>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "datasets/gltf/accessors.h"
#include "datasets/gltf/container.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// A number of an object in an extension; the fallback where it is missing or of another type.
double GltfNumber(const tinygltf::Value& object, const char* key, double fallback);

/// The same for an index: a number that is none becomes one that nothing has.
int GltfIndex(const tinygltf::Value& object, const char* key, int fallback);

/// A Whitted material that stands for material `index` of the file, by the table of MATERIALS.md; without its
/// textures. Throws InputError where a number of an extension is out of its range.
Material GltfMaterial(const GltfContainer& container, const tinygltf::Material& material, size_t index);

/// The extensions of materials that GltfMaterial() and GltfBaseColor() do not follow, "A, B"; empty: none.
std::string GltfIgnoredExtensions(const std::vector<tinygltf::Material>& materials);

/// Where a material looks up a colour: a texture, a set of coordinates, and an affine map of them.
struct GltfLookup {
  int texture = -1;  ///< -1: none
  int set = 0;       ///< TEXCOORD_0, ...
  bool mapped = false;
  double xx = 1, xy = 0, yx = 0, yy = 1, x = 0, y = 0;

  /// Whether both look at the same coordinates.
  bool SamePlaces(const GltfLookup& b) const {
    return set == b.set && xx == b.xx && xy == b.xy && yx == b.yx && yy == b.yy && x == b.x && y == b.y;
  }

  Vec2f operator()(std::array<float, 2> uv) const {
    if (!mapped) return {uv[0], uv[1]};
    return {float(xx * uv[0] + xy * uv[1] + x), float(yx * uv[0] + yy * uv[1] + y)};
  }
};
/// With KHR_texture_transform.
GltfLookup GltfBaseColor(const tinygltf::Material& material);
GltfLookup GltfEmission(const tinygltf::Material& material);

/// Puts textures into a scene, each once.
class GltfTextures {
 public:
  /// `images` is the file's array of them; all arguments outlive this.
  GltfTextures(const tinygltf::Model& model, const nlohmann::json& images, GltfContainer& container,
               GltfAccessors& accessors, Scene& scene)
      : model_(model), images_(images), container_(container), accessors_(accessors), scene_(scene) {}

  /// The scene's index of the file's texture; -1, with a note, where it has no image or its file is
  /// not there.
  int32_t Load(int texture);

 private:
  const GltfResource& Image(int64_t index);

  const tinygltf::Model& model_;
  const nlohmann::json& images_;
  GltfContainer& container_;
  GltfAccessors& accessors_;
  Scene& scene_;
  std::map<int, int32_t> textures_;
  std::map<int64_t, GltfResource> resources_;
};

}  // namespace raybench
