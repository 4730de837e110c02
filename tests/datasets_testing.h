// What the tests of the datasets layer share.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "datasets/scene.h"

namespace raybench {

/// A directory that is removed with everything in it.
class ScratchDirectory {
 public:
  ScratchDirectory() {
    std::string pattern = (std::filesystem::temp_directory_path() / "raybench-test-XXXXXX").string();
    path_ = mkdtemp(pattern.data());
  }
  ~ScratchDirectory() { std::filesystem::remove_all(path_); }
  ScratchDirectory(const ScratchDirectory&) = delete;

  std::string Write(const std::string& name, const std::string& text) const {
    std::ofstream(path_ / name, std::ios::binary) << text;
    return (path_ / name).string();
  }
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

/// The message of the InputError that loading `name` throws; it must be one line and contain the name
/// (less its parameters).
inline std::string LoadError(const std::string& name, const LoadOptions& options = {}) {
  try {
    LoadScene(name, options);
  } catch (const InputError& e) {
    std::string text = e.what();
    EXPECT_EQ(text.find('\n'), text.npos) << text;
    EXPECT_NE(text.find(name.substr(0, name.find('('))), text.npos) << text;
    return text;
  }
  ADD_FAILURE() << name << " loaded without an error";
  return {};
}

/// The corners of triangle i.
inline std::array<Vec3f, 3> Corners(const Scene& scene, size_t i) {
  const std::array<uint32_t, 3>& t = scene.triangles[i];
  return {scene.positions[t[0]], scene.positions[t[1]], scene.positions[t[2]]};
}

}  // namespace raybench
