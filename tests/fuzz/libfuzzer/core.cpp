// The fuzzer's core on bytes: they become geometry, rays and a structure, before which every promise is looked at.
// Two bytes of structure and seed, one of mode, then a primitive or a ray after the other.
#include <cstring>
#include <limits>

#include "accel/base/random.h"
#include "accel/contract/valid_ray.h"
#include "harness/fuzz/examine.h"
#include "harness/fuzz/generate.h"
#include "harness/fuzz/lattice.h"
#include "tests/fuzz/libfuzzer/target.h"

namespace raybench::fuzz {
namespace {

class Decoder {
 public:
  Decoder(const uint8_t* data, size_t size) : data_(data), end_(data + size) {}

  bool AtEnd() const { return data_ == end_; }
  uint8_t Byte() { return AtEnd() ? uint8_t{0} : *data_++; }

  Case Decode(const Registry& registry) {
    const auto structures = registry.structures();
    const rb_structure& structure = *structures[Byte() % structures.size()];
    Random random(Byte(), 0);
    case_.structure = random.Below(2) ? DrawParameters(structure, random) : structure.name;
    case_.exact = Byte() % 2 != 0;
    while (!AtEnd() && case_.primitives() < 40 && case_.rays.size() < 20) Item();
    return std::move(case_);
  }

 private:
  void Item() {
    switch (Byte() % (case_.exact ? 4 : 6)) {
      case 0:
      case 1:
        case_.triangles.push_back({Vertex(), Vertex(), Vertex()});
        break;
      case 2:
      case 3:
        Ray();
        break;
      case 4:
        case_.spheres.push_back({Point(), Number()});
        break;
      default:
        case_.cones.push_back({Point(), Number(), Point(), Number()});
    }
  }
  /// A new one, or, by a byte from 128 on, one that is there.
  uint32_t Vertex() {
    const uint8_t byte = Byte();
    if (byte >= 128 && !case_.positions.empty()) return uint32_t(byte % case_.positions.size());
    case_.positions.push_back(Point());
    return uint32_t(case_.positions.size() - 1);
  }
  Vec3f Point() {
    const float x = Number(), y = Number(), z = Number();
    return {x, y, z};
  }
  /// A small integer in a byte, or, in chaotic mode after 255, the bits of a float.
  float Number() {
    const uint8_t byte = Byte();
    if (case_.exact) return float(int(byte) % (2 * kLattice + 1) - kLattice);
    if (byte == 254) return -0.0f;
    if (byte != 255) return float(int(byte) - 127) / 16;
    uint32_t bits = 0;
    for (int i = 0; i < 4; ++i) bits = bits << 8 | Byte();
    float x;
    std::memcpy(&x, &bits, sizeof x);
    return x;
  }
  void Ray() {
    const Vec3f org = Point(), dir = Point();
    rb_ray ray{{org.x, org.y, org.z}, 0, {dir.x, dir.y, dir.z}, std::numeric_limits<float>::infinity()};
    const uint8_t ends = Byte();
    if (ends % 4 == 1) ray.tnear = float(ends) / 64;
    if (ends % 4 == 2) ray.tfar = float(ends) / 16;
    if (IsValidRay(ray)) case_.rays.push_back(ray);
  }

  const uint8_t *data_, *end_;
  Case case_;
};

}  // namespace
}  // namespace raybench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace raybench;
  using namespace raybench::fuzz;
  static const Registry registry;
  const Case c = Decoder(data, size).Decode(registry);
  if (c.rays.empty() || c.primitives() == 0) return 0;
  try {
    const Examination e = Examine(registry, c);
    for (const Finding& finding : e.findings)
      Broken(fmt::format("{}: {}\n{}", finding.check, finding.text, Format(c)));
  } catch (const InputError&) {
    // A degenerate triangle, or numbers out of the range of scenes: no case.
  }
  return 0;
}
