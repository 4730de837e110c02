// Private to the oracles: truth derived a second time.
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "harness/truth/oracle.h"

namespace raybench {

/// Derives the truth of one ray by CGAL's exact constructions (EPECK), sharing no arithmetic with Ask(): the
/// points where its line meets the triangles `near`, which must contain all triangles that it meets. Returns
/// what differs from `truth`, in words; empty if nothing does.
std::string AuditTruth(const Scene& scene, const rb_ray& ray, const Truth& truth,
                       std::span<const uint32_t> near);

}  // namespace raybench
