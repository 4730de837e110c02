#include "harness/fuzz/check_plugin.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "accel/base/files.h"
#include "accel/host/parameters.h"
#include "accel/host/registry.h"
#include "datasets/scene/text.h"
#include "harness/fuzz/fuzz.h"
#include "harness/fuzz/report.h"

namespace raybench::fuzz {
namespace fs = std::filesystem;
namespace {

/// How a promise fared with one structure.
struct Promise {
  const CheckInfo* info;
  uint64_t cases = 0;
  const FoundFault* fault = nullptr;

  const char* Word() const { return fault != nullptr ? "BROKEN" : cases > 0 ? "held" : "not asked"; }
};

std::vector<Promise> PromisesOf(const FuzzResult& result, const FuzzedStructure& structure) {
  std::vector<Promise> promises;
  for (size_t i = 0; i < Checks().size(); ++i) {
    Promise& p = promises.emplace_back(Promise{&Checks()[i], structure.looked_at[i]});
    for (const FoundFault& fault : result.faults)
      if (fault.structure == structure.name && fault.check == p.info->name) p.fault = &fault;
    // raybench's own numerics are nobody else's promise.
    if (p.info->demand == Demand::kOwn && p.fault == nullptr) promises.pop_back();
  }
  return promises;
}

std::string Capabilities(const rb_structure& s) {
  std::string text;
  const auto add = [&](uint64_t flag, const char* word) {
    if ((s.capabilities & flag) != 0) text += (text.empty() ? "" : ", ") + std::string(word);
  };
  add(RB_CAN_COUNT, "counts"), add(RB_CAN_PROCEDURAL, "procedural primitives"), add(RB_CAN_AFTER, "after");
  add(RB_CAN_SKIP, "skip"), add(RB_NATIVE_BATCH, "native batches"), add(RB_DETERMINISTIC, "deterministic");
  add(RB_LINEAR, "linear");
  return text.empty() ? "none" : text;
}

void PrintPage(const rb_structure& s, const FuzzedStructure& structure, const std::vector<Promise>& promises,
               const CheckPluginOptions& options) {
  const auto broken =
      std::count_if(promises.begin(), promises.end(), [](const Promise& p) { return p.fault != nullptr; });
  fmt::print("\n{}: {}\n  {}\n  capabilities: {}\n", s.name,
             broken == 0 ? "every promise held" : fmt::format("{} BROKEN", broken), s.doc, Capabilities(s));
  std::string parameters;
  for (uint32_t i = 0; i < s.param_count; ++i) parameters += fmt::format(" {}", s.params[i].name);
  fmt::print("  parameters:{}; {} cases, {} rays, {} left out\n", parameters.empty() ? " none" : parameters,
             structure.cases, structure.rays, structure.left_out);
  for (const Promise& p : promises)
    fmt::print("  {:<9} {:>7}  {:<14} {}\n", p.Word(), p.cases, p.info->name, p.info->doc);
  for (const Promise& p : promises) {
    if (p.fault == nullptr) continue;
    fmt::print("\n  BROKEN {}: {}\n    found after {:.1f} s\n", p.info->name, p.fault->text,
               p.fault->seconds);
    if (p.fault->file.empty()) {
      const std::string file = Format(p.fault->smallest);
      Lines lines(file);
      for (std::string_view line; lines.Next(line);) fmt::print("      {}\n", line);
    } else {
      fmt::print("    {}: {}; raybench replay {} --plugin {}\n", p.fault->file, SizeOf(p.fault->smallest),
                 p.fault->file, options.plugin);
    }
  }
}

std::string Escaped(std::string_view text) {
  std::string out;
  for (char c : text) {
    switch (c) {
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '&':
        out += "&amp;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        out += static_cast<unsigned char>(c) < 0x20 ? ' ' : c;
    }
  }
  return out;
}

/// JUnit's format as CI services read it: a suite a structure, a case a promise.
std::string JUnit(const FuzzResult& result) {
  std::string text = "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n";
  for (const FuzzedStructure& s : result.structures) {
    const std::vector<Promise> promises = PromisesOf(result, s);
    const auto failures =
        std::count_if(promises.begin(), promises.end(), [](const Promise& p) { return p.fault != nullptr; });
    text += fmt::format("  <testsuite name=\"{}\" tests=\"{}\" failures=\"{}\" time=\"{:.3f}\">\n",
                        Escaped(s.name), promises.size(), failures, result.seconds);
    for (const Promise& p : promises) {
      text += fmt::format("    <testcase classname=\"{}\" name=\"{}\"", Escaped(s.name), p.info->name);
      if (p.fault != nullptr) {
        text += fmt::format(">\n      <failure message=\"{}\">{}</failure>\n    </testcase>\n",
                            Escaped(p.fault->text), Escaped(Format(p.fault->smallest)));
      } else {
        text += p.cases > 0 ? "/>\n" : ">\n      <skipped/>\n    </testcase>\n";
      }
    }
    text += "  </testsuite>\n";
  }
  return text + "</testsuites>\n";
}

}  // namespace

int RunCheckPlugin(const CheckPluginOptions& options) {
  std::error_code error;
  if (!fs::exists(options.plugin, error)) throw InputError(fmt::format("{}: no such file", options.plugin));
  Registry registry;
  const size_t known = registry.structures().size();
  try {
    registry.LoadPlugin(options.plugin);
  } catch (const InputError& refusal) {
    fmt::print("BROKEN: it cannot be loaded: {}\n", refusal.what());
    return 1;
  }
  FuzzOptions fuzz;
  for (const rb_structure* s : registry.structures())
    if (!registry.OriginOf(*s).empty()) fuzz.structures.push_back(s->name);
  fmt::print("{}: {} structure{} beside the {} built in\n", options.plugin, fuzz.structures.size(),
             fuzz.structures.size() == 1 ? "" : "s", known);
  fuzz.plugins = {options.plugin};
  fuzz.seconds = options.seconds * double(fuzz.structures.size());
  fuzz.seed = options.seed, fuzz.jobs = options.jobs, fuzz.out = options.out, fuzz.scenes = true;
  FindingFiles files(options.out);
  if (!options.out.empty()) fuzz.on_found = [&](FoundFault& fault) { files.Write(fault); };
  FuzzResult result = Fuzz(registry, fuzz);
  if (!options.out.empty()) {
    WriteFindings(fuzz, files, result);
    WriteFileAtomically(fs::path(options.out) / "junit.xml", JUnit(result));
  }
  for (const FuzzedStructure& s : result.structures)
    PrintPage(registry.Find(s.name), s, PromisesOf(result, s), options);
  if (!result.faults.empty()) return 1;
  return result.interrupted ? 130 : 0;
}

}  // namespace raybench::fuzz
