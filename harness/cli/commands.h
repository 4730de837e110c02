// The commands of raybench: one file each, cli/NAME.cpp, with the options it takes, their help and what
// it does.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "accel/host/registry.h"
#include "harness/cli/all_commands.h"

namespace raybench {

/// What was typed, and what came of reading it.
struct Invocation {
  std::vector<std::string> arguments;        ///< the whole command line, for run.json
  std::vector<std::string> benchmark_flags;  ///< "--benchmark_...": set aside; only `run` takes them
  std::vector<std::string> plugins;          ///< --plugin; loaded before `action` runs
  /// Set by the command that was named, while the command line is read; returns the exit code.
  std::function<int(const Registry&)> action;
};

/// Each is a `const Command kNAME` in its file, and found by that name.
struct Command {
  int place;  ///< in help: smaller ones first
  /// Adds the command. Options live as long as the program's `app`; `invocation` must outlive it.
  void (*add)(CLI::App& app, Invocation& invocation);
};

void AddListSceneCommand(CLI::App& list, Invocation& invocation);  ///< below `list`

/// What may stand behind a whole number: nothing, or K, M, G, T, P, E (powers of 1024, perhaps with B or iB).
enum class Units { kNone, kSizes };

/// `text` as a whole number: decimal digits and perhaps a unit, nothing else. None if it is no such number or
/// larger than 2^64 - 1.
std::optional<uint64_t> ParseWholeNumber(std::string_view text, Units units);

/// For options: takes what ParseWholeNumber() reads within [lo, hi] and refuses all else, saying what is
/// allowed. CLI11 alone takes -1 for 2^64 - 1.
CLI::Validator WholeNumber(uint64_t lo = 0, uint64_t hi = UINT64_MAX, Units units = Units::kNone);
/// The same for a decimal number within [lo, hi]; NaN is none.
CLI::Validator RealNumber(double lo, double hi);

/// The user's goals with the commands for each: in raybench --help, raybench run --help and README.
extern const char* const kGoals;

/// What the words of --rays say.
struct RayWords {
  uint64_t number = 0;             ///< rays of a set; 0: not given
  std::vector<std::string> files;  ///< .rays files or folders of them
};

/// Each word is a number of rays ("64K", 64 to 2^28) or an existing file or folder. A word that reads as a
/// number is one; a file called "64" must be given as ./64. Throws InputError.
RayWords ReadRayWords(const std::vector<std::string>& words);

/// A command whose options are a T, made here and kept by `act`: calls add(command, options) once, and
/// act(options, registry) when the command was typed.
template <class T, class Act>
CLI::App& AddCommand(CLI::App& parent, Invocation& invocation, const char* name, const char* doc,
                     void (*add)(CLI::App&, T&), const Act& act) {
  auto options = std::make_shared<T>();
  CLI::App& command = *parent.add_subcommand(name, doc);
  command.fallthrough();
  add(command, *options);
  command.callback([&invocation, options, act] {
    invocation.action = [options, act](const Registry& registry) { return act(*options, registry); };
  });
  return command;
}

}  // namespace raybench
