// What raybench's own structures promise beside: the answers of brute force, and that changes which change no answer
// change none (NUMERICS of raybench).
#include <cmath>

#include "accel/contract/structure.h"
#include "harness/fuzz/examiner.h"

namespace raybench::fuzz {
namespace {

/// The case with its geometry and rays changed.
template <class Point, class Size>
Case Mapped(Case c, const Point& point, const Size& size) {
  for (Vec3f& p : c.positions) p = point(p);
  for (Sphere& s : c.spheres) s.center = point(s.center), s.radius = size(s.radius);
  for (Cone& k : c.cones) {
    k.base = point(k.base), k.base_radius = size(k.base_radius);
    k.apex = point(k.apex), k.apex_radius = size(k.apex_radius);
  }
  for (rb_ray& r : c.rays) {
    const Vec3f org = point(LoadVec3(r.org)), dir = point(LoadVec3(r.dir));
    for (int k = 0; k < 3; ++k) r.org[k] = org[k], r.dir[k] = dir[k];
  }
  return c;
}

}  // namespace

const Contestant* Examiner::BruteLike() const {
  if (brute_) return brute_->structure != nullptr ? &*brute_ : nullptr;
  brute_.emplace();
  if (!registry_.OriginOf(*contestant_.structure).empty()) return nullptr;
  const std::string numerics = ParameterOf("numerics");
  if (numerics.empty()) return nullptr;
  brute_ = ParseContestant(registry_, "brute(numerics=" + numerics + ")");
  return &*brute_;
}

Text Examiner::IsBrute() {
  const Tree brute = Build(*BruteLike(), geometry_, {});
  for (uint32_t kind : {RB_CLOSEST, RB_ANY}) {
    const Question q = All(kind);
    if (auto text = Difference(q, kind == RB_CLOSEST ? Closest() : Any(), Ask(brute, q), "brute force"))
      return text;
  }
  for (size_t i : Hitting()) {
    if (!Can(RB_CAN_AFTER)) break;
    const std::vector<rb_hit>&walk = WalkOf(i), expected = Walk(brute, case_.rays[i], MostHits());
    for (size_t k = 0; k < std::max(walk.size(), expected.size()); ++k)
      if (k >= walk.size() || k >= expected.size() || !SameHit(walk[k], expected[k]))
        return fmt::format("{}: hit {} by `after` is {}, but of brute force {}", RayText(i), k,
                           k < walk.size() ? Describe(walk[k]) : "none",
                           k < expected.size() ? Describe(expected[k]) : "none");
  }
  return std::nullopt;
}

Text Examiner::SameAnswers(const Case& changed, const char* what,
                           const std::function<uint32_t(uint32_t)>& renamed, bool with_uv) {
  std::optional<Scene> scene;
  try {
    scene = SceneOf(changed);
  } catch (const InputError&) {
    return std::nullopt;  // out of range: nothing is promised
  }
  const Tree other = Build(contestant_, scene->Geometry(), {});
  Question q = All(RB_CLOSEST);
  q.rays = changed.rays;
  Answer answer = Ask(other, q);
  for (size_t i = 0; i < q.rays.size(); ++i) {
    rb_hit& hit = answer.hits[i];
    if (hit.prim != RAYBENCH_NONE) hit.prim = renamed(hit.prim);
    const rb_hit& mine = Closest().hits[i];
    const bool same = SameHit(hit, mine, with_uv);
    // Of two at the same t the lowest number wins, and numbers have changed.
    const bool tied = renamed(0) != 0 && hit.t == mine.t && hit.prim != mine.prim &&
                      hit.prim != RAYBENCH_NONE && mine.prim != RAYBENCH_NONE;
    if (!same && !tied)
      return fmt::format("{}: {}, but {}: {}", RayText(i), Describe(mine), what, Describe(hit));
  }
  return std::nullopt;
}

bool Examiner::IsInMiddle() const {
  bool middle = true;
  const auto look = [&](float x) { middle &= x == 0 || (std::fabs(x) > 0x1p-20f && std::fabs(x) < 0x1p20f); };
  Mapped(
      case_, [&](Vec3f p) { return look(p.x), look(p.y), look(p.z), p; },
      [&](float r) { return look(r), r; });
  for (const rb_ray& ray : case_.rays) look(ray.tnear);
  return middle;
}

Text Examiner::Scaled() {
  if (!IsInMiddle()) return std::nullopt;
  for (float scale : {0x1p7f, 0x1p-9f}) {
    const auto by = [&](auto x) { return x * scale; };
    if (auto text = SameAnswers(Mapped(case_, by, by), "scaled by a power of two", Unchanged, true))
      return text;
  }
  return std::nullopt;
}

Text Examiner::Turned() {
  if (!IsExact() || case_.primitives() > case_.triangles.size()) return std::nullopt;
  const auto same = [](float r) { return r; };
  const auto turn = [](Vec3f p) { return Vec3f{p.y, p.z, p.x}; };
  if (auto text = SameAnswers(Mapped(case_, turn, same), "with axes exchanged", Unchanged, false))
    return text;
  const auto mirror = [](Vec3f p) { return Vec3f{-p.x, p.y, p.z}; };
  return SameAnswers(Mapped(case_, mirror, same), "mirrored", Unchanged, false);
}

Text Examiner::Renumbered() {
  Case changed = case_;
  std::reverse(changed.triangles.begin(), changed.triangles.end());
  const uint32_t n = uint32_t(case_.triangles.size());
  return SameAnswers(
      changed, "with triangles in reverse order",
      [n](uint32_t prim) { return prim < n ? n - 1 - prim : prim; }, true);
}

Text Examiner::Added() {
  Case changed = case_;
  const Bounds3 box = scene_.bounds();
  if (box.Empty()) return std::nullopt;
  const float size = std::max({box.Extent().x, box.Extent().y, box.Extent().z}), far = 4 * size;
  if (!(far > 0) || !(std::fabs(box.lo.x) + far < 0x1p29f)) return std::nullopt;
  Case alone;
  for (float side : {-1.0f, 1.0f}) {
    const Vec3f at = {side < 0 ? box.lo.x - far : box.hi.x + far, box.lo.y - far, box.hi.z + far};
    for (Case* c : {&changed, &alone}) {
      const uint32_t first = uint32_t(c->positions.size());
      for (Vec3f p : {at, Vec3f{at.x + side * size, at.y, at.z}, Vec3f{at.x, at.y - size, at.z}})
        c->positions.push_back(p);
      c->triangles.push_back({first, first + 1, first + 2});
    }
  }
  // Numbers of what follows the triangles change.
  const uint32_t n = uint32_t(case_.triangles.size());
  try {
    const Scene scene = SceneOf(alone);
    const Tree brute = Build(*BruteLike(), scene.Geometry(), {});
    for (uint8_t occluded : Ask(brute, All(RB_ANY)).occluded)
      if (occluded != 0) return std::nullopt;
  } catch (const InputError&) {
    return std::nullopt;
  }
  return SameAnswers(
      changed, "with triangles that no ray meets", [n](uint32_t prim) { return prim < n ? prim : prim - 2; },
      true);
}

}  // namespace raybench::fuzz
