// Hair: thousands of strands of small thin pieces that curl, on a ball or a meadow. Each piece fills little
// of its box, neighbours' boxes overlap heavily, and a ray that misses one strand comes close to the next
// ones; this is where trees of boxes do most work for nothing. Production scenes are full of it (hair, fur,
// grass, needles). Ribbons are the usual cheap form; tubes of three sides are closed.

#include <cstddef>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

enum Shape : uint32_t { kRibbon, kTube };
enum Ground : uint32_t { kBall, kPlane };
const char* const kShapes[] = {"ribbon", "tube", nullptr};
const char* const kGrounds[] = {"ball", "plane", nullptr};

struct Config {
  int64_t size, segments;
  double length, curl;
  uint32_t shape, on;
};

const rb_param kParams[] = {
    IntParam("size", "triangles, taken to whole strands: 99,995 at 100000", offsetof(Config, size), 60, 1e9,
             100000, RB_PARAM_LOG),
    IntParam("segments",
             "pieces of a strand; it has 2 segments - 1 triangles as a ribbon, 6 segments - 2 as a tube",
             offsetof(Config, segments), 1, 1024, 8, RB_PARAM_LOG),
    FloatParam("length", "of a strand at most, over the ball's radius or half the plane's side",
               offsetof(Config, length), 0.01, 2, 0.5, RB_PARAM_LOG),
    FloatParam("curl", "turns along a strand, held below 0.38 a segment", offsetof(Config, curl), 0, 64, 1.5),
    ChoiceParam("shape", "flat, or a closed tube of three sides", offsetof(Config, shape), kShapes, kRibbon),
    ChoiceParam("on", "what the strands stand on", offsetof(Config, on), kGrounds, kBall),
};

/// What a configuration comes to.
struct Layout {
  uint32_t skin_steps;  ///< of the ball
  uint64_t skin_triangles, strands, strand_triangles, strand_vertices;

  explicit Layout(const Config& c) {
    const double size = double(c.size);
    // The ball takes a tenth, up to 81,920 triangles.
    skin_steps = uint32_t(std::clamp(std::round(std::sqrt(size / 200)), 1.0, 64.0));
    skin_triangles = c.on == kBall ? uint64_t{20} * skin_steps * skin_steps : 2;
    const uint64_t segments = uint64_t(c.segments);
    strand_triangles = c.shape == kRibbon ? 2 * segments - 1 : 6 * segments - 2;
    strand_vertices = (c.shape == kRibbon ? 2 : 3) * segments + 1;
    const double wanted = (size - double(skin_triangles)) / double(strand_triangles);
    strands = uint64_t(std::max(1.0, std::round(wanted)));
  }
};

uint64_t Count(const void* config) {
  const Layout layout(*static_cast<const Config*>(config));
  return layout.skin_triangles + layout.strands * layout.strand_triangles;
}

Vec3d AnyPerpendicular(Vec3d d) {
  return Normalize(std::abs(d.x) < 0.6 ? Cross(d, Vec3d{1, 0, 0}) : Cross(d, Vec3d{0, 1, 0}));
}

/// A helix about a growing axis whose radius opens from the root, and which gravity bends.
class Strand {
 public:
  Strand(const Config& c, Random& random) : segments_(uint64_t(c.segments)) {
    Vec3d up{0, 1, 0};
    if (c.on == kBall) {
      root_ = up = random.UnitVector();
    } else {
      root_.x = 2 * random.NextDouble() - 1;
      root_.y = 0;
      root_.z = 2 * random.NextDouble() - 1;
    }
    axis_ = Normalize(up + random.UnitVector() * 0.45);
    x_ = AnyPerpendicular(axis_);
    y_ = Cross(axis_, x_);
    length_ = c.length * (0.65 + 0.35 * random.NextDouble());
    droop_ = c.on == kBall ? 0.45 * length_ : 0.2 * length_;
    radius_ = 0.07 * length_;
    // Turning by 2 x a segment: the point ((1 - w^2), 2 w) / (1 + w^2) of the circle for w = tan(x), and for
    // that a quotient of polynomials (the continued fraction of Lambert, 1768), good to 1 % up to 1.2.
    const double x = std::min(1.2, 3.14159265358979 * c.curl / double(c.segments));
    double w = x * (15 - x * x) / (15 - 6 * x * x);
    if (random.NextBits() >> 63 != 0) w = -w;
    cosine_ = (1 - w * w) / (1 + w * w);
    sine_ = 2 * w / (1 + w * w);
  }

  /// body(k, point, tangent) for the segments + 1 points from the root on; the tangent is a unit vector.
  template <class Body>
  void Walk(const Body& body) const {
    Vec3d last = Point(-1, cosine_, -sine_), here = Point(0, 1, 0);
    double c = 1, s = 0;
    for (uint64_t k = 0; k <= segments_; ++k) {
      const double next_c = c * cosine_ - s * sine_;
      s = c * sine_ + s * cosine_;
      c = next_c;
      const Vec3d next = Point(double(k + 1), c, s);
      body(k, here, Normalize(next - last));
      last = here;
      here = next;
    }
  }

 private:
  Vec3d Point(double k, double cosine, double sine) const {
    const double u = k / double(segments_), open = std::clamp(4 * u, 0.0, 1.0);
    return root_ + axis_ * (length_ * u) + (x_ * (cosine - 1) + y_ * sine) * (radius_ * open) -
           Vec3d{0, droop_ * u * u, 0};
  }

