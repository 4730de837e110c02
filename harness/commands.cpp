#include "harness/commands.h"

#include <fmt/format.h>

#include <filesystem>
#include <optional>

namespace raybench {
namespace {

/// "64K" as a number, if it is one.
std::optional<uint64_t> ParseCount(std::string word) {
  try {
    uint64_t count = 0;
    if (CLI::AsSizeValue(false)(word).empty() && CLI::detail::lexical_cast(word, count)) return count;
  } catch (const CLI::ValidationError&) {  // no number, or an unknown unit
  }
  return std::nullopt;
}

}  // namespace

RayWords ReadRayWords(const std::vector<std::string>& words) {
  RayWords rays;
  for (const std::string& word : words) {
    std::error_code error;
    if (const std::optional<uint64_t> number = ParseCount(word)) {
      if (*number < 64 || *number > uint64_t{1} << 28)
        throw InputError(fmt::format("--rays {}: a number of rays lies between 64 and 2^28", word));
      rays.number = *number;
    } else if (std::filesystem::exists(word, error)) {
      rays.files.push_back(word);
    } else {
      throw InputError(fmt::format(
          "--rays {}: neither a number of rays (such as 64K or 1M) nor a .rays file or a folder of them",
          word));
    }
  }
  return rays;
}

}  // namespace raybench
