// The raybench command's exit: what went wrong becomes one line and a code.
#include <fmt/format.h>

#include <algorithm>
#include <csignal>
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "harness/cli/command_line.h"
#include "harness/terminal/interrupt.h"

namespace raybench {
namespace {

/// One line, whatever a message holds.
int Fail(const char* message) {
  if (Interrupted()) return 130;
  std::string line = message;
  std::replace(line.begin(), line.end(), '\n', ' ');
  fmt::print(stderr, "raybench: {}\n", line);
  return 2;
}

}  // namespace
}  // namespace raybench

int main(int argc, char** argv) {
  using namespace raybench;
  try {
    std::signal(SIGXFSZ, SIG_IGN);  // a file that may not grow is an error of writing, told as such
    const int code = RunCommandLine({argv, argv + argc});
    if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0)
      return Fail("the output cannot be written: no space left, or closed");
    return code;
  } catch (const InterruptedError&) {
    return 130;
  } catch (const std::bad_alloc&) {
    return Fail("out of memory");
  } catch (const std::exception& error) {
    return Fail(error.what());
  }
}
