// Every scene there is, small: what `raybench verify --all` takes.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace raybench {

struct SmallScenes {
  std::vector<std::string> names;        ///< generators first, each with one parameter; then models
  std::vector<std::string> not_fetched;  ///< small models that are not in the cache
};

/// Every generator, with the first whole-numbered parameter (its size, level, ...) as large as leaves it at
/// most `primitives`; every model that has at most `model_triangles`.
SmallScenes EverySmallScene(uint64_t primitives, uint64_t model_triangles);

}  // namespace raybench
