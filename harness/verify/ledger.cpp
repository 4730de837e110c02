#include "harness/verify/ledger.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <fstream>
#include <set>
#include <sstream>

#include "accel/base/error.h"
#include "accel/base/files.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

constexpr const char* kFormat = "raybench closed-mesh ledger 1";

/// Held while the ledger is read and written. On the folder, since the file itself is replaced.
class FolderLock {
 public:
  explicit FolderLock(const fs::path& file) {
    const fs::path folder = file.has_parent_path() ? file.parent_path() : fs::path(".");
    descriptor_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    if (descriptor_ < 0)
      throw InputError(fmt::format("{}: {} is not a readable folder", file.string(), folder.string()));
    while (flock(descriptor_, LOCK_EX) != 0 && errno == EINTR) {
    }
  }
  ~FolderLock() { close(descriptor_); }
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_;
};

Json KeyOf(const LedgerKey& key) {
  return {{"scene_hash", key.scene_hash},
          {"structure", key.structure},
          {"params", key.params},
          {"query", key.query},
          {"version", key.version},
          {"commit", key.commit},
          {"plugin_sha256", key.plugin_sha256}};
}

bool HasKey(const Json& campaign, const Json& key) {
  for (const auto& [name, value] : key.items())
    if (campaign.at(name) != value) return false;
  return true;
}

Json* Find(Json& ledger, const LedgerKey& key) {
  const Json wanted = KeyOf(key);
  for (Json& campaign : ledger.at("campaigns"))
    if (HasKey(campaign, wanted)) return &campaign;
  return nullptr;
}

/// What is wrong with an entry, in words; empty if nothing is.
std::string FlawOf(const Json& campaign) {
  if (!campaign.is_object()) return "is no object";
  const Json key = KeyOf({});
  for (const auto& [name, value] : key.items())
    if (!campaign.contains(name) || !campaign[name].is_string()) return fmt::format("has no text '{}'", name);
  const auto is_count = [](const Json& json, const char* name) {
    return json.contains(name) && json[name].is_number_unsigned();
  };
  if (!is_count(campaign, "rays") || !is_count(campaign, "misses"))
    return "has no counts 'rays' and 'misses'";
  if (!campaign.contains("runs") || !campaign["runs"].is_array()) return "has no list 'runs'";
  LedgerTotals sum;
  std::set<uint64_t> seeds;
  for (const Json& run : campaign["runs"]) {
    if (!run.is_object() || !is_count(run, "seed") || !is_count(run, "rays") || !is_count(run, "misses"))
      return "has a run without the counts 'seed', 'rays' and 'misses'";
    const uint64_t seed = run["seed"], rays = run["rays"], misses = run["misses"];
    if (misses > rays) return fmt::format("has more misses than rays in the run with seed {}", seed);
    if (!seeds.insert(seed).second) return fmt::format("has two runs with seed {}", seed);
    sum.rays += rays;
    sum.misses += misses;
  }
  if (campaign["rays"] != sum.rays || campaign["misses"] != sum.misses)
    return fmt::format("has {} rays and {} misses, but its runs add up to {} and {}",
                       campaign["rays"].get<uint64_t>(), campaign["misses"].get<uint64_t>(), sum.rays,
                       sum.misses);
  return {};
}

}  // namespace

Ledger::Ledger(fs::path path) : path_(std::move(path)) {
  const FolderLock lock(path_);
  ReadChecked();
}

uint64_t Ledger::Begin(const LedgerKey& key, const std::string& scene, uint64_t seed) {
  const FolderLock lock(path_);
  Json ledger = ReadChecked();
  Json* campaign = Find(ledger, key);
  if (campaign == nullptr) {
    Json fresh = {{"scene", scene}};
    fresh.update(KeyOf(key));
    fresh["rays"] = 0u;
    fresh["misses"] = 0u;
    fresh["runs"] = Json::array();
    ledger["campaigns"].push_back(std::move(fresh));
    campaign = &ledger["campaigns"].back();
  }
  std::set<uint64_t> used;
  for (const Json& run : campaign->at("runs")) used.insert(run.at("seed").get<uint64_t>());
  while (used.contains(seed)) ++seed;
  campaign->at("runs").push_back({{"seed", seed}, {"rays", 0u}, {"misses", 0u}});
  Write(ledger);
  return seed;
}

void Ledger::Record(const LedgerKey& key, uint64_t seed, uint64_t rays, uint64_t misses) {
  const FolderLock lock(path_);
  Json ledger = ReadChecked();
  Json* campaign = Find(ledger, key);
  bool found = false;
  LedgerTotals sum;
  if (campaign != nullptr) {
    for (Json& run : campaign->at("runs")) {
      if (run.at("seed") == seed) {
        run["rays"] = rays;
        run["misses"] = misses;
        found = true;
      }
      sum.rays += run.at("rays").get<uint64_t>();
      sum.misses += run.at("misses").get<uint64_t>();
    }
  }
  if (!found) throw InputError(fmt::format("{}: the run with seed {} is gone", path_.string(), seed));
  campaign->at("rays") = sum.rays;
  campaign->at("misses") = sum.misses;
  Write(ledger);
}

LedgerTotals Ledger::Totals(const LedgerKey& key) const {
  const FolderLock lock(path_);
  Json ledger = ReadChecked();
  const Json* campaign = Find(ledger, key);
  if (campaign == nullptr) return {};
  return {campaign->at("rays"), campaign->at("misses"), campaign->at("runs").size()};
}

Json Ledger::ReadChecked() const {
  std::error_code error;
  if (!fs::exists(path_, error)) return {{"format", kFormat}, {"campaigns", Json::array()}};
  std::ifstream in(path_, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  if (!in) throw InputError(fmt::format("{}: cannot be read", path_.string()));
  const Json ledger = Json::parse(text.str(), nullptr, false);
  if (!ledger.is_object() || !ledger.contains("format") || ledger["format"] != kFormat ||
      !ledger.contains("campaigns") || !ledger["campaigns"].is_array())
    throw InputError(fmt::format("{}: is not a ledger of raybench (format '{}')", path_.string(), kFormat));
  size_t number = 0;
  for (const Json& campaign : ledger["campaigns"]) {
    if (const std::string flaw = FlawOf(campaign); !flaw.empty())
      throw InputError(fmt::format("{}: campaign {} {}", path_.string(), number, flaw));
    ++number;
  }
  return ledger;
}

void Ledger::Write(const Json& ledger) const {
  WriteFileAtomically(path_, ledger.dump(1, ' ', false, Json::error_handler_t::replace) + "\n");
}

}  // namespace raybench
