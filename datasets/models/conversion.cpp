#include "datasets/models/conversion.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "datasets/readers/readers.h"

namespace raybench {
namespace {

/// The array of arrays that follows "NAME=" in the text.
nlohmann::json LiteralArray(const std::string& path, const std::string& text, const std::string& name) {
  const size_t at = text.find(name + "=");
  const size_t begin = at == text.npos ? at : text.find_first_not_of(" \n", at + name.size() + 1);
  const size_t end = begin == text.npos ? begin : text.find("]]", begin);
  if (end == text.npos || text[begin] != '[')
    throw InputError(fmt::format("{}: exports no array of arrays '{}'", path, name));
  nlohmann::json array = nlohmann::json::parse(text.begin() + ptrdiff_t(begin),
                                               text.begin() + ptrdiff_t(end) + 2, nullptr, false);
  if (!array.is_array())
    throw InputError(fmt::format("{}: '{}' is not an array of literal numbers", path, name));
  return array;
}

}  // namespace

TriangleMesh ReadModuleMesh(const std::filesystem::path& path) {
  const std::string text = ReadFile(path), name = path.string();
  TriangleMesh mesh;
  try {
    const nlohmann::json positions = LiteralArray(name, text, "positions");
    for (const nlohmann::json& p : positions) {
      const std::array<float, 3> xyz = p.get<std::array<float, 3>>();
      mesh.positions.push_back({xyz[0], xyz[1], xyz[2]});
    }
    const nlohmann::json cells = LiteralArray(name, text, "cells");
    for (const nlohmann::json& cell : cells) {
      const std::array<int64_t, 3> corners = cell.get<std::array<int64_t, 3>>();
      for (const int64_t corner : corners) {
        if (corner < 0 || uint64_t(corner) >= mesh.positions.size()) {
          throw InputError(fmt::format("{}: cell {} refers to position {}; allowed are 0 to {}", name,
                                       mesh.triangles.size(), corner, mesh.positions.size() - 1));
        }
      }
      mesh.triangles.push_back({uint32_t(corners[0]), uint32_t(corners[1]), uint32_t(corners[2])});
    }
  } catch (const nlohmann::json::exception&) {
    throw InputError(name + ": positions and cells must be arrays of three numbers each");
  }
  return mesh;
}

void Convert(const Conversion& conversion, const std::filesystem::path& from,
             const std::filesystem::path& to) {
  const auto [column, row] = conversion.spacing;
  if (conversion.kind == "grid") {
    WriteBinaryPly(to, GridMesh(ReadNpy(from), column, row, conversion.exaggeration));
  } else if (conversion.kind == "globe") {
    WriteBinaryPly(to, GlobeMesh(ReadGtx(from), conversion.exaggeration, from.string()));
  } else if (conversion.kind == "module") {
    WriteBinaryPly(to, ReadModuleMesh(from));
  } else {
    throw InputError(fmt::format("the manifest names the conversion '{}'; allowed are grid, globe, module",
                                 conversion.kind));
  }
}

}  // namespace raybench
