#include "tracer/film.h"

#include <array>
#include <cmath>
#include <utility>

namespace raybench {
namespace {

/// Along one axis: the pixels that a sample at `place` counts for, and how much.
struct Support {
  uint32_t begin, count = 0;
  std::array<float, 4> weights;

  Support(ReconstructionFilter filter, float place, uint32_t pixels) {
    const float radius = FilterRadius(filter);
    begin = uint32_t(std::max(0.0f, std::floor(place - 0.5f - radius) + 1));
    for (uint32_t i = begin; i < pixels && count < weights.size(); ++i) {
      const float offset = float(i) + 0.5f - place;
      if (offset >= radius) break;
      weights[count++] = FilterWeight(filter, offset);
    }
  }
};

}  // namespace

Film::Film(uint32_t width, uint32_t height, const Sampling& sampling)
    : width_(width),
      height_(height),
      sampling_(sampling),
      filter_(sampling.filter),
      sums_(size_t{width} * height),
      weights_(size_t{width} * height) {
  const bool corners = sampling.pattern == SamplePattern::kCorners;
  // At corners, which stand half a pixel off, a tent weighs the four around a pixel alike.
  if (corners && filter_ == ReconstructionFilter::kBox) filter_ = ReconstructionFilter::kTent;
  sums_only_pixel_ = filter_ == ReconstructionFilter::kBox;
}

void Film::Add(uint32_t x, uint32_t y, uint32_t index, Vec3f color, float weight) {
  const auto add = [&](size_t pixel, float w) {
    sums_[pixel] = sums_[pixel] + color * w;
    weights_[pixel] += w;
  };
  if (sums_only_pixel_) return add(size_t{y} * width_ + x, weight);
  const Vec2f place = SamplePlace(sampling_, x, y, index);
  const Support across(filter_, place.u, width_), down(filter_, place.v, height_);
  for (uint32_t j = 0; j < down.count; ++j)
    for (uint32_t i = 0; i < across.count; ++i)
      add(size_t{down.begin + j} * width_ + across.begin + i, weight * down.weights[j] * across.weights[i]);
}

Image Film::Develop() {
  Image image{width_, height_, std::move(sums_)};
  // Negative lobes could leave a pixel with next to no weight only if its own samples were far off.
  for (size_t i = 0; i < image.pixels.size(); ++i)
    image.pixels[i] = weights_[i] > 0 ? image.pixels[i] * (1 / weights_[i]) : Vec3f{0, 0, 0};
  weights_ = {};
  return image;
}

}  // namespace raybench
