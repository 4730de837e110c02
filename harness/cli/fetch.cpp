// raybench fetch: gets real models.
#include "datasets/models/fetch.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "harness/cli/commands.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/progress.h"

namespace raybench {
namespace {

struct FetchOptions {
  std::vector<std::string> names;
  bool all = false;
};

std::vector<const ManifestEntry*> Wanted(const FetchOptions& options) {
  std::vector<const ManifestEntry*> wanted;
  const auto add = [&](const ManifestEntry* entry) {
    if (std::find(wanted.begin(), wanted.end(), entry) == wanted.end()) wanted.push_back(entry);
  };
  for (const std::string& name : options.names)
    for (const ManifestEntry* entry : FindModels(name)) add(entry);
  if (options.all)
    for (const ManifestEntry& entry : Manifest()) add(&entry);
  if (wanted.empty()) {
    throw InputError(fmt::format("name a model (see: raybench list models), a family ({}), or --all",
                                 fmt::join(kModelFamilies, ", ")));
  }
  return wanted;
}

std::string Joined(const std::vector<std::string>& names) {
  return fmt::format("{}", fmt::join(names, ", "));
}

/// Each reason once, on stderr, with the models that it keeps away; the rest to stdout. 2 if any failed.
int Summarise(const std::vector<FetchResult>& results) {
  std::vector<std::string> fetched, there, failed, reasons;
  std::map<std::string, std::vector<std::string>> models_of;
  for (const FetchResult& result : results) {
    const std::string& name = result.entry->name;
    if (result.state == FetchResult::State::kFetched) fetched.push_back(name);
    if (result.state == FetchResult::State::kAlreadyThere) there.push_back(name);
    if (result.state != FetchResult::State::kFailed) continue;
    failed.push_back(name);
    if (models_of[result.reason].empty()) reasons.push_back(result.reason);
    models_of[result.reason].push_back(name);
  }
  if (!fetched.empty()) fmt::print("fetched: {}\n", Joined(fetched));
  if (!there.empty()) fmt::print("already there: {}\n", Joined(there));
  std::fflush(stdout);
  for (const std::string& reason : reasons)
    fmt::print(stderr, "raybench: not fetched: {}: {}\n", Joined(models_of[reason]), reason);
  if (failed.empty()) {
    fmt::print("The models are in {}\n", (CacheDirectory() / "models").string());
    return 0;
  }
  fmt::print(stderr,
             "Fetched models work without a network. They are in {}; set RAYBENCH_CACHE to use another "
             "folder, such as one copied from a machine that is online.\n",
             CacheDirectory().string());
  return 2;
}

int FetchCommand(const FetchOptions& options) {
  const std::vector<const ManifestEntry*> wanted = Wanted(options);
  Progress progress;
  FetchListener listener;
  listener.say = [&](const std::string& line) { progress.Say(line); };
  listener.progress = [&](double fraction, const std::string& what) { progress.Update(fraction, what); };
  std::vector<FetchResult> results;
  try {
    results = FetchModels(wanted, listener);
  } catch (const InputError& error) {
    progress.Clear();
    if (Interrupted()) fmt::print(stderr, "raybench: {}\n", error.what());
    ThrowIfInterrupted();
    throw;
  }
  progress.Clear();
  return Summarise(results);
}

void AddFetchCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<FetchOptions>(
      app, invocation, "fetch", "Fetch real models as packages",
      [](CLI::App& command, FetchOptions& options) {
        command
            .add_option("models", options.names,
                        fmt::format("Models (see: raybench list models) or families: {}",
                                    fmt::join(kModelFamilies, ", ")))
            ->type_name("NAME");
        command.add_flag("--all", options.all, "All models");
        command.footer(
            "Models come as packages, through apt, pip, npm and cargo as configured on this machine.\n"
            "Each is checked against its SHA-256 and kept in RAYBENCH_CACHE, or else ~/.cache/raybench.\n"
            "After an interruption the same command continues. Fetched models work without a network.");
      },
      [](const FetchOptions& options, const Registry&) { return FetchCommand(options); });
}

}  // namespace

const Command kFetch = {70, AddFetchCommand};

}  // namespace raybench
