// NFF, Eric Haines' Neutral File Format 3.1 (1992), in which the Standard Procedural Databases come.
//
// How it is understood:
// - `angle` is the whole picture's, from edge to edge, up and across. `hither` and `resolution` are checked
//   and else unused.
// - `f r g b Kd Ks shine T ior`: diffuse Kd * rgb; Phong lobe and ideal mirror Ks, white; exponent shine;
//   refracted weight T, white. A file's primitives before its first `f` are grey.
// - `l` without colour: NFF leaves its intensity open; all such lights of a file get 1 / sqrt(number of its
//   lights), as is the custom of the SPD's renderers. Lights do not fall off with distance.
// - `p` and `pp` of three corners are triangles, of more n-gons, whole. Corners equal in position and normal
//   are one vertex, so that neighbours share them. A vertex without a normal of its own has (0, 0, 0).

#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <numbers>
#include <string_view>

#include "datasets/readers/readers.h"
#include "datasets/scene/tangent.h"
#include "datasets/scene/text.h"

namespace raybench {
namespace {

constexpr char kEntities[] =
    "v (camera), b (background), l (light), f (material), s (sphere), c (cone or cylinder), p, pp "
    "(polygons), "
    "# (comment)";

/// Gives equal corners the same index. Open addressing, at most half full.
class VertexTable {
 public:
  struct Vertex {
    Vec3f position, normal;
  };

  explicit VertexTable(Scene& scene) : scene_(scene), slots_(1024, RAYBENCH_NONE) {}

  /// Index of the vertex, new or known. Normals are kept from the first one on that is not zero.
  uint32_t Add(const Vertex& v) {
    if (2 * (scene_.positions.size() + 1) > slots_.size()) Grow();
    uint32_t& slot = Find(v);
    if (slot == RAYBENCH_NONE) {
      slot = uint32_t(scene_.positions.size());
      scene_.positions.push_back(v.position);
      if (scene_.normals.empty() && !(v.normal == Vec3f{0, 0, 0}))
        scene_.normals.resize(scene_.positions.size() - 1);
      if (!scene_.normals.empty() || !(v.normal == Vec3f{0, 0, 0})) scene_.normals.push_back(v.normal);
    }
    return slot;
  }

 private:
  Vertex At(uint32_t i) const {
    return {scene_.positions[i], scene_.normals.empty() ? Vec3f{0, 0, 0} : scene_.normals[i]};
  }
  uint32_t& Find(const Vertex& v) {
    uint64_t words[3];
    static_assert(sizeof words == sizeof v);
    std::memcpy(words, &v, sizeof v);
    uint64_t h = 0;
    for (uint64_t word : words) h = (h ^ word) * 0x9FB21C651E98DF25u, h ^= h >> 32;
    for (size_t i = h;; ++i) {
      uint32_t& slot = slots_[i & (slots_.size() - 1)];
      if (slot == RAYBENCH_NONE) return slot;
      const Vertex other = At(slot);
      if (std::memcmp(&other, &v, sizeof v) == 0) return slot;
    }
  }
  void Grow() {
    slots_.assign(4 * slots_.size(), RAYBENCH_NONE);
    for (uint32_t i = 0; i < scene_.positions.size(); ++i) Find(At(i)) = i;
  }

  Scene& scene_;
  std::vector<uint32_t> slots_;
};

class NffReader {
 public:
  NffReader(const std::filesystem::path& path, const LoadOptions& options)
      : path_(path.string()),
        text_(ReadText(path)),
        p_(text_.data()),
        end_(p_ + text_.size()),
        options_(options),
        vertices_(scene_) {
    scene_.provenance.source = path_;
  }

  Scene Read() {
    while (SkipBlanks()) {
      const std::string_view key = Word();
      entity_line_ = line_;
      if (key == "p" || key == "pp") {
        ReadPolygon(key == "pp");
      } else if (key == "s") {
        ReadSphere();
      } else if (key == "c") {
        ReadCone();
      } else if (key == "f") {
        ReadMaterial();
      } else if (key == "l") {
        ReadLight();
      } else if (key == "b") {
        scene_.background = Color("background");
      } else if (key == "v") {
        ReadCamera();
      } else {
        Fail(fmt::format("unknown entity {}; allowed are {}", Quoted(key), kEntities));
      }
    }
    if (scene_.primitive_count() + scene_.stats.dropped_triangles == 0)
      throw InputError(path_ + ": has no primitives");
    for (size_t i : lights_without_color_) {
      const float intensity = 1 / std::sqrt(float(scene_.lights.size()));
      scene_.lights[i].intensity = {intensity, intensity, intensity};
    }
    if (scene_.materials.empty()) scene_.materials.emplace_back().name = "default";
    return std::move(scene_);
  }

