// Private to this folder: exact truth for primitives of any kind. It shares no code with the tests that
// structures call.
//
// What is true of a ray is true of these point sets, with the float values as given:
//
// - Triangle: closed.
// - Sphere: |p - center| = |radius|.
// - Cone: |p - base|^2 = s^2 |axis|^2 + r(s)^2 where axis = apex - base, s = (p - base).axis / |axis|^2 and r(s)
//   goes from |base_radius| at s = 0 to |apex_radius| at s = 1, both rims included.
// - Negative radii show only the inside: where the ray passes from outside to inside there is nothing.
// - Polygon: the point of the ray in the plane through the mean of the corners with Newell's normal, if the
//   outline, closed and seen along the ray, encloses the ray an odd number of times or runs through it. For
//   polygons that are not flat that point is moved along the ray into the box of the corners, and a ray that
//   is parallel to the plane has its first point of that box.
//
// A ray that lies in the plane of a triangle or polygon and meets it, or lies in a cone's side, is
// `coplanar`: hit and miss are both right.
//
// So t is a root of a quadratic with rational coefficients, or a ratio. Each is first bounded in double
// (approx.h); what that leaves open, and the order of hits whose bounds overlap, is decided by integers
// (surd.h). Two t are equal only if they are.
#pragma once

#include <optional>
#include <vector>

#include "datasets/scene/scene.h"
#include "harness/truth/approx.h"
#include "harness/truth/box_tree.h"
#include "harness/truth/oracle.h"
#include "harness/truth/surd.h"

namespace raybench {

class ExactTruth {
 public:
  /// Of the primitives from id `first` on. The scene must outlive it, unmoved.
  ExactTruth(const Scene& scene, uint32_t first);

  /// A meeting of a ray with a primitive; a curved one may have two.
  struct Meeting {
    uint32_t prim;
    int side;  ///< curved: -1 where the ray enters, +1 where it leaves; flat: 0
    Feature feature;
    Approx t;
  };

  /// Makes the truth about the triangles before `first`, if there are any, the truth about all primitives.
  void Join(const rb_ray& ray, Truth& truth) const;
  /// Every meeting with t in (tnear, tfar], in any order.
  std::vector<Meeting> All(const rb_ray& ray) const { return Find(ray, ray.tfar, false).all; }

  /// True if `accept` holds for some primitive near the ray's whole line: within 2^-18 of the distance to the
  /// primitive's far end, more than float tests may err (verdict.cpp, margins.cpp).
  template <class Accept>
  bool AnyNear(const rb_ray& ray, const Accept& accept) const {
    constexpr double infinity = std::numeric_limits<double>::infinity();
    bool found = false;
    tree_.Traverse({ToDouble(LoadVec3(ray.org)), ToDouble(LoadVec3(ray.dir)), 0x1p-18}, -infinity, infinity,
                   [&](uint32_t i) {
                     found = found || accept(first_ + i);
                     return found ? -infinity : infinity;
                   });
    return found;
  }

 private:
  struct Meetings {
    std::vector<Meeting> all;
    bool coplanar = false;
  };
  /// What is worked out once for a polygon.
  struct Face {
    Vec3<Approx> normal, offset;  ///< Newell's; from the first corner to the mean of all
    Vec3f lo, hi;
    int shift;                  ///< the integers are in units of 2^-shift
    Vec3<Int> normal_int, sum;  ///< the normal, in squares of them; the sum of the corners
  };

  /// Meetings in (tnear, limit]; of these the ones that may round to the same float as the nearest, at least,
  /// if only these are wanted.
  Meetings Find(const rb_ray& ray, double limit, bool nearest) const;
  void Meet(const rb_ray& ray, uint32_t prim, Meetings& found) const;
  void MeetTriangle(const rb_ray& ray, uint32_t prim, Meetings& found) const;
  void MeetCurved(const rb_ray& ray, uint32_t prim, Meetings& found) const;
  void MeetPolygon(const rb_ray& ray, uint32_t prim, Meetings& found) const;
  Surd Exact(const rb_ray& ray, const Meeting& meeting) const;

  exact::Corners Triangle(uint32_t prim) const;
  Surd ExactTriangle(const rb_ray& ray, uint32_t prim) const;
  /// Both are triangles with the same three corners, and so have the same t.
  bool AreCopies(uint32_t a, uint32_t b) const;
  Face MakeFace(const Polygon& polygon) const;
  /// Where the outline is met, if it is.
  std::optional<Feature> Outline(const rb_ray& ray, const Polygon& polygon) const;
  /// None: the ray lies in the plane. It must meet the outline.
  std::optional<Surd> ExactPolygon(const rb_ray& ray, uint32_t index) const;

  const Scene& scene_;
  const uint32_t first_;
  std::vector<Face> faces_;
  const BoxTree tree_;
};

}  // namespace raybench
