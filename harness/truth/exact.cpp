#include "harness/truth/exact.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "harness/truth/verdict.h"

namespace raybench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// The t at which a line meets a curved surface are the roots of a t^2 - 2 h t + c, which is negative inside.
/// Between the rims: 0 <= along + climb t <= length.
template <class T>
struct Quadratic {
  T a, h, c, along{}, climb{}, length{};
};

/// f: the ray's origin from the sphere's centre.
template <class T>
Quadratic<T> SphereQuadratic(Vec3<T> f, Vec3<T> d, T radius) {
  return {Dot(d, d), -Dot(f, d), Dot(f, f) - radius * radius};
}

/// f: the ray's origin from the cone's base. All times |axis|^4 to avoid divisions.
template <class T>
Quadratic<T> ConeQuadratic(Vec3<T> f, Vec3<T> d, Vec3<T> axis, T base_radius, T apex_radius) {
  const T n = Dot(axis, axis), along = Dot(f, axis), climb = Dot(d, axis);
  const T widening = apex_radius - base_radius;
  const T r0 = base_radius * n + widening * along, r1 = widening * climb;
  return {n * (n * Dot(d, d) - climb * climb) - r1 * r1,
          -(n * (n * Dot(f, d) - along * climb) - r0 * r1),
          n * (n * Dot(f, f) - along * along) - r0 * r0,
          along,
          climb,
          n};
}

Vec3<Approx> ToApprox(Vec3d v) { return {{v.x}, {v.y}, {v.z}}; }
Vec3<Approx> Difference(Vec3d a, Vec3d b) {
  return {Approx::Difference(a.x, b.x), Approx::Difference(a.y, b.y), Approx::Difference(a.z, b.z)};
}

int LowestBit(Vec3f v) {
  return std::min({raybench::LowestBit(v.x), raybench::LowestBit(v.y), raybench::LowestBit(v.z)});
}
int LowestBit(const rb_ray& ray) {
  return std::min(LowestBit(LoadVec3(ray.org)), LowestBit(LoadVec3(ray.dir)));
}
Vec3<Int> ToInt(Vec3f v, int shift) {
  return {raybench::ToInt(v.x, shift), raybench::ToInt(v.y, shift), raybench::ToInt(v.z, shift)};
}

/// A ray against a sphere or cone in integers. Lengths and directions are counted in the same unit, which
/// leaves t alone.
struct ExactCurve {
  Quadratic<Int> q;
  Int radicand;
  bool has_rims;

  ExactCurve(const rb_ray& ray, const Sphere& s) : has_rims(false) {
    const int shift = -std::min({LowestBit(ray), LowestBit(s.center), raybench::LowestBit(s.radius)});
    q = SphereQuadratic<Int>(ToInt(LoadVec3(ray.org), shift) - ToInt(s.center, shift),
                             ToInt(LoadVec3(ray.dir), shift), raybench::ToInt(s.radius, shift));
    radicand = q.h * q.h - q.a * q.c;
  }
  ExactCurve(const rb_ray& ray, const Cone& c) : has_rims(true) {
    const int shift = -std::min({LowestBit(ray), LowestBit(c.base), LowestBit(c.apex),
                                 raybench::LowestBit(c.base_radius), raybench::LowestBit(c.apex_radius)});
    const Vec3<Int> base = ToInt(c.base, shift);
    q = ConeQuadratic<Int>(ToInt(LoadVec3(ray.org), shift) - base, ToInt(LoadVec3(ray.dir), shift),
                           ToInt(c.apex, shift) - base, raybench::ToInt(std::fabs(c.base_radius), shift),
                           raybench::ToInt(std::fabs(c.apex_radius), shift));
    radicand = q.h * q.h - q.a * q.c;
  }

  bool RayLiesInIt() const { return q.a.is_zero() && q.h.is_zero() && q.c.is_zero(); }

