// What a structure promises, looked at on one case: every check by name, and what broke it.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/fuzz/case.h"

namespace raybench::fuzz {

/// Of whom something is asked.
enum class Demand {
  kAlways,        ///< the contract alone: of everybody
  kConservative,  ///< of trees that claim watertight or exact
  kOwn,           ///< of built-in structures that do, and use the shared tests: NUMERICS of raybench itself
};

struct CheckInfo {
  const char* name;
  Demand demand;
  const char* doc;          ///< what is promised, one line
  uint64_t capability = 0;  ///< RB_*: who does not have it promises nothing here
};
/// In the order in which they are looked at.
std::span<const CheckInfo> Checks();
/// Throws InputError that lists the names.
const CheckInfo& FindCheck(std::string_view name);

struct Finding {
  std::string check;
  std::string text;  ///< what broke the promise, in words, one line
};

struct Examination {
  std::string left_out;  ///< why the structure could not be asked: it does not take the scene, memory
  uint32_t claim = RB_CLAIM_NOTHING;
  std::vector<Finding> findings;       ///< one for each broken promise
  std::vector<std::string> looked_at;  ///< names of the checks that could be made
};

/// Builds and asks the case's structure; all checks, or the case's own where it names one. What it says
/// depends on nothing but the case, but for faults that do themselves. `on_check` is told the name of what
/// comes next. Throws InputError: a scene or structure that cannot be.
Examination Examine(const Registry& registry, const Case& c,
                    const std::function<void(const char* check)>& on_check = {});

}  // namespace raybench::fuzz
