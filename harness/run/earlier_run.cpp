#include "harness/run/earlier_run.h"

#include <fmt/format.h>

#include <fstream>
#include <set>

#include "accel/base/error.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

Json ReadObject(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  Json json = Json::parse(in, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || json.value("format", uint64_t{0}) != kResultFormat)
    throw InputError(fmt::format("--again: {} is missing, or no file of this raybench", path.string()));
  return json;
}

/// The columns that a new process must find again; times and what is said of them are its own.
Row WhatStays(const Json& values) {
  Json kept = Json::object();
  for (const Column& column : kCasesColumns)
    if (const auto it = values.find(column.name); !column.varies && it != values.end() && !it->is_null())
      kept[column.name] = *it;
  for (const char* own : {column::status.name, column::note.name, column::anchor.name}) kept.erase(own);
  return Row(kept, kCasesColumns);
}

}  // namespace

fs::path KeptRays(const fs::path& folder, const std::string& stem, size_t index) {
  return folder / "rays" / stem / fmt::format("{:02}.rays", index);
}

EarlierRun::EarlierRun(fs::path folder, const std::string& program) : folder_(std::move(folder)) {
  if (ReadObject(folder_ / "run.json").value("program", "") != program)
    throw InputError(
        fmt::format("--again: {} was measured by another program or another plugin, whose verdicts say "
                    "nothing of this one",
                    folder_.string()));
  std::error_code error;
  for (fs::directory_iterator it(folder_ / "cases", error), end; !error && it != end; it.increment(error)) {
    if (it->path().extension() != ".json") continue;
    const Json file = ReadObject(it->path());
    const Json values = file.value("case", Json::object());
    // What --benchmark_filter left out is judged as well.
    if (values.value("status", "") != "refused") rows_[it->path().stem().string()] = WhatStays(values);
  }
  if (rows_.empty())
    throw InputError(fmt::format("--again: {} has no case that kept its claim", folder_.string()));
}

std::vector<SourcedSet> EarlierRun::Rays(const std::string& stem, const Scene& scene) const {
  std::vector<SourcedSet> sets;
  std::error_code error;
  for (fs::path path = KeptRays(folder_, stem, 0); fs::exists(path, error);
       path = KeptRays(folder_, stem, sets.size()))
    sets.push_back({ReplayedSet(ReadRayFile(path), scene), 0, {}, {}, {}});
  if (sets.empty())
    throw InputError(fmt::format("--again: {} has no rays of scene '{}'; make it with --keep-rays",
                                 folder_.string(), scene.name));
  for (SourcedSet& s : sets) s.captured = s.set.rays.size();
  return sets;
}

const Row* EarlierRun::Find(const std::string& case_id) const {
  const auto found = rows_.find(case_id);
  return found == rows_.end() ? nullptr : &found->second;
}

}  // namespace raybench
