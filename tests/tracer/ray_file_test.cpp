// .rays files: what is written is read back to the bit; what is not as it should be is refused in one line.
#include "tracer/rays/ray_file.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstring>
#include <functional>
#include <limits>

#include "accel/base/hash.h"
#include "tests/support/files.h"
#include "tests/support/tracer.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;
using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

using testing::kInf;
using testing::kNan;

class TracerRayFile : public ::testing::Test {
 protected:
  TracerRayFile() : folder_(fs::path(::testing::TempDir()) / fmt::format("raybench_ray_file_{}", getpid())) {
    fs::create_directories(folder_);
  }
  ~TracerRayFile() override { fs::remove_all(folder_); }

  fs::path Path(const std::string& name = "a.rays") const { return folder_ / name; }

  /// A file of 100 rays of `scene`, as text.
  std::string Good(const Scene& scene) {
    WriteRayFile(Path("good.rays"), RandomRays(scene, 100, 1), scene, "test");
    return Read(Path("good.rays"));
  }

  /// The line that reading `bytes` ends with.
  std::string Refusal(const std::string& bytes) {
    std::ofstream(Path(), std::ios::binary) << bytes;
    return RefusalOf(Path());
  }
  static std::string RefusalOf(const fs::path& path) {
    try {
      ReadRayFile(path);
    } catch (const InputError& error) {
      return error.what();
    }
    return "nothing was thrown";
  }

  static std::string WithHeader(std::string bytes, size_t offset, const std::string& field) {
    bytes.replace(offset, field.size(), field);
    Hash64 hash;
    hash.Add(bytes.data(), 248);
    const uint64_t value = hash.value();
    std::memcpy(bytes.data() + 248, &value, sizeof value);
    return bytes;
  }
  template <class T>
  static std::string Bytes(T value) {
    return std::string(reinterpret_cast<const char*>(&value), sizeof value);
  }

  fs::path folder_;
};

Scene ScaledScene(float size) {
  Scene scene;
  scene.name = "scaled";
  testing::AddFloor(scene, {0, 0, 0}, size);
  testing::AddTriangle(scene, {size, 0, 0}, {0, size, 0}, {0, 0, size});
  scene.Finish();
  return scene;
}

TEST_F(TracerRayFile, WhatIsWrittenIsReadBackToTheBit) {
  for (const float size : {1.0f, 0x1p60f, 0x1p-45f}) {
    const Scene scene = ScaledScene(size);
    EXPECT_EQ(scene.scale_exponent == 0, size == 1);
    RaySet set = RandomRays(scene, 1000, 7);
    set.kind = "shadow", set.depth = 3, set.query = RB_ANY;
    set.rays[5].dir[0] = kNan;
    set.rays[6].tfar = 0.25f, set.rays[7].tnear = 0.125f, set.rays[8].org[1] = -0.0f;
    Freeze(set, scene.bounds());
    ASSERT_EQ(set.invalid_rays, 1u);
    WriteRayFile(Path(), set, scene, "test 1.2");
    EXPECT_EQ(fs::file_size(Path()), 256 + 32 * 1000u);

    const RayFileHeader header = ReadRayFileHeader(Path());
    EXPECT_EQ(header.count, 1000u);
    EXPECT_EQ(header.kind, "shadow");
    EXPECT_EQ(header.depth, 3u);
    EXPECT_EQ(header.query, uint32_t(RB_ANY));
    EXPECT_EQ(header.order, "traced");
    EXPECT_EQ(header.scene_hash, scene.hash());
    EXPECT_EQ(header.software, "test 1.2");
    EXPECT_EQ(header.scene, "scaled");
    const RayFile file = ReadRayFile(Path());
    // In the file, rays have the size of the scene as it was given.
    EXPECT_EQ(file.rays[8].org[2], std::ldexp(set.rays[8].org[2], -scene.scale_exponent));
    EXPECT_EQ(file.rays[6].tfar, 0.25f);
    const RaySet back = ReplayedSet(file, scene);
    EXPECT_EQ(back.hash, set.hash);
    EXPECT_EQ(back.invalid_rays, 1u);
    EXPECT_EQ(back.outside_rays, set.outside_rays);
    EXPECT_EQ(std::memcmp(back.rays.data(), set.rays.data(), 32 * set.rays.size()), 0);
  }
}

