#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "stack_overflow";
  static constexpr const char* kDoc =
      "a stack of 16 entries for trees that get deeper: what does not fit is forgotten";
  static constexpr uint32_t kStack = 16;
  static size_t LeftOf(size_t count, const rb_build_options&) {
    return count - std::max<size_t>(1, count / 8);
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
