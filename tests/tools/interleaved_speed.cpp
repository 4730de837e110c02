// How fast structures are beside each other: on recorded rays, by one thread, in one process, in turn.
//
//   interleaved_speed --structures embree,bvh_wide,bvh_sah SCENE...
//
// Each round asks every structure for each whole ray set, in random order, by the thread's CPU time. Printed
// is the speed in units of the first structure's: the median of the rounds' ratios, per cell and as geometric
// means. `--same NAME` also counts answers that differ from that structure's in a bit of t or in the primitive.
#include <fmt/format.h>

#include <algorithm>
#include <map>

#include "harness/rays/ray_sets.h"
#include "tests/tools/race.h"
#include "tests/tools/tool.h"

namespace raybench {
namespace {

double Median(std::vector<double> v) {
  std::nth_element(v.begin(), v.begin() + long(v.size() / 2), v.end());
  return v[v.size() / 2];
}

struct Options : RaceOptions {
  std::vector<std::string> sets{};
  std::string same{};
  uint64_t rays = 1 << 16;
  int builds = 1;
};

struct Contender {
  std::string spec;
  Tree tree;
  std::vector<rb_hit> hits;
  std::vector<uint8_t> occluded;
};

size_t Differences(const Contender& a, const Contender& b, uint32_t kind) {
  size_t n = 0;
  if (kind == RB_ANY) {
    for (size_t i = 0; i < a.occluded.size(); ++i) n += a.occluded[i] != b.occluded[i];
  } else {
    for (size_t i = 0; i < a.hits.size(); ++i)
      n += a.hits[i].t != b.hits[i].t || a.hits[i].prim != b.hits[i].prim;
  }
  return n;
}

class Race {
 public:
  explicit Race(const Options& options) : options_(options), registry_(WithPlugins(options.plugins)) {}

  void Scene(const std::string& name) {
    const class Scene scene = LoadScene(name);
    const rb_geometry geometry = scene.Geometry();
    fmt::print("{}: {} primitives; ns a ray of {}, and speeds in its units\n", name, scene.primitive_count(),
               options_.structures[0]);
    std::vector<Contender> all(options_.structures.size());
    Build(geometry, all);
    CaptureOptions capture;
    capture.rays = options_.rays, capture.sets = options_.sets;
    for (const SourcedSet& s : CaptureRaySets(registry_, scene, capture).sets) Set(s.set, all);
  }

  void Summary() const {
    fmt::print("geometric means\n");
    for (const auto& [label, cells] : cells_) {
      fmt::print("  {:24}", label);
      for (const std::vector<double>& c : cells) fmt::print(" {:8.3f}", GeometricMean(c));
      fmt::print("\n");
    }
  }

 private:
  void Build(const rb_geometry& geometry, std::vector<Contender>& all) {
    std::vector<std::vector<double>> seconds(all.size());
    for (int i = 0; i < options_.builds; ++i) {
      for (size_t k = 0; k < all.size(); ++k) {
        all[k].spec = options_.structures[k];
        const Contestant contestant = ParseContestant(registry_, all[k].spec);
        rb_build_options options = DefaultBuildOptions();
        options.needs |= RB_NEED_ANY;
        all[k].tree = {};
        const double start = Seconds(CLOCK_PROCESS_CPUTIME_ID);
        all[k].tree = Tree(contestant, geometry, options);
        seconds[k].push_back(Seconds(CLOCK_PROCESS_CPUTIME_ID) - start);
      }
    }
    const double base = *std::min_element(seconds[0].begin(), seconds[0].end());
    fmt::print("  {:24} {:6.0f} ms", "build", 1000 * base);
    Cells& cells = CellsOf("build");
    for (size_t k = 0; k < all.size(); ++k) {
      cells[k].push_back(base / *std::min_element(seconds[k].begin(), seconds[k].end()));
      uint64_t nodes = 0, prims = 0;
      int needs_geometry = 0;
      all[k].tree.structure().memory(all[k].tree.get(), &nodes, &prims, &needs_geometry);
      fmt::print("  {:.3f} ({:.1f}+{:.1f} B)", cells[k].back(),
                 double(nodes) / double(geometry.triangle_count),
                 double(prims) / double(geometry.triangle_count));
    }
    fmt::print("\n");
  }

  void Set(const RaySet& set, std::vector<Contender>& all) {
    const size_t n = set.rays.size();
    if (n * 8 < options_.rays) return;
    auto ask = [&](Contender& c) {
      c.hits.resize(n), c.occluded.resize(n);
      rb_query query{};
      query.struct_size = sizeof query, query.kind = set.query, query.n = n, query.rays = set.rays.data();
      query.hits = c.hits.data(), query.occluded = c.occluded.data();
      const double start = Seconds(CLOCK_THREAD_CPUTIME_ID);
      c.tree.Query(query);
      return Seconds(CLOCK_THREAD_CPUTIME_ID) - start;
    };
    Turns turns(all.size());
    std::vector<std::vector<double>> ratios(all.size());
    std::vector<double> times(all.size()), base;
    for (int round = -1; round < options_.rounds; ++round) {  // the first one warms up
      for (const size_t k : turns.Next(random_)) times[k] = ask(all[k]);
      if (round < 0) continue;
      base.push_back(times[0]);
      for (size_t k = 0; k < all.size(); ++k) ratios[k].push_back(times[0] / times[k]);
    }
    fmt::print("  {:24} {:6.0f}   ", set.Label(), 1e9 * Median(base) / double(n));
    Cells& cells = CellsOf(set.kind + (set.query == RB_ANY ? " (any)" : ""));
    for (size_t k = 0; k < all.size(); ++k) {
      cells[k].push_back(Median(ratios[k]));
      fmt::print(" {:8.3f}", cells[k].back());
    }
    if (!options_.same.empty()) {
      const auto it = std::find(options_.structures.begin(), options_.structures.end(), options_.same);
      for (const Contender& c : all)
        fmt::print(" {:6}", Differences(c, all[size_t(it - options_.structures.begin())], set.query));
    }
    fmt::print("\n");
    std::fflush(stdout);
  }

  using Cells = std::vector<std::vector<double>>;  // per structure, per scene
  Cells& CellsOf(const std::string& label) {
    Cells& cells = cells_[label];
    cells.resize(options_.structures.size());
    return cells;
  }

  Options options_;
  Registry registry_;
  Random random_{7};
  std::map<std::string, Cells> cells_;
};

int Main(int argc, char** argv) {
  Options options{RaceOptions(9)};
  CLI::App app("Speeds of structures in units of the first one's, interleaved, one thread");
  options.AddTo(app);
  app.add_option("--sets", options.sets, "ray sets, all by default");
  app.add_option("--rays", options.rays, "of a set");
  app.add_option("--builds", options.builds);
  app.add_option("--same", options.same, "count answers that differ from this structure's");
  return RunRace<Race>(app, options, argc, argv);
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) { return raybench::RunTool("interleaved_speed", raybench::Main, argc, argv); }
