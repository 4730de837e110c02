#include <OpenImageIO/imageio.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>

#include "accel/base/error.h"
#include "accel/base/random.h"
#include "tracer/image_io.h"

namespace raybench {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

class TracerImageIo : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string pattern = (fs::temp_directory_path() / "raybench-image-XXXXXX").string();
    ASSERT_NE(::mkdtemp(pattern.data()), nullptr);
    directory_ = pattern;
  }
  void TearDown() override { fs::remove_all(directory_); }

  std::string Path(const std::string& name) const { return (directory_ / name).string(); }
  size_t FileCount() const {
    return size_t(std::distance(fs::directory_iterator(directory_), fs::directory_iterator()));
  }
  static Image Noise(uint32_t width, uint32_t height) {
    Image image{width, height, {}};
    Random random(1);
    for (size_t i = 0; i < size_t{width} * height; ++i)
      image.pixels.push_back({random.NextFloat(), random.NextFloat(), random.NextFloat()});
    return image;
  }
  template <class Action>
  static std::string ErrorOf(const Action& action) {
    try {
      action();
    } catch (const InputError& error) {
      return error.what();
    }
    return "no InputError";
  }

  fs::path directory_;
};

TEST_F(TracerImageIo, ExrHoldsNamedLayersBesideThePicture) {
  const Image image = Noise(33, 17);
  Channel steps{"bvh_sah(numerics=fast,cost=1.5).steps", {}}, prims{"a.prims", {}};
  Random random(2);
  for (size_t i = 0; i < image.pixels.size(); ++i) {
    steps.values.push_back(float(random.Below(1 << 24)));
    prims.values.push_back(float(i));
  }
  WriteLayers(image, {steps, prims}, Path("a.exr"), "raybench test");
  EXPECT_EQ(ReadImage(Path("a.exr")).pixels, image.pixels);
  const auto input = OIIO::ImageInput::open(Path("a.exr"));
  ASSERT_TRUE(input);
  ASSERT_EQ(input->spec().nchannels, 5);
  EXPECT_EQ(input->spec().format, OIIO::TypeDesc::FLOAT);
  for (const Channel& channel : {steps, prims}) {
    const int index = input->spec().channelindex(channel.name);
    ASSERT_GE(index, 3) << channel.name;
    std::vector<float> read(channel.values.size());
    ASSERT_TRUE(input->read_image(0, 0, index, index + 1, OIIO::TypeDesc::FLOAT, read.data()));
    EXPECT_EQ(read, channel.values) << channel.name;
  }
  EXPECT_EQ(FileCount(), 1u);

  EXPECT_THAT(ErrorOf([&] { WriteLayers(image, {steps}, Path("b.png"), "t"); }),
              HasSubstr("b.png: only .exr"));
  steps.values.pop_back();
  EXPECT_THAT(ErrorOf([&] { WriteLayers(image, {steps}, Path("b.exr"), "t"); }), HasSubstr("not as large"));
  EXPECT_EQ(FileCount(), 1u);
}

TEST_F(TracerImageIo, ExrKeepsEveryFloat) {
  Image image = Noise(33, 17);
  image.pixels[5] = {-1, 1e20f, 1e-20f};
  WriteImage(image, Path("a.exr"), "raybench test");
  const Image read = ReadImage(Path("a.exr"));
  ASSERT_EQ(read.width, 33u);
  ASSERT_EQ(read.height, 17u);
  EXPECT_EQ(read.pixels, image.pixels);
  EXPECT_EQ(FileCount(), 1u);  // nothing temporary is left
}

