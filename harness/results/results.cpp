#include "harness/results/results.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <stdexcept>

namespace raybench {
namespace fs = std::filesystem;
namespace {

constexpr const char* kCaseColumns[] = {"case_id",
                                        "scene",
                                        "scene_hash",
                                        "primitives",  //
                                        "structure",
                                        "spec",
                                        "params",  //
                                        "ray_set",
                                        "ray_hash",
                                        "query",
                                        "order",
                                        "rays",  //
                                        "threads",
                                        "seed",
                                        "status",
                                        "note",
                                        "claim",
                                        "oracle",
                                        "verified",  //
                                        "exact",
                                        "tie",
                                        "neighbour",
                                        "leak",
                                        "wrong",
                                        "wrong_marginal",  //
                                        "false_miss",
                                        "false_miss_marginal",
                                        "false_hit",
                                        "false_hit_marginal",  //
                                        "t_error_p50",
                                        "t_error_p99",
                                        "t_error_max",
                                        "hits",  //
                                        "steps",
                                        "leaves",
                                        "empty_leaves",
                                        "bounds",
                                        "prims",
                                        "bytes",
                                        "lcv",  //
                                        "inner_nodes",
                                        "leaf_nodes",
                                        "empty_leaf_nodes",
                                        "references",
                                        "depth",
                                        "sah_cost",
                                        "epo",
                                        "leaf_depth",
                                        "tightness",  //
                                        "node_bytes",
                                        "prim_bytes",
                                        "needs_geometry",  //
                                        "build_peak_bytes",
                                        "cold_ns",
                                        "samples",
                                        "timed_rays",
                                        "median_ns",
                                        "lo_ns",
                                        "hi_ns",
                                        "rate",
                                        "anchor",
                                        "anchor_ns"};
constexpr const char* kSampleColumns[] = {"case_id", "scene",   "structure",  "spec",     "ray_set",
                                          "query",   "threads", "sample",     "sequence", "passes",
                                          "rays",    "seconds", "cpu_seconds"};

/// Text that comes from files and plugins need not be UTF-8; what is not is replaced.
std::string Dump(const Json& json) { return json.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

std::string CsvLine(const auto& fields) { return fmt::format("{}\n", fmt::join(fields, ",")); }

}  // namespace

std::span<const char* const> CaseColumns() { return kCaseColumns; }
std::span<const char* const> SampleColumns() { return kSampleColumns; }

std::string CsvField(const Json& value) {
  if (value.is_null()) return {};
  if (value.is_number_float()) return fmt::format("{}", value.get<double>());
  if (value.is_boolean()) return value.get<bool>() ? "1" : "0";
  if (!value.is_string()) return value.dump();
  const std::string text = value.get<std::string>();
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (char c : text) {
    if (c == '"') quoted += '"';
    quoted += c;
  }
  return quoted + '"';
}

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

void ResultFolder::Store(const Case& key, const Json& values, std::span<const Sample> samples) const {
  Json row;
  for (const char* column : kCaseColumns) row[column] = nullptr;
  const std::string id = key.Id();
  row["case_id"] = id;
  row["scene"] = key.scene;
  row["scene_hash"] = key.scene_hash;
  row["primitives"] = key.primitives;
  row["structure"] = key.structure;
  row["spec"] = key.spec;
  row["params"] = key.params;
  row["ray_set"] = key.ray_set;
  if (!key.ray_hash.empty()) row["ray_hash"] = key.ray_hash;
  row["query"] = key.query;
  if (!key.order.empty()) row["order"] = key.order;
  if (!key.IsBuild()) row["rays"] = key.rays;
  row["threads"] = key.threads;
  row["seed"] = key.seed;
  for (const auto& [column, value] : values.items()) {
    if (!row.contains(column)) throw std::logic_error("no such column: " + column);
    row[column] = value;
  }
  Json rows_of_samples = Json::array();
  for (const Sample& s : samples) {
    rows_of_samples.push_back({{"sample", s.sample},
                               {"sequence", s.sequence},
                               {"passes", s.passes},
                               {"seconds", s.time.wall},
                               {"cpu_seconds", s.time.cpu}});
  }
  const Json file = {
      {"format", 1}, {"plan_index", key.plan_index}, {"case", row}, {"samples", rows_of_samples}};
  WriteFileAtomically(path_ / "cases" / (id + ".json"), Dump(file));
}

std::vector<Json> ResultFolder::Cases() const {
  std::vector<Json> cases;
  for (const fs::directory_entry& entry : fs::directory_iterator(path_ / "cases")) {
    if (entry.path().extension() != ".json") continue;
    std::ifstream in(entry.path(), std::ios::binary);
    Json file = Json::parse(in, nullptr, /*allow_exceptions=*/false);
    const bool whole = file.is_object() && file.contains("plan_index") && file.contains("samples") &&
                       file.contains("case") &&
                       std::all_of(std::begin(kCaseColumns), std::end(kCaseColumns),
                                   [&](auto* c) { return file["case"].contains(c); });
    if (!whole)
      throw InputError(fmt::format("{}: not a case file of this raybench; remove it", entry.path().string()));
    cases.push_back(std::move(file));
  }
  std::sort(cases.begin(), cases.end(), [](const Json& a, const Json& b) {
    const auto key = [](const Json& c) {
      return std::pair(c.at("plan_index").get<uint64_t>(), c.at("case").at("case_id").get<std::string>());
    };
    return key(a) < key(b);
  });
  return cases;
}

void ResultFolder::WriteCsvs() const {
  std::string cases = CsvLine(kCaseColumns), samples = CsvLine(kSampleColumns);
  for (const Json& file : Cases()) {
    const Json& row = file.at("case");
    std::vector<std::string> fields;
    for (const char* column : kCaseColumns) fields.push_back(CsvField(row.at(column)));
    cases += CsvLine(fields);
    for (const Json& sample : file.at("samples")) {
      fields.clear();
      for (const char* column : kSampleColumns) {
        const bool rays = std::string_view(column) == "rays" && !row.at("timed_rays").is_null();
        if (rays) column = "timed_rays";
        fields.push_back(CsvField(sample.contains(column) ? sample.at(column) : row.at(column)));
      }
      samples += CsvLine(fields);
    }
  }
  WriteFileAtomically(path_ / "cases.csv", cases);
  WriteFileAtomically(path_ / "samples.csv", samples);
}

void ResultFolder::WriteRunJson(const Json& run) const { WriteFileAtomically(path_ / "run.json", Dump(run)); }

}  // namespace raybench
