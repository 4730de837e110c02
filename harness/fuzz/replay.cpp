#include "harness/fuzz/replay.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "harness/fuzz/asking.h"
#include "harness/fuzz/fuzz.h"
#include "harness/fuzz/isolate.h"
#include "harness/fuzz/report.h"
#include "harness/judge/claim.h"
#include "harness/plan/build_options.h"
#include "harness/truth/oracle.h"
#include "harness/truth/uv.h"

namespace raybench::fuzz {
namespace fs = std::filesystem;
namespace {

constexpr size_t kShownRays = 8;

std::vector<std::string> CaseFiles(const std::vector<std::string>& names) {
  std::vector<std::string> files;
  for (const std::string& name : names) {
    std::error_code error;
    if (!fs::is_directory(name, error)) {
      files.push_back(name);
      continue;
    }
    const size_t before = files.size();
    for (const auto& entry : fs::directory_iterator(name))
      if (entry.path().extension() == ".case") files.push_back(entry.path().string());
    if (files.size() == before) throw InputError(fmt::format("{}: holds no .case files", name));
    std::sort(files.begin() + ptrdiff_t(before), files.end());
  }
  return files;
}

/// Answer, verdict and truth of each ray, with all digits.
std::string ShowRays(const Registry& registry, const Case& c) {
  const Scene scene = SceneOf(c);
  rb_build_options build = BuildOptions(1, c.seed);
  const Tree tree(ParseContestant(registry, c.structure), scene.Geometry(), build);
  const auto oracle = MakeBoxOracle(scene);
  Question question;
  question.rays = c.rays;
  const Answer closest = Ask(tree, question);
  question.kind = RB_ANY;
  const Answer any = Ask(tree, question);
  const std::vector<Truth> truth = oracle->Ask(c.rays, 1);
  std::string text = fmt::format("  claims {}\n", ClaimName(tree.Claims()));
  for (size_t i = 0; i < std::min(c.rays.size(), kShownRays); ++i) {
    const rb_hit& hit = closest.hits[i];
    const Truth& t = truth[i];
    text += fmt::format("  ray {}: {}\n", i, Describe(c.rays[i]));
    text += fmt::format("    closest: {} [t {:a}]: {}; any-hit: {}\n", Describe(hit), hit.t,
                        VerdictName(oracle->Judge(c.rays[i], t, hit)), any.occluded[i]);
    if (const UvTruth uv = TrueUv(scene, c.rays[i], hit); uv.known)
      text += fmt::format("    u, v of that point: {} and {}, within {:.2g} and {:.2g}\n", uv.u, uv.v,
                          uv.u_bound, uv.v_bound);
    if (t.hit) {
      text += fmt::format("    true: primitive {} at t {} [{:a}], as a float {} [{:a}]{}\n",
                          fmt::join(t.tied, ", "), t.t, t.t, t.t_rounded, t.t_rounded,
                          t.feature == Feature::kEdge     ? ", on an edge"
                          : t.feature == Feature::kVertex ? ", at a vertex"
                                                          : "");
    } else {
      text += fmt::format("    true: no hit{}\n",
                          t.coplanar ? ", or a triangle in whose plane the ray lies" : "");
    }
  }
  if (c.rays.size() > kShownRays) text += fmt::format("  and {} rays more\n", c.rays.size() - kShownRays);
  return text;
}

void ShowShrunk(const Registry& registry, const Case& c, const Finding& finding, FindingFiles& files) {
  FoundFault fault;
  fault.structure = c.structure.substr(0, c.structure.find('('));
  fault.check = finding.check, fault.text = finding.text, fault.smallest = c;
  fault.smallest.check = finding.check;
  ShrinkFault(registry, fault, true);
  if (!fault.repeats) return fmt::print("  {}: not seen again\n", finding.check);
  files.Write(fault);
  fmt::print("  {}: {}: {}\n", fault.file, SizeOf(fault.smallest), fault.text);
}

}  // namespace

int RunReplay(const Registry& registry, const ReplayOptions& options) {
  bool broken = false;
  const std::vector<std::string> files = CaseFiles(options.files);
  FindingFiles files_of_shrunk(options.shrunk);
  for (const std::string& file : files) {
    Case c = ReadCase(file);
    if (!options.structure.empty()) c.structure = options.structure;
    ParseContestant(registry, c.structure);
    SceneOf(c);
    const std::string looked_for = c.check;
    c.check.clear();
    std::string left_out;
    const std::vector<Finding> findings = ExamineIsolated(registry, c, 60, &left_out);
    broken |= !findings.empty();
    fmt::print("{}: {}: {}\n", file, c.structure,
               !findings.empty()   ? fmt::format("{} broken", findings.size())
               : !left_out.empty() ? "left out: " + left_out
                                   : "every promise held");
    for (const Finding& f : findings)
      fmt::print("  {}{}: {}\n", f.check, f.check == looked_for ? " (as the file says)" : "", f.text);
    if (!options.shrunk.empty())
      for (const Finding& f : findings) ShowShrunk(registry, c, f, files_of_shrunk);
    if (options.brief) continue;
    std::string shown;
    const std::string how = RunIsolated(
        {60, 2048, false}, [&] { return ShowRays(registry, c); }, shown);
    fmt::print("{}", shown);
    if (!how.empty()) fmt::print("  showing its rays: the process {}\n", how);
  }
  return broken ? 1 : 0;
}

}  // namespace raybench::fuzz
