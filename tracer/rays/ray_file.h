// Ray sets as files (.rays), so that rays travel: recorded here and replayed elsewhere, or recorded in
// somebody's own engine (tracer/rays/recorder/) and replayed here. RAYS.md has the format byte by byte.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "tracer/rays/ray_set.h"

namespace raybench {

/// What a .rays file says before its rays.
struct RayFileHeader {
  uint64_t count = 0;  ///< rays, at least 1
  uint32_t query = RB_CLOSEST;
  uint32_t depth = 0;
  std::string kind;        ///< [a-z0-9_]+, at most 31 characters
  std::string order;       ///< "traced", "shuffled" or "recorded" (by another program, in its own order)
  std::string scene_hash;  ///< 16 hex digits, as Scene::hash()
  std::string rays_hash;   ///< 16 hex digits, Hash64 over the bytes of the rays
  std::string software;    ///< what wrote it
  std::string scene;       ///< how the writer called the scene; says nothing about its geometry
};

/// A whole file. The rays stand in the coordinates of the scene's file, as they were written: not checked
/// for NaN or zero directions.
struct RayFile {
  std::filesystem::path path;
  RayFileHeader header;
  std::vector<rb_ray> rays;
};

/// Writes `set`, captured in `scene`, through a temporary file that is renamed. Rays are written in the
/// coordinates of the scene's file: origins and directions times 2^-scale_exponent, t as it is. Throws
/// InputError: no rays, a kind that is not allowed, a ray that cannot be scaled without loss, or a file that
/// cannot be written; nothing is left then.
void WriteRayFile(const std::filesystem::path& path, const RaySet& set, const Scene& scene,
                  const std::string& software);

/// Whether the ray can be brought back to the scale of the scene's file without loss, so that WriteRayFile()
/// takes it.
bool HasFileForm(rb_ray ray, const Scene& scene);

/// Reads and checks the header, and the size of the file against it. Throws InputError naming the file and
/// what is wrong: no regular file, too short, magic, version, checksum, count, a field that is not allowed.
RayFileHeader ReadRayFileHeader(const std::filesystem::path& path);

/// Reads the whole file. Memory is taken only after the header and the size agree. Throws as above, and when
/// the rays do not have the checksum that the header says.
RayFile ReadRayFile(const std::filesystem::path& path);

/// The ray set for replaying in `scene`: scaled as the scene was, invalid rays replaced and counted, frozen.
/// A file that WriteRayFile() made gives the set that was written, to the bit and with the same hash. Throws
/// InputError when the rays belong to another scene (naming both) or cannot be scaled without loss.
RaySet ReplayedSet(const RayFile& file, const Scene& scene);

}  // namespace raybench
