// Where on the image plane camera rays go, and how their colours become pixels.
#pragma once

#include <cstdint>

#include "datasets/texture.h"

namespace raybench {

enum class SamplePattern : uint8_t {
  kCenter,   ///< one ray through the middle of each pixel
  kCorners,  ///< one ray through each corner, shared by the pixels around it: (width + 1) x (height + 1) rays
  kUniform,  ///< a regular n x n grid in each pixel
  kJittered,        ///< one random place in each cell of that grid
  kLowDiscrepancy,  ///< n * n points of a (0,2)-sequence, scrambled by pixel
};
enum class ReconstructionFilter : uint8_t { kBox, kTent, kGaussian, kMitchell };

/// All of it is a function of these, the pixel and the sample's number; never of threads.
struct Sampling {
  SamplePattern pattern = SamplePattern::kCenter;
  uint32_t grid = 1;  ///< n of n x n samples a pixel, in [1, 64]; 1 with kCenter and kCorners
  ReconstructionFilter filter = ReconstructionFilter::kBox;
  /// Adaptive supersampling: pixels whose samples, or whose neighbours' first samples, differ by more than
  /// this in a channel (after tone clamping to [0, 1]) get the whole n x n grid, others one sample; 0: off.
  float adaptive_contrast = 0;
  uint64_t seed = 1;
};

/// Number of rays of a picture without adaptation.
uint64_t SampleCount(const Sampling& sampling, uint32_t width, uint32_t height);

/// The place of sample `index` (< grid * grid) of pixel (x, y), in pixels from the upper left corner of the
/// picture: the middle of pixel (0, 0) is (0.5, 0.5).
Vec2f SamplePlace(const Sampling& sampling, uint32_t x, uint32_t y, uint32_t index);

/// Half the width of the filter's support, in pixels.
float FilterRadius(ReconstructionFilter filter);

/// The filter at an offset (dx, dy) from a pixel's middle, in pixels; not normalised. 0 from FilterRadius() on.
float FilterWeight(ReconstructionFilter filter, float dx, float dy);

}  // namespace raybench
