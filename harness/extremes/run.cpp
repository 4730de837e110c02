#include "harness/extremes/run.h"

#include <fmt/format.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <map>
#include <optional>
#include <set>

#include "accel/base/files.h"
#include "harness/base/json.h"
#include "harness/extremes/point.h"
#include "harness/measure/machine.h"
#include "harness/plan/plan.h"
#include "harness/results/python.h"
#include "harness/results/results.h"
#include "harness/results/run_facts.h"
#include "harness/terminal/interrupt.h"
#include "harness/terminal/progress.h"

namespace raybench::extremes {
namespace fs = std::filesystem;
namespace {

/// Every second point of each variant, and its last one.
std::vector<Point> Thinned(const std::vector<Point>& points) {
  std::vector<Point> kept;
  size_t within = 0;
  for (size_t i = 0; i < points.size(); ++i) {
    if (i > 0 && points[i].variant != points[i - 1].variant) within = 0;
    const bool last = i + 1 == points.size() || points[i + 1].variant != points[i].variant;
    if (within++ % 2 == 0 || last) kept.push_back(points[i]);
  }
  return kept;
}

class ExtremesRun {
 public:
  ExtremesRun(const Registry& registry, const Options& options) : registry_(registry), options_(options) {}

  int Go() {
    ChooseSuites();
    contestants_ = EveryArithmetic(registry_, options_.structures);
    MakeFolder();
    started_ = UtcTime("%Y-%m-%dT%H:%M:%SZ");
    bool interrupted = false;
    try {
      MeasureAll();
    } catch (...) {
      interrupted = Interrupted();
      if (!interrupted) {
        progress_.Clear();
        WriteFiles(false);
        throw;
      }
    }
    progress_.Clear();
    WriteFiles(interrupted);
    return Finish(interrupted);
  }

 private:
  struct Planned {
    const Suite* suite;
    Point point;
  };

  void ChooseSuites() {
    std::set<std::string> seen;
    for (const std::string& name : options_.suites) {
      if (!seen.insert(name).second) throw InputError(fmt::format("suite '{}' is given twice", name));
      suites_.push_back(&FindSuite(name));
    }
    if (suites_.empty()) suites_.assign(Suites().begin(), Suites().end());
    for (const Suite* suite : suites_)
      for (const Point& point : options_.quick ? Thinned(suite->points()) : suite->points())
        plan_.push_back({suite, point});
  }

  void MakeFolder() {
    folder_ = options_.out.empty() ? "results/extremes-" + UtcTime("%Y-%m-%dT%H-%M-%SZ") : options_.out;
    std::error_code error;
    if (fs::exists(folder_ / "extremes.csv", error))
      throw InputError(
          fmt::format("{} already holds an extremes.csv: choose another --out", folder_.string()));
    fs::create_directories(folder_, error);
    if (error) throw InputError(fmt::format("{}: cannot be created: {}", folder_.string(), error.message()));
    lock_.emplace(folder_);
  }

  void MeasureAll() {
    for (size_t i = 0; i < plan_.size(); ++i) {
      const auto& [suite, point] = plan_[i];
      PointOptions options;
      options.rays = options_.Rays();
      options.seed = options_.seed;
      size_t done = 0;
      const std::string place = fmt::format("{} at {:g}{}{}", suite->name, point.magnitude,
                                            point.variant.empty() ? "" : ", ", point.variant);
      options.progress = [&](const std::string& what) {
        const double within = double(done++) / double(contestants_.size() + 1);
        progress_.Update((double(i) + within) / double(plan_.size()), fmt::format("{}: {}", place, what));
      };
      ThrowIfInterrupted();
      for (Row& row : MeasurePoint(*suite, point, contestants_, options)) {
        if (row.Get(column::status) == "broken" && point.valid) {
          ++broken_;
          progress_.Say(
              fmt::format("BROKEN CLAIM: {}: {}: {}", place, row.Get(column::spec), row.Get(column::note)));
        }
        rows_.push_back(std::move(row));
      }
    }
  }

