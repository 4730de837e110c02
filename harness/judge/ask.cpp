#include "harness/judge/ask.h"

#include <cstring>

#include "accel/base/hash.h"
#include "tracer/tracer.h"

namespace raybench {
namespace {

bool SameBits(float a, float b) { return std::memcmp(&a, &b, sizeof a) == 0; }

bool SameHit(const rb_hit& a, const rb_hit& b, bool has_uv) {
  if (a.prim != b.prim || !SameBits(a.t, b.t)) return false;
  return a.prim == RAYBENCH_NONE || !has_uv || (SameBits(a.u, b.u) && SameBits(a.v, b.v));
}

}  // namespace

rb_query Answers::To(const Question& question, rb_counts* counts) {
  rb_query query = {};
  query.struct_size = sizeof query;
  query.kind = question.query;
  query.n = question.rays.size();
  query.rays = question.rays.data();
  if (!question.skip.empty()) query.skip = question.skip.data();
  if (!question.after.empty()) query.after = question.after.data();
  query.hits = hits.data();
  query.occluded = occluded.data();
  query.counts = counts;
  return query;
}

void Ask(const Tree& tree, const Question& question, Answers& answers, uint32_t threads, rb_counts* counts) {
  const rb_query query = answers.To(question, counts);
  if (threads != 1) {
    QueryParallel(tree, query, threads);
  } else if (counts != nullptr) {
    tree.QueryCounted(query);
  } else {
    tree.Query(query);
  }
}

size_t FirstDifference(const Question& question, const Answers& a, const Answers& b) {
  size_t i = 0;
  while (i < question.rays.size() &&
         (question.query == RB_ANY ? a.occluded[i] == b.occluded[i]
                                   : SameHit(a.hits[i], b.hits[i], question.has_uv)))
    ++i;
  return i;
}

std::string DigestOf(const Question& question, const Answers& answers) {
  Hash64 digest;
  const size_t n = question.rays.size();
  if (question.query == RB_ANY) {
    digest.Add(answers.occluded.data(), n);
    return digest.Hex();
  }
  for (size_t i = 0; i < n; ++i) {
    const rb_hit& hit = answers.hits[i];
    digest.AddValue(hit.prim);
    digest.AddValue(hit.t);
    if (hit.prim == RAYBENCH_NONE || !question.has_uv) continue;
    digest.AddValue(hit.u);
    digest.AddValue(hit.v);
  }
  return digest.Hex();
}

}  // namespace raybench
