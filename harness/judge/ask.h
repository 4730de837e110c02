// The first step of judging a tree: what it is asked, and where its answers go.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"

namespace raybench {

/// Rays and what is asked about them.
struct Question {
  uint32_t query = RB_CLOSEST;
  std::span<const rb_ray> rays;
  std::span<const uint32_t> skip = {}, after = {};  ///< as in rb_query, one a ray; empty: none
  bool has_uv = true;  ///< the tree was built with RB_NEED_UV: its u and v are judged
};

/// Where answers go; space that may be larger than the question.
struct Answers {
  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;

  Answers() = default;
  explicit Answers(size_t n) : hits(n), occluded(n) {}
  /// The question with its answers to go here, for callers that query a structure themselves.
  rb_query To(const Question& question, rb_counts* counts = nullptr);
};

/// Asks on so many threads (0: all), on one as a single batch. With `counts`, one a ray, counted. The answers
/// hold as many rays as the question, at least.
void Ask(const Tree& tree, const Question& question, Answers& answers, uint32_t threads,
         rb_counts* counts = nullptr);

/// The first ray that two trees, or one asked in two ways, answer differently; as many as there are rays if
/// all is the same to the bit.
size_t FirstDifference(const Question& question, const Answers& a, const Answers& b);

/// 16 hex digits over what FirstDifference() compares: answers with the same digest are the same.
std::string DigestOf(const Question& question, const Answers& answers);

}  // namespace raybench
