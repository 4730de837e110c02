#include "harness/results/run_facts.h"

#include <fmt/format.h>

#include "harness/measure/measure.h"

namespace raybench {

Json FactsOf(const Scene& scene) {
  return {{"hash", scene.hash()},
          {"triangles", scene.triangles.size()},
          {"procedural", scene.procedural_count()},
          {"source", scene.provenance.source},
          {"licence", scene.provenance.licence},
          {"package", scene.provenance.package},
          {"version", scene.provenance.version},
          {"sha256", scene.provenance.sha256},
          {"faces", scene.stats.faces},
          {"degenerate_triangles", scene.stats.degenerate_triangles},
          {"dropped_triangles", scene.stats.dropped_triangles},
          {"crossed_faces", scene.stats.crossed_faces},
          {"instances", scene.stats.instances},
          {"shared_triangles", scene.stats.shared_triangles},
          {"saved_bytes", scene.stats.saved_bytes},
          {"scale_exponent", scene.scale_exponent},
          {"automatic_camera", scene.automatic_camera},
          {"automatic_lights", scene.automatic_lights}};
}

Json FactsOf(const SceneNeeds& needs, const Scene& scene, const SceneFacts& facts) {
  Json json;
  for (const Need& need : needs.list) json[need.name] = {{"needed", need.needed}, {"why", need.why}};
  const auto if_there = [](bool there, Json value) { return there ? std::move(value) : Json(); };
  json["closed"] = if_there(!scene.triangles.empty(), facts.closed());
  json["smallest_feature_ulp"] = if_there(facts.smallest_feature_ulp > 0, facts.smallest_feature_ulp);
  json["size_spread"] = if_there(!scene.triangles.empty(), facts.size_spread());
  return json;
}

std::optional<Kind> KindOf(const rb_structure& structure) {
  for (const Builtin& builtin : BuiltinStructures())
    if (builtin.table == &structure) return builtin.kind;
  return std::nullopt;
}

Json FactsOf(const Contestant& contestant, const Registry& registry) {
  const std::optional<Kind> kind = KindOf(*contestant.structure);
  return {{"spec", contestant.Spec()},
          {"params", contestant.Params()},
          {"family", kind ? Json(kind->family) : Json()},
          {"doc", contestant.structure->doc},
          {"source", contestant.structure->source},
          {"plugin", registry.OriginOf(*contestant.structure)}};
}

Json FactsOf(const RunOptions& options) {
  const bool whole_files = !options.ray_files.empty() && options.rays == 0;
  return {{"command_line", options.command_line},
          {"seed", options.seed},
          {"quick", options.suite.name == "quick"},
          {"suite", {{"name", options.suite.name}, {"hash", options.suite.hash}}},
          {"rays_per_set", whole_files ? Json() : Json(options.RaysPerSet())},
          {"verified_per_set", options.RaysVerified()},
          {"depth", options.depth},
          {"memory_limit", options.memory_limit},
          {"processes", options.processes},
          {"shard", options.shards == 1 ? Json() : Json(fmt::format("{}/{}", options.shard, options.shards))},
          {"plugins", options.plugins}};
}

Json TimingFacts(const RunOptions& options) {
  const std::string remarks = EngineRemarks();
  return {
      {"engine", "Google Benchmark"},
      {"repetitions", options.Repetitions()},
      {"random_interleaving", true},
      {"flags", options.benchmark_flags},
      {"budget_seconds", options.Budget()},
      {"clock", "CPU time at one thread, pinned; wall time at more"},
      {"engine_remarks", remarks.empty() ? Json() : Json(remarks)},
      {"engine_built_as_debug", remarks.empty() ? Json() : Json(remarks.find("DEBUG") != std::string::npos)}};
}

}  // namespace raybench
