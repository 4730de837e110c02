#include "tracer/sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <set>

#include "tests/support/tracer.h"
#include "tracer/film.h"

namespace raybench {
namespace {

using testing::AddMaterial;
using testing::AddQuad;
using testing::BuildTree;
using testing::FindSet;
using testing::MixedScene;

constexpr SamplePattern kPatterns[] = {SamplePattern::kCenter, SamplePattern::kCorners,
                                       SamplePattern::kUniform, SamplePattern::kJittered,
                                       SamplePattern::kLowDiscrepancy};
constexpr ReconstructionFilter kFilters[] = {ReconstructionFilter::kBox, ReconstructionFilter::kTent,
                                             ReconstructionFilter::kGaussian,
                                             ReconstructionFilter::kMitchell};

uint32_t GridOf(SamplePattern pattern, uint32_t grid) {
  return pattern == SamplePattern::kCenter || pattern == SamplePattern::kCorners ? 1 : grid;
}

TEST(TracerSampling, Ranges) {
  EXPECT_THROW(CheckSampling({.pattern = SamplePattern::kUniform, .grid = 0}), InputError);
  EXPECT_THROW(CheckSampling({.pattern = SamplePattern::kUniform, .grid = 65}), InputError);
  EXPECT_THROW(CheckSampling({.pattern = SamplePattern::kCenter, .grid = 2}), InputError);
  EXPECT_THROW(CheckSampling({.pattern = SamplePattern::kCorners, .grid = 2}), InputError);
  EXPECT_THROW(CheckSampling({.adaptive_contrast = -1}), InputError);
  EXPECT_THROW(CheckSampling({.adaptive_contrast = std::nanf("")}), InputError);
  CheckSampling({.pattern = SamplePattern::kUniform, .grid = 64, .adaptive_contrast = 0.1f});
}

TEST(TracerSampling, PlacesLieWhereTheirPatternSays) {
  EXPECT_EQ(SamplePlace({}, 3, 7, 0), (Vec2f{3.5f, 7.5f}));
  EXPECT_EQ(SamplePlace({.pattern = SamplePattern::kCorners}, 3, 7, 0), (Vec2f{3, 7}));
  EXPECT_EQ(SamplePlace({.pattern = SamplePattern::kUniform, .grid = 2}, 3, 7, 1), (Vec2f{3.75f, 7.25f}));
  for (uint32_t grid : {1u, 2u, 5u, 64u})
    for (uint32_t pixel = 0; pixel < 20; ++pixel) {
      const Sampling jittered{.pattern = SamplePattern::kJittered, .grid = grid, .seed = 9};
      for (uint32_t i = 0; i < grid * grid; ++i) {
        const Vec2f p = SampleOffset(jittered, pixel, 5, i);
        ASSERT_EQ(uint32_t(p.u * float(grid)), i % grid) << grid;  // each in its own cell
        ASSERT_EQ(uint32_t(p.v * float(grid)), i / grid) << grid;
      }
    }
}

TEST(TracerSampling, LowDiscrepancyPointsFillEveryElementaryInterval) {
  // A (0, 2)-sequence: of its first 2^m points each box of 2^-a x 2^-(m-a) holds just one.
  const Sampling sampling{.pattern = SamplePattern::kLowDiscrepancy, .grid = 16, .seed = 4};
  for (uint32_t pixel : {0u, 77u})
    for (uint32_t m : {2u, 4u, 8u})
      for (uint32_t a = 0; a <= m; ++a) {
        std::set<std::pair<uint32_t, uint32_t>> boxes;
        for (uint32_t i = 0; i < 1u << m; ++i) {
          const Vec2f p = SampleOffset(sampling, pixel, 3, i);
          boxes.insert({uint32_t(p.u * float(1u << a)), uint32_t(p.v * float(1u << (m - a)))});
        }
        EXPECT_EQ(boxes.size(), 1u << m) << m << " " << a;
      }
}

TEST(TracerSampling, SeedAndPixelDecide) {
  for (SamplePattern pattern : {SamplePattern::kJittered, SamplePattern::kLowDiscrepancy}) {
    const Sampling a{.pattern = pattern, .grid = 4, .seed = 1}, b{.pattern = pattern, .grid = 4, .seed = 2};
    EXPECT_EQ(SampleOffset(a, 3, 4, 5), SampleOffset(a, 3, 4, 5));
    EXPECT_FALSE(SampleOffset(a, 3, 4, 5) == SampleOffset(b, 3, 4, 5));
    EXPECT_FALSE(SampleOffset(a, 3, 4, 5) == SampleOffset(a, 4, 3, 5));
    double mean = 0;
    for (uint32_t x = 0; x < 1000; ++x) mean += double(SampleOffset(a, x, 0, 5).u) / 1000;
    // Cell 1 of 4, or anywhere: mean 0.375 and 0.5, standard deviations 1/4 and 1 over sqrt(12 000).
    const bool jittered = pattern == SamplePattern::kJittered;
    EXPECT_NEAR(mean, jittered ? 0.375 : 0.5, (jittered ? 0.25 : 1.0) * 5 / std::sqrt(12000.0));
  }
}

TEST(TracerFilter, SumsToOneOverPixelsAndEndsAtItsRadius) {
  for (ReconstructionFilter filter : kFilters) {
    const float radius = FilterRadius(filter);
    EXPECT_EQ(FilterWeight(filter, radius), 0);
    EXPECT_EQ(FilterWeight(filter, -radius), 0);
    EXPECT_NE(FilterWeight(filter, std::nextafter(radius, 0.0f) - 0.01f), 0);
    EXPECT_EQ(FilterWeight(filter, -0.2f), FilterWeight(filter, 0.2f));
    for (float offset = -0.49f; offset < 0.5f; offset += 0.01f) {
      double sum = 0;
      for (int i = -3; i <= 3; ++i) sum += double(FilterWeight(filter, offset + float(i)));
      // Terms of at most 4 and a few roundings of 2^-24 each; the gaussian is normalised by the film alone.
      if (filter != ReconstructionFilter::kGaussian) {
        ASSERT_NEAR(sum, 1, 32 * 0x1p-24) << offset;
      } else {
        ASSERT_GT(sum, 1);
      }
    }
  }
  EXPECT_LT(FilterWeight(ReconstructionFilter::kMitchell, 1.5f), 0) << "negative lobes";
}

TEST(TracerFilm, AConstantStaysConstant) {
  // Each pixel is a mean with weights: rounded some hundred times at most.
  for (SamplePattern pattern : kPatterns)
    for (ReconstructionFilter filter : kFilters) {
      Scene scene;
      scene.background = {0.25f, 0.7f, 3};
      scene.Finish();
      const Sampling sampling{.pattern = pattern, .grid = GridOf(pattern, 3), .filter = filter};
      const TraceResult result =
          Trace(scene, BuildTree(scene), {.width = 11, .height = 9, .sampling = sampling});
      EXPECT_EQ(result.camera_rays,
                sampling.pattern == SamplePattern::kCorners ? 12 * 10 : 11 * 9 * sampling.PixelSamples());
      ASSERT_EQ(result.image.pixels.size(), 99u);
      for (const Vec3f& pixel : result.image.pixels)
        for (int c = 0; c < 3; ++c)
          ASSERT_NEAR(pixel[c], scene.background[c], double(scene.background[c]) * 300 * 0x1p-24);
    }
}

TEST(TracerFilm, APixelIsTheMeanOfItsFourCorners) {
  Film film(3, 2, {.pattern = SamplePattern::kCorners});
  const auto value = [](uint32_t x, uint32_t y) { return float(x * x + 10 * y * y * y); };
  for (uint32_t y = 0; y <= 2; ++y)
    for (uint32_t x = 0; x <= 3; ++x) film.Add(x, y, 0, {value(x, y), 1, 0}, 1);
  const Image image = film.Develop();
  for (uint32_t y = 0; y < 2; ++y)
    for (uint32_t x = 0; x < 3; ++x) {
      const float mean = (value(x, y) + value(x + 1, y) + value(x, y + 1) + value(x + 1, y + 1)) / 4;
      EXPECT_EQ(image.pixels[y * 3 + x], (Vec3f{mean, 1, 0}));
    }
}

TEST(TracerFilm, CornerRaysAreSharedAndSpanThePicture) {
  Scene scene;
  scene.cameras = {{.eye = {0, 0, 0}, .at = {0, 0, -1}, .tan_half_fov = 0.5f}};
  scene.Finish();
  const TraceResult result =
      Trace(scene, BuildTree(scene),
            {.width = 6, .height = 7, .sampling = {.pattern = SamplePattern::kCorners}, .capture = true});
  const std::vector<rb_ray>& rays = FindSet(result, "camera")->rays;
  ASSERT_EQ(rays.size(), 56u);  // one tile of 7 x 8: row by row
  const double aspect = 6.0 / 7;
  for (uint32_t y = 0; y <= 7; ++y)
    for (uint32_t x = 0; x <= 6; ++x) {
      const rb_ray& ray = rays[y * 7 + x];
      EXPECT_NEAR(ray.dir[0] / -ray.dir[2], 0.5 * aspect * (2 * x / 6.0 - 1), 1e-6);
      EXPECT_NEAR(ray.dir[1] / -ray.dir[2], 0.5 * (1 - 2 * y / 7.0), 1e-6);
    }
}

/// Mean over the middle 8 x 8 of 32 x 32 pixels of 1/2 + 1/2 cos of a zone plate whose frequency there is
/// `frequency` cycles a pixel both ways; `variance` is that of its pixels about 1/2. Without aliasing: 1/2.
double ZonePlate(const Sampling& sampling, double frequency, double* variance = nullptr) {
  Film film(32, 32, sampling);
  for (uint32_t y = 0; y < 32; ++y)
    for (uint32_t x = 0; x < 32; ++x)
      for (uint32_t i = 0; i < sampling.PixelSamples(); ++i) {
        const Vec2f p = SamplePlace(sampling, x, y, i);
        const double dx = double(p.u) - 16, dy = double(p.v) - 16;
        const double cycles = frequency * (dx + dy) + (dx * dx + dy * dy) / 128;
        const auto value = float(0.5 + 0.5 * std::cos(2 * std::numbers::pi * cycles));
        film.Add(x, y, i, {value, value, value}, 1);
      }
  const Image image = film.Develop();
  double mean = 0, square = 0;
  for (uint32_t y = 12; y < 20; ++y)
    for (uint32_t x = 12; x < 20; ++x) {
      const double v = double(image.pixels[y * 32 + x].x);
      mean += v / 64, square += (v - 0.5) * (v - 0.5) / 64;
    }
  if (variance) *variance = square;
  return mean;
}

TEST(TracerZonePlate, UniformSamplingMovesTheAliasAndJitterTurnsItIntoNoise) {
  const Sampling center{}, uniform{.pattern = SamplePattern::kUniform, .grid = 4};
  // At the sampling frequency the aliased rings are slow: the phase changes by 2 pi (4^2 + 4^2) / 128 = pi
  // / 2 at the farthest of the 8 x 8 pixels, and the mean of the cosine stays above 1/2: of the value,
  // above 3/4.
  EXPECT_GT(std::fabs(ZonePlate(center, 1) - 0.5), 0.25);
  // 4 x 4 samples see that frequency as it is (mean 1/2, up to the change of frequency over the block) ...
  EXPECT_LT(std::fabs(ZonePlate(uniform, 1) - 0.5), 0.02);
  // ... and are taken in by four times as much.
  EXPECT_GT(std::fabs(ZonePlate(uniform, 4) - 0.5), 0.25);

  // Independent samples of a cosine have variance 1/8, means of n of them 1/8n: five standard deviations.
  for (uint32_t grid : {1u, 4u})
    for (uint64_t seed : {1, 2, 3}) {
      const Sampling jittered{.pattern = SamplePattern::kJittered, .grid = grid, .seed = seed};
      const double n = grid * grid;
      double variance = 0;
      EXPECT_LT(std::fabs(ZonePlate(jittered, grid, &variance) - 0.5), 5 * std::sqrt(1 / (8 * n * 64)));
      // The energy went into pixels that differ: within a cell the phase is uniform, 1/8n again; its estimate
      // from 64 pixels is good to a factor of 2.
      EXPECT_GT(variance, 1 / (8 * n) / 2);
      EXPECT_LT(variance, 1 / (8 * n) * 2);
    }
}

/// A bright square before a dark background.
Scene Square() {
  Scene scene;
  scene.ambient = scene.background = {0, 0, 0};
  AddMaterial(scene, {.name = "m", .diffuse = {0, 0, 0}, .emission = {1, 1, 1}});
  AddQuad(scene, {-1, -1, -4}, {1, -1, -4}, {1, 1, -4}, {-1, 1, -4});
  scene.cameras = {{.eye = {0, 0, 0}, .at = {0.01f, 0.02f, -1}, .tan_half_fov = 0.5f}};
  scene.Finish();
  return scene;
}

TEST(TracerAdaptive, OnlyPixelsThatDifferFromANeighbourAreRefined) {
  const Scene scene = Square();
  const Tree tree = BuildTree(scene);
  TraceOptions options{
      .width = 40, .height = 40, .sampling = {.pattern = SamplePattern::kUniform, .grid = 4}};
  const TraceResult full = Trace(scene, tree, options);
  options.sampling.adaptive_contrast = 0.1f;
  const TraceResult adaptive = Trace(scene, tree, options);
  EXPECT_EQ(full.camera_rays, 40u * 40 * 16);
  // The square is 20 pixels wide: its edge, 80 pixels long, touches about 2 pixels across.
  EXPECT_GT(adaptive.camera_rays, 1600u + 15 * 2 * 70);
  EXPECT_LT(adaptive.camera_rays, 1600u + 15 * 2 * 90);
  // Everything that shows is at the edge, so nothing is lost. Means of 0 and 1 over 16 are exact.
  EXPECT_EQ(adaptive.image.pixels, full.image.pixels);
  // No contrast is above 1: the first samples alone.
  options.sampling.adaptive_contrast = 1;
  EXPECT_EQ(Trace(scene, tree, options).camera_rays, 1600u);
}

TEST(TracerAdaptive, DoesNotDependOnThreadsOrBands) {
  const Scene scene = MixedScene(31);
  const Tree tree = BuildTree(scene, "bvh_sah");
  for (ReconstructionFilter filter : kFilters) {
    TraceOptions options{.width = 37,
                         .height = 29,
                         .sampling = {.pattern = SamplePattern::kJittered,
                                      .grid = 3,
                                      .filter = filter,
                                      .adaptive_contrast = 0.05f},
                         .threads = 1};
    const TraceResult reference = Trace(scene, tree, options);
    EXPECT_GT(reference.camera_rays, 37u * 29 * 2);
    options.threads = 0, options.band_rays = 333;
    const TraceResult other = Trace(scene, tree, options);
    EXPECT_EQ(other.camera_rays, reference.camera_rays);
    EXPECT_EQ(other.image.pixels, reference.image.pixels);
  }
}

}  // namespace
}  // namespace raybench
