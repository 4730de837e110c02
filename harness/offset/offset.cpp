#include "harness/offset/offset.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <optional>
#include <set>

#include "accel/base/files.h"
#include "datasets/scene/needs.h"
#include "harness/base/columns.h"
#include "harness/judge/claim.h"
#include "harness/measure/machine.h"
#include "harness/measure/statistics.h"
#include "harness/offset/search.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/results/run_facts.h"
#include "harness/results/table.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

/// In the order in which they are taken where they are safe: a proven bound that no number has to be found for first.
constexpr SelfIntersection kCures[] = {SelfIntersection::kErrorBound,    SelfIntersection::kSkip,
                                       SelfIntersection::kNormalOffset,  SelfIntersection::kFixedTnear,
                                       SelfIntersection::kIntegerOffset, SelfIntersection::kNone};

/// As `render --self-intersection` has them.
const char* NameOf(SelfIntersection cure) {
  switch (cure) {
    case SelfIntersection::kErrorBound:
      return "error-bound";
    case SelfIntersection::kNone:
      return "none";
    case SelfIntersection::kFixedTnear:
      return "tnear";
    case SelfIntersection::kNormalOffset:
      return "normal-offset";
    case SelfIntersection::kIntegerOffset:
      return "integer-offset";
    case SelfIntersection::kSkip:
      break;
  }
  return "skip";
}

/// The options of `render` that choose it.
std::string ChoiceOf(const CureFindings& found) {
  std::string text = fmt::format("--self-intersection {}", NameOf(found.cure));
  if (found.sized) text += fmt::format(" --self-intersection-size {:g}", found.named.offset);
  return text;
}

std::string Share(uint64_t events, uint64_t rays) {
  return events == 0 ? fmt::format("0 (< {:.1e})", UpperRate(0, rays))
                     : fmt::format("{} ({:.2g} %)", events, 100 * double(events) / double(rays));
}

std::string RangeOf(const CureFindings& found) {
  if (!found.sized) return "-";
  if (!found.HasRange()) return "none";
  return fmt::format("{:.3g} to {:.3g}{}", found.smallest_safe->offset, found.largest_safe->offset,
                     found.above ? "" : " (the scene's size)");
}

class OffsetRun {
 public:
  OffsetRun(const Registry& registry, const OffsetOptions& options)
      : registry_(registry),
        options_(options),
        contestant_(ParseContestant(registry, options.structure)),
        started_(UtcTime("%Y-%m-%dT%H:%M:%SZ")) {}

  int Go() {
    MakeFolder();
    Load();
    const bool skips = (contestant_.structure->capabilities & RB_CAN_SKIP) != 0;
    const Tree tree(contestant_, scene_.Geometry(),
                    BuildOptions(options_.threads, options_.seed, RB_NEED_UV | (skips ? RB_NEED_SKIP : 0)));
    claim_ = tree.Claims();
    const LeavingTruth truth(scene_);
    Progress progress;
    DepartureOptions wanted{options_.Rays(), options_.seed, options_.aimed, options_.threads,
                            [&](double fraction) { progress.Update(0.05 * fraction, "making rays"); }};
    departing_ = MakeDepartures(registry_, scene_, truth, wanted);
    uint64_t all = 0, done = 0;
    std::string what;
    const OffsetSearch search(scene_, tree, truth, departing_, options_.threads, [&](uint64_t rays) {
      done += rays;
      progress.Update(0.05 + 0.95 * std::min(1.0, double(done) / double(all)), what);
    });
    std::vector<SelfIntersection> cures;
    for (SelfIntersection cure : kCures)
      if (cure != SelfIntersection::kSkip || skips) cures.push_back(cure), all += search.Work(cure);
    uint64_t before = 0;
    for (SelfIntersection cure : cures) {
      what = fmt::format("{}: {}", options_.scene, NameOf(cure));
      found_.push_back(search.Find(cure));
      done = before += search.Work(cure);
    }
    search.Time(found_);
    progress.Clear();
    Print(skips);
    if (!options_.out.empty()) WriteFiles();
    return Best().named.Safe() ? 0 : 1;
  }