  /// Where the ray enters (-1) or leaves (+1) the endless surface; a tangent does both at once.
  std::optional<Surd> Root(int side) const {
    if (radicand.sign() < 0) return {};
    if (!q.a.is_zero()) return Surd(q.h, side, radicand, q.a);
    if (q.h.is_zero() || side != -q.h.sign()) return {};
    return Surd(q.c, Int(2 * q.h));
  }
  /// How far the surface is followed at t: interior, or edge at a rim, or none beyond the rims.
  std::optional<Feature> RimsAt(const Surd& t) const {
    if (!has_rims) return Feature::kInterior;
    const Int along = q.along * t.a + q.climb * t.h, climb = q.climb * t.s;
    const int above = SignOf(along, climb, t.q),
              below = SignOf(Int(q.length * t.a - along), Int(-climb), t.q);
    if (above < 0 || below < 0) return {};
    return above == 0 || below == 0 ? Feature::kEdge : Feature::kInterior;
  }
  /// For a ray that lies in the surface: between the rims at some t of its interval?
  bool Overlaps(const rb_ray& ray) const {
    const Surd bottom(Int(-q.along), q.climb), top(Int(q.length - q.along), q.climb);
    const Surd &first = q.climb.sign() > 0 ? bottom : top, &last = q.climb.sign() > 0 ? top : bottom;
    return Compare(last, Surd(ray.tnear)) > 0 && Compare(first, Surd(LastT(ray))) <= 0;
  }
};

ExactCurve MakeExactCurve(const Scene& scene, const rb_ray& ray, uint32_t prim) {
  const auto [kind, i] = scene.Locate(prim);
  return kind == PrimKind::kSphere ? ExactCurve(ray, scene.spheres[i]) : ExactCurve(ray, scene.cones[i]);
}

/// Whether t lies in (tnear, tfar]: 1, -1, or 0 if unknown.
int InInterval(const rb_ray& ray, Approx t) {
  if (t.lo() > ray.tnear && t.hi() <= LastT(ray)) return 1;
  return t.hi() <= ray.tnear || t.lo() > LastT(ray) ? -1 : 0;
}
bool InInterval(const rb_ray& ray, const Surd& t) {
  return Compare(t, Surd(ray.tnear)) > 0 && Compare(t, Surd(LastT(ray))) <= 0;
}

Approx Rounded(const Surd& t) {
  const double v = Round<double>(t);
  return Approx::Rounded(v, 0);
}

BoxTree MakeTree(const Scene& scene, uint32_t first) {
  std::vector<BoxTree::Box> boxes(scene.primitive_count() - first);
  for (size_t i = 0; i < boxes.size(); ++i) {
    BoxTree::Box& box = boxes[i];
    const auto ball = [&](Vec3f center, float radius) {
      const double r = std::fabs(radius);
      box.Extend(ToDouble(center) - Vec3d{r, r, r});
      box.Extend(ToDouble(center) + Vec3d{r, r, r});
    };
    const auto corners = [&](std::span<const uint32_t> vertices) {
      for (uint32_t v : vertices) box.Extend(ToDouble(scene.positions[v]));
    };
    const auto [kind, index] = scene.Locate(uint32_t(first + i));
    switch (kind) {
      case PrimKind::kTriangle:
        corners(scene.triangles[index]);
        break;
      case PrimKind::kSphere:
        ball(scene.spheres[index].center, scene.spheres[index].radius);
        break;
      case PrimKind::kCone:
        ball(scene.cones[index].base, scene.cones[index].base_radius);
        ball(scene.cones[index].apex, scene.cones[index].apex_radius);
        break;
      case PrimKind::kPolygon:
        corners(scene.CornersOf(scene.polygons[index]));
    }
  }
  return BoxTree(boxes);
}

/// A hit beyond this cannot round to the same float as one at or before t.
double RoundsBefore(double t) { return t + 0x1p-22 * std::fabs(t) + 0x1p-148; }

}  // namespace

