// The table of suites.
#include <fmt/format.h>

#include "accel/host/names.h"
#include "harness/extremes/suite.h"

namespace raybench::extremes {

const char* const kNotCovered =
    "not here: bad_input (tests cover it), quantised_nodes (no structure has such nodes yet)";

std::span<const Suite* const> Suites() { return kAllSuites; }

const Suite& FindSuite(const std::string& name) {
  std::vector<std::string_view> known;
  for (const Suite* suite : Suites()) {
    if (name == suite->name) return *suite;
    known.push_back(suite->name);
  }
  throw InputError(
      fmt::format("unknown suite '{}'{}; see: raybench extremes --list", name, DidYouMean(name, known)));
}

}  // namespace raybench::extremes