 private:
  [[noreturn]] void Fail(const std::string& what) const {
    throw InputError(fmt::format("{}: line {}: {}", path_, line_, what));
  }
  static std::string Quoted(std::string_view text) {
    return OneLine(fmt::format("'{}'", text.substr(0, 40)));
  }

  /// Goes to the next word, over line breaks and comments; false at the end of the file.
  bool SkipBlanks() {
    for (; p_ < end_; ++p_) {
      if (*p_ == '#') {
        p_ = static_cast<const char*>(std::memchr(p_, '\n', size_t(end_ - p_)));
        if (p_ == nullptr) return p_ = end_, false;
      }
      if (*p_ == '\n') {
        ++line_;
      } else if (!IsBlank(*p_)) {
        return true;
      }
    }
    return false;
  }
  static bool IsBlank(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

  /// The word that begins here.
  std::string_view Word() {
    const char* begin = p_;
    while (p_ < end_ && *p_ != '\n' && !IsBlank(*p_)) ++p_;
    return {begin, size_t(p_ - begin)};
  }

  /// The next word as a number; `what` and `which` tell the reader of an error what is missing.
  float Number(const char* what, const char* which) {
    if (!SkipBlanks()) Fail(fmt::format("the file ends where the {} of the {} should stand", which, what));
    const std::string_view word = Word();
    const char* begin = word.data() + (word.starts_with('+') ? 1 : 0);
    float value = 0;
    const auto [end, error] = std::from_chars(begin, word.data() + word.size(), value);
    if (end != word.data() + word.size() || begin == end || error == std::errc::invalid_argument)
      Fail(fmt::format("the {} of the {} is {}; a number is needed", which, what, Quoted(word)));
    // Too large, or so small that it is 0.
    if (error == std::errc::result_out_of_range) value = std::strtof(std::string(word).c_str(), nullptr);
    return value;
  }
  float Finite(const char* what, const char* which, const char* hint = "") {
    const float value = Number(what, which);
    if (!std::isfinite(value))
      Fail(fmt::format("the {} of the {} is not finite, or too large for a float{}", which, what, hint));
    return value;
  }
  /// Finite, unless bad primitives are to be dropped.
  float Coordinate(const char* what, const char* which) {
    return options_.drop_bad ? Number(what, which) : Finite(what, which, kOrDropBad);
  }
  Vec3f Point(const char* what) {
    const float x = Coordinate(what, "x"), y = Coordinate(what, "y"), z = Coordinate(what, "z");
    return {x, y, z};
  }
  Vec3f Color(const char* what) {
    const float r = Finite(what, "red"), g = Finite(what, "green"), b = Finite(what, "blue");
    if (r < 0 || g < 0 || b < 0) Fail(fmt::format("the colour of the {} is negative", what));
    return {r, g, b};
  }
  /// A number of at least 0.
  float Weight(const char* which) {
    const float value = Finite("material", which);
    if (value < 0) Fail(fmt::format("the {} of the material is {}; at least 0 is needed", which, value));
    return value;
  }

  void ReadPolygon(bool has_normals) {
    const char* const kind = has_normals ? "patch pp" : "polygon p";
    if (!SkipBlanks())
      Fail(fmt::format("the file ends where the number of corners of the {} should stand", kind));
    const std::string_view word = Word();
    uint64_t count = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), count);
    if (error != std::errc() || end != word.data() + word.size() || count < 3)
      Fail(fmt::format("the {} has {} corners; a number of at least 3 is needed", kind, Quoted(word)));
    // Each corner takes its numbers and as many blanks.
    const uint64_t rest = uint64_t(end_ - p_), least = has_normals ? 12 : 6;
    if (count > rest / least)
      Fail(fmt::format("the {} has {} corners, more than the rest of the file can hold", kind, count));

    corners_.clear();
    for (uint64_t i = 0; i < count; ++i) {
      VertexTable::Vertex v{};
      v.position = Point("corner");
      if (has_normals) v.normal = Point("normal");
      corners_.push_back(vertices_.Add(v));
      if (scene_.positions.size() >= RAYBENCH_NONE)
        Fail(fmt::format("too many vertices; fewer than {} are allowed", RAYBENCH_NONE));
    }
    const uint32_t material = CurrentMaterial();
    const uint64_t face = scene_.stats.faces++;
    if (count == 3) {
      scene_.triangles.push_back({corners_[0], corners_[1], corners_[2]});
      scene_.triangle_material.push_back(material);
      scene_.triangle_face.push_back(uint32_t(face));
    } else {
      if (scene_.polygon_vertices.size() + count >= RAYBENCH_NONE)
        Fail(fmt::format("too many corners; fewer than {} are allowed", RAYBENCH_NONE));
      scene_.polygons.push_back({uint32_t(scene_.polygon_vertices.size()), uint32_t(count)});
      scene_.polygon_material.push_back(material);
      scene_.polygon_vertices.insert(scene_.polygon_vertices.end(), corners_.begin(), corners_.end());
    }
    if (options_.progress && face % 65536 == 65535)
      options_.progress(double(p_ - text_.data()) / double(text_.size()));
  }

