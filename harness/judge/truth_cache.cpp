#include "harness/judge/truth_cache.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <optional>

#include "accel/base/files.h"
#include "accel/base/hash.h"
#include "datasets/models/fetch.h"
#include "harness/truth/sources.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

// File: magic; identity (length, bytes); number of rays; for each ray flags (bit 0 hit, 1 coplanar, 2-3
// feature) and, of hits, t, t_rounded, first, number of tied and their ids; Hash64 of all before. Lengths,
// numbers and the checksum are uint64, ids and the number of tied uint32; little-endian, without padding.
constexpr std::string_view kMagic = "raybench truth 1\n";
constexpr uint64_t kLimit = 1 << 30;      ///< bytes of all files
constexpr uint64_t kFileLimit = 1 << 28;  ///< of one; a larger one is not kept
constexpr size_t kChunk = 1024;           ///< rays between two calls of progress

/// All that the truth depends on.
std::string Identity(const Oracle& oracle, const Scene& scene, std::span<const rb_ray> rays) {
  Hash64 hash;
  hash.Add(rays.data(), rays.size_bytes());
  return fmt::format(
      "scene {} scale 2^{} positions {} triangles {} spheres {} cones {} polygons {} degenerate {} dropped "
      "{}\n"
      "rays {} {}\noracle {} sources {}\n",
      scene.hash(), scene.scale_exponent, scene.positions.size(), scene.triangles.size(),
      scene.spheres.size(), scene.cones.size(), scene.polygons.size(), scene.stats.degenerate_triangles,
      scene.stats.dropped_triangles, rays.size(), hash.Hex(), oracle.Name(), kTruthSources);
}

std::string HashOf(std::string_view text) {
  Hash64 hash;
  hash.Add(text.data(), text.size());
  return hash.Hex();
}

template <class T>
void Put(std::string& out, T value) {
  out.append(reinterpret_cast<const char*>(&value), sizeof value);
}

/// Takes values off the front; once there is too little, everything is zero and `whole` false.
struct Reader {
  std::string_view rest;
  bool whole = true;

  std::string_view Bytes(uint64_t size) {
    if (size > rest.size()) {
      whole = false;
      size = 0;
      rest = {};
    }
    const std::string_view taken = rest.substr(0, size);
    rest.remove_prefix(size);
    return taken;
  }
  template <class T>
  T Get() {
    T value{};
    if (const std::string_view bytes = Bytes(sizeof value); whole)
      std::memcpy(&value, bytes.data(), sizeof value);
    return value;
  }
};

std::string Encode(std::span<const Truth> truth) {
  std::string out;
  Put(out, uint64_t{truth.size()});
  for (const Truth& t : truth) {
    Put(out, uint8_t(unsigned(t.hit) | unsigned(t.coplanar) << 1 | unsigned(t.feature) << 2));
    if (!t.hit) continue;
    Put(out, t.t);
    Put(out, t.t_rounded);
    Put(out, t.first);
    Put(out, uint32_t(t.tied.size()));
    for (uint32_t prim : t.tied) Put(out, prim);
  }
  return out;
}

std::optional<std::vector<Truth>> Decode(std::string_view text, size_t rays) {
  Reader in{text};
  if (in.Get<uint64_t>() != rays) return {};
  std::vector<Truth> truth(rays);
  for (Truth& t : truth) {
    const auto flags = in.Get<uint8_t>();
    t.hit = flags & 1;
    t.coplanar = flags & 2;
    t.feature = Feature(flags >> 2);
    if (!t.hit) continue;
    t.t = in.Get<double>();
    t.t_rounded = in.Get<float>();
    t.first = in.Get<uint32_t>();
    const std::string_view ids = in.Bytes(uint64_t{in.Get<uint32_t>()} * sizeof(uint32_t));
    t.tied.resize(ids.size() / sizeof(uint32_t));
    std::copy(ids.begin(), ids.end(), reinterpret_cast<char*>(t.tied.data()));
  }
  if (!in.whole || !in.rest.empty()) return {};
  return truth;
}

