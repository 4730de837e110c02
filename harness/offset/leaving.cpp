#include "harness/offset/leaving.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <optional>

#include "harness/truth/approx.h"
#include "harness/truth/surd.h"

namespace raybench {
namespace {

int SignOf(const Approx& x) { return x.Sign(); }  // 0: unknown
int SignOf(const Int& x) { return x.sign(); }

template <class T>
struct Triangle {
  std::array<Vec3<T>, 3> p;

  Vec3<T> Normal() const { return Cross(p[1] - p[0], p[2] - p[0]); }
  /// Above 0: on the side that Normal() points to.
  T Height(const Vec3<T>& x) const { return Dot(Normal(), x - p[0]); }
  T Climb(const Vec3<T>& dir) const { return Dot(Normal(), dir); }
};

/// All that a question is about, in one arithmetic. Integers count lengths in one unit, directions in another:
/// both leave signs alone.
template <class T>
struct Figures {
  Triangle<T> own, other;
  Vec3<T> spot, begin, dir;
  bool mirrored = false;  ///< the ray leaves against own.Normal()

  T Front(const T& height) const { return mirrored ? -height : height; }
};

std::array<Vec3f, 3> Corners(const Scene& scene, uint32_t prim) {
  const auto& [a, b, c] = scene.triangles[prim];
  return {scene.positions[a], scene.positions[b], scene.positions[c]};
}

Vec3<Approx> PointInDouble(Vec3d p) { return {{p.x}, {p.y}, {p.z}}; }

Triangle<Approx> InDouble(const Scene& scene, uint32_t prim) {
  const auto [a, b, c] = Corners(scene, prim);
  return {{PointInDouble(ToDouble(a)), PointInDouble(ToDouble(b)), PointInDouble(ToDouble(c))}};
}

/// But for the other triangle.
Figures<Approx> InDouble(const Scene& scene, const Spot& spot, Vec3d begin, Vec3f dir) {
  const Approx u{spot.u}, v{spot.v}, w = Approx{1} - u - v;
  Figures<Approx> f{InDouble(scene, spot.prim),   {},           {}, PointInDouble(begin),
                    PointInDouble(ToDouble(dir)), spot.side < 0};
  f.spot = f.own.p[0] * w + f.own.p[1] * u + f.own.p[2] * v;
  return f;
}

Figures<Int> InIntegers(const Scene& scene, const Spot& spot, Vec3d begin, Vec3f dir, uint32_t prim) {
  const auto shift_of = [](std::initializer_list<double> values) {
    int lowest = 0;
    for (double x : values) lowest = std::min(lowest, LowestBit(x));
    return -lowest;
  };
  const auto shift_of_point = [&](auto p) { return shift_of({double(p.x), double(p.y), double(p.z)}); };
  const int weights = shift_of({double(spot.u), double(spot.v)});
  int lengths = shift_of_point(begin);
  for (uint32_t i : {spot.prim, prim})
    for (Vec3f p : Corners(scene, i)) lengths = std::max(lengths, shift_of_point(p));
  const auto point = [](auto p, int shift) {
    return Vec3<Int>{ToInt(p.x, shift), ToInt(p.y, shift), ToInt(p.z, shift)};
  };
  const auto triangle = [&](uint32_t i, int shift) {
    const auto [a, b, c] = Corners(scene, i);
    return Triangle<Int>{{point(a, shift), point(b, shift), point(c, shift)}};
  };
  const Int u = ToInt(spot.u, weights), v = ToInt(spot.v, weights), w = ToInt(1, weights) - u - v;
  const int all = lengths + weights;
  Figures<Int> f{triangle(spot.prim, all),        triangle(prim, all), {}, point(begin, all),
                 point(dir, shift_of_point(dir)), spot.side < 0};
  const Triangle<Int> coarse = triangle(spot.prim, lengths);
  f.spot = coarse.p[0] * w + coarse.p[1] * u + coarse.p[2] * v;
  return f;
}

/// Of the line through spot and begin past the other triangle's edges: whether signs are there of both kinds,
/// and how many are not 0.
template <class T>
std::pair<bool, int> Edges(const Figures<T>& f) {
  bool above = false, below = false;
  int known = 0;
  for (int k = 0; k < 3; ++k) {
    const Vec3<T> from = f.other.p[size_t(k)] - f.spot, to = f.other.p[size_t(k + 1) % 3] - f.spot;
    const int sign = SignOf(Dot(Cross(from, to), f.begin - f.spot));
    above |= sign > 0;
    below |= sign < 0;
    known += sign != 0;
  }
  return {above && below, known};
}

std::optional<bool> Meets(const Figures<Approx>& f) {
  const int at_spot = SignOf(f.other.Height(f.spot)), at_begin = SignOf(f.other.Height(f.begin));
  if (at_spot * at_begin > 0) return false;
  const auto [beside, known] = Edges(f);
  if (beside) return false;
  if (at_spot * at_begin < 0 && known == 3) return true;
  return std::nullopt;
}

bool Meets(const Figures<Int>& f) {
  const int at_spot = SignOf(f.other.Height(f.spot)), at_begin = SignOf(f.other.Height(f.begin));
  return at_spot != 0 && at_spot != at_begin && !Edges(f).first;
}

/// The height over the plane that is left, at which the ray from begin meets the other's plane, times something
/// positive; that plane must be ahead.
template <class T>
T HeightOfHit(const Figures<T>& f) {
  const T climb = f.other.Climb(f.dir);
  const T height =
      f.Front(f.own.Height(f.begin)) * climb - f.other.Height(f.begin) * f.Front(f.own.Climb(f.dir));
  return SignOf(climb) < 0 ? -height : height;
}

/// What nearly all true hits have.
bool IsPlainlyNoSelfHit(const Figures<Approx>& f) {
  const int climb = SignOf(f.other.Climb(f.dir)), at_begin = SignOf(f.other.Height(f.begin)),
            at_spot = SignOf(f.other.Height(f.spot));
  if (!(climb * at_begin < 0 && at_spot * at_begin > 0) || SignOf(HeightOfHit(f)) <= 0) return false;
  for (const Vec3<Approx>& p : f.other.p)
    if (SignOf(f.Front(f.own.Height(p))) > 0) return true;
  return false;
}

bool IsSelfHit(const Figures<Int>& f) {
  bool in_front = false;
  for (const Vec3<Int>& p : f.other.p) in_front |= SignOf(f.Front(f.own.Height(p))) > 0;
  const bool ahead = SignOf(f.other.Height(f.begin)) * SignOf(f.other.Climb(f.dir)) < 0;
  return !in_front || !ahead || Meets(f) || SignOf(HeightOfHit(f)) <= 0;
}

}  // namespace

Spot SpotOf(uint32_t prim, float u, float v, double side) {
  u = std::clamp(u, 0.0f, 1.0f);
  v = std::clamp(v, 0.0f, 1.0f);
  const auto beyond = [&] {
    double error;
    const double sum = exact::TwoSum(u, v, error);
    return sum > 1 || (sum == 1 && error > 0);
  };
  if (beyond()) v = float(1 - double(u));
  if (beyond()) v = std::nextafter(v, 0.0f);
  return {prim, u, v, side};
}

WayTree::WayTree(const Scene& scene) : items_(scene.triangles.size()) {
  std::iota(items_.begin(), items_.end(), 0u);
  double farthest = 0;
  for (Vec3f p : scene.positions)
    for (int k = 0; k < 3; ++k) farthest = std::max(farthest, std::fabs(double(p[k])));
  // More than rounding takes of spots, ways and the tests of boxes.
  if (!items_.empty()) Split(scene, farthest * 0x1p-44, 0, uint32_t(items_.size()));
}

/// At the median of the widest axis.
void WayTree::Split(const Scene& scene, double pad, uint32_t first, uint32_t count) {
  constexpr uint32_t kLeaf = 2;
  Bounds3 box;
  for (uint32_t i = first; i < first + count; ++i)
    for (Vec3f p : Corners(scene, items_[i])) box.Extend(p);
  const Vec3d around = {pad, pad, pad};
  const size_t index = nodes_.size();
  nodes_.push_back({ToDouble(box.lo) - around, ToDouble(box.hi) + around, first, count});
  if (count <= kLeaf) return;
  const Vec3f extent = box.Extent();
  const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
  const auto place = [&](uint32_t i) {
    const auto [a, b, c] = Corners(scene, i);
    return std::pair(double(a[axis]) + b[axis] + c[axis], i);
  };
  const auto begin = items_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count,
                   [&](uint32_t a, uint32_t b) { return place(a) < place(b); });
  Split(scene, pad, first, count / 2);
  nodes_[index].count = 0;
  nodes_[index].first = uint32_t(nodes_.size());
  Split(scene, pad, first + count / 2, count - count / 2);
}

