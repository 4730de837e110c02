// Camera rays, and the order in which a picture is walked.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "accel/contract/valid_ray.h"
#include "datasets/scene/scene.h"

namespace raybench {

/// Invalid rays (overflow, a light at the hit point) become the stand-in that Freeze() counts.
inline rb_ray MakeRay(Vec3f org, float tnear, Vec3f dir, float tfar) {
  // IsValidRay(), while the numbers are in registers still: 4 % of a picture's time with Embree. 0 times what
  // is not finite is NaN.
  const float zero =
      ((org.x * 0 + org.y * 0) + (org.z * 0 + tnear * 0)) + ((dir.x * 0 + dir.y * 0) + dir.z * 0);
  const bool valid = zero == 0 && (dir.x != 0 || dir.y != 0 || dir.z != 0) && tnear >= 0 && !std::isnan(tfar);
  return valid ? rb_ray{{org.x, org.y, org.z}, tnear, {dir.x, dir.y, dir.z}, tfar} : InvalidRayStandIn();
}

/// The cells of a picture (pixels, or corners of pixels) in the order of tiles of 8 x 8: a cell's place in
/// that order is its slot.
class TiledCells {
 public:
  /// width x height below 2^32.
  TiledCells(uint32_t width, uint32_t height)
      : width_(width),
        height_(height),
        // Only a picture of less than a row of tiles saturates.
        row_cells_(uint32_t(std::min(uint64_t{kTile} * width, uint64_t{0xFFFFFFFFu}))) {}

  struct Cell {
    uint32_t x, y;
  };
  Cell At(uint32_t slot) const {
    const uint32_t y0 = slot / row_cells_ * kTile, rest = slot % row_cells_;
    const uint32_t tile_height = std::min(kTile, height_ - y0);
    // Division takes as long as much of shading a hit, so whole tiles go without.
    if (tile_height == kTile && rest / (kTile * kTile) * kTile + kTile <= width_)
      return {rest / (kTile * kTile) * kTile + rest % kTile, y0 + rest / kTile % kTile};
    const uint32_t x0 = rest / (kTile * tile_height) * kTile, in_tile = rest % (kTile * tile_height);
    const uint32_t tile_width = std::min(kTile, width_ - x0);
    return {x0 + in_tile % tile_width, y0 + in_tile / tile_width};
  }
  uint64_t size() const { return uint64_t{width_} * height_; }
  uint32_t width() const { return width_; }
  uint32_t height() const { return height_; }

 private:
  static constexpr uint32_t kTile = 8;
  uint32_t width_, height_, row_cells_;
};

/// Rays of the scene's first camera through places of a picture of width x height pixels.
class CameraRays {
 public:
  CameraRays(const Scene& scene, uint32_t width, uint32_t height) : width_(width), height_(height) {
    const Camera& camera = scene.cameras.front();
    const Vec3d forward = ToDouble(camera.at) - ToDouble(camera.eye),
                right = Cross(forward, ToDouble(camera.up));
    eye_ = camera.eye;
    forward_ = Normalize(forward);
    right_ = Normalize(right);
    up_ = Cross(right_, forward_);
    tan_y_ = camera.tan_half_fov;
    tan_x_ = tan_y_ * width / height;
  }

  /// (x, y) in pixels from the upper left corner.
  rb_ray Through(double x, double y, float tnear = 0) const {
    const double across = (2 * x / width_ - 1) * tan_x_, upward = (1 - 2 * y / height_) * tan_y_;
    return MakeRay(eye_, tnear, ToFloat(Normalize(forward_ + right_ * across + up_ * upward)),
                   std::numeric_limits<float>::infinity());
  }

 private:
  double width_, height_;
  Vec3f eye_;
  Vec3d forward_, right_, up_;
  double tan_x_, tan_y_;
};

}  // namespace raybench
