// The raybench command as a process, for tests: started, interrupted, its output and exit code.
#pragma once

#include <fcntl.h>
#include <fmt/format.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

#include "harness/base/columns.h"
#include "harness/measure/build_info.h"
#include "tests/support/files.h"

namespace raybench {

namespace fs = std::filesystem;

struct Outcome {
  int exit_code = -1;
  std::string out, err;
};

/// Takes out of a row of cases.csv what is not the same from run to run.
inline void EraseVarying(std::map<std::string, std::string>& row) {
  for (const Column& column : kCasesColumns)
    if (column.varies) row.erase(column.name);
}

/// Rows of a CSV file by column name; quoted fields as RFC 4180 says.
inline std::vector<std::map<std::string, std::string>> ReadCsv(const fs::path& path) {
  std::vector<std::vector<std::string>> lines(1, {""});
  bool quoted = false;
  for (const std::string text = Read(path); char c : text) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      lines.back().emplace_back();
    } else if (c == '\n' && !quoted) {
      lines.push_back({""});
    } else {
      lines.back().back() += c;
    }
  }
  lines.pop_back();
  std::vector<std::map<std::string, std::string>> rows;
  for (size_t r = 1; r < lines.size(); ++r) {
    EXPECT_EQ(lines[r].size(), lines[0].size());
    rows.emplace_back();
    for (size_t c = 0; c < lines[0].size(); ++c) rows.back()[lines[0][c]] = lines[r][c];
  }
  return rows;
}

class HarnessCommand : public ::testing::Test {
 protected:
  HarnessCommand()
      : folder_(fs::path(::testing::TempDir()) /
                fmt::format("raybench_{}_{}", ::testing::UnitTest::GetInstance()->current_test_info()->name(),
                            getpid())) {
    fs::create_directories(folder_);
    setenv("RAYBENCH_TRUTH_CACHE", "off", 1);  // the user's cache is none of a test's business
  }
  ~HarnessCommand() override { fs::remove_all(folder_); }

  pid_t Start(std::vector<std::string> arguments) {
    arguments.insert(arguments.begin(), (fs::path(kBinaryDirectory) / "raybench").string());
    std::vector<char*> argv;
    for (std::string& a : arguments) argv.push_back(a.data());
    argv.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    const int flags = O_WRONLY | O_CREAT | O_TRUNC;
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, (folder_ / "stdout").c_str(), flags, 0600);
    posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, (folder_ / "stderr").c_str(), flags, 0600);
    // Where the tests run in the background, SIGINT may be ignored; the command shall not inherit that.
    posix_spawnattr_t attributes;
    posix_spawnattr_init(&attributes);
    sigset_t signals;
    sigemptyset(&signals);
    sigaddset(&signals, SIGINT);
    posix_spawnattr_setsigdefault(&attributes, &signals);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGDEF);
    pid_t pid = 0;
    EXPECT_EQ(posix_spawn(&pid, argv[0], &actions, &attributes, argv.data(), environ), 0);
    posix_spawnattr_destroy(&attributes);
    posix_spawn_file_actions_destroy(&actions);
    return pid;
  }
  Outcome Finish(pid_t pid) {
    int status = 0;
    waitpid(pid, &status, 0);
    return {WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status), Read(folder_ / "stdout"),
            Read(folder_ / "stderr")};
  }
  Outcome Call(std::vector<std::string> arguments) { return Finish(Start(std::move(arguments))); }

  /// A run small enough for a test; `more` comes last.
  std::vector<std::string> TinyRun(const std::string& out, std::vector<std::string> more = {}) const {
    std::vector<std::string> words = {"run",       "icosphere(level=1)",
                                      "--quick",   "--rays",
                                      "256",       "--depth",
                                      "1",         "--seed",
                                      "3",         "--no-report",
                                      "--out",     (folder_ / out).string(),
                                      "--threads", "1"};
    words.insert(words.end(), more.begin(), more.end());
    return words;
  }

  /// tests/plugins as a project of its own that finds raybench by find_package; the folder with
  /// the libraries.
  fs::path BuildPlugins() {
    const fs::path build = fs::path(kBinaryDirectory) / "test_plugins";
    const std::string command = fmt::format(
        "flock '{0}.lock' sh -c \"'{1}' -S '{2}/tests/plugins' -B '{0}' '-Draybench_DIR={3}' "
        "'-DCMAKE_CXX_COMPILER={4}' && '{1}' --build '{0}'\" > '{5}' 2>&1",
        build.string(), kCmakeCommand, kSourceDirectory, kBinaryDirectory, kCompilerPath,
        (folder_ / "log").string());
    EXPECT_EQ(std::system(command.c_str()), 0) << Read(folder_ / "log");
    return build;
  }

  fs::path folder_;
};

}  // namespace raybench
