#include "accel/host/compatible.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

#include "accel/host/parameters.h"

namespace raybench {

std::string WhyIncompatible(const rb_structure& structure, const std::byte* config) {
  const auto value = [&](std::string_view name) {
    for (uint32_t i = 0; i < structure.param_count; ++i)
      if (name == structure.params[i].name) return FormatParameter(structure.params[i], config);
    return std::string();
  };
  if (value("fma") == "true") {  // accel/ray/study.h
    const std::string triangle = value("triangle");
    if (triangle == "exact") return "triangle=exact has no fused form for fma=true";
    if (triangle == "as_numerics" && value("numerics") == "exact")
      return "numerics=exact has no fused form for fma=true; choose a published `triangle`";
  }
  double cells = 1;
  for (const char* name : {"resolution_x", "resolution_y", "resolution_z"})
    if (const std::string n = value(name); !n.empty()) cells *= std::max(1.0, std::stod(n));
  if (cells >= 0x1p32) return fmt::format("{:.0f} cells are too many; fewer than 2^32 are allowed", cells);
  return {};
}

}  // namespace raybench
