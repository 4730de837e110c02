#include "tracer/sampling.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "accel/base/error.h"
#include "accel/base/random.h"

namespace raybench {
namespace {

constexpr float kBelowOne = 1 - 0x1p-24f;

bool HasGrid(const Sampling& sampling) {
  return sampling.pattern != SamplePattern::kCenter && sampling.pattern != SamplePattern::kCorners;
}

float Fraction(uint32_t bits) { return float(bits >> 8) * 0x1p-24f; }

uint32_t ReversedBits(uint32_t i) {
  uint32_t r = 0;
  for (uint32_t bit = 0x80000000u; i != 0; i >>= 1, bit >>= 1)
    if (i & 1) r |= bit;
  return r;
}

/// The second dimension of Sobol's sequence: its direction numbers are rows of Pascal's triangle modulo 2.
uint32_t Sobol2(uint32_t i) {
  uint32_t r = 0;
  for (uint32_t direction = 0x80000000u; i != 0; i >>= 1, direction ^= direction >> 1)
    if (i & 1) r ^= direction;
  return r;
}

}  // namespace

void CheckSampling(const Sampling& sampling) {
  if (sampling.grid < 1 || sampling.grid > 64)
    throw InputError("sampling grid = " + std::to_string(sampling.grid) + ": must lie in [1, 64]");
  if (sampling.grid > 1 && !HasGrid(sampling))
    throw InputError("sampling grid = " + std::to_string(sampling.grid) +
                     ": the patterns center and corners have one sample a pixel, so only 1 is allowed");
  if (!(sampling.adaptive_contrast >= 0) || !std::isfinite(sampling.adaptive_contrast))
    throw InputError("adaptive contrast = " + std::to_string(sampling.adaptive_contrast) +
                     ": must be finite and at least 0");
}

Vec2f SampleOffset(const Sampling& sampling, uint32_t x, uint32_t y, uint32_t index) {
  if (sampling.pattern == SamplePattern::kCenter) return {0.5f, 0.5f};
  const uint32_t n = sampling.grid, column = index % n, row = index / n;
  Random pixel(sampling.seed, uint64_t{y} << 32 | x);
  switch (sampling.pattern) {
    case SamplePattern::kCenter:
      break;
    case SamplePattern::kCorners:
      return {0, 0};
    case SamplePattern::kUniform:
      return {(float(column) + 0.5f) / float(n), (float(row) + 0.5f) / float(n)};
    case SamplePattern::kJittered: {
      Random random(pixel.NextBits(), index);
      const float u = random.NextFloat(), v = random.NextFloat();
      return {std::min((float(column) + u) / float(n), kBelowOne),
              std::min((float(row) + v) / float(n), kBelowOne)};
    }
    case SamplePattern::kLowDiscrepancy: {
      // A random digital shift keeps the sequence's nets (Kollig, Keller 2002).
      const uint64_t shift = pixel.NextBits();
      return {Fraction(ReversedBits(index) ^ uint32_t(shift)),
              Fraction(Sobol2(index) ^ uint32_t(shift >> 32))};
    }
  }
  return {0.5f, 0.5f};
}

Vec2f SamplePlace(const Sampling& sampling, uint32_t x, uint32_t y, uint32_t index) {
  const Vec2f offset = SampleOffset(sampling, x, y, index);
  return {float(x) + offset.u, float(y) + offset.v};
}

float FilterRadius(ReconstructionFilter filter) {
  switch (filter) {
    case ReconstructionFilter::kBox:
      return 0.5f;
    case ReconstructionFilter::kTent:
      return 1;
    case ReconstructionFilter::kGaussian:
      return 1.5f;
    case ReconstructionFilter::kMitchell:
      break;
  }
  return 2;
}

float FilterWeight(ReconstructionFilter filter, float offset) {
  const float x = std::fabs(offset), radius = FilterRadius(filter);
  if (!(x < radius)) return 0;
  switch (filter) {
    case ReconstructionFilter::kBox:
      return 1;
    case ReconstructionFilter::kTent:
      return 1 - x;
    case ReconstructionFilter::kGaussian:
      return std::exp(-2 * x * x) - std::exp(-2 * radius * radius);
    case ReconstructionFilter::kMitchell:
      break;
  }
  return x < 1 ? ((7.0f / 6) * x - 2) * x * x + 8.0f / 9
               : ((-7.0f / 18 * x + 2) * x - 10.0f / 3) * x + 16.0f / 9;
}

}  // namespace raybench