 private:
  void MakeFolder() {
    if (options_.out.empty()) return;
    std::error_code error;
    if (fs::exists(fs::path(options_.out) / "offset.csv", error))
      throw InputError(fmt::format("{} already holds an offset.csv: choose another --out", options_.out));
    fs::create_directories(options_.out, error);
    if (error) throw InputError(fmt::format("{}: cannot be created: {}", options_.out, error.message()));
    lock_.emplace(options_.out);
  }

  void Load() {
    LoadOptions load;
    load.seed = options_.seed;
    load.drop_bad = options_.drop_bad;
    scene_ = LoadWithProgress(options_.scene, load);
    ThrowIfInterrupted();
    const auto refuse = [&](const std::string& why) {
      throw InputError(fmt::format("offset: scene '{}' {}", options_.scene, why));
    };
    if (const uint64_t n = scene_.procedural_count(); n > 0)
      refuse(fmt::format("has {} procedural primitives; it must be of triangles alone", n));
    if (scene_.triangles.empty()) refuse("has no triangles");
    if (const std::string why = WhyNotTaken(*contestant_.structure, scene_); !why.empty())
      throw InputError(
          fmt::format("structure '{}', scene '{}': {}", contestant_.structure->name, options_.scene, why));
  }

  /// The first that is safe, else the one that fails least.
  const CureFindings& Best() const {
    for (const CureFindings& found : found_)
      if (found.named.Safe()) return found;
    return *std::min_element(found_.begin(), found_.end(), [](const CureFindings& a, const CureFindings& b) {
      return *a.named.self_hits + *a.named.lost < *b.named.self_hits + *b.named.lost;
    });
  }

  void Print(bool skips) const {
    std::set<uint32_t> left;
    for (const Departing& d : departing_) left.insert(d.prim);
    fmt::print("{}: {} triangles, diagonal {:.4g}; {} rays leave {} of them{}; {}, seed {}\n", options_.scene,
               scene_.triangles.size(),
               std::ldexp(Length(ToDouble(scene_.bounds().Extent())), -scene_.scale_exponent),
               departing_.size(), left.size(), options_.aimed ? ", at edges and vertices" : "",
               contestant_.Spec(), options_.seed);
    Grid grid(
        {"cure", "safe offsets", "offset", "origin moves by", "self-hits", "lost hits", "ns/ray", "safe"});
    for (const CureFindings& found : found_)
      grid.Add({NameOf(found.cure), RangeOf(found),
                found.sized ? fmt::format("{:.3g}", found.named.offset) : "-",
                fmt::format("{:.2g} to {:.2g}", found.shortest, found.longest),
                Share(*found.named.self_hits, found.named.rays), Share(*found.named.lost, found.named.rays),
                fmt::format("{:.0f}", *found.ns_per_ray), found.named.Safe() ? "yes" : "NO"});
    fmt::print("{}", grid.Format(1, 130));
    for (const CureFindings& found : found_) PrintEnds(found);
    if (!skips) fmt::print("skip: {} cannot skip a primitive\n", contestant_.structure->name);
    fmt::print("{}\n", Advice());
    std::fflush(stdout);
  }

  static void PrintEnds(const CureFindings& found) {
    if (found.below)
      fmt::print("{} {:.3g}: {} of {} rays hit the surface that they leave\n", NameOf(found.cure),
                 found.below->offset, *found.below->self_hits, found.below->rays);
    if (found.above)
      fmt::print("{} {:.3g}: {} of {} rays lose a hit\n", NameOf(found.cure), found.above->offset,
                 *found.above->lost, found.above->rays);
  }

