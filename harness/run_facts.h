// What run.json says of scenes, structures and options.
#pragma once

#include "accel/registry.h"
#include "datasets/scene.h"
#include "harness/plan.h"
#include "harness/results.h"

namespace raybench {

Json FactsOf(const Scene& scene);
Json FactsOf(const Contestant& contestant, const Registry& registry);
Json FactsOf(const RunOptions& options);
/// How times were taken; samples last about `sample_seconds`.
Json TimingFacts(const RunOptions& options, double sample_seconds);

}  // namespace raybench
