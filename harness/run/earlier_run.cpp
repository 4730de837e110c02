#include "harness/run/earlier_run.h"

#include <fmt/format.h>

#include <fstream>
#include <functional>
#include <set>

#include "accel/base/error.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

Json ReadObject(const char* option, const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  Json json = Json::parse(in, nullptr, /*allow_exceptions=*/false);
  if (!json.is_object() || json.value("format", uint64_t{0}) != kResultFormat)
    throw InputError(fmt::format("{}: {} is missing, or no file of this raybench", option, path.string()));
  return json;
}

void ForEachCase(const char* option, const fs::path& folder,
                 const std::function<void(const std::string& id, const Json& values)>& take) {
  std::error_code error;
  for (fs::directory_iterator it(folder / "cases", error), end; !error && it != end; it.increment(error))
    if (it->path().extension() == ".json")
      take(it->path().stem().string(), ReadObject(option, it->path()).value("case", Json::object()));
}

void AddPart(TimedParts& parts, const std::string& id, const Json& values) {
  if (values.value("status", "") == "timed" && values.value("query", "") != "build")
    parts[id] = values.value(column::timed_rays.name, uint64_t{0});
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

TimedParts ReadTimedParts(const fs::path& folder) {
  ReadObject("--parts-of", folder / "run.json");
  TimedParts parts;
  ForEachCase("--parts-of", folder,
              [&](const std::string& id, const Json& values) { AddPart(parts, id, values); });
  return parts;
}

EarlierRun::EarlierRun(fs::path folder, const std::string& program) : folder_(std::move(folder)) {
  if (ReadObject("--again", folder_ / "run.json").value("program", "") != program)
    throw InputError(
        fmt::format("--again: {} was measured by another program or another plugin, whose verdicts say "
                    "nothing of this one",
                    folder_.string()));
  ForEachCase("--again", folder_, [&](const std::string& id, const Json& values) {
    // What --benchmark_filter left out is judged as well.
    if (values.value("status", "") != "refused") rows_[id] = WhatStays(values);
    AddPart(parts_, id, values);
  });
  if (rows_.empty())
    throw InputError(fmt::format("--again: {} has no case that kept its claim", folder_.string()));
}

std::vector<SourcedSet> ReadKeptRays(const fs::path& folder, const std::string& stem, const Scene& scene) {
  std::vector<SourcedSet> sets;
  std::error_code error;
  for (fs::path path = KeptRays(folder, stem, 0); fs::exists(path, error);
       path = KeptRays(folder, stem, sets.size())) {
    sets.push_back({ReplayedSet(ReadRayFile(path), scene), 0, {}, {}, {}});
    sets.back().captured = sets.back().set.rays.size();
  }
  return sets;
}

std::vector<SourcedSet> EarlierRun::Rays(const std::string& stem, const Scene& scene) const {
  std::vector<SourcedSet> sets = ReadKeptRays(folder_, stem, scene);
  if (sets.empty())
    throw InputError(fmt::format("--again: {} has no rays of scene '{}'; make it with --keep-rays",
                                 folder_.string(), scene.name));
  return sets;
}

const Row* EarlierRun::Find(const std::string& case_id) const {
  const auto found = rows_.find(case_id);
  return found == rows_.end() ? nullptr : &found->second;
}

}  // namespace raybench
