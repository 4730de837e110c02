// How much memory there still is, so that what cannot fit is refused before work starts.
#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace raybench {

/// Bytes that this process can still take without swapping: the least of what the machine has available and
/// what the control groups around the process leave. Empty where the system does not tell.
std::optional<uint64_t> AvailableMemory();

/// Throws InputError if `what` ("soup(size=1000000000)") needs more than AvailableMemory().
void RequireMemory(const std::string& what, uint64_t bytes);

}  // namespace raybench
