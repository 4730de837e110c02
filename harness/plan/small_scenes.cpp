#include "harness/plan/small_scenes.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <stdexcept>

#include "accel/host/parameters.h"
#include "datasets/models/fetch.h"
#include "datasets/models/manifest.h"
#include "datasets/scene/scene.h"

namespace raybench {
namespace {

/// NAME(PARAMETER=VALUE), by bisection: sizes grow with that parameter.
std::string SmallSpec(const Generator& generator, uint64_t primitives) {
  const std::span<const rb_param> params(generator.params, generator.param_count);
  const auto size =
      std::find_if(params.begin(), params.end(), [](const rb_param& p) { return p.type == RB_INT; });
  if (size == params.end()) throw std::logic_error(fmt::format("generator {} has no size", generator.name));
  const auto with = [&](int64_t value) {
    const std::pair<std::string, std::string> values[] = {{size->name, std::to_string(value)}};
    return Configure(generator.name, params, generator.config_size, values);
  };
  auto lo = int64_t(size->lo), hi = int64_t(size->hi);
  while (lo < hi) {
    const int64_t middle = lo + (hi - lo + 1) / 2;
    if (generator.count(with(middle).data()) <= primitives) {
      lo = middle;
    } else {
      hi = middle - 1;
    }
  }
  return fmt::format("{}({}={})", generator.name, size->name, lo);
}

}  // namespace

SmallScenes EverySmallScene(uint64_t primitives, uint64_t model_triangles) {
  SmallScenes scenes;
  for (const Generator* generator : Generators()) scenes.names.push_back(SmallSpec(*generator, primitives));
  for (const ManifestEntry& entry : Manifest()) {
    if (entry.triangles > model_triangles) continue;
    (IsFetched(entry) ? scenes.names : scenes.not_fetched).push_back(entry.name);
  }
  return scenes;
}

}  // namespace raybench
