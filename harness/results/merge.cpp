#include "harness/results/merge.h"

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <system_error>

#include "accel/base/error.h"
#include "accel/base/files.h"
#include "harness/measure/statistics.h"
#include "harness/results/results.h"
#include "harness/results/times.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

struct Source {
  fs::path path;
  Json run;
  std::vector<FinishedCase> cases;
};

Json ReadJson(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  Json json = in ? Json::parse(in, nullptr, /*allow_exceptions=*/false) : Json();
  if (!json.is_object()) throw InputError(fmt::format("{}: not there, or not of a run", path.string()));
  return json;
}

Source Read(const std::string& folder) {
  Source source{folder, ReadJson(fs::path(folder) / "run.json"), {}};
  if (source.run.value("format", uint64_t{0}) != kResultFormat)
    throw InputError(fmt::format("{}/run.json: not of this result format, {}", folder, kResultFormat));
  if (source.run.value("ended", Json()).is_null() || source.run.value("interrupted", false))
    throw InputError(fmt::format("{}: the run has not ended; its command with --resume ends it", folder));
  source.cases = ReadCases(source.path);
  return source;
}

/// What must be the same in all runs: where it stands in run.json.
constexpr const char* kSame[] = {
    "/build/version", "/build/commit",   "/build/compiler",      "/build/build_type",
    "/build/flags",   "/libraries/cgal", "/libraries/benchmark", "/suite/name",
    "/suite/hash",    "/seed",           "/rays_per_set",        "/verified_per_set",
    "/depth",         "/processes",      "/timing/repetitions",  "/timing/budget_seconds",
    "/timing/flags",  "/plugins"};

void RefuseUnlike(const Source& a, const Source& b) {
  const auto at = [](const Source& source, const char* where) {
    const Json::json_pointer pointer(where);
    return source.run.contains(pointer) ? source.run.at(pointer) : Json();
  };
  const auto same = [&](const char* where) {
    if (at(a, where) == at(b, where)) return;
    throw InputError(
        fmt::format("{}: {} is {}, and {} in {}; only runs of one version, suite and options are merged",
                    b.path.string(), where + 1, at(b, where).dump(), at(a, where).dump(), a.path.string()));
  };
  for (const char* where : kSame) same(where);
  const Json version = at(a, "/libraries/embree/version"), other = at(b, "/libraries/embree/version");
  if (version != other) same("/libraries/embree");
}

std::string NameOf(const Row& row) {
  return fmt::format("{}/{}/{}/{}/threads:{}", row.Get(column::scene), row.Get(column::spec),
                     row.Get(column::ray_set), row.Get(column::query), row.Get(column::threads).value_or(0));
}

/// The first column that should be the same and is not, in words; empty: all are.
std::string Disagreement(const Row& a, const Row& b) {
  const Json left = a.ToJson(kCasesColumns), right = b.ToJson(kCasesColumns);
  for (const Column& column : kCasesColumns) {
    if (column.varies || left.at(column.name) == right.at(column.name)) continue;
    return fmt::format("{}: {} is {} and {}", NameOf(a), column.name, left.at(column.name).dump(),
                       right.at(column.name).dump());
  }
  return {};
}

uint64_t SessionsOf(const Source& source) { return source.run.value("sessions", Json::array()).size(); }

/// Adds the samples of `more` to the case, if both were timed on the same rays; whether it could.
bool Pool(FinishedCase& all, const FinishedCase& more) {
  if (more.samples.empty()) return true;
  if (all.samples.empty() || all.row.Get(column::timed_rays) != more.row.Get(column::timed_rays))
    return false;
  const auto a = all.row.Get(column::anchor_ns), b = more.row.Get(column::anchor_ns);
  if (a && b)
    all.row[column::anchor_ns] =
        WeightedMedian({{*a, double(all.samples.size())}, {*b, double(more.samples.size())}});
  for (Sample s : more.samples) {
    s.sample = all.samples.size();
    all.samples.push_back(s);
  }
  AddTimes(all.row, all.samples);
  return true;
}

