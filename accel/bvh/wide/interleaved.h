// Interleaved traversal: one thread has several rays of a batch in flight, each with its own stack.
//
// A single ray waits for memory and for the chain from a node's boxes to the next node's address, and where it goes next,
// to a node or to a leaf, the processor often guesses wrong. Here a turn takes one step of each ray: of all that stand at
// nodes, then of all that stand at leaves. What a ray needs next is asked of the memory when its step ends and has arrived
// when its turn comes; the steps of one kind do not depend on each other; and few branches tell rays apart. (Wald, Benthin,
// Boulos 2008 and Barringer, Akenine-Moeller 2014, "Dynamic ray stream traversal", sort rays likewise.)
//
// Boxes, tests and order are those of a single ray, and so are the answers.
#pragma once

#include <new>
#include <utility>

#include "accel/bvh/binary_tree.h"
#include "accel/bvh/wide/ray.h"
#include "accel/contract/structure.h"
#include "accel/ray/primitive.h"

namespace raybench {

/// Of WatertightTest, for trees of triangles with at least one node. Tree: a friend that is WideBvhOf.
template <class Tree, bool kAnyHit>
class Interleaved {
  static constexpr int kWidth = Tree::kChildren;
  static constexpr size_t kRays = 16;  // in flight
  using F = FloatN<kWidth>;
  using Boxes = WideRay<kWidth, true, float>;

  struct Waiting {
    F entry;  // where the ray enters the children
    uint32_t node;
    unsigned children;  // bits
  };
  struct WaitingAny {
    uint32_t node;
    unsigned children;
  };

  /// A ray in flight.
  struct alignas(64) Flight {
    union {
      SlabRay slab;
    };
    union {
      Boxes boxes;
    };
    union {
      WatertightLanes lanes;
    };
    RayQuery query;
    size_t index;
    rb_hit best;
    uint32_t ref;         // the node or leaf where it stands
    unsigned candidates;  // of the leaf
    std::conditional_t<kAnyHit, WaitingAny, Waiting>*top, stack[kMaxTreeDepth];

    Flight() {}
    [[gnu::always_inline]] void Push(uint32_t node, F entry, unsigned children) {
      if constexpr (!kAnyHit) top->entry = entry;
      top->node = node, top->children = children;
      top += children != 0;
    }
  };

  struct List {
    size_t size = 0;
    Flight* flights[kRays + 1];

    /// Without a branch.
    [[gnu::always_inline]] void Add(Flight& f, bool really = true) { flights[size] = &f, size += really; }
  };

 public:
  Interleaved(const Tree& tree, const rb_query& query) : tree_(tree), query_(query) {
    for (Flight& f : flights_) free_.Add(f);
  }

  void Run() {
    for (;;) {
      Start();
      if (at_nodes_.size + at_leaves_.size == 0) return;
      const size_t n = std::exchange(at_nodes_.size, 0);
      for (size_t k = 0; k < n; ++k) StepNode(*at_nodes_.flights[k]);
      StepLeaves();
    }
  }

 private:
  /// Puts the next rays that meet children of the root in flight. Numbers are written and read in pieces of one size,
  /// for else the processor waits until they have reached the cache.
  void Start() {
    size_t started = 0;
    while (started < free_.size && next_ < query_.n) {
      Flight& f = *free_.flights[started];
      const size_t i = next_++;
      const rb_ray& ray = query_.rays[i];
      f.query.ray = ray;
      f.query.skip = query_.skip != nullptr ? query_.skip[i] : RAYBENCH_NONE;
      f.query.after = query_.after != nullptr ? query_.after[i] : RAYBENCH_NONE;
      f.index = i;
      f.best.t = ray.tfar, f.best.u = f.best.v = 0, f.best.prim = RAYBENCH_NONE;
      Answer(f);  // until there is another one
      new (&f.slab) SlabRay(ray, WatertightTest::kSlack);
      if (!IsValidRay(ray) || !MovedSlab::Fits(f.slab)) [[unlikely]] {
        if (IsValidRay(ray)) tree_.template TraceAlone<kAnyHit>(f.query, f.best), Answer(f);
        continue;
      }
      new (&f.boxes) Boxes(f.slab, tree_.NearWidening(WatertightTest::kSlack));
      F entry;
      const unsigned children = Meets(f, 0, entry);
      f.top = f.stack;
      f.Push(0, entry, children);
      started += children != 0;
    }
    for (size_t k = 0; k < started; ++k) {
      Flight& f = *free_.flights[k];
      new (&f.lanes) WatertightLanes(f.query, f.slab, RayShear(f.query.ray));
    }
    for (size_t k = 0; k < started; ++k) Advance(*free_.flights[k]);
    free_.size -= started;
    for (size_t k = 0; k < free_.size; ++k) free_.flights[k] = free_.flights[k + started];
  }