TEST_F(TracerImageIo, PngIsEightBitSrgb) {
  Image image = Noise(31, 9);
  image.pixels[0] = {-3, 2, std::nanf("")};
  WriteImage(image, Path("a.png"), "raybench test");
  const Image read = ReadImage(Path("a.png"));
  ASSERT_EQ(read.width, 31u);
  ASSERT_EQ(read.height, 9u);
  EXPECT_EQ(read.pixels[0], (Vec3f{0, 1, 0}));
  for (size_t i = 1; i < read.pixels.size(); ++i)
    for (int c = 0; c < 3; ++c) {
      // Half a step of the code; the curve's slope is at most 2.4 / 1.055 in linear light.
      ASSERT_NEAR(read.pixels[i][c], image.pixels[i][c], 0.5 / 255 * 2.28 + 1e-4) << i;
    }
  // What is read is written again to the same codes.
  WriteImage(read, Path("b.png"), "raybench test");
  EXPECT_EQ(ReadImage(Path("b.png")).pixels, read.pixels);
}

TEST_F(TracerImageIo, MiddleGreyIsEncodedBySrgbCurve) {
  Image image{1, 1, {{0.5f, 0.21404114f, 0.002f}}};  // codes 187.5 (rounds to 188), 127.5, 6.6
  WriteImage(image, Path("a.png"), "t");
  const Vec3f p = ReadImage(Path("a.png")).pixels[0];
  auto decode = [](double code) {
    const double x = code / 255;
    return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
  };
  EXPECT_NEAR(p.x, decode(188), 1e-6);
  EXPECT_NEAR(p.z, decode(7), 1e-6);
}

TEST_F(TracerImageIo, ReplacesAnOlderFile) {
  WriteImage(Noise(4, 4), Path("a.png"), "t");
  WriteImage(Noise(5, 3), Path("a.png"), "t");
  EXPECT_EQ(ReadImage(Path("a.png")).width, 5u);
}

TEST_F(TracerImageIo, UpperCaseExtensionIsKnown) {
  WriteImage(Noise(4, 4), Path("a.PNG"), "t");
  EXPECT_EQ(ReadImage(Path("a.PNG")).width, 4u);
}

TEST_F(TracerImageIo, ErrorsNameTheFileAndWhatIsAllowed) {
  const Image image = Noise(4, 4);
  auto write = [&](const std::string& name) { return ErrorOf([&] { WriteImage(image, Path(name), "t"); }); };
  EXPECT_THAT(write("a.bmp"), ::testing::AllOf(HasSubstr("a.bmp"), HasSubstr(".png"), HasSubstr(".exr")));
  EXPECT_THAT(write("a"), HasSubstr(".png"));
  EXPECT_THAT(write("missing/a.png"),
              ::testing::AllOf(HasSubstr("missing/a.png"), HasSubstr("No such file")));
  std::ofstream(Path("file")) << "x";
  EXPECT_THAT(write("file/a.exr"), HasSubstr("file/a.exr"));
  fs::create_directory(Path("dir.png"));
  EXPECT_THAT(write("dir.png"), HasSubstr("dir.png"));
  EXPECT_EQ(FileCount(), 2u) << "something half-written was left";

  EXPECT_THAT(ErrorOf([&] { WriteImage({4, 4, {}}, Path("a.png"), "t"); }), HasSubstr("a.png"));
  EXPECT_THAT(ErrorOf([&] { WriteImage({}, Path("a.png"), "t"); }), HasSubstr("a.png"));

  EXPECT_THAT(ErrorOf([&] { ReadImage(Path("none.png")); }), HasSubstr("none.png"));
  EXPECT_THAT(ErrorOf([&] { ReadImage(Path("none.jpg")); }), HasSubstr(".exr"));
  std::ofstream(Path("broken.png")) << "not a picture";
  std::ofstream(Path("broken.exr")) << "not a picture";
  for (const char* name : {"broken.png", "broken.exr"}) {
    const std::string error = ErrorOf([&] { ReadImage(Path(name)); });
    EXPECT_THAT(error, HasSubstr(name));
    EXPECT_EQ(error.find('\n'), std::string::npos);
  }
}

}  // namespace
}  // namespace raybench
