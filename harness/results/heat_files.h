// Heat maps as files, for the Python part to draw: heat.json beside one .npy file a map.
#pragma once

#include <filesystem>
#include <string>

#include "harness/base/json.h"
#include "tracer/heat_map.h"

namespace raybench {

/// A folder with the heat maps of one scene. Files are written at once, each through a temporary one; an
/// existing folder is gone on with, so that an interrupted run keeps what it has counted.
class HeatFiles {
 public:
  /// Creates the folder. `picture`: the scene seen by the same camera, relative to `folder`.
  /// Throws InputError.
  HeatFiles(std::filesystem::path folder, const std::string& scene, const std::string& picture);

  bool Has(const std::string& spec) const;
  void Add(const std::string& spec, const HeatMap& map);
  /// Stands in the place of a map: why this structure has none.
  void AddNotCounted(const std::string& spec, const std::string& why);

 private:
  void Put(Json entry);

  std::filesystem::path folder_;
  Json content_;
};

/// Why the structure has no heat map on this scene; empty: it may have one.
std::string WhyNotCounted(const rb_structure& structure, const Scene& scene);

}  // namespace raybench
