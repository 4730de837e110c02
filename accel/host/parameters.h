// Text <-> configuration block: "bvh_sah(numerics=fast,leaf_size=4)". Structures and procedural scenes are
// named the same way, so this serves both.
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "accel/base/error.h"
#include "accel/contract/raybench.h"

namespace raybench {

/// A name with its parameters, not yet checked against any description.
struct Spec {
  std::string name;
  std::vector<std::pair<std::string, std::string>> values;
};

/// Parses "name" or "name(key=value,...)". Throws InputError on malformed text or a key given twice.
Spec ParseSpec(std::string_view text);

/// Splits "a,b(x=1,y=2),c" at the commas outside parentheses; empty items are errors.
std::vector<std::string> SplitSpecs(std::string_view list);

/// A configuration block with every parameter at its default, then `values` applied.
/// `owner` names the structure or scene in errors. Unknown keys and values out of range throw InputError
/// listing what is allowed.
std::vector<std::byte> Configure(std::string_view owner, std::span<const rb_param> params, size_t config_size,
                                 std::span<const std::pair<std::string, std::string>> values);

/// One parameter's value as text that Configure() reads back to the same bits.
std::string FormatParameter(const rb_param& param, const std::byte* config);
/// All parameters, "key=value,..." in the order of their description: the canonical form behind case ids.
std::string FormatAllParameters(std::span<const rb_param> params, const std::byte* config);
/// name, or name(key=value,...) with only the parameters that differ from their defaults.
std::string FormatSpec(std::string_view name, std::span<const rb_param> params, const std::byte* config);

}  // namespace raybench
