// raybench list scene NAME: loads one scene and prints its contents.
#include <fmt/format.h>

#include "datasets/models/fetch.h"
#include "datasets/scene/facts.h"
#include "datasets/scene/scene.h"
#include "harness/base/json.h"
#include "harness/cli/commands.h"
#include "harness/measure/measure.h"
#include "harness/results/run_facts.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"

namespace raybench {
namespace {

struct ListSceneOptions {
  std::string scene;
  uint64_t seed = 1;
  bool drop_bad = false, json = false;
};

Json TextOrNull(const std::string& text) { return text.empty() ? Json() : Json(text); }

Json Numbers(Vec3f v) { return {v.x, v.y, v.z}; }

Json SpreadAsJson(const Spread& s, uint64_t triangles) {
  if (triangles == 0) return {};
  return {{"percent_1", s.percent1}, {"median", s.median}, {"percent_99", s.percent99}};
}

/// All facts in the order of printing. A fact that is unknown or does not apply is null.
Json Describe(const Scene& scene, const SceneFacts& facts, double load_seconds) {
  Json json;
  json["name"] = scene.name;
  json["primitives"] = scene.primitive_count();
  json["triangles"] = scene.triangles.size();
  json["procedural"] = Json::object();
  for (const auto& [kind, count] : facts.procedural) json["procedural"][kind] = count;
  json["faces_in_file"] = scene.stats.faces > 0 ? Json(scene.stats.faces) : Json();
  json["vertices"] = scene.positions.size();
  json["distinct_positions"] = facts.distinct_positions;
  json["boundary_edges"] = scene.triangles.empty() ? Json() : Json(facts.boundary_edges);
  json["non_manifold_edges"] = scene.triangles.empty() ? Json() : Json(facts.non_manifold_edges);
  json["closed"] = scene.triangles.empty() ? Json() : Json(facts.closed());
  json["triangle_area"] = SpreadAsJson(facts.area, scene.triangles.size());
  json["triangle_aspect"] = SpreadAsJson(facts.aspect, scene.triangles.size());
  json["bounds"] = scene.bounds().Empty()
                       ? Json()
                       : Json{{"lo", Numbers(scene.bounds().lo)}, {"hi", Numbers(scene.bounds().hi)}};
  json["scale_exponent"] = scene.scale_exponent;
  json["materials"] = Json::array();
  for (const Material& material : scene.materials) json["materials"].push_back(material.name);
  json["textures"] = scene.textures.size();
  json["shading_normals"] = !scene.normals.empty();
  json["cameras"] = scene.cameras.size();
  json["automatic_camera"] = scene.automatic_camera;
  json["lights"] = scene.lights.size();
  json["automatic_lights"] = scene.automatic_lights;
  json["degenerate_triangles"] = scene.stats.degenerate_triangles;
  json["dropped_triangles"] = scene.stats.dropped_triangles;
  json["instances"] = scene.stats.instances;
  json["shared_triangles"] = scene.stats.shared_triangles;
  json["notes"] = scene.stats.notes;
  json["needs"] = FactsOf(NeedsOf(scene), scene, facts);
  json["bytes"] = facts.bytes;
  json["saved_bytes"] = scene.stats.saved_bytes;
  json["hash"] = scene.hash();
  json["source"] = TextOrNull(scene.provenance.source);
  json["package"] = TextOrNull(scene.provenance.package);
  json["version"] = TextOrNull(scene.provenance.version);
  json["licence"] = TextOrNull(scene.provenance.licence);
  json["sha256"] = TextOrNull(scene.provenance.sha256);
  json["load_seconds"] = load_seconds;
  return json;
}

void Line(const char* key, const std::string& value) { fmt::print("  {:<16} {}\n", key, value); }

std::string Text(const Json& json, const char* key, const char* unknown) {
  return json[key].is_null() ? unknown : json[key].get<std::string>();
}

std::string Count(const Json& json, const char* key) { return fmt::format("{}", json[key].get<uint64_t>()); }

/// The first few, and how many more.
std::string Some(const Json& names) {
  constexpr size_t kSome = 8;
  std::string text;
  for (size_t i = 0; i < std::min(names.size(), kSome); ++i) {
    const std::string name = names[i];
    text += fmt::format("{}{}", i == 0 ? "" : ", ", name.empty() ? "(no name)" : name);
  }
  if (names.size() > kSome) text += fmt::format(" and {} more", names.size() - kSome);
  return text;
}

std::string SpreadText(const Json& spread) {
  return fmt::format("median {:.3g}; {:.3g} to {:.3g} without the smallest and largest 1 %",
                     spread["median"].get<double>(), spread["percent_1"].get<double>(),
                     spread["percent_99"].get<double>());
}

/// What the scene asks of loader, tracer and structures, each with its reason.
void PrintNeeds(const Json& needs) {
  fmt::print("  needs\n");
  for (const auto& [name, need] : needs.items()) {
    if (!need.is_object()) continue;
    fmt::print("    {:<16} {:<4} {}\n", name, need["needed"].get<bool>() ? "yes" : "no",
               need["why"].get<std::string>());
  }
  if (const Json& ulp = needs["smallest_feature_ulp"]; !ulp.is_null())
    Line("smallest feature", fmt::format("{:.3g} ulp of the largest coordinate", ulp.get<double>()));
  if (const Json& spread = needs["size_spread"]; !spread.is_null())
    Line("triangle sizes",
         fmt::format("the 99th percentile is {:.3g} times the first", spread.get<double>()));
}

void Print(const Json& json) {
  fmt::print("{}\n", json["name"].get<std::string>());
  std::string primitives = Count(json, "triangles") + " triangles";
  for (const auto& [kind, count] : json["procedural"].items())
    primitives += fmt::format(", {} {}", count.get<uint64_t>(), kind);
  if (!json["faces_in_file"].is_null())
    primitives += fmt::format(" from {} faces", Count(json, "faces_in_file"));
  Line("primitives", primitives);
  Line("vertices",
       fmt::format("{}, at {} distinct places", Count(json, "vertices"), Count(json, "distinct_positions")));
  if (!json["closed"].is_null()) {
    Line("surface", fmt::format("{}: {} boundary edges, {} edges of more than two triangles",
                                json["closed"].get<bool>() ? "closed" : "not closed",
                                Count(json, "boundary_edges"), Count(json, "non_manifold_edges")));
    Line("triangle area", SpreadText(json["triangle_area"]));
    Line("triangle aspect", SpreadText(json["triangle_aspect"]) + " (longest edge over height)");
  }
  if (!json["bounds"].is_null()) {
    const auto lo = json["bounds"]["lo"].get<std::vector<float>>(),
               hi = json["bounds"]["hi"].get<std::vector<float>>();
    const int exponent = json["scale_exponent"];
    Line("bounds", fmt::format("({}, {}, {}) to ({}, {}, {}){}", lo[0], lo[1], lo[2], hi[0], hi[1], hi[2],
                               exponent == 0 ? "" : fmt::format(", after scaling by 2^{}", exponent)));
  }
  Line("materials", fmt::format("{}: {}", json["materials"].size(), Some(json["materials"])));
  Line("textures",
       Count(json, "textures") + (json["shading_normals"].get<bool>() ? "; with shading normals" : ""));
  Line("cameras", Count(json, "cameras") + (json["automatic_camera"].get<bool>() ? ", automatic" : ""));
  Line("lights", Count(json, "lights") + (json["automatic_lights"].get<bool>() ? ", automatic" : ""));
  Line("left out", fmt::format("{} degenerate, {} bad triangles", Count(json, "degenerate_triangles"),
                               Count(json, "dropped_triangles")));
  if (json["instances"].get<uint64_t>() > 0)
    Line("instances", fmt::format("{}, sharing {} triangles in the file", Count(json, "instances"),
                                  Count(json, "shared_triangles")));
  PrintNeeds(json["needs"]);
  for (const Json& note : json["notes"]) Line("note", note.get<std::string>());
  Line("memory", fmt::format("{:.1f} MB; left out what nothing reads: {:.1f} MB",
                             double(json["bytes"].get<uint64_t>()) * 1e-6,
                             double(json["saved_bytes"].get<uint64_t>()) * 1e-6));
  Line("hash", json["hash"].get<std::string>());
  Line("source", Text(json, "source", "not known"));
  if (!json["package"].is_null())
    Line("package", fmt::format("{} {}", Text(json, "package", ""), Text(json, "version", "")));
  Line("licence", Text(json, "licence", "not stated"));
  if (!json["sha256"].is_null()) Line("SHA-256", Text(json, "sha256", ""));
  Line("loaded in", fmt::format("{:.2f} s", json["load_seconds"].get<double>()));
}

/// What the manifest knows of a model that is not there yet.
void PrintUnfetched(const ManifestEntry& entry, bool as_json) {
  if (as_json) {
    const Json json{{"name", entry.name},
                    {"fetched", false},
                    {"doc", entry.doc},
                    {"family", entry.family},
                    {"triangles", entry.triangles},
                    {"client", entry.client},
                    {"package", entry.package},
                    {"versions", entry.versions},
                    {"licence", entry.licence},
                    {"author", TextOrNull(entry.author)},
                    {"download_bytes", entry.package_bytes},
                    {"fetch", fmt::format("raybench fetch {}", entry.name)}};
    fmt::print("{}\n", json.dump(2));
    return;
  }
  fmt::print("{}\n", entry.name);
  Line("what", fmt::format("{}: {}", entry.family, entry.doc));
  Line("triangles", fmt::format("{}", entry.triangles));
  std::string versions;
  for (const std::string& version : entry.versions)
    versions += fmt::format("{}{}", versions.empty() ? "" : " or ", version);
  Line("package", fmt::format("{} package {} {}", entry.client, entry.package, versions));
  Line("licence", entry.licence);
  if (!entry.author.empty()) Line("author", entry.author);
  Line("download", fmt::format("about {:.1f} MB", double(entry.package_bytes) * 1e-6));
  Line("not fetched", fmt::format("fetch it with 'raybench fetch {}'", entry.name));
}

int ListScene(const ListSceneOptions& options) {
  for (const ManifestEntry& entry : Manifest()) {
    if (entry.name != options.scene || IsFetched(entry)) continue;
    PrintUnfetched(entry, options.json);
    return 0;
  }
  LoadOptions load;
  load.seed = options.seed;
  load.drop_bad = options.drop_bad;
  const Stopwatch watch(true);
  const Scene scene = LoadWithProgress(options.scene, load);
  const double seconds = watch.Elapsed().wall;
  ThrowIfInterrupted();
  const Json json = Describe(scene, Examine(scene), seconds);
  if (options.json) {
    fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
  } else {
    Print(json);
  }
  return 0;
}

}  // namespace

void AddListSceneCommand(CLI::App& list, Invocation& invocation) {
  AddCommand<ListSceneOptions>(
      list, invocation, "scene", "Load one scene and show its contents",
      [](CLI::App& command, ListSceneOptions& options) {
        command.add_option("scene", options.scene, "File, generator, model or modified scene")
            ->required()
            ->type_name("SCENE");
        command.add_option("--seed", options.seed, "Seed of generators; default 1")
            ->transform(WholeNumber())
            ->type_name("N");
        command.add_flag("--drop-bad", options.drop_bad,
                         "Leave out bad triangles instead of refusing the file");
        command.add_flag("--json", options.json, "Print this as JSON; null: not known or not applicable");
      },
      [](const ListSceneOptions& options, const Registry&) { return ListScene(options); });
}

}  // namespace raybench
