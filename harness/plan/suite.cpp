#include "harness/plan/suite.h"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <limits>
#include <set>
#include <sstream>

#include "accel/base/hash.h"
#include "accel/host/names.h"
#include "accel/host/parameters.h"
#include "datasets/scene/scene.h"
#include "datasets/scene/text.h"

namespace raybench {

extern const SuiteText kShippedSuites[];  // suites.cpp, made from suites/*.toml
extern const size_t kShippedSuiteCount;

namespace {

class Reader {
 public:
  Reader(const Registry& registry, const std::string& text, const std::string& where)
      : registry_(registry), where_(where) {
    try {
      table_ = toml::parse(text);
    } catch (const toml::parse_error& error) {
      throw InputError(fmt::format("{}:{}: not TOML: {}", where_, error.source().begin.line,
                                   OneLine(std::string(error.description()))));
    }
  }

  Suite Read() {
    Suite suite;
    Text("doc", suite.doc);
    List("scenes", [&](const toml::node& node, const std::string& key) { AddScenes(suite, node, key); });
    Words("numerics", numerics_);
    List("structures",
         [&](const toml::node& node, const std::string& key) { AddStructures(suite, node, key); });
    if (suite.structures == std::vector<std::string>{"families"}) suite.structures.clear();
    Words("sets", suite.sets);
    List("threads", [&](const toml::node& node, const std::string& key) {
      suite.threads.push_back(uint32_t(WholeNumber(node, key, 1, 1024)));
    });
    std::sort(suite.threads.begin(), suite.threads.end());
    suite.threads.erase(std::unique(suite.threads.begin(), suite.threads.end()), suite.threads.end());
    Number("rays", suite.rays, 64, uint64_t{1} << 28);
    Number("verify_rays", suite.verify_rays, 1, uint64_t{1} << 28);
    Number("tree_samples", suite.tree_samples, 1, uint64_t{1} << 28);
    Number("linear_tests", suite.linear_tests, 1, uint64_t{1} << 50);
    Number("seed", suite.seed, 0, uint64_t(std::numeric_limits<int64_t>::max()));
    Number("repetitions", suite.repetitions, 1, 10000);
    Number("fewest_samples", suite.fewest_samples, 1, 10000);
    Number("depth", suite.depth, 0, 64);
    Number("heat_pixels", suite.heat_pixels, 8, 4096);
    Number("processes", suite.processes, 1, 1000);
    if (const toml::node* node = Take("sample_seconds")) {
      const auto value = node->value<double>();
      if (!value || !(*value >= 1e-4 && *value <= 3600))
        Fail(*node, "sample_seconds", "allowed: a number from 0.0001 to 3600");
      suite.sample_seconds = *value;
    }
    if (const toml::node* node = Take("shuffled")) {
      if (!node->is_boolean()) Fail(*node, "shuffled", "allowed: true or false");
      suite.shuffled = *node->value<bool>();
    }
    RefuseOthers();
    if (suite.scenes.empty()) Fail(table_, "scenes", "missing; allowed: a list of at least one scene");
    return suite;
  }

 private:
  [[noreturn]] void Fail(const toml::node& node, const std::string& key, const std::string& what) const {
    throw InputError(fmt::format("{}:{}: {}: {}", where_, node.source().begin.line, key, what));
  }

  /// The node of a key, which is then known.
  const toml::node* Take(const char* key) {
    known_.push_back(key);
    return table_.get(key);
  }

  void RefuseOthers() const {
    for (const auto& [key, node] : table_) {
      const std::string name(key.str());
      if (std::find(known_.begin(), known_.end(), name) != known_.end()) continue;
      throw InputError(fmt::format("{}:{}: {}: unknown key{}; allowed: {}", where_, key.source().begin.line,
                                   name, DidYouMean(name, known_), fmt::join(known_, ", ")));
    }
  }

  void Text(const char* key, std::string& value) {
    const toml::node* node = Take(key);
    if (node == nullptr) return;
    if (!node->is_string()) Fail(*node, key, "allowed: a text");
    value = *node->value<std::string>();
  }

