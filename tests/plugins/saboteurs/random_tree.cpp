#include <atomic>

#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "random_tree";
  static constexpr const char* kDoc =
      "splits at random, with numbers that go on from tree to tree, and calls itself deterministic";
  static size_t LeftOf(size_t count, const rb_build_options&) {
    static std::atomic<uint32_t> state{1};
    const uint32_t next = state = state * 1664525u + 1013904223u;
    const size_t least = std::max<size_t>(1, count / 4);
    return least + (next >> 8) % (count - 2 * least + 1);
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
