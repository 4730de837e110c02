// The Menger sponge: a cube cut into 27, the seven in the middle taken out, and so on with those that stay.
// All its faces are axis-parallel squares in a lattice, many exactly in one plane, edges of many boxes
// coincide, and a ray along a tunnel touches hundreds of them. So it asks for the right answer on ties and
// planes of splitting planes, and is kind to boxes otherwise; the exact counts are known. Only faces between
// inside and outside are made, over shared vertices: the surface is closed at any depth.
//
// A cell (x, y, z) of the lattice of 3^depth is empty if in some base-3 digit at least two coordinates are
// 1. With the digits that are 1 as bits of a word, that is three ands. A lattice point is a vertex if its
// eight cells are neither all empty nor all full, so vertices are bits in a map, and their ids counts of the
// bits before.

#include <bit>
#include <cstddef>
#include <numeric>

#include "datasets/generators/generators.h"

namespace raybench {
namespace {

struct Config {
  int64_t depth;
};

const rb_param kParams[] = {
    IntParam(
        "depth",
        "times it is cut: 4 * 20^depth + 8 * 8^depth triangles: 36,096 at 3, 672,768 at 4, 13,062,144 at 5",
        offsetof(Config, depth), 0, 7, 3),
};

uint64_t Count(const void* config) {
  uint64_t twenty = 1, eight = 1;
  for (int64_t i = 0; i < static_cast<const Config*>(config)->depth; ++i) {
    twenty *= 20;
    eight *= 8;
  }
  return 4 * twenty + 8 * eight;
}

class Sponge {
 public:
  explicit Sponge(int64_t depth) {
    for (int64_t i = 0; i < depth; ++i) cells_ *= 3;
    ones_.resize(size_t(cells_));
    for (int i = 0; i < cells_; ++i) {
      int bit = 0;
      for (int rest = i; rest > 0; rest /= 3, ++bit) ones_[size_t(i)] |= uint32_t(rest % 3 == 1) << bit;
    }
  }

  int cells() const { return cells_; }

  bool IsFull(int x, int y, int z) const {
    if (uint32_t(x) >= uint32_t(cells_) || uint32_t(y) >= uint32_t(cells_) || uint32_t(z) >= uint32_t(cells_))
      return false;
    const uint32_t a = ones_[size_t(x)], b = ones_[size_t(y)], c = ones_[size_t(z)];
    return ((a & b) | (b & c) | (c & a)) == 0;
  }

  bool IsVertex(int x, int y, int z) const {
    int full = 0;
    for (int corner = 0; corner < 8; ++corner)
      full += IsFull(x - (corner & 1), y - (corner >> 1 & 1), z - (corner >> 2));
    return full != 0 && full != 8;
  }

  /// face(axis, side) for each open face of a full cell; side 0 is the lower one.
  template <class Face>
  void ForEachFace(int x, int y, int z, const Face& face) const {
    if (!IsFull(x, y, z)) return;
    for (int axis = 0; axis < 3; ++axis)
      for (int side = 0; side < 2; ++side) {
        const int step = 2 * side - 1;
        if (!IsFull(x + (axis == 0 ? step : 0), y + (axis == 1 ? step : 0), z + (axis == 2 ? step : 0)))
          face(axis, side);
      }
  }

 private:
  int cells_ = 1;
  std::vector<uint32_t> ones_;
};

/// Lattice points marked in z order, then y, then x; a marked point's id is the number of marks before it.
class PointIds {
 public:
  PointIds(const Sponge& sponge, const std::function<void(double)>& progress)
      : points_(size_t(sponge.cells()) + 1), row_words_((points_ + 63) / 64) {
    bits_.resize(points_ * points_ * row_words_);
    before_.resize(points_ * points_ * row_words_);
    ForEachItem(points_, progress, 0.4, [&](size_t z) {
      for (size_t y = 0; y < points_; ++y)
        for (size_t x = 0; x < points_; ++x)
          if (sponge.IsVertex(int(x), int(y), int(z))) bits_[Word(x, y, z)] |= uint64_t{1} << (x % 64);
    });
    for (size_t word = 0; word < bits_.size(); ++word) {
      before_[word] = uint32_t(count_);
      count_ += size_t(std::popcount(bits_[word]));
    }
  }

