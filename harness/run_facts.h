// What run.json says of scenes, structures and options.
#pragma once

#include "accel/registry.h"
#include "datasets/scene.h"
#include "datasets/scene_facts.h"
#include "datasets/scene_needs.h"
#include "harness/plan.h"
#include "harness/results.h"

namespace raybench {

Json FactsOf(const Scene& scene);
/// The object `needs`: each decision as {"needed", "why"}, then what the shape asks of float; null: there is
/// nothing to measure.
Json FactsOf(const SceneNeeds& needs, const Scene& scene, const SceneFacts& facts);
Json FactsOf(const Contestant& contestant, const Registry& registry);
Json FactsOf(const RunOptions& options);
/// How times were taken.
Json TimingFacts(const RunOptions& options);

}  // namespace raybench
