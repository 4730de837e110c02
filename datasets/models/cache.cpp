// Where fetched models lie: CACHE/models/NAME/FILE with its record.json.
#include <fmt/format.h>

#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "datasets/models/fetch.h"

namespace raybench {

namespace fs = std::filesystem;

fs::path CacheDirectory() {
  const auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value != nullptr ? value : "");
  };
  if (fs::path cache = variable("RAYBENCH_CACHE"); !cache.empty()) return cache;
  // The XDG base directory specification: relative paths are to be ignored.
  if (fs::path xdg = variable("XDG_CACHE_HOME"); xdg.is_absolute()) return xdg / "raybench";
  const fs::path home = variable("HOME");
  if (home.empty()) throw InputError("no cache directory: set RAYBENCH_CACHE, XDG_CACHE_HOME or HOME");
  return home / ".cache" / "raybench";
}

namespace {

fs::path FileName(const std::string& member) { return member.substr(member.find_last_of("!/") + 1); }

}  // namespace

fs::path CachedFile(const ManifestEntry& entry) {
  return CacheDirectory() / "models" / entry.name /
         (entry.conversion.kind.empty() ? FileName(entry.file.member) : fs::path(entry.name + ".ply"));
}

bool IsFetched(const ManifestEntry& entry) {
  const fs::path file = CachedFile(entry);
  std::error_code ignored;
  if (!fs::is_regular_file(file, ignored)) return false;
  for (const PackageFile& beside : entry.beside)
    if (!fs::is_regular_file(file.parent_path() / FileName(beside.member), ignored)) return false;
  return true;
}

std::string FetchedVersion(const ManifestEntry& entry) {
  std::ifstream in(CachedFile(entry).parent_path() / "record.json");
  const nlohmann::json record = nlohmann::json::parse(in, nullptr, false);
  if (!record.is_object() || !record.contains("version") || !record["version"].is_string()) return {};
  return record["version"];
}

void VerifyFetched(const ManifestEntry& entry) {
  if (!IsFetched(entry)) {
    throw InputError(
        fmt::format("{}: not fetched yet; get it with 'raybench fetch {}'", entry.name, entry.name));
  }
  const auto check = [&](const fs::path& path, const std::string& sha256) {
    if (Sha256OfFile(path) != sha256) {
      throw InputError(
          fmt::format("{}: does not have the SHA-256 of the manifest; get it again with 'raybench fetch {}'",
                      path.string(), entry.name));
    }
  };
  const fs::path file = CachedFile(entry);
  check(file, entry.CachedSha256());
  for (const PackageFile& beside : entry.beside)
    check(file.parent_path() / FileName(beside.member), beside.sha256);
}

}  // namespace raybench