  void ReadSphere() {
    Sphere s;
    s.center = Point("sphere");
    s.radius = Coordinate("sphere", "radius");
    Keep(s, "sphere", scene_.spheres, scene_.sphere_material);
  }

  void ReadCone() {
    Cone c;
    c.base = Point("cone's base");
    c.base_radius = Coordinate("cone's base", "radius");
    c.apex = Point("cone's apex");
    c.apex_radius = Coordinate("cone's apex", "radius");
    Keep(c, "cone", scene_.cones, scene_.cone_material);
  }

  template <class Prim>
  void Keep(const Prim& prim, const char* kind, std::vector<Prim>& prims, std::vector<uint32_t>& material) {
    if (!options_.drop_bad)
      if (const std::string flaw = Flaw(prim); !flaw.empty())
        Fail(fmt::format("the {} {}{}", kind, flaw, kOrDropBad));
    prims.push_back(prim), material.push_back(CurrentMaterial());
  }

  /// The material in force, made on first use where the file names none.
  uint32_t CurrentMaterial() {
    if (scene_.materials.empty()) scene_.materials.emplace_back().name = "default";
    return uint32_t(scene_.materials.size() - 1);
  }

  void ReadMaterial() {
    Material m;
    const Vec3f color = Color("material");
    m.diffuse = color * Weight("Kd");
    const float ks = Weight("Ks");
    m.specular = m.reflect = Vec3f{1, 1, 1} * ks;
    m.shininess = std::min(Weight("shine"), 1e6f);
    m.transmit = Vec3f{1, 1, 1} * Weight("T");
    const float ior = Weight("index of refraction");
    m.ior = ior > 0 ? ior : 1;  // opaque materials say 0
    m.name = fmt::format("line {}", entity_line_);
    scene_.materials.push_back(m);
  }

  void ReadLight() {
    Light light;
    const float x = Finite("light", "x"), y = Finite("light", "y"), z = Finite("light", "z");
    light.position = {x, y, z};
    // A colour is there if the line goes on with a number.
    while (p_ < end_ && IsBlank(*p_)) ++p_;
    if (p_ < end_ && *p_ != '\n' && *p_ != '#') {
      light.intensity = Color("light");
    } else {
      lights_without_color_.push_back(scene_.lights.size());
    }
    scene_.lights.push_back(light);
  }

  void ReadCamera() {
    Camera camera;
    const auto expect = [&](std::string_view key) {
      if (!SkipBlanks()) Fail(fmt::format("the file ends within a camera, where '{}' should stand", key));
      if (const std::string_view word = Word(); word != key)
        Fail(fmt::format(
            "a camera needs '{}' here, not {}; its lines are from, at, up, angle, hither, resolution", key,
            Quoted(word)));
    };
    const auto vector = [&](const char* key) {
      expect(key);
      const float x = Finite(key, "x"), y = Finite(key, "y"), z = Finite(key, "z");
      return Vec3f{x, y, z};
    };
    camera.eye = vector("from"), camera.at = vector("at"), camera.up = vector("up");
    const Vec3d side = Cross(ToDouble(camera.at) - ToDouble(camera.eye), ToDouble(camera.up));
    if (!(Dot(side, side) > 0)) Fail("the camera looks nowhere: 'at' is 'from', or 'up' lies along the view");
    expect("angle");
    const float angle = Finite("camera", "angle");
    if (!(angle > 0 && angle < 180))
      Fail(fmt::format("the angle of the camera is {} degrees; allowed is what lies between 0 and 180",
                       angle));
    camera.tan_half_fov = float(Tangent(angle * (std::numbers::pi / 360)));
    expect("hither");
    Finite("camera", "hither");
    expect("resolution");
    for (const char* which : {"width", "height"})
      if (!(Finite("resolution", which) >= 1)) Fail(fmt::format("the {} of the picture is below 1", which));
    scene_.cameras.push_back(camera);
  }

  const std::string path_, text_;
  const char *p_, *end_;
  const LoadOptions& options_;
  uint64_t line_ = 1, entity_line_ = 1;
  Scene scene_;
  VertexTable vertices_;
  std::vector<uint32_t> corners_;
  std::vector<size_t> lights_without_color_;
};

}  // namespace

Scene ReadNff(const std::filesystem::path& path, const LoadOptions& options) {
  return NffReader(path, options).Read();
}

}  // namespace raybench
