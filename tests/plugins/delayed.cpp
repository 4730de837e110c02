// A plugin that is slower by a known share: what `raybench check` must find. Each batch is answered, then the thread
// waits for RAYBENCH_TEST_DELAY (0.05: 5 %) of the CPU time that this took. The delay is no parameter, so that both
// programs of a comparison measure cases of the same name. RAYBENCH_TEST_EXTRA_VISIT=1 counts one node more for one
// ray in a thousand instead, at no cost of time.
#include <time.h>

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "accel/ray/primitive.h"

using namespace raybench;

namespace {

double Seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

double FromEnvironment(const char* name) {
  const char* text = std::getenv(name);
  return text != nullptr ? std::strtod(text, nullptr) : 0;
}

/// A binary tree, split at the median of the centres along the longest axis.
class Delayed {
 public:
  struct Config {
    int64_t leaf_size;
  };
  static constexpr const char* kName = "delayed";
  static constexpr const char* kDoc = "a test of raybench check: a binary tree, slower by a known share";
  static constexpr const char* kSource = "raybench's tests";
  static constexpr uint64_t kCapabilities = RB_CAN_COUNT | RB_DETERMINISTIC;
  static std::span<const rb_param> Params() {
    static const rb_param params[] = {
        IntParam("leaf_size", "primitives in a leaf", offsetof(Config, leaf_size), 1, 64, 4)};
    return params;
  }

  Delayed(const rb_geometry& geometry, const rb_build_options&, const Config& config) : geometry_(geometry) {
    for (uint32_t i = 0; i < geometry.triangle_count; ++i) prims_.push_back(i);
    Build(0, uint32_t(prims_.size()), uint32_t(config.leaf_size));
  }

  template <class Counter>
  void Query(const rb_query& query) const {
    const double begin = Seconds(CLOCK_THREAD_CPUTIME_ID);
    uint64_t rays = 0;
    ForEachRay<Counter>(query, [&](auto any, const RayQuery& q, rb_hit& best, Counter& counter) {
      if (extra_visit_ && rays++ % 1000 == 0) counter.Step(0);
      const RayState<WatertightTest> ray(q);
      uint32_t stack[64] = {0};
      for (int size = 1; size > 0;) {
        const Node& node = nodes_[stack[--size]];
        counter.Step(sizeof(Node));
        counter.Bounds(1);
        float tnear, tfar;
        ray.slab.Interval(node.box, tnear, tfar);
        if (!(std::max(tnear, q.ray.tnear) <= std::min(tfar, best.t))) continue;
        if (node.count == 0) {
          stack[size++] = node.first;
          stack[size++] = uint32_t(&node - nodes_.data()) + 1;
          continue;
        }
        counter.Leaf(false);
        counter.Prims(node.count, node.count * (sizeof(uint32_t[3]) + sizeof(float[3][3])));
        for (uint32_t i = 0; i < node.count; ++i)
          if (ray.Primitive(geometry_, prims_[node.first + i], best) && any.value) return;
      }
    });
    // Without a delay, too, the slow clock is read twice; the wait itself is by the quick one.
    const double wait = delay_ * (Seconds(CLOCK_THREAD_CPUTIME_ID) - begin);
    if (delay_ == 0) return;
    const double until = Seconds(CLOCK_MONOTONIC) + wait;
    while (Seconds(CLOCK_MONOTONIC) < until) {
    }
  }
  uint32_t Claims() const { return RB_CLAIM_WATERTIGHT; }
  MemoryUse Memory() const { return {nodes_.size() * sizeof(Node), prims_.size() * sizeof(uint32_t), true}; }

 private:
  struct Node {
    Bounds3 box;
    uint32_t first = 0, count = 0;  ///< of a leaf: its primitives; of an inner node: the second child, 0
  };

  /// The subtree over prims_[begin, end) behind the nodes that there are.
  void Build(uint32_t begin, uint32_t end, uint32_t leaf_size) {
    const uint32_t index = uint32_t(nodes_.size());
    nodes_.emplace_back();
    Bounds3 centres;
    for (uint32_t i = begin; i < end; ++i) {
      nodes_[index].box.Extend(PaddedPrimBounds(geometry_, prims_[i]));
      centres.Extend(Centre(prims_[i]));
    }
    if (end - begin <= leaf_size) {
      nodes_[index].first = begin;
      nodes_[index].count = end - begin;
      return;
    }
    const Vec3f size = centres.hi - centres.lo;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    const uint32_t middle = (begin + end) / 2;
    std::nth_element(prims_.begin() + begin, prims_.begin() + middle, prims_.begin() + end,
                     [&](uint32_t a, uint32_t b) {
                       const float at_a = Centre(a)[axis], at_b = Centre(b)[axis];
                       return at_a != at_b ? at_a < at_b : a < b;
                     });
    Build(begin, middle, leaf_size);
    nodes_[index].first = uint32_t(nodes_.size());
    Build(middle, end, leaf_size);
  }
  Vec3f Centre(uint32_t prim) const {
    const Bounds3 b = PrimBounds(geometry_, prim);
    return (b.lo + b.hi) * 0.5f;
  }

  rb_geometry geometry_;
  std::vector<uint32_t> prims_;
  std::vector<Node> nodes_;
  const double delay_ = FromEnvironment("RAYBENCH_TEST_DELAY");
  const bool extra_visit_ = FromEnvironment("RAYBENCH_TEST_EXTRA_VISIT") != 0;
};

}  // namespace

RAYBENCH_PLUGIN(Delayed)
