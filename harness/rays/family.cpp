#include "harness/rays/family.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "accel/base/error.h"
#include "accel/host/names.h"

namespace raybench {
namespace {

std::string Label(const RayFamily& family) {
  return std::string(family.name) + (family.numbered ? ".N" : "");
}

/// "shadow" and "shadow.12" name the numbered family shadow.
bool Names(std::string_view name, const RayFamily& family) {
  if (name == family.name) return true;
  const size_t length = std::string_view(family.name).size();
  return family.numbered && name.starts_with(family.name) && name.size() > length + 1 &&
         name.size() <= length + 3 && name[length] == '.' &&
         name.find_first_not_of("0123456789", length + 1) == std::string_view::npos;
}

}  // namespace

void CheckFamilyNames(const char* option, const std::vector<std::string>& names,
                      std::span<const RayFamily> families) {
  for (const std::string& name : names) {
    if (std::any_of(families.begin(), families.end(), [&](const RayFamily& f) { return Names(name, f); }))
      continue;
    std::vector<std::string_view> known;
    std::vector<std::string> labels;
    for (const RayFamily& family : families) {
      known.push_back(family.name);
      labels.push_back(Label(family));
    }
    const std::string_view kind = std::string_view(name).substr(0, name.find('.'));
    const bool numbered =
        std::any_of(families.begin(), families.end(), [](const RayFamily& f) { return f.numbered; });
    throw InputError(fmt::format("{}: unknown ray set '{}'{}; allowed are {}{}", option, name,
                                 DidYouMean(kind, known), fmt::join(labels, ", "),
                                 numbered ? ", N being the depth, or none for all" : ""));
  }
}

std::string FormatFamilies(std::span<const RayFamily> families) {
  std::string text;
  for (const RayFamily& family : families) text += fmt::format("  {:<18} {}\n", Label(family), family.doc);
  return text;
}

}  // namespace raybench
