// Wavefront MTL: the materials of OBJ files.
#pragma once

#include <filesystem>
#include <map>
#include <string>
#include <tuple>

#include "datasets/scene/scene.h"

namespace raybench {

/// A picture that a material names.
struct MtlMap {
  std::filesystem::path file;  ///< empty: none
  TextureWrap wrap = TextureWrap::kRepeat;

  friend bool operator<(const MtlMap& a, const MtlMap& b) {
    return std::tie(a.file, a.wrap) < std::tie(b.file, b.wrap);
  }
};

struct MtlMaterial {
  Material material;         ///< by the table of MATERIALS.md; without textures
  MtlMap diffuse, emission;  ///< multiply what is of their name
};

using MtlLibrary = std::map<std::string, MtlMaterial, std::less<>>;

/// Reads the materials of a file into `library`, by name; of one name the last counts. A statement that does
/// not parse is passed over. The scene gets a note for what the file has and the model has not, and nothing
/// else. Throws InputError: a file that is missing, or no text.
void ReadMtl(const std::filesystem::path& path, const LoadOptions& options, Scene& scene,
             MtlLibrary& library);

}  // namespace raybench
