// JSON as raybench writes it: keys stay in the order in which they were given.
#pragma once

#include <nlohmann/json.hpp>
#include <string>

namespace raybench {

using Json = nlohmann::ordered_json;

/// A whole file. Text from files and plugins need not be UTF-8; invalid bytes are replaced.
inline std::string Dump(const Json& json) {
  return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace raybench