  uint64_t segments_;
  Vec3d root_, axis_, x_, y_;
  double length_, droop_, radius_, cosine_, sine_;
};

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  const Layout layout(c);
  const bool ball = c.on == kBall;
  Scene scene;
  scene.provenance.source = "fibres";
  Material skin;
  skin.name = ball ? "skin" : "soil";
  skin.diffuse = ball ? Vec3f{0.3f, 0.2f, 0.15f} : Vec3f{0.22f, 0.17f, 0.12f};
  const uint32_t skin_material = AddMaterial(scene, skin);
  const Vec3f hair[] = {{0.72f, 0.45f, 0.22f}, {0.6f, 0.34f, 0.15f}, {0.82f, 0.58f, 0.32f}};
  const Vec3f grass[] = {{0.3f, 0.5f, 0.16f}, {0.22f, 0.4f, 0.12f}, {0.45f, 0.55f, 0.2f}};
  for (size_t i = 0; i < 3; ++i) {
    Material material;
    material.name = (ball ? "hair " : "grass ") + std::to_string(i + 1);
    material.diffuse = ball ? hair[i] : grass[i];
    material.specular = Vec3f{1, 1, 1} * (ball ? 0.3f : 0.1f);
    AddMaterial(scene, material);
  }
  Mesh base;
  if (ball) {
    base = GeodesicSphere(layout.skin_steps);
  } else {
    for (Vec3d p : {Vec3d{-1, 0, -1}, Vec3d{-1, 0, 1}, Vec3d{1, 0, 1}, Vec3d{1, 0, -1}}) base.Add(p);
    base.AddQuad(0, 1, 2, 3);
  }
  Append(scene, base, skin_material);
  const size_t first_vertex = scene.positions.size(), first_triangle = scene.triangles.size();
  scene.positions.resize(first_vertex + layout.strands * layout.strand_vertices);
  scene.triangles.resize(Count(config));
  scene.triangle_material.resize(Count(config));

  // A strand is two sevenths as wide as it is far to the next.
  const double area = ball ? 12.566 : 4, spacing = std::sqrt(area / double(layout.strands));
  const double half_width = std::min(spacing / 7, 0.015);
  const uint32_t sides = c.shape == kRibbon ? 2 : 3;
  ForEachItem(layout.strands, options.progress, 0.7, [&](size_t i) {
    Random random(options.seed, i);
    const Strand strand(c, random);
    const uint32_t material = skin_material + 1 + uint32_t(random.Below(3));
    const uint32_t start = uint32_t(first_vertex + i * layout.strand_vertices);
    uint32_t vertex = start;
    size_t triangle = first_triangle + i * layout.strand_triangles;
    const auto add = [&](uint32_t a, uint32_t b, uint32_t d) {
      scene.triangles[triangle] = {a, b, d};
      scene.triangle_material[triangle++] = material;
    };
    Vec3d side = random.UnitVector();
    strand.Walk([&](uint64_t k, Vec3d p, Vec3d tangent) {
      if (k == uint64_t(c.segments)) {
        scene.positions[vertex] = ToFloat(p);
        return;
      }
      // Carried along without twist.
      side = side - tangent * Dot(side, tangent);
      side = Dot(side, side) > 1e-6 ? Normalize(side) : AnyPerpendicular(tangent);
      const double w = half_width * (1 - 0.8 * double(k) / double(c.segments));
      if (sides == 2) {
        scene.positions[vertex++] = ToFloat(p + side * w);
        scene.positions[vertex++] = ToFloat(p - side * w);
        return;
      }
      const Vec3d other = Cross(tangent, side) * (w * std::sqrt(3.0) / 2);
      scene.positions[vertex++] = ToFloat(p + side * w);
      scene.positions[vertex++] = ToFloat(p - side * (w / 2) + other);
      scene.positions[vertex++] = ToFloat(p - side * (w / 2) - other);
    });
    const uint32_t rings = uint32_t(c.segments), tip = start + sides * rings;
    const uint32_t walls = sides == 2 ? 1 : 3;
    for (uint32_t k = 0; k < rings; ++k)
      for (uint32_t j = 0; j < walls; ++j) {
        const uint32_t a = start + sides * k + j, b = start + sides * k + (j + 1) % sides;
        if (k + 1 == rings) {
          add(a, b, tip);
        } else {
          add(a, b, b + sides);
          add(a, b + sides, a + sides);
        }
      }
    if (sides == 3) add(start, start + 2, start + 1);
  });
  if (ball) {
    scene.cameras.push_back({{1.9f, 1.5f, 3.4f}, {0, -0.08f, 0}, {0, 1, 0}, 0.41421356f});
    scene.lights = {{{-5, 7, 6}, Vec3f{1, 0.95f, 0.9f} * 0.8f, false},
                    {{7, 3, 5}, Vec3f{0.8f, 0.9f, 1} * 0.35f, false}};
  } else {
    const float length = float(c.length);
    scene.cameras.push_back({{0.15f, 0.7f + length, 2.1f}, {0, 0.1f * length, 0}, {0, 1, 0}, 0.41421356f});
    scene.lights = {{{-4, 5, 2}, Vec3f{1, 0.95f, 0.85f} * 0.9f, false},
                    {{4, 6, 5}, Vec3f{0.8f, 0.9f, 1} * 0.25f, false}};
  }
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kFibresGenerator = {
    "fibres",
    "curling strands of thin triangles, strewn by the seed on a ball or a plane",
    "own",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