  /// Without the key nothing is called.
  template <class Each>
  void List(const char* key, const Each& each) {
    const toml::node* node = Take(key);
    if (node == nullptr) return;
    if (!node->is_array() || node->as_array()->empty()) Fail(*node, key, "allowed: a list of at least one");
    size_t index = 0;
    for (const toml::node& item : *node->as_array()) each(item, fmt::format("{}[{}]", key, index++));
  }

  void Words(const char* key, std::vector<std::string>& words) {
    List(key, [&](const toml::node& node, const std::string& at) {
      if (!node.is_string()) Fail(node, at, "allowed: a text");
      words.push_back(*node.value<std::string>());
    });
  }

  uint64_t WholeNumber(const toml::node& node, const std::string& key, uint64_t lo, uint64_t hi) const {
    const auto value = node.is_integer() ? node.value<int64_t>() : std::nullopt;
    if (!value || *value < 0 || uint64_t(*value) < lo || uint64_t(*value) > hi)
      Fail(node, key, fmt::format("allowed: a whole number from {} to {}", lo, hi));
    return uint64_t(*value);
  }

  template <class T>
  void Number(const char* key, T& value, uint64_t lo, uint64_t hi) {
    if (const toml::node* node = Take(key)) value = T(WholeNumber(*node, key, lo, hi));
  }

  /// One value of a parameter, as the command line has it.
  std::string Value(const toml::node& node, const std::string& key) const {
    if (node.is_string()) return *node.value<std::string>();
    if (node.is_boolean()) return *node.value<bool>() ? "true" : "false";
    if (node.is_integer()) return fmt::format("{}", *node.value<int64_t>());
    if (node.is_floating_point()) return fmt::format("{}", *node.value<double>());
    Fail(node, key, "allowed: a text, a number, true or false, or a list of these");
  }

  /// "NAME(KEY=VALUE,...)" for each combination of the values in a table's lists, the last key fastest.
  std::vector<std::string> Grid(const toml::table& table, const std::string& key) const {
    const toml::node* name = table.get("name");
    if (name == nullptr || !name->is_string()) Fail(table, key + ".name", "missing; allowed: a text");
    std::vector<std::string> combinations = {""};
    std::vector<std::pair<const toml::key*, const toml::node*>> in_order;
    for (const auto& [parameter, node] : table)
      if (parameter.str() != "name") in_order.push_back({&parameter, &node});
    // The library sorts by name; what was written first varies slowest.
    std::sort(in_order.begin(), in_order.end(), [](const auto& a, const auto& b) {
      const auto place = [](const toml::source_position& p) { return std::pair(p.line, p.column); };
      return place(a.first->source().begin) < place(b.first->source().begin);
    });
    for (const auto& [parameter, node] : in_order) {
      const std::string at = fmt::format("{}.{}", key, parameter->str());
      std::vector<std::string> values, longer;
      if (const toml::array* list = node->as_array()) {
        if (list->empty()) Fail(*node, at, "allowed: a list of at least one");
        for (const toml::node& item : *list) values.push_back(Value(item, at));
      } else {
        values.push_back(Value(*node, at));
      }
      for (const std::string& before : combinations)
        for (const std::string& value : values)
          longer.push_back(
              fmt::format("{}{}{}={}", before, before.empty() ? "" : ",", parameter->str(), value));
      combinations = std::move(longer);
    }
    std::vector<std::string> specs;
    for (const std::string& values : combinations)
      specs.push_back(fmt::format("{}{}{}{}", *name->value<std::string>(), values.empty() ? "" : "(", values,
                                  values.empty() ? "" : ")"));
    return specs;
  }

  std::vector<std::string> Specs(const toml::node& node, const std::string& key) const {
    if (node.is_string()) return {*node.value<std::string>()};
    if (const toml::table* table = node.as_table()) return Grid(*table, key);
    Fail(node, key,
         "allowed: a name such as bvh_sah(leaf_size=4), or a table {name = ..., PARAMETER = [...]}");
  }

