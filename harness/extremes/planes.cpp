// Planes that coincide with something: zero components on a face, rays on split planes, boxes without
// thickness, sheets without a gap.
#include <fmt/format.h>

#include "harness/extremes/make.h"

namespace raybench::extremes {
namespace {

constexpr const char *kOne = "one component", *kTwo = "two components";

/// Odd rays start inside a box, even ones outside on the plane of one of its faces, mostly a maximum face.
Workload MakeAxisParallel(const Point& point, uint64_t rays, uint64_t seed) {
  Workload work;
  work.scene = ToScene(Box({-1, -1, -1}, {1, 1, 1}, 8), kAxisParallel, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    const int along = int(r.Below(3)), small = (along + 1 + int(r.Below(2))) % 3, other = 3 - along - small;
    const auto tiny = [&] { return float(r.Below(2) ? point.magnitude : -point.magnitude); };  // 0 or -0 too
    Vec3f org, dir;
    dir[along] = r.Below(2) ? 1.0f : -1.0f;
    dir[small] = tiny();
    dir[other] = point.variant == kTwo ? tiny() : float(r.NextDouble() - 0.5);
    for (int k = 0; k < 3; ++k) org[k] = float(1.9 * r.NextDouble() - 0.95);
    if (i % 2 == 0) {
      org[along] = -dir[along] * float(1.5 + r.NextDouble());
      org[small] = r.Below(4) == 0 ? -1.0f : 1.0f;
    } else if (r.Below(2) == 0) {
      org[small] = float(int(r.Below(7)) - 3) * 0.25f;  // in the plane of vertices
    }
    return MakeRay(org, dir);
  });
  work.second = HitOrMissDiffers;
  return work;
}

/// A box of integer cells with a sheet of cells at z = 0.
Workload MakeSplitPlane(const Point& point, uint64_t rays, uint64_t seed) {
  const int n = int(point.magnitude), half = n / 2;
  const double h = half;
  Mesh mesh = Box({-h, -h, -h}, {h, h, h}, uint32_t(n));
  const uint32_t first = uint32_t(mesh.positions.size()), row = uint32_t(n + 1);
  for (int y = -half; y <= half; ++y)
    for (int x = -half; x <= half; ++x) mesh.Add({double(x), double(y), 0});
  for (uint32_t y = 0; y < uint32_t(n); ++y) {
    for (uint32_t x = 0; x < uint32_t(n); ++x) {
      const uint32_t at = first + y * row + x;
      mesh.AddQuad(at, at + 1, at + row + 1, at + row);
    }
  }
  Workload work;
  work.scene = ToScene(mesh, kSplitPlane, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    // On cell walls or halfway between them, inside, not on the sheet.
    Vec3f org;
    for (int k = 0; k < 3; ++k) org[k] = float(r.Below(uint64_t(2 * n - 1)) + 1) * 0.5f - float(half);
    if (org.z == 0) org.z = 0.5f;
    if (i % 2 != 0) return MakeRay(org, EdgeTarget(work.scene, 1, r) - org);
    Vec3f dir;
    for (int k = 0; k < 3; ++k) dir[k] = r.Below(2) ? 0.0f : -0.0f;
    dir[int(r.Below(3))] = r.Below(2) ? 1.0f : -1.0f;
    if (r.Below(2)) dir[int(r.Below(3))] = r.Below(2) ? 1.0f : -1.0f;  // diagonal across cells
    return MakeRay(org, dir);
  });
  return work;
}

/// Even rays start outside; odd ones inside, where there is an inside.
Workload MakeFlatBox(const Point& point, uint64_t rays, uint64_t seed) {
  const double thick = point.magnitude;
  const Vec3d lo{-0.9371, -1.0413, 0}, hi{1.0237, 0.9619, thick};  // off the lattice along the flat axes
  Workload work;
  work.scene = ToScene(Box(lo, hi, 8), kFlatBox, point);
  if (work.scene.stats.degenerate_triangles > 0)
    work.note =
        fmt::format("{} triangles without area left out at load", work.scene.stats.degenerate_triangles);
  work.rays = MakeRays(rays, seed, [&](uint64_t i, Random& r) {
    Vec3f org = ToFloat(r.UnitVector() * 2.0);
    if (i % 2 != 0 && thick > 0)
      org = {float(r.NextDouble() - 0.5), float(r.NextDouble() - 0.5), float(thick * 0.5)};
    return Towards(org, EdgeTarget(work.scene, i / 2, r));
  });
  return work;
}

