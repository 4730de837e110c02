// raybench spd: counts the rays of the Standard Procedural Databases and compares with published counts.
//
// The counts do not depend on the structure that answers; what a grid and an octree cost per ray does, so
// these are built as Havran built them and asked the very rays of the picture.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <optional>

#include "accel/base/files.h"
#include "harness/base/json.h"
#include "harness/cli/commands.h"
#include "harness/cli/picture_options.h"
#include "harness/judge/tree_statistics.h"
#include "harness/measure/machine.h"
#include "harness/measure/measure.h"
#include "harness/plan/build_options.h"
#include "harness/plan/plan.h"
#include "harness/results/results.h"
#include "harness/spd/figures.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/load.h"
#include "harness/terminal/progress.h"
#include "tracer/tracer.h"

namespace raybench {
namespace fs = std::filesystem;
namespace {

struct SpdOptions {
  std::vector<std::string> scenes;
  std::string structure = "bvh_sah(numerics=double)", json, csv;
  uint32_t threads = 0;
};

constexpr const char* kNote =
    "Figures per ray are averages over all rays of the picture, including those that miss the grid; a shadow "
    "ray stops at its first hit. The published tests per ray of octrees agree with our tests per ray that "
    "hits, the ratio to the fewest possible (Havran's r_ITM).";

constexpr SpdFigure kNoFigure{kUncounted, kUncounted};

/// One figure of one tree.
struct Row {
  std::string scene, structure;
  const char* figure;
  double ours;
  SpdFigure others;
  bool per_ray = false;
};

/// How far `ours` is from `other`, in %; none where nobody counted it, or only `other` is 0.
std::optional<double> Percent(double ours, double other) {
  if (other == 0 && ours == 0) return 0;
  if (!(other > 0)) return std::nullopt;
  return 100 * (ours / other - 1);
}

/// "1,402,297", or "15.97" of figures per ray.
std::string Text(double value, bool per_ray) {
  if (per_ray) return fmt::format("{:.2f}", value);
  std::string digits = fmt::format("{:.0f}", value);
  for (size_t at = digits.size(); at > 3;) digits.insert(at -= 3, ",");
  return digits;
}

/// A number that is shown as 0 has no sign.
double NoMinusZero(double percent) { return std::abs(percent) < 0.005 ? 0 : percent; }

void Print(const std::vector<Row>& rows) {
  fmt::print("  {:<24}{:>13}{:>13}{:>11}{:>13}{:>11}\n", "", "ours", "published", "differs", "check",
             "differs");
  for (const Row& row : rows) {
    std::string line = fmt::format("  {:<24}{:>13}", row.figure, Text(row.ours, row.per_ray));
    for (const double other : {row.others.published, row.others.check}) {
      const std::optional<double> percent = Percent(row.ours, other);
      const bool known = !std::isnan(other);
      line += fmt::format("{:>13}{:>11}", known ? Text(other, row.per_ray) : "-",
                          known && percent ? fmt::format("{:+.2f} %", NoMinusZero(*percent)) : "-");
    }
    fmt::print("{}\n", line);
  }
}

Json AsJson(const Row& row) {
  const auto known = [&](double other) { return std::isnan(other) ? Json() : Json(other); };
  const auto percent = [&](double other) {
    const std::optional<double> value = Percent(row.ours, other);
    return value ? Json(*value) : Json();
  };
  return {{"scene", row.scene},
          {"structure", row.structure},
          {"figure", row.figure},
          {"ours", row.ours},
          {"published", known(row.others.published)},
          {"published_percent", percent(row.others.published)},
          {"check", known(row.others.check)},
          {"check_percent", percent(row.others.check)}};
}

std::string AsCsv(const std::vector<Row>& rows) {
  std::string text = "scene,structure,figure,ours,published,published_percent,check,check_percent\n";
  for (const Row& row : rows) {
    const Json fields = AsJson(row);
    std::string line;
    for (const auto& [key, value] : fields.items())
      line += fmt::format("{}{}", line.empty() ? "" : ",", CsvField(value));
    text += line + "\n";
  }
  return text;
}

/// "balls" of the generator of that name, and of a file balls.nff.
std::string StemOf(const Scene& scene) {
  const fs::path name(scene.name);
  const std::string extension = name.extension().string();
  return extension == ".nff" || extension == ".NFF" ? name.stem().string() : scene.name;
}

/// Means over all rays of all sets.
struct PerRay {
  double steps = 0, leaves = 0, empty_leaves = 0, prims = 0;
  double hits = 0;  ///< share of rays that hit or are blocked

