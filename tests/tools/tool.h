// What the tools here have in common.
#pragma once

#include <fmt/format.h>

#include <cstdio>
#include <exception>

namespace raybench {

/// The tool's Main(); an exception becomes one line on stderr and exit code 2.
inline int RunTool(const char* name, int (*run)(int argc, char** argv), int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}: {}\n", name, e.what());
    return 2;
  }
}

}  // namespace raybench