/// A scene as several runs tell of it: what the first one knows, and all notes.
void TakeScene(Json& scenes, const Json& scene) {
  for (Json& known : scenes) {
    if (known.at("scene") != scene.at("scene")) continue;
    for (const char* key : {"oracle", "anchor", "ray_sets"})
      if (known.at(key).is_null() || known.at(key).empty()) known[key] = scene.at(key);
    for (const Json& note : scene.at("notes"))
      if (std::find(known["notes"].begin(), known["notes"].end(), note) == known["notes"].end())
        known["notes"].push_back(note);
    known["cases"] = known.value("cases", uint64_t{0}) + scene.value("cases", uint64_t{0});
    return;
  }
  scenes.push_back(scene);
}

/// What run.json says of the sources together.
Json MergedRun(const std::vector<const Source*>& sources, const std::vector<FinishedCase>& cases) {
  Json run = sources[0]->run;
  run.erase("format");
  Json scenes = Json::array(), sessions = Json::array(), from = Json::array(), warnings = Json::array();
  double seconds = 0;
  Json phases = Json::object();
  for (const Source* source : sources) {
    const Json& own = source->run;
    for (const Json& scene : own.at("scenes")) TakeScene(scenes, scene);
    for (const Json& session : own.value("sessions", Json::array())) sessions.push_back(session);
    from.push_back({{"folder", source->path.filename().string()},
                    {"shard", own.value("shard", Json())},
                    {"command_line", own.at("command_line")}});
    for (const Json& warning : own.at("warnings")) warnings.push_back(warning);
    seconds += own.at("seconds").get<double>();
    for (const auto& [phase, value] : own.at("phases").items())
      phases[phase] = phases.value(phase, 0.0) + value.get<double>();
    run["started"] = std::min(run.at("started").get<std::string>(), own.at("started").get<std::string>());
    run["ended"] = std::max(run.at("ended").get<std::string>(), own.at("ended").get<std::string>());
  }
  // In the order of the plan, in which a shard may lack the first ones.
  std::map<std::string, uint64_t> place;
  for (const FinishedCase& c : cases) place.emplace(c.row.Get(column::scene), c.plan_index);
  std::stable_sort(scenes.begin(), scenes.end(),
                   [&](const Json& a, const Json& b) { return place[a.at("scene")] < place[b.at("scene")]; });
  run["scenes"] = scenes;
  run["sessions"] = sessions;
  run["seconds"] = seconds;
  run["phases"] = phases;
  run["warnings"] = warnings;
  run["finished_cases"] = cases.size();
  run["shard"] = nullptr;
  run["merged"] = from;
  return run;
}

void CopyNew(const fs::path& from, const fs::path& to) {
  std::error_code error;
  if (!fs::exists(from, error)) return;
  fs::create_directories(to, error);
  if (!error) fs::copy(from, to, fs::copy_options::recursive | fs::copy_options::skip_existing, error);
  if (error) throw InputError(fmt::format("{}: cannot be copied: {}", from.string(), error.message()));
}

/// Heat maps are numbered within each folder.
void CopyHeat(const fs::path& from, const fs::path& to) {
  std::error_code error;
  fs::create_directories(to, error);
  Json whole = fs::exists(to / "heat.json") ? ReadJson(to / "heat.json") : Json();
  const Json own = ReadJson(from / "heat.json");
  if (whole.is_null()) {
    whole = own;
    whole["maps"] = Json::array();
  }
  Json& maps = whole["maps"];
  for (Json map : own.at("maps")) {
    if (std::any_of(maps.begin(), maps.end(), [&](const Json& m) { return m.at("spec") == map.at("spec"); }))
      continue;
    for (const char* key : {"steps", "prims"}) {
      if (!map.contains(key)) continue;
      const std::string name = fmt::format("{}_{}.npy", maps.size(), key);
      fs::copy_file(from / map.at(key).get<std::string>(), to / name, fs::copy_options::overwrite_existing,
                    error);
      if (error) throw InputError(fmt::format("{}: cannot be copied: {}", from.string(), error.message()));
      map[key] = name;
    }
    maps.push_back(std::move(map));
  }
  WriteFileAtomically(to / "heat.json", whole.dump(1) + "\n");
}

