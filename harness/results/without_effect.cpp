#include "harness/results/without_effect.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>

#include "accel/host/parameters.h"

namespace raybench {
namespace {

/// All that tells one contestant from another on a scene.
struct Likeness {
  std::string tree, bytes;
  std::map<std::string, std::string> answers;  ///< digest by ray set, order and query
  bool has_closest = false;

  bool operator==(const Likeness& other) const { return tree == other.tree && answers == other.answers; }
};

void Add(Likeness& likeness, const Row& row) {
  if (likeness.tree.empty() && row.Has(column::node_bytes)) {
    likeness.bytes = fmt::format("{}+{}", *row.Get(column::node_bytes), *row.Get(column::prim_bytes));
    likeness.tree = row.Has(column::tree_digest) ? row.Get(column::tree_digest) : likeness.bytes;
  }
  if (!row.Has(column::hits_digest)) return;
  const std::string query = row.Get(column::query);
  likeness.has_closest |= query == "closest";
  likeness.answers[fmt::format("{}/{}/{}", row.Get(column::ray_set), row.Get(column::order), query)] =
      row.Get(column::hits_digest);
}

const Contestant* Find(std::span<const Contestant> contestants, const std::string& spec) {
  for (const Contestant& c : contestants)
    if (c.Spec() == spec) return &c;
  return nullptr;
}

/// The parameters in which two of the same structure differ, but for those of speed alone.
std::vector<std::string> Differing(const Contestant& a, const Contestant& b) {
  std::vector<std::string> names;
  for (const rb_param& p : std::span(a.structure->params, a.structure->param_count))
    if ((p.flags & RB_PARAM_SPEED_ONLY) == 0 &&
        FormatParameter(p, a.config.data()) != FormatParameter(p, b.config.data()))
      names.push_back(p.name);
  return names;
}

}  // namespace

std::vector<Twins> FindTwins(std::span<const FinishedCase> cases, std::span<const Contestant> contestants) {
  std::map<std::string, std::map<std::string, Likeness>> scenes;
  for (const FinishedCase& c : cases)
    if (c.row.Get(column::status) == "timed")
      Add(scenes[c.row.Get(column::scene)][c.row.Get(column::spec)], c.row);
  std::vector<Twins> found;
  for (const auto& [scene, likenesses] : scenes)
    for (auto a = likenesses.begin(); a != likenesses.end(); ++a)
      for (auto b = std::next(a); b != likenesses.end(); ++b) {
        const Contestant *first = Find(contestants, a->first), *second = Find(contestants, b->first);
        if (first == nullptr || second == nullptr || !a->second.has_closest || !(a->second == b->second))
          continue;
        if (first->structure != second->structure) {
          if (first->structure->visit != nullptr && second->structure->visit != nullptr)
            found.push_back({scene, a->first, b->first, {}});
        } else if (auto names = Differing(*first, *second);
                   !names.empty() && a->second.bytes == b->second.bytes) {
          found.push_back({scene, a->first, b->first, std::move(names)});
        }
      }
  return found;
}

std::string Say(const Twins& twins) {
  const std::string same =
      fmt::format("{}: {} and {} have the same tree and the same answers", twins.scene, twins.a, twins.b);
  if (twins.parameters.empty()) return same + ": are they two structures?";
  return fmt::format("{}: has {} no effect here?", same, fmt::join(twins.parameters, ", "));
}

}  // namespace raybench
