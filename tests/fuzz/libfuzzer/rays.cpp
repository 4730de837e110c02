// The reader of .rays files on bytes. Unless the first byte is even, checksums and the scene's hash are made right
// before, so that what lies behind them is reached.
#include <cstring>

#include "accel/base/hash.h"
#include "accel/contract/valid_ray.h"
#include "datasets/scene/scene.h"
#include "tests/fuzz/libfuzzer/target.h"
#include "tracer/rays/ray_file.h"

namespace raybench::fuzz {
namespace {

const Scene& TheScene() {
  static const Scene scene = LoadScene("icosphere(level=1)");
  return scene;
}

uint64_t HashOf(const std::string& bytes, size_t begin, size_t size) {
  Hash64 hash;
  hash.Add(bytes.data() + begin, size);
  return hash.value();
}

/// RAYS.md has the offsets.
void MakeRight(std::string& bytes) {
  if (bytes.size() < 256) return;
  const uint64_t scene = std::stoull(TheScene().hash(), nullptr, 16),
                 rays = HashOf(bytes, 256, bytes.size() - 256);
  std::memcpy(bytes.data() + 32, &scene, 8);
  std::memcpy(bytes.data() + 40, &rays, 8);
  const uint64_t header = HashOf(bytes, 0, 248);
  std::memcpy(bytes.data() + 248, &header, 8);
}

}  // namespace
}  // namespace raybench::fuzz

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace raybench;
  using namespace raybench::fuzz;
  if (size < 1) return 0;
  std::string bytes(Bytes(data + 1, size - 1));
  if (data[0] % 2 != 0) MakeRight(bytes);
  const auto path = Written("input.rays", bytes);
  try {
    const RayFile file = ReadRayFile(path);
    Demand(file.rays.size() == file.header.count && file.header.count > 0, "number of rays");
    const RaySet set = ReplayedSet(file, TheScene());
    Demand(set.rays.size() == file.rays.size(), "number of rays replayed");
    for (const rb_ray& ray : set.rays) Demand(IsValidRay(ray), "a ray that is not valid");
  } catch (const InputError& error) {
    DemandOneLine(error.what(), path.string());
  }
  return 0;
}
