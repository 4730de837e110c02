#include "datasets/generators/spd.h"

#include <cmath>
#include <numbers>

#include "datasets/generators/height_field.h"
#include "datasets/scene/tangent.h"

namespace raybench {

Scene SpdScene(Vec3d eye, Vec3d at, Vec3d up, double degrees, std::initializer_list<Vec3d> lights) {
  Scene scene;
  scene.background = {0.078f, 0.361f, 0.753f};
  scene.cameras.push_back(
      {ToFloat(eye), ToFloat(at), ToFloat(up), float(Tangent(degrees * (std::numbers::pi / 360)))});
  const float intensity = 1 / std::sqrt(float(lights.size()));
  for (Vec3d position : lights) {
    Light& light = scene.lights.emplace_back();
    light.position = ToFloat(position);
    light.intensity = {intensity, intensity, intensity};
  }
  return scene;
}

uint32_t AddSurface(Scene& scene, const SpdSurface& surface) {
  Material m;
  m.name = surface.name;
  m.diffuse = ToFloat(surface.color * surface.kd);
  m.specular = m.reflect = Vec3f{1, 1, 1} * float(surface.ks);
  m.transmit = Vec3f{1, 1, 1} * float(surface.transmittance);
  m.ior = surface.ior > 0 ? float(surface.ior) : 1;
  // cos(highlight)^shininess = 1/2; the databases' stand-in for infinity is 10^5.
  m.shininess = surface.highlight > 0
                    ? float(std::numbers::ln2 / -NaturalLog(Degrees(surface.highlight).cosine))
                    : 100000;
  return AddMaterial(scene, std::move(m));
}

void AddSphere(Scene& scene, Vec3d center, double radius, uint32_t material) {
  scene.spheres.push_back({ToFloat(center), float(radius)});
  scene.sphere_material.push_back(material);
}

void AddCone(Scene& scene, Vec3d base, double base_radius, Vec3d apex, double apex_radius,
             uint32_t material) {
  scene.cones.push_back({ToFloat(base), float(base_radius), ToFloat(apex), float(apex_radius)});
  scene.cone_material.push_back(material);
}

uint32_t AddVertex(Scene& scene, Vec3d position) {
  scene.positions.push_back(ToFloat(position));
  return uint32_t(scene.positions.size() - 1);
}

void AddTriangle(Scene& scene, std::array<uint32_t, 3> corners, uint32_t material) {
  scene.triangles.push_back(corners);
  scene.triangle_material.push_back(material);
}

void AddPolygon(Scene& scene, std::span<const uint32_t> corners, uint32_t material) {
  scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), uint32_t(corners.size())});
  scene.polygon_material.push_back(material);
  scene.polygon_vertices.insert(scene.polygon_vertices.end(), corners.begin(), corners.end());
}

void AddGround(Scene& scene, double half, double z, uint32_t material) {
  const uint32_t corners[] = {AddVertex(scene, {half, half, z}), AddVertex(scene, {-half, half, z}),
                              AddVertex(scene, {-half, -half, z}), AddVertex(scene, {half, -half, z})};
  AddPolygon(scene, corners, material);
}

Angle Degrees(double degrees) {
  Angle angle;
  SinCosDegrees(degrees, angle.sine, angle.cosine);
  return angle;
}

double NaturalLog(double x) {
  // x = m 2^e with m near 1; log m = 2 artanh((m - 1) / (m + 1)), a series in a number below 0.172.
  int exponent;
  double m = std::frexp(x, &exponent);
  if (m < std::numbers::sqrt2 / 2) {
    m *= 2;
    --exponent;
  }
  const double y = (m - 1) / (m + 1), y2 = y * y;
  double sum = 0;
  for (int n = 23; n >= 1; n -= 2) sum = sum * y2 + 1.0 / n;
  return 2 * y * sum + exponent * std::numbers::ln2;
}

}  // namespace raybench
