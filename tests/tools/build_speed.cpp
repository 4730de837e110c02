// How fast structures are built, beside each other and by several numbers of threads: in one process, in turn.
//
//   build_speed SCENE... --structures embree bvh_wide --threads 1 2
//
// Each round builds every structure by each number of threads, in random order. Printed are, for each structure, the
// least processor and wall times, its speed in units of the first structure's (processor time, at the first number of
// threads), how many times as fast each further number of threads is (wall time; of all rounds the quickest), and a
// hash of the tree, which has to be the same in all rounds.
#include <fmt/format.h>

#include <limits>
#include <stdexcept>

#include "accel/base/hash.h"
#include "accel/base/parallel.h"
#include "datasets/scene/scene.h"
#include "tests/tools/race.h"
#include "tests/tools/tool.h"

namespace raybench {
namespace {

/// Of all nodes that the structure shows; empty if it shows none.
std::string HashOf(const Tree& tree) {
  if (tree.structure().visit == nullptr) return "";
  Hash64 hash;
  auto add = [](void* context, const rb_node* node) {
    Hash64& h = *static_cast<Hash64*>(context);
    h.AddValue(node->depth), h.AddValue(node->is_leaf);
    h.Add(node->bounds, node->bounds_count * sizeof(float));
    h.Add(node->prims, node->prim_count * sizeof(uint32_t));
    return 0;
  };
  tree.structure().visit(tree.get(), add, &hash);
  return hash.Hex();
}

struct Options : RaceOptions {
  std::vector<uint32_t> threads{1};
  bool hash = true;
};

struct Best {
  double cpu = std::numeric_limits<double>::infinity(), wall = cpu;
};

class Race {
 public:
  explicit Race(const Options& options) : options_(options), registry_(WithPlugins(options.plugins)) {
    for (const std::string& spec : options.structures) all_.push_back(ParseContestant(registry_, spec));
    speeds_.resize(all_.size());
    scaling_.resize(all_.size() * options.threads.size());
  }

  void Scene(const std::string& name) {
    const class Scene scene = LoadScene(name);
    fmt::print("{}: {} primitives\n", name, scene.primitive_count());
    const rb_geometry geometry = scene.Geometry();
    const size_t counts = options_.threads.size();
    std::vector<Best> best(all_.size() * counts);
    std::vector<std::string> hashes(all_.size());
    Turns turns(best.size());
    for (int round = 0; round < options_.rounds; ++round) {
      for (const size_t i : turns.Next(random_)) {
        const std::string hash = Build(geometry, i / counts, options_.threads[i % counts], best[i]);
        std::string& known = hashes[i / counts];
        if (!known.empty() && hash != known)
          throw std::runtime_error(options_.structures[i / counts] + ": two builds gave different trees");
        known = hash;
      }
    }
    for (size_t k = 0; k < all_.size(); ++k) {
      const Best& one = best[k * counts];
      speeds_[k].push_back(best[0].cpu / one.cpu);
      fmt::print("  {:34} {:7.1f} ms {:7.3f}", options_.structures[k], 1000 * one.cpu, speeds_[k].back());
      for (size_t t = 1; t < counts; ++t) {
        const Best& more = best[k * counts + t];
        scaling_[k * counts + t].push_back(one.wall / more.wall);
        fmt::print("  {} threads x{:.2f} ({:.1f} -> {:.1f} ms)", options_.threads[t], one.wall / more.wall,
                   1000 * one.wall, 1000 * more.wall);
      }
      fmt::print("  {}\n", hashes[k]);
    }
    std::fflush(stdout);
  }

  void Summary() const {
    fmt::print("geometric means\n");
    for (size_t k = 0; k < all_.size(); ++k) {
      fmt::print("  {:34} {:18.3f}", options_.structures[k], GeometricMean(speeds_[k]));
      for (size_t t = 1; t < options_.threads.size(); ++t)
        fmt::print("  {} threads x{:.2f}", options_.threads[t],
                   GeometricMean(scaling_[k * options_.threads.size() + t]));
      fmt::print("\n");
    }
  }

 private:
  std::string Build(const rb_geometry& geometry, size_t structure, uint32_t threads, Best& best) const {
    rb_build_options options = DefaultBuildOptions();
    options.needs |= RB_NEED_ANY;
    options.threads = threads;
    const double cpu = Seconds(CLOCK_PROCESS_CPUTIME_ID), wall = Seconds(CLOCK_MONOTONIC);
    const Tree tree(all_[structure], geometry, options);
    best.wall = std::min(best.wall, Seconds(CLOCK_MONOTONIC) - wall);
    best.cpu = std::min(best.cpu, Seconds(CLOCK_PROCESS_CPUTIME_ID) - cpu);
    return options_.hash ? HashOf(tree) : "";
  }

  Options options_;
  Registry registry_;
  Random random_{7};
  std::vector<Contestant> all_;
  std::vector<std::vector<double>> speeds_;   // per structure, per scene
  std::vector<std::vector<double>> scaling_;  // per structure and number of threads, per scene
};

int Main(int argc, char** argv) {
  Options options{RaceOptions(5)};
  CLI::App app("Build times of structures, interleaved");
  options.AddTo(app);
  app.add_option("--threads", options.threads, "numbers of threads; the first is compared with the others");
  app.add_flag("!--no-hash", options.hash, "do not compare the trees of the rounds");
  return RunRace<Race>(app, options, argc, argv);
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) { return raybench::RunTool("build_speed", raybench::Main, argc, argv); }