ExactTruth::ExactTruth(const Scene& scene, uint32_t first)
    : scene_(scene), first_(first), tree_(MakeTree(scene, first)) {
  faces_.reserve(scene.polygons.size());
  for (const Polygon& polygon : scene.polygons) faces_.push_back(MakeFace(polygon));
}

void ExactTruth::Meet(const rb_ray& ray, uint32_t prim, Meetings& found) const {
  switch (scene_.Locate(prim).kind) {
    case PrimKind::kTriangle:
      return MeetTriangle(ray, prim, found);
    case PrimKind::kSphere:
    case PrimKind::kCone:
      return MeetCurved(ray, prim, found);
    case PrimKind::kPolygon:
      return MeetPolygon(ray, prim, found);
  }
}

ExactTruth::Meetings ExactTruth::Find(const rb_ray& ray, double limit, bool nearest) const {
  Meetings found;
  if (!(ray.tnear < LastT(ray))) return found;
  size_t seen = 0;
  tree_.Traverse({ToDouble(LoadVec3(ray.org)), ToDouble(LoadVec3(ray.dir)), 0x1p-40}, ray.tnear, limit,
                 [&](uint32_t i) {
                   Meet(ray, first_ + i, found);
                   for (; nearest && seen < found.all.size(); ++seen)
                     limit = std::min(limit, RoundsBefore(found.all[seen].t.hi()));
                   return limit;
                 });
  std::erase_if(found.all, [&](const Meeting& m) { return m.t.lo() > limit; });
  return found;
}

Surd ExactTruth::Exact(const rb_ray& ray, const Meeting& meeting) const {
  const auto [kind, i] = scene_.Locate(meeting.prim);
  if (kind == PrimKind::kTriangle) return ExactTriangle(ray, i);
  if (kind == PrimKind::kPolygon) return *ExactPolygon(ray, i);
  return *MakeExactCurve(scene_, ray, meeting.prim).Root(meeting.side);
}

void ExactTruth::Join(const rb_ray& ray, Truth& truth) const {
  Meetings found = Find(ray, truth.hit ? std::min<double>(ray.tfar, RoundsBefore(truth.t)) : ray.tfar, true);
  truth.coplanar = truth.coplanar || found.coplanar;
  if (found.all.empty()) return;
  std::sort(found.all.begin(), found.all.end(), [](const Meeting& a, const Meeting& b) {
    return a.prim != b.prim ? a.prim < b.prim : a.side < b.side;
  });
  double nearest = truth.hit ? Approx::Rounded(truth.t, 0).hi() : kInfinity;
  for (const Meeting& m : found.all) nearest = std::min(nearest, m.t.hi());
  std::optional<Surd> best;
  if (truth.hit) best = ExactTriangle(ray, truth.tied[0]);
  for (const Meeting& m : found.all) {
    if (m.t.lo() > nearest) continue;
    int order = -1;
    if (truth.tied.empty() || !AreCopies(truth.tied.back(), m.prim)) {
      Surd t = Exact(ray, m);
      if (best) order = Compare(t, *best);
      if (order < 0) {
        best = std::move(t);
        truth.tied.clear();
        truth.feature = m.feature;
      }
    } else {
      order = 0;
    }
    if (order <= 0 && (truth.tied.empty() || truth.tied.back() != m.prim)) truth.tied.push_back(m.prim);
  }
  const uint32_t first_before = truth.first;
  const float before = truth.t_rounded;
  truth.t = Round<double>(*best);
  truth.t_rounded = AnswerableT(Round<float>(*best), ray);
  truth.first = truth.hit && before == truth.t_rounded ? first_before : truth.tied.front();
  for (const Meeting& m : found.all) {
    if (m.prim >= truth.first) break;
    const float lo = float(m.t.lo()), hi = float(m.t.hi());
    if (AnswerableT(lo == hi ? lo : Round<float>(Exact(ray, m)), ray) == truth.t_rounded)
      truth.first = m.prim;
  }
  truth.hit = true;
}

// --- Triangles

