// Suites of extremes: inputs that get worse along one axis, to see where answers begin to fail.
//
// A suite is a `const Suite kNAME` in a file of this folder, and found by that name. It lists the points of its axis and makes, for one of them, a
// scene (through Scene::Finish, so that what the scene model refuses is refused here too), rays, and what
// counts as a failure.
#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/extremes/all_suites.h"
#include "harness/truth/oracle.h"

namespace raybench::extremes {

/// A place on a suite's axis.
struct Point {
  double magnitude = 0;      ///< in the unit of the suite's axis
  std::string variant = {};  ///< names a series of its own; empty where the suite has one
  bool valid = true;         ///< claims must hold here; elsewhere failures are measured and break nothing
};

/// What an answer is judged by, besides the oracle's verdict.
using Judgement = std::function<bool(const Truth& truth, const rb_hit& hit)>;

/// One point made real.
struct Workload {
  Scene scene;
  std::vector<rb_ray> rays;  ///< valid ones (see IsValidRay)
  /// Whether an answer fails; empty: leaks and plain errors fail.
  Judgement fails = {};
  /// The suite's second measure; empty where it has none.
  Judgement second = {};
  bool second_on_odd_rays = false;  ///< the second measure looks at odd rays only, else at all
  /// When set, `rays` only lead to a surface. This turns rays and a tree's own hits into the rays that leave
  /// there, with what each skips (left empty: nothing), and these are judged and timed.
  std::function<void(const Scene& scene, std::span<const rb_hit> hits, std::vector<rb_ray>& rays,
                     std::vector<uint32_t>& skip)>
      leave = {};
  std::string note = {};  ///< what loading noticed
};

enum class Axis { kLogarithmic, kLinear };

struct Suite {
  const char *name, *doc;
  const char* axis_title;  ///< with its unit
  Axis axis;               ///< kLogarithmic may hold a zero, drawn apart
  const char* failure;     ///< what `fails` means, in words
  const char* second;      ///< what `second` means; null where there is none
  const char* range;       ///< where claims must hold, in words
  std::vector<Point> (*points)();
  /// `rays` is the number wanted; a suite may make fewer where one ray is dear. Throws InputError when the
  /// scene model refuses the input.
  Workload (*make)(const Point& point, uint64_t rays, uint64_t seed);
};

std::span<const Suite* const> Suites();
/// Throws InputError with the nearest known name.
const Suite& FindSuite(const std::string& name);
/// What is known to go wrong elsewhere and no suite covers, with the reason; for --list.
extern const char* const kNotCovered;

}  // namespace raybench::extremes