  size_t count() const { return count_; }
  bool Has(size_t x, size_t y, size_t z) const { return (bits_[Word(x, y, z)] >> (x % 64) & 1) != 0; }
  uint32_t operator()(size_t x, size_t y, size_t z) const {
    const size_t word = Word(x, y, z);
    const uint64_t lower = bits_[word] & ((uint64_t{1} << (x % 64)) - 1);
    return before_[word] + uint32_t(std::popcount(lower));
  }

 private:
  size_t Word(size_t x, size_t y, size_t z) const { return (z * points_ + y) * row_words_ + x / 64; }

  size_t points_, row_words_, count_ = 0;
  std::vector<uint64_t> bits_;
  std::vector<uint32_t> before_;
};

Scene Generate(const void* config, const LoadOptions& options) {
  const Sponge sponge(static_cast<const Config*>(config)->depth);
  const PointIds ids(sponge, options.progress);
  const size_t n = size_t(sponge.cells());

  Scene scene;
  scene.provenance.source = "menger";
  Material outside, inside;
  outside.name = "outer faces";
  outside.diffuse = {0.72f, 0.66f, 0.55f};
  outside.specular = {0.1f, 0.1f, 0.1f};
  inside.name = "tunnels";
  inside.diffuse = {0.78f, 0.42f, 0.26f};
  inside.reflect = {0.15f, 0.12f, 0.1f};
  const uint32_t outer = AddMaterial(scene, outside), inner = AddMaterial(scene, inside);

  scene.positions.resize(ids.count());
  ForEachItem(n + 1, {}, 0, [&](size_t z) {
    const auto coordinate = [&](size_t i) { return float(2.0 * double(i) / double(n) - 1); };
    for (size_t y = 0; y <= n; ++y)
      for (size_t x = 0; x <= n; ++x)
        if (ids.Has(x, y, z)) scene.positions[ids(x, y, z)] = {coordinate(x), coordinate(y), coordinate(z)};
  });

  // Faces are counted layer by layer first, so that all layers can be filled at once.
  const auto for_each_face = [&](size_t z, const auto& face) {
    for (int y = 0; y < int(n); ++y)
      for (int x = 0; x < int(n); ++x)
        sponge.ForEachFace(x, y, int(z), [&](int axis, int side) { face(x, y, axis, side); });
  };
  std::vector<size_t> start(n + 1);
  ForEachItem(n, {}, 0, [&](size_t z) { for_each_face(z, [&](int, int, int, int) { ++start[z + 1]; }); });
  std::partial_sum(start.begin(), start.end(), start.begin());
  scene.triangles.resize(2 * start[n]);
  scene.triangle_material.resize(2 * start[n]);
  ForEachItem(n, {}, 0, [&](size_t z) {
    size_t next = 2 * start[z];
    for_each_face(z, [&](int x, int y, int axis, int side) {
      // The square's corners in the two other directions, counter-clockwise seen from outside.
      const size_t cell[3] = {size_t(x), size_t(y), z};
      uint32_t corner[4];
      for (int k = 0; k < 4; ++k) {
        size_t p[3] = {cell[0], cell[1], cell[2]};
        p[axis] += size_t(side);
        const int walk = side == 1 ? k : 3 - k;
        p[(axis + 1) % 3] += size_t(walk == 1 || walk == 2);
        p[(axis + 2) % 3] += size_t(walk >= 2);
        corner[k] = ids(p[0], p[1], p[2]);
      }
      const uint32_t material = cell[axis] == (side == 1 ? n - 1 : 0) ? outer : inner;
      scene.triangle_material[next] = scene.triangle_material[next + 1] = material;
      scene.triangles[next++] = {corner[0], corner[1], corner[2]};
      scene.triangles[next++] = {corner[0], corner[2], corner[3]};
    });
  });
  scene.cameras.push_back({{2.45f, 1.75f, 3.35f}, {0, -0.08f, 0}, {0, 1, 0}, 0.41421356f});
  scene.Finish();
  return scene;
}

}  // namespace

const Generator kMengerGenerator = {
    "menger",
    "Menger sponge: closed, all faces along the axes, many in one plane; the seed changes nothing",
    "Menger, Allgemeine Raeume und Cartesische Raeume, 1926",
    kParams,
    std::size(kParams),
    sizeof(Config),
    Count,
    Generate};

}  // namespace raybench
