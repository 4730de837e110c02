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

#include <cmath>
#include <cstring>
#include <numbers>

#include "datasets/readers/readers.h"
#include "datasets/readers/text_reader.h"
#include "datasets/scene/tangent.h"

namespace raybench {
namespace {

constexpr char kEntities[] =
    "v (camera), b (background), l (light), f (material), s (sphere), c (cone or cylinder), p, pp "
    "(polygons), # (comment)";

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
    for (uint64_t word : words) {
      h = (h ^ word) * 0x9FB21C651E98DF25u;
      h ^= h >> 32;
    }
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

class NffReader : TextReader {
 public:
  NffReader(const std::filesystem::path& path, const LoadOptions& options, Scene& scene)
      : TextReader(path, ReadText(path), options, scene), vertices_(scene) {}

  void Run() {
    for (std::string_view key = Word(); !key.empty(); key = Word()) {
      ReadEntity(key);
      TellProgress(lines_.offset());
    }
    if (scene_.primitive_count() + scene_.stats.dropped_triangles == 0) Fail("has no primitives");
    for (size_t i : lights_without_color_) {
      const float intensity = 1 / std::sqrt(float(scene_.lights.size()));
      scene_.lights[i].intensity = {intensity, intensity, intensity};
    }
    if (scene_.materials.empty()) scene_.materials.emplace_back().name = "default";
  }

 private:
  void ReadEntity(std::string_view key) {
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
      FailHere(fmt::format("unknown entity {}; allowed are {}", Quoted(key), kEntities));
    }
  }

  /// The next word that is not in a comment, empty at the end of the file.
  std::string_view Word() {
    std::string_view word = NextWord();
    for (; word.starts_with('#'); word = NextWord()) words_ = Words("");
    return word;
  }
  /// Likewise; at the end of the file it fails, for `what` should stand there.
  template <class... Args>
  std::string_view Expect(const char* what, const Args&... args) {
    const std::string_view word = Word();
    if (word.empty())  // in the line after the last
      Fail(fmt::format("line {}: the file ends {}", lines_.number() + !lines_.is_unended(),
                       fmt::format(fmt::runtime(what), args...)));
    return word;
  }

  /// The next word as a number; `what` and `which` tell the reader of an error what is missing.
  float Value(const char* what, const char* which) {
    const std::string_view word = Expect("where the {} of the {} should stand", which, what);
    float value;
    if (ParseNumber(word, value) == Number::kMalformed)
      FailHere(fmt::format("the {} of the {} is {}; a number is needed", which, what, Quoted(word)));
    return value;
  }
  float Finite(const char* what, const char* which, const char* hint = "") {
    const float value = Value(what, which);
    if (!std::isfinite(value))
      FailHere(fmt::format("the {} of the {} is not finite, or too large for a float{}", which, what, hint));
    return value;
  }
  /// Finite, unless bad primitives are to be dropped.
  float Coordinate(const char* what, const char* which) {
    return options_.drop_bad ? Value(what, which) : Finite(what, which, kOrDropBad);
  }
  Vec3f Point(const char* what) {
    const float x = Coordinate(what, "x"), y = Coordinate(what, "y"), z = Coordinate(what, "z");
    return {x, y, z};
  }
  Vec3f Color(const char* what) {
    const float r = Finite(what, "red"), g = Finite(what, "green"), b = Finite(what, "blue");
    if (r < 0 || g < 0 || b < 0) FailHere(fmt::format("the colour of the {} is negative", what));
    return {r, g, b};
  }
  /// A number of at least 0.
  float Weight(const char* which) {
    const float value = Finite("material", which);
    if (value < 0) FailHere(fmt::format("the {} of the material is {}; at least 0 is needed", which, value));
    return value;
  }

