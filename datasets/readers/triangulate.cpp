// Ear clipping (Meisters 1975, ElGindy et al. 1993) with exact predicates.
//
// What makes a cut right is simple. Whatever n - 2 triangles a polygon is cut into along chords, at each
// point of the plane the triangles around it, those turning the other way counted negative, add up to the
// winding number of the outline. So if no triangle turns the other way, a polygon that does not cross itself
// is covered once, and nothing else is. This is what is checked; finding ears by emptiness only serves to
// get there.

#include "datasets/readers/triangulate.h"

#include <algorithm>
#include <cmath>

#include "datasets/scene/orientation.h"

namespace raybench {
namespace {

/// Corner-in-triangle tests for one polygon: half a second.
constexpr int64_t kMaxTests = 1 << 27;

bool IsFinite(Vec3f v) { return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z); }

class EarClipper {
 public:
  EarClipper(std::span<const Vec3f> corners, std::vector<std::array<uint32_t, 3>>& triangles)
      : corners_(corners), triangles_(triangles), n_(uint32_t(corners.size())) {}

  bool Run() {
    if (n_ == 3) return Fan(), true;
    if (!std::all_of(corners_.begin(), corners_.end(), IsFinite)) return Fan(), false;
    FindPlane();
    if (FanCovers()) {
      Fan();
      return !IsEdgeOn() || std::all_of(triangles_.begin(), triangles_.end(), [&](const auto& t) {
        return IsDegenerate(corners_[t[0]], corners_[t[1]], corners_[t[2]]);
      });
    }
    if (Clip()) return true;
    return Fan(), false;
  }

 private:
  void Fan() {
    triangles_.clear();
    for (uint32_t i = 2; i < n_; ++i) triangles_.push_back({0, i - 1, i});
  }

  /// Newell's normal: twice the area as seen along each axis.
  void FindPlane() {
    Vec3d normal{0, 0, 0}, first = ToDouble(corners_[0]);
    for (uint32_t i = 2; i < n_; ++i)
      normal = normal + Cross(ToDouble(corners_[i - 1]) - first, ToDouble(corners_[i]) - first);
    axis_ = 0;
    for (int k = 1; k < 3; ++k)
      if (std::abs(normal[k]) > std::abs(normal[axis_])) axis_ = k;
    sign_ = normal[axis_] < 0 ? -1 : 1;
  }

  /// 1: c lies to the left of the line from a to b, for one who looks at the polygon's front.
  int Turn(uint32_t a, uint32_t b, uint32_t c) const {
    return sign_ * Orientation(corners_[a], corners_[b], corners_[c], axis_);
  }

  bool FanCovers() const {
    for (uint32_t i = 2; i < n_; ++i)
      if (Turn(0, i - 1, i) < 0) return false;
    return true;
  }

  /// Seen along the axis it is a line, so no area adds up: it crosses itself, or is a line.
  bool IsEdgeOn() const {
    for (uint32_t i = 2; i < n_; ++i)
      if (Turn(0, i - 1, i) != 0) return false;
    return true;
  }

  bool Clip() {
    triangles_.clear();
    previous_.resize(n_);
    next_.resize(n_);
    turn_.resize(n_);
    for (uint32_t v = 0; v < n_; ++v) {
      previous_[v] = (v + n_ - 1) % n_;
      next_[v] = (v + 1) % n_;
    }
    for (uint32_t v = 0; v < n_; ++v) {
      turn_[v] = Turn(previous_[v], v, next_[v]);
      if (turn_[v] <= 0) not_convex_.push_back(v);
    }
    uint32_t v = 0;
    for (uint32_t left = n_; left > 3; --left) {
      uint32_t tried = 0;
      while (tried < left && tests_ <= kMaxTests && !IsEar(v)) {
        v = next_[v];
        ++tried;
      }
      if (tests_ > kMaxTests) return false;
      // A corner in the middle of an edge, or at the end of an edge there and back, encloses nothing.
      if (tried == left)
        for (tried = 0; tried < left && turn_[v] != 0; ++tried) v = next_[v];
      if (tried == left) return false;
      triangles_.push_back({previous_[v], v, next_[v]});
      v = Remove(v);
    }
    triangles_.push_back({previous_[v], v, next_[v]});
    return turn_[v] >= 0;
  }

  /// Returns the corner after the next one: taking turns makes better triangles than a fan.
  uint32_t Remove(uint32_t v) {
    const uint32_t a = previous_[v], c = next_[v];
    next_[a] = c;
    previous_[c] = a;
    turn_[v] = 1;
    for (uint32_t u : {a, c}) {
      const bool was_convex = turn_[u] > 0;
      turn_[u] = Turn(previous_[u], u, next_[u]);
      if (was_convex && turn_[u] <= 0) not_convex_.push_back(u);
    }
    tests_ += int64_t(not_convex_.size());
    std::erase_if(not_convex_, [&](uint32_t u) { return turn_[u] > 0; });
    return next_[c];
  }

  bool IsEar(uint32_t b) {
    if (turn_[b] <= 0) return false;
    const uint32_t a = previous_[b], c = next_[b];
    // If any corner lies inside, one that is not convex does. Those at the places of a, b and c belong to
    // edges that an outline may only have outside.
    const int j = (axis_ + 1) % 3, k = (axis_ + 2) % 3;
    const Vec3f pa = corners_[a], pb = corners_[b], pc = corners_[c];
    const Vec3f lo = Min(Min(pa, pb), pc), hi = Max(Max(pa, pb), pc);
    tests_ += 1 + int64_t(not_convex_.size());
    for (uint32_t v : not_convex_) {
      const Vec3f p = corners_[v];
      if (p[j] < lo[j] || p[j] > hi[j] || p[k] < lo[k] || p[k] > hi[k]) continue;
      const auto at = [&](Vec3f q) { return p[j] == q[j] && p[k] == q[k]; };
      if (at(pa) || at(pb) || at(pc)) continue;
      if (Turn(a, b, v) >= 0 && Turn(b, c, v) >= 0 && Turn(c, a, v) >= 0) return false;
    }
    return true;
  }

  std::span<const Vec3f> corners_;
  std::vector<std::array<uint32_t, 3>>& triangles_;
  uint32_t n_;
  int axis_ = 0, sign_ = 1;
  std::vector<uint32_t> previous_, next_, not_convex_;
  std::vector<int> turn_;
  int64_t tests_ = 0;
};

}  // namespace

bool Triangulate(std::span<const Vec3f> corners, std::vector<std::array<uint32_t, 3>>& triangles) {
  return EarClipper(corners, triangles).Run();
}

}  // namespace raybench
