#include "harness/results/python.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <optional>

#include "accel/base/error.h"
#include "harness/measure/build_info.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// Runs a program and waits; its exit code, 128 + signal, or nothing if it cannot be started.
std::optional<int> RunProgram(std::vector<std::string> words,
                              const std::vector<std::string>& more_environment, bool quiet) {
  std::vector<char*> argv, envp;
  for (std::string& word : words) argv.push_back(word.data());
  argv.push_back(nullptr);
  std::vector<std::string> environment = more_environment;
  for (char** e = environ; *e != nullptr; ++e) {
    const std::string_view entry = *e;
    const bool replaced =
        std::any_of(more_environment.begin(), more_environment.end(), [&](const std::string& own) {
          return entry.substr(0, entry.find('=') + 1) == std::string_view(own).substr(0, own.find('=') + 1);
        });
    if (!replaced) environment.emplace_back(entry);
  }
  for (std::string& e : environment) envp.push_back(e.data());
  envp.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  if (quiet) {
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  }
  pid_t pid = 0;
  const int error = posix_spawnp(&pid, argv[0], &actions, nullptr, argv.data(), envp.data());
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return std::nullopt;
  int status = 0;
  while (waitpid(pid, &status, 0) < 0) {
    if (errno != EINTR) return std::nullopt;
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status);
}

/// The folder that holds the Python package: the source tree's, else the installed one beside the program.
fs::path ReportsFolder() {
  std::error_code error;
  const fs::path source = fs::path(kSourceDirectory) / "reports";
  if (fs::exists(source / "raybench_report", error)) return source;
  const fs::path program = ThisProgram();
  const fs::path installed = program.parent_path().parent_path() / "share" / "raybench" / "reports";
  if (fs::exists(installed / "raybench_report", error)) return installed;
  return {};
}

std::string PythonProgram() {
  if (const char* named = std::getenv("RAYBENCH_PYTHON"); named != nullptr && *named != '\0') return named;
  const fs::path own = fs::path(kSourceDirectory) / "build" / "venv" / "bin" / "python";
  std::error_code error;
  return fs::exists(own, error) ? own.string() : "python3";
}

std::vector<std::string> PythonPath(const fs::path& reports) {
  const char* before = std::getenv("PYTHONPATH");
  return {fmt::format("PYTHONPATH={}{}{}", reports.string(), before != nullptr ? ":" : "",
                      before != nullptr ? before : "")};
}

std::string MissingPython(const std::string& python) {
  return fmt::format(
      "'{}' lacks the modules of reports/requirements.txt; name a Python that has them in RAYBENCH_PYTHON",
      python);
}

bool PythonWorks(const std::string& python, const fs::path& reports) {
  return RunProgram({python, "-c",
                     "import raybench_report, sys; from importlib.util import find_spec\n"
                     "sys.exit(not all(map(find_spec, ['PIL', 'jinja2', 'pandas', 'ruptures', 'scipy', "
                     "'vl_convert'])))"},
                    PythonPath(reports), true) == 0;
}

}  // namespace

Reports::Reports() : folder_(ReportsFolder().string()), python_(PythonProgram()) {
  if (folder_.empty())
    throw InputError("the Python part raybench_report is not installed beside this program");
  if (!PythonWorks(python_, folder_)) throw InputError(MissingPython(python_));
}

int Reports::Run(const std::vector<std::string>& arguments) const {
  std::vector<std::string> words = {python_, "-m", "raybench_report"};
  words.insert(words.end(), arguments.begin(), arguments.end());
  std::fflush(stdout);
  return RunProgram(std::move(words), PythonPath(folder_), false).value_or(2);
}

std::string ThisProgram() {
  std::error_code error;
  return fs::read_symlink("/proc/self/exe", error).string();
}

void RequireFolder(const std::string& folder) {
  std::error_code error;
  if (!fs::is_directory(folder, error)) throw InputError(folder + ": no such directory");
}

void DrawReportIfPossible(const std::string& folder) {
  try {
    if (Reports().Run({folder}) != 0)
      fmt::print("report  not made; again with: raybench report {}\n", folder);
  } catch (const InputError& error) {
    fmt::print("report  not made: {}; then: raybench report {}\n", error.what(), folder);
  }
}

}  // namespace raybench
