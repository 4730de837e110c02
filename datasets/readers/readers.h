// The file readers behind LoadScene(): one file each. What it defines as `const Format kNAME` is found by its name.
// Files are read once, by code of our own: other readers of meshes skip what does not parse, which shifts all
// later indices, leave out faces without a word, and take what is cut off for whole. Tests hold them against
// OpenMesh's.
#pragma once

#include <filesystem>

#include "datasets/readers/all_formats.h"
#include "datasets/scene/scene.h"
#include "datasets/scene/text.h"

namespace raybench {

struct Format {
  const char* ending;  ///< ".off"; in a file's name also in capitals
  /// Returns a filled scene on which Finish() has not run yet, and throws InputError with one line that begins
  /// with the path.
  Scene (*read)(const std::filesystem::path& path, const LoadOptions& options);
};

}  // namespace raybench
