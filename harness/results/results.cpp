#include "harness/results/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>

#include "accel/base/error.h"
#include "datasets/scene/text.h"
#include "harness/measure/machine.h"
#include "harness/results/journal.h"

namespace raybench {
namespace fs = std::filesystem;
ResultFolder::ResultFolder(fs::path path, bool resume) : path_(std::move(path)) {
  std::error_code error;
  uint64_t cases = 0;
  for (fs::directory_iterator it(path_ / "cases", error), end; !error && it != end; it.increment(error)) {
    cases += it->path().extension() == ".json";
  }
  if (cases > 0 && !resume) {
    throw InputError(fmt::format(
        "{} already holds {} finished cases: add --resume to go on there, or choose another --out",
        path_.string(), cases));
  }
  fs::create_directories(path_, error);
  if (error) throw InputError(fmt::format("{}: cannot be created: {}", path_.string(), error.message()));
  lock_.emplace(path_);
  for (const char* part : {"cases", "images"}) {
    fs::create_directories(path_ / part, error);
    if (error)
      throw InputError(fmt::format("{}: cannot be created: {}", (path_ / part).string(), error.message()));
  }
}

bool ResultFolder::Has(const std::string& case_id) const {
  std::error_code error;
  return fs::exists(path_ / "cases" / (case_id + ".json"), error);
}

bool ResultFolder::IsTimed(const std::string& case_id) const {
  std::ifstream in(path_ / "cases" / (case_id + ".json"), std::ios::binary);
  const Json file = Json::parse(in, nullptr, /*allow_exceptions=*/false);
  return file.is_object() && file.contains("case") && file["case"].value("status", "") == "timed";
}

void ResultFolder::Store(const Case& key, const Row& values, std::span<const Sample> samples) const {
  Row row;
  row[column::case_id] = key.Id();
  row[column::scene] = key.scene;
  row[column::scene_hash] = key.scene_hash;
  row[column::primitives] = key.primitives;
  row[column::structure] = key.structure;
  row[column::spec] = key.spec;
  row[column::params] = key.params;
  row[column::ray_set] = key.ray_set;
  if (!key.ray_hash.empty()) row[column::ray_hash] = key.ray_hash;
  row[column::query] = key.query;
  if (!key.order.empty()) row[column::order] = key.order;
  if (!key.IsBuild()) row[column::rays] = key.rays;
  row[column::threads] = key.threads;
  row[column::seed] = key.seed;
  row[column::machine] = MachineFingerprint();
  row.Take(values);
  Store({key.plan_index, std::move(row), {samples.begin(), samples.end()}});
}

void ResultFolder::Store(const FinishedCase& finished) const {
  Json samples = Json::array();
  for (const Sample& s : finished.samples) samples.push_back(ToJson(s));
  const Json file = {{"format", kResultFormat},
                     {"plan_index", finished.plan_index},
                     {"case", finished.row.ToJson(kCasesColumns)},
                     {"samples", samples}};
  WriteFileAtomically(path_ / "cases" / (finished.row.Get(column::case_id) + ".json"), Dump(file));
}

Json ResultFolder::PreviousRun() const {
  std::ifstream in(path_ / "run.json", std::ios::binary);
  Json run = in ? Json::parse(in, nullptr, /*allow_exceptions=*/false) : Json();
  return run.is_object() ? run : Json();
}

std::vector<FinishedCase> ResultFolder::Cases() const { return ReadCases(path_); }

std::vector<FinishedCase> ReadCases(const fs::path& folder) {
  std::vector<FinishedCase> cases;
  std::error_code error;
  fs::directory_iterator it(folder / "cases", error);
  if (error)
    throw InputError(fmt::format("{}: cannot be read: {}", (folder / "cases").string(), error.message()));
  for (const fs::directory_entry& entry : it) {
    if (entry.path().extension() != ".json") continue;
    std::ifstream in(entry.path(), std::ios::binary);
    try {
      const Json file = Json::parse(in);
      if (const auto format = file.at("format").get<uint64_t>(); format != kResultFormat)
        throw std::invalid_argument(fmt::format("its format is {}, not {}", format, kResultFormat));
      FinishedCase finished{file.at("plan_index"), Row(file.at("case"), kCasesColumns), {}};
      for (const Json& s : file.at("samples")) finished.samples.push_back(SampleFrom(s));
      cases.push_back(std::move(finished));
    } catch (const std::exception& error) {  // JSON's own, and those of Row
      throw InputError(fmt::format("{}: not a case file of this raybench ({}); remove it",
                                   entry.path().string(), OneLine(error.what())));
    }
  }
  std::sort(cases.begin(), cases.end(), [](const FinishedCase& a, const FinishedCase& b) {
    const auto key = [](const FinishedCase& c) {
      return std::pair(c.plan_index, c.row.Get(column::case_id));
    };
    return key(a) < key(b);
  });
  return cases;
}

std::vector<FinishedCase> ResultFolder::WriteCsvs() const {
  std::string cases = CsvHeader(kCasesColumns) + "\n", samples = CsvHeader(kSamplesColumns) + "\n";
  const std::vector<FinishedCase> finished_cases = Cases();
  for (const FinishedCase& finished : finished_cases) {
    const Row& c = finished.row;
    cases += c.ToCsv(kCasesColumns) + "\n";
    for (const Sample& s : finished.samples) {
      Row row;
      row[column::case_id] = c.Get(column::case_id);
      row[column::scene] = c.Get(column::scene);
      row[column::structure] = c.Get(column::structure);
      row[column::spec] = c.Get(column::spec);
      row[column::ray_set] = c.Get(column::ray_set);
      row[column::query] = c.Get(column::query);
      row[column::threads] = c.Get(column::threads);
      row[column::sample] = s.sample;
      row[column::sequence] = s.sequence;
      row[column::passes] = s.passes;
      row[column::rays] = c.Get(column::timed_rays);
      row[column::seconds] = s.time.wall;
      row[column::cpu_seconds] = s.time.cpu;
      row[column::process] = s.process;
      row[column::session] = s.session;
      samples += row.ToCsv(kSamplesColumns) + "\n";
    }
  }
  WriteFileAtomically(path_ / "cases.csv", cases);
  WriteFileAtomically(path_ / "samples.csv", samples);
  return finished_cases;
}

void ResultFolder::WriteRunJson(Json run) const {
  Json whole = {{"format", kResultFormat}};
  whole.update(run);
  WriteFileAtomically(path_ / "run.json", Dump(whole));
}

}  // namespace raybench
