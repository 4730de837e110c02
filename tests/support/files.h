// Whole files as text; shared by tests.
#pragma once

#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

namespace raybench {

/// Everything in the file; empty if it cannot be read.
inline std::string Read(const std::filesystem::path& path) {
  std::ifstream in(path, std::ios::binary);
  std::ostringstream text;
  text << in.rdbuf();
  return text.str();
}

}  // namespace raybench
