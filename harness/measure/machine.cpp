#include "harness/measure/machine.h"

#include <OpenImageIO/oiioversion.h>
#include <OpenMesh/Core/System/config.h>
#include <elf.h>
#include <fmt/format.h>
#include <sched.h>
#include <sys/resource.h>
#include <sys/utsname.h>
#include <tbb/version.h>
#include <unistd.h>

#include <CLI/Version.hpp>
#include <algorithm>
#include <cstring>
#include <ctime>
#include <fstream>
#include <set>
#include <string>

#include "accel/base/hash.h"
#include "harness/measure/build_info.h"
#include "harness/measure/commit.h"
#ifdef RAYBENCH_EMBREE_MAJOR
#include "accel/structures/library/embree.h"
#endif

namespace raybench {
namespace {

/// The value behind "KEY<separator>" at the start of a line; empty if there is none.
std::string ReadEntry(const char* file, const std::string& key, char separator) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    const size_t at = line.find(separator);
    if (at == std::string::npos || line.compare(0, key.size(), key) != 0) continue;
    if (line.find_first_not_of(" \t", key.size()) != at) continue;
    const size_t begin = line.find_first_not_of(" \t\"", at + 1);
    const size_t end = line.find_last_not_of(" \t\"\r");
    return begin == std::string::npos ? std::string() : line.substr(begin, end - begin + 1);
  }
  return {};
}

Json OrNull(const std::string& text) { return text.empty() ? Json() : Json(text); }

uint64_t StatusBytes(const char* key) {
  const std::string text = ReadEntry("/proc/self/status", key, ':');
  return text.empty() ? 0 : std::stoull(text) * 1024;
}

/// The bytes by which the linker names what it made, by default a digest of all of it; empty if it did not.
std::string BuildId(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  const auto read = [&](uint64_t at, auto* to, size_t bytes) {
    return bool(in.seekg(std::streamoff(at)).read(reinterpret_cast<char*>(to), std::streamsize(bytes)));
  };
  Elf64_Ehdr file;
  if (!read(0, &file, sizeof file) || std::memcmp(file.e_ident, ELFMAG, SELFMAG) != 0 ||
      file.e_ident[EI_CLASS] != ELFCLASS64)
    return {};
  for (uint16_t i = 0; i < file.e_phnum; ++i) {
    Elf64_Phdr part;
    if (!read(file.e_phoff + uint64_t{i} * file.e_phentsize, &part, sizeof part)) return {};
    if (part.p_type != PT_NOTE || part.p_filesz > 4096) continue;
    std::string bytes(part.p_filesz, 0);
    if (!read(part.p_offset, bytes.data(), bytes.size())) return {};
    Elf64_Nhdr note;
    for (size_t at = 0; at + sizeof note <= bytes.size();) {
      std::memcpy(&note, &bytes[at], sizeof note);
      const size_t name = at + sizeof note, value = name + (note.n_namesz + size_t{3}) / 4 * 4;
      if (value + note.n_descsz > bytes.size()) break;
      if (note.n_type == NT_GNU_BUILD_ID && bytes.substr(name, note.n_namesz) == std::string("GNU\0", 4))
        return bytes.substr(value, note.n_descsz);
      at = value + (note.n_descsz + size_t{3}) / 4 * 4;
    }
  }
  return {};
}

/// Distinct (socket, core) pairs; 0 if /proc/cpuinfo does not tell.
size_t PhysicalCores() {
  std::ifstream in("/proc/cpuinfo");
  std::set<std::pair<std::string, std::string>> cores;
  std::string socket;
  for (std::string line; std::getline(in, line);) {
    if (line.starts_with("physical id")) socket = line.substr(line.find(':') + 1);
    if (line.starts_with("core id")) cores.emplace(socket, line.substr(line.find(':') + 1));
  }
  return cores.size();
}