TEST_F(TracerRayFile, InvalidRaysInAFileAreReplacedAndCounted) {
  for (const float size : {1.0f, 0x1p60f}) {
    const Scene scene = ScaledScene(size);
    RaySet set = RandomRays(scene, 100, 7);
    set.rays[3].org[0] = kNan;
    set.rays[4] = {{0, 0, 0}, 0, {0, 0, 0}, kInf};
    set.rays[5].tnear = -1;
    const std::string invalid(reinterpret_cast<const char*>(&set.rays[3]), 3 * sizeof(rb_ray));
    std::string bytes = Good(scene);
    bytes.replace(256 + 3 * 32, invalid.size(), invalid);
    Hash64 hash;
    hash.Add(bytes.data() + 256, bytes.size() - 256);
    std::ofstream(Path(), std::ios::binary) << WithHeader(bytes, 40, Bytes(hash.value()));
    const RayFile file = ReadRayFile(Path());
    EXPECT_TRUE(std::isnan(file.rays[3].org[0]));
    const RaySet replayed = ReplayedSet(file, scene);
    EXPECT_EQ(replayed.invalid_rays, 3u);
    const rb_ray stand_in = InvalidRayStandIn();
    for (size_t i : {3, 4, 5}) EXPECT_EQ(std::memcmp(&replayed.rays[i], &stand_in, 32), 0) << i;
  }
}

TEST_F(TracerRayFile, OtherScenesRaysAreRefused) {
  const Scene scene = ScaledScene(1), other = ScaledScene(2);
  Good(scene);
  const RayFile file = ReadRayFile(Path("good.rays"));
  try {
    ReplayedSet(file, other);
    FAIL() << "was accepted";
  } catch (const InputError& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("good.rays: was recorded in 'scaled'"), HasSubstr(scene.hash()),
                                    HasSubstr(other.hash())));
  }
}

TEST_F(TracerRayFile, RaysThatCannotBeScaledWithoutLossAreRefused) {
  const Scene scene = ScaledScene(0x1p100f);
  RaySet set = RandomRays(scene, 4, 1);
  set.rays[2].org[0] = 0x1.8p126f;  // times 2^100 it is infinite
  Freeze(set, scene.bounds());
  EXPECT_THROW(WriteRayFile(Path(), set, scene, "test"), InputError);
  std::string bytes = Good(scene);
  bytes.replace(256 + 32, 4, Bytes(0x1.000002p-120f));  // times 2^-100 a bit is lost
  Hash64 hash;
  hash.Add(bytes.data() + 256, bytes.size() - 256);
  std::ofstream(Path(), std::ios::binary) << WithHeader(bytes, 40, Bytes(hash.value()));
  EXPECT_THROW(ReplayedSet(ReadRayFile(Path()), scene), InputError);
}

TEST_F(TracerRayFile, EveryTruncationAndEveryFlippedBitIsRefused) {
  const std::string good = Good(ScaledScene(1));
  ASSERT_EQ(good.size(), 256 + 3200u);
  for (size_t size = 0; size < good.size(); ++size) {
    if (size > 300 && size % 97 != 0 && size + 2 < good.size()) continue;
    EXPECT_THAT(Refusal(good.substr(0, size)), HasSubstr("a.rays: ")) << size;
  }
  EXPECT_THAT(Refusal(good + '\0'), HasSubstr("goes on after its rays: 100 rays take 3456 bytes"));
  for (size_t bit = 0; bit < 8 * good.size(); bit += bit < 8 * 300 ? 7 : 101) {
    std::string bytes = good;
    bytes[bit / 8] = char(bytes[bit / 8] ^ (1 << bit % 8));
    EXPECT_THAT(Refusal(bytes), HasSubstr("a.rays: ")) << "bit " << bit;
  }
  std::ofstream(Path(), std::ios::binary) << good;
  EXPECT_EQ(ReadRayFile(Path()).rays.size(), 100u);
}

