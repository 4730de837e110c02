// The file readers behind LoadScene(). Each returns a filled scene on which Finish() has not run yet, and
// throws InputError with one line that begins with the path. Files are read once, by code of our own: other
// readers of meshes skip what does not parse, which shifts all later indices, leave out faces without a word,
// and take what is cut off for whole. Tests hold them against OpenMesh's.
#pragma once

#include <filesystem>
#include <string>

#include "datasets/scene/scene.h"
#include "datasets/scene/text.h"

namespace raybench {

/// Wavefront OBJ with its MTL files. Each `f` line is one face.
Scene ReadObj(const std::filesystem::path& path, const LoadOptions& options);
/// PLY, ASCII and binary. Faces are the items of `face` and the triangles of `tristrips`.
Scene ReadPly(const std::filesystem::path& path, const LoadOptions& options);
/// STL, ASCII and binary. Corners at equal positions are one vertex; each facet is one face.
Scene ReadStl(const std::filesystem::path& path, const LoadOptions& options);
/// ASCII OFF (also COFF, NOFF, STOFF).
Scene ReadOff(const std::filesystem::path& path, const LoadOptions& options);
/// glTF 2.0, .gltf or .glb, through tinygltf: the default scene with its node hierarchy flattened.
Scene ReadGltf(const std::filesystem::path& path, const LoadOptions& options);

/// Haines' Neutral File Format 3.1 for the Standard Procedural Databases: polygons, spheres, cones, camera,
/// lights. What it is mapped to stands in readers/nff.cpp.
Scene ReadNff(const std::filesystem::path& path, const LoadOptions& options);

}  // namespace raybench
