// Makers of rb_param, the description of a build parameter. `offset` is where it stands in the configuration:
// offsetof(Config, name). Ranges are inclusive; `flags` are RB_PARAM_*.
#pragma once

#include <cstddef>
#include <cstdint>

#include "accel/contract/raybench.h"

namespace raybench {

/// Stored as uint32_t, 0 or 1.
constexpr rb_param BoolParam(const char* name, const char* doc, size_t offset, bool by_default,
                             uint32_t flags = 0) {
  return {name, doc, RB_BOOL, flags, uint32_t(offset), 0, 0, 1, by_default ? 1.0 : 0.0, nullptr};
}

/// Stored as int64_t.
constexpr rb_param IntParam(const char* name, const char* doc, size_t offset, double lo, double hi,
                            double by_default, uint32_t flags = 0) {
  return {name, doc, RB_INT, flags, uint32_t(offset), 0, lo, hi, by_default, nullptr};
}

/// Stored as double.
constexpr rb_param FloatParam(const char* name, const char* doc, size_t offset, double lo, double hi,
                              double by_default, uint32_t flags = 0) {
  return {name, doc, RB_FLOAT, flags, uint32_t(offset), 0, lo, hi, by_default, nullptr};
}

/// Stored as uint32_t, the index of one of `choices`, which nullptr closes.
constexpr rb_param ChoiceParam(const char* name, const char* doc, size_t offset, const char* const* choices,
                               uint32_t by_default, uint32_t flags = 0) {
  return {name, doc, RB_CHOICE, flags, uint32_t(offset), 0, 0, 0, double(by_default), choices};
}

}  // namespace raybench
