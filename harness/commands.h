// The commands of raybench: one file each, command_NAME.cpp, with the options it takes, their help and what
// it does.
#pragma once

#include <CLI/CLI.hpp>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "accel/registry.h"

namespace raybench {

/// What was typed, and what came of reading it.
struct Invocation {
  std::vector<std::string> arguments;        ///< the whole command line, for run.json
  std::vector<std::string> benchmark_flags;  ///< "--benchmark_...": set aside, `run` alone takes them
  std::vector<std::string> plugins;          ///< --plugin; loaded before `action` runs
  /// Set by the command that was named, while the command line is read; returns the exit code.
  std::function<int(const Registry&)> action;
};

// Each adds its command to the program. Options live as long as the program's `app`; `invocation` must
// outlive it.
void AddRunCommand(CLI::App& app, Invocation& invocation);
void AddRenderCommand(CLI::App& app, Invocation& invocation);
void AddRaysCommand(CLI::App& app, Invocation& invocation);
void AddListCommand(CLI::App& app, Invocation& invocation);
void AddListSceneCommand(CLI::App& list, Invocation& invocation);  ///< below `list`
void AddFetchCommand(CLI::App& app, Invocation& invocation);
void AddExtremesCommand(CLI::App& app, Invocation& invocation);
void AddSpdCommand(CLI::App& app, Invocation& invocation);
void AddReportCommand(CLI::App& app, Invocation& invocation);
void AddVerifyCommand(CLI::App& app, Invocation& invocation);

/// What the words of --rays say.
struct RayWords {
  uint64_t number = 0;             ///< rays of a set; 0: not given
  std::vector<std::string> files;  ///< .rays files or folders of them
};

/// Each word is a number of rays ("64K", 64 to 2^28) or a file or folder that is there; what reads as a
/// number names no file, and the file "64" is reached as ./64. Throws InputError.
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