exact::Corners ExactTruth::Triangle(uint32_t prim) const {
  const auto& v = scene_.triangles[prim];
  return {ToDouble(scene_.positions[v[0]]), ToDouble(scene_.positions[v[1]]),
          ToDouble(scene_.positions[v[2]])};
}

Surd ExactTruth::ExactTriangle(const rb_ray& ray, uint32_t prim) const {
  return Surd(exact::PlaneRatio(exact::Line(ray), Triangle(prim)));
}

bool ExactTruth::AreCopies(uint32_t a, uint32_t b) const {
  if (std::max(a, b) >= scene_.triangles.size()) return false;
  const exact::Corners p = Triangle(a), q = Triangle(b);
  return std::is_permutation(p.begin(), p.end(), q.begin());
}

void ExactTruth::MeetTriangle(const rb_ray& ray, uint32_t prim, Meetings& found) const {
  const exact::Line line(ray);
  const exact::Corners p = Triangle(prim);
  const exact::Meeting meeting = exact::Meet(line, p);
  if (meeting == exact::Meeting::kNone) return;
  if (meeting == exact::Meeting::kInPlane) {
    found.coplanar = found.coplanar || exact::MeetsInPlane(line, p, ray.tnear, ray.tfar);
    return;
  }
  const auto [v, e] = exact::PlaneApproximate(line, p);
  Approx t{v, e};
  int decision = InInterval(ray, t);
  if (decision == 0) {
    const Surd surd = ExactTriangle(ray, prim);
    t = Rounded(surd);
    decision = InInterval(ray, surd) ? 1 : -1;
  }
  if (decision < 0) return;
  found.all.push_back({prim, 0,
                       meeting == exact::Meeting::kInterior ? Feature::kInterior
                       : meeting == exact::Meeting::kEdge   ? Feature::kEdge
                                                            : Feature::kVertex,
                       t});
}

// --- Spheres and cones

void ExactTruth::MeetCurved(const rb_ray& ray, uint32_t prim, Meetings& found) const {
  const auto [kind, i] = scene_.Locate(prim);
  const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
  // Starting where the ray is nearest to the middle, at t = start, distance does not cancel.
  Quadratic<Approx> q;
  double start;
  bool has_rims = false, inside_only;
  const auto moved_from = [&](Vec3d point) {
    const Vec3<Approx> f = Difference(o, point);
    return f + ToApprox(d) * Approx{start};
  };
  if (kind == PrimKind::kSphere) {
    const Sphere& s = scene_.spheres[i];
    start = Dot(ToDouble(s.center) - o, d) / Dot(d, d);
    inside_only = s.radius < 0;
    q = SphereQuadratic<Approx>(moved_from(ToDouble(s.center)), ToApprox(d), {s.radius});
  } else {
    const Cone& c = scene_.cones[i];
    const Vec3d base = ToDouble(c.base), apex = ToDouble(c.apex);
    start = Dot((base + apex) * 0.5 - o, d) / Dot(d, d);
    has_rims = true;
    inside_only = c.base_radius < 0 || c.apex_radius < 0;
    q = ConeQuadratic<Approx>(moved_from(base), ToApprox(d), Difference(apex, base),
                              {std::fabs(c.base_radius)}, {std::fabs(c.apex_radius)});
  }
  const Approx radicand = q.h * q.h - q.a * q.c;
  if (radicand.Sign() < 0) return;

  std::optional<ExactCurve> exact;
  const Approx root = radicand.Sign() > 0 ? Sqrt(radicand) : Approx{0, kInfinity};
  for (const int side : {-1, 1}) {
    if (side < 0 && inside_only) continue;
    // Of (h + side sqrt) / a and c / (h - side sqrt) the one that does not cancel.
    const Approx signed_root = side < 0 ? -root : root;
    const Approx step = (q.h.v >= 0) == (side > 0) ? (q.h + signed_root) / q.a : q.c / (q.h - signed_root);
    const Approx t = step + Approx{start}, above = q.along + q.climb * step, below = q.length - above;
    int decision = InInterval(ray, t);
    if (has_rims) {
      if (above.Sign() < 0 || below.Sign() < 0) continue;
      if (above.Sign() == 0 || below.Sign() == 0) decision = std::min(decision, 0);
    }
    if (decision < 0) continue;
    if (decision > 0) {
      found.all.push_back({prim, side, Feature::kInterior, t});
      continue;
    }
    if (!exact) {
      exact = MakeExactCurve(scene_, ray, prim);
      if (exact->RayLiesInIt()) {
        found.coplanar = found.coplanar || exact->Overlaps(ray);
        return;
      }
    }
    const std::optional<Surd> surd = exact->Root(side);
    if (!surd || !InInterval(ray, *surd)) continue;
    if (const auto feature = exact->RimsAt(*surd))
      found.all.push_back({prim, side, *feature, Rounded(*surd)});
  }
}

