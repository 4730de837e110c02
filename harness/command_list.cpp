// raybench list: structures and scenes, with all parameters. `list scene` is in command_list_scene.cpp.
#include <fmt/format.h>
#include <fmt/ranges.h>

#include "datasets/fetch.h"
#include "datasets/scene.h"
#include "harness/commands.h"

namespace raybench {
namespace {

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

void PrintParameters(std::span<const rb_param> params, size_t config_size) {
  if (params.empty()) return;
  const std::vector<std::byte> defaults = Configure("", params, config_size, {});
  for (const rb_param& p : params) {
    fmt::print("      {:<16} {}, default {}{}: {}\n", p.name, Range(p), FormatParameter(p, defaults.data()),
               (p.flags & RB_PARAM_APPROXIMATE) != 0 ? ", trades exactness for speed" : "", p.doc);
  }
}

/// Every structure with its parameters, types, ranges and defaults, to stdout.
int ListStructures(const Registry& registry) {
  for (const rb_structure* s : registry.structures()) {
    const std::string origin = registry.OriginOf(*s);
    fmt::print("{}: {}\n      source: {}{}\n", s->name, s->doc, s->source,
               origin.empty() ? std::string() : fmt::format("\n      plugin: {}", origin));
    std::string can;
    for (auto [flag, text] :
         {std::pair(RB_CAN_COUNT, "counts"), std::pair(RB_CAN_PROCEDURAL, "procedural primitives"),
          std::pair(RB_CAN_AFTER, "resumes"), std::pair(RB_CAN_SKIP, "skips"),
          std::pair(RB_NATIVE_BATCH, "traces batches together"),
          std::pair(RB_DETERMINISTIC, "same tree at any thread count")}) {
      if ((s->capabilities & uint64_t(flag)) != 0) can += fmt::format("{}{}", can.empty() ? "" : ", ", text);
    }
    if (!can.empty()) fmt::print("      can: {}\n", can);
    PrintParameters({s->params, s->param_count}, s->config_size);
  }
  return 0;
}

/// `text` in lines of at most 100 columns, each behind `indent` blanks.
void PrintWrapped(size_t indent, std::string_view text) {
  constexpr size_t kColumns = 100;
  while (!text.empty()) {
    size_t end = text.size();
    if (indent + end > kColumns) {
      end = text.rfind(' ', kColumns - indent);
      if (end == text.npos || end == 0) end = std::min(text.find(' '), text.size());
    }
    fmt::print("{:{}}{}\n", "", indent, text.substr(0, end));
    text.remove_prefix(std::min(end + 1, text.size()));
  }
}

/// Each parameter, wrapped: name, range, default, meaning.
void PrintSceneParameters(std::span<const rb_param> params, size_t config_size) {
  const std::vector<std::byte> defaults = Configure("", params, config_size, {});
  for (const rb_param& p : params)
    PrintWrapped(6, fmt::format("{}: {}, default {}: {}", p.name, Range(p),
                                FormatParameter(p, defaults.data()), p.doc));
}

/// Everything that can be named as a scene, to stdout.
int ListScenes() {
  fmt::print("Generators, written NAME or NAME(key=value,...):\n\n");
  for (const Generator* g : Generators()) {
    const std::span<const rb_param> params(g->params, g->param_count);
    const std::vector<std::byte> defaults = Configure("", params, g->config_size, {});
    fmt::print("  {}  {} primitives by default\n", g->name, g->count(defaults.data()));
    PrintWrapped(4, g->doc);
    PrintWrapped(4, fmt::format("source: {}", g->source));
    PrintSceneParameters(params, g->config_size);
  }
  fmt::print("\nModifiers, written NAME(SCENE) or NAME(SCENE,key=value,...), around any scene:\n\n");
  for (const Modifier* m : Modifiers()) {
    fmt::print("  {}\n", m->name);
    PrintWrapped(4, m->doc);
    PrintWrapped(4, fmt::format("source: {}", m->source));
    PrintSceneParameters({m->params, m->param_count}, m->config_size);
  }
  fmt::print("\nModels that `raybench fetch` gets, into {}:\n\n", CacheDirectory().string());
  for (const std::string_view family : kModelFamilies) {
    fmt::print("  {}\n", family);
    for (const ManifestEntry& e : Manifest()) {
      if (e.family != family) continue;
      fmt::print("    {}  {} triangles, {}\n", e.name, e.triangles, IsFetched(e) ? "fetched" : "not fetched");
      PrintWrapped(6, e.doc);
      PrintWrapped(6, fmt::format("{} package {}, licence: {}", e.client, e.package, e.licence));
    }
  }
  fmt::print("\nOr the path of a file: {}\n", fmt::join(SceneFileEndings(), ", "));
  fmt::print("\n`raybench list scene NAME` has the details of one.\n");
  return 0;
}

struct ListOptions {};

}  // namespace

void AddListCommand(CLI::App& app, Invocation& invocation) {
  CLI::App& list = *app.add_subcommand("list", "What there is");
  list.require_subcommand(0, 1);
  list.fallthrough();
  list.callback([&list] {
    if (list.get_subcommands().empty())
      throw InputError("raybench list: say 'structures', 'scenes' or 'scene NAME'");
  });
  const auto no_options = [](CLI::App&, ListOptions&) {};
  AddCommand<ListOptions>(
      list, invocation, "structures", "Structures with their parameters", no_options,
      [](const ListOptions&, const Registry& registry) { return ListStructures(registry); });
  AddCommand<ListOptions>(list, invocation, "scenes", "Generators, modifiers, models and file formats",
                          no_options, [](const ListOptions&, const Registry&) { return ListScenes(); });
  AddListSceneCommand(list, invocation);
}

}  // namespace raybench
