// What the tools have in common that time structures beside each other, in turn.
#pragma once

#include <CLI/CLI.hpp>
#include <cmath>
#include <ctime>
#include <numeric>
#include <string>
#include <utility>
#include <vector>

#include "accel/base/random.h"
#include "accel/host/registry.h"

namespace raybench {

inline double Seconds(clockid_t clock) {
  timespec t;
  clock_gettime(clock, &t);
  return double(t.tv_sec) + 1e-9 * double(t.tv_nsec);
}

inline double GeometricMean(const std::vector<double>& values) {
  double sum = 0;
  for (const double x : values) sum += std::log(x);
  return std::exp(sum / double(values.size()));
}

struct RaceOptions {
  std::vector<std::string> structures, scenes, plugins;
  int rounds;

  explicit RaceOptions(int rounds_in) : rounds(rounds_in) {}
  void AddTo(CLI::App& app) {
    app.add_option("scenes", scenes)->required();
    app.add_option("--structures", structures, "the first is the unit")->required();
    app.add_option("--plugin", plugins, "shared libraries with structures");
    app.add_option("--rounds", rounds);
  }
};

inline Registry WithPlugins(const std::vector<std::string>& plugins) {
  Registry registry;
  for (const std::string& plugin : plugins) registry.LoadPlugin(plugin);
  return registry;
}

/// Who is asked when in a round: 0 to n - 1, shuffled anew each time.
class Turns {
 public:
  explicit Turns(size_t n) : order_(n) { std::iota(order_.begin(), order_.end(), size_t{0}); }
  const std::vector<size_t>& Next(Random& random) {
    for (size_t i = order_.size(); i-- > 1;) std::swap(order_[i], order_[random.Below(i + 1)]);
    return order_;
  }

 private:
  std::vector<size_t> order_;
};

/// Reads the command line and runs R(options) over all scenes: R has Scene(name) and Summary().
template <class R, class Options>
int RunRace(CLI::App& app, Options& options, int argc, char** argv) {
  CLI11_PARSE(app, argc, argv);
  R race(options);
  for (const std::string& scene : options.scenes) race.Scene(scene);
  race.Summary();
  return 0;
}

}  // namespace raybench