// --- Polygons

ExactTruth::Face ExactTruth::MakeFace(const Polygon& polygon) const {
  const auto corners = scene_.CornersOf(polygon);
  const auto at = [&](size_t i) { return scene_.positions[corners[i % corners.size()]]; };
  Face face;
  face.lo = face.hi = at(0);
  int low = std::numeric_limits<int>::max();
  for (size_t i = 0; i < corners.size(); ++i) {
    face.lo = Min(face.lo, at(i));
    face.hi = Max(face.hi, at(i));
    low = std::min(low, LowestBit(at(i)));
  }
  face.shift = -low;
  face.normal_int = face.sum = {0, 0, 0};
  Vec3<Approx> offsets{};
  for (size_t i = 0; i < corners.size(); ++i) {
    const Vec3<Int> a = ToInt(at(i), face.shift);
    face.sum = face.sum + a;
    face.normal_int = face.normal_int + Cross(a, ToInt(at(i + 1), face.shift));
    const Vec3<Approx> here = Difference(ToDouble(at(i)), ToDouble(at(0))),
                       next = Difference(ToDouble(at(i + 1)), ToDouble(at(0)));
    offsets = offsets + here;
    face.normal = face.normal + Cross(here, next);
  }
  const Approx count{double(corners.size())};
  face.offset = {offsets.x / count, offsets.y / count, offsets.z / count};
  return face;
}

/// Two coordinates across the ray are u = x dz - z dx and v = y dz - z dy where z is the axis along which the
/// ray is longest; edges that cross u = 0 at v > 0 are counted. u1 v2 - u2 v1 is dz times exact::SideOf().
std::optional<Feature> ExactTruth::Outline(const rb_ray& ray, const Polygon& polygon) const {
  const exact::Line line(ray);
  const Vec3d o = line.org, d = line.dir;
  int z = 0;
  for (int k = 1; k < 3; ++k)
    if (std::fabs(d[k]) > std::fabs(d[z])) z = k;
  const int x = (z + 1) % 3, y = (z + 2) % 3;
  const auto sign_across = [&](Vec3d p, int k) {
    const double first = (p[k] - o[k]) * d[z], second = (p[z] - o[z]) * d[k], value = first - second;
    if (std::fabs(value) > 8 * exact::kEps * (std::fabs(first) + std::fabs(second)))
      return value > 0 ? 1 : -1;
    return (exact::Difference(p[k], o[k]) * d[z] - exact::Difference(p[z], o[z]) * d[k]).Sign();
  };
  const auto corners = scene_.CornersOf(polygon);
  Vec3d a = ToDouble(scene_.positions[corners.back()]);
  int side_a = sign_across(a, x);
  bool inside = false;
  std::optional<Feature> feature;
  for (const uint32_t vertex : corners) {
    const Vec3d b = ToDouble(scene_.positions[vertex]);
    const int side_b = sign_across(b, x);
    if (side_a * side_b <= 0) {
      const int turn = exact::SideOf(line, a, b) * (d[z] > 0 ? 1 : -1);
      if (turn == 0) {
        const int v_a = sign_across(a, y), v_b = sign_across(b, y);
        if ((side_a == 0 && v_a == 0) || (side_b == 0 && v_b == 0)) return Feature::kVertex;
        if (v_a * v_b <= 0) feature = Feature::kEdge;
      } else if ((side_a > 0) != (side_b > 0)) {
        inside ^= (turn > 0) == (side_a > 0);
      }
    }
    a = b;
    side_a = side_b;
  }
  if (inside && !feature) feature = Feature::kInterior;
  return feature;
}

