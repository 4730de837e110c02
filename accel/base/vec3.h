// The few vector types that all layers share.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

namespace raybench {

template <class T>
struct Vec3 {
  T x, y, z;

  constexpr T operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
  constexpr T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  friend constexpr bool operator==(const Vec3&, const Vec3&) = default;
};

template <class T>
constexpr Vec3<T> operator+(Vec3<T> a, Vec3<T> b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
constexpr Vec3<T> operator-(Vec3<T> a, Vec3<T> b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class T>
constexpr Vec3<T> operator-(Vec3<T> a) {
  return {-a.x, -a.y, -a.z};
}
template <class T>
constexpr Vec3<T> operator*(Vec3<T> a, Vec3<T> b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
template <class T>
constexpr Vec3<T> operator*(Vec3<T> a, T s) {
  return {a.x * s, a.y * s, a.z * s};
}
template <class T>
constexpr Vec3<T> operator*(T s, Vec3<T> a) {
  return a * s;
}
template <class T>
constexpr T Dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
constexpr Vec3<T> Cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
template <class T>
T Length(Vec3<T> a) {
  return std::sqrt(Dot(a, a));
}
template <class T>
Vec3<T> Normalize(Vec3<T> a) {
  return a * (T(1) / Length(a));
}
template <class T>
constexpr Vec3<T> Min(Vec3<T> a, Vec3<T> b) {
  return {std::min(a.x, b.x), std::min(a.y, b.y), std::min(a.z, b.z)};
}
template <class T>
constexpr Vec3<T> Max(Vec3<T> a, Vec3<T> b) {
  return {std::max(a.x, b.x), std::max(a.y, b.y), std::max(a.z, b.z)};
}

using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;

inline Vec3f LoadVec3(const float* p) { return {p[0], p[1], p[2]}; }
inline Vec3d ToDouble(Vec3f v) { return {v.x, v.y, v.z}; }
inline Vec3f ToFloat(Vec3d v) { return {float(v.x), float(v.y), float(v.z)}; }

/// Closed axis-aligned box; empty (lo > hi) when default-constructed.
struct Bounds3 {
  Vec3f lo{std::numeric_limits<float>::infinity(), std::numeric_limits<float>::infinity(),
           std::numeric_limits<float>::infinity()};
  Vec3f hi{-std::numeric_limits<float>::infinity(), -std::numeric_limits<float>::infinity(),
           -std::numeric_limits<float>::infinity()};

  void Extend(Vec3f p) { lo = Min(lo, p), hi = Max(hi, p); }
  void Extend(const Bounds3& b) { lo = Min(lo, b.lo), hi = Max(hi, b.hi); }
  bool Empty() const { return lo.x > hi.x || lo.y > hi.y || lo.z > hi.z; }
  bool Contains(const Bounds3& b) const {
    return lo.x <= b.lo.x && lo.y <= b.lo.y && lo.z <= b.lo.z && hi.x >= b.hi.x && hi.y >= b.hi.y &&
           hi.z >= b.hi.z;
  }
  Vec3f Extent() const { return hi - lo; }
  /// Half the surface area: what SAH needs. 0 for an empty box.
  float HalfArea() const {
    if (Empty()) return 0;
    Vec3f e = Extent();
    return e.x * e.y + e.y * e.z + e.z * e.x;
  }
};

}  // namespace raybench