TEST_F(TracerRayFile, WhatIsWrongIsSaidInOneLine) {
  const std::string good = Good(ScaledScene(1));
  const auto text = [](const char* name) { return std::string(name) + std::string(8, '\0'); };
  struct Row {
    std::string bytes, says;
  };
  for (const Row& row : std::vector<Row>{
           {"", "is empty, not a .rays file"},
           {"ply\nformat ascii 1.0\n", "is not a .rays file"},
           {std::string(5000, 'x'), "is not a .rays file"},
           {good.substr(0, 100), "ends after 100 of the header's 256 bytes"},
           {good.substr(0, 256), "is truncated: 100 rays take 3456 bytes, it has 256"},
           {good.substr(0, 3455), "is truncated: 100 rays take 3456 bytes, it has 3455"},
           {WithHeader(good, 8, Bytes(2u)), "version 2; version 1 is read"},
           {WithHeader(good, 12, Bytes(512u)), "512 bytes; version 1 has 256"},
           {WithHeader(good, 16, Bytes(uint64_t{0})), "holds 0 rays"},
           {WithHeader(good, 16, Bytes(uint64_t{1} << 60)), "holds 1152921504606846976 rays"},
           {WithHeader(good, 16, Bytes(uint64_t{0xFFFFFFFF})), "is truncated: 4294967295 rays take"},
           {WithHeader(good, 24, Bytes(2u)), "has query 2"},
           {WithHeader(good, 48, text("")), "has kind ''"},
           {WithHeader(good, 48, text("Ca/mera")), "has kind 'Ca/mera'"},
           {WithHeader(good, 48, std::string(32, 'a')), "1 to 31"},
           {WithHeader(good, 80, text("sorted\n")), "has order 'sorted?'"},
           {good.substr(0, 300) + "?" + good.substr(301), "is damaged: the rays' checksum"},
           {good.substr(0, 100) + "?" + good.substr(101), "is damaged: the header's checksum"},
       }) {
    const std::string line = Refusal(row.bytes);
    EXPECT_THAT(line, AllOf(HasSubstr("a.rays: "), HasSubstr(row.says), Not(HasSubstr("\n"))));
  }
  EXPECT_THAT(RefusalOf(folder_), HasSubstr("is a directory"));
  EXPECT_THAT(RefusalOf(Path("nosuch.rays")), HasSubstr("nosuch.rays: there is no such file"));
  EXPECT_THAT(RefusalOf("/dev/zero"), HasSubstr("/dev/zero: is not a regular file"));
}

TEST_F(TracerRayFile, NothingIsLeftWhereWritingFails) {
  const Scene scene = ScaledScene(1);
  RaySet set = RandomRays(scene, 10, 1);
  fs::create_directories(Path("taken.rays") / "inside");
  EXPECT_THROW(WriteRayFile(Path("taken.rays"), set, scene, "test"), InputError);
  EXPECT_THROW(WriteRayFile(folder_ / "no" / "such.rays", set, scene, "test"), InputError);
  set.kind = "Not a kind";
  EXPECT_THROW(WriteRayFile(Path(), set, scene, "test"), InputError);
  set.kind = "random", set.rays.clear();
  EXPECT_THROW(WriteRayFile(Path(), set, scene, "test"), InputError);
  size_t files = 0;
  for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_)) ++files;
  EXPECT_EQ(files, 1u);
}

}  // namespace
}  // namespace raybench