  std::string Advice() const {
    const CureFindings& best = Best();
    const uint64_t rays = departing_.size();
    if (!best.named.Safe())
      return fmt::format(
          "No cure is safe here. Least goes wrong with {}: {} self-hits and {} lost hits among {} rays. "
          "A structure with numerics=double, and more room between surfaces, help.",
          ChoiceOf(best), *best.named.self_hits, *best.named.lost, rays);
    std::string text = fmt::format(
        "Take {}: no self-hit and no lost hit among {} rays, so each rate is below {:.1e} at 95 %.",
        ChoiceOf(best), rays, UpperRate(0, rays));
    std::string also, unsafe;
    for (const CureFindings& found : found_) {
      if (&found == &best || found.cure == SelfIntersection::kNone) continue;
      std::string& list = found.named.Safe() ? also : unsafe;
      list += fmt::format("{}{}", list.empty() ? "" : ", ", NameOf(found.cure));
      if (found.named.Safe() && found.sized) list += fmt::format(" from {}", RangeOf(found));
    }
    if (!also.empty()) text += fmt::format(" Safe, too: {}.", also);
    if (!unsafe.empty()) text += fmt::format(" Not safe at any offset here: {}.", unsafe);
    return text;
  }

  std::vector<Row> Rows() const {
    std::vector<Row> rows;
    for (const CureFindings& found : found_) {
      const auto add = [&](const char* role, const Seen& seen) -> Row& {
        Row& row = rows.emplace_back();
        row[column::scene] = options_.scene;
        row[column::scene_hash] = scene_.hash();
        row[column::primitives] = scene_.primitive_count();
        row[column::structure] = contestant_.structure->name;
        row[column::spec] = contestant_.Spec();
        row[column::params] = contestant_.Params();
        row[column::claim] = ClaimName(claim_);
        row[column::seed] = options_.seed;
        row[column::cure] = NameOf(found.cure);
        row[column::role] = role;
        if (found.sized) row[column::offset] = seen.offset;
        row[column::rays] = seen.rays;
        row[column::self_hits] = seen.self_hits;
        row[column::lost] = seen.lost;
        if (seen.self_hits) row[column::self_hit_upper] = UpperRate(*seen.self_hits, seen.rays);
        if (seen.lost) row[column::lost_upper] = UpperRate(*seen.lost, seen.rays);
        return row;
      };
      for (const Seen& seen : found.scan) add("scan", seen);
      if (found.below) add("below", *found.below);
      if (found.smallest_safe) add("smallest_safe", *found.smallest_safe);
      if (found.largest_safe) add("largest_safe", *found.largest_safe);
      if (found.above) add("above", *found.above);
      Row& named = add("named", found.named);
      named[column::offset_min] = found.shortest;
      named[column::offset_max] = found.longest;
      named[column::safe] = found.named.Safe();
      named[column::ns_per_ray] = found.ns_per_ray;
    }
    return rows;
  }

  void WriteFiles() const {
    const std::vector<Row> rows = Rows();
    std::string csv = CsvHeader(kOffsetColumns) + "\n";
    Json json_rows = Json::array();
    for (const Row& row : rows) {
      csv += row.ToCsv(kOffsetColumns) + "\n";
      json_rows.push_back(row.ToJson(kOffsetColumns));
    }
    const Json json = {{"format", kResultFormat},
                       {"started", started_},
                       {"ended", UtcTime("%Y-%m-%dT%H:%M:%SZ")},
                       {"command_line", options_.command_line},
                       {"plugins", options_.plugins},
                       {"seed", options_.seed},
                       {"aimed", options_.aimed},
                       {"advice", Advice()},
                       {"scene", FactsOf(scene_)},
                       {"structure", FactsOf(contestant_, registry_)},
                       {"build", BuildFacts()},
                       {"machine", MachineFacts()},
                       {"libraries", LibraryFacts()},
                       {"rows", json_rows}};
    const fs::path out(options_.out);
    WriteFileAtomically(out / "offset.csv", csv);
    WriteFileAtomically(out / "offset.json", Dump(json));
    fmt::print("rows    {}\n", (out / "offset.csv").string());
  }

  const Registry& registry_;
  const OffsetOptions& options_;
  const Contestant contestant_;
  const std::string started_;
  std::optional<OneProcessLock> lock_;
  Scene scene_;
  uint32_t claim_ = RB_CLAIM_NOTHING;
  std::vector<Departing> departing_;
  std::vector<CureFindings> found_;
};

}  // namespace

int RunOffset(const Registry& registry, const OffsetOptions& options) {
  return OffsetRun(registry, options).Go();
}

}  // namespace raybench
