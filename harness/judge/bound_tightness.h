// How much of what hits a bound hits something in it.
#pragma once

#include <cstdint>
#include <optional>

#include "accel/host/registry.h"

namespace raybench {

/// P(primitive hit | bound hit): of random lines (isotropic, uniform in space) that meet the bounds of a leaf
/// which is not empty, the share that hit one of its primitives within these bounds; lines are weighted as
/// they come, so large leaves count more. The higher, the fewer primitives are tested in vain (Weghorst,
/// Hooper, Greenberg 1984 call the rest void area). Estimated with `samples` lines; its standard error is at
/// most 0.5 / sqrt(samples / 3). Absent when the structure shows no nodes, or ones of unknown shape.
std::optional<double> BoundTightness(const Tree& tree, const rb_geometry& geometry, uint64_t samples,
                                     uint64_t seed);

}  // namespace raybench
