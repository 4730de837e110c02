#include "harness/fuzz/asking.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <limits>

#include "accel/base/float_state.h"

namespace raybench::fuzz {
namespace {

/// What no structure answers: arrays are filled with it before.
constexpr rb_hit kUnwritten = {std::numeric_limits<float>::quiet_NaN(), 0, 0, 0xA5A5A5A5u};
constexpr uint8_t kUnwrittenByte = 0xA5;

bool IsUnwritten(const rb_hit& hit) { return std::memcmp(&hit, &kUnwritten, sizeof hit) == 0; }

/// Without the flags that say which exceptions have happened.
unsigned ControlState() {
#if defined(__SSE__)
  return _mm_getcsr() & ~0x3Fu;
#else
  return 0;
#endif
}

bool SameBits(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }

}  // namespace

Answer Ask(const Tree& tree, const Question& question) {
  const size_t n = question.rays.size();
  Answer answer;
  // One more than asked about, to see that it stays.
  answer.hits.assign(question.kind == RB_CLOSEST ? n + 1 : 0, kUnwritten);
  answer.occluded.assign(question.kind == RB_ANY ? n + 1 : 0, kUnwrittenByte);
  answer.counts.resize(question.counted ? n : 0);
  const unsigned state = ControlState();
  for (size_t first = 0; first < n;) {
    const size_t count = question.batch == 0 ? n : std::min(question.batch, n - first);
    rb_query query = {};
    query.struct_size = sizeof query, query.kind = question.kind, query.n = count;
    query.rays = question.rays.data() + first;
    if (!question.skip.empty()) query.skip = question.skip.data() + first;
    if (!question.after.empty()) query.after = question.after.data() + first;
    if (question.kind == RB_CLOSEST) query.hits = answer.hits.data() + first;
    if (question.kind == RB_ANY) query.occluded = answer.occluded.data() + first;
    if (question.counted) query.counts = answer.counts.data() + first;
    question.counted ? tree.QueryCounted(query) : tree.Query(query);
    first += count;
    const bool kept = question.kind == RB_CLOSEST ? IsUnwritten(answer.hits[first])
                                                  : answer.occluded[first] == kUnwrittenByte;
    if (!kept && answer.flaw.empty())
      answer.flaw = fmt::format("asked about {} rays, it writes the answer behind the last one, too", count);
  }
  if (ControlState() != state && answer.flaw.empty())
    answer.flaw = "a query leaves another floating-point state (MXCSR) behind";
  if (question.kind == RB_CLOSEST) answer.hits.resize(n);
  if (question.kind == RB_ANY) answer.occluded.resize(n);
  for (size_t i = 0; i < n && answer.flaw.empty(); ++i)
    if (question.kind == RB_CLOSEST ? IsUnwritten(answer.hits[i]) : answer.occluded[i] == kUnwrittenByte)
      answer.flaw = fmt::format("ray {} of {} ({}) gets no answer", i, n, Describe(question.rays[i]));
  return answer;
}

bool SameHit(const rb_hit& a, const rb_hit& b, bool with_uv) {
  return a.prim == b.prim && SameBits(a.t, b.t) &&
         (!with_uv || a.prim == RAYBENCH_NONE || (SameBits(a.u, b.u) && SameBits(a.v, b.v)));
}

std::string Describe(const rb_hit& hit) {
  return hit.prim == RAYBENCH_NONE
             ? fmt::format("no hit (t {})", hit.t)
             : fmt::format("primitive {} at t {} (u {}, v {})", hit.prim, hit.t, hit.u, hit.v);
}

std::string Describe(const rb_ray& r) {
  return fmt::format("org {} {} {} dir {} {} {} t in ({}, {}]", r.org[0], r.org[1], r.org[2], r.dir[0],
                     r.dir[1], r.dir[2], r.tnear, r.tfar);
}

std::optional<std::string> Difference(const Question& question, const Answer& a, const Answer& b,
                                      const std::string& what, bool with_uv) {
  for (size_t i = 0; i < question.rays.size(); ++i) {
    const std::string ray = fmt::format("ray {} ({})", i, Describe(question.rays[i]));
    if (question.kind == RB_CLOSEST && !SameHit(a.hits[i], b.hits[i], with_uv))
      return fmt::format("{}: {}, but {}: {}", ray, Describe(a.hits[i]), what, Describe(b.hits[i]));
    if (question.kind == RB_ANY && a.occluded[i] != b.occluded[i])
      return fmt::format("{}: occluded {}, but {}: {}", ray, a.occluded[i], what, b.occluded[i]);
  }
  return std::nullopt;
}

std::vector<rb_hit> Walk(const Tree& tree, rb_ray ray, size_t most, uint32_t skip) {
  std::vector<rb_hit> walk;
  Question question;
  question.rays = {ray}, question.after = {RAYBENCH_NONE}, question.skip = {skip};
  if (skip == RAYBENCH_NONE) question.skip.clear();
  while (walk.size() < most) {
    const rb_hit hit = Ask(tree, question).hits[0];
    if (hit.prim == RAYBENCH_NONE) break;
    walk.push_back(hit);
    question.rays[0].tnear = hit.t, question.after[0] = hit.prim;
    if (!(hit.t >= 0)) break;  // a tnear that may not be asked about
  }
  return walk;
}

}  // namespace raybench::fuzz
