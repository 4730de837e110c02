// A city of boxes: podium, tower and roof house on each lot of a street grid, high in the middle and low
// at the rim, on one large ground. Everything stands along the axes, so boxes fit; but facades are strips
// from bottom to top, long and thin, the ground's two triangles lie under all of it, and sizes differ by
// four orders of magnitude. Rays along a street pass many boxes and hit none. It stands for architecture
// and urban models, which come as such boxes. The glass strips mirror, so that there are reflection rays
// in all directions.

#include <cstddef>
#include <tuple>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t size, strips;
};

const rb_param kParams[] = {
    IntParam("size", "triangles, taken to whole buildings: 100,030 at 100000", offsetof(Config, size), 70,
             1e9, 100000, RB_PARAM_LOG),
    IntParam("strips",
             "strips from bottom to top on each side of a tower; a building has 20 + 12 strips triangles",
             offsetof(Config, strips), 1, 64, 4, RB_PARAM_LOG),
};

// In metres: lots, and a street after every second one.
constexpr double kLot = 26, kStreet = 16;

uint64_t TrianglesOfABuilding(const Config& c) { return 20 + 12 * uint64_t(c.strips); }

uint64_t Buildings(const Config& c) {
  const double wanted = double(c.size - 2) / double(TrianglesOfABuilding(c));
  return uint64_t(std::max(1.0, std::round(wanted)));
}

uint64_t Count(const void* config) {
  const Config& c = *static_cast<const Config*>(config);
  return 2 + Buildings(c) * TrianglesOfABuilding(c);
}

struct Lot {
  uint64_t distance;  ///< squared, from the middle, in half lots
  int32_t x, z;
};

/// The lots nearest to the middle of the grid: a round city.
std::vector<Lot> Lots(uint64_t count) {
  // A disc of this radius holds `count` lots; the square around it has them all.
  const int32_t half = int32_t(std::sqrt(double(count) / 3.1) / 2 + 1) * 2;
  std::vector<Lot> lots;
  lots.reserve(size_t(half) * 2 * size_t(half) * 2);
  for (int32_t z = -half; z < half; ++z)
    for (int32_t x = -half; x < half; ++x) {
      const int64_t dx = 2 * x + 1, dz = 2 * z + 1;
      lots.push_back({uint64_t(dx * dx + dz * dz), x, z});
    }
  std::sort(lots.begin(), lots.end(), [](const Lot& a, const Lot& b) {
    return std::tie(a.distance, a.z, a.x) < std::tie(b.distance, b.z, b.x);
  });
  lots.resize(count);
  return lots;
}

/// Where lot i begins along one direction; blocks of two lots between streets, one street through the middle.
double Begin(int32_t i) {
  const int32_t block = i >= 0 ? i / 2 : (i - 1) / 2;
  return i * kLot + block * kStreet + kStreet / 2;
}

/// Writes one building's vertices and triangles into the places that belong to it.
class Builder {
 public:
  Builder(Scene& scene, uint64_t strips, size_t building, uint64_t triangles)
      : scene_(scene),
        strips_(strips),
        vertex_(4 + building * Vertices(strips)),
        triangle_(2 + building * triangles) {}

  static uint64_t Vertices(uint64_t strips) { return 8 + (8 * strips + 1) + 8; }

  /// Walls and a flat roof of two triangles.
  void Box(Vec3d lo, Vec3d hi, uint32_t material) {
    const size_t v = vertex_;
    for (double y : {lo.y, hi.y})
      for (auto [x, z] :
           {std::pair(lo.x, lo.z), std::pair(lo.x, hi.z), std::pair(hi.x, hi.z), std::pair(hi.x, lo.z)})
        Vertex({x, y, z});
    for (size_t k = 0; k < 4; ++k) Quad(v + k, v + (k + 1) % 4, v + 4 + (k + 1) % 4, v + 4 + k, material);
    Quad(v + 4, v + 5, v + 6, v + 7, material);
  }

  /// Walls of strips, every second one of glass, and a fan for a roof.
  void Tower(Vec3d lo, Vec3d hi, uint32_t wall, uint32_t glass) {
    const size_t v = vertex_, around = 4 * strips_;
    for (double y : {lo.y, hi.y})
      for (size_t k = 0; k < around; ++k) {
        const double t = double(k % strips_) / double(strips_);
        const double x = lo.x + (hi.x - lo.x) * t, z = lo.z + (hi.z - lo.z) * t;
        switch (k / strips_) {
          case 0:
            Vertex({lo.x, y, z});
            break;
          case 1:
            Vertex({x, y, hi.z});
            break;
          case 2:
            Vertex({hi.x, y, hi.z - (hi.z - lo.z) * t});
            break;
          default:
            Vertex({hi.x - (hi.x - lo.x) * t, y, lo.z});
        }
      }
    const size_t middle = vertex_;
    Vertex({(lo.x + hi.x) / 2, hi.y, (lo.z + hi.z) / 2});
    for (size_t k = 0; k < around; ++k) {
      const size_t next = (k + 1) % around;
      Quad(v + k, v + next, v + around + next, v + around + k, k % 2 == 0 ? wall : glass);
    }
    for (size_t k = 0; k < around; ++k) Triangle(v + around + k, v + around + (k + 1) % around, middle, wall);
  }

