#include "harness/fuzz/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "accel/base/files.h"
#include "harness/base/json.h"

namespace raybench::fuzz {
namespace fs = std::filesystem;
namespace {

std::string Plugins(const FuzzOptions& options) {
  std::string text;
  for (const std::string& plugin : options.plugins) text += " --plugin " + plugin;
  return text;
}

void MakeFolder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(fmt::format("{}: cannot be made: {}", folder.string(), error.message()));
}

}  // namespace

std::string SizeOf(const Case& c) {
  return fmt::format("{} primitive{}, {} ray{}", c.primitives(), c.primitives() == 1 ? "" : "s",
                     c.rays.size(), c.rays.size() == 1 ? "" : "s");
}

void FindingFiles::Write(FoundFault& fault) {
  MakeFolder(folder_);
  if (fault.file.empty())
    fault.file = (folder_ / (names_(FileStem(fault.structure + "-" + fault.check)) + ".case")).string();
  WriteFileAtomically(fault.file, Format(fault.smallest, fault.text));
}

void WriteFindings(const FuzzOptions& options, FindingFiles& files, FuzzResult& result) {
  MakeFolder(options.out);
  Json list = Json::array();
  for (FoundFault& fault : result.faults) {
    files.Write(fault);
    list.push_back({{"structure", fault.structure},
                    {"check", fault.check},
                    {"what", fault.text},
                    {"file", fs::path(fault.file).filename().string()},
                    {"case_index", fault.index},
                    {"found_after_s", fault.seconds},
                    {"found_after_cases", fault.cases},
                    {"repeats", fault.repeats},
                    {"primitives", fault.smallest.primitives()},
                    {"rays", fault.smallest.rays.size()},
                    {"primitives_before", fault.primitives_before},
                    {"rays_before", fault.rays_before},
                    {"shrinking_tries", fault.tries}});
  }
  Json structures = Json::array();
  for (const FuzzedStructure& s : result.structures)
    structures.push_back(
        {{"structure", s.name}, {"cases", s.cases}, {"left_out", s.left_out}, {"rays", s.rays}});
  WriteFileAtomically(fs::path(options.out) / "fuzz.json", Dump({{"seed", options.seed},
                                                                 {"mode", options.mode},
                                                                 {"seconds", result.seconds},
                                                                 {"structures", structures},
                                                                 {"findings", list}}));
}

int RunFuzz(const Registry& registry, FuzzOptions options) {
  const bool asked = !options.out.empty();  // then there is a report of a clean campaign too
  if (!asked) options.out = "fuzz_findings";
  FindingFiles files(options.out);
  options.on_found = [&](FoundFault& fault) { files.Write(fault); };
  FuzzResult result = Fuzz(registry, options);
  if (asked || !result.faults.empty()) WriteFindings(options, files, result);
  uint64_t cases = 0, rays = 0, left_out = 0;
  fmt::print("{:<24} {:>9} {:>11} {:>9} {:>9}\n", "structure", "cases", "rays", "left out", "broken");
  for (const FuzzedStructure& s : result.structures) {
    const auto broken = std::count_if(result.faults.begin(), result.faults.end(),
                                      [&](const FoundFault& f) { return f.structure == s.name; });
    fmt::print("{:<24} {:>9} {:>11} {:>9} {:>9}\n", s.name, s.cases, s.rays, s.left_out, broken);
    cases += s.cases, rays += s.rays, left_out += s.left_out;
  }
  fmt::print("seed {}: {} cases, {} rays in {:.1f} s: {:.0f} cases a second; {} left out\n", options.seed,
             cases, rays, result.seconds, double(cases) / std::max(result.seconds, 1e-9), left_out);
  for (const FoundFault& fault : result.faults) {
    fmt::print("\nFOUND {}: {}: {}\n", fault.structure, fault.check, fault.text);
    for (const CheckInfo& info : Checks())
      if (fault.check == info.name) fmt::print("  promised: {}\n", info.doc);
    fmt::print("  after {:.1f} s and {} cases, in case {}{}\n", fault.seconds, fault.cases, fault.index,
               fault.repeats ? "" : "; not seen again, or not tried");
    fmt::print("  {} ({}; at first {} primitives, {} rays)\n", fault.file, SizeOf(fault.smallest),
               fault.primitives_before, fault.rays_before);
    fmt::print("  raybench replay {}{}\n", fault.file, Plugins(options));
  }
  if (!result.faults.empty()) return 1;
  return result.interrupted ? 130 : 0;
}

}  // namespace raybench::fuzz
