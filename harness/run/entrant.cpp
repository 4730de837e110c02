#include "harness/run/entrant.h"

#include <fmt/format.h>

#include <algorithm>

namespace raybench {

std::string PlannedCase::Name() const {
  return fmt::format("{}/{}/{}/{}/{}/threads:{}", key.scene, key.spec, key.ray_set, key.order, key.query,
                     key.threads);
}

bool Entrant::Answers(size_t set) const {
  return std::any_of(cases.begin(), cases.end(), [&](const PlannedCase& c) {
    return !c.key.IsBuild() && c.set == set && c.skip.empty();
  });
}

bool Entrant::AllDone(const ResultFolder& results) const {
  return std::all_of(cases.begin(), cases.end(),
                     [&](const PlannedCase& c) { return results.Has(c.key.Id()); });
}

bool Entrant::MayHaveDigest(const std::string& digest) const {
  return std::all_of(build_values.begin(), build_values.end(), [&](const auto& build) {
    const Row& row = build.second;
    return !row.Has(column::tree_digest) || row.Get(column::tree_digest) == digest;
  });
}

void Entrant::SetTreeValues(const TreeStatistics& s, std::optional<double> overlap,
                            std::optional<double> tightness) {
  for (auto& [threads, values] : build_values) {
    if (!values.Has(column::node_bytes)) continue;
    values[column::inner_nodes] = s.inner_nodes;
    values[column::leaf_nodes] = s.leaf_nodes;
    values[column::empty_leaf_nodes] = s.empty_leaf_nodes;
    values[column::references] = s.references;
    values[column::depth] = s.depth;
    values[column::tree_digest] = s.digest;
    values[column::sah_cost] = s.sah_cost;
    values[column::epo] = overlap;
    values[column::leaf_depth] = s.leaf_depth;
    values[column::tightness] = tightness;
  }
}

Row Entrant::ValuesOf(const PlannedCase& c) const {
  if (build_values.empty()) return {};
  if (c.key.IsBuild()) {
    const auto own = build_values.find(c.key.threads);
    return own != build_values.end() ? own->second : Row();
  }
  Row values = build_values.begin()->second;
  values[column::build_peak_bytes] = std::optional<uint64_t>();
  for (const auto& of_build : {column::cold_ns, column::device_ns, column::copies_ns})
    values[of_build] = std::optional<double>();
  if (c.set < set_values.size()) values.Take(set_values[c.set]);
  return values;
}

void Entrant::StoreSkipped(const ResultFolder& results) const {
  if (foreign) return;
  for (const PlannedCase& c : cases) {
    if (c.skip.empty() || results.Has(c.key.Id())) continue;
    Row row;
    row[column::status] = "skipped";
    row[column::note] = c.skip;
    results.Store(c.key, row, {});
  }
}

void Entrant::Close(const ResultFolder& results, const std::string& status, const std::string& note) {
  StoreSkipped(results);
  for (const PlannedCase& c : cases) {
    if (foreign) break;
    if (results.Has(c.key.Id())) continue;
    Row values = ValuesOf(c);
    values[column::status] = status;
    values[column::note] = note;
    results.Store(c.key, values, {});
  }
  tree = Tree();
}

std::vector<Entrant*> AnchorsFirst(std::vector<Entrant>& entrants) {
  std::vector<Entrant*> order;
  for (Entrant& entrant : entrants) order.push_back(&entrant);
  const auto place = [](const Entrant* e) {
    if (e->Spec() == "embree") return 0;
    return e->Is("null") ? 3 : e->Can(RB_LINEAR) || e->Can(RB_DEVICE) ? 2 : 1;
  };
  std::stable_sort(order.begin(), order.end(),
                   [&](const Entrant* a, const Entrant* b) { return place(a) < place(b); });
  return order;
}

}  // namespace raybench