constexpr uint32_t kSheetCells = 8;

/// Two sheets with the same jittered cells; the one that the rays meet first has the higher ids, so that
/// taking the two for one does not pass.
Workload MakeThinGap(const Point& point, uint64_t rays, uint64_t seed) {
  float upper = 0.7f;
  for (int i = 0; i < int(point.magnitude); ++i) upper = std::nextafter(upper, 1.0f);
  Mesh mesh;
  constexpr uint32_t kRow = kSheetCells + 1;
  for (float z : {0.7f, upper}) {
    Random random(seed, 1);
    const uint32_t first = uint32_t(mesh.positions.size());
    for (uint32_t y = 0; y < kRow; ++y)
      for (uint32_t x = 0; x < kRow; ++x)
        mesh.Add({(x + 0.5 * random.NextDouble()) / kRow, (y + 0.5 * random.NextDouble()) / kRow, z});
    for (uint32_t y = 0; y < kSheetCells; ++y) {
      for (uint32_t x = 0; x < kSheetCells; ++x) {
        const uint32_t at = first + y * kRow + x;
        mesh.AddQuad(at, at + 1, at + kRow + 1, at + kRow);
      }
    }
  }
  Workload work;
  work.scene = ToScene(mesh, kThinGap, point);
  work.rays = MakeRays(rays, seed, [&](uint64_t, Random& r) {
    const Vec3d target{0.1 + 0.7 * r.NextDouble(), 0.1 + 0.7 * r.NextDouble(), 0.7};
    Vec3d from = r.UnitVector();
    from.z = std::fabs(from.z) + 0.1;
    return Towards(ToFloat(target + from), ToFloat(target));
  });
  work.fails = [](const Truth& truth, const rb_hit& hit) {
    constexpr uint32_t kOfOneSheet = 2 * kSheetCells * kSheetCells;
    if (!truth.hit || hit.prim == RAYBENCH_NONE) return truth.hit != (hit.prim != RAYBENCH_NONE);
    return (truth.tied.front() < kOfOneSheet) != (hit.prim < kOfOneSheet);
  };
  return work;
}

std::vector<Point> TinyComponents() {
  std::vector<Point> points = Along({0});
  for (int e : {-149, -126, -100, -64, -40, -24, -16, -8, -1}) points.push_back({std::ldexp(1.0, e)});
  return Times(points, {kOne, kTwo});
}

std::vector<Point> Thicknesses() {
  std::vector<Point> points = Along({0});
  for (int e : {-40, -30, -20, -15, -10, -8, -6, -5, -4, -3, -2, -1, 0})
    points.push_back(Decades(e, e).front());
  return points;
}

}  // namespace

const Suite kAxisParallel = {
    "axis_parallel",
    "a box; rays with one or two direction components of this size, +-0 among them, from inside and from "
    "outside on the plane of a face",
    "size of the small direction components",
    Axis::kLogarithmic,
    "leak or plain error",
    "hit instead of miss or the reverse, excused or not",
    "all",
    TinyComponents,
    MakeAxisParallel};

const Suite kSplitPlane = {
    "split_plane",
    "a box of integer cells with a sheet inside; rays in the planes of cell walls and to lattice points",
    "cells along a side of the box",
    Axis::kLogarithmic,
    "leak or plain error",
    nullptr,
    "all",
    [] {
      return Along({2, 4, 8, 16, 32, 64});
    },
    MakeSplitPlane};

const Suite kFlatBox = {"flat_box",
                        "a closed box of side 2 that gets flat; rays from outside and inside at its edges",
                        "thickness (sides are 2)",
                        Axis::kLogarithmic,
                        "leak or plain error",
                        nullptr,
                        "all",
                        Thicknesses,
                        MakeFlatBox};

const Suite kThinGap = {"thin_gap",
                        "two parallel sheets, rays that cross both",
                        "gap between the sheets, in ulp of their coordinates",
                        Axis::kLogarithmic,
                        "answer lies on the sheet behind, or misses both",
                        nullptr,
                        "all",
                        [] {
                          return Along({0, 1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024});
                        },
                        MakeThinGap};

}  // namespace raybench::extremes
