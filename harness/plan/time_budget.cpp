#include "harness/plan/time_budget.h"

#include <algorithm>
#include <cmath>

#include "accel/base/hash.h"
#include "accel/base/random.h"

namespace raybench {
namespace {

constexpr uint64_t kTile = 64;

}  // namespace

uint32_t TimeBudget::Samples(double each) const {
  if (fixed || repetitions <= fewest || each * repetitions <= seconds) return repetitions;
  return uint32_t(std::max<double>(fewest, std::floor(seconds / each)));
}

uint32_t LastStep(uint64_t rays, uint64_t least) {
  uint32_t step = 0;
  // Whole tiles: a quarter is rounded up.
  for (uint64_t tiles = (rays + kTile - 1) / kTile; (tiles + 3) / 4 * kTile >= least && tiles > 1; ++step)
    tiles = (tiles + 3) / 4;
  return step;
}

RaySet PartOf(const RaySet& set, uint32_t step, uint64_t seed) {
  const uint64_t n = set.rays.size();
  std::vector<uint64_t> tiles((n + kTile - 1) / kTile);
  for (uint64_t i = 0; i < tiles.size(); ++i) tiles[i] = i;
  Hash64 hash;
  hash.Add(std::string_view(set.hash));
  for (uint32_t s = 1; s <= step; ++s) {
    Random random(seed, hash.value() + s);
    std::vector<uint64_t> kept;
    for (uint64_t i = 0; i < tiles.size(); i += 4)
      kept.push_back(tiles[i + random.Below(std::min<uint64_t>(4, tiles.size() - i))]);
    tiles = std::move(kept);
  }
  RaySet part = set;
  if (step == 0) return part;
  part.rays.clear();
  for (uint64_t tile : tiles)
    part.rays.insert(part.rays.end(), set.rays.begin() + ptrdiff_t(tile * kTile),
                     set.rays.begin() + ptrdiff_t(std::min(n, (tile + 1) * kTile)));
  return part;
}

uint32_t StepFor(double seconds, uint32_t last_step, const TimeBudget& budget) {
  uint32_t step = 0;
  for (; step < last_step && seconds > budget.SampleSeconds(); ++step) seconds /= 4;
  return step;
}

SamplePlan PlanSamples(double pass_seconds, const TimeBudget& budget) {
  SamplePlan plan;
  const double pass = std::max(1e-7, pass_seconds);
  plan.passes =
      budget.passes > 0 ? budget.passes : uint64_t(std::max(1.0, std::round(budget.SampleSeconds() / pass)));
  plan.warm_up = budget.passes == 0 && pass < kLongPassSeconds;
  plan.sample_cost = pass * double(plan.passes + (plan.warm_up ? 1 : 0));
  plan.samples = budget.Samples(plan.sample_cost);
  return plan;
}

}  // namespace raybench
