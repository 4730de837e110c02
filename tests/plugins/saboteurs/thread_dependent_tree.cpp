#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "thread_dependent_tree";
  static constexpr const char* kDoc =
      "splits so that each thread gets a part, and calls itself deterministic";
  static size_t LeftOf(size_t count, const rb_build_options& options) {
    return std::max<size_t>(1, count / (std::min(options.threads, 3u) + 1));
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
