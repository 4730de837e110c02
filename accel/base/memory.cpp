#include "accel/base/memory.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fstream>

#include "accel/base/error.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;

/// The number behind `key` in a file of "key number" lines, or the file's only number when `key` is empty.
std::optional<uint64_t> NumberIn(const fs::path& path, const std::string& key) {
  std::ifstream file(path);
  std::string word;
  if (!key.empty()) {
    while (file >> word)
      if (word == key) break;
  }
  uint64_t number = 0;
  if (file >> number) return number;
  return {};
}

/// What one control group (version 2) leaves; empty where it sets no limit.
std::optional<uint64_t> LeftBy(const fs::path& group) {
  const std::optional<uint64_t> limit = NumberIn(group / "memory.max", "");
  if (!limit) return {};
  const uint64_t used = NumberIn(group / "memory.current", "").value_or(0);
  // File pages that nobody looks at are given up when memory is asked for.
  const uint64_t idle = NumberIn(group / "memory.stat", "inactive_file").value_or(0);
  const uint64_t held = used - std::min(used, idle);
  return *limit - std::min(*limit, held);
}

}  // namespace

std::optional<uint64_t> AvailableMemory() {
  std::optional<uint64_t> least = NumberIn("/proc/meminfo", "MemAvailable:");
  if (least) *least *= 1024;
  const auto take = [&](std::optional<uint64_t> left) {
    if (left) least = std::min(least.value_or(*left), *left);
  };
  const fs::path root = "/sys/fs/cgroup";
  take(LeftBy(root));
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    if (!line.starts_with("0::/")) continue;
    for (fs::path group = line.substr(4); !group.empty(); group = group.parent_path())
      take(LeftBy(root / group));
  }
  return least;
}

void RequireMemory(const std::string& what, uint64_t bytes) {
  const std::optional<uint64_t> available = AvailableMemory();
  if (available && bytes > *available)
    throw InputError(fmt::format("{} would need about {:.1f} GB of memory; {:.1f} GB are available", what,
                                 double(bytes) * 1e-9, double(*available) * 1e-9));
}

}  // namespace raybench
