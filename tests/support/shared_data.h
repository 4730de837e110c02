// Data for tests that is not part of the repository; shared by tests.
#pragma once

#include <cstdlib>
#include <filesystem>
#include <string>

#include "tests/support/source_directory.h"

namespace raybench::testing {

/// The folder that the environment variable RAYBENCH_SHARED_DATA names, else ../shared/data beside the
/// sources. It may not exist: tests then say so and skip.
inline std::filesystem::path SharedData() {
  if (const char* folder = std::getenv("RAYBENCH_SHARED_DATA")) return folder;
  return std::filesystem::path(kTestedSource).parent_path() / "shared" / "data";
}

/// What a test that skips for want of one of these files says.
inline std::string NotCompared(const std::filesystem::path& file) {
  return "NOT COMPARED: no " + file.string() +
         ", which is not part of the repository; RAYBENCH_SHARED_DATA names the folder of such files";
}

}  // namespace raybench::testing
