// `raybench fuzz`: structures on random cases until a promise breaks, and the smallest case that shows it.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/fuzz/examine.h"
#include "harness/fuzz/generate.h"

namespace raybench::fuzz {

struct FoundFault;

struct FuzzOptions {
  std::vector<std::string> structures;  ///< names, or specifications whose parameters stay; empty: all
  std::vector<std::string> plugins;     ///< already loaded; for replay commands
  std::string mode = "both";
  std::string out;    ///< folder of RunFuzz; empty: fuzz_findings, if something is found
  std::string check;  ///< one alone; empty: all
  uint64_t seed = 1;
  uint64_t cases = 0;     ///< 0: as many as there is time for
  double seconds = 60;    ///< 0: as long as there are cases
  uint32_t jobs = 0;      ///< processes; 0: as many as there are processors
  uint64_t findings = 0;  ///< stop at so many; 0: go on
  bool shrink = true, quiet = false;
  bool scenes = false;  ///< first of all the standard cases (generate.h)
  /// Told of a fault as soon as it is found, when `smallest` is the case as it was found. May be empty.
  std::function<void(FoundFault&)> on_found;
};

/// A promise that one structure broke.
struct FoundFault {
  std::string structure, check, text;  ///< text: of the shrunk case
  uint64_t index = 0;                  ///< of the case in the campaign
  double seconds = 0;                  ///< since the start
  uint64_t cases = 0;                  ///< looked at by then
  bool repeats = false;                ///< alone in a new process it fails again
  Case smallest;
  size_t primitives_before = 0, rays_before = 0;
  uint64_t tries = 0;
  std::string file;  ///< where it was written
};

/// What one structure went through.
struct FuzzedStructure {
  std::string name;
  uint64_t cases = 0, left_out = 0, rays = 0;
  std::vector<uint64_t> looked_at;  ///< cases by check, in the order of Checks()
};

struct FuzzResult {
  std::vector<FuzzedStructure> structures;
  std::vector<FoundFault> faults;  ///< by structure, then in the order of Checks()
  double seconds = 0;
  bool interrupted = false;
};

/// Every structure in turn gets the next case, in children of this process. A crash, a hang of 20 s and memory
/// beyond 2 GiB are findings of the check that was at work. Which cases are looked at depends on the seed
/// alone, how many on time. Must be called while the process has one thread.
FuzzResult Fuzz(const Registry& registry, const FuzzOptions& options);

/// Looks whether `smallest` breaks fault.check in a new process (`repeats`), and if so and `shrink`, makes it as
/// small as 20 s allow. Must be called while the process has one thread.
void ShrinkFault(const Registry& registry, FoundFault& fault, bool shrink);

/// Examines the case in a child. Findings as Examine() has them; a crash is one of the check at work.
std::vector<Finding> ExamineIsolated(const Registry& registry, const Case& c, double seconds = 20,
                                     std::string* left_out = nullptr);

}  // namespace raybench::fuzz