  void ReadPolygon(bool has_normals) {
    const char* const kind = has_normals ? "patch pp" : "polygon p";
    const std::string_view word = Expect("where the number of corners of the {} should stand", kind);
    int64_t count = 0;
    if (!ParseInt(word, count) || count < 3)
      FailHere(fmt::format("the {} has {} corners; a number of at least 3 is needed", kind, Quoted(word)));
    // Each corner takes its numbers and as many blanks.
    const int64_t rest = text_.data() + text_.size() - (word.data() + word.size());
    if (count > rest / (has_normals ? 12 : 6))
      FailHere(fmt::format("the {} has {} corners, more than the rest of the file can hold", kind, count));

    corners_.clear();
    for (int64_t i = 0; i < count; ++i) {
      VertexTable::Vertex v{};
      v.position = Point("corner");
      if (has_normals) v.normal = Point("normal");
      corners_.push_back(vertices_.Add(v));
      if (scene_.positions.size() >= RAYBENCH_NONE)
        FailHere(fmt::format("too many vertices; fewer than {} are allowed", RAYBENCH_NONE));
    }
    const uint32_t material = CurrentMaterial();
    const uint64_t face = scene_.stats.faces++;
    if (count == 3) {
      scene_.triangles.push_back({corners_[0], corners_[1], corners_[2]});
      scene_.triangle_material.push_back(material);
      scene_.triangle_face.push_back(uint32_t(face));
    } else {
      if (scene_.polygon_vertices.size() + uint64_t(count) >= RAYBENCH_NONE)
        FailHere(fmt::format("too many corners; fewer than {} are allowed", RAYBENCH_NONE));
      scene_.polygons.push_back({uint32_t(scene_.polygon_vertices.size()), uint32_t(count)});
      scene_.polygon_material.push_back(material);
      scene_.polygon_vertices.insert(scene_.polygon_vertices.end(), corners_.begin(), corners_.end());
    }
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
        FailHere(fmt::format("the {} {}{}", kind, flaw, kOrDropBad));
    prims.push_back(prim);
    material.push_back(CurrentMaterial());
  }

  /// The material in force, made on first use where the file names none.
  uint32_t CurrentMaterial() {
    if (scene_.materials.empty()) scene_.materials.emplace_back().name = "default";
    return uint32_t(scene_.materials.size() - 1);
  }

  void ReadMaterial() {
    Material m;
    m.name = Where();
    const Vec3f color = Color("material");
    m.diffuse = color * Weight("Kd");
    const float ks = Weight("Ks");
    m.specular = m.reflect = Vec3f{1, 1, 1} * ks;
    m.shininess = std::min(Weight("shine"), 1e6f);
    m.transmit = Vec3f{1, 1, 1} * Weight("T");
    const float ior = Weight("index of refraction");
    m.ior = ior > 0 ? ior : 1;  // opaque materials say 0
    scene_.materials.push_back(m);
  }

  void ReadLight() {
    Light light;
    const float x = Finite("light", "x"), y = Finite("light", "y"), z = Finite("light", "z");
    light.position = {x, y, z};
    // A colour is there if the line goes on with a number.
    if (const std::string_view rest = words_.Rest(); !rest.empty() && !rest.starts_with('#')) {
      light.intensity = Color("light");
    } else {
      lights_without_color_.push_back(scene_.lights.size());
    }
    scene_.lights.push_back(light);
  }

  void ReadCamera() {
    Camera camera;
    const auto expect = [&](std::string_view key) {
      if (const std::string_view word = Expect("within a camera, where '{}' should stand", key); word != key)
        FailHere(fmt::format(
            "a camera needs '{}' here, not {}; its lines are from, at, up, angle, hither, resolution", key,
            Quoted(word)));
    };
    const auto vector = [&](const char* key) {
      expect(key);
      const float x = Finite(key, "x"), y = Finite(key, "y"), z = Finite(key, "z");
      return Vec3f{x, y, z};
    };
    camera.eye = vector("from");
    camera.at = vector("at");
    camera.up = vector("up");
    const Vec3d side = Cross(ToDouble(camera.at) - ToDouble(camera.eye), ToDouble(camera.up));
    if (!(Dot(side, side) > 0))
      FailHere("the camera looks nowhere: 'at' is 'from', or 'up' lies along the view");
    expect("angle");
    const float angle = Finite("camera", "angle");
    if (!(angle > 0 && angle < 180))
      FailHere(fmt::format("the angle of the camera is {} degrees; allowed is what lies between 0 and 180",
                           angle));
    camera.tan_half_fov = float(Tangent(angle * (std::numbers::pi / 360)));
    expect("hither");
    Finite("camera", "hither");
    expect("resolution");
    for (const char* which : {"width", "height"})
      if (!(Finite("resolution", which) >= 1))
        FailHere(fmt::format("the {} of the picture is below 1", which));
    scene_.cameras.push_back(camera);
  }

  VertexTable vertices_;
  std::vector<uint32_t> corners_;
  std::vector<size_t> lights_without_color_;
};

Scene ReadNff(const std::filesystem::path& path, const LoadOptions& options) {
  Scene scene;
  NffReader(path, options, scene).Run();
  return scene;
}

}  // namespace

const Format kNff = {".nff", ReadNff};

}  // namespace raybench
