#include "accel/ray/study.h"

#include <new>
#include <stdexcept>
#include <type_traits>

namespace raybench {

/// How a test is called: into `state`, what depends on the ray; then block after block.
struct Study::Test {
  void (*prepare)(void* state, const RayQuery& query);
  bool (*take)(const void* state, const rb_geometry& geometry, const StudyBlock& block, bool any,
               rb_hit& best);
};

namespace {

using namespace published;

/// Procedural primitives are left to the arithmetic that the test's `numerics` gives them.
template <class T>
struct Calls {
  using State = RayState<T>;
  static_assert(sizeof(State) <= RayState<StudyTest>::kStateBytes && alignof(State) <= 64 &&
                std::is_trivially_destructible_v<State>);

  static void Prepare(void* state, const RayQuery& query) { new (state) State(query); }

  static bool One(const State& ray, const StudyBlock& block, uint32_t i, rb_hit& best) {
    if constexpr (requires(PrimHit hit) { ray.test.Intersect(block.maps[i], hit); }) {
      PrimHit hit;
      if (!ray.test.Intersect(block.maps[i], hit) || !ray.query.Accepts(hit.t, block.prim[i], best))
        return false;
      best = {hit.t, hit.u, hit.v, block.prim[i]};
      return true;
    } else {
      const auto corner = [&](uint32_t c) {
        const float* v = block.v + 3 * c * block.lanes + i;
        return Vec3f{v[0], v[block.lanes], v[2 * block.lanes]};
      };
      return ray.Triangle(corner(0), corner(1), corner(2), block.prim[i], best);
    }
  }
  static bool Take(const void* state, const rb_geometry& geometry, const StudyBlock& block, bool any,
                   rb_hit& best) {
    const State& ray = *static_cast<const State*>(state);
    bool changed = false;
    for (uint32_t i = 0; i < block.count; ++i) {
      const uint32_t prim = block.prim[i];
      changed |=
          prim < geometry.triangle_count ? One(ray, block, i, best) : ray.Primitive(geometry, prim, best);
      if (any && changed) return true;
    }
    return changed;
  }
  static constexpr Study::Test kTest = {&Prepare, &Take};
};

template <class R>
const Study::Test* Published(TriangleTest test) {
  switch (test) {
    case TriangleTest::kMollerTrumbore:
      return &Calls<MollerTrumbore<float, R>>::kTest;
    case TriangleTest::kMollerTrumboreDouble:
      return &Calls<MollerTrumbore<double, R>>::kTest;
    case TriangleTest::kBaldwinWeber:
      return &Calls<BaldwinWeber<R>>::kTest;
    case TriangleTest::kPluecker:
      return &Calls<Pluecker<R>>::kTest;
    case TriangleTest::kWoop:
      return &Calls<Woop<float, R>>::kTest;
    case TriangleTest::kWoopDouble:
      return &Calls<Woop<double, R>>::kTest;
    default:
      return nullptr;
  }
}

/// The published test whose arithmetic `numerics` is made from; as_numerics where there is none.
TriangleTest PublishedLike(Numerics numerics) {
  switch (numerics) {
    case Numerics::kFast:
      return TriangleTest::kMollerTrumbore;
    case Numerics::kWatertight:
      return TriangleTest::kWoop;
    case Numerics::kDouble:
      return TriangleTest::kWoopDouble;
    default:
      return TriangleTest::kAsNumerics;
  }
}

}  // namespace

Slack SlackOf(uint32_t numerics) {
  return WithNumerics(numerics, []<class T>() { return T::kSlack; });
}

Study::Study(uint32_t numerics, uint32_t triangle, bool fma, bool rules, double t_tolerance)
    : numerics_(numerics), reach_(float(1 / (1 + t_tolerance))) {
  rules = rules || t_tolerance > 0;
  TriangleTest choice{triangle};
  if (fma && choice == TriangleTest::kAsNumerics) choice = PublishedLike(Numerics(numerics));
  test_ = fma ? Published<Fused>(choice) : Published<Rounded>(choice);
  if (test_ == nullptr && fma) throw std::runtime_error("fma=true: exact arithmetic has no fused form");
  if (choice == TriangleTest::kExact) test_ = &Calls<ExactTest>::kTest;
  if (choice == TriangleTest::kAsNumerics && rules)
    WithNumerics(numerics, [&]<class T>() { test_ = &Calls<T>::kTest; });
  claims_ = choice == TriangleTest::kExact && Numerics(numerics) == Numerics::kExact && !rules;
}

uint32_t Study::Claim(const rb_geometry& geometry) const {
  return claims_ ? ClaimOf(numerics_, geometry) : uint32_t(RB_CLAIM_INEXACT);
}

bool Study::NeedsMaps() const {
  return test_ == &Calls<BaldwinWeber<Rounded>>::kTest || test_ == &Calls<BaldwinWeber<Fused>>::kTest;
}

Study::Map Study::MapOf(const rb_geometry& g, uint32_t prim) {
  if (prim >= g.triangle_count) return {};
  return Map::Of(Vertex(g, prim, 0), Vertex(g, prim, 1), Vertex(g, prim, 2));
}

RayState<StudyTest>::RayState(const Study& study, const RayQuery& q, const SlabRay& traversal)
    : query(q), slab(traversal), study_(study) {
  study.test().prepare(state_, q);
}

bool RayState<StudyTest>::Take(const rb_geometry& geometry, const StudyBlock& block, bool any,
                               rb_hit& best) const {
  return study_.test().take(state_, geometry, block, any, best);
}

}  // namespace raybench
