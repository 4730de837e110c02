#include "harness/plan/params_file.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>

#include "accel/host/parameters.h"
#include "harness/plan/plan.h"

namespace raybench {
namespace {

using Values = std::vector<std::pair<std::string, std::string>>;

std::string Format(const std::string& name, const Values& values) {
  std::vector<std::string> items;
  for (const auto& [key, value] : values) items.push_back(key + "=" + value);
  return items.empty() ? name : fmt::format("{}({})", name, fmt::join(items, ","));
}

class ParamsFile {
 public:
  ParamsFile(const Registry& registry, const std::string& file) : registry_(registry), file_(file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw InputError(fmt::format("--params {}: cannot be read", file));
    const std::string text(std::istreambuf_iterator<char>(in), {});
    try {
      for (const auto& [key, node] : toml::parse(text)) Read(std::string(key.str()), node);
    } catch (const toml::parse_error& error) {
      std::string why(error.description());
      std::replace(why.begin(), why.end(), '\n', ' ');
      throw InputError(fmt::format("{}:{}: not TOML: {}", file, error.source().begin.line, why));
    }
  }

  const Values* Of(const std::string& structure) const {
    const auto it = values_.find(structure);
    return it == values_.end() ? nullptr : &it->second;
  }

 private:
  void Read(const std::string& structure, const toml::node& node) {
    const auto fail = [&](const std::string& why) {
      throw InputError(fmt::format("{}:{}: {}", file_, node.source().begin.line, why));
    };
    if (!node.is_table())
      fail(fmt::format("'{}' must be a table, the name of a structure with its parameters", structure));
    Values& values = values_[structure];
    for (const auto& [key, value] : *node.as_table()) {
      const std::string name(key.str());
      if (value.is_string()) {
        values.emplace_back(name, **value.as_string());
      } else if (value.is_boolean()) {
        values.emplace_back(name, **value.as_boolean() ? "true" : "false");
      } else if (value.is_integer()) {
        values.emplace_back(name, fmt::format("{}", **value.as_integer()));
      } else if (value.is_floating_point()) {
        values.emplace_back(name, fmt::format("{}", **value.as_floating_point()));
      } else {
        fail(fmt::format("'{}' must be a number, a word, true or false", name));
      }
    }
    try {
      ParseContestant(registry_, Format(structure, values));
    } catch (const InputError& error) {
      fail(error.what());
    }
  }

  const Registry& registry_;
  const std::string file_;
  std::map<std::string, Values> values_;
};

}  // namespace

std::vector<std::string> ApplyParams(const Registry& registry, const std::string& file,
                                     const std::vector<std::string>& specs) {
  const ParamsFile params(registry, file);
  // "families" and "all" stand for what they choose; what was typed says more than a contestant, which does not
  // tell a default from a value given.
  std::vector<std::string> chosen = specs;
  const auto is_structure = [&](const std::string& spec) {
    const auto same = [&](const rb_structure* s) { return ParseSpec(spec).name == s->name; };
    return std::any_of(registry.structures().begin(), registry.structures().end(), same);
  };
  if (specs.empty() || !std::all_of(specs.begin(), specs.end(), is_structure)) {
    chosen.clear();
    for (const Contestant& contestant : ChooseContestants(registry, specs))
      chosen.push_back(contestant.Spec());
  }
  std::vector<std::string> applied;
  bool found = false;
  for (const std::string& text : chosen) {
    Spec spec = ParseSpec(text);
    if (const Values* values = params.Of(spec.name)) {
      found = true;
      for (const auto& [key, value] : *values) {
        const auto same = [&](const auto& given) { return given.first == key; };
        if (std::none_of(spec.values.begin(), spec.values.end(), same)) spec.values.emplace_back(key, value);
      }
    }
    applied.push_back(Format(spec.name, spec.values));
  }
  if (!found) throw InputError(fmt::format("--params {}: has none of the structures that are run", file));
  return applied;
}

}  // namespace raybench
