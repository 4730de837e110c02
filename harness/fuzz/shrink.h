// From a case that fails to the smallest one found that fails in the same way.
#pragma once

#include <functional>

#include "harness/fuzz/case.h"

namespace raybench::fuzz {

struct Shrunk {
  Case smallest;
  uint64_t tries = 0;
};

/// Leaves out rays and primitives (halves, quarters, ..., one at a time: delta debugging, Zeller and Hildebrandt
/// 2002), sets parameters to their defaults and intervals to all of the ray, then makes numbers short: 0,
/// integers, few digits. `fails` is asked about each candidate, which may be no scene at all. Ends when nothing
/// smaller fails, or `stop` says so.
Shrunk Shrink(const Case& failing, const std::function<bool(const Case&)>& fails,
              const std::function<bool()>& stop);

}  // namespace raybench::fuzz
