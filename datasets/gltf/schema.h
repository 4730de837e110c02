// Whether the JSON of a glTF file has the shape that the specification says.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace raybench {

/// Empty, or one line that names the first place that is wrong and what is allowed there: "accessors[3].count
/// is "24"; a whole number from 0 is needed". Looks at what raybench reads, and nothing else. Whole
/// numbers written as 3.0 become integers, as the specification allows. Refuses versions other than 2 and
/// extensions that change which triangles there are.
std::string CheckGltfSchema(nlohmann::json& root);

}  // namespace raybench
