#include "harness/distance/distance.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <vector>

#include "accel/base/parallel.h"
#include "accel/base/random.h"
#include "accel/host/registry.h"
#include "harness/base/point_triangle.h"
#include "harness/judge/ask.h"
#include "harness/plan/build_options.h"

namespace raybench {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr uint32_t kLeaf = 4;

std::array<Vec3d, 3> Corners(const Scene& scene, uint32_t triangle) {
  const auto& [a, b, c] = scene.triangles[triangle];
  return {ToDouble(scene.positions[a]), ToDouble(scene.positions[b]), ToDouble(scene.positions[c])};
}

/// Boxes around halves of the triangles by the median of their centres: finds the nearest one.
class NearestTree {
 public:
  explicit NearestTree(const Scene& scene) : scene_(scene), items_(scene.triangles.size()) {
    std::iota(items_.begin(), items_.end(), 0u);
    Split(0, uint32_t(items_.size()));
  }

  double SquaredDistanceTo(Vec3d p) const {
    double best = kInfinity;
    Visit(0, p, best);
    return best;
  }

 private:
  struct Node {
    Vec3d lo, hi;
    uint32_t first, count;  ///< count 0: the second child's index; the first one is the next node
  };

  void Split(uint32_t first, uint32_t count) {
    Node node{{kInfinity, kInfinity, kInfinity}, {-kInfinity, -kInfinity, -kInfinity}, first, count};
    for (uint32_t i = first; i < first + count; ++i)
      for (Vec3d p : Corners(scene_, items_[i])) node.lo = Min(node.lo, p), node.hi = Max(node.hi, p);
    const size_t index = nodes_.size();
    nodes_.push_back(node);
    if (count <= kLeaf) return;
    const Vec3d extent = node.hi - node.lo;
    const int axis = extent.x >= extent.y && extent.x >= extent.z ? 0 : extent.y >= extent.z ? 1 : 2;
    const auto centre = [&](uint32_t i) {
      const auto [a, b, c] = Corners(scene_, i);
      return std::pair((a + b + c)[axis], i);
    };
    const auto begin = items_.begin() + first;
    std::nth_element(begin, begin + count / 2, begin + count,
                     [&](uint32_t a, uint32_t b) { return centre(a) < centre(b); });
    Split(first, count / 2);
    nodes_[index].count = 0;
    nodes_[index].first = uint32_t(nodes_.size());
    Split(first + count / 2, count - count / 2);
  }

  static double SquaredDistanceToBox(const Node& node, Vec3d p) {
    const Vec3d d = Max(Max(node.lo - p, p - node.hi), Vec3d{0, 0, 0});
    return Dot(d, d);
  }

  void Visit(uint32_t index, Vec3d p, double& best) const {
    const Node& node = nodes_[index];
    if (node.count > 0) {
      for (uint32_t i = node.first; i < node.first + node.count; ++i)
        best = std::min(best, SquaredDistance(p, Corners(scene_, items_[i])));
      return;
    }
    uint32_t near = index + 1, far = node.first;
    double to_near = SquaredDistanceToBox(nodes_[near], p), to_far = SquaredDistanceToBox(nodes_[far], p);
    if (to_far < to_near) std::swap(near, far), std::swap(to_near, to_far);
    if (to_near < best) Visit(near, p, best);
    if (to_far < best) Visit(far, p, best);
  }

  const Scene& scene_;
  std::vector<uint32_t> items_;
  std::vector<Node> nodes_;
};

/// Vertices that triangles use, then face centres.
std::vector<Vec3d> SamplesOf(const Scene& scene) {
  std::vector<uint8_t> used(scene.positions.size());
  for (const auto& corners : scene.triangles)
    for (uint32_t v : corners) used[v] = 1;
  std::vector<Vec3d> samples;
  for (size_t v = 0; v < used.size(); ++v)
    if (used[v]) samples.push_back(ToDouble(scene.positions[v]));
  for (uint32_t i = 0; i < scene.triangles.size(); ++i) {
    const auto [a, b, c] = Corners(scene, i);
    samples.push_back((a + b + c) * (1.0 / 3));
  }
  return samples;
}

}  // namespace

OneSided DistanceTo(const Scene& from, const Scene& to) {
  const NearestTree tree(to);
  const std::vector<Vec3d> samples = SamplesOf(from);
  std::vector<double> squares(samples.size());
  ParallelFor(size_t{0}, samples.size(), [&](size_t i) { squares[i] = tree.SquaredDistanceTo(samples[i]); });
  OneSided found{samples.size()};
  double sum = 0, sum_of_squares = 0;
  for (double square : squares) {
    found.max = std::max(found.max, std::sqrt(square));
    sum += std::sqrt(square);
    sum_of_squares += square;
  }
  found.mean = sum / double(samples.size());
  found.rms = std::sqrt(sum_of_squares / double(samples.size()));
  return found;
}

SilhouetteError CompareSilhouettes(const Scene& a, const Scene& b, uint32_t directions, uint32_t across,
                                   uint64_t seed) {
  Bounds3 box = a.bounds();
  box.Extend(b.bounds());
  const Vec3d center = (ToDouble(box.lo) + ToDouble(box.hi)) * 0.5;
  const double radius = Length(ToDouble(box.hi) - ToDouble(box.lo)) * 0.5;
  const Registry registry;
  const Contestant contestant = ParseContestant(registry, "bvh_wide");
  const Tree tree_a(contestant, a.Geometry(), BuildOptions(0, seed)),
      tree_b(contestant, b.Geometry(), BuildOptions(0, seed));
  SilhouetteError error;
  std::vector<rb_ray> rays(size_t{across} * across);
  Answers of_a(rays.size()), of_b(rays.size());
  for (uint32_t d = 0; d < directions; ++d) {
    Random random(seed, d);
    const Vec3d along = random.UnitVector();
    Vec3d right = Cross(along, random.UnitVector());
    right = Normalize(right);
    const Vec3d up = Cross(right, along);
    const Vec3f dir = ToFloat(along);
    for (uint32_t i = 0; i < rays.size(); ++i) {
      const double x = (i % across + 0.5) * 2 / across - 1, y = (i / across + 0.5) * 2 / across - 1;
      const Vec3f org = ToFloat(center + (right * x + up * y - along * 1.5) * radius);
      rays[i] = {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
    }
    const Question question{RB_ANY, rays};
    Ask(tree_a, question, of_a, 0);
    Ask(tree_b, question, of_b, 0);
    for (size_t i = 0; i < rays.size(); ++i) {
      error.lines += of_a.occluded[i] != 0;
      error.differ += (of_a.occluded[i] != 0) != (of_b.occluded[i] != 0);
    }
  }
  return error;
}

}  // namespace raybench
