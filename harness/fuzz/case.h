// A case of the fuzzer: geometry, rays and a structure, small enough to read, in a text file that replays.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

#include "datasets/scene/scene.h"

namespace raybench::fuzz {

/// What a file holds, a line each:
///
///     raybench-case 1
///     structure NAME(KEY=VALUE,...)
///     mode exact                          or chaotic
///     check NAME                          the promise that was broken; without it all are looked at
///     seed N                              of the build
///     vertex X Y Z
///     triangle A B C                      numbers of vertices, from 0
///     sphere X Y Z RADIUS
///     cone X Y Z RADIUS  X Y Z RADIUS     base, apex
///     polygon A B C D ...
///     ray OX OY OZ TNEAR DX DY DZ TFAR
///
/// Numbers are decimal and read back to the same bits. Primitives are numbered as Scene does: triangles,
/// spheres, cones, polygons. What follows a # is a comment.
struct Case {
  std::string structure;
  bool exact = false;  ///< all coordinates are small integers, and integers say what is true (lattice.h)
  std::string check;
  uint64_t seed = 1;
  std::vector<Vec3f> positions;
  std::vector<std::array<uint32_t, 3>> triangles;
  std::vector<Sphere> spheres;
  std::vector<Cone> cones;
  std::vector<std::vector<uint32_t>> polygons;
  std::vector<rb_ray> rays;

  size_t primitives() const { return triangles.size() + spheres.size() + cones.size() + polygons.size(); }
};

/// `comment`, of any number of lines, stands on top.
std::string Format(const Case& c, std::string_view comment = {});
/// Throws InputError naming `source`, the line and what is allowed.
Case ParseCase(std::string_view text, const std::string& source);
Case ReadCase(const std::filesystem::path& path);

/// The case's geometry as structures get it. Throws InputError where the scene model refuses it, or would
/// change its numbers: a degenerate triangle, or a scale that would have to be another.
Scene SceneOf(const Case& c);

}  // namespace raybench::fuzz
