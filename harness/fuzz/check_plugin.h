// `raybench check-plugin`: whether a plugin keeps the whole contract, on one page.
#pragma once

#include <cstdint>
#include <string>

namespace raybench::fuzz {

struct CheckPluginOptions {
  std::string plugin;
  double seconds = 60;  ///< of fuzzing, for each structure
  std::string out;      ///< folder for case files, check.json and junit.xml; empty: beside nothing but stdout
  uint64_t seed = 1;
  uint32_t jobs = 0;
};

/// Loads the plugin, puts its structures before aimed rays at standard scenes and then before random cases, and
/// prints for each what it promises, what held in how many cases, and what broke with the smallest case.
/// Returns 0 if everything held, 1 if something broke, a refusal to load among it; 130 interrupted. Throws
/// InputError if the file is not there.
int RunCheckPlugin(const CheckPluginOptions& options);

}  // namespace raybench::fuzz