void ExactTruth::MeetPolygon(const rb_ray& ray, uint32_t prim, Meetings& found) const {
  const uint32_t index = scene_.Locate(prim).index;
  const auto feature = Outline(ray, scene_.polygons[index]);
  if (!feature) return;
  const Face& face = faces_[index];
  const Vec3d o = ToDouble(LoadVec3(ray.org)), d = ToDouble(LoadVec3(ray.dir));
  const Vec3d corner = ToDouble(scene_.positions[scene_.CornersOf(scene_.polygons[index])[0]]);
  const Approx toward = Dot(face.normal, ToApprox(d));
  Approx t = Dot(face.normal, Difference(corner, o) + face.offset) / toward;
  // Clamped to the box; the error of a clamped value is no more than that of the three it is made from.
  Approx near{-kInfinity}, far{kInfinity};
  for (int k = 0; k < 3; ++k) {
    if (d[k] == 0) continue;
    Approx t0 = Approx::Difference(face.lo[k], o[k]) / Approx{d[k]},
           t1 = Approx::Difference(face.hi[k], o[k]) / Approx{d[k]};
    if (d[k] < 0) std::swap(t0, t1);
    near = {std::max(near.v, t0.v), std::max(near.e, t0.e)};
    far = {std::min(far.v, t1.v), std::max(far.e, t1.e)};
  }
  t = {std::clamp(t.v, std::min(near.v, far.v), far.v), std::max({t.e, near.e, far.e})};
  int decision = toward.Sign() == 0 ? 0 : InInterval(ray, t);
  if (decision == 0) {
    const auto surd = ExactPolygon(ray, index);
    if (!surd) {
      found.coplanar = found.coplanar || (near.lo() <= ray.tfar && far.hi() > ray.tnear);
      return;
    }
    t = Rounded(*surd);
    decision = InInterval(ray, *surd) ? 1 : -1;
  }
  if (decision > 0) found.all.push_back({prim, 0, *feature, t});
}

std::optional<Surd> ExactTruth::ExactPolygon(const rb_ray& ray, uint32_t index) const {
  const Face& face = faces_[index];
  const int shift = std::max(face.shift, -LowestBit(ray)), finer = shift - face.shift;
  const auto scaled = [&](const Vec3<Int>& v, int by) {
    return Vec3<Int>{Int(v.x << by), Int(v.y << by), Int(v.z << by)};
  };
  const Vec3<Int> o = ToInt(LoadVec3(ray.org), shift), d = ToInt(LoadVec3(ray.dir), shift);
  const Int count = scene_.polygons[index].count;
  const Int toward = Dot(face.normal_int, d),
            away = Dot(face.normal_int, Vec3<Int>(scaled(face.sum, finer) - o * count));
  if (toward.is_zero() && away.is_zero()) return {};

  const Vec3<Int> lo = ToInt(face.lo, shift), hi = ToInt(face.hi, shift);
  std::optional<Surd> near, far;
  for (int k = 0; k < 3; ++k) {
    if (d[k].is_zero()) continue;
    Surd t0(Int(lo[k] - o[k]), d[k]), t1(Int(hi[k] - o[k]), d[k]);
    if (d[k].sign() < 0) std::swap(t0, t1);
    if (!near || Compare(t0, *near) > 0) near = t0;
    if (!far || Compare(t1, *far) < 0) far = t1;
  }
  if (toward.is_zero()) return near;
  const Surd t(away, Int(toward * count));
  return Compare(t, *near) < 0 ? *near : Compare(t, *far) > 0 ? *far : t;
}

}  // namespace raybench