  double PrimsPerHit() const { return hits > 0 ? prims / hits : 0; }
};

PerRay CountAll(const Tree& tree, const std::vector<RaySet>& sets, uint32_t threads) {
  PerRay sum;
  double rays = 0;
  for (const RaySet& set : sets) {
    const size_t n = set.rays.size();
    std::vector<rb_hit> hits(set.query == RB_CLOSEST ? n : 0);
    std::vector<uint8_t> occluded(set.query == RB_ANY ? n : 0);
    std::vector<rb_counts> counts(n);
    rb_query query{};
    query.struct_size = sizeof query;
    query.kind = set.query;
    query.n = n;
    query.rays = set.rays.data();
    query.counts = counts.data();
    query.hits = hits.data();
    query.occluded = occluded.data();
    QueryParallel(tree, query, threads);
    for (const rb_counts& c : counts) {
      sum.steps += double(c.steps);
      sum.leaves += double(c.leaves);
      sum.empty_leaves += double(c.empty_leaves);
      sum.prims += double(c.prims);
    }
    sum.hits += double(std::count(occluded.begin(), occluded.end(), 1));
    for (const rb_hit& hit : hits) sum.hits += hit.prim != RAYBENCH_NONE;
    rays += double(n);
  }
  for (double* mean : {&sum.steps, &sum.leaves, &sum.empty_leaves, &sum.prims, &sum.hits}) *mean /= rays;
  return sum;
}

class Spd {
 public:
  Spd(const Registry& registry, const SpdOptions& options)
      : registry_(registry), options_(options), contestant_(ParseContestant(registry, options.structure)) {}

  int Go() {
    for (const std::string& file : {options_.json, options_.csv}) CheckOut(file);
    std::vector<std::string> names = options_.scenes;
    if (names.empty())
      for (const SpdCounts& counts : kSpdCounts) names.emplace_back(counts.scene);
    for (size_t i = 0; i < names.size(); ++i) {
      begin_ = double(i) / double(names.size());
      share_ = 1 / double(names.size());
      CountScene(names[i]);
    }
    fmt::print("{}\n", kNote);
    if (!options_.json.empty()) {
      Json rows = Json::array();
      for (const Row& row : rows_) rows.push_back(AsJson(row));
      const Json all{{"note", kNote}, {"build", BuildFacts()}, {"rows", std::move(rows)}};
      WriteFileAtomically(options_.json, all.dump(2) + "\n");
    }
    if (!options_.csv.empty()) WriteFileAtomically(options_.csv, AsCsv(rows_));
    return 0;
  }

 private:
  static void CheckOut(const std::string& file) {
    if (file.empty()) return;
    const fs::path path(file), folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
    std::error_code error;
    if (!fs::is_directory(folder, error))
      throw InputError(fmt::format("{}: cannot be written: {} is not a directory", file, folder.string()));
  }

  /// Of this scene, in [0, 1].
  void Update(double fraction, const std::string& what) {
    ThrowIfInterrupted();
    progress_.Update(begin_ + share_ * fraction, what);
  }

