// Branches that stay branches.
#pragma once

namespace raybench {

/// Stands in each of two branches that differ only in what they load, and keeps the compiler from making one load by a
/// computed index of them. The processor then guesses where a ray goes on and asks for that node before it knows; the
/// index would have to wait for the node test, at every step.
[[gnu::always_inline]] inline void StayBranch() { asm volatile(""); }

}  // namespace raybench