  void AddScenes(Suite& suite, const toml::node& node, const std::string& key) {
    for (const std::string& name : Specs(node, key)) {
      try {
        CheckSceneName(name);
      } catch (const InputError& error) {
        Fail(node, key, error.what());
      }
      if (!scenes_.insert(name).second) Fail(node, key, fmt::format("'{}' is given twice", name));
      suite.scenes.push_back(name);
    }
  }

  void AddStructures(Suite& suite, const toml::node& node, const std::string& key) {
    std::vector<std::string> specs = Specs(node, key);
    const bool all = specs[0] == "all" || specs[0] == "families";
    if (all && node.is_string() && table_.get("structures")->as_array()->size() > 1)
      Fail(node, key, fmt::format("'{}' stands alone", specs[0]));
    if (all && !numerics_.empty())
      Fail(node, key, fmt::format("'{}' cannot be multiplied by `numerics`; name the structures", specs[0]));
    if (all) {
      suite.structures = specs;
      return;
    }
    for (const std::string& text : specs) {
      try {
        for (const std::string& spec : WithNumerics(text)) {
          const std::string canonical = ParseContestant(registry_, spec).Spec();
          // Grids meet: bvh_sah and bvh_sah(leaf_size=16) are the same where that is the default.
          if (seen_.insert(canonical).second) suite.structures.push_back(canonical);
        }
      } catch (const InputError& error) {
        Fail(node, key, error.what());
      }
    }
  }

  /// The structure at each of the suite's `numerics`, unless it says its own or has none.
  std::vector<std::string> WithNumerics(const std::string& text) const {
    const Spec spec = ParseSpec(text);
    const rb_structure& structure = *ParseContestant(registry_, text).structure;
    const std::span<const rb_param> params(structure.params, structure.param_count);
    const bool has = std::any_of(params.begin(), params.end(),
                                 [](const rb_param& p) { return std::string_view(p.name) == "numerics"; });
    const bool own = std::any_of(spec.values.begin(), spec.values.end(),
                                 [](const auto& value) { return value.first == "numerics"; });
    if (numerics_.empty() || !has || own) return {text};
    std::vector<std::string> specs;
    for (const std::string& value : numerics_) {
      std::string inner = "numerics=" + value;
      for (const auto& [name, of] : spec.values) inner += fmt::format(",{}={}", name, of);
      specs.push_back(fmt::format("{}({})", spec.name, inner));
    }
    return specs;
  }

  const Registry& registry_;
  const std::string& where_;
  toml::table table_;
  std::vector<std::string_view> known_;
  std::vector<std::string> numerics_;
  std::set<std::string> scenes_, seen_;
};

}  // namespace

std::span<const SuiteText> ShippedSuites() { return {kShippedSuites, kShippedSuiteCount}; }

Suite ParseSuite(const Registry& registry, const std::string& text, const std::string& where,
                 const std::string& name) {
  Suite suite = Reader(registry, text, where).Read();
  suite.name = name;
  Hash64 hash;
  hash.Add(std::string_view(text));
  suite.hash = hash.Hex();
  return suite;
}

Suite ReadSuite(const Registry& registry, const std::string& name) {
  if (!name.ends_with(".toml")) {
    std::vector<std::string_view> known;
    for (const SuiteText& shipped : ShippedSuites()) {
      if (name == shipped.name) return ParseSuite(registry, shipped.text, name + ".toml", name);
      known.push_back(shipped.name);
    }
    throw InputError(fmt::format("unknown suite '{}'{}; allowed: {}, or a file whose name ends in .toml",
                                 name, DidYouMean(name, known), fmt::join(known, ", ")));
  }
  std::ifstream in(name, std::ios::binary);
  std::ostringstream text;
  if (in) text << in.rdbuf();
  if (!in) throw InputError(fmt::format("{}: cannot be read", name));
  return ParseSuite(registry, text.str(), name, std::filesystem::path(name).stem().string());
}

}  // namespace raybench
