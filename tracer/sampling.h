// Where on the image plane camera rays go, and how their colours become pixels.
#pragma once

#include <cstdint>

#include "datasets/scene/texture.h"  // Vec2f

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
  /// Adaptive supersampling (Whitted 1980): a pixel whose first sample differs by more than this in a channel
  /// (after clamping to [0, 1]) from that of one of its 8 neighbours gets the whole n x n grid, others that
  /// one sample; 0: off.
  float adaptive_contrast = 0;
  uint64_t seed = 1;

  uint32_t PixelSamples() const { return grid * grid; }
  /// The sample that adaptation begins with: the grid's middle one.
  uint32_t FirstSample() const { return grid / 2 * grid + grid / 2; }
};

/// Throws InputError where a number lies outside the ranges above.
void CheckSampling(const Sampling& sampling);

/// The place of sample `index` (< grid * grid) in pixel (x, y), from its upper left corner, in [0, 1) pixels.
Vec2f SampleOffset(const Sampling& sampling, uint32_t x, uint32_t y, uint32_t index);

/// The place of sample `index` (< grid * grid) of pixel (x, y), in pixels from the upper left corner of the
/// picture: the middle of pixel (0, 0) is (0.5, 0.5).
Vec2f SamplePlace(const Sampling& sampling, uint32_t x, uint32_t y, uint32_t index);

/// Half the width of the filter's support, in pixels.
float FilterRadius(ReconstructionFilter filter);

/// The filter along one axis, at an offset from a pixel's middle; not normalised. The gaussian is that of
/// standard deviation 1/2, lowered to be 0 at the radius; Mitchell's has B = C = 1/3 (Mitchell, Netravali
/// 1988) and negative lobes. Both sides of a box belong to its neighbours.
float FilterWeight(ReconstructionFilter filter, float offset);

}  // namespace raybench
