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
    return 1 + (next >> 8) % (count - 1);
  }
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
