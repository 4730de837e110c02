// Packets: up to 16 rays of a batch that follow each other and have directions of the same signs go through the tree
// together (Wald et al. 2001; Reshetov, Soupikov, Hurley 2005, "Multi-level ray tracing algorithm").
//
// At a node all children are tested at once against the interval of the rays' origins and reciprocal directions: by
// monotone rounding its t contain those of every single ray (SlabRay). A child that may be met is tested against all
// rays at once, a ray a lane. At a leaf each ray that meets its box tests the triangles as a single ray does. What is
// visited contains what a single ray visits, and traversal is conservative: answers are those of single rays.
//
// Rays that do not make a packet are traced by Interleaved.
#pragma once

#include <bit>
#include <new>
#include <utility>

#include "accel/bvh/binary_tree.h"
#include "accel/bvh/wide/interleaved.h"

namespace raybench {

/// Of WatertightTest, for trees of triangles with at least one node. Tree: a friend that is WideBvhOf.
template <class Tree, bool kAnyHit>
class Packets {
  static constexpr int kWidth = Tree::kChildren;
  static constexpr int kRays = 16;
  static constexpr size_t kFewest = 6;  // rays that are worth a packet
  using F = FloatN<kWidth>;             // children
  using R = FloatN<kRays>;              // rays

  struct Waiting {
    F entry;  // where the first ray may enter the children
    uint32_t node;
    unsigned children, rays;  // bits
  };
  struct Ray {
    union {
      SlabRay slab;
    };
    union {
      WatertightLanes lanes;
    };
    RayQuery query;
    rb_hit best;
    unsigned candidates;

    Ray() {}
  };

 public:
  Packets(const Tree& tree, const rb_query& query) : tree_(tree), query_(query) {}

  void Run() {
    size_t alone = 0, i = 0;  // rays from `alone` to i wait for others
    while (i < query_.n) {
      size_t n = Alike(i);
      if (n >= kFewest && (n = Gather(i, n)) >= kFewest) {
        TraceOthers(alone, i);
        Trace(n);
        for (size_t k = 0; k < n; ++k) Answer(i + k, rays_[k].best);
        alone = i + n;
      }
      i += std::max<size_t>(n, 1);
    }
    TraceOthers(alone, query_.n);
  }

 private:
  void TraceOthers(size_t begin, size_t end) const {
    if (begin == end) return;
    rb_query part = query_;
    part.n = end - begin, part.rays += begin;
    if (part.skip != nullptr) part.skip += begin;
    if (part.after != nullptr) part.after += begin;
    kAnyHit ? void(part.occluded += begin) : void(part.hits += begin);
    Interleaved<Tree, kAnyHit>(tree_, part).Run();
  }

  /// How many rays from `first` on have directions of the same signs.
  size_t Alike(size_t first) const {
    const auto signs = [&](size_t i) { return Mask(Load<Float4>(query_.rays[i].dir)) & 7u; };
    const size_t most = std::min<size_t>(kRays, query_.n - first);
    size_t n = 1;
    while (n < most && signs(first + n) == signs(first)) ++n;
    return n;
  }

  /// Takes `most` of them as long as they can be traced together; returns how many.
  size_t Gather(size_t first, size_t most) {
    size_t n = 0;
    for (; n < most; ++n) {
      Ray& r = rays_[n];
      const rb_ray& ray = query_.rays[first + n];
      new (&r.slab) SlabRay(ray, WatertightTest::kSlack);
      if (!IsValidRay(ray) || !MovedSlab::Fits(r.slab)) break;
      const Float4 near = r.slab.inv_near * tree_.NearWidening(WatertightTest::kSlack), far = r.slab.inv_far;
      if (n == 0) {
        org_lo_ = org_hi_ = r.slab.org, near_lo_ = near_hi_ = near, far_lo_ = far_hi_ = far;
      } else {
        org_lo_ = Smaller<4>(org_lo_, r.slab.org), org_hi_ = Larger<4>(org_hi_, r.slab.org);
        near_lo_ = Smaller<4>(near_lo_, near), near_hi_ = Larger<4>(near_hi_, near);
        far_lo_ = Smaller<4>(far_lo_, far), far_hi_ = Larger<4>(far_hi_, far);
      }
      for (unsigned a = 0; a < 3; ++a) org_[a][n] = r.slab.org[a], near_[a][n] = near[a], far_[a][n] = far[a];
      tnear_[n] = ray.tnear + 0.0f, tfar_[n] = ray.tfar;
      r.query.ray = ray;
      r.query.skip = query_.skip != nullptr ? query_.skip[first + n] : RAYBENCH_NONE;
      r.query.after = query_.after != nullptr ? query_.after[first + n] : RAYBENCH_NONE;
      r.best.t = ray.tfar, r.best.u = r.best.v = 0, r.best.prim = RAYBENCH_NONE;
    }
    return n;
  }