LeavingTruth::LeavingTruth(const Scene& scene) : scene_(scene), tree_(scene) {}

bool LeavingTruth::Leaves(const Spot& spot, Vec3f dir) const {
  const auto f = InDouble(scene_, spot, {0, 0, 0}, dir);
  if (const int sign = SignOf(f.Front(f.own.Climb(f.dir)))) return sign > 0;
  const auto exactly = InIntegers(scene_, spot, {0, 0, 0}, dir, spot.prim);
  return SignOf(exactly.Front(exactly.own.Climb(exactly.dir))) > 0;
}

bool LeavingTruth::LeapsOver(const Spot& spot, Vec3d begin) const {
  const auto [a, b, c] = Corners(scene_, spot.prim);
  const double u = spot.u, v = spot.v;
  const Vec3d at = ToDouble(a) * (1 - u - v) + ToDouble(b) * u + ToDouble(c) * v;
  bool met = false;
  Figures<Approx> f = InDouble(scene_, spot, begin, {0, 0, 0});
  tree_.Traverse(at, begin, [&](uint32_t prim) {
    if (prim == spot.prim) return false;
    f.other = InDouble(scene_, prim);
    const std::optional<bool> meets = Meets(f);
    return met = meets ? *meets : Meets(InIntegers(scene_, spot, begin, {0, 0, 0}, prim));
  });
  return met;
}

bool LeavingTruth::IsSelfHit(const Spot& spot, Vec3d begin, Vec3f dir, uint32_t prim) const {
  if (prim == spot.prim) return true;
  Figures<Approx> f = InDouble(scene_, spot, begin, dir);
  f.other = InDouble(scene_, prim);
  if (IsPlainlyNoSelfHit(f)) return false;
  return raybench::IsSelfHit(InIntegers(scene_, spot, begin, dir, prim));
}

}  // namespace raybench
