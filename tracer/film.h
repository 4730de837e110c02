// Gathers the colours of samples and makes pixels of them.
#pragma once

#include "tracer/sampling.h"
#include "tracer/tracer.h"

namespace raybench {

/// Pixels are weighted means of the samples within the filter's reach. The box is taken by pixel: a sample
/// counts for the pixel that it was made for, a corner for the pixels around it.
class Film {
 public:
  Film(uint32_t width, uint32_t height, const Sampling& sampling);

  /// Whether each pixel is just its sample: then different pixels may be added from different threads.
  bool OneSampleEach() const { return sums_only_pixel_ && sampling_.PixelSamples() == 1; }

  /// Adds sample `index` of pixel (x, y), or corner (x, y). In one order, for sums are rounded.
  void Add(uint32_t x, uint32_t y, uint32_t index, Vec3f color, float weight);

  /// The picture; the film is empty then.
  Image Develop();

 private:
  uint32_t width_, height_;
  Sampling sampling_;
  ReconstructionFilter filter_;
  bool sums_only_pixel_;  ///< a sample adds to one pixel
  std::vector<Vec3f> sums_;
  std::vector<float> weights_;
};

}  // namespace raybench
