#include "harness/offset/search.h"

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstdlib>

#include "accel/base/parallel.h"
#include "harness/judge/ask.h"
#include "harness/measure/measure.h"
#include "harness/measure/statistics.h"
#include "harness/terminal/interrupt.h"
#include "tracer/surface.h"

namespace raybench {
namespace {

constexpr uint64_t kBlock = 4096;
/// Of the scan, of timing, and of the search for the range's ends.
constexpr uint64_t kScanned = 16384, kTimed = 65536, kSearched = 131072;
/// The scan takes powers of four, from the scene's diagonal down to 2^-kPowers of it.
constexpr int kPowers = 36, kStep = 2;
/// Both ends of the range are known to within this factor.
constexpr double kNear = 1.1;
constexpr int kPasses = 5;

/// Rounded to three digits, as it is printed and typed.
float Printable(double x) { return std::strtof(fmt::format("{:.3g}", x).c_str(), nullptr); }

bool IsSized(SelfIntersection cure) {
  return cure == SelfIntersection::kFixedTnear || cure == SelfIntersection::kNormalOffset;
}

/// A block of rays with the space for its answers.
struct Block {
  std::vector<rb_ray> rays;
  std::vector<uint32_t> skip;
  Answers answers{kBlock};

  void Ask(const Tree& tree) {
    const bool skips = std::any_of(skip.begin(), skip.end(), [](uint32_t s) { return s != RAYBENCH_NONE; });
    Question question{RB_CLOSEST, rays};
    if (skips) question.skip = skip;
    raybench::Ask(tree, question, answers, 1);
  }
};

}  // namespace

OffsetSearch::OffsetSearch(const Scene& scene, const Tree& tree, const LeavingTruth& truth,
                           std::span<const Departing> departing, uint32_t threads,
                           std::function<void(uint64_t)> work)
    : scene_(scene),
      tree_(tree),
      truth_(truth),
      departing_(departing),
      threads_(threads),
      work_(std::move(work)) {}

double OffsetSearch::InScene(float offset) const { return std::ldexp(double(offset), scene_.scale_exponent); }

uint64_t OffsetSearch::Count(SelfIntersection cure, float offset, Fault fault, uint64_t rays,
                             bool first_only) const {
  ThrowIfInterrupted();
  const double size = InScene(offset);
  const auto ray = [&](uint64_t i) -> const Departing& { return Picked(i, rays); };
  const auto count_block = [&](uint64_t begin, uint64_t end) {
    uint64_t count = 0;
    std::vector<Departed> departed;
    for (uint64_t i = begin; i < end; ++i) departed.push_back(Depart(scene_, ray(i), cure, size));
    if (fault == Fault::kLost) {
      for (uint64_t i = begin; i < end; ++i)
        count += truth_.LeapsOver(ray(i).At(), departed[i - begin].begin);
      return count;
    }
    Block block;
    for (const Departed& d : departed) block.rays.push_back(d.ray), block.skip.push_back(d.skip);
    block.Ask(tree_);
    for (uint64_t i = begin; i < end; ++i) {
      const uint32_t prim = block.answers.hits[i - begin].prim;
      count +=
          prim != RAYBENCH_NONE && truth_.IsSelfHit(ray(i).At(), departed[i - begin].begin, ray(i).dir, prim);
    }
    return count;
  };
  std::atomic<uint64_t> total = 0;
  Arena arena(threads_);
  arena.Run([&] {
    ParallelFor(uint64_t{0}, (rays + kBlock - 1) / kBlock, [&](uint64_t b) {
      if ((first_only && total.load() > 0) || Interrupted()) return;
      total += count_block(b * kBlock, std::min(rays, (b + 1) * kBlock));
    });
  });
  ThrowIfInterrupted();
  if (work_) work_(rays);
  return total;
}

Seen OffsetSearch::Look(SelfIntersection cure, float offset, uint64_t rays) const {
  return {offset, rays, Count(cure, offset, Fault::kSelfHit, rays, false),
          Count(cure, offset, Fault::kLost, rays, false)};
}

/// One end of the range: self-hits bound it from below, lost hits from above. The scan says where to begin. Rays
/// need not fail less with every step, since origins are rounded to float.
void OffsetSearch::FindRange(CureFindings& found, Fault fault, uint64_t rays) const {
  const auto any = [&](float offset) { return Count(found.cure, offset, fault, rays, true) > 0; };
  const bool low = fault == Fault::kSelfHit;
  const int step = low ? 1 : -1, n = int(found.scan.size());
  const auto fails = [&](const Seen& seen) { return (low ? *seen.self_hits : *seen.lost) > 0; };
  // The last that fails, seen from the safe end. Where hits are lost, rays also hit from behind what they leapt over.
  int i = 0;
  while (low && i + 1 < n && *found.scan[size_t(i + 1)].lost == 0) ++i;
  while (i >= 0 && i < n && !fails(found.scan[size_t(i)])) i -= step;
  std::optional<float> bad, good;
  if (i >= 0 && i < n) bad = found.scan[size_t(i)].offset;
  for (i = i < 0 ? 0 : i >= n ? n - 1 : i + step; i >= 0 && i < n && !good; i += step) {
    const float offset = found.scan[size_t(i)].offset;
    (any(offset) ? bad : good) = offset;
  }
  while (bad && good && std::max(*good / *bad, *bad / *good) > kNear) {
    const float middle = Printable(std::sqrt(double(*bad) * double(*good)));
    if (middle == *bad || middle == *good) break;
    (any(middle) ? bad : good) = middle;
  }
  const auto seen = [&](float offset, uint64_t count) {
    Seen s{offset, rays, {}, {}};
    (low ? s.self_hits : s.lost) = count;
    return s;
  };
  (low ? found.smallest_safe : found.largest_safe) = {};
  (low ? found.below : found.above) = {};
  if (good) (low ? found.smallest_safe : found.largest_safe) = seen(*good, 0);
  if (bad) (low ? found.below : found.above) = seen(*bad, Count(found.cure, *bad, fault, rays, false));
}

void OffsetSearch::Name(CureFindings& found) const {
  std::vector<float> tries;
  if (found.HasRange()) {
    const double lo = found.smallest_safe->offset, hi = found.largest_safe->offset;
    // A margin on either side, where there is room for it.
    for (double x : {std::min(2 * lo, std::sqrt(lo * hi)), std::sqrt(lo * hi), lo})
      tries.push_back(std::clamp(Printable(x), float(lo), float(hi)));
  } else {
    const auto faults = [](const Seen& s) { return *s.self_hits + *s.lost; };
    tries.push_back(std::min_element(found.scan.begin(), found.scan.end(), [&](const Seen& a, const Seen& b) {
                      return faults(a) < faults(b);
                    })->offset);
  }
  for (float offset : tries) {
    found.named = Look(found.cure, offset, departing_.size());
    if (found.named.Safe()) return;
  }
}

void OffsetSearch::MeasureWays(CureFindings& found) const {
  const double size = InScene(found.named.offset);
  found.shortest = std::numeric_limits<double>::infinity();
  const uint64_t rays = std::min<uint64_t>(kTimed, departing_.size());
  for (uint64_t i = 0; i < rays; ++i) {
    const Departing& departing = Picked(i, rays);
    const rb_hit hit{0, departing.u, departing.v, departing.prim};
    const double way =
        Length(Depart(scene_, departing, found.cure, size).begin - SurfaceAt(scene_, {}, hit).point);
    found.shortest = std::min(found.shortest, std::ldexp(way, -scene_.scale_exponent));
    found.longest = std::max(found.longest, std::ldexp(way, -scene_.scale_exponent));
  }
}

CureFindings OffsetSearch::Find(SelfIntersection cure) const {
  CureFindings found{.cure = cure, .sized = IsSized(cure)};
  if (found.sized) {
    const double diagonal = std::ldexp(Length(ToDouble(scene_.bounds().Extent())), -scene_.scale_exponent);
    for (int power = -kPowers; power <= 0; power += kStep)
      found.scan.push_back(Look(cure, Printable(std::ldexp(diagonal, power)),
                                std::min<uint64_t>(kScanned, departing_.size())));
    // All rays judge what is named; where that fails, all of them have to search.
    const uint64_t all = departing_.size(), some = std::min(kSearched, all);
    for (uint64_t rays = some;; rays = all) {
      FindRange(found, Fault::kSelfHit, rays);
      FindRange(found, Fault::kLost, rays);
      Name(found);
      if (found.named.Safe() || !found.HasRange() || rays == all) break;
    }
  } else {
    found.named = Look(cure, 0, departing_.size());
  }
  MeasureWays(found);
  return found;
}

uint64_t OffsetSearch::Work(SelfIntersection cure) const {
  const uint64_t n = departing_.size();
  return IsSized(cure)
             ? 2 * (kPowers / kStep + 1) * std::min(kScanned, n) + 14 * std::min(kSearched, n) + 2 * n
             : 2 * n;
}

void OffsetSearch::Time(std::span<CureFindings> findings) const {
  const uint64_t rays = std::min<uint64_t>(kTimed, departing_.size());
  std::vector<std::vector<double>> ns(findings.size());
  const Pinned pinned(true);
  Block block;
  for (int pass = 0; pass < kPasses; ++pass) {
    for (size_t i = 0; i < findings.size(); ++i) {
      ThrowIfInterrupted();
      const double size = InScene(findings[i].named.offset);
      const Stopwatch watch(/*process=*/false);
      for (uint64_t begin = 0; begin < rays; begin += kBlock) {
        block.rays.clear();
        block.skip.clear();
        for (uint64_t k = begin; k < std::min(rays, begin + kBlock); ++k) {
          const Departed departed = Depart(scene_, Picked(k, rays), findings[i].cure, size);
          block.rays.push_back(departed.ray);
          block.skip.push_back(departed.skip);
        }
        block.Ask(tree_);
      }
      ns[i].push_back(watch.Elapsed().cpu * 1e9 / double(rays));
    }
  }
  for (size_t i = 0; i < findings.size(); ++i) findings[i].ns_per_ray = MedianOf(ns[i]).median;
}

}  // namespace raybench
