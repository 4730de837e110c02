// "Parameter without effect?": contestants of different names that are the same thing.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/results/results.h"

namespace raybench {

struct Twins {
  std::string scene, a, b;              ///< specs
  std::vector<std::string> parameters;  ///< in which they differ; empty for different structures
};

/// Pairs whose trees have the same digest, and all of whose answers, closest-hit ones among them, have too, although
/// they differ in more than parameters of speed alone (RB_PARAM_SPEED_ONLY), and of one structure also take the same
/// memory: less of it is an effect. Where a tree is not shown, its memory stands for it. A benchmark that ignores a flag publishes such pairs as two results.
std::vector<Twins> FindTwins(std::span<const FinishedCase> cases, std::span<const Contestant> contestants);

/// "scene: a and b have the same tree and the same answers: has numerics no effect here?"
std::string Say(const Twins& twins);

}  // namespace raybench
