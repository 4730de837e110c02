// What run.json says of scenes, structures and options.
#pragma once

#include <optional>

#include "accel/host/builtin.h"
#include "accel/host/registry.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/needs.h"
#include "datasets/scene/scene.h"
#include "harness/base/json.h"
#include "harness/plan/plan.h"

namespace raybench {

Json FactsOf(const Scene& scene);
/// The object `needs`: each decision as {"needed", "why"}, then what the shape asks of float; null: there is
/// nothing to measure.
Json FactsOf(const SceneNeeds& needs, const Scene& scene, const SceneFacts& facts);
/// None for a plugin, of which no more is known than its table says.
std::optional<Kind> KindOf(const rb_structure& structure);
Json FactsOf(const Contestant& contestant, const Registry& registry);
Json FactsOf(const RunOptions& options);
/// How times were taken.
Json TimingFacts(const RunOptions& options);

}  // namespace raybench
