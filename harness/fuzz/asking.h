// How the checks ask: every answer is seen to be written, and nothing behind the last one.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench::fuzz {

struct Question {
  uint32_t kind = RB_CLOSEST;
  std::vector<rb_ray> rays;
  std::vector<uint32_t> skip, after;  ///< empty, or one a ray
  bool counted = false;
  size_t batch = 0;  ///< rays of a call; 0: all
};

struct Answer {
  std::vector<rb_hit> hits;       ///< RB_CLOSEST
  std::vector<uint8_t> occluded;  ///< RB_ANY
  std::vector<rb_counts> counts;  ///< if counted
  std::string flaw;  ///< in words: something else was written, or the floating-point state changed
};

Answer Ask(const Tree& tree, const Question& question);

/// Prim and t to the bit, with_uv also u and v of hits.
bool SameHit(const rb_hit& a, const rb_hit& b, bool with_uv = true);
/// "primitive 3 at t 1.5 (u 0.1, v 0.2)", "no hit".
std::string Describe(const rb_hit& hit);
std::string Describe(const rb_ray& ray);
/// The first ray with another answer, in words: "ray 3 (...): A, but WHAT: B". Counts are not compared.
std::optional<std::string> Difference(const Question& question, const Answer& a, const Answer& b,
                                      const std::string& what, bool with_uv = true);

/// The hits of a ray in the order in which `after` walks them, at most `most`.
std::vector<rb_hit> Walk(const Tree& tree, rb_ray ray, size_t most, uint32_t skip = RAYBENCH_NONE);

}  // namespace raybench::fuzz
