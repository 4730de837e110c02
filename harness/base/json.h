// JSON as raybench writes it: keys stay in the order in which they were given.
#pragma once

#include <nlohmann/json.hpp>

namespace raybench {

using Json = nlohmann::ordered_json;

}  // namespace raybench
