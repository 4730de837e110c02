#include "harness/extremes/make.h"

#include <fmt/format.h>

#include <map>

namespace raybench::extremes {

std::vector<Point> Along(std::initializer_list<double> magnitudes, double valid_to) {
  std::vector<Point> points;
  for (double m : magnitudes) points.push_back({m, {}, m <= valid_to});
  return points;
}

std::vector<Point> Decades(int first, int last, double valid_to) {
  std::vector<Point> points;
  for (int d = first; d <= last; ++d) {
    double magnitude = 1;  // exact for every decade used, unlike pow
    for (int i = 0; i < std::abs(d); ++i) magnitude *= 10;
    if (d < 0) magnitude = 1 / magnitude;
    points.push_back({magnitude, {}, magnitude <= valid_to});
  }
  return points;
}

std::vector<Point> Times(const std::vector<Point>& points, std::initializer_list<const char*> variants) {
  std::vector<Point> all;
  for (const char* variant : variants) {
    for (Point point : points) {
      point.variant = variant;
      all.push_back(point);
    }
  }
  return all;
}

Mesh Ball(uint32_t n, uint64_t seed) {
  Mesh mesh = GeodesicSphere(n);
  Random random(seed);
  const Frame frame = RandomFrame(random);
  for (Vec3d& p : mesh.positions) p = frame * p;
  return mesh;
}

Mesh Box(Vec3d lo, Vec3d hi, uint32_t n) {
  Mesh mesh;
  std::map<std::array<uint32_t, 3>, uint32_t> vertices;
  const auto at = [&](std::array<uint32_t, 3> cell) {
    const auto [it, is_new] = vertices.try_emplace(cell, uint32_t(mesh.positions.size()));
    if (is_new) {
      Vec3d p;
      for (int k = 0; k < 3; ++k) {
        const uint32_t i = cell[size_t(k)];
        p[k] = i == n ? hi[k] : lo[k] + (hi[k] - lo[k]) * i / n;
      }
      mesh.Add(p);
    }
    return it->second;
  };
  for (size_t axis = 0; axis < 3; ++axis) {
    const size_t u = (axis + 1) % 3, v = (axis + 2) % 3;
    for (uint32_t side : {0u, n}) {
      for (uint32_t i = 0; i < n; ++i) {
        for (uint32_t j = 0; j < n; ++j) {
          std::array<uint32_t, 4> quad;
          for (uint32_t c = 0; c < 4; ++c) {
            std::array<uint32_t, 3> cell;
            cell[axis] = side;
            cell[u] = i + (c == 1 || c == 2);
            cell[v] = j + (c >= 2);
            quad[c] = at(cell);
          }
          if (side == 0) std::swap(quad[1], quad[3]);  // outward
          mesh.AddQuad(quad[0], quad[1], quad[2], quad[3]);
        }
      }
    }
  }
  return mesh;
}

Scene ToScene(const Mesh& mesh, const Suite& suite, const Point& point) {
  Scene scene;
  scene.name = fmt::format("{} at {}", suite.name, point.magnitude);
  scene.provenance.source = scene.name;
  Append(scene, mesh, AddMaterial(scene, Material{}));
  scene.Finish();
  return scene;
}

rb_ray MakeRay(Vec3f org, Vec3f dir) {
  return {{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
}

rb_ray Towards(Vec3f org, Vec3f target) {
  const Vec3d d = ToDouble(target) - ToDouble(org);
  return MakeRay(org, d == Vec3d{0, 0, 0} ? Vec3f{0, 0, 0} : ToFloat(Normalize(d)));
}

Vec3f EdgeTarget(const Scene& scene, uint64_t i, Random& random) {
  const auto& triangle = scene.triangles[random.Below(scene.triangles.size())];
  const size_t corner = random.Below(3);
  const Vec3f a = scene.positions[triangle[corner]], b = scene.positions[triangle[(corner + 1) % 3]];
  return i % 2 != 0 ? a : ToFloat((ToDouble(a) + ToDouble(b)) * 0.5);
}

Vec3d InBall(Random& random) {
  for (;;) {
    const Vec3d p{2 * random.NextDouble() - 1, 2 * random.NextDouble() - 1, 2 * random.NextDouble() - 1};
    if (Dot(p, p) <= 1) return p;
  }
}

bool OtherPrimitive(const Truth& truth, const rb_hit& hit) {
  if (hit.prim == RAYBENCH_NONE) return truth.hit;
  return hit.prim != truth.first && !std::binary_search(truth.tied.begin(), truth.tied.end(), hit.prim);
}

bool HitOrMissDiffers(const Truth& truth, const rb_hit& hit) {
  return truth.hit != (hit.prim != RAYBENCH_NONE) && !truth.coplanar;
}

}  // namespace raybench::extremes
