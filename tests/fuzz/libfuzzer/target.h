// What the targets of libFuzzer share: a finding ends the process, as libFuzzer wants it.
#pragma once

#include <fmt/format.h>
#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>

namespace raybench::fuzz {

/// Says what is wrong and aborts.
[[noreturn]] inline void Broken(const std::string& what) {
  fmt::print(stderr, "broken: {}\n", what);
  std::abort();
}

inline void Demand(bool holds, std::string_view what) {
  if (!holds) Broken(std::string(what));
}

/// Every message is one line of printable text that begins with `where`.
inline void DemandOneLine(std::string_view message, std::string_view where) {
  Demand(message.starts_with(where), fmt::format("message does not begin with '{}': {}", where, message));
  for (const char c : message)
    Demand(static_cast<unsigned char>(c) >= ' ' && c != '\x7f',
           fmt::format("message with a control character: {}", message));
}

/// A file of this process in the folder for temporary files (TMPDIR).
inline std::filesystem::path Written(const std::string& name, std::string_view bytes) {
  static const std::filesystem::path folder = [] {
    const auto path = std::filesystem::temp_directory_path() / fmt::format("raybench-libfuzzer-{}", getpid());
    std::filesystem::create_directories(path);
    return path;
  }();
  const auto path = folder / name;
  std::ofstream(path, std::ios::binary).write(bytes.data(), std::streamsize(bytes.size()));
  return path;
}

inline std::string_view Bytes(const uint8_t* data, size_t size) {
  return {reinterpret_cast<const char*>(data), size};
}

}  // namespace raybench::fuzz
