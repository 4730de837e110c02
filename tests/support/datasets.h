// What the tests of the datasets layer share.
#pragma once

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "accel/base/random.h"
#include "datasets/scene/scene.h"

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

/// Loads `count` seeded mutations of a file; each must load, or throw an InputError of one line that begins
/// with the path. Returns how many were refused.
inline int CountRefusedMutations(const ScratchDirectory& files, const std::string& name,
                                 const std::string& text, int count) {
  static const char kBytes[] = "0123456789-+.e/ \n\t#\"{}[],:\0\xff\x7f nfvOF";
  int refused = 0;
  for (int n = 0; n < count; ++n) {
    Random random(2024, uint64_t(n));
    std::string damaged = text;
    for (uint64_t edits = 1 + random.Below(4); edits > 0 && !damaged.empty(); --edits) {
      size_t at = random.Below(damaged.size());
      switch (random.Below(4)) {
        case 0:
          damaged.erase(at, 1 + random.Below(8));
          break;
        case 1:
          damaged.insert(at, 1, kBytes[random.Below(sizeof kBytes)]);
          break;
        case 2:
          damaged.insert(at, text.substr(random.Below(text.size()), 1 + random.Below(12)));
          break;
        default:
          damaged[at] = kBytes[random.Below(sizeof kBytes)];
      }
    }
    std::string path = files.Write(name, damaged);
    try {
      LoadOptions options;
      options.drop_bad = n % 2 == 1;
      LoadScene(path, options).Geometry();
    } catch (const InputError& e) {
      ++refused;
      std::string message = e.what();
      EXPECT_TRUE(message.starts_with(path + ": ")) << message;
      EXPECT_EQ(message.find('\n'), message.npos) << message;
    }
  }
  return refused;
}

/// The corners of triangle i.
inline std::array<Vec3f, 3> CornersOf(const Scene& scene, size_t i) {
  const std::array<uint32_t, 3>& t = scene.triangles[i];
  return {scene.positions[t[0]], scene.positions[t[1]], scene.positions[t[2]]};
}

}  // namespace raybench
