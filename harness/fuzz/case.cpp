#include "harness/fuzz/case.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "accel/contract/valid_ray.h"
#include "datasets/scene/text.h"

namespace raybench::fuzz {
namespace {

constexpr std::string_view kMagic = "raybench-case";
constexpr int kVersion = 1;
/// More is no case but a scene.
constexpr size_t kMostItems = 1 << 20;

std::string Join(std::initializer_list<float> numbers) { return fmt::format("{}", fmt::join(numbers, " ")); }

class Parser {
 public:
  Parser(std::string_view text, const std::string& source) : lines_(text), source_(source) {}

  Case Run() {
    std::string_view line;
    bool has_magic = false;
    while (lines_.Next(line)) {
      words_ = Words(line.substr(0, line.find('#')));
      key_ = words_.Next();
      if (key_.empty()) continue;
      if (!has_magic) {
        int64_t version = 0;
        if (key_ != kMagic || !ParseInt(words_.Next(), version) || version != kVersion)
          Fail(fmt::format("a case begins with '{} {}'", kMagic, kVersion));
        has_magic = true;
      } else {
        Item();
      }
      if (!words_.Next().empty()) Fail(fmt::format("more words than {} takes", Quoted(key_)));
    }
    if (!has_magic)
      throw InputError(fmt::format("{}: is no case: '{} {}' is missing", source_, kMagic, kVersion));
    if (case_.structure.empty())
      throw InputError(fmt::format("{}: a line 'structure NAME' is missing", source_));
    CheckCorners();
    return std::move(case_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", source_, lines_.number(), what));
  }

  void Item() {
    if (case_.primitives() + case_.positions.size() + case_.rays.size() > kMostItems)
      Fail(fmt::format("more than {} vertices, primitives and rays", kMostItems));
    if (key_ == "structure") {
      case_.structure = words_.Rest();
      words_ = Words({});
    } else if (key_ == "mode") {
      const std::string_view mode = words_.Next();
      if (mode != "exact" && mode != "chaotic") Fail("the mode is exact or chaotic");
      case_.exact = mode == "exact";
    } else if (key_ == "check") {
      case_.check = words_.Next();
    } else if (key_ == "seed") {
      case_.seed = uint64_t(Integer(0, std::numeric_limits<int64_t>::max()));
    } else if (key_ == "vertex") {
      case_.positions.push_back(Point());
    } else if (key_ == "triangle") {
      auto& corners = case_.triangles.emplace_back();
      for (uint32_t& corner : corners) corner = Corner();
    } else if (key_ == "sphere") {
      const Vec3f center = Point();
      case_.spheres.push_back({center, Real()});
    } else if (key_ == "cone") {
      Cone& cone = case_.cones.emplace_back();
      cone.base = Point(), cone.base_radius = Real(), cone.apex = Point(), cone.apex_radius = Real();
    } else if (key_ == "polygon") {
      auto& corners = case_.polygons.emplace_back();
      while (!words_.Rest().empty()) corners.push_back(Corner());
      if (corners.size() < 3) Fail("a polygon needs 3 corners or more");
    } else if (key_ == "ray") {
      Ray();
    } else {
      Fail(
          fmt::format("{} is unknown; allowed: structure, mode, check, seed, vertex, triangle, sphere, cone, "
                      "polygon, ray",
                      Quoted(key_)));
    }
  }

  float Real(bool finite = true) {
    const std::string_view word = words_.Next();
    float value = 0;
    const Number number = ParseNumber(word, value);
    if (number == Number::kMalformed || std::isnan(value) || (finite && number == Number::kNotFinite))
      Fail(fmt::format("{} stands where a {}number is needed", Quoted(word), finite ? "finite " : ""));
    return value;
  }
  Vec3f Point() {
    const float x = Real(), y = Real(), z = Real();
    return {x, y, z};
  }
  int64_t Integer(int64_t lo, int64_t hi) {
    const std::string_view word = words_.Next();
    int64_t value = 0;
    if (!ParseInt(word, value) || value < lo || value > hi)
      Fail(fmt::format("{} stands where a whole number from {} to {} is needed", Quoted(word), lo, hi));
    return value;
  }
  uint32_t Corner() { return uint32_t(Integer(0, std::numeric_limits<int32_t>::max())); }

  void Ray() {
    rb_ray& ray = case_.rays.emplace_back();
    for (float& x : ray.org) x = Real();
    ray.tnear = Real();
    for (float& x : ray.dir) x = Real();
    ray.tfar = Real(/*finite=*/false);
    if (!IsValidRay(ray)) Fail("the ray is not valid: tnear >= 0 and a direction other than 0 are needed");
  }

  void CheckCorners() const {
    const auto check = [&](const auto& primitives, const char* what) {
      for (size_t i = 0; i < primitives.size(); ++i)
        for (uint32_t corner : primitives[i])
          if (corner >= case_.positions.size())
            throw InputError(fmt::format("{}: {} {} refers to vertex {}, but there are {}", source_, what, i,
                                         corner, case_.positions.size()));
    };
    check(case_.triangles, "triangle");
    check(case_.polygons, "polygon");
  }

  Lines lines_;
  const std::string& source_;
  Words words_{{}};
  std::string_view key_;
  Case case_;
};

}  // namespace

std::string Format(const Case& c, std::string_view comment) {
  std::string text = fmt::format("{} {}\n", kMagic, kVersion);
  Lines lines(comment);
  for (std::string_view line; lines.Next(line);) text += fmt::format("# {}\n", line);
  text += fmt::format("structure {}\nmode {}\n", c.structure, c.exact ? "exact" : "chaotic");
  if (!c.check.empty()) text += fmt::format("check {}\n", c.check);
  if (c.seed != 1) text += fmt::format("seed {}\n", c.seed);
  for (const Vec3f& p : c.positions) text += fmt::format("vertex {}\n", Join({p.x, p.y, p.z}));
  for (const auto& t : c.triangles) text += fmt::format("triangle {}\n", fmt::join(t, " "));
  for (const Sphere& s : c.spheres)
    text += fmt::format("sphere {}\n", Join({s.center.x, s.center.y, s.center.z, s.radius}));
  for (const Cone& k : c.cones)
    text += fmt::format("cone {}  {}\n", Join({k.base.x, k.base.y, k.base.z, k.base_radius}),
                        Join({k.apex.x, k.apex.y, k.apex.z, k.apex_radius}));
  for (const auto& p : c.polygons) text += fmt::format("polygon {}\n", fmt::join(p, " "));
  for (const rb_ray& r : c.rays)
    text += fmt::format("ray {} {}  {} {}\n", Join({r.org[0], r.org[1], r.org[2]}), r.tnear,
                        Join({r.dir[0], r.dir[1], r.dir[2]}), r.tfar);
  return text;
}

Case ParseCase(std::string_view text, const std::string& source) { return Parser(text, source).Run(); }

Case ReadCase(const std::filesystem::path& path) { return ParseCase(ReadText(path), path.string()); }

Scene SceneOf(const Case& c) {
  Scene scene;
  scene.name = scene.provenance.source = "case";
  scene.positions = c.positions;
  scene.triangles = c.triangles;
  scene.triangle_material.assign(c.triangles.size(), 0);
  for (uint32_t i = 0; i < c.triangles.size(); ++i) scene.triangle_face.push_back(i);
  scene.spheres = c.spheres, scene.sphere_material.assign(c.spheres.size(), 0);
  scene.cones = c.cones, scene.cone_material.assign(c.cones.size(), 0);
  for (const std::vector<uint32_t>& corners : c.polygons) {
    scene.polygons.push_back({uint32_t(scene.polygon_vertices.size()), uint32_t(corners.size())});
    scene.polygon_vertices.insert(scene.polygon_vertices.end(), corners.begin(), corners.end());
  }
  scene.polygon_material.assign(c.polygons.size(), 0);
  scene.Finish();
  if (scene.primitive_count() != c.primitives())
    throw InputError(
        fmt::format("case: {} of its primitives are degenerate", c.primitives() - scene.primitive_count()));
  if (scene.scale_exponent != 0) throw InputError("case: its largest coordinate is not within 2^-30 to 2^30");
  return scene;
}

}  // namespace raybench::fuzz
