#include "tests/plugins/saboteurs/bvh.h"

using namespace raybench;
using namespace raybench::saboteurs;

namespace {

struct Fault : HonestBvh {
  static constexpr const char* kName = "visitor_shows_nothing";
  static constexpr const char* kDoc = "shows no node of its tree";
  static constexpr bool kShowsNodes = false;
};

}  // namespace

RAYBENCH_PLUGIN(Bvh<Fault>)