/// None if there is no such file, or it must be written again.
std::optional<std::vector<Truth>> Read(const fs::path& path, const std::string& identity, size_t rays,
                                       const TruthListener& listener) {
  std::ifstream file(path, std::ios::binary);
  if (!file) return {};
  const std::string text{std::istreambuf_iterator<char>(file), {}};
  Reader in{text};
  std::string what = "is broken";
  if (in.Bytes(kMagic.size()) == kMagic && text.size() >= kMagic.size() + sizeof(uint64_t)) {
    const std::string_view sum = std::string_view(text).substr(text.size() - sizeof(uint64_t));
    Hash64 hash;
    hash.Add(text.data(), text.size() - sum.size());
    if (Reader{sum}.Get<uint64_t>() == hash.value()) {
      in.rest.remove_suffix(sum.size());
      what = "tells of something else";
      if (in.Bytes(in.Get<uint64_t>()) == identity) {
        if (auto truth = Decode(in.rest, rays)) return truth;
      }
    }
  }
  if (listener.say)
    listener.say(
        fmt::format("{}: {} and is written again; the truth is computed again", path.string(), what));
  return {};
}

/// Removes the least recently used files until the folder is within its limit.
void Tidy(const fs::path& folder) {
  struct Entry {
    fs::file_time_type used;
    fs::path path;
    uint64_t size;
  };
  std::vector<Entry> entries;
  uint64_t total = 0;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    std::error_code gone;  // another run may tidy as well
    Entry entry{it->last_write_time(gone), it->path(), it->file_size(gone)};
    if (gone) continue;
    total += entry.size;
    entries.push_back(std::move(entry));
  }
  std::sort(entries.begin(), entries.end(), [](const Entry& a, const Entry& b) { return a.used < b.used; });
  for (const Entry& entry : entries) {
    if (total <= kLimit) break;
    if (fs::remove(entry.path, error)) total -= entry.size;
  }
}

void SayNotKept(const InputError& why, const TruthListener& listener) {
  static std::atomic<bool> said = false;
  if (listener.say && !said.exchange(true))
    listener.say(fmt::format("truth is not stored for the next run: {}", why.what()));
}

/// Where truth is kept, if anywhere.
std::optional<fs::path> Folder(const TruthListener& listener) {
  const char* value = std::getenv("RAYBENCH_TRUTH_CACHE");
  const std::string_view text = value == nullptr ? "" : value;
  if (text == "off") return {};
  if (!text.empty() && text != "on")
    throw InputError(fmt::format("RAYBENCH_TRUTH_CACHE is '{}'; allowed are on and off", text));
  try {
    return CacheDirectory() / "truth";
  } catch (const InputError& failure) {
    SayNotKept(failure, listener);
    return {};
  }
}

void Write(const fs::path& path, const std::string& identity, std::span<const Truth> truth,
           const TruthListener& listener) {
  uint64_t size = 0;
  for (const Truth& t : truth) size += 32 + t.tied.size() * sizeof(uint32_t);
  if (size > kFileLimit) return;
  std::string text(kMagic);
  Put(text, uint64_t{identity.size()});
  text += identity + Encode(truth);
  Hash64 hash;
  hash.Add(text.data(), text.size());
  Put(text, hash.value());
  std::error_code error;
  fs::create_directories(path.parent_path(), error);
  try {
    WriteFileAtomically(path, text);
    Tidy(path.parent_path());
  } catch (const InputError& failure) {
    SayNotKept(failure, listener);
  }
}

std::vector<Truth> Ask(const Oracle& oracle, std::span<const rb_ray> rays, uint32_t threads,
                       const TruthListener& listener) {
  std::vector<Truth> truth;
  truth.reserve(rays.size());
  for (size_t at = 0; at < rays.size(); at += kChunk) {
    if (listener.progress) listener.progress(double(at) / double(rays.size()));
    std::vector<Truth> part = oracle.Ask(rays.subspan(at, std::min(kChunk, rays.size() - at)), threads);
    std::move(part.begin(), part.end(), std::back_inserter(truth));
  }
  return truth;
}

}  // namespace

std::vector<Truth> CachedTruth(const Oracle& oracle, const Scene& scene, std::span<const rb_ray> rays,
                               uint32_t threads, const TruthListener& listener) {
  const std::optional<fs::path> folder = Folder(listener);
  if (!folder) return Ask(oracle, rays, threads, listener);
  const std::string identity = Identity(oracle, scene, rays);
  const fs::path path = *folder / HashOf(identity);
  if (auto truth = Read(path, identity, rays.size(), listener)) {
    std::error_code ignored;
    fs::last_write_time(path, fs::file_time_type::clock::now(), ignored);
    return *std::move(truth);
  }
  std::vector<Truth> truth = Ask(oracle, rays, threads, listener);
  Write(path, identity, truth, listener);
  return truth;
}

}  // namespace raybench