void Write(const fs::path& out, const std::vector<const Source*>& sources, Merged& merged,
           const std::function<void(const std::string&)>& note) {
  std::map<std::string, FinishedCase> by_id;
  uint64_t session = 0, process = 0;
  for (const Source* source : sources) {
    uint64_t processes = 1;
    for (FinishedCase finished : source->cases) {
      for (Sample& s : finished.samples) {
        processes = std::max(processes, s.process + 1);
        s.session += session;
        s.process += process;
      }
      const std::string id = finished.row.Get(column::case_id);
      const auto [there, is_new] = by_id.try_emplace(id, finished);
      if (is_new) continue;
      ++merged.shared_cases;
      if (const std::string line = Disagreement(there->second.row, finished.row); !line.empty())
        merged.disagreements.push_back(fmt::format("{} (in {})", line, source->path.string()));
      else if (!Pool(there->second, finished))
        note(fmt::format("{}: timed on other rays in {}: these samples are left out", NameOf(finished.row),
                         source->path.string()));
    }
    session += SessionsOf(*source);
    // Shards of one run are the same processes of its plan; what was run again is another one.
    if (source->run.value("shard", Json()).is_null()) process += processes;
  }
  std::vector<FinishedCase> cases;
  for (auto& [id, finished] : by_id) cases.push_back(std::move(finished));
  std::sort(cases.begin(), cases.end(),
            [](const FinishedCase& a, const FinishedCase& b) { return a.plan_index < b.plan_index; });
  const ResultFolder folder(out, false);
  for (const FinishedCase& finished : cases) folder.Store(finished);
  for (const Source* source : sources) {
    CopyNew(source->path / "images", out / "images");
    std::error_code error;
    for (fs::directory_iterator it(source->path / "heat", error), end; !error && it != end;
         it.increment(error))
      if (fs::exists(it->path() / "heat.json")) CopyHeat(it->path(), out / "heat" / it->path().filename());
  }
  folder.WriteCsvs();
  folder.WriteRunJson(MergedRun(sources, cases));
  merged.folders.push_back(out);
}

/// Of the shards that are named, those that are not there.
std::vector<std::string> MissingShards(const std::vector<Source>& sources) {
  std::set<std::string> there;
  uint64_t shards = 0;
  for (const Source& source : sources) {
    const Json shard = source.run.value("shard", Json());
    if (!shard.is_string()) return {};
    there.insert(shard.get<std::string>());
    const auto of = std::stoull(shard.get<std::string>().substr(shard.get<std::string>().find('/') + 1));
    if (shards != 0 && of != shards)
      throw InputError(fmt::format("{}: shard {} is of another division than {}", source.path.string(),
                                   shard.get<std::string>(), *there.begin()));
    shards = of;
  }
  std::vector<std::string> missing;
  for (uint64_t i = 1; i <= shards; ++i)
    if (const std::string name = fmt::format("{}/{}", i, shards); !there.contains(name))
      missing.push_back(name);
  return missing;
}

}  // namespace

Merged Merge(const fs::path& out, const std::vector<std::string>& folders,
             const std::function<void(const std::string&)>& note) {
  std::vector<Source> sources;
  for (const std::string& folder : folders) {
    std::error_code error;
    for (const Source& source : sources)
      if (fs::equivalent(source.path, folder, error))
        throw InputError(fmt::format("{}: is given twice", folder));
    sources.push_back(Read(folder));
    RefuseUnlike(sources.front(), sources.back());
  }
  if (fs::exists(out / "run.json") || fs::exists(out / "cases"))
    throw InputError(fmt::format("{}: holds a run already; choose another folder", out.string()));
  Merged merged;
  merged.missing = MissingShards(sources);
  std::map<std::string, std::vector<const Source*>> machines;
  for (const Source& source : sources)
    machines[source.run.at("machine").value("fingerprint", "unknown")].push_back(&source);
  for (const auto& [machine, own] : machines)
    Write(machines.size() == 1 ? out : out / machine, own, merged, note);
  // What no machine may change.
  std::map<std::string, std::pair<const Source*, const Row*>> seen;
  for (const auto& [machine, own] : machines)
    for (const Source* source : own)
      for (const FinishedCase& c : source->cases) {
        const auto [there, is_new] = seen.try_emplace(c.row.Get(column::case_id), source, &c.row);
        if (is_new || there->second.first->run.at("machine") == source->run.at("machine")) continue;
        ++merged.shared_cases;
        if (const std::string line = Disagreement(*there->second.second, c.row); !line.empty())
          merged.disagreements.push_back(fmt::format(
              "{} (in {} and {})", line, there->second.first->path.string(), source->path.string()));
      }
  return merged;
}

}  // namespace raybench
