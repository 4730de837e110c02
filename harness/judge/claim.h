// The last step of judging a tree: whether it keeps what it claims, in the words that all commands use.
#pragma once

#include <cstdint>
#include <string>

#include "harness/judge/verdicts.h"

namespace raybench {

/// "nothing", "inexact", "watertight", "exact".
const char* ClaimName(uint32_t claim);

/// What breaks the claim, such as "claims watertight, but of 4096 rays 3 leak, 1 wrong; ray 99: org ...": the
/// ray that `breaking` shows with all that replays it in a scene traced at 2^scale_exponent times its size,
/// the answer and the truth. Empty if nothing does.
std::string BrokenClaim(uint32_t claim, const VerdictCounts& counts,
                        const std::optional<JudgedAnswer>& breaking, int scale_exponent);

}  // namespace raybench
