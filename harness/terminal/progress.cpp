#include "harness/terminal/progress.h"

#include <fmt/format.h>
#include <unistd.h>

namespace raybench {

std::string FormatDuration(double seconds) {
  const long s = long(seconds + 0.5);
  if (s < 60) return fmt::format("{} s", s);
  if (s < 3600) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} h {} min", s / 3600, s / 60 % 60);
}

Progress::Progress(std::FILE* out) : out_(out), terminal_(isatty(fileno(out)) != 0) {}

void Progress::Say(std::string_view line) {
  Clear();
  fmt::print(out_, "{}\n", line);
  std::fflush(out_);
}

double Progress::Elapsed() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

void Progress::Update(double fraction, std::string_view what) {
  if (IsTime()) Draw(fraction, Elapsed() * (1 / fraction - 1), what);
}

void Progress::UpdateLeft(double seconds, std::string_view what) {
  const double elapsed = Elapsed();
  if (IsTime()) Draw(elapsed / (elapsed + seconds), seconds, what);
}

bool Progress::IsTime() {
  const Clock::time_point now = Clock::now();
  if (now - last_ < (terminal_ ? std::chrono::milliseconds(100) : std::chrono::milliseconds(15000)))
    return false;
  last_ = now;
  return true;
}

void Progress::Draw(double fraction, double left, std::string_view what) {
  std::string line = fmt::format("[{:3.0f} %] {}", 100 * fraction, what);
  // Before a twentieth is done the estimate would be a guess.
  if (fraction > 0.05) line += fmt::format(" - about {} left", FormatDuration(left));
  if (!terminal_) {
    fmt::print(out_, "{}\n", line);
  } else {
    fmt::print(out_, "\r{:.110}\x1b[K", line);
    drawn_ = true;
  }
  std::fflush(out_);
}

void Progress::Clear() {
  if (drawn_) fmt::print(out_, "\r\x1b[K");
  drawn_ = false;
  std::fflush(out_);
}

}  // namespace raybench
