// How a case keeps within its budget of time: which part of the rays is timed, and how often.
#pragma once

#include <cstdint>
#include <vector>

#include "tracer/rays/ray_set.h"

namespace raybench {

/// A sample longer than this fills the caches in a small part of itself and needs no untimed pass before it.
inline constexpr double kLongPassSeconds = 0.25;

/// What timing a case may take, and its samples.
struct TimeBudget {
  double seconds = 0;
  uint32_t repetitions = 1;  ///< samples
  bool fixed = false;        ///< take that many, whatever they cost
  uint32_t fewest = 3;       ///< a case that needs more time than its budget even for these gets it
  uint64_t passes = 0;       ///< of a sample, none before it, whatever they cost; 0: as many as fit

  /// Half of the budget is for samples, the other half for the untimed pass before each.
  double SampleSeconds() const { return seconds / (2 * repetitions); }
  /// As many samples as the budget pays at this price, within the limits above.
  uint32_t Samples(double each) const;
};

/// The ladder: step 0 is the whole set, each further one a quarter of the tiles of the step before, the last
/// the smallest with at least `least` rays. A tile is 64 rays in the set's order: 8 x 8 pixels where the
/// tracer made them.
uint32_t LastStep(uint64_t rays, uint64_t least);

/// The rays of a step, in the order of the set. Of each four neighbouring tiles of the step before one stays,
/// chosen by `seed` and the set's hash: so the part is spread evenly, and contained in every larger one. It
/// keeps what names the set; hash and counts stay those of the whole.
RaySet PartOf(const RaySet& set, uint32_t step, uint64_t seed);

/// The first step whose pass fits into a sample, when a pass over the whole set takes `seconds`.
uint32_t StepFor(double seconds, uint32_t last_step, const TimeBudget& budget);

/// What one sample consists of.
struct SamplePlan {
  uint64_t passes = 1;
  bool warm_up = true;     ///< one untimed pass before it
  uint32_t samples = 1;    ///< of the case
  double sample_cost = 0;  ///< expected seconds a sample, the untimed pass included
};
SamplePlan PlanSamples(double pass_seconds, const TimeBudget& budget);

}  // namespace raybench