#ifdef RAYBENCH_EMBREE_MAJOR
Json EmbreeFacts() {
  const std::unique_ptr<RTCDeviceTy, void (*)(RTCDevice)> device(rtcNewDevice(nullptr), &rtcReleaseDevice);
  if (!device) return nullptr;
  const auto get = [&](RTCDeviceProperty p) { return rtcGetDeviceProperty(device.get(), p); };
  Json facts;
  facts["version"] =
      fmt::format("{}.{}.{}", get(RTC_DEVICE_PROPERTY_VERSION_MAJOR), get(RTC_DEVICE_PROPERTY_VERSION_MINOR),
                  get(RTC_DEVICE_PROPERTY_VERSION_PATCH));
  // The widest packet it says it traces natively names the instruction set it chose at run time.
  facts["instruction_set"] = get(RTC_DEVICE_PROPERTY_NATIVE_RAY16_SUPPORTED)  ? "AVX-512"
                             : get(RTC_DEVICE_PROPERTY_NATIVE_RAY8_SUPPORTED) ? "AVX or AVX2"
                                                                              : "SSE";
  facts["tasking"] = get(RTC_DEVICE_PROPERTY_TASKING_SYSTEM) == 1 ? "TBB" : "other";
  facts["ray_mask"] = get(RTC_DEVICE_PROPERTY_RAY_MASK_SUPPORTED) != 0;
  facts["backface_culling"] = get(RTC_DEVICE_PROPERTY_BACKFACE_CULLING_ENABLED) != 0;
  facts["filter_functions"] = get(RTC_DEVICE_PROPERTY_FILTER_FUNCTION_SUPPORTED) != 0;
  facts["ignore_invalid_rays"] = get(RTC_DEVICE_PROPERTY_IGNORE_INVALID_RAYS_ENABLED) != 0;
  return facts;
}
#endif

}  // namespace