  void CountScene(const std::string& name) {
    const Scene scene = LoadWithProgress(name, {});
    if (scene.primitive_count() == 0) throw InputError(fmt::format("scene '{}' has no primitives", name));
    if (const std::string why = WhyNotTaken(*contestant_.structure, scene); !why.empty())
      throw InputError(fmt::format("structure '{}', scene '{}': {}", contestant_.structure->name, name, why));
    const std::string stem = StemOf(scene);
    const auto wanted = [&](const auto& figures) { return figures.scene == stem; };
    const auto grids = std::count_if(std::begin(kSpdGrids), std::end(kSpdGrids), wanted);
    const auto octrees = std::count_if(std::begin(kSpdOctrees), std::end(kSpdOctrees), wanted);

    TraceOptions trace;
    trace.width = trace.height = 512;
    trace.sampling.pattern = SamplePattern::kCorners;
    trace.rules = TraceRules::kSpd;
    trace.threads = options_.threads;
    trace.capture = grids + octrees > 0;
    trace.progress = [&](double fraction) { Update(0.5 * fraction, name + ": tracing"); };
    const rb_geometry geometry = scene.Geometry();
    const Tree tree(contestant_, geometry,
                    BuildOptions(options_.threads, 1, BuildNeedsOf(scene, trace, *contestant_.structure)));
    const Stopwatch watch(true);
    const TraceResult traced = Trace(scene, tree, trace);
    const double seconds = watch.Elapsed().wall;
    ThrowIfInterrupted();

    progress_.Clear();
    const auto counts = std::find_if(std::begin(kSpdCounts), std::end(kSpdCounts), wanted);
    fmt::print("{}: counted by {} in {:.1f} s{}\n", name, contestant_.Spec(), seconds,
               counts == std::end(kSpdCounts) ? "; no figures are published here" : "");
    AddCounts(name, scene, traced, counts == std::end(kSpdCounts) ? nullptr : counts);
    double done = 0;
    const auto next = [&](const std::string& spec) {
      Update(0.5 + 0.5 * done++ / double(grids + octrees), fmt::format("{}: {}", name, spec));
    };
    for (const SpdGrid& grid : kSpdGrids)
      if (wanted(grid)) AddGrid(name, geometry, grid, traced.ray_sets, next);
    for (const SpdOctree& octree : kSpdOctrees)
      if (wanted(octree)) AddOctree(name, geometry, octree, traced.ray_sets, next);
  }

  void Add(const std::vector<Row>& rows) {
    progress_.Clear();
    Print(rows);
    std::fflush(stdout);
    rows_.insert(rows_.end(), rows.begin(), rows.end());
  }

  void AddCounts(const std::string& name, const Scene& scene, const TraceResult& traced,
                 const SpdCounts* figures) {
    const std::string spec = contestant_.Spec();
    const uint64_t secondary = traced.reflection_rays + traced.refraction_rays;
    const auto row = [&](const char* figure, uint64_t ours, SpdFigure SpdCounts::*others) -> Row {
      return {name, spec, figure, double(ours), figures != nullptr ? figures->*others : kNoFigure};
    };
    Add({row("primitives", scene.primitive_count(), &SpdCounts::primitives),
         row("camera rays", traced.camera_rays, &SpdCounts::camera_rays),
         row("camera rays hitting", traced.camera_hits, &SpdCounts::camera_hits),
         row("shadow rays", traced.shadow_rays, &SpdCounts::shadow_rays),
         row("shadow rays blocked", traced.shadow_blocked, &SpdCounts::shadow_blocked),
         row("secondary rays", secondary, &SpdCounts::secondary_rays),
         row("secondary rays hitting", traced.reflection_hits + traced.refraction_hits,
             &SpdCounts::secondary_hits),
         row("all rays", traced.camera_rays + traced.shadow_rays + secondary, &SpdCounts::all_rays)});
  }

  /// Builds the tree that `spec` says; `make` gets its statistics and costs, and makes the rows.
  template <class Next, class Make>
  void AddTree(const std::string& name, const rb_geometry& geometry, const std::string& spec,
               const std::vector<RaySet>& rays, const Next& next, const Make& make) {
    const Contestant contestant = ParseContestant(registry_, spec);
    next(contestant.Spec());
    const Tree tree(contestant, geometry, BuildOptions(options_.threads, 1));
    const std::optional<TreeStatistics> statistics = ReadTree(tree, geometry);
    std::vector<Row> rows = make(statistics.value(), CountAll(tree, rays, options_.threads));
    for (Row& row : rows) {
      row.scene = name;
      row.structure = contestant.Spec();
    }
    progress_.Clear();
    fmt::print("{}: {}\n", name, contestant.Spec());
    Add(rows);
  }