 private:
  void Vertex(Vec3d p) { scene_.positions[vertex_++] = ToFloat(p); }
  void Triangle(size_t a, size_t b, size_t c, uint32_t material) {
    scene_.triangles[triangle_] = {uint32_t(a), uint32_t(b), uint32_t(c)};
    scene_.triangle_material[triangle_++] = material;
  }
  void Quad(size_t a, size_t b, size_t c, size_t d, uint32_t material) {
    Triangle(a, b, c, material);
    Triangle(a, c, d, material);
  }

  Scene& scene_;
  size_t strips_, vertex_, triangle_;
};

Scene Generate(const void* config, const LoadOptions& options) {
  const Config& c = *static_cast<const Config*>(config);
  const std::vector<Lot> lots = Lots(Buildings(c));
  const uint64_t strips = uint64_t(c.strips);
  const double rim = std::sqrt(double(lots.back().distance)) / 2 + 1;  // in lots
  const double radius = rim * (kLot + kStreet / 2), downtown = std::max(radius / 3, 120.0);

  Scene scene;
  scene.provenance.source = "city";
  const auto add = [&](const char* name, Vec3f diffuse, float reflect) {
    Material material;
    material.name = name;
    material.diffuse = diffuse;
    material.reflect = Vec3f{1, 1, 1} * reflect;
    return AddMaterial(scene, material);
  };
  const uint32_t ground = add("ground", {0.3f, 0.31f, 0.33f}, 0);
  const uint32_t walls[] = {add("concrete", {0.62f, 0.6f, 0.56f}, 0), add("brick", {0.6f, 0.36f, 0.28f}, 0),
                            add("plaster", {0.78f, 0.7f, 0.55f}, 0), add("steel", {0.4f, 0.45f, 0.5f}, 0.1f)};
  const uint32_t glass = add("glass", {0.14f, 0.2f, 0.26f}, 0.4f);

  scene.positions.resize(4 + lots.size() * Builder::Vertices(strips));
  scene.triangles.resize(Count(config));
  scene.triangle_material.resize(Count(config), ground);
  const float far = float(radius * 20);
  scene.positions[0] = {-far, 0, -far};
  scene.positions[1] = {-far, 0, far};
  scene.positions[2] = {far, 0, far};
  scene.positions[3] = {far, 0, -far};
  scene.triangles[0] = {0, 1, 2};
  scene.triangles[1] = {0, 2, 3};

  std::vector<double> tops(lots.size());
  ForEachItem(lots.size(), options.progress, 0.7, [&](size_t i) {
    Random random(options.seed, i);
    const auto uniform = [&](double lo, double hi) { return lo + (hi - lo) * random.NextDouble(); };
    const Lot& lot = lots[i];
    Vec3d lo{Begin(lot.x), 0, Begin(lot.z)}, hi{lo.x + kLot, 0, lo.z + kLot};
    const auto shrink = [&](double least, double most) {
      lo.x += uniform(least, most);
      lo.z += uniform(least, most);
      hi.x -= uniform(least, most);
      hi.z -= uniform(least, most);
      lo.y = hi.y;
    };
    // Few are high, and the highest stand in the middle.
    const double away = std::sqrt(double(lot.distance)) / 2 * kLot / downtown, u = random.NextDouble();
    const double height = 8 + 14 * u + 260 * u * u * u * u / (1 + away * away * away * away);
    const uint32_t wall = walls[random.Below(std::size(walls))];
    Builder builder(scene, strips, i, TrianglesOfABuilding(c));
    shrink(1, 2.5);
    lo.y = 0;
    hi.y = uniform(4, 7);
    builder.Box(lo, hi, walls[random.Below(std::size(walls))]);
    shrink(0.5, 4);
    hi.y = lo.y + height;
    builder.Tower(lo, hi, wall, glass);
    shrink(2, 4);
    hi.y = lo.y + uniform(2.5, 5);
    builder.Box(lo, hi, walls[0]);
    tops[i] = hi.y;
  });

  const double top = *std::max_element(tops.begin(), tops.end()), reach = std::max(radius, 0.95 * top);
  scene.cameras.push_back({ToFloat(Vec3d{0.55, 0, 1.35} * reach + Vec3d{0, 0.35 * reach + 0.9 * top, 0}),
                           ToFloat({0, 0.4 * top, 0.1 * radius}),
                           {0, 1, 0},
                           0.41421356f});
  scene.lights = {{ToFloat(Vec3d{-5, 6, 3} * reach), Vec3f{1, 0.95f, 0.85f} * 0.8f, false},
                  {ToFloat(Vec3d{4, 5, 6} * reach), Vec3f{0.8f, 0.9f, 1} * 0.25f, false}};
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kCityGenerator = {"city",
                                  "boxes of varying heights, chosen by the seed, on a street grid: long thin "
                                  "facades on one large ground",
                                  "own",
                                  kParams,
                                  std::size(kParams),
                                  sizeof(Config),
                                  Count,
                                  Generate};

}  // namespace raybench
