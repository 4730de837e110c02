#include "harness/results/heat_files.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <system_error>

#include "accel/base/files.h"
#include "harness/plan/plan.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

template <class T>
void AppendAs(std::string& bytes, const std::vector<uint32_t>& values) {
  for (uint32_t value : values)
    for (size_t i = 0; i < sizeof(T); ++i) bytes += char(value >> (8 * i) & 0xFF);
}

/// NumPy's .npy, version 1.0 (numpy.lib.format), in the narrowest unsigned type, little-endian.
std::string Npy(const std::vector<uint32_t>& values, uint32_t width, uint32_t height) {
  const uint32_t max = Summarize(values).max;
  const size_t size = max < 1u << 8 ? 1 : max < 1u << 16 ? 2 : 4;
  std::string header = fmt::format("{{'descr': '{}u{}', 'fortran_order': False, 'shape': ({}, {}), }}",
                                   size == 1 ? '|' : '<', size, height, width);
  header.resize((10 + header.size() + 1 + 63) / 64 * 64 - 11, ' ');
  header += '\n';
  std::string bytes("\x93NUMPY\x01\x00", 8);
  bytes += char(header.size() & 0xFF);
  bytes += char(header.size() >> 8);
  bytes += header;
  bytes.reserve(bytes.size() + values.size() * size);
  size == 1   ? AppendAs<uint8_t>(bytes, values)
  : size == 2 ? AppendAs<uint16_t>(bytes, values)
              : AppendAs<uint32_t>(bytes, values);
  return bytes;
}

Json ReadOrMake(const fs::path& path) {
  std::ifstream file(path);
  Json content = file ? Json::parse(file, nullptr, /*allow_exceptions=*/false) : Json::object();
  if (!content.is_object()) throw InputError(path.string() + ": not a file of heat maps; remove it");
  return content;
}

}  // namespace

HeatFiles::HeatFiles(fs::path folder, const std::string& scene, const std::string& picture)
    : folder_(std::move(folder)) {
  std::error_code error;
  fs::create_directories(folder_, error);
  if (error) throw InputError(fmt::format("{}: cannot be made: {}", folder_.string(), error.message()));
  content_ = ReadOrMake(folder_ / "heat.json");
  content_["scene"] = scene;
  content_["picture"] = picture;
  if (!content_.contains("maps")) content_["maps"] = Json::array();
}

bool HeatFiles::Has(const std::string& spec) const {
  const Json& maps = content_.at("maps");
  return std::any_of(maps.begin(), maps.end(), [&](const Json& map) { return map.at("spec") == spec; });
}

void HeatFiles::Add(const std::string& spec, const HeatMap& map) {
  const std::string stem = fmt::format("{}", content_.at("maps").size());
  WriteFileAtomically(folder_ / (stem + "_steps.npy"), Npy(map.steps, map.width, map.height));
  WriteFileAtomically(folder_ / (stem + "_prims.npy"), Npy(map.prims, map.width, map.height));
  Put({{"spec", spec}, {"steps", stem + "_steps.npy"}, {"prims", stem + "_prims.npy"}});
}

void HeatFiles::AddNotCounted(const std::string& spec, const std::string& why) {
  Put({{"spec", spec}, {"why_not", why}});
}

void HeatFiles::Put(Json entry) {
  content_["maps"].push_back(std::move(entry));
  WriteFileAtomically(folder_ / "heat.json", content_.dump(1) + "\n");
}

std::string WhyNotCounted(const rb_structure& structure, const Scene& scene) {
  if (!WhyNotTaken(structure, scene).empty()) return "takes triangles only";
  return structure.query_counted == nullptr ? "cannot count" : "";
}

}  // namespace raybench