uint64_t UsableMemory() {
  uint64_t bytes = uint64_t(sysconf(_SC_PHYS_PAGES)) * uint64_t(sysconf(_SC_PAGE_SIZE));
  rlimit limit;
  if (getrlimit(RLIMIT_AS, &limit) == 0) bytes = std::min<uint64_t>(bytes, limit.rlim_cur);
  // Each line: number, controllers (none: version 2), group. A limit of any group above holds too.
  std::ifstream groups("/proc/self/cgroup");
  for (std::string line; std::getline(groups, line);) {
    const size_t first = line.find(':'), second = line.find(':', first + 1);
    if (second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    if (!controllers.empty() && controllers != "memory") continue;
    const std::string root = controllers.empty() ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    const char* file = controllers.empty() ? "/memory.max" : "/memory.limit_in_bytes";
    for (std::string group = line.substr(second + 1);;
         group.erase(std::min(group.rfind('/'), group.size()))) {
      if (group == "/") group.clear();
      std::ifstream in(root + group + file);
      if (uint64_t value; in >> value) bytes = std::min(bytes, value);  // or the word "max"
      if (group.empty()) break;
    }
  }
  return bytes;
}

uint64_t ResidentMemory() { return StatusBytes("VmRSS"); }
uint64_t PeakMemory() { return StatusBytes("VmHWM"); }

bool ResetPeakMemory() {
  std::ofstream out("/proc/self/clear_refs");
  out << "5";
  out.close();
  return bool(out) && ResidentMemory() > 0;
}

Json MachineFacts() {
  Json facts;
  facts["cpu"] = OrNull(ReadEntry("/proc/cpuinfo", "model name", ':'));
  facts["cpu_flags"] = OrNull(ReadEntry("/proc/cpuinfo", "flags", ':'));
  facts["logical_cpus"] = sysconf(_SC_NPROCESSORS_ONLN);
  if (const size_t cores = PhysicalCores(); cores > 0) {
    facts["physical_cores"] = cores;
  } else {
    facts["physical_cores"] = nullptr;
  }
  cpu_set_t allowed;
  facts["allowed_cpus"] =
      sched_getaffinity(0, sizeof allowed, &allowed) == 0 ? Json(CPU_COUNT(&allowed)) : Json();
  facts["governor"] = nullptr;
  if (std::ifstream in("/sys/devices/system/cpu/cpu0/cpufreq/scaling_governor"); in) {
    std::string governor;
    in >> governor;
    facts["governor"] = governor;
  }
  facts["memory_bytes"] = uint64_t(sysconf(_SC_PHYS_PAGES)) * uint64_t(sysconf(_SC_PAGE_SIZE));
  facts["transparent_huge_pages"] = nullptr;
  if (std::ifstream in("/sys/kernel/mm/transparent_hugepage/enabled"); in) {
    std::string line;
    std::getline(in, line);
    facts["transparent_huge_pages"] = line;
  }
  facts["os"] = OrNull(ReadEntry("/etc/os-release", "PRETTY_NAME", '='));
  utsname name;
  facts["kernel"] =
      uname(&name) == 0 ? Json(fmt::format("{} {} {}", name.sysname, name.release, name.machine)) : Json();
  return facts;
}

std::string MachineFingerprint() {
  static const std::string fingerprint = [] {
    const Json facts = MachineFacts();
    Hash64 hash;
    for (const char* key : {"cpu", "cpu_flags", "logical_cpus", "physical_cores", "allowed_cpus", "os"})
      hash.Add(std::string_view(facts.at(key).dump()));
    // What the kernel keeps for itself differs from boot to boot.
    hash.AddValue((facts.at("memory_bytes").get<uint64_t>() + (uint64_t{1} << 29)) >> 30);
    return hash.Hex().substr(0, 8);
  }();
  return fingerprint;
}

Json BuildFacts() {
  return {{"version", kVersion},      {"commit", OrNull(kCommit)}, {"compiler", kCompiler},
          {"build_type", kBuildType}, {"flags", kFlags},           {"fp_contract", "off"}};
}

Json LibraryFacts() {
  Json facts;
#ifdef RAYBENCH_EMBREE_MAJOR
  facts["embree"] = EmbreeFacts();
#else
  facts["embree"] = nullptr;
#endif
  facts["cgal"] = HasCgalOracle() ? OrNull(kCgalVersion) : Json();
  facts["benchmark"] = OrNull(kBenchmarkVersion);
  facts["openmesh"] = fmt::format("{}.{}", (OM_VERSION >> 16) & 0xF, (OM_VERSION >> 8) & 0xFF);
  facts["tinygltf"] = OrNull(kTinygltfVersion);
  facts["openimageio"] = OIIO_VERSION_STRING;
  facts["onetbb"] = TBB_runtime_version();
  facts["fmt"] = fmt::format("{}.{}.{}", FMT_VERSION / 10000, FMT_VERSION / 100 % 100, FMT_VERSION % 100);
  facts["nlohmann_json"] = fmt::format("{}.{}.{}", NLOHMANN_JSON_VERSION_MAJOR, NLOHMANN_JSON_VERSION_MINOR,
                                       NLOHMANN_JSON_VERSION_PATCH);
  facts["cli11"] = CLI11_VERSION;
  return facts;
}

std::string ProgramDigest(const std::vector<std::string>& plugins) {
  Hash64 digest;
  const auto add = [&](const std::string& path) {
    // To read all of a program takes a fifth of a process of `raybench check`.
    if (const std::string id = BuildId(path); !id.empty()) return digest.Add(id);
    std::ifstream in(path, std::ios::binary);
    std::vector<char> block(1 << 20);
    while (in.read(block.data(), std::streamsize(block.size())), in.gcount() > 0)
      digest.Add(block.data(), size_t(in.gcount()));
  };
  add("/proc/self/exe");
  for (const std::string& plugin : plugins) add(plugin);
  return digest.Hex();
}

bool HasCgalOracle() { return RAYBENCH_HAS_CGAL != 0; }

std::string SoftwareName() { return fmt::format("raybench {}", kVersion); }

std::string VersionText() {
  std::string text = fmt::format("raybench {} ({})\n{}, {}, {}\n", kVersion,
                                 *kCommit ? kCommit : "commit unknown", kCompiler, kBuildType, kFlags);
  const Json libraries = LibraryFacts();
  for (const auto& [name, value] : libraries.items()) {
    if (value.is_null()) {
      text += fmt::format("  {:<14} not in this build, or its version is unknown\n", name);
    } else if (value.is_string()) {
      text += fmt::format("  {:<14} {}\n", name, value.get<std::string>());
    } else {
      text += fmt::format("  {:<14} {} ({})\n", name, value.at("version").get<std::string>(),
                          value.at("instruction_set").get<std::string>());
    }
  }
  text += HasCgalOracle() ? "The exact oracle over CGAL is built in. Its AABB tree is GPL-3.0-or-later, so "
                            "this binary may be passed on under those terms only."
                          : "Without CGAL: candidates for truth come from a tree of boxes.";
  return text;
}

std::string UtcTime(const char* format) {
  const std::time_t now = std::time(nullptr);
  std::tm utc;
  gmtime_r(&now, &utc);
  char text[32];
  std::strftime(text, sizeof text, format, &utc);
  return text;
}

}  // namespace raybench
