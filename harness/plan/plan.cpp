#include "harness/plan/plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <set>
#include <span>

#include "accel/base/hash.h"
#include "accel/base/random.h"

namespace raybench {

std::string Case::Id() const {
  Hash64 hash;
  for (const std::string* text :
       {&scene, &scene_hash, &structure, &params, &ray_set, &ray_hash, &query, &order}) {
    hash.Add(std::string_view(*text));
  }
  hash.AddValue(uint64_t{threads});
  hash.AddValue(seed);
  return hash.Hex();
}

namespace {

/// One structure of each family; the rest is asked for by name.
constexpr std::string_view kFamilies[] = {"brute", "bvh_sah",    "bvh_wide", "embree", "grid",
                                          "kdop",  "kdtree_sah", "null",     "octree"};

bool IsFamilies(const std::vector<std::string>& specs) {
  return specs.empty() || (specs.size() == 1 && specs[0] == "families");
}

bool IsEvery(const std::vector<std::string>& specs) { return specs.size() == 1 && specs[0] == "all"; }

std::vector<const rb_structure*> ChooseStructures(const Registry& registry, bool all) {
  std::vector<const rb_structure*> chosen;
  for (const rb_structure* s : registry.structures()) {
    const bool is_family =
        std::find(std::begin(kFamilies), std::end(kFamilies), s->name) != std::end(kFamilies);
    if (all || is_family || !registry.OriginOf(*s).empty()) chosen.push_back(s);
  }
  return chosen;
}

}  // namespace

bool Owns(const RunOptions& options, size_t scene, size_t scenes, size_t structure, size_t structures) {
  return (scene * structures + structure) * options.shards / (scenes * structures) + 1 == options.shard;
}

std::string WhyNotTaken(const rb_structure& structure, const Scene& scene) {
  if (scene.procedural_count() == 0 || (structure.capabilities & RB_CAN_PROCEDURAL) != 0) return {};
  return "the scene has procedural primitives and the structure takes triangles only";
}

std::vector<Contestant> ChooseContestants(const Registry& registry, const std::vector<std::string>& specs) {
  std::vector<Contestant> chosen;
  if (!IsFamilies(specs) && !IsEvery(specs)) {
    std::set<std::string> seen;
    for (const std::string& spec : specs) {
      chosen.push_back(ParseContestant(registry, spec));
      if (!seen.insert(chosen.back().Spec()).second) {
        throw InputError(fmt::format("structure '{}' is given twice", chosen.back().Spec()));
      }
    }
    return chosen;
  }
  // What accuracy costs and brings: the ends that the defaults lie between.
  const std::pair<std::string_view, const char*> variants[] = {{"bvh_sah", "bvh_sah(numerics=fast)"},
                                                               {"bvh_sah", "bvh_sah(numerics=exact)"},
                                                               {"embree", "embree(robust=true)"}};
  for (const rb_structure* structure : ChooseStructures(registry, IsEvery(specs))) {
    chosen.push_back(ParseContestant(registry, structure->name));
    for (auto [name, spec] : variants) {
      if (name == structure->name) chosen.push_back(ParseContestant(registry, spec));
    }
  }
  return chosen;
}

std::vector<Contestant> EveryArithmetic(const Registry& registry, const std::vector<std::string>& specs) {
  if (!IsFamilies(specs) && !IsEvery(specs)) return ChooseContestants(registry, specs);
  std::vector<Contestant> chosen;
  for (const rb_structure* s : ChooseStructures(registry, IsEvery(specs))) {
    if (std::string_view(s->name) == "null") continue;  // always misses
    std::vector<std::string> variants;
    for (const rb_param& p : std::span(s->params, s->param_count)) {
      const std::string_view name = p.name;
      if (p.type == RB_CHOICE && name == "numerics") {
        for (const char* const* choice = p.choices; *choice != nullptr; ++choice)
          variants.push_back(fmt::format("{}(numerics={})", s->name, *choice));
      } else if (p.type == RB_BOOL && name == "robust") {
        for (const char* value : {"false", "true"})
          variants.push_back(fmt::format("{}(robust={})", s->name, value));
      }
    }
    if (variants.empty()) variants.push_back(s->name);
    for (const std::string& spec : variants) chosen.push_back(ParseContestant(registry, spec));
  }
  return chosen;
}

std::vector<uint32_t> PickSample(uint64_t n, uint64_t count, uint64_t seed, const std::string& stream) {
  std::vector<uint32_t> picks;
  count = std::min(n, count);
  picks.reserve(count);
  Hash64 hash;
  hash.Add(std::string_view(stream));
  Random random(seed, hash.value());
  for (uint64_t i = 0; i < count; ++i) {
    const uint64_t lo = i * n / count, hi = (i + 1) * n / count;
    picks.push_back(uint32_t(lo + random.Below(hi - lo)));
  }
  return picks;
}

std::string FileStem(const std::string& name) {
  const bool generator = !name.empty() && name.back() == ')';
  const std::string base = generator ? name : std::filesystem::path(name).stem().string();
  std::string stem;
  for (char c : base) {
    const bool keep = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-';
    if (keep) {
      stem += c;
    } else if (!stem.empty() && stem.back() != '_') {
      stem += '_';
    }
  }
  while (!stem.empty() && stem.back() == '_') stem.pop_back();
  return stem.empty() ? "scene" : stem;
}

std::string DistinctNames::operator()(const std::string& wanted) {
  std::string name = wanted;
  for (int n = 2; !given_.insert(name).second; ++n) name = fmt::format("{}_{}", wanted, n);
  return name;
}

}  // namespace raybench