  void WriteFiles(bool interrupted) const {
    std::string csv = CsvHeader(kExtremesColumns) + "\n";
    for (const Row& row : rows_) csv += row.ToCsv(kExtremesColumns) + "\n";
    WriteFileAtomically(folder_ / "extremes.csv", csv);

    Json suites = Json::array(), structures = Json::array();
    for (const Suite* s : suites_) {
      suites.push_back({{"name", s->name},
                        {"doc", s->doc},
                        {"axis_title", s->axis_title},
                        {"axis", s->axis == Axis::kLinear ? "linear" : "logarithmic"},
                        {"failure", s->failure},
                        {"second", s->second != nullptr ? Json(s->second) : Json()},
                        {"range", s->range}});
    }
    for (const Contestant& c : contestants_) structures.push_back(FactsOf(c, registry_));
    const Json json = {
        {"format", kResultFormat},
        {"started", started_},
        {"ended", UtcTime("%Y-%m-%dT%H:%M:%SZ")},
        {"interrupted", interrupted},
        {"points", plan_.size()},
        {"command_line", options_.command_line},
        {"plugins", options_.plugins},
        {"seed", options_.seed},
        {"quick", options_.quick},
        {"rays_per_point", options_.Rays()},
        {"timing",
         "rough: median of 3 passes in turn (1 where a pass lasts long), one pinned thread, CPU time"},
        {"build", BuildFacts()},
        {"machine", MachineFacts()},
        {"libraries", LibraryFacts()},
        {"structures", structures},
        {"suites", suites}};
    WriteFileAtomically(folder_ / "extremes.json", Dump(json));
  }

  /// What one contestant did in one series of points.
  static std::string Summary(const std::vector<const Row*>& rows) {
    uint64_t rays = 0, refused = 0, skipped = 0;
    std::optional<double> first;
    double worst = 0, worst_at = 0, t_error = 0;
    std::vector<double> ns;
    for (const Row* row : rows) {
      const std::string status = row->Get(column::status);
      refused += status == "refused";
      skipped += status == "skipped";
      const auto rate = row->Get(column::failure_rate);
      if (!rate) continue;
      rays += *row->Get(column::rays);
      t_error = std::max(t_error, row->Get(column::t_error_p99).value_or(0));
      ns.push_back(*row->Get(column::ns_per_ray));
      const double at = *row->Get(column::magnitude);
      if (*rate > 0 && !first) first = at;
      if (*rate > worst) {
        worst = *rate;
        worst_at = at;
      }
    }
    std::string text;
    if (rays > 0) {
      const auto [lo, hi] = std::minmax_element(ns.begin(), ns.end());
      text = first ? fmt::format("fails from {:g} on, most at {:g}: {:.3g} %", *first, worst_at, 100 * worst)
                   : fmt::format("0 of {} rays fail", rays);
      text += fmt::format("; t error p99 at most {:.3g} ulp; {:.3g} to {:.3g} ns a ray", t_error, *lo, *hi);
    }
    if (refused > 0) text += fmt::format("{}{} points refused at load", text.empty() ? "" : "; ", refused);
    if (skipped > 0) text += fmt::format("{}{} points skipped", text.empty() ? "" : "; ", skipped);
    return text;
  }

  void PrintTable() const {
    // Suites and variants in the order of the plan.
    std::vector<std::string> series;
    std::map<std::string, std::map<std::string, std::vector<const Row*>>> rows;
    for (const Row& row : rows_) {
      std::string name = row.Get(column::suite);
      if (row.Has(column::variant)) name += ", " + row.Get(column::variant);
      if (!rows.contains(name)) series.push_back(name);
      rows[name][row.Get(column::spec)].push_back(&row);
    }
    for (const std::string& name : series) {
      fmt::print("{}\n", name);
      for (const Contestant& c : contestants_) {
        const auto found = rows[name].find(c.Spec());
        if (found != rows[name].end()) fmt::print("  {:<28} {}\n", c.Spec(), Summary(found->second));
      }
    }
  }

  int Finish(bool interrupted) {
    if (!rows_.empty()) PrintTable();
    const std::string folder = folder_.string();
    fmt::print("rows    {}/extremes.csv\n", folder);
    std::fflush(stdout);
    if (interrupted) {
      progress_.Say(fmt::format("interrupted: {} finished points are kept",
                                contestants_.empty() ? 0 : rows_.size() / contestants_.size()));
      return 130;
    }
    if (options_.report) {
      DrawReportIfPossible(folder);
    } else {
      fmt::print("report  raybench report {} makes it\n", folder);
    }
    if (broken_ == 0) return 0;
    progress_.Say(
        fmt::format("{} times a structure broke its claim inside a suite's range (above)", broken_));
    return 1;
  }

  const Registry& registry_;
  const Options& options_;
  Progress progress_;
  std::optional<OneProcessLock> lock_;
  std::vector<const Suite*> suites_;
  std::vector<Planned> plan_;
  std::vector<Contestant> contestants_;
  std::vector<Row> rows_;
  fs::path folder_;
  std::string started_;
  uint64_t broken_ = 0;
};

}  // namespace

int Run(const Registry& registry, const Options& options) { return ExtremesRun(registry, options).Go(); }

}  // namespace raybench::extremes