  [[gnu::always_inline]] unsigned Meets(const Flight& f, uint32_t ref, F& entry) const {
    const auto& node = tree_.NodeOf(ref);
    const F tnear = Splat<F>(f.query.ray.tnear + 0.0f), tfar = Splat<F>(f.best.t);
    return node.WithChild(f.boxes.Meets([&](unsigned row) { return node.Row(row); }, tnear, tfar, entry));
  }

  [[gnu::always_inline]] void StepNode(Flight& f) {
    F entry;
    const uint32_t ref = f.ref;
    const unsigned children = Meets(f, ref, entry);
    if constexpr (kAnyHit) {
      f.Push(ref, entry, children);
    } else if (children != 0) {
      const unsigned i = LaneOfLeast<kWidth>(entry, children);
      f.Push(ref, entry, children & ~(1u << i));
      Go(f, tree_.ChildOf(tree_.NodeOf(ref), i));
      return;
    }
    Advance(f);
  }

  void StepLeaves() {
    List hit;
    const auto look = [&](const List& list, size_t n, auto candidates) {
      for (size_t k = 0; k < n; ++k) {
        Flight& f = *list.flights[k];
        f.candidates = candidates(f, tree_.BlockOf(f.ref));
        hit.Add(f, f.candidates != 0);
      }
    };
    look(at_leaves_, at_leaves_.size, [](const Flight& f, const auto& block) {
      return f.lanes.template Candidates<false>(block, kAllLanes<Tree::kLeafLanes>);
    });
    if constexpr (kAnyHit) {
      look(hit, std::exchange(hit.size, 0), [](const Flight& f, const auto& block) {
        return f.lanes.template Candidates<true>(block, f.candidates);
      });
    }
    for (size_t k = 0; k < hit.size; ++k) {
      Flight& f = *hit.flights[k];
      f.lanes.template Decide<kAnyHit>(tree_.BlockOf(f.ref), f.candidates, f.query, f.slab, tree_.needs_uv_,
                                       f.best);
    }
    const size_t n = std::exchange(at_leaves_.size, 0);
    for (size_t k = 0; k < n; ++k) {
      Flight& f = *at_leaves_.flights[k];
      if (kAnyHit && f.best.prim != RAYBENCH_NONE) {
        Finish(f);
      } else {
        Advance(f);
      }
    }
  }

  /// On to the next child that waits.
  [[gnu::always_inline]] void Advance(Flight& f) {
    auto* top = f.top;
    unsigned children, i;
    do {
      if (top == f.stack) {
        Finish(f);
        return;
      }
      --top;
      children = top->children;
      if constexpr (!kAnyHit) children &= LessEqual<kWidth>(top->entry, Splat<F>(f.best.t));
    } while (!kAnyHit && children == 0);
    if constexpr (kAnyHit) {
      i = unsigned(__builtin_ctz(children));
    } else {
      i = LaneOfLeast<kWidth>(top->entry, children);
    }
    const uint32_t ref = tree_.ChildOf(tree_.NodeOf(top->node), i);
    children &= ~(1u << i);
    top->children = children;
    f.top = top + (children != 0);
    Go(f, ref);
  }
  [[gnu::always_inline]] void Go(Flight& f, uint32_t ref) {
    f.ref = ref;
    tree_.Prefetch(ref);
    const bool is_leaf = Tree::IsLeaf(ref);
    at_nodes_.Add(f, !is_leaf);
    at_leaves_.Add(f, is_leaf);
  }

  void Finish(Flight& f) {
    Answer(f);
    free_.Add(f);
  }
  [[gnu::always_inline]] void Answer(const Flight& f) const {
    if constexpr (kAnyHit) {
      query_.occluded[f.index] = f.best.prim != RAYBENCH_NONE;
    } else {
      rb_hit& hit = query_.hits[f.index];
      hit.t = f.best.t, hit.u = f.best.u, hit.v = f.best.v, hit.prim = f.best.prim;
    }
  }

  const Tree& tree_;
  const rb_query query_;
  size_t next_ = 0;
  List at_nodes_, at_leaves_, free_;
  Flight flights_[kRays];
};

}  // namespace raybench
