// What a run is doing and how long it will take, on stderr.
#pragma once

#include <chrono>
#include <cstdio>
#include <string>
#include <string_view>

namespace raybench {

class Progress {
 public:
  /// On a terminal one line is redrawn; elsewhere a line is printed every 15 seconds at most.
  explicit Progress(std::FILE* out = stderr);
  ~Progress() { Clear(); }
  Progress(const Progress&) = delete;
  Progress& operator=(const Progress&) = delete;

  /// A line that stays.
  void Say(std::string_view line);
  /// `fraction` of the whole run is done, in [0, 1]; `what` is being done now.
  void Update(double fraction, std::string_view what);
  /// The same, where it is known how many seconds are left instead.
  void UpdateLeft(double seconds, std::string_view what);
  /// Seconds since the start.
  double Elapsed() const;
  /// Takes the redrawn line away.
  void Clear();

 private:
  bool IsTime();
  void Draw(double fraction, double left, std::string_view what);

  using Clock = std::chrono::steady_clock;
  std::FILE* out_;
  bool terminal_, drawn_ = false;
  Clock::time_point start_ = Clock::now(), last_ = start_;
};

/// "45 s", "3 min 20 s".
std::string FormatDuration(double seconds);

}  // namespace raybench