  template <class Next>
  void AddGrid(const std::string& name, const rb_geometry& geometry, const SpdGrid& his,
               const std::vector<RaySet>& rays, const Next& next) {
    const uint32_t* n = his.resolution;
    const std::string spec = fmt::format(
        "grid(numerics=fast,resolution_x={},resolution_y={},resolution_z={},insertion=bounds,mailbox=false)",
        n[0], n[1], n[2]);
    AddTree(name, geometry, spec, rays, next, [&](const TreeStatistics& s, const PerRay& cost) {
      return std::vector<Row>{{"", "", "empty cells", double(s.empty_leaf_nodes), his.empty_cells},
                              {"", "", "references", double(s.references), his.references},
                              {"", "", "cells per ray", cost.steps, his.steps, true},
                              {"", "", "empty cells per ray", cost.empty_leaves, his.empty_steps, true},
                              {"", "", "tests per ray", cost.prims, his.tests, true}};
    });
  }

  /// His octree knows no other end of subdivision than one primitive or the depth.
  template <class Next>
  void AddOctree(const std::string& name, const rb_geometry& geometry, const SpdOctree& his,
                 const std::vector<RaySet>& rays, const Next& next) {
    const std::string spec = fmt::format(
        "octree(numerics=fast,depth={},leaf_size=1,growth=9,references=1024,insertion=bounds)", his.depth);
    AddTree(name, geometry, spec, rays, next, [&](const TreeStatistics& s, const PerRay& cost) {
      return std::vector<Row>{{"", "", "interior nodes", double(s.inner_nodes), his.inner_nodes},
                              {"", "", "leaves", double(s.leaf_nodes), his.leaves},
                              {"", "", "empty leaves", double(s.empty_leaf_nodes), his.empty_leaves},
                              {"", "", "references", double(s.references), his.references},
                              {"", "", "tests per ray", cost.prims, his.tests, true},
                              {"", "", "tests per ray that hits", cost.PrimsPerHit(), his.tests, true},
                              {"", "", "leaves per ray", cost.leaves, his.leaves_visited, true}};
    });
  }

  const Registry& registry_;
  const SpdOptions& options_;
  const Contestant contestant_;
  Progress progress_;
  double begin_ = 0, share_ = 1;  ///< of the scene at hand, of all work
  std::vector<Row> rows_;
};

void AddSpdCommand(CLI::App& app, Invocation& invocation) {
  AddCommand<SpdOptions>(
      app, invocation, "spd",
      "Count the rays of the Standard Procedural Databases and compare with published counts",
      [](CLI::App& command, SpdOptions& spd) {
        command
            .add_option("scenes", spd.scenes,
                        "Scenes or NFF files; one with the name of a published scene (balls, balls.nff) is "
                        "compared with it. Default: balls, gears, mount, teapot, tetra")
            ->type_name("SCENE");
        command
            .add_option("--structure", spd.structure,
                        "Structure that traces the counted rays; default bvh_sah(numerics=double)")
            ->type_name("A(X=1)");
        command.add_option("--threads", spd.threads, "Threads; default all")
            ->transform(WholeNumber(1, 1024))
            ->type_name("N");
        command.add_option("--json", spd.json, "Write all figures as JSON")->type_name("FILE");
        command.add_option("--csv", spd.csv, "Write all figures as CSV")->type_name("FILE");
        command.footer(
            "Rays are those of `raybench render --rules spd --pattern corners`, 513 x 513 of them. "
            "Published: Havran and Sixta 1999 (their opaque surfaces were one-sided), octrees Havran 1999. "
            "Check: an independent one by the rules used here. Where published grids and octrees of a scene "
            "are known, they are built and asked the same rays.");
      },
      [](const SpdOptions& options, const Registry& registry) { return Spd(registry, options).Go(); });
}

}  // namespace

const Command kSpd = {90, AddSpdCommand};

}  // namespace raybench
