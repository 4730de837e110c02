// Height fields to triangles. The same input gives the same bytes on every machine: plain IEEE arithmetic,
// no libm.
#pragma once

#include <filesystem>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench {

/// Heights on a regular grid, row after row.
struct HeightField {
  uint32_t rows = 0, columns = 0;  ///< each at least 2, at most 16384
  std::vector<float> heights;      ///< rows * columns, finite

  // Where a file says it (.gtx), in degrees; rows go from south to north, columns from west to east.
  double south = 0, west = 0, latitude_step = 0, longitude_step = 0;
};

struct TriangleMesh {
  std::vector<Vec3f> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
};

/// NumPy's .npy, version 1 to 3, two-dimensional in C order, of int16, int32, float32 or float64 in either
/// byte order. Throws InputError: anything else, truncated, or not finite.
HeightField ReadNpy(const std::filesystem::path& path);
/// PROJ's .gtx: a big-endian header of 40 bytes, then float32. Throws InputError likewise.
HeightField ReadGtx(const std::filesystem::path& path);

/// x to the columns' end (east), z to the rows' end (south, where the first row is the northern one), y up,
/// centred on the y axis; two triangles a cell, 2 (rows - 1) (columns - 1) in all, facing up.
TriangleMesh GridMesh(const HeightField& field, double column_spacing, double row_spacing,
                      double exaggeration);

/// A closed globe around the origin, y to the north pole, x to longitude 0: radius 1 at height 0, heights in
/// metres over the mean earth radius times `exaggeration`. The first and the last row are the poles, one
/// vertex each at their mean height. Throws InputError naming `name` unless the field spans the whole globe.
TriangleMesh GlobeMesh(const HeightField& field, double exaggeration, const std::string& name);

/// Sine and cosine of an angle in degrees, to about 1e-15, from +, - and * alone.
void SinCosDegrees(double degrees, double& sine, double& cosine);

/// Binary little-endian PLY: float x y z; list uchar int vertex_indices. Throws InputError if it cannot
/// be written.
void WriteBinaryPly(const std::filesystem::path& path, const TriangleMesh& mesh);

}  // namespace raybench