  /// The first n rays; the other lanes hold none, but numbers that do not disturb.
  void Trace(size_t n) {
    for (size_t k = n; k < kRays; ++k) {
      for (unsigned a = 0; a < 3; ++a)
        org_[a][k] = org_[a][0], near_[a][k] = near_[a][0], far_[a][k] = far_[a][0];
      tnear_[k] = tnear_[0], tfar_[k] = 0;
    }
    const unsigned signs = rays_[0].slab.signs;
    F near_org[3], near_lo[3], near_hi[3], far_org[3], far_lo[3], far_hi[3];
    R org[3], near[3], far[3];
    unsigned near_row[3], far_row[3];
    for (unsigned a = 0; a < 3; ++a) {
      const bool negative = (signs >> a & 1) != 0;
      near_row[a] = a + 3 * negative, far_row[a] = 2 * a + 3 - near_row[a];
      near_org[a] = Splat<F>(negative ? org_lo_[a] : org_hi_[a]);
      far_org[a] = Splat<F>(negative ? org_hi_[a] : org_lo_[a]);
      near_lo[a] = Splat<F>(near_lo_[a]), near_hi[a] = Splat<F>(near_hi_[a]);
      far_lo[a] = Splat<F>(far_lo_[a]), far_hi[a] = Splat<F>(far_hi_[a]);
      org[a] = Load<R>(org_[a]), near[a] = Load<R>(near_[a]), far[a] = Load<R>(far_[a]);
    }
    const R tnear = Load<R>(tnear_);
    const F first_tnear = Splat<F>(LeastOf(tnear));
    alive_ = (1u << n) - 1, has_lanes_ = 0;
    F last_tfar = Splat<F>(LastTfar());

    const auto meets_lanes = [&](const auto& node, unsigned rays, F& entry) {
      if ((rays & (rays - 1)) == 0) {  // its own numbers
        const unsigned k = unsigned(__builtin_ctz(rays));
        const auto t = [&](const unsigned(&row)[3], const float(&scale)[3][kRays], unsigned a) {
          return (node.Row(row[a]) - Splat<F>(org_[a][k])) * Splat<F>(scale[a][k]);
        };
        return Between(t(near_row, near_, 0), t(near_row, near_, 1), t(near_row, near_, 2), first_tnear,
                       t(far_row, far_, 0), t(far_row, far_, 1), t(far_row, far_, 2), Splat<F>(tfar_[k]),
                       entry);
      }
      const auto lower = [&](unsigned a) {
        const F d = node.Row(near_row[a]) - near_org[a];
        return Smaller<kWidth>(d * near_lo[a], d * near_hi[a]);
      };
      const auto upper = [&](unsigned a) {
        const F d = node.Row(far_row[a]) - far_org[a];
        return Larger<kWidth>(d * far_lo[a], d * far_hi[a]);
      };
      return Between(lower(0), lower(1), lower(2), first_tnear, upper(0), upper(1), upper(2), last_tfar,
                     entry);
    };
    const auto meets = [&](uint32_t ref, unsigned rays, F& entry) {
      const auto& node = tree_.NodeOf(ref);
      return node.WithChild(meets_lanes(node, rays, entry));
    };
    /// Rays that meet child i.
    const auto meeting = [&](uint32_t ref, unsigned i) {
      const auto& node = tree_.NodeOf(ref);
      const auto t = [&](unsigned row, R o, R scale) { return (Splat<R>(node.Plane(row, i)) - o) * scale; };
      R enter;
      return Between(t(near_row[0], org[0], near[0]), t(near_row[1], org[1], near[1]),
                     t(near_row[2], org[2], near[2]), tnear, t(far_row[0], org[0], far[0]),
                     t(far_row[1], org[1], far[1]), t(far_row[2], org[2], far[2]), Load<R>(tfar_), enter);
    };

    Waiting stack[kMaxTreeDepth];
    Waiting* top = stack;
    uint32_t node = 0;
    unsigned rays = alive_;
    F entry;
    unsigned children = meets(node, rays, entry);
    for (;;) {
      while (children == 0 || rays == 0) {
        if (top == stack) return;
        --top;
        node = top->node, entry = top->entry, rays = top->rays & alive_;
        children = top->children & LessEqual<kWidth>(entry, last_tfar);
      }
      const unsigned i = LaneOfLeast<kWidth>(entry, children);
      children &= ~(1u << i);
      const uint32_t ref = tree_.ChildOf(tree_.NodeOf(node), i);
      tree_.Prefetch(ref);
      const unsigned going = (rays & (rays - 1)) == 0 ? rays : rays & meeting(node, i);
      if (going == 0) continue;
      if (Tree::IsLeaf(ref)) {
        if (!TakeLeaf(ref, going)) continue;
        if constexpr (kAnyHit) {
          rays &= alive_;
        } else {
          last_tfar = Splat<F>(LastTfar());
          children &= LessEqual<kWidth>(entry, last_tfar);
        }
        continue;
      }
      top->entry = entry, top->node = node, top->children = children, top->rays = rays;
      top += children != 0;
      node = ref, rays = going;
      children = meets(node, rays, entry);
    }
  }

