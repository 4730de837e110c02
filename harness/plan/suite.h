// Suites: what a run measures, as a TOML file. README.md has the keys.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench {

/// A suite; what its file does not say is as in the suite `default`.
struct Suite {
  std::string name, doc;
  std::string hash;                     ///< 16 hex digits over the text of its file
  std::vector<std::string> scenes;      ///< as on the command line; at least one
  std::vector<std::string> structures;  ///< as ChooseContestants() takes them; empty: one of each family
  std::vector<std::string> sets;        ///< ray sets to capture; empty: all
  std::vector<uint32_t> threads;        ///< ascending; empty: queries 1, builds 1 and all
  uint64_t rays = 1 << 17;              ///< of a set
  uint64_t verify_rays = 4096;          ///< of a set, compared with the truth
  uint64_t tree_samples = 1 << 14;      ///< triangles and lines behind end-point overlap and tightness
  uint64_t linear_tests = 1 << 25;      ///< a pass of a linear structure that tests more is left out
  uint64_t seed = 1;
  uint32_t repetitions = 9;      ///< samples of a case
  uint32_t fewest_samples = 3;   ///< of a case that its budget pays for fewer
  uint32_t depth = 2;            ///< bounces of the picture
  uint32_t heat_pixels = 256;    ///< across a heat map
  uint32_t processes = 1;        ///< one after the other, each takes all samples
  double sample_seconds = 0.04;  ///< budget of a case, a sample
  bool shuffled = false;         ///< also a shuffled copy of each traced set
};

/// A suite that comes with the program.
struct SuiteText {
  const char *name, *text;
};
std::span<const SuiteText> ShippedSuites();

/// Reads a shipped suite by name, or a file whose name ends in .toml. Throws InputError with one line: an
/// unknown name; or file, line and key, what is wrong and what is allowed. Plugins must have been loaded.
Suite ReadSuite(const Registry& registry, const std::string& name);

/// The same from text; `where` names it in errors, `name` in results.
Suite ParseSuite(const Registry& registry, const std::string& text, const std::string& where,
                 const std::string& name);

}  // namespace raybench
