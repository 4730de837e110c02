// Times, with Google Benchmark as the engine: benchmarks are registered at run time, all trees of a scene in
// one group, whose repetitions the engine interleaves at random.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <regex>
#include <string>
#include <vector>

namespace raybench {

/// Both clocks over the same stretch of work, in seconds.
struct Seconds {
  double wall = 0, cpu = 0;
};

/// Of what one thread asked for: its processor time, or wall time where a device did it, which that does not see.
inline double TimeOfWork(const Seconds& seconds, bool device) { return device ? seconds.wall : seconds.cpu; }

/// Starts both clocks; cpu is the calling thread's, or with `process` that of all threads.
class Stopwatch {
 public:
  explicit Stopwatch(bool process);
  Seconds Elapsed() const;

 private:
  bool process_;
  Seconds start_;
};

/// Keeps the calling thread on one CPU (the last it may use) while it lives, if `active`.
class Pinned {
 public:
  explicit Pinned(bool active);
  ~Pinned();
  Pinned(const Pinned&) = delete;
  Pinned& operator=(const Pinned&) = delete;

 private:
  bool active_;
  std::vector<unsigned char> saved_;
};

/// One repetition of one task.
struct Sample {
  uint64_t sample = 0;    ///< counts from 0 within the task
  uint64_t sequence = 0;  ///< place in the random order of the group
  uint64_t passes = 0;    ///< passes in this sample
  Seconds time;           ///< of one pass
  uint64_t process = 0;   ///< of --processes, from 0
  uint64_t session = 0;   ///< process of the operating system that took it, counted from 0 in a folder
};

/// What is timed. Exactly one of `pass` and `build` is set.
struct TimedTask {
  std::string name;                ///< unique
  std::function<void()> pass;      ///< one pass over a ray set; an untimed one goes before each sample
  std::function<Seconds()> build;  ///< measures itself, since destroying the tree is no part of it
  uint64_t passes = 1;             ///< passes a sample, unless the user chose --benchmark_min_time
  uint32_t samples = 1;            ///< repetitions
  double sample_cost = 0;          ///< expected seconds a sample, for the progress
  bool warm_up = true;             ///< one untimed pass before each sample
  bool parallel = false;           ///< more than one thread: not pinned, the whole process's CPU time
  bool device = false;  ///< work that processor time does not see: not pinned, wall time on both clocks
};

/// Samples of one task; fewer than it wants where the run was interrupted.
using Measurement = std::vector<Sample>;

/// What a run takes of the arguments "--benchmark_..."; the rest of what Google Benchmark knows would end the
/// process, write files of its own or change what is measured.
class EngineFlags {
 public:
  /// Throws InputError naming the argument that is not taken or cannot be read.
  explicit EngineFlags(const std::vector<std::string>& flags);
  /// Whether --benchmark_filter lets a case of this name through: it holds the regular expression (POSIX,
  /// extended), or with '-' in front of that does not.
  bool Takes(const std::string& name) const;
  const std::string& filter() const { return filter_; }         ///< as given; empty: none
  std::optional<double> min_time() const { return min_time_; }  ///< seconds

 private:
  std::string filter_;
  std::optional<std::regex> expression_;
  std::optional<double> min_time_;
};

/// Sets the engine up: random interleaving, and `flags`. Call once.
void InitialiseEngine(const EngineFlags& flags);

/// What the engine says of itself and of the machine, word for word; it warns here if it was built without
/// optimisation. Known after the first Measure().
std::string EngineRemarks();

/// Times all tasks as one group. `take` is given each sample as it ends, with the task's index; `progress` the
/// fraction of the expected time that is done; both outside the clock. A task whose work throws a
/// std::runtime_error is given up: these are returned, each with the reason.
std::map<size_t, std::string> Measure(const std::vector<TimedTask>& tasks,
                                      const std::function<void(size_t, const Sample&)>& take,
                                      const std::function<void(double)>& progress);

}  // namespace raybench