  /// Lanes in which an interval is not empty, and where it begins.
  template <class V>
  [[gnu::always_inline]] static unsigned Between(V nx, V ny, V nz, V tnear, V fx, V fy, V fz, V tfar,
                                                 V& begin) {
    constexpr int kLanes = kLanesOf<V>;
    begin = Larger<kLanes>(Larger<kLanes>(nx, ny), Larger<kLanes>(nz, tnear));
    const V end = Smaller<kLanes>(Smaller<kLanes>(fx, fy), Smaller<kLanes>(fz, tfar));
    return LessEqual<kLanes>(begin, end);
  }

  /// True if an answer changed.
  bool TakeLeaf(uint32_t ref, unsigned rays) {
    const auto& block = tree_.BlockOf(ref);
    for (unsigned left = rays & ~has_lanes_; left != 0; left &= left - 1) {
      Ray& r = rays_[__builtin_ctz(left)];
      new (&r.lanes) WatertightLanes(r.query, r.slab, RayShear(r.query.ray));
    }
    has_lanes_ |= rays;
    unsigned hit = 0;
    for (unsigned left = rays; left != 0; left &= left - 1) {
      const unsigned k = unsigned(__builtin_ctz(left));
      rays_[k].candidates = rays_[k].lanes.template Candidates<false>(block, kAllLanes<Tree::kLeafLanes>);
      hit |= unsigned(rays_[k].candidates != 0) << k;
    }
    if constexpr (kAnyHit) {
      for (unsigned left = hit; left != 0; left &= left - 1) {
        const unsigned k = unsigned(__builtin_ctz(left));
        rays_[k].candidates = rays_[k].lanes.template Candidates<true>(block, rays_[k].candidates);
        hit &= ~(unsigned(rays_[k].candidates == 0) << k);
      }
    }
    bool changed = false;
    for (; hit != 0; hit &= hit - 1) {
      const unsigned k = unsigned(__builtin_ctz(hit));
      Ray& r = rays_[k];
      if (!r.lanes.template Decide<kAnyHit>(block, r.candidates, r.query, r.slab, tree_.needs_uv_, r.best))
        continue;
      changed = true;
      tfar_[k] = r.best.t;
      if constexpr (kAnyHit) alive_ &= ~(1u << k);
    }
    return changed;
  }

  /// Of numbers that are not negative, whose bits have their order.
  static float LeastOf(R v) { return std::bit_cast<float>(Least<kRays>(IntN<kRays>(v))); }
  /// Of all rays; 0 if it is negative.
  float LastTfar() const {
    return std::bit_cast<float>(~Least<kRays>(~IntN<kRays>(Larger<kRays>(Load<R>(tfar_), R{}))));
  }
  void Answer(size_t i, const rb_hit& best) const {
    if constexpr (kAnyHit) {
      query_.occluded[i] = best.prim != RAYBENCH_NONE;
    } else {
      rb_hit& hit = query_.hits[i];
      hit.t = best.t, hit.u = best.u, hit.v = best.v, hit.prim = best.prim;
    }
  }

  const Tree& tree_;
  const rb_query query_;
  Float4 org_lo_, org_hi_, near_lo_, near_hi_, far_lo_, far_hi_;
  alignas(64) float org_[3][kRays], near_[3][kRays], far_[3][kRays], tnear_[kRays], tfar_[kRays];
  unsigned alive_, has_lanes_;  // bits
  Ray rays_[kRays];
};

}  // namespace raybench
